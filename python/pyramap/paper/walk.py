"""The walk through the simulated office, mapped at several resolutions: for Figure 7 and Table 1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Literal, TypeAlias

from .. import OccupancyGrid, SensorModel, num_threads, scenes
from ..datasets import Frame
from .effort import Effort

Backend: TypeAlias = Literal["auto", "cpu", "gpu"]

NOISE_SEED = 1
FRAMES = 684
"""Of the whole walk, as in the paper."""
MAX_RANGE = 5.0
"""Of a Kinect, metres."""


@dataclass(frozen=True)
class Run:
    """One map of the walk.

    Attributes:
        grid: The map.
        seconds: That all calls of `integrate` took together.
    """

    grid: OccupancyGrid
    seconds: float


@dataclass(frozen=True)
class Walk:
    """All maps.

    Attributes:
        scene: The office.
        frames: The images that were mapped, with the noise of a Kinect.
        runs: The finest first.
        threads: Of the CPU.
    """

    scene: scenes.Scene
    frames: Sequence[Frame]
    runs: list[Run]
    threads: int


def compute(effort: Effort, backend: Backend) -> Walk:
    """Render each image once, and fuse it into the map of each resolution."""
    scene = scenes.office_loop()
    frames = scene.frames(noise=NOISE_SEED)[:: effort.office_stride]
    grids = [
        OccupancyGrid(size, SensorModel(size, k=size), max_range=MAX_RANGE, backend=backend)
        for size in effort.voxel_sizes
    ]
    seconds = [0.0] * len(grids)
    for frame in frames:
        for i, grid in enumerate(grids):
            start = perf_counter()
            grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
            seconds[i] += perf_counter() - start
    runs = [Run(grid, time) for grid, time in zip(grids, seconds, strict=True)]
    return Walk(scene, frames, runs, num_threads())
