"""Decoded frames in a file that every process reads: plain arrays, so that no process imports what it does not time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

MAX_RANGE = 5.0
"""Metres; readings beyond it say nothing about surfaces in any of the systems."""


class Frame(NamedTuple):
    """A depth image (H, W) float32 in metres, 0 where nothing was read, its intrinsics (3, 3) and its pose (4, 4)."""

    depth: NDArray[np.float32]
    intrinsics: NDArray[np.float64]
    world_from_camera: NDArray[np.float64]


@dataclass(frozen=True)
class FrameFile:
    """The frames of one data set in one file of raw depth.

    It is read, not mapped into memory: mapped pages would count as memory of the system that is measured.

    Attributes:
        name: Of the data set.
        path: The depth images, one after the other.
        poses: (N, 4, 4) world_from_camera.
    """

    name: str
    path: Path
    shape: tuple[int, int]
    intrinsics: NDArray[np.float64]
    poses: NDArray[np.float64]

    def __len__(self) -> int:
        """How many frames there are."""
        return len(self.poses)

    def __getitem__(self, index: int) -> Frame:
        """Frame number `index`, read now."""
        pixels = self.shape[0] * self.shape[1]
        depth = np.fromfile(self.path, np.float32, pixels, offset=index * pixels * np.float32().itemsize)
        return Frame(depth.reshape(self.shape), self.intrinsics, self.poses[index])


def write(name: str, frames: Iterable[Frame], path: Path) -> FrameFile:
    """Writes frames of one camera, one at a time, to a file of their own."""
    poses = []
    with path.open("wb") as file:
        for frame in frames:
            file.write(np.ascontiguousarray(frame.depth).data)
            poses.append(frame.world_from_camera)
    height, width = frame.depth.shape
    return FrameFile(name, path, (height, width), frame.intrinsics, np.array(poses))
