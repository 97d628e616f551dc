"""Queries at points, of regions and for voxels by their state, held against a dense array of all voxels."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pyramap as pm
import pytest
from frames import make_grid, map_of, random_frames
from naive_map import FREE, OCCUPIED, UNKNOWN, DenseMap, Floats, dense_map
from numpy.typing import ArrayLike

GRIDS = {
    "plain": map_of(random_frames(5, seed=21), voxel_size=0.1),
    "biased": map_of(random_frames(3, seed=22), voxel_size=0.0625, prior=0.35),
}
WORLDS = {name: dense_map(grid) for name, grid in GRIDS.items()}
NAMES = sorted(GRIDS)


def points_around(grid: pm.OccupancyGrid, count: int, seed: int) -> Floats:
    low, high = np.asarray(grid.bounds) + np.array([[-0.5], [0.5]])
    return np.random.default_rng(seed).uniform(low, high, (count, 3))


# ---- points ----


def naive_trilinear(world: DenseMap, prior: float, point: Floats) -> float:
    """0 in an unknown voxel; else the mean of the known among the eight voxels around, weighted by volume."""
    at = point / world.voxel_size
    if world.values(np.floor(at).astype(np.int64)) == 0:
        return 0.0
    total = weights = 0.0
    lowest = np.floor(at - 0.5)
    for step in itertools.product((0, 1), repeat=3):
        voxel = lowest + step
        weight = math.prod(1 - np.abs(at - (voxel + 0.5)))
        value = float(world.values(voxel.astype(np.int64)))
        if value != 0:
            total += weight * value
            weights += weight
    return total / weights


@pytest.mark.parametrize("name", NAMES)
def test_trilinear_is_the_mean_of_known_neighbours(name: str) -> None:
    grid, world = GRIDS[name], WORLDS[name]
    points = points_around(grid, 4_000, seed=1)
    naive = np.array([naive_trilinear(world, grid.prior, point) for point in points])
    log_odds = grid.log_odds(points, interpolation="trilinear")
    assert log_odds.dtype == np.float32
    # What is summed here are log-odds of up to 10, rounded to float32 already: 1e-6 of them.
    np.testing.assert_allclose(log_odds, naive, atol=1e-5)
    np.testing.assert_array_equal(log_odds == 0, grid.state(points) == UNKNOWN)
    probability = grid.probability(points, interpolation="trilinear")
    expected = np.where(grid.state(points) == UNKNOWN, grid.prior, 1 / (1 + np.exp(-naive)))
    np.testing.assert_allclose(probability, expected, atol=1e-5)
    # Points where knowledge ends, and in unknown, free and occupied voxels, are among them.
    assert {-1, 0, 1} == set(grid.state(points))


@pytest.mark.parametrize("name", NAMES)
def test_trilinear_has_the_voxels_values_at_their_centres(name: str) -> None:
    grid = GRIDS[name]
    centres = grid.voxel_centres(np.concatenate([grid.free_voxels(), grid.occupied_voxels()]))
    # A centre is rounded, by 1e-16 of a few metres; the values of neighbours differ by 10 at most.
    np.testing.assert_allclose(grid.log_odds(centres, "trilinear"), grid.log_odds(centres), atol=1e-6)
    np.testing.assert_array_equal(grid.log_odds(centres, "nearest"), grid.log_odds(centres))


@pytest.mark.parametrize("name", NAMES)
def test_few_points_and_many_have_the_same_answers(name: str) -> None:
    grid, world = GRIDS[name], WORLDS[name]
    points = points_around(grid, 20_000, seed=2)
    questions: list[Callable[[Floats], np.ndarray]] = [
        grid.log_odds,
        grid.probability,
        grid.state,
        lambda points: grid.log_odds(points, "trilinear"),
    ]
    for ask in questions:
        few = np.concatenate([ask(points[row : row + 1]) for row in range(500)])
        np.testing.assert_array_equal(few, ask(points)[:500])
    voxels = np.floor(points / grid.voxel_size).astype(np.int64)
    np.testing.assert_array_equal(grid.state(points), world.state(voxels))
    np.testing.assert_array_equal(grid.log_odds(points), world.values(voxels))


def test_points_beyond_all_coordinates_are_unknown() -> None:
    grid = GRIDS["plain"]
    far = [[1e300, 0, 0], [0, -1e12, 0], [2.2e8, 2.2e8, 2.2e8], [-2.2e8, 0, 0]]
    for points in (far, far * 5_000):
        assert not grid.log_odds(points).any()
        assert not grid.log_odds(points, "trilinear").any()
        np.testing.assert_array_equal(grid.state(points), [UNKNOWN] * len(points))


def test_points_of_any_kind_of_array() -> None:
    grid = GRIDS["plain"]
    points = points_around(grid, 300, seed=3)
    expected = grid.state(points)
    for same in (points.tolist(), np.asfortranarray(points), points.repeat(2, axis=0)[::2], points.astype(">f8")):
        np.testing.assert_array_equal(grid.state(same), expected)
    points.setflags(write=False)
    np.testing.assert_array_equal(grid.state(points), expected)
    assert grid.state(np.zeros((0, 3))).shape == (0,)


# ---- regions ----


@pytest.mark.parametrize("name", NAMES)
def test_dense_holds_every_voxel(name: str) -> None:
    grid, world = GRIDS[name], WORLDS[name]
    rng = np.random.default_rng(4)
    regions = [
        np.asarray(grid.bounds),
        *(np.sort(points_around(grid, 2, seed), axis=0) for seed in rng.integers(99, size=9)),
    ]
    for region in regions:
        values, first = grid.dense(region)
        assert values.dtype == np.float32
        assert first.dtype == np.int32
        assert first.shape == (3,)
        voxels = first.astype(np.int64) + np.moveaxis(np.indices(values.shape), 0, -1)
        np.testing.assert_array_equal(values, world.values(voxels))
        # All voxels whose centres lie in the region, and no others.
        size = grid.voxel_size
        np.testing.assert_array_equal(first, np.ceil(region[0] / size - 0.5))
        np.testing.assert_array_equal(first + values.shape, np.ceil(region[1] / size - 0.5))
    assert np.count_nonzero(grid.dense(regions[0])[0]) == grid.num_observed


def test_a_region_of_whole_voxels_has_these_voxels() -> None:
    grid = make_grid(voxel_size=0.1)
    # 0.7 / 0.1 and the like are not whole numbers.
    for low, high in itertools.product((-0.3, 0.0, 0.6), (0.7, 1.1, 2.3)):
        values, first = grid.dense([[low] * 3, [high] * 3])
        assert values.shape == (round(10 * (high - low)),) * 3
        np.testing.assert_array_equal(first, [round(10 * low)] * 3)
    assert grid.dense([[0.01] * 3, [0.02] * 3])[0].shape == (0, 0, 0)


@pytest.mark.parametrize(
    ("region", "message"),
    [
        (
            [[0, 0, 0], [1000, 1000, 1000]],
            "region is 10000 x 10000 x 10000 voxels, 4000000000000 bytes, expected at most",
        ),
        ([[-math.inf] * 3, [math.inf] * 3], "expected at most 2147483648 voxels"),
        ([[0, 0, 1], [1, 1, 1]], r"region is .*, expected a low corner below the high one"),
        ([[0, 0, math.nan], [1, 1, 1]], r"region is \[0.0, 0.0, NaN\]"),
        ([0, 0, 0, 1, 1, 1], r"region has shape \[6\], expected \(2, 3\)"),
    ],
)
def test_bad_regions_are_refused(region: ArrayLike, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        GRIDS["plain"].dense(region)


# ---- voxels ----


@pytest.mark.parametrize("name", NAMES)
def test_voxels_by_their_state(name: str) -> None:
    grid, world = GRIDS[name], WORLDS[name]
    unknown, free = np.pad(world.states, 1, constant_values=UNKNOWN) == UNKNOWN, world.states == FREE
    beside = np.zeros_like(unknown)
    for axis, step in itertools.product(range(3), (-1, 1)):
        beside |= np.roll(np.pad(free, 1), step, axis)
    for found, expected in (
        (grid.occupied_voxels(), np.argwhere(world.states == OCCUPIED)),
        (grid.free_voxels(), np.argwhere(free)),
        (grid.unknown_voxels_next_to_free(), np.argwhere(unknown & beside) - 1),
    ):
        assert found.dtype == np.int32
        assert found.ndim == 2
        assert len(found) > 100
        expected = expected + world.first
        # By block, and in each by x, y, z.
        order = np.lexsort([*(expected % 8).T[::-1], *(expected // 8).T[::-1]])
        np.testing.assert_array_equal(found, expected[order])


def test_an_empty_map_has_no_voxels() -> None:
    grid = make_grid()
    for voxels in (grid.occupied_voxels(), grid.free_voxels(), grid.unknown_voxels_next_to_free()):
        assert voxels.shape == (0, 3)
    assert grid.voxel_centres(grid.free_voxels()).shape == (0, 3)


def test_centres_of_voxels() -> None:
    grid = GRIDS["plain"]
    indices = [[0, 0, 0], [-1, 5, 2**31 - 1]]
    np.testing.assert_array_equal(grid.voxel_centres(indices), (np.array(indices) + 0.5) * 0.1)
    voxels = grid.occupied_voxels()
    np.testing.assert_array_equal(grid.state(grid.voxel_centres(voxels)), [OCCUPIED] * len(voxels))


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (
            lambda grid: grid.state([[0, 0, 0], [1, math.nan, 1]]),
            r"points is \[1.0, NaN, 1.0\] in row 1, expected finite",
        ),
        (lambda grid: grid.log_odds([[0, math.inf, 0]], "trilinear"), r"points is \[0.0, inf, 0.0\] in row 0"),
        (lambda grid: grid.log_odds([0, 0, 0]), r"points have shape \[3\], expected \(N, 3\)"),
        (
            lambda grid: grid.probability([[0, 0, 0]], "cubic"),
            'interpolation is "cubic", expected "nearest" or "trilinear"',
        ),
        (lambda grid: grid.voxel_centres([[0.5, 0, 0]]), "indices have dtype float64"),
        (lambda grid: grid.voxel_centres([[2**31, 0, 0]]), "indices hold 2147483648, expected numbers of 32 bits"),
    ],
)
def test_bad_questions_are_refused(ask: Callable[[pm.OccupancyGrid], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ask(GRIDS["plain"])
