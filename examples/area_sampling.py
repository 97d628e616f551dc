"""Where should the rule `area` read the depth image for a voxel?

The ideal occupancy (Eq. 8, 9) weights every pixel's ray by its length inside the voxel: slow and exact. The candidates
below read a few pixels instead and take the mean of their log-odds (Eq. 7), all at the distance of the voxel's centre.
The table says how far from the ideal that leads: |dp| is the difference of a voxel's probabilities, for voxels of which
something is known. What it shows:

- The lengths of rays in a volume are in proportion to the volume around them: points spread evenly in the voxel sample
  just those weights. A square of pixels has not the voxel's outline, and weights all of it alike: it does worse.
- Seen along an axis, the points of a cube hide each other: of 2 x 2 x 2 the image hardly shows more than four. Those of
  a lattice differ in every coordinate. With eight, as many texels as `pyramid` reads, the mean error is a ninth to a
  twelfth of `pyramid`'s, and a seventh in the worst single view.
- More points go on paying: 18 in a lattice err half as much as 8, and less than 27 in a cube. Where an image has holes,
  as those of real cameras have, they must: all eight points may fall into a hole that some ray of the ideal escapes.
- But only where they do not agree. Most voxels are settled by eight, and to ask 48 more in the others leads as near to
  the ideal as to ask 56 in all, for a third of the texels. This is the rule `area`.
- A single pixel, that of the centre, already errs by less than half of what `pyramid` does.

The rows of the library's rules come from its own maps, which round log-odds to a unit of 2^-12.
Run it without arguments for the table (some 10 s), with `--quick` for one view of each scene.
"""

from __future__ import annotations

import argparse
import itertools
import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import pyramap as pm
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pyramap.datasets import Frame

Array = NDArray[np.float64]
Rule = Literal["ideal", "pyramid", "min_layer", "area"]
TEXELS: dict[Rule, float] = {"pyramid": 8, "min_layer": 4}
"""Texels that the library's rules with layers read."""


@dataclass(frozen=True)
class View:
    """One depth image and how it is mapped; metres. `k` is `sigma`, as in the paper."""

    frame: Frame
    voxel_size: float
    sigma: float
    max_range: float

    def ranges(self) -> Array:
        """M of Eq. 6, (height, width): infinite, free throughout, beyond the greatest range; NaN for holes."""
        ranges = pm.ranges(self.frame.depth, self.frame.camera).astype(np.float64)
        return np.where(ranges > self.max_range, np.inf, np.where(ranges > 0, ranges, np.nan))

    def project(self, points: Array) -> tuple[Array, Array, Array]:
        """Pixel coordinates u and v, NaN behind the camera, and the distance z of world points (..., 3)."""
        camera, pose = self.frame.camera, self.frame.world_from_camera
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        forward = np.where(local[..., 2] > 0, local[..., 2], np.nan)
        u, v = (f * local[..., i] / forward + c for i, f, c in ((0, camera.fx, camera.cx), (1, camera.fy, camera.cy)))
        return u, v, np.linalg.norm(local, axis=-1)


Sampling = Callable[[View, Array], tuple[Array, Array, Array]]
"""What is read for voxels with centres (N, 3): pixel coordinates u and v, and weights, each (texels, N)."""

Method = Callable[[View, Array], tuple[float, Array]]
"""For voxels with centres (N, 3): how many texels each reads on average, and log-odds (N,), 0 where none is known."""


def midpoints(n: int) -> Array:
    """The middles of n equal parts of an edge, from the voxel's centre, in edges."""
    return (np.arange(n) + 0.5) / n - 0.5


def cube(n: int) -> Array:
    return np.array(list(itertools.product(midpoints(n), repeat=3)))


def lattice(n: int, steps: tuple[int, int, int]) -> Array:
    """Points of which no two share a coordinate, if no step has a factor in common with their number."""
    return (np.arange(n)[:, None] + 0.5) * steps / n % 1.0 - 0.5


def inside(points: Array) -> Sampling:
    """The pixels on which points in the voxel fall, given in edges from its centre; none for one behind the camera."""

    def reads(view: View, centres: Array) -> tuple[Array, Array, Array]:
        u, v, _ = view.project(centres + points[:, None] * view.voxel_size)
        return u, v, np.isfinite(u).astype(np.float64)

    return reads


