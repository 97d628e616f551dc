"""What the paper lacks: how far each rule is from the ideal over whole volumes, and what it costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .. import SensorModel, scenes
from ..datasets import Frame
from . import charts
from .comparison import Floats, Rule, maps_of, occupancies
from .effort import Effort
from .figure1 import SIGMA
from .rooms import BOX
from .section import Section, Table
from .walk import MAX_RANGE, NOISE_SEED

RULES: tuple[Rule, ...] = ("pyramid", "min_layer", "area", "rays", "ideal")
TAILS = (0.95, 0.99)


@dataclass(frozen=True)
class Case:
    """A scene and how it is mapped; metres. `k` is `sigma`, as in the paper."""

    name: str
    voxel_size: float
    sigma: float
    max_range: float

    @property
    def model(self) -> SensorModel:
        """Eq. 7."""
        return SensorModel(self.sigma, k=self.sigma)


ROOM = Case("BOX, sigma 0.6 m", 0.1, SIGMA, BOX.reach)
SHARP = Case("BOX, sigma 0.1 m", 0.1, 0.1, BOX.reach)
OFFICE = Case("office, sigma 0.08 m", 0.08, 0.08, MAX_RANGE)


@dataclass(frozen=True)
class Comparison:
    """All rules in one case.

    Attributes:
        case: Which.
        views: How many images were compared, each in a map of its own.
        errors: (N,) |dp| to the ideal of all voxels that any rule knows, of all images, by rule.
        milliseconds: That an image takes, median, by rule.
    """

    case: Case
    views: int
    errors: dict[Rule, Floats]
    milliseconds: dict[Rule, float]


def compute(effort: Effort) -> list[Comparison]:
    """Map single images by each rule."""
    box, office = scenes.box().frames(), scenes.office_loop().frames(noise=NOISE_SEED)
    box_views = box[: len(box) - 1 : (len(box) - 1) // effort.views]
    office_views = office[:: len(office) // effort.views]
    return [
        _compare(ROOM, list(box_views)[: effort.views]),
        _compare(SHARP, list(box_views)[: effort.views]),
        _compare(OFFICE, list(office_views)[: effort.views]),
    ]


def _compare(case: Case, frames: Sequence[Frame]) -> Comparison:
    errors: dict[Rule, list[Floats]] = {rule: [] for rule in RULES}
    seconds: dict[Rule, list[float]] = {rule: [] for rule in RULES}
    for frame in frames:
        maps = maps_of(frame, case.voxel_size, case.model, case.max_range, RULES)
        p = occupancies(maps)
        for rule in RULES:
            errors[rule].append(np.abs(p[rule] - p["ideal"]))
            seconds[rule].append(maps[rule].seconds)
    return Comparison(
        case,
        len(frames),
        {rule: np.concatenate(parts) for rule, parts in errors.items()},
        {rule: 1e3 * median(times) for rule, times in seconds.items()},
    )


def draw(comparisons: list[Comparison]) -> Figure:
    """Above, how many voxels err by more than so much; below, the mean error beside the cost."""
    figure = charts.figure(6.8)
    panels = figure.subplots(2, len(comparisons), sharey="row")
    for (tails, costs), comparison in zip(panels.T, comparisons, strict=True):
        _draw_tails(tails, comparison)
        _draw_costs(costs, comparison)
        tails.set_title(comparison.case.name, loc="left", fontsize=10)
    panels[0, 0].set_ylabel("share of voxels with a larger error")
    panels[1, 0].set_ylabel("mean |Δp| to the ideal")
    handles, labels = panels[1, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(RULES), frameon=False)
    return figure


def _draw_tails(axes: Axes, comparison: Comparison) -> None:
    steps = np.logspace(-4, 0, 200)
    for rule in RULES[:-1]:
        ordered = np.sort(comparison.errors[rule])
        share = 1 - np.searchsorted(ordered, steps, side="right") / len(ordered)
        axes.plot(steps, share, color=charts.RULE_COLOURS[rule])
    axes.set(xscale="log", yscale="log", xlim=(1e-4, 1), ylim=(1e-4, 1), xlabel="error |Δp|")
    axes.grid(alpha=0.3)


def _draw_costs(axes: Axes, comparison: Comparison) -> None:
    for rule, marker in zip(RULES, "os^vD", strict=True):
        cost, colour, name = comparison.milliseconds[rule], charts.RULE_COLOURS[rule], charts.RULE_NAMES[rule]
        if rule == "ideal":
            axes.axvline(cost, linestyle="--", color=colour, label=name)
        else:
            mean = comparison.errors[rule].mean()
            axes.plot([cost], [mean], marker, markersize=9, linestyle="none", color=colour, label=name)
    axes.set(xscale="log", yscale="log", xlabel="time of an image (ms)")
    axes.grid(alpha=0.3)


def section(comparisons: list[Comparison]) -> Section:
    """For the page."""
    results = {comparison.case.name: _results(comparison) for comparison in comparisons}
    columns = ("mean", *map(_tail_name, TAILS), "max")
    rows = [
        [
            f"{name}: {charts.RULE_NAMES[rule]}",
            *(f"{by_rule[rule][column]:.4f}" for column in columns),
            f"{by_rule[rule]['milliseconds']:.1f}",
        ]
        for name, by_rule in results.items()
        for rule in RULES
    ]
    return Section(
        name="volumes",
        title="One more: every rule over whole volumes",
        figures={"volumes": draw(comparisons)},
        results={"views": comparisons[0].views, "by_case": results},
        values={
            "views": str(comparisons[0].views),
            "gain": _ratios(results, "pyramid", "area"),
            "versus": _ratios(results, "min_layer", "pyramid"),
        },
        table=Table(
            ["|Δp| to the ideal", "mean", *(f"{tail:.0%} are below" for tail in TAILS), "greatest", "ms an image"], rows
        ),
    )


def _results(comparison: Comparison) -> dict[Rule, dict[str, float]]:
    return {
        rule: {
            "voxels": len(errors),
            "mean": float(errors.mean()),
            **{_tail_name(tail): float(np.quantile(errors, tail)) for tail in TAILS},
            "max": float(errors.max()),
            "milliseconds": comparison.milliseconds[rule],
        }
        for rule, errors in comparison.errors.items()
    }


def _tail_name(tail: float) -> str:
    return f"p{100 * tail:g}"


def _ratios(results: dict[str, dict[Rule, dict[str, float]]], rule: Rule, other: Rule) -> str:
    """Mean error of one rule over that of another, in each case."""
    ratios = ((name, by_rule[rule]["mean"] / by_rule[other]["mean"]) for name, by_rule in results.items())
    return ", ".join(f"{ratio:.1f} ({name})" for name, ratio in ratios)
