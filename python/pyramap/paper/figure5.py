"""Figure 5: occupancies along the optical axis by the fast rules, and their errors to the ideal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from . import axis, charts
from .comparison import Rule
from .section import Section, Table

RULES: tuple[Rule, ...] = ("pyramid", "min_layer", "area")
LITERAL = "literal"
"""The paper's rule with Eq. 14 to the letter."""
CURVES = (*RULES, LITERAL)
TITLES = {**charts.RULE_NAMES, LITERAL: "Eq. 14 to the letter"}
MOVED = axis.LAYOUTS[1]
"""The layout that shows best what the usual one hides."""


@dataclass(frozen=True)
class Accuracy:
    """Occupancies of the voxels on the axis in one layout.

    Attributes:
        layout: The scene.
        ideal: (N,).
        occupancies: (N,) by rule, and LITERAL.
    """

    layout: axis.Layout
    ideal: NDArray[np.float64]
    occupancies: dict[str, NDArray[np.float64]]

    def error(self, curve: str) -> NDArray[np.float64]:
        """(N,) |dp| to the ideal."""
        return np.abs(self.occupancies[curve] - self.ideal)

    def mean_errors(self) -> dict[str, float]:
        """By curve."""
        return {curve: float(self.error(curve).mean()) for curve in self.occupancies}


def compute() -> dict[str, Accuracy]:
    """Map the scene of Figure 2 with each rule, in each layout; by the names of the layouts."""
    return {layout.name: _compute(layout) for layout in axis.LAYOUTS}


def _compute(layout: axis.Layout) -> Accuracy:
    occupancies: dict[str, NDArray[np.float64]] = {rule: axis.occupancies(layout, rule) for rule in RULES}
    occupancies[LITERAL] = axis.by_equations(layout, half_texel=False)
    return Accuracy(layout, axis.occupancies(layout, "ideal"), occupancies)


def layer_borders() -> NDArray[np.float64]:
    """Distances t_i at which layers change, metres, as far as they lie on the axis."""
    limits = axis.thresholds(layers=8)
    return limits[limits < axis.LENGTH]


def draw(accuracy: Accuracy) -> Figure:
    """One panel a curve."""
    figure = charts.figure(6.4)
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for letter, axes, (curve, mean) in zip("abcd", panels.flat, accuracy.mean_errors().items(), strict=True):
        _draw_curve(axes, accuracy, curve)
        axes.set_title(f"({letter}) {TITLES[curve]}: mean |Δp| {mean:.4f}", loc="left")
    for axes in panels[1]:
        axes.set_xlabel("distance z on the axis (m)")
    for axes in panels[:, 0]:
        axes.set_ylabel("probability of being occupied")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure


def _draw_curve(axes: Axes, accuracy: Accuracy, curve: str) -> None:
    z, error = accuracy.layout.distances(), accuracy.error(curve)
    for i, border in enumerate(layer_borders()):
        axes.axvline(
            border, color=charts.GREY, linewidth=0.8, linestyle="--", label=None if i else "layer borders $t_i$"
        )
    axes.fill_between(z, error, color=charts.GREEN, alpha=0.6, linewidth=0, label="|Δp| to the ideal")
    axes.plot(z, accuracy.ideal, color=charts.BLACK, linewidth=2.2, label="ideal")
    axes.plot(z, accuracy.occupancies[curve], color=charts.VERMILION, linewidth=1.4, label="this rule")
    axes.set(xlim=(0, axis.LENGTH), ylim=(0, 1))


def section(layouts: dict[str, Accuracy]) -> Section:
    """For the page."""
    means = {name: accuracy.mean_errors() for name, accuracy in layouts.items()}
    usual, moved = means[axis.USUAL.name], means[MOVED.name]
    greatest = {
        name: {curve: float(accuracy.error(curve).max()) for curve in CURVES} for name, accuracy in layouts.items()
    }
    return Section(
        name="figure5",
        title="Figure 5: accuracy along the axis",
        figures={"figure5": draw(layouts[axis.USUAL.name]), "figure5_moved": draw(layouts[MOVED.name])},
        results={
            "voxel_size_m": axis.VOXEL,
            "layer_borders_m": layer_borders().tolist(),
            "mean_error": means,
            "max_error": greatest,
        },
        values={
            "gain": f"{usual['min_layer'] / usual['pyramid']:.1f}",
            "literal": f"{usual[LITERAL] / usual['pyramid']:.0f}",
            "area_both": f"{usual['area']:.4f} and {moved['area']:.4f}",
            "moved": f"{moved['pyramid'] / usual['pyramid']:.0f}",
        },
        table=Table(
            ["mean |Δp| on the axis", *(TITLES[curve] for curve in CURVES)],
            [[name, *(f"{errors[curve]:.5f}" for curve in CURVES)] for name, errors in means.items()],
        ),
    )
