"""A box stands in view and is then taken away: one voxel of it, in a map with a clamp and in one without."""

import numpy as np
import pyramap as pm
from _style import BLUE, GREY, VERMILION, figure, save

FRAMES, TAKEN_AWAY = 60, 24
CAMERA = pm.PinholeCamera(width=32, height=24, fx=30, fy=30, cx=15.5, cy=11.5)
WALL, BOX = 3.0, 2.0
VOXEL = [[0.01, 0.01, BOX - 0.01]]

drawn = figure(3.2)
axes = drawn.subplots()
for clamp, colour, name in ((None, VERMILION, "no clamp: counts everything"), ((-2.0, 3.5), BLUE, "clamp=(-2.0, 3.5)")):
    grid = pm.OccupancyGrid(voxel_size=0.05, backend="cpu", clamp=clamp)
    evidence = []
    for frame in range(FRAMES):
        depth = np.full((24, 32), BOX if frame < TAKEN_AWAY else WALL, np.float32)
        grid.integrate(depth, CAMERA, np.eye(4))
        evidence.append(grid.log_odds(VOXEL)[0])
    axes.plot(range(1, FRAMES + 1), evidence, color=colour, label=name)
axes.axhline(0, color=GREY, lw=0.8)
axes.axvline(TAKEN_AWAY, color=GREY, ls="--", lw=1)
axes.text(TAKEN_AWAY + 0.7, 12, "the box is taken away", color="#555555")
axes.set(xlabel="frames", ylabel="log-odds of a voxel of the box")
axes.legend(loc="upper right")
save(drawn)
