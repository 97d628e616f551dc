"""Planes through a map: free, occupied and unknown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._core import OccupancyGrid
from .planes import Plane, axis_plane

BLOCK = 8
"""Voxels along the edge of a block, as `OccupancyGrid.block_coords` counts them."""

_LONGEST_SIDE = 2000
"""Most cells along a side of a slice; more voxels than that are gathered into cells."""
_POINTS_AT_ONCE = 1_000_000
"""Bounds the memory of reading: 24 MB of points."""

Values = NDArray[np.float32]
Read = Callable[[NDArray[np.float64]], Values]
"""(N, 3) points to (N,) float32 values, NaN where unknown."""


@dataclass(frozen=True)
class Slice:
    """What a map answers on a plane.

    Attributes:
        log_odds: (rows, columns) float32, NaN where unknown; columns run to the right, rows upward.
        origin: Coordinates in the plane of the lower left corner of cell (0, 0), metres: to the right, and upward.
        cell: Edge of a cell in metres: the voxel size, or a multiple of it.
        plane: Where it lies.
    """

    log_odds: Values
    origin: tuple[float, float]
    cell: float
    plane: Plane

    @property
    def at(self) -> float:
        """Signed distance of the plane from the world's origin, metres: of an axis's plane, the position there."""
        return self.plane.at


def cut(grid: OccupancyGrid, axis: int, at: float) -> Slice:
    """Read the layer of voxels that contains the plane `axis = at`; see `cut_plane`.

    Args:
        grid: The map.
        axis: 0, 1 or 2 for x, y or z.
        at: Position of the plane, metres.

    Raises:
        ValueError: `axis` is none of the three, or the plane meets no block of the map.
    """
    return cut_plane(grid, layer_plane(grid.voxel_size, axis, at))


def layer_plane(voxel_size: float, axis: int, at: float) -> Plane:
    """The plane through the centres of the layer of voxels that contains `axis = at`.

    Args:
        voxel_size: Metres.
        axis: 0, 1 or 2 for x, y or z.
        at: Metres.

    Raises:
        ValueError: `axis` is none of the three.
    """
    return axis_plane(axis, (np.floor(at / voxel_size) + 0.5) * voxel_size)


def cut_plane(grid: OccupancyGrid, plane: Plane) -> Slice:
    """Read a map on any plane, at points that lie a voxel apart: each shows the voxel that it lies in.

    Where the map is longer than 2000 voxels, cells of n x n points stand for it, each with the log-odds of its most
    occupied known voxel, so that thin walls stay.

    Args:
        grid: The map.
        plane: Such as `plane_through` makes.

    Raises:
        ValueError: The plane meets no block of the map.
    """

    def known_log_odds(points: NDArray[np.float64]) -> Values:
        return np.where(grid.state(points) < 0, np.float32(np.nan), grid.log_odds(points))

    return _read_plane([grid], plane, known_log_odds, np.fmax.reduce)


def cut_difference(before: OccupancyGrid, after: OccupancyGrid, plane: Plane) -> Slice:
    """Read on a plane by how much the log-odds of two maps of one voxel size differ: `after` minus `before`.

    A voxel that only one of them knows counts as no evidence in the other; one that neither knows is NaN. Where cells
    stand for several voxels, each has the largest difference of either sign.

    Args:
        before: One map.
        after: The other.
        plane: Such as `plane_through` makes.

    Raises:
        ValueError: The voxel sizes differ, or the plane meets no block of either map.
    """
    if before.voxel_size != after.voxel_size:
        raise ValueError(f"voxels of {before.voxel_size:g} m and of {after.voxel_size:g} m cannot be compared")

    def difference(points: NDArray[np.float64]) -> Values:
        neither = (before.state(points) < 0) & (after.state(points) < 0)
        return np.where(neither, np.float32(np.nan), after.log_odds(points) - before.log_odds(points))

    return _read_plane([before, after], plane, difference, _largest)


def slice_image(layer: Slice) -> NDArray[np.uint8]:
    """Draw a slice with axes in metres, a scale of probability and a legend that names the three states.

    Returns:
        (height, width, 3) uint8 image.
    """
    # Matplotlib takes half a second to load: only who draws a slice waits for it.
    from .slice_drawing import draw

    return draw(layer)


def difference_image(layer: Slice) -> NDArray[np.uint8]:
    """Draw what `cut_difference` read, with axes in metres, a scale of log-odds and a legend.

    Returns:
        (height, width, 3) uint8 image.
    """
    from .slice_drawing import draw_difference

    return draw_difference(layer)


def _read_plane(grids: Sequence[OccupancyGrid], plane: Plane, read: Read, gather: Callable[..., Values]) -> Slice:
    """Read all that maps hold on a plane; `gather` reduces an axis of the values to the one that stands for them."""
    step = grids[0].voxel_size
    low, high = _extent(np.concatenate([grid.block_coords() for grid in grids]), step, plane)
    stride = -(-int(np.max(high - low)) // _LONGEST_SIDE)
    columns, rows = -(-(high - low) // stride)
    right = (low[0] + np.arange(columns * stride) + 0.5) * step
    strip = max(1, _POINTS_AT_ONCE // (len(right) * stride))
    cells = np.empty((rows, columns), dtype=np.float32)
    for top in range(0, rows, strip):
        some = slice(top, min(top + strip, rows))
        upward = (low[1] + np.arange(some.start * stride, some.stop * stride) + 0.5) * step
        values = read(plane.points(right, upward).reshape(-1, 3)).reshape(len(upward), -1)
        cells[some] = gather(
            gather(values.reshape(-1, stride, len(right)), axis=1).reshape(-1, columns, stride), axis=2
        )
    cells, corner = _trim(cells)
    column_start, row_start = (low + corner * stride) * step
    return Slice(cells, (float(column_start), float(row_start)), step * stride, plane)


def _extent(blocks: NDArray[np.int32], step: float, plane: Plane) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The part of a plane that blocks meet, in steps to the right and upward: the first, and that behind the last."""
    if len(blocks) == 0:
        raise ValueError("the map is empty: there is nothing to slice")
    edge = BLOCK * step
    centres = (blocks + 0.5) * edge - plane.origin
    directions = np.stack([plane.right, plane.upward, plane.normal])
    along = centres @ directions.T
    # How far a cube reaches from its centre in each direction.
    reach = edge / 2 * np.abs(directions).sum(axis=1)
    met = along[np.abs(along[:, 2]) <= reach[2], :2]
    if len(met) == 0:
        low, high = along[:, 2].min() - reach[2] + plane.at, along[:, 2].max() + reach[2] + plane.at
        where = plane.title if plane.axis is not None else f"the plane {plane.title}, {plane.at:g} m along it"
        raise ValueError(f"no block of the map meets {where}: the map spans {low:g} to {high:g} m there")
    low = np.floor((met.min(axis=0) - reach[:2]) / step).astype(np.int64)
    high = np.ceil((met.max(axis=0) + reach[:2]) / step).astype(np.int64)
    return low, high


def _largest(values: Values, axis: int) -> Values:
    """Along an axis, the known value that is farthest from 0."""
    highest, lowest = np.fmax.reduce(values, axis=axis), np.fmin.reduce(values, axis=axis)
    return np.asarray(np.where(highest > -lowest, highest, lowest))


def _trim(cells: Values) -> tuple[Values, NDArray[np.int64]]:
    """The part of the cells that holds all known ones, and the column and row of its first; all, if none is known."""
    known = ~np.isnan(cells)
    spans = []
    for axis in (0, 1):
        used = np.flatnonzero(known.any(axis=1 - axis))
        spans.append((used[0], used[-1] + 1) if len(used) else (0, cells.shape[axis]))
    (bottom, top), (first, last) = spans
    return cells[bottom:top, first:last], np.array([first, bottom])
