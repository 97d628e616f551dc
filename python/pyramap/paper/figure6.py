"""Figure 6: slices of the map of one image of BOX, by the paper's rule and by the one it is compared with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from .. import SensorModel, scenes
from ..pictures.slice_drawing import COLOURS, UNKNOWN, colours
from . import charts
from .comparison import Floats, Rule, maps_of, occupancies
from .figure1 import SIGMA
from .rooms import BOX
from .section import Section, Table

VIEW = 0
VOXEL = 0.5
SHARP_SIGMA = 0.2
"""Metres."""
RULES: tuple[Rule, ...] = ("pyramid", "min_layer", "ideal")
FREE, UNDECIDED, OCCUPIED = 0.4, (0.48, 0.52), 0.6
"""Occupancies below the first, between the second ones, above the third."""


@dataclass(frozen=True)
class Plane:
    """A layer of voxels.

    Attributes:
        name: From where one looks at it.
        axis: The axis that it is perpendicular to: 0 or 1.
        at: Where its middle lies on that axis, metres.
    """

    name: str
    axis: int
    at: float

    @property
    def across(self) -> int:
        """Axis of its rows; its columns run along z, away from the camera."""
        return 1 - self.axis


PLANES = (Plane("side", 0, -0.75), Plane("top", 1, 0.75))
ASIDE, AWAY = 3.5, 6.0
"""What the slices show: so far to both sides of the camera, and so far away from it; metres."""


@dataclass(frozen=True)
class Slices:
    """What the rules make of the image with one sigma.

    Attributes:
        sigma: And k, metres.
        log_odds: By plane's name, then rule: (rows, columns) float32, NaN where unknown.
        mean_errors: Mean |dp| to the ideal over the whole volume, by rule.
        free_undecided: Of the voxels that are free in the ideal map, the share that is undecided, by rule.
        occupied_undecided: The same of those that are occupied.
    """

    sigma: float
    log_odds: dict[str, dict[Rule, Floats]]
    mean_errors: dict[Rule, float]
    free_undecided: dict[Rule, float]
    occupied_undecided: dict[Rule, float]


def compute() -> list[Slices]:
    """Map the view with the paper's sigma, and with a smaller one."""
    return [_compute(sigma) for sigma in (SIGMA, SHARP_SIGMA)]


def _compute(sigma: float) -> Slices:
    maps = maps_of(scenes.box().frames()[VIEW], VOXEL, SensorModel(sigma, k=sigma), BOX.reach, RULES)
    log_odds: dict[str, dict[Rule, Floats]] = {plane.name: {} for plane in PLANES}
    for plane in PLANES:
        points = _points(plane, VOXEL)
        for rule, (grid, _) in maps.items():
            values = grid.log_odds(points.reshape(-1, 3)).astype(np.float64).reshape(points.shape[:2])
            log_odds[plane.name][rule] = np.where(values == 0, np.nan, values)
    p = occupancies(maps)
    ideal = p["ideal"]
    undecided = {rule: (values > UNDECIDED[0]) & (values < UNDECIDED[1]) for rule, values in p.items()}
    return Slices(
        sigma,
        log_odds,
        {rule: float(np.abs(values - ideal).mean()) for rule, values in p.items()},
        {rule: float(undecided[rule][ideal < FREE].mean()) for rule in p},
        {rule: float(undecided[rule][ideal > OCCUPIED].mean()) for rule in p},
    )


def _points(plane: Plane, step: float) -> Floats:
    """(rows, columns, 3) centres of the cells of a plane; metres."""
    aside, away = (np.arange(start + step / 2, stop, step) for start, stop in ((-ASIDE, ASIDE), (0.0, AWAY)))
    points = np.empty((len(aside), len(away), 3))
    points[..., plane.axis] = plane.at
    points[..., plane.across] = aside[:, None]
    points[..., 2] = away
    return points


