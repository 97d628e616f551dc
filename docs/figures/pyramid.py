"""The first layers of a range pyramid, each with the distance that it belongs to."""

import numpy as np
import pyramap as pm
from _style import figure, save

VOXEL_SIZE, LAYERS = 0.02, (0, 2, 4, 5)
frame = pm.scenes.office_loop().frames(noise=1)[330]
camera = frame.camera
layers = pm.pyramid(frame.depth, camera, VOXEL_SIZE)
t_0 = np.sqrt(camera.fx * camera.fy) * VOXEL_SIZE

drawn = figure(2.1)
for axes, i in zip(drawn.subplots(1, len(LAYERS)), LAYERS, strict=True):
    ranges = np.where(layers[i] > 0, layers[i], np.nan)
    image = axes.imshow(ranges, cmap="viridis", vmin=0, vmax=8, interpolation="nearest")
    image.cmap.set_bad("#d9d9d9")
    height, width = layers[i].shape
    axes.set_title(f"layer {i}, $t_{i}$ = {t_0 / 2**i:.2f} m\n{width} x {height}", fontsize=9)
    axes.set(xticks=[], yticks=[])
drawn.colorbar(image, ax=drawn.axes, label="range (m)", shrink=0.8)
save(drawn)
