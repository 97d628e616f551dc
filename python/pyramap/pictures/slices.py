"""Picture of an axis-aligned plane through a map: free, occupied and unknown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._core import OccupancyGrid

AXES = "xyz"
BLOCK = 8
"""Voxels along the edge of a block, as `OccupancyGrid.block_log_odds` returns them."""

_LONGEST_SIDE = 2000
"""Most cells along a side of a slice; more voxels than that are gathered into cells."""
_BLOCKS_AT_ONCE = 4096
"""Bounds the memory of reading: 8 MB of log-odds."""


@dataclass(frozen=True)
class Slice:
    """One layer of voxels.

    Attributes:
        log_odds: (rows, columns) float32, NaN where unknown; columns run along `across`, rows along `upward`.
        origin: World coordinates of the lower corner of cell (0, 0) along `across` and `upward`, metres.
        cell: Edge of a cell in metres: the voxel size, or a multiple of it.
        axis: Axis that the slice is perpendicular to: 0, 1, 2 for x, y, z.
        at: Where the layer's centre lies on that axis, metres.
    """

    log_odds: NDArray[np.float32]
    origin: tuple[float, float]
    cell: float
    axis: int
    at: float

    @property
    def across(self) -> int:
        """Axis that runs to the right."""
        return 1 if self.axis == 0 else 0

    @property
    def upward(self) -> int:
        """Axis that runs upwards."""
        return 1 if self.axis == 2 else 2


def cut(grid: OccupancyGrid, axis: int, at: float) -> Slice:
    """Read the layer of voxels that contains the plane `axis = at`.

    Where the layer is longer than 2000 voxels, cells of n x n voxels stand for it, each with the log-odds of its most
    occupied known voxel, so that thin walls stay.

    Args:
        grid: The map.
        axis: 0, 1 or 2 for x, y or z.
        at: Position of the plane, metres.

    Raises:
        ValueError: `axis` is none of the three, or the plane meets no block of the map.
    """
    if axis not in (0, 1, 2):
        raise ValueError(f"axis must be 0, 1 or 2 for x, y or z, got {axis!r}")
    layer = int(np.floor(at / grid.voxel_size))
    met = _blocks_at(grid, axis, layer)
    across, upward = (other for other in range(3) if other != axis)
    plane = [upward, across]
    first = met[:, plane].min(axis=0).astype(np.int64) * BLOCK
    voxels = (met[:, plane].max(axis=0) + 1) * BLOCK - first
    stride = -(-int(voxels.max()) // _LONGEST_SIDE)
    cells = np.full(-(-voxels // stride), np.nan, dtype=np.float32)
    for start in range(0, len(met), _BLOCKS_AT_ONCE):
        some = met[start : start + _BLOCKS_AT_ONCE]
        log_odds = np.take(grid.block_log_odds(some), layer % BLOCK, axis=axis + 1)
        log_odds = np.where(log_odds == 0, np.float32(np.nan), log_odds).swapaxes(1, 2)  # rows run upward
        rows, columns = ((some[:, plane] * BLOCK - first)[..., None] + np.arange(BLOCK)).swapaxes(0, 1) // stride
        np.fmax.at(cells, (rows[:, :, None], columns[:, None, :]), log_odds)
    cells, corner = _trim(cells)
    row_start, column_start = (first + corner * stride) * grid.voxel_size
    return Slice(
        log_odds=cells,
        origin=(float(column_start), float(row_start)),
        cell=grid.voxel_size * stride,
        axis=axis,
        at=(layer + 0.5) * grid.voxel_size,
    )


def _blocks_at(grid: OccupancyGrid, axis: int, layer: int) -> NDArray[np.int32]:
    """(B, 3) coordinates of the blocks that hold a layer of voxels."""
    blocks = grid.block_coords()
    if len(blocks) == 0:
        raise ValueError("the map is empty: there is nothing to slice")
    met: NDArray[np.int32] = blocks[blocks[:, axis] == layer // BLOCK]
    if len(met) == 0:
        edge = BLOCK * grid.voxel_size
        low, high = blocks[:, axis].min() * edge, (blocks[:, axis].max() + 1) * edge
        raise ValueError(
            f"no block of the map meets {AXES[axis]} = {layer * grid.voxel_size:g} m: "
            f"the map spans {low:g} to {high:g} m there"
        )
    return met


def slice_image(layer: Slice) -> NDArray[np.uint8]:
    """Draw a slice with axes in metres, a scale of probability and a legend that names the three states.

    Returns:
        (height, width, 3) uint8 image.
    """
    # Matplotlib takes half a second to load: only who draws a slice waits for it.
    from .slice_drawing import draw

    return draw(layer)


def _trim(cells: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """The part of the cells that holds all known ones, and the indices of its first; all, if none is known."""
    known = ~np.isnan(cells)
    spans = []
    for axis in (0, 1):
        used = np.flatnonzero(known.any(axis=1 - axis))
        spans.append((used[0], used[-1] + 1) if len(used) else (0, cells.shape[axis]))
    (top, bottom), (first, last) = spans
    return cells[top:bottom, first:last], np.array([top, first])