def draw(slices: Slices) -> Figure:
    """A row a plane, a column a rule; the true surface as a line."""
    figure = charts.figure(7.2)
    panels = figure.subplots(len(PLANES), len(RULES), sharex=True, sharey=True)
    scene, extent = scenes.box(), (0.0, AWAY, -ASIDE, ASIDE)
    for row, plane, letter in zip(panels, PLANES, "ab", strict=True):
        points = _points(plane, VOXEL / 20)
        distances = scene.signed_distance(points.reshape(-1, 3)).reshape(points.shape[:2])
        for axes, rule in zip(row, RULES, strict=True):
            image = colours(slices.log_odds[plane.name][rule].astype(np.float32))
            axes.imshow(image, extent=extent, origin="lower", interpolation="nearest")
            axes.contour(distances, levels=[0.0], extent=extent, origin="lower", colors="black", linewidths=1.2)
            axes.set_title(f"({letter}) {plane.name}, {charts.RULE_NAMES[rule]}", loc="left", fontsize=10)
        row[0].set_ylabel(f"{'xyz'[plane.across]} (m)" + (", down" if plane.across == 1 else ""))
    panels[0, 0].invert_yaxis()  # of all panels: y points down, and seen from above x points to the right of the camera
    for axes in panels[-1]:
        axes.set_xlabel("z, away from the camera (m)")
    figure.colorbar(ScalarMappable(cmap=COLOURS), ax=panels, label="probability of being occupied", aspect=40, pad=0.01)
    names = (
        (COLOURS(0.3), "free"),
        (COLOURS(0.5), "seen but undecided"),
        (COLOURS(0.85), "occupied"),
        (UNKNOWN, "unknown"),
    )
    patches = [Patch(facecolor=colour, edgecolor=charts.GREY, label=name) for colour, name in names]
    line = Line2D([], [], color="black", label="true surface")
    figure.legend(handles=[*patches, line], loc="outside lower center", ncols=len(patches) + 1, frameon=False)
    return figure


def section(by_sigma: list[Slices]) -> Section:
    """For the page."""
    paper, sharp = by_sigma
    rows = [
        [
            charts.RULE_NAMES[rule],
            f"{slices.sigma:g}",
            f"{slices.mean_errors[rule]:.4f}",
            f"{slices.free_undecided[rule]:.1%}",
            f"{slices.occupied_undecided[rule]:.1%}",
        ]
        for slices in by_sigma
        for rule in RULES[:-1]
    ]
    return Section(
        name="figure6",
        title="Figure 6: one image of BOX at 0.5 m",
        figures={"figure6": draw(paper), "figure6_sharp": draw(sharp)},
        results={
            "voxel_size_m": VOXEL,
            "view": VIEW,
            "by_sigma": {
                f"{slices.sigma:g}": {
                    "mean_error": slices.mean_errors,
                    "free_undecided": slices.free_undecided,
                    "occupied_undecided": slices.occupied_undecided,
                }
                for slices in by_sigma
            },
        },
        values={
            "view": str(VIEW),
            "paper_sigma": f"{paper.sigma:g}",
            "sharp_sigma": f"{sharp.sigma:g}",
            "sharp_free": f"{sharp.free_undecided['pyramid']:.1%}",
            "sharp_free_min": f"{sharp.free_undecided['min_layer']:.1%}",
            "free": f"{paper.free_undecided['pyramid']:.1%}",
            "free_min": f"{paper.free_undecided['min_layer']:.1%}",
            "occupied": f"{sharp.occupied_undecided['pyramid']:.1%}",
            "occupied_min": f"{sharp.occupied_undecided['min_layer']:.1%}",
            "mean": f"{paper.mean_errors['pyramid']:.4f}",
            "mean_min": f"{paper.mean_errors['min_layer']:.4f}",
        },
        table=Table(
            ["rule", "sigma (m)", "mean |Δp| to the ideal", "free left undecided", "occupied left undecided"], rows
        ),
    )
