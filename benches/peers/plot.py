"""Milliseconds a frame against voxel size, one line a system."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator, ScalarFormatter

from .systems import SYSTEMS
from .turns import Turns

# Okabe and Ito's colours, which stay apart for colour-blind eyes, with brown for their yellow, which is pale on white,
# and greys. The marker tells a system as well. A rule on the GPU has the look of the same rule on the CPU, but hollow.
RULES = (("#0072B2", "o"), ("#56B4E9", "s"), ("#009E73", "D"), ("#CC79A7", "^"), ("#000000", "*"))
ON_A_GPU = (RULES[0], RULES[2], RULES[3])
PEERS = (("#D55E00", "s"), ("#E69F00", "X"), ("#8C510A", "P"), ("#7F7F7F", "v"), ("#B3B3B3", "d"))
LOOKS = dict(zip(SYSTEMS, (*RULES, *ON_A_GPU, *PEERS), strict=True))


def save_plot(path: Path, title: str, turns: Sequence[Turns]) -> None:
    """Draws the median of each system at the most threads it was given, with a bar from quartile to quartile."""
    figure = Figure(figsize=(9, 5.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for system, (colour, marker) in LOOKS.items():
        threads = max((threads for at in turns for name, threads in at.times if name == system.name), default=None)
        if threads is None:
            continue
        key = system.name, threads
        sizes = [at.voxel_size for at in turns if key in at.times]
        low, middle, high = zip(*(at.quartiles_ms(key) for at in turns if key in at.times), strict=True)
        below = [m - lowest for m, lowest in zip(middle, low, strict=True)]
        above = [highest - m for m, highest in zip(middle, high, strict=True)]
        axes.errorbar(
            sizes,
            middle,
            yerr=[below, above],
            label=f"{system.name} ({threads} thread{'s' * (threads > 1)})",
            color=colour,
            marker=marker,
            fillstyle="none" if system.on_gpu else "full",
            linestyle=":" if system.on_gpu else "-" if system.package == "pyramap" else "--",
            capsize=2,
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks([at.voxel_size for at in turns])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("voxel size (m)")
    axes.set_ylabel("time to fuse a frame (ms), median and quartiles")
    axes.set_title(title)
    axes.grid(which="both", alpha=0.25)
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)
    figure.savefig(path, dpi=150)
