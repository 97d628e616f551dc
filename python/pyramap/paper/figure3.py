"""Figure 3: the simulated rooms BOX and SPHERES, and depth images taken in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from . import charts, exact
from .rooms import ROOMS, Room
from .section import Section


@dataclass(frozen=True)
class Scenery:
    """Pictures of one room.

    Attributes:
        room: Which.
        overview: (h, w, 3) uint8.
        depths: z-depth images, metres, by number of the view.
        views: How many there are.
        coverage: Least and greatest depth of all views, metres.
    """

    room: Room
    overview: NDArray[np.uint8]
    depths: dict[int, NDArray[np.float32]]
    views: int
    coverage: tuple[float, float]


def compute() -> list[Scenery]:
    """Render the rooms."""
    result = []
    for room in ROOMS:
        scene = room.make()
        frames = scene.frames()
        bounds = [(float(frame.depth.min()), float(frame.depth.max())) for frame in frames]
        result.append(
            Scenery(
                room,
                exact.shaded(scene, room.view(width=700)),
                {number: frames[number].depth for number in room.examples},
                len(frames),
                (min(low for low, _ in bounds), max(high for _, high in bounds)),
            )
        )
    return result


def draw(sceneries: list[Scenery]) -> Figure:
    """A row a room."""
    figure = charts.figure(6.0)
    rows = figure.subplots(len(sceneries), 3, width_ratios=(4 / 3, 1, 1))
    for letter, row, scenery in zip("ab", rows, sceneries, strict=True):
        row[0].imshow(scenery.overview)
        row[0].set_axis_off()
        row[0].set_title(f"({letter}) {scenery.room.name}: {scenery.room.objects}", loc="left")
        farthest = max(depth.max() for depth in scenery.depths.values())
        for axes, (number, depth) in zip(row[1:], scenery.depths.items(), strict=True):
            image = axes.imshow(depth, cmap="viridis", vmin=0, vmax=farthest)
            axes.set_title(f"depth of view {number}", loc="left")
            axes.set(xlabel="u (pixels)", xticks=(0, 200, 399), yticks=(0, 200, 399))
        row[1].set_ylabel("v (pixels)")
        figure.colorbar(image, ax=row[1:], label="z-depth (m)", fraction=0.05, aspect=18)
    return figure


def section(sceneries: list[Scenery]) -> Section:
    """For the page."""
    return Section(
        name="figure3",
        title="Figure 3: BOX and SPHERES",
        figures={"figure3": draw(sceneries)},
        results={
            scenery.room.name: {
                "views": scenery.views,
                "examples": list(scenery.depths),
                "nearest_depth_m": scenery.coverage[0],
                "farthest_depth_m": scenery.coverage[1],
            }
            for scenery in sceneries
        },
        values={"views": str(sceneries[0].views)},
    )
