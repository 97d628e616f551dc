"""Picture of an axis-aligned plane through a map: free, occupied and unknown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from .._core import OccupancyGrid

AXES = "xyz"
BLOCK = 8
"""Voxels along the edge of a block, as `OccupancyGrid.block_log_odds` returns them."""

UNKNOWN = "#d9d9d9"
COLOURS = LinearSegmentedColormap.from_list("occupancy", ["#4393c3", "#a6cee9", "#fdf3c4", "#d9601a", "#7a1a04"])
"""Probability 0 to 1: blue is free, pale is undecided, dark red is occupied; told apart with any colour vision."""

_LONGEST_SIDE = 2000
"""Most cells along a side of a slice; more voxels than that are gathered into cells."""
_PICTURE_SIDE = 1200
"""Short slices are magnified by a whole number to about this many pixels."""
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
    rows, columns = layer.log_odds.shape
    # Whole pixels a cell, so that none is blurred or dropped.
    magnified = max(1, _PICTURE_SIDE // max(rows, columns))
    width, height = columns * magnified, rows * magnified
    left, right, below, above = 90, 150, 110, 50
    legend_width = 560
    total_width = left + max(width, legend_width) + right
    total_height = below + max(height, 200) + above
    dpi = 100
    figure = Figure(figsize=(total_width / dpi, total_height / dpi), dpi=dpi, facecolor="white")
    canvas = FigureCanvasAgg(figure)

    box = (left / total_width, below / total_height, width / total_width, height / total_height)
    axes = figure.add_axes(box)
    x, y = layer.origin
    extent = (x, x + columns * layer.cell, y, y + rows * layer.cell)
    axes.imshow(colours(layer.log_odds), origin="lower", extent=extent, interpolation="nearest", aspect="auto")
    axes.set_xlabel(f"{AXES[layer.across]} (m)")
    axes.set_ylabel(f"{AXES[layer.upward]} (m)")
    axes.set_title(f"{AXES[layer.axis]} = {layer.at:.4g} m, cells of {layer.cell:g} m", loc="left")

    bar = figure.add_axes(((left + width + 25) / total_width, box[1], 18 / total_width, box[3]))
    figure.colorbar(ScalarMappable(cmap=COLOURS), cax=bar, label="probability of being occupied")
    states = (("free, p < 0.5", COLOURS(0.1)), ("occupied, p > 0.5", COLOURS(0.9)), ("unknown, never seen", UNKNOWN))
    patches = [Patch(facecolor=to_rgb(colour), edgecolor="#666666", label=name) for name, colour in states]
    figure.legend(handles=patches, loc=(box[0], 0.01), ncols=len(patches), frameon=False)
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.array(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]


def colours(log_odds: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(..., 3) uint8 colours of log-odds: the scale of probabilities, and its own grey for NaN, unknown."""
    probability = 1 / (1 + np.exp(-np.nan_to_num(log_odds, nan=0.0).astype(np.float64)))
    rgb = COLOURS(probability)[..., :3]
    rgb[np.isnan(log_odds)] = to_rgb(UNKNOWN)
    return np.asarray(np.round(255 * rgb), dtype=np.uint8)


def _trim(cells: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """The part of the cells that holds all known ones, and the indices of its first; all, if none is known."""
    known = ~np.isnan(cells)
    spans = []
    for axis in (0, 1):
        used = np.flatnonzero(known.any(axis=1 - axis))
        spans.append((used[0], used[-1] + 1) if len(used) else (0, cells.shape[axis]))
    (top, bottom), (first, last) = spans
    return cells[top:bottom, first:last], np.array([top, first])
