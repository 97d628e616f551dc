"""Occupied voxels as boxes, no more of them than a viewer can turn smoothly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._core import OccupancyGrid

MOST_BOXES = 60_000
"""More are gathered into larger ones: Rerun leaves out what exceeds this number."""

_SIDES = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))


@dataclass(frozen=True)
class Boxes:
    """Cubes of one size.

    Attributes:
        centres: (N, 3) float32, metres.
        edge: Metres: the voxel size, or 2, 4, ... times that.
        colours: (N, 3) uint8: the height, from dark blue to yellow.
    """

    centres: NDArray[np.float32]
    edge: float
    colours: NDArray[np.uint8]


def occupied_boxes(grid: OccupancyGrid, up: ArrayLike = (0, 0, 1), at_most: int = MOST_BOXES) -> Boxes:
    """The occupied voxels of a map that can be seen; if there are too many, cubes of 2, 4, ... voxels that hold any.

    A voxel between six occupied ones cannot be seen, and is left out.

    Args:
        grid: The map.
        up: (3,) direction along which the height is measured.
        at_most: How many boxes there may be, at least 1.
    """
    voxels, edge = grid.occupied_voxels(), 1
    while len(visible := _visible(voxels)) > at_most:
        voxels, edge = np.floor_divide(voxels, 2), 2 * edge
    centres = (visible + 0.5) * (edge * grid.voxel_size)
    return Boxes(centres.astype(np.float32), edge * grid.voxel_size, _height_colours(centres @ np.asarray(up)))


def _visible(cells: NDArray[np.int32]) -> NDArray[np.int64]:
    """The different rows of cells of which not all six neighbours are among them."""
    if len(cells) == 0:
        return cells.astype(np.int64)
    # As one number each, cells are sorted and looked up many times faster than as rows. A margin of one cell all round
    # keeps the numbers of neighbours from running over into the next row.
    low = cells.min(axis=0).astype(np.int64) - 1
    spans = tuple(int(span) for span in cells.max(axis=0) - low + 2)
    numbers = np.unique(np.ravel_multi_index(tuple((cells - low).T), spans))
    steps = (int(np.dot(side, (spans[1] * spans[2], spans[2], 1))) for side in _SIDES)
    hidden = np.logical_and.reduce([np.isin(numbers + step, numbers, assume_unique=True) for step in steps])
    return np.asarray(np.stack(np.unravel_index(numbers[~hidden], spans), axis=1) + low)


def _height_colours(heights: NDArray[np.float64]) -> NDArray[np.uint8]:
    """(N, 3); the scale runs over all but the lowest and highest hundredth, which stray readings may be."""
    # Matplotlib takes a while to load: only who draws waits for it.
    from matplotlib import colormaps

    if len(heights) == 0:
        return np.empty((0, 3), dtype=np.uint8)
    low, high = np.percentile(heights, [1, 99])
    # Viridis grows evenly in lightness: it reads the same with any colour vision.
    shades = colormaps["viridis"](np.clip((heights - low) / max(high - low, 1e-9), 0, 1))
    return np.asarray(np.round(255 * shades[:, :3]), dtype=np.uint8)