def square(n: int) -> Sampling:
    """Pixels spread, n by n, over a square as wide as the voxel appears at its distance."""

    def reads(view: View, centres: Array) -> tuple[Array, Array, Array]:
        u, v, z = view.project(centres)
        du, dv = np.array(list(itertools.product(midpoints(n), repeat=2))).T[..., None] * view.voxel_size / z
        return u + du * view.frame.camera.fx, v + dv * view.frame.camera.fy, np.ones((n * n, len(z)))

    return reads


def bilinear(view: View, centres: Array) -> tuple[Array, Array, Array]:
    """The four pixels around the voxel's centre, weighted as in Eq. 16."""
    u, v, _ = view.project(centres)
    du, dv = np.array(list(itertools.product((0, 1), repeat=2))).T[..., None]
    column, row = np.floor(u) + du, np.floor(v) + dv
    return column, row, (1 - np.abs(u - column)) * (1 - np.abs(v - row))


def told(view: View, sampling: Sampling, centres: Array) -> tuple[Array, Array]:
    """What the texels say of their voxels, and their weights, 0 for a hole; (texels, N) each."""
    ranges, z, (u, v, weight) = view.ranges(), view.project(centres)[2], sampling(view, centres)
    readings = ranges[nearest(v, ranges.shape[0]), nearest(u, ranges.shape[1])]
    weight = np.where(np.isnan(readings), 0.0, weight)
    x = (z - np.nan_to_num(readings, posinf=np.inf)) / view.sigma
    a, g = 1.0 / math.sqrt(2.0 * math.pi), np.exp(-0.5 * x**2)
    p = np.where(x <= 0.0, 0.3 + (a + 0.2) * g, 0.5 + a * g)  # Eq. 7
    return np.log(p / (1.0 - p)), weight


def mean(values: Array, weight: Array) -> Array:
    total, weights = (weight * values).sum(axis=0), weight.sum(axis=0)
    return np.asarray(np.divide(total, weights, out=np.zeros_like(total), where=weights > 0))


def always(sampling: Sampling) -> Method:
    """The same texels for every voxel."""

    def method(view: View, centres: Array) -> tuple[float, Array]:
        values, weight = told(view, sampling, centres)
        return len(values), mean(values, weight)

    return method


def where_needed(few: Sampling, more: Sampling, tolerance: float) -> Method:
    """More texels where those of `few` differ by more than the tolerance, in log-odds, or are all holes."""

    def method(view: View, centres: Array) -> tuple[float, Array]:
        values, weight = told(view, few, centres)
        highest, lowest = (np.where(weight > 0, values, empty) for empty in (-np.inf, np.inf))
        settled = (weight > 0).any(axis=0) & (highest.max(axis=0) - lowest.min(axis=0) <= tolerance)
        others, other_weight = told(view, more, centres)
        weights = np.concatenate([weight, np.where(settled, 0.0, other_weight)])
        texels = len(values) + (1 - settled.mean()) * len(others)
        return float(texels), mean(np.concatenate([values, others]), weights)

    return method


TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 4
EIGHT, FORTY_EIGHT = inside(lattice(8, (1, 5, 7))), inside(lattice(48, (1, 13, 19)))
CHOSEN = "8, and 48 where needed"
METHODS: dict[str, Method] = {
    "centre, nearest pixel": always(square(1)),
    "centre, bilinear": always(bilinear),
    **{f"square {n} x {n}": always(square(n)) for n in (2, 3, 4)},
    "tetrahedron": always(inside(TETRAHEDRON)),
    **{f"cube {n} x {n} x {n}": always(inside(cube(n))) for n in (2, 3, 4)},
    "lattice of 8 (1, 5, 7)": always(EIGHT),
    **{f"lattice of {n} {g}": always(inside(lattice(n, g))) for n, g in ((14, (1, 9, 11)), (18, (1, 5, 7)))},
    "lattice of 48 (1, 13, 19)": always(FORTY_EIGHT),
    **{f"8, 48 beyond {t:g}": where_needed(EIGHT, FORTY_EIGHT, t) for t in (0.1, 1.0)},
    CHOSEN: where_needed(EIGHT, FORTY_EIGHT, 0.5),
}


def nearest(x: Array, size: int) -> NDArray[np.int64]:
    """The pixel nearest to x along a side of the image: beside the image, the last one."""
    return np.clip(np.floor(np.nan_to_num(x) + 0.5), 0, size - 1).astype(np.int64)


def probability(evidence: Array) -> Array:
    return 1.0 / (1.0 + np.exp(-evidence))


