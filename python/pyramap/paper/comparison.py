"""One image mapped by several rules, and what each says of every voxel."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from time import perf_counter
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import OccupancyGrid, SensorModel
from ..datasets import Frame

Floats = NDArray[np.float64]
Rule = Literal["pyramid", "min_layer", "area", "rays", "ideal"]


class TimedMap(NamedTuple):
    """A map of one image, and the seconds that it took."""

    grid: OccupancyGrid
    seconds: float


def probability(log_odds: NDArray[np.floating]) -> Floats:
    """Eq. 5."""
    return np.asarray(1 - 1 / (1 + np.exp(log_odds.astype(np.float64))))


def maps_of(
    frame: Frame, voxel_size: float, model: SensorModel, max_range: float, rules: Iterable[Rule]
) -> dict[Rule, TimedMap]:
    """The map of one image by each rule, on the CPU."""
    maps = {}
    for rule in rules:
        grid = OccupancyGrid(voxel_size, model, max_range=max_range, update=rule, backend="cpu")
        start = perf_counter()
        grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
        maps[rule] = TimedMap(grid, perf_counter() - start)
    return maps


def occupancies(maps: Mapping[Rule, TimedMap]) -> dict[Rule, Floats]:
    """(N,) by rule: of all voxels that any of the maps knows; 0.5 where that map does not."""
    coords = np.unique(np.concatenate([grid.block_coords() for grid, _ in maps.values()]), axis=0)
    log_odds = {rule: grid.block_log_odds(coords).ravel() for rule, (grid, _) in maps.items()}
    known = np.any([values != 0 for values in log_odds.values()], axis=0)
    return {rule: probability(values[known]) for rule, values in log_odds.items()}
