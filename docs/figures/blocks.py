"""One frame's map with the blocks that it is stored in: free throughout, or dense."""

import numpy as np
import pyramap as pm
from _style import BLUE, VERMILION, draw_slice, figure, save
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

HEIGHT, BLOCK = 1.3, 8
frame = pm.scenes.office_loop().frames()[306]
grid = pm.OccupancyGrid(voxel_size=0.025, backend="cpu")
stats = grid.integrate(frame.depth, frame.camera, frame.world_from_camera)

drawn = figure(4.6)
axes = drawn.subplots()
draw_slice(axes, grid, HEIGHT)
edge = BLOCK * grid.voxel_size
coords = grid.block_coords()
coords = coords[coords[:, 2] == int(HEIGHT / edge)]
values = grid.block_log_odds(coords).reshape(len(coords), -1)
is_uniform = np.ptp(values, axis=1) == 0
for uniform in (True, False):
    for a, b, _ in coords[is_uniform == uniform]:
        colour = BLUE if uniform else VERMILION
        axes.add_patch(Rectangle((a * edge, b * edge), edge, edge, fill=False, edgecolor=colour, lw=0.9))
u, v = frame.world_from_camera[:2, 3]
axes.plot(u, v, "k^", ms=8)
names = {
    f"free throughout: one number a block ({stats.blocks_free} of the frame's blocks)": BLUE,
    f"mixed: 512 voxels ({stats.blocks_mixed})": VERMILION,
}
handles = [Line2D([], [], color=colour, marker="s", mfc="none", ls="", label=name) for name, colour in names.items()]
handles.append(Line2D([], [], color="black", marker="^", ls="", label="the camera"))
drawn.legend(handles=handles, loc="outside lower center", frameon=False, fontsize=9)
low, high = coords.min(axis=0) * edge - 0.3, (coords.max(axis=0) + 1) * edge + 0.3
axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
save(drawn)
