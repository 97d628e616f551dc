"""Two maps, voxel by voxel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._core import OccupancyGrid
from ..pictures.slices import BLOCK
from .facts import Facts, map_facts

STATES = ("unknown", "free", "occupied")
THRESHOLDS = (0.0, 0.001, 0.01, 0.1, 1.0, 10.0)
"""Log-odds; of each it is counted how many voxels differ by more."""

_BLOCKS_AT_ONCE = 4096
"""Bounds the memory of comparing: 16 MB of log-odds."""
_PARAMETERS = ("update", "sigma", "k", "surface_offset", "max_range", "beyond_max_range", "clamp", "prior", "frames")


@dataclass(frozen=True)
class Worst:
    """The voxel that differs most.

    Attributes:
        voxel: Its index.
        log_odds: What each map says; 0 where unknown.
    """

    voxel: tuple[int, int, int]
    log_odds: tuple[float, float]

    @property
    def difference(self) -> float:
        """Log-odds, either sign."""
        return abs(self.log_odds[1] - self.log_odds[0])


@dataclass(frozen=True)
class Comparison:
    """What two maps have in common, and what not. An unknown voxel has no evidence: its log-odds are 0.

    Attributes:
        blocks: Blocks that both maps hold, only the first, only the second.
        states: (3, 3) voxels by their state in the first map (rows) and the second (columns), as in `STATES`; those
            that both do not know are not counted.
        exceeding: Voxels whose log-odds differ by more than each of `THRESHOLDS`.
        differing: Voxels whose log-odds differ by more than the tolerance.
        mean: Mean difference of log-odds over the voxels that either map knows, without sign.
        worst: The voxel that differs most, if any differs.
    """

    blocks: tuple[int, int, int]
    states: NDArray[np.int64]
    exceeding: NDArray[np.int64]
    differing: int
    mean: float
    worst: Worst | None

    @property
    def known(self) -> int:
        """Voxels that either map knows."""
        return int(self.states.sum())


def compare_maps(first: OccupancyGrid, second: OccupancyGrid, tolerance: float = 0.0) -> Comparison:
    """Compare all voxels that either map knows.

    Args:
        first: One map.
        second: The other.
        tolerance: By how much log-odds may differ.

    Raises:
        ValueError: The voxels have different sizes.
    """
    if first.voxel_size != second.voxel_size:
        raise ValueError(
            f"voxels of {first.voxel_size:g} m and of {second.voxel_size:g} m cannot be compared: "
            "map the data at one resolution"
        )
    blocks, count = np.unique(np.concatenate([first.block_coords(), second.block_coords()]), axis=0, return_counts=True)
    both = int(np.count_nonzero(count == 2))
    states = np.zeros((3, 3), dtype=np.int64)
    exceeding = np.zeros(len(THRESHOLDS), dtype=np.int64)
    differing, total, worst = 0, 0.0, None
    for start in range(0, len(blocks), _BLOCKS_AT_ONCE):
        some = blocks[start : start + _BLOCKS_AT_ONCE]
        a, b = first.block_log_odds(some), second.block_log_odds(some)
        states += np.bincount((3 * _states(a) + _states(b)).ravel(), minlength=9).reshape(3, 3)
        difference = np.abs(b.astype(np.float64) - a)
        exceeding += [np.count_nonzero(difference > threshold) for threshold in THRESHOLDS]
        differing += int(np.count_nonzero(difference > tolerance))
        total += float(difference.sum())
        at = np.unravel_index(np.argmax(difference), difference.shape)
        if difference[at] > (0.0 if worst is None else worst.difference):
            x, y, z = (int(index) for index in BLOCK * some[at[0]].astype(np.int64) + at[1:])
            worst = Worst((x, y, z), (float(a[at]), float(b[at])))
    states[0, 0] = 0
    return Comparison(
        (both, first.num_blocks - both, second.num_blocks - both),
        states,
        exceeding,
        differing,
        total / max(int(states.sum()), 1),
        worst,
    )


def _states(log_odds: NDArray[np.float32]) -> NDArray[np.int64]:
    """Index into `STATES`."""
    return np.where(log_odds == 0, 0, np.where(log_odds < 0, 1, 2))


def comparison_facts(comparison: Comparison, first: OccupancyGrid, second: OccupancyGrid) -> Facts:
    """A comparison as plain data; metres, cubic metres, log-odds."""
    size, worst = first.voxel_size, comparison.worst
    a, b = map_facts(first), map_facts(second)
    return {
        "voxel_size": size,
        "parameters": {name: [a[name], b[name]] for name in _PARAMETERS if a[name] != b[name]},
        "blocks": dict(zip(("both", "first", "second"), comparison.blocks, strict=True)),
        "known": comparison.known,
        "states": {
            f"{STATES[i]} -> {STATES[j]}": int(comparison.states[i, j]) for i in range(3) for j in range(3) if i or j
        },
        "volumes": {
            name: [
                float(comparison.states.sum(axis=1)[i] * size**3),
                float(comparison.states.sum(axis=0)[i] * size**3),
            ]
            for i, name in enumerate(STATES)
            if i
        },
        "differing": comparison.differing,
        "exceeding": {f"{threshold:g}": int(n) for threshold, n in zip(THRESHOLDS, comparison.exceeding, strict=True)},
        "mean_difference": comparison.mean,
        "worst": worst
        and {
            "voxel": list(worst.voxel),
            "centre": [(index + 0.5) * size for index in worst.voxel],
            "log_odds": list(worst.log_odds),
            "difference": worst.difference,
        },
    }
