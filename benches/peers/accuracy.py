"""How far each of pyramap's rules is from the ideal (Eq. 8, 9), on single frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyramap as pm
from numpy.typing import NDArray

from .frames import Frame, FrameFile
from .systems import PyramapMap, Rule

IDEAL: Rule = "ideal"
RULES: tuple[Rule, ...] = ("pyramid", "area", "min_layer")

BLOCKS = 2000
"""How many blocks of 512 voxels are compared in a frame, drawn with a fixed seed."""


@dataclass(frozen=True)
class Errors:
    """Of one rule to the ideal, over the voxels that any of the rules knows, the ideal included.

    Attributes:
        mean: Of |dp|, p the probability that a voxel is occupied; 0.5 where a rule knows nothing.
        p99: Its 99th percentile.
        mean_where_known: The mean over the voxels that both the rule and the ideal know.
        missed: The share of voxels that the ideal knows and the rule does not.
        added: The share of voxels that the rule knows and the ideal does not.
        to_pyramid: `mean` over that of `pyramid`.
        voxels: How many were compared.
    """

    mean: float
    p99: float
    mean_where_known: float
    missed: float
    added: float
    to_pyramid: float
    voxels: int


def compare_rules(frames: FrameFile, count: int, voxel_size: float) -> dict[Rule, Errors]:
    """The errors by rule, over the same `count` frames, spread evenly, each mapped by itself."""
    chosen = [frames[int(i)] for i in np.linspace(0, len(frames), count, endpoint=False)]
    log_odds = np.concatenate([_log_odds(frame, voxel_size) for frame in chosen], axis=1)
    ideal, *rules = log_odds[:, (log_odds != 0).any(axis=0)]
    pyramid = float(_errors(rules[RULES.index("pyramid")], ideal).mean())
    return {name: _summary(rule, ideal, pyramid) for name, rule in zip(RULES, rules, strict=True)}


def _summary(rule: NDArray[np.float32], ideal: NDArray[np.float32], mean_of_pyramid: float) -> Errors:
    errors = _errors(rule, ideal)
    return Errors(
        mean=float(errors.mean()),
        p99=float(np.percentile(errors, 99)),
        mean_where_known=float(errors[(rule != 0) & (ideal != 0)].mean()),
        missed=float(((rule == 0) & (ideal != 0)).mean()),
        added=float(((rule != 0) & (ideal == 0)).mean()),
        to_pyramid=float(errors.mean() / mean_of_pyramid),
        voxels=len(errors),
    )


def _errors(rule: NDArray[np.float32], ideal: NDArray[np.float32]) -> NDArray[np.float64]:
    errors: NDArray[np.float64] = np.abs(_probability(rule) - _probability(ideal))
    return errors


def _log_odds(frame: Frame, voxel_size: float) -> NDArray[np.float32]:
    """(1 + rules, voxels): of the ideal, then of each rule, for the voxels of the drawn blocks."""
    maps = [_map(rule, frame, voxel_size) for rule in (IDEAL, *RULES)]
    coords = np.unique(np.concatenate([map.block_coords() for map in maps]), axis=0)
    if len(coords) > BLOCKS:
        coords = np.random.default_rng(0).choice(coords, BLOCKS, replace=False)
    return np.array([map.block_log_odds(coords).ravel() for map in maps])


def _map(rule: Rule, frame: Frame, voxel_size: float) -> pm.OccupancyGrid:
    map = PyramapMap(voxel_size, rule)
    map.integrate(map.prepare(frame))
    return map.grid


def _probability(log_odds: NDArray[np.float32]) -> NDArray[np.float64]:
    probability: NDArray[np.float64] = 1 / (1 + np.exp(-log_odds.astype(np.float64)))
    return probability
