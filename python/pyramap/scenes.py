"""Simulated scenes whose every surface is known exactly.

```python
scene = pyramap.scenes.office_loop()
for frame in scene.frames(noise=1):
    grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
error = scene.signed_distance(grid.mesh().vertices)
```
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np
from numpy.typing import NDArray

from . import _core
from .datasets import Frame

__all__ = ["Scene", "SceneFrames", "box", "office_loop", "spheres"]

FRAMES_PER_SECOND = 30.0
"""Of the Kinect: the times of the frames follow from it."""


class Scene(_core.Scene):
    """Solid boxes, balls and cylinders in a room, a camera, and the poses from which it looks.

    `box()`, `spheres()` and `office_loop()` make the three there are.

    Args:
        name: "box", "spheres" or "office_loop".

    Raises:
        ValueError: If there is no such scene.
    """

    def frames(self, noise: int | None = None) -> SceneFrames:
        """The views in the order of the poses, as a data set gives its frames; each is rendered when asked for.

        Args:
            noise: None for exact depth; an integer for that of a Kinect, the seed of frame `i` being `noise + i`.
        """
        return SceneFrames(self, noise, range(len(self.poses())))


class SceneFrames(Sequence[Frame]):
    """The frames of a scene: iterate, take `frames[7]`, or slice: `frames[::10]` are frames again."""

    def __init__(self, scene: Scene, noise: int | None, indices: range) -> None:
        self._scene = scene
        self._noise = noise
        self._indices = indices
        self._poses: NDArray[np.float64] = scene.poses()

    def __len__(self) -> int:
        """How many frames there are."""
        return len(self._indices)

    @overload
    def __getitem__(self, key: int) -> Frame: ...
    @overload
    def __getitem__(self, key: slice) -> SceneFrames: ...
    def __getitem__(self, key: int | slice) -> Frame | SceneFrames:
        """Frame number `key`, rendered now; or a part, not rendered."""
        if isinstance(key, slice):
            return SceneFrames(self._scene, self._noise, self._indices[key])
        index = self._indices[key]
        camera, pose = self._scene.camera, self._poses[index]
        seed = None if self._noise is None else self._noise + index
        return Frame(
            index=index,
            depth=self._scene.render(camera, pose, seed),
            camera=camera,
            world_from_camera=pose,
            timestamp=index / FRAMES_PER_SECOND,
        )


def box() -> Scene:
    """The paper's BOX: a room of 10.8 x 8.3 x 11.2 m (x, y, z) with six cubes of 1 m at different depths.

    181 views of 400 x 400 pixels (f = 400) from one place: the start, a turn about the camera's x axis in 90 steps of
    4 degrees, and one about its y axis. The world's axes are those of the first view: x right, y down, z forward.
    """
    return Scene("box")


def spheres() -> Scene:
    """The paper's SPHERES: a room of 2.2 x 2.1 x 2 m with a box and four spheres. Views and axes as in `box`."""
    return Scene("spheres")


def office_loop() -> Scene:
    """Corridors of 2 m width and a large meeting room, furnished, walked in a closed loop of 60 m.

    684 views of 640 x 480 pixels (a Kinect's f = 585) from 1.45 m height, never nearer than 0.3 m to anything.
    The world's x and y lie on the floor, z points up, the ceiling is at 2.7 m.
    """
    return Scene("office_loop")