def mapped(view: View, count: int) -> tuple[Array, dict[Rule, Array]]:
    """The centres of `count` random voxels of those that any rule of the library knows, and their log-odds by rule."""
    model, grids = pm.SensorModel(view.sigma, k=view.sigma), {}
    for rule in get_args(Rule):
        grids[rule] = pm.OccupancyGrid(view.voxel_size, sensor_model=model, max_range=view.max_range, update=rule)
        grids[rule].integrate(view.frame.depth, view.frame.camera, view.frame.world_from_camera)
    coords = np.unique(np.concatenate([grid.block_coords() for grid in grids.values()]), axis=0)
    values = {rule: grid.block_log_odds(coords).ravel().astype(np.float64) for rule, grid in grids.items()}
    known = np.flatnonzero(np.any(list(values.values()), axis=0))
    some = np.random.default_rng(0).choice(known, min(count, len(known)), replace=False)
    voxels = coords[some // 512] * 8 + np.stack(np.unravel_index(some % 512, (8, 8, 8)), axis=-1)
    return (voxels + 0.5) * view.voxel_size, {rule: value[some] for rule, value in values.items()}


def errors(view: View, count: int) -> dict[str, tuple[float, Array]]:
    """Texels read and |dp| to the ideal, by the names of the library's rules and of the methods."""
    centres, rules = mapped(view, count)
    ideal = probability(rules["ideal"])
    found = {name: method(view, centres) for name, method in METHODS.items()}
    reads = {**TEXELS, "area": found[CHOSEN][0]}
    found = {f"update={rule!r}": (texels, rules[rule]) for rule, texels in reads.items()} | found
    return {name: (texels, np.abs(probability(values) - ideal)) for name, (texels, values) in found.items()}


def print_table(title: str, views: list[View], count: int) -> dict[str, float]:
    """Prints how every way to sample does; gives the mean |dp| of each."""
    per_view = [errors(view, count) for view in views]
    print(f"\n{title}; {len(views)} views\n{'':25} texels mean |dp|     p99  times smaller than pyramid's (by view)")
    pyramid = np.array([view["update='pyramid'"][1].mean() for view in per_view])
    for name in per_view[0]:
        texels = float(np.mean([view[name][0] for view in per_view]))
        errors_of = [view[name][1] for view in per_view]
        means, p99 = np.array([error.mean() for error in errors_of]), np.quantile(np.concatenate(errors_of), 0.99)
        smaller, by_view = pyramid.mean() / means.mean(), pyramid / means
        remark = "  chosen" if name == CHOSEN else ""
        print(
            f"{name:25} {texels:6.1f} {means.mean():9.6f} {p99:7.4f} {smaller:6.1f}"
            f"  ({by_view.min():.1f} to {by_view.max():.1f}){remark}"
        )
    return {name: float(np.mean([view[name][1].mean() for view in per_view])) for name in per_view[0]}


def draw(means: dict[str, dict[str, float]]) -> Figure:
    """The mean |dp| of every way to sample, by scene."""
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.subplots()
    markers = itertools.cycle("os^D")
    for (title, by_name), colour in zip(means.items(), ("#0072b2", "#d55e00", "#009e73", "#cc79a7"), strict=True):
        axes.plot(list(by_name.values()), list(by_name), next(markers), color=colour, label=title)
    axes.set(xscale="log", xlabel="mean |dp| to the ideal")
    axes.invert_yaxis()
    axes.grid(alpha=0.3)
    axes.legend()
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description="The error of many ways to sample a voxel in the depth image.")
    parser.add_argument("--quick", action="store_true", help="one view of each scene, and fewer voxels")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()), help="where the picture goes")
    arguments = parser.parse_args()
    quick = arguments.quick
    count = 5_000 if quick else 20_000
    box, office = pm.scenes.box().frames()[:180:25], pm.scenes.office_loop().frames()[::114]
    means = {}
    real = pm.scenes.office_loop().frames(noise=1)[::114]
    for name, frames, voxel, sigma, reach in (
        ("BOX, the paper's model", box, 0.1, 0.6, 15.0),
        ("BOX, a sharp model", box, 0.1, 0.1, 15.0),
        ("Office, a Kinect, a sharp model", office, 0.16, 0.16, 5.0),
        ("The same with a Kinect's noise and holes", real, 0.04, 0.04, 5.0),
    ):
        views = [View(frame, voxel, sigma, reach) for frame in frames[: 1 if quick else None]]
        means[name] = print_table(f"{name}: voxels of {voxel:g} m, k = sigma = {sigma:g} m", views, count)
    picture = arguments.folder / "area_sampling.png"
    draw(means).savefig(picture)
    print(f"drawn in {picture}")


if __name__ == "__main__":
    main()
