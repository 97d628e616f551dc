"""Figure 2: ideal occupancies along the optical axis, for obstacles at 6 m and 10 m."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from . import axis, charts
from .section import Section

MARKED = 8.05
"""Centre of the voxel in green, metres."""


@dataclass(frozen=True)
class Ideal:
    """The curve and what the marked voxel sees.

    Attributes:
        distances: (N,) metres.
        occupancies: (N,).
        columns: (C,) columns of pixels whose rays pass through the marked voxel.
        marked: Occupancy of that voxel.
    """

    distances: NDArray[np.float64]
    occupancies: NDArray[np.float64]
    columns: NDArray[np.int64]
    marked: float


def compute() -> Ideal:
    """Map one image by Eq. 8 and 9."""
    layout = axis.USUAL
    distances, occupancies = layout.distances(), axis.occupancies(layout, "ideal")
    # A ray passes through the voxel if it does so at the voxel's far face, where rays have spread the most, or before.
    columns = np.arange(axis.SIDE)
    aside = np.abs(columns - layout.cx) / axis.FOCAL * (MARKED - axis.VOXEL / 2)
    at = int(np.argmin(np.abs(distances - MARKED)))
    return Ideal(distances, occupancies, columns[aside < axis.VOXEL / 2], float(occupancies[at]))


def draw(ideal: Ideal) -> Figure:
    """The scene from above, its marked voxel from near by, and the curve."""
    figure = charts.figure(4.0)
    scene, voxel, curve = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.7))
    _draw_scene(scene)
    _draw_voxel(voxel, ideal)
    curve.plot(ideal.distances, ideal.occupancies, color=charts.BLACK)
    curve.plot(
        [MARKED],
        [ideal.marked],
        "s",
        color=charts.GREEN,
        markersize=9,
        label=f"voxel at {MARKED:g} m: {ideal.marked:.3f}",
    )
    for z in (axis.NEAR, axis.FAR):
        curve.axvline(z, color=charts.GREY, linestyle=":", linewidth=1)
    curve.set(
        xlim=(0, axis.LENGTH), ylim=(0, 1), xlabel="distance z on the axis (m)", ylabel="probability of being occupied"
    )
    curve.legend(loc="upper left")
    curve.set_title("(b) ideal occupancies, Eq. 8", loc="left")
    return figure


def _draw_scene(axes: Axes) -> None:
    edge = axis.USUAL.near_columns - 0.5 - axis.USUAL.cx
    for z, side, name in ((axis.NEAR, -1, "6 m"), (axis.FAR, 1, "10 m")):
        border = edge / axis.FOCAL * z
        axes.plot([border, side * z / 2], [z, z], color=charts.VERMILION if side < 0 else charts.BLUE, linewidth=4)
        axes.text(side * z / 4, z + 0.25, name, ha="center")
        axes.plot([0, side * axis.FAR / 2], [0, axis.FAR], color=charts.GREY, linewidth=0.8)
    axes.plot([0, 0], [0, 11], color=charts.BLACK, linestyle="--", linewidth=0.8)
    axes.plot([0], [0], marker="^", color=charts.BLACK, markersize=9)
    axes.plot([0], [MARKED], marker="s", color=charts.GREEN, markersize=7)
    axes.set(xlabel="x (m)", ylabel="z (m)", xlim=(-5.2, 5.2), ylim=(-0.5, 11.2))
    axes.set_title("(a) scene from above", loc="left")


def _draw_voxel(axes: Axes, ideal: Ideal) -> None:
    half = axis.VOXEL / 2
    axes.add_patch(Rectangle((-half, MARKED - half), 2 * half, 2 * half, color=charts.GREEN, alpha=0.35, linewidth=0))
    shown = np.array([MARKED - 1.6 * half, MARKED + 1.6 * half])
    for column in ideal.columns:
        slope = (column - axis.USUAL.cx) / axis.FOCAL
        if column < axis.USUAL.near_columns:
            ended = axes.plot(slope * shown, shown, color=charts.VERMILION, linestyle="--")
        else:
            passing = axes.plot(slope * shown, shown, color=charts.BLUE)
    axes.set(xlabel="x (m)", ylabel="z (m)", xlim=(-1.6 * half, 1.6 * half), ylim=(shown[0], shown[1] + half))
    axes.legend([*ended, *passing], [f"reads {z:g} m" for z in (axis.NEAR, axis.FAR)], loc="upper center")
    axes.set_title("the green voxel", loc="left")


def section(ideal: Ideal) -> Section:
    """For the page."""
    near = int(np.count_nonzero(ideal.columns < axis.USUAL.near_columns))
    pairs = zip(ideal.distances, ideal.occupancies, strict=True)
    return Section(
        name="figure2",
        title="Figure 2: ideal occupancy mapping",
        figures={"figure2": draw(ideal)},
        results={
            "voxel_size_m": axis.VOXEL,
            "occupancies": {f"{z:.2f}": round(float(p), 6) for z, p in pairs},
            "marked_m": MARKED,
            "marked_occupancy": ideal.marked,
            "marked_columns": ideal.columns.tolist(),
        },
        values={"near": str(near), "far": str(len(ideal.columns) - near), "marked": f"{ideal.marked:.3f}"},
    )
