"""How sure a map is, as a histogram."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..pictures import slice_drawing
from .statistics import Statistics


def histogram_image(statistics: Statistics) -> NDArray[np.uint8]:
    """Bars in the colours of the slices; counts on a logarithmic scale, since free space dwarfs all else.

    Returns:
        (height, width, 3) image.
    """
    figure = Figure(figsize=(9, 3.2), dpi=120, facecolor="white", layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    middles = (statistics.edges[:-1] + statistics.edges[1:]) / 2
    shades = slice_drawing.colours(middles.astype(np.float32)) / 255
    axes.bar(middles, statistics.counts, np.diff(statistics.edges), color=shades, edgecolor="#777777", linewidth=0.3)
    axes.set_yscale("symlog", linthresh=1)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("log-odds: free below 0, occupied above")
    axes.set_ylabel("voxels")
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.array(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]
