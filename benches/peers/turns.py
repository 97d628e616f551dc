"""Timing in turns: every system fuses the same frames within the same seconds, so that a slow spell hits all alike."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from .worker import Worker

TURNS = 3
"""Into how many turns a system's frames of one round are split."""

TURN_SECONDS = 0.3
"""A system that takes longer for its turn leaves out the rest of the turn's frames."""

Times = list[dict[int, float]]
"""Of one system: for each round, seconds a frame by the frame's index."""


@dataclass
class Turns:
    """What was timed at one voxel size.

    Attributes:
        voxel_size: In metres.
        times: By the system's name and its number of threads.
    """

    voxel_size: float
    times: dict[tuple[str, int], Times] = field(default_factory=lambda: defaultdict(list))

    def quartiles_ms(self, key: tuple[str, int]) -> tuple[float, float, float]:
        """Lower quartile, median and upper quartile of milliseconds a frame, over all rounds and frames."""
        seconds = [value for times in self.times[key] for value in times.values()]
        low, middle, high = 1e3 * np.percentile(seconds, [25, 50, 75])
        return float(low), float(middle), float(high)

    def round_medians_ms(self, key: tuple[str, int]) -> list[float]:
        """The median of milliseconds a frame, of each round."""
        return [1e3 * median(times.values()) for times in self.times[key]]

    def ratios(self, key: tuple[str, int], base: tuple[str, int]) -> list[float]:
        """Of each round: the median time of one system over that of another, on the frames that both fused."""
        return [
            median(ours[index] for index in common) / median(theirs[index] for index in common)
            for ours, theirs in zip(self.times[key], self.times[base], strict=True)
            if (common := ours.keys() & theirs.keys())
        ]


def time_frames(
    workers: Sequence[Worker], voxel_size: float, frames: int, rounds: int, tell: Callable[[str], None]
) -> Turns:
    """Times `rounds` rounds, in each of which every system makes a new map of the frames; `tell` hears of each.

    The order of the systems moves on by one from round to round, so that none always follows the same one.
    """
    result = Turns(voxel_size)
    parts = [part.tolist() for part in np.array_split(np.arange(frames), min(TURNS, frames))]
    for number in range(rounds):
        tell(f"{voxel_size:g} m: round {number + 1} of {rounds}")
        order = [*workers[number % len(workers) :], *workers[: number % len(workers)]]
        for worker in order:
            worker.new_map(voxel_size)
            result.times[worker.system.name, worker.threads].append({})
        for part in parts:
            for worker in order:
                result.times[worker.system.name, worker.threads][-1].update(worker.fuse(part, TURN_SECONDS))
    return result


@dataclass
class MeshTimes:
    """Meshes of the map of all frames.

    Attributes:
        triangles: By the system's name and its number of threads.
        seconds: The same, one of each round.
    """

    triangles: dict[tuple[str, int], int] = field(default_factory=dict)
    seconds: dict[tuple[str, int], list[float]] = field(default_factory=lambda: defaultdict(list))

    def ns_per_triangle(self, key: tuple[str, int]) -> list[float]:
        """Of each round."""
        return [1e9 * seconds / self.triangles[key] for seconds in self.seconds[key]]

    def ratios(self, key: tuple[str, int], base: tuple[str, int]) -> list[float]:
        """Of each round: the time a triangle of one system over that of another."""
        pairs = zip(self.ns_per_triangle(key), self.ns_per_triangle(base), strict=True)
        return [ours / theirs for ours, theirs in pairs]


def time_meshes(workers: Sequence[Worker], voxel_size: float, frames: int, rounds: int) -> MeshTimes:
    """Each system maps all frames; then they extract their surfaces in turns, `rounds` times."""
    result = MeshTimes()
    for worker in workers:
        worker.new_map(voxel_size)
        worker.fuse(range(frames))
    for _ in range(rounds):
        for worker in workers:
            key = worker.system.name, worker.threads
            seconds, result.triangles[key] = worker.mesh()
            result.seconds[key].append(seconds)
    return result
