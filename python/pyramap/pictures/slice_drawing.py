"""A slice with axes, scale and legend, by Matplotlib; pyplot and its global state stay out of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.typing import ColorType
from numpy.typing import NDArray

from .scale_bar import round_length
from .slices import Slice

UNKNOWN = "#d9d9d9"
COLOURS = LinearSegmentedColormap.from_list("occupancy", ["#4393c3", "#a6cee9", "#fdf3c4", "#d9601a", "#7a1a04"])
"""Probability 0 to 1: blue is free, pale is undecided, dark red is occupied; told apart with any colour vision."""
DIFFERENCES = LinearSegmentedColormap.from_list(
    "difference",
    ["#542788", "#b2abd2", "#ffffff", "#fdb863", "#b35806"],
    N=257,  # an odd number, so that there is one for no difference
)
"""Less to more occupied: violet to brown, white where nothing changed; told apart with any colour vision."""

_PICTURE_SIDE = 1200
"""Short slices are magnified by a whole number to about this many pixels."""
_INK = "#3c3c3c"

_Key = tuple[str, ColorType]
"""A name of the legend, and its colour."""


def draw(layer: Slice) -> NDArray[np.uint8]:
    """See `slice_image`."""
    states = (("free, p < 0.5", COLOURS(0.1)), ("occupied, p > 0.5", COLOURS(0.9)), ("unknown, never seen", UNKNOWN))
    scale = ScalarMappable(Normalize(0, 1), COLOURS)
    return _draw(layer, colours(layer.log_odds), scale, "probability of being occupied", states)


def draw_difference(layer: Slice) -> NDArray[np.uint8]:
    """See `difference_image`."""
    # A map without a difference is white; any limit does for its scale.
    limit = float(np.nanmax(np.abs(layer.log_odds), initial=0.0)) or 1.0
    scale = ScalarMappable(Normalize(-limit, limit), DIFFERENCES)
    key = (
        ("less occupied in the second", DIFFERENCES(0.1)),
        ("more occupied there", DIFFERENCES(0.9)),
        ("unknown in both", UNKNOWN),
    )
    rgb = _coloured(DIFFERENCES, (layer.log_odds / limit + 1) / 2)
    return _draw(layer, rgb, scale, "difference of log-odds", key)


def colours(log_odds: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(..., 3) uint8 colours of log-odds: the scale of probabilities, and its own grey for NaN, unknown."""
    # Eq. 5 by the hyperbolic tangent, which cannot overflow.
    return _coloured(COLOURS, (1 + np.tanh(log_odds / 2)) / 2)


def _coloured(scale: Colormap, values: NDArray[np.floating]) -> NDArray[np.uint8]:
    """(..., 3) uint8: a scale's colours of values from 0 to 1, grey for NaN."""
    rgb = scale(np.nan_to_num(values, nan=0.5))[..., :3]
    rgb[np.isnan(values)] = to_rgb(UNKNOWN)
    return np.asarray(np.round(255 * rgb), dtype=np.uint8)


def _draw(
    layer: Slice, rgb: NDArray[np.uint8], scale: ScalarMappable, label: str, key: Sequence[_Key]
) -> NDArray[np.uint8]:
    """The picture of a slice whose cells have these colours."""
    rows, columns = layer.log_odds.shape
    # Whole pixels a cell, so that none is blurred or dropped.
    magnified = max(1, _PICTURE_SIDE // max(rows, columns))
    width, height = columns * magnified, rows * magnified
    left, right, below, above = 90, 150, 140, 50
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
    axes.imshow(rgb, origin="lower", extent=extent, interpolation="nearest", aspect="auto")
    across, upward = layer.plane.labels
    axes.set_xlabel(across)
    axes.set_ylabel(upward)
    axes.set_title(f"{layer.plane.title}, cells of {layer.cell:g} m", loc="left")

    bar = figure.add_axes(((left + width + 25) / total_width, box[1], 18 / total_width, box[3]))
    figure.colorbar(scale, cax=bar, label=label)
    patches = [Patch(facecolor=to_rgb(colour), edgecolor="#666666", label=name) for name, colour in key]
    figure.legend(handles=patches, loc=(box[0], 0.01), ncols=len(patches), frameon=False)
    _add_scale_bar(figure, left, 62, columns * layer.cell, width)
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.array(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]


def _add_scale_bar(figure: Figure, left: int, bottom: int, metres: float, pixels: int) -> None:
    """A bar of a round length at (left, bottom) pixels, in a picture in which so many metres are so many pixels."""
    length = round_length(metres / 5)
    width, height = figure.get_size_inches() * figure.dpi
    end, middle = (left + length / metres * pixels) / width, bottom / height
    figure.add_artist(Line2D([left / width, end], [middle, middle], color=_INK, linewidth=2, marker="|", markersize=8))
    figure.text(end + 8 / width, middle, f"{length:g} m", color=_INK, va="center_baseline")
