"""What all figures share: their width, colours that any colour vision tells apart, and the way into a PNG."""

from __future__ import annotations

from io import BytesIO

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

WIDTH = 10.0
"""Of every figure, inches: text of 10 points is then as large as the page's own."""
DPI = 150

# The palette of Okabe and Ito, "Color Universal Design" (2008).
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE = (
    "#000000",
    "#e69f00",
    "#56b4e9",
    "#009e73",
    "#0072b2",
    "#d55e00",
    "#cc79a7",
)
GREY = "#999999"

RULE_COLOURS = {"ideal": BLACK, "pyramid": VERMILION, "min_layer": BLUE, "area": PURPLE, "rays": ORANGE}
RULE_NAMES = {
    "ideal": "ideal (Eq. 8)",
    "pyramid": "pyramid (the paper's)",
    "min_layer": "min_layer (after Andert)",
    "area": "area (ours)",
    "rays": "rays (OctoMap's)",
}
"""Update rules in legends."""


def figure(height: float) -> Figure:
    """An empty figure as wide as the page, `height` inches high; no display and no global state."""
    empty = Figure(figsize=(WIDTH, height), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(empty)
    return empty


def png(drawn: Figure) -> bytes:
    """A figure as a PNG file."""
    buffer = BytesIO()
    with rc_context({"savefig.facecolor": "white"}):
        drawn.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
