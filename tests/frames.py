"""Small random frames, and maps of them, for tests of what a map does with frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyramap as pm
from numpy.typing import NDArray

CAMERA = pm.PinholeCamera(width=64, height=48, fx=55.0, fy=57.0, cx=31.2, cy=23.9)
IDENTITY = np.eye(4)
VOXEL_SIZE = 0.05
MAX_RANGE = 3.0


class Frame(NamedTuple):
    """The arguments of `integrate` and `remove`."""

    depth: NDArray[np.float32]
    camera: pm.PinholeCamera
    world_from_camera: NDArray[np.float64]


def make_grid(**options: Any) -> pm.OccupancyGrid:
    """An empty map of 5 cm voxels up to 3 m."""
    return pm.OccupancyGrid(**{"voxel_size": VOXEL_SIZE, "max_range": MAX_RANGE, **options})


def map_of(frames: list[Frame], **options: Any) -> pm.OccupancyGrid:
    grid = make_grid(**options)
    for frame in frames:
        grid.integrate(*frame)
    return grid


def map_bytes(grid: pm.OccupancyGrid, folder: Path) -> bytes:
    """The file of a map: equal maps, and only those, have equal bytes."""
    path = folder / "bytes.pmap"
    grid.save(path)
    return path.read_bytes()


def wall(distance: float) -> Frame:
    """A wall across the whole view, seen from the origin along z."""
    return Frame(np.full((CAMERA.height, CAMERA.width), distance, np.float32), CAMERA, IDENTITY)


def random_frames(count: int, seed: int) -> list[Frame]:
    """Slanted walls with boxes before them, noise and every kind of reading, from places around the origin."""
    rng = np.random.default_rng(seed)
    return [Frame(random_depth(rng), CAMERA, random_pose(rng)) for _ in range(count)]


def random_depth(rng: np.random.Generator) -> NDArray[np.float32]:
    height, width = CAMERA.height, CAMERA.width
    v, u = np.mgrid[:height, :width]
    slope_u, slope_v = rng.uniform(-0.5, 0.5, 2)
    depth: NDArray[np.float64] = rng.uniform(1.0, 2.0) + slope_u * u / width + slope_v * v / height
    for reading in (*rng.uniform(0.4, 2.5, 3), 0.0, np.nan, -1.0, np.inf, 2 * MAX_RANGE):
        top, left = rng.integers(0, height - 8), rng.integers(0, width - 8)
        depth[top : top + rng.integers(4, 20), left : left + rng.integers(4, 20)] = reading
    depth += 0.01 * rng.standard_normal(depth.shape)
    return depth.astype(np.float32)


def random_pose(rng: np.random.Generator) -> NDArray[np.float64]:
    rotation, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    rotation[:, 0] *= np.linalg.det(rotation)
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = rng.uniform(-1, 1, 3)
    return pose
