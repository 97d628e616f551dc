"""A slice with axes, scale and legend, by Matplotlib; pyplot and its global state stay out of it."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from .slices import AXES, Slice

UNKNOWN = "#d9d9d9"
COLOURS = LinearSegmentedColormap.from_list("occupancy", ["#4393c3", "#a6cee9", "#fdf3c4", "#d9601a", "#7a1a04"])
"""Probability 0 to 1: blue is free, pale is undecided, dark red is occupied; told apart with any colour vision."""

_PICTURE_SIDE = 1200
"""Short slices are magnified by a whole number to about this many pixels."""


def draw(layer: Slice) -> NDArray[np.uint8]:
    """See `slice_image`."""
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
    # Eq. 5 by the hyperbolic tangent, which cannot overflow.
    probability = (1 + np.tanh(np.nan_to_num(log_odds, nan=0.0) / 2)) / 2
    rgb = COLOURS(probability)[..., :3]
    rgb[np.isnan(log_odds)] = to_rgb(UNKNOWN)
    return np.asarray(np.round(255 * rgb), dtype=np.uint8)
