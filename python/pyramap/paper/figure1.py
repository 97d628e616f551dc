"""Figure 1: the inverse sensor model (Eq. 7) for readings at 10 m and 25 m."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .. import SensorModel
from . import charts
from .comparison import probability
from .section import Section

READINGS = (10.0, 25.0)
"""Metres."""
SIGMA = 0.6
"""The paper's k and sigma, metres, here and wherever it names none."""


@dataclass(frozen=True)
class Curves:
    """Occupancies over distance.

    Attributes:
        distances: (N,) metres.
        paper: (N,) for each reading, with the paper's model.
        centred: The same with `surface_offset="centred"`.
        lead: How far in front of a reading p is 0.5, metres.
    """

    distances: NDArray[np.float64]
    paper: dict[float, NDArray[np.float64]]
    centred: dict[float, NDArray[np.float64]]
    lead: float


def paper_model() -> SensorModel:
    """Eq. 7 with k = sigma = 0.6 m."""
    return SensorModel(SIGMA, k=SIGMA)


def compute() -> Curves:
    """Ask the sensor model every centimetre."""
    distances = np.arange(1, 3001) / 100
    paper, centred = paper_model(), SensorModel(SIGMA, k=SIGMA, surface_offset="centred")
    return Curves(
        distances,
        {reading: _probabilities(paper, distances, reading) for reading in READINGS},
        {reading: _probabilities(centred, distances, reading) for reading in READINGS},
        lead=_lead(paper, READINGS[0]),
    )


def _probabilities(model: SensorModel, distances: NDArray[np.float64], reading: float) -> NDArray[np.float64]:
    return probability(np.array([model.log_odds(float(z), reading) for z in distances]))


def _lead(model: SensorModel, reading: float) -> float:
    """By bisection: far in front of a reading the log-odds are below 0, at the reading they are above."""
    free, occupied = reading - 3 * SIGMA, reading
    while occupied - free > 1e-6:
        middle = (free + occupied) / 2
        free, occupied = (middle, occupied) if model.log_odds(middle, reading) < 0 else (free, middle)
    return reading - occupied


def draw(curves: Curves) -> Figure:
    """The curves, and the ends of the one at 10 m from near by."""
    figure = charts.figure(3.8)
    whole, near = figure.subplots(1, 2, width_ratios=(3, 2), sharey=True)
    for axes in (whole, near):
        axes.axhline(0.5, color=charts.GREY, linewidth=0.8)
        for reading, colour in zip(READINGS, (charts.VERMILION, charts.BLUE), strict=True):
            axes.plot(curves.distances, curves.paper[reading], color=colour, label=f"reading {reading:g} m")
            axes.axvline(reading, color=colour, linewidth=0.8, linestyle=":")
        axes.set_xlabel("distance z from the camera (m)")
    whole.set_ylabel("probability of being occupied")
    whole.set_ylim(0, 1)
    whole.set_xlim(0, 30)
    whole.legend(loc="upper left")
    whole.set_title(rf"Eq. 7, k = $\sigma$ = {SIGMA:g} m", loc="left")

    reading = READINGS[0]
    near.plot(
        curves.distances, curves.centred[reading], color=charts.BLACK, linestyle="--", label='surface_offset="centred"'
    )
    near.set_xlim(reading - 3, reading + 3)
    near.plot([reading - curves.lead, reading], [0.5, 0.5], color=charts.VERMILION, marker="|", markersize=12)
    near.annotate(
        f"p = 0.5 lies\n{curves.lead:.2f} m in front",
        (reading - curves.lead, 0.5),
        xytext=(reading - 2.8, 0.62),
        arrowprops={"arrowstyle": "-", "color": charts.GREY},
    )
    near.legend(*_only(near.get_legend_handles_labels(), "surface_offset"), loc="lower right")
    near.set_title("around 10 m", loc="left")
    return figure


def _only(entries: tuple[list[object], list[str]], start: str) -> tuple[list[object], list[str]]:
    kept = [(handle, label) for handle, label in zip(*entries, strict=True) if label.startswith(start)]
    return [handle for handle, _ in kept], [label for _, label in kept]


def section(curves: Curves) -> Section:
    """For the page."""
    peaks = {f"{reading:g}": float(p.max()) for reading, p in curves.paper.items()}
    return Section(
        name="figure1",
        title="Figure 1: the inverse sensor model",
        figures={"figure1": draw(curves)},
        results={
            "sigma_m": SIGMA,
            "k_m": SIGMA,
            "free": float(curves.paper[READINGS[1]][0]),
            "peaks": peaks,
            "behind": float(curves.paper[READINGS[0]][-1]),
            "lead_m": curves.lead,
            "lead_sigmas": curves.lead / SIGMA,
        },
        values={"peak": f"{peaks['10']:.3f}", "lead_sigmas": f"{curves.lead / SIGMA:.2f}"},
    )
