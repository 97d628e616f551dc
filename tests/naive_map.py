"""A map as one dense array of states, and what a naive program finds in it by looking at every voxel."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
import pyramap as pm
from numpy.typing import NDArray

Floats = NDArray[np.float64]
UNKNOWN, FREE, OCCUPIED = -1, 0, 1
_T = TypeVar("_T", bound=np.generic)


class DenseMap(NamedTuple):
    """States of all voxels of a box; whatever lies outside is unknown."""

    states: NDArray[np.int8]
    log_odds: NDArray[np.float32]
    first: NDArray[np.int64]
    voxel_size: float

    def state(self, voxels: NDArray[np.int64]) -> NDArray[np.int8]:
        """Of voxels by their indices, (..., 3)."""
        return look_up(self.states, voxels - self.first, UNKNOWN)

    def values(self, voxels: NDArray[np.int64]) -> NDArray[np.float32]:
        """Log-odds of voxels by their indices, (..., 3)."""
        return look_up(self.log_odds, voxels - self.first, 0)


def look_up(array: NDArray[_T], at: NDArray[np.int64], outside: int) -> NDArray[_T]:
    inside = np.all((at >= 0) & (at < array.shape), axis=-1)
    x, y, z = np.moveaxis(np.where(inside[..., None], at, 0), -1, 0)
    found: NDArray[_T] = np.where(inside, array[x, y, z], array.dtype.type(outside))
    return found


def dense_map(grid: pm.OccupancyGrid) -> DenseMap:
    """Put together out of the map's blocks, one after the other, with a border of unknown voxels."""
    coords = grid.block_coords()
    low, high = coords.min(axis=0) - 1, coords.max(axis=0) + 2
    values = np.zeros(8 * (high - low), np.float32)
    for (x, y, z), block in zip(8 * (coords - low), grid.block_log_odds(coords), strict=True):
        values[x : x + 8, y : y + 8, z : z + 8] = block
    states = np.where(values == 0, UNKNOWN, np.where(values > 0, OCCUPIED, FREE)).astype(np.int8)
    return DenseMap(states, values, 8 * low.astype(np.int64), grid.voxel_size)
