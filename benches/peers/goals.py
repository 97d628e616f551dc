"""The ratios that pyramap holds itself to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median

from .accuracy import Errors
from .systems import AREA, OPEN3D, PYOCTOMAP, PYRAMID, Rule
from .turns import MeshTimes, Turns

FINEST = 0.02
"""The voxel size in metres at which mapping costs most, and for which the strictest goals are set."""

Key = tuple[str, int]
"""A system's name and its number of threads."""


@dataclass(frozen=True)
class Goal:
    """One ratio.

    Attributes:
        what: Which times or errors it is of.
        at_most: What it should be.
        ratios: What it was, in each round.
    """

    what: str
    at_most: float
    ratios: Sequence[float]

    @property
    def ratio(self) -> float:
        """The median over the rounds."""
        return median(self.ratios)

    @property
    def reached(self) -> bool:
        """Whether the median is small enough."""
        return self.ratio <= self.at_most


def goals(
    turns: Sequence[Turns], meshes: MeshTimes, errors: dict[float, dict[Rule, Errors]], threads: int
) -> list[Goal]:
    """All that can be told from what was measured.

    Args:
        turns: One of each voxel size.
        meshes: Those timed, at the smallest voxel size.
        errors: By voxel size.
        threads: The most that a system was given.
    """
    result = []
    for at in turns:
        size = f"{at.voxel_size:g} m"
        for what, at_most, key, base in _time_goals(at.voxel_size, threads):
            if key != base and key in at.times and base in at.times:
                result.append(Goal(f"{size}: time of {what}", at_most, at.ratios(key, base)))
        if at.voxel_size in errors:
            ratio = errors[at.voxel_size]["area"].to_pyramid
            result.append(Goal(f"{size}: mean error to the ideal of area / pyramid", 1 / 8, [ratio]))
    key, base = (PYRAMID.name, threads), (OPEN3D.name, threads)
    if key in meshes.seconds and base in meshes.seconds:
        what = f"mesh: time a triangle of pyramap / Open3D, {threads} threads"
        result.append(Goal(what, 0.5, meshes.ratios(key, base)))
    return result


def _time_goals(voxel_size: float, threads: int) -> Iterator[tuple[str, float, Key, Key]]:
    pyramid, finest = (PYRAMID.name, threads), voxel_size <= FINEST
    yield f"pyramid / Open3D, {threads} threads", 0.7 if finest else 1.0, pyramid, (OPEN3D.name, threads)
    yield f"area / pyramid, {threads} threads", 1.0, (AREA.name, threads), pyramid
    if finest:
        yield "pyramid / pyoctomap, 1 thread", 1 / 80, (PYRAMID.name, 1), (PYOCTOMAP.name, 1)
        yield f"pyramid, {threads} threads / 1", 0.62, pyramid, (PYRAMID.name, 1)
