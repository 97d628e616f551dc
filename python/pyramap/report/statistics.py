"""What a map holds, counted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._core import OccupancyGrid

_BLOCKS_AT_ONCE = 8192
"""Bounds the memory of counting: 16 MB of log-odds."""
_LIMIT = 12.0
"""Log-odds at the ends of the histogram: 6 in a million against it."""
_BINS = 96


@dataclass(frozen=True)
class Statistics:
    """Counts of voxels.

    Attributes:
        free: More likely free than occupied.
        occupied: More likely occupied.
        unknown: Never seen, within the bounds of the map.
        voxel_volume: Cubic metres of each.
        edges: (B + 1,) log-odds between the bins of the histogram.
        counts: (B,) known voxels in each bin; what is beyond the edges is in the first and the last.
    """

    free: int
    occupied: int
    unknown: int
    voxel_volume: float
    edges: NDArray[np.float64]
    counts: NDArray[np.int64]


def known_log_odds(grid: OccupancyGrid) -> Iterator[NDArray[np.float32]]:
    """(N,) log-odds of all known voxels, in parts."""
    blocks = grid.block_coords()
    for start in range(0, len(blocks), _BLOCKS_AT_ONCE):
        log_odds = grid.block_log_odds(blocks[start : start + _BLOCKS_AT_ONCE])
        yield log_odds[log_odds != 0]


def count(grid: OccupancyGrid) -> Statistics:
    """Count the voxels of a map."""
    edges = np.linspace(-_LIMIT, _LIMIT, _BINS + 1)
    counts = np.zeros(_BINS, dtype=np.int64)
    occupied = 0
    for known in known_log_odds(grid):
        occupied += int(np.count_nonzero(known > 0))
        # The outermost bins are closed: what lies beyond must be inside them.
        counts += np.histogram(np.clip(known, -_LIMIT, _LIMIT), edges)[0]
    size = grid.voxel_size
    spans = np.zeros(3) if grid.bounds is None else np.round((grid.bounds[1] - grid.bounds[0]) / size)
    known_voxels = grid.num_observed
    return Statistics(known_voxels - occupied, occupied, int(np.prod(spans)) - known_voxels, size**3, edges, counts)
