"""Maps, and how they grow, in the Rerun viewer: the extra `viz`.

```python
from pyramap import viewer

with viewer.saving("kitchen.rrd") as recorder:  # or viewer.live(), to watch
    for frame in frames:
        grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
        recorder.show_frame(frame)
    recorder.show_map(grid, grid.mesh())
```
"""

from .errors import ViewerError
from .opening import live, saving
from .voxels import MOST_BOXES, Boxes, occupied_boxes

__all__ = ["MOST_BOXES", "Boxes", "ViewerError", "live", "occupied_boxes", "saving"]
