"""What each kind of reading says: an image of stripes, and the map that comes of it, from above."""

from typing import Literal

import numpy as np
import pyramap as pm
from _style import draw_slice, figure, save, world_from_camera
from matplotlib.colors import to_hex
from matplotlib.patches import Patch
from pyramap.pictures.slice_drawing import COLOURS, UNKNOWN

CAMERA = pm.PinholeCamera(width=250, height=20, fx=140, fy=140, cx=124.5, cy=9.5)
MAX_RANGE = 3.0
STRIPES = {"2.0": 2.0, "0, NaN, negative": 0.0, "inf": np.inf, "7.0": 7.0, "1.5": 1.5}

depth = np.repeat(np.array([list(STRIPES.values())], np.float32), CAMERA.width // len(STRIPES), axis=1)
depth = np.repeat(depth, CAMERA.height, axis=0)

drawn = figure(4.0)
panels = drawn.subplots(1, 2, sharey=True)
choices: tuple[Literal["free", "ignore"], ...] = ("free", "ignore")
for axes, beyond in zip(panels, choices, strict=True):
    grid = pm.OccupancyGrid(voxel_size=0.02, max_range=MAX_RANGE, beyond_max_range=beyond, backend="cpu")
    grid.integrate(depth, CAMERA, world_from_camera(np.pi / 2, (0, 0, 0)))
    draw_slice(axes, grid, height=0.0)
    angles = (np.arange(len(STRIPES)) - 2) * 50 / CAMERA.fx
    for name, tangent in zip(STRIPES, angles, strict=True):
        slope = np.degrees(np.arctan2(1.0, tangent))
        upright = slope if slope <= 90 else slope - 180
        axes.text(1.2 * tangent, 1.2, name, ha="center", va="center", fontsize=7.5, rotation=upright)
    axes.set(xlim=(-2.1, 2.1), ylim=(0, 3.2), title=f'beyond_max_range="{beyond}", max_range={MAX_RANGE:g}')
    axes.title.set_fontsize(9)
    axes.label_outer()
states = {"free": to_hex(COLOURS(0.1)), "occupied": to_hex(COLOURS(0.9)), "unknown": UNKNOWN}
patches = [Patch(facecolor=colour, edgecolor="#666666", label=name) for name, colour in states.items()]
drawn.legend(handles=patches, loc="outside lower center", ncols=3, frameon=False)
save(drawn)
