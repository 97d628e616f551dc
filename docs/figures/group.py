"""Two maps, their sum, and the sum less the frames of the first."""

import numpy as np
import pyramap as pm
from _style import draw_slice, figure, save

frames = pm.scenes.office_loop().frames()
first, second = frames[300:312:4], frames[330:342:4]
HEIGHT = 1.2


def mapped(*parts: pm.scenes.SceneFrames) -> pm.OccupancyGrid:
    """The map of some frames."""
    grid = pm.OccupancyGrid(voxel_size=0.1, backend="cpu")
    for part in parts:
        for frame in part:
            grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
    return grid


merged = mapped(first)
merged.merge(mapped(second))
less = mapped(first)
less.merge(mapped(second))
for frame in first:
    less.remove(frame.depth, frame.camera, frame.world_from_camera)

drawn = figure(2.6)
panels = drawn.subplots(1, 4, sharex=True, sharey=True)
maps = {"A": mapped(first), "B": mapped(second), "A merged with B": merged, "less the frames of A": less}
assert merged.bounds is not None
low, high = merged.bounds
for axes, (name, grid) in zip(panels, maps.items(), strict=True):
    draw_slice(axes, grid, HEIGHT)
    axes.set_title(name, fontsize=10)
    axes.label_outer()
panels[0].set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
blocks = maps["B"].block_coords()
assert np.array_equal(less.block_log_odds(blocks), maps["B"].block_log_odds(blocks)), "not exact"
save(drawn)
