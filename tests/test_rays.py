"""Rays: each is stopped where a naive program finds it, which cuts the ray at all planes between voxels and looks at
the middle of every piece."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
import pyramap as pm
import pytest
from frames import make_grid, map_of, random_frames, wall
from hypothesis import given, settings
from hypothesis import strategies as st
from naive_map import OCCUPIED, UNKNOWN, DenseMap, Floats, dense_map
from numpy.typing import ArrayLike, NDArray

Words = Literal["stop", "pass"]
NOTHING = np.iinfo(np.int32).min
TOUCH = 1e-9
"""Metres. A ray that cuts so little of a voxel may as well miss it: coordinates of a few metres are rounded by 1e-15,
and rays that run through edges of voxels are decided by that. Of a million random rays some 1 in 1e5 cut so little."""


class Hits(NamedTuple):
    distance: Floats
    state: NDArray[np.int8]
    voxel: NDArray[np.int64]


def naive_cast(world: DenseMap, origins: Floats, directions: Floats, max_range: float, unknown: Words) -> Hits:
    """The first voxel of which a ray cuts more than TOUCH, or that contains the origin, and that stops it."""
    size = world.voxel_size
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    count = math.ceil(max_range / size) + 2
    planes = np.floor(origins / size)[:, :, None] + np.arange(-count, count + 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossed = (planes * size - origins[:, :, None]) / directions[:, :, None]
    crossed = np.where((crossed > 0) & (crossed < max_range), crossed, 0.0).reshape(len(origins), -1)
    # As many as there can be beyond 0; the others are 0.
    crossed = np.sort(crossed, axis=1)[:, -3 * count :]
    ends = np.full((len(origins), 1), max_range)
    begins, ends = crossed, np.concatenate([crossed[:, 1:], ends], axis=1)
    middles = origins[:, None] + (0.5 * (begins + ends))[:, :, None] * directions[:, None]

    voxels = np.concatenate([origins[:, None], middles], axis=1)
    voxels = np.floor(voxels / size).astype(np.int64)
    begins = np.concatenate([np.zeros((len(origins), 1)), begins], axis=1)
    counts = np.concatenate([np.ones((len(origins), 1), bool), ends - begins[:, 1:] > TOUCH], axis=1)
    states = world.state(voxels)
    stopping = counts & ((states == OCCUPIED) | ((states == UNKNOWN) & (unknown == "stop")))

    stopped, first = stopping.any(axis=1), stopping.argmax(axis=1)
    rows = np.arange(len(origins))
    return Hits(
        np.where(stopped, begins[rows, first], np.inf),
        np.where(stopped, states[rows, first], 0).astype(np.int8),
        np.where(stopped[:, None], voxels[rows, first], NOTHING),
    )


def gap(world: DenseMap, voxels: NDArray[np.int32], points: Floats) -> Floats:
    """How far points are from voxels, on the axis where that is most, metres."""
    low = voxels * world.voxel_size
    beyond = np.maximum(low - points, points - (low + world.voxel_size))
    farthest: Floats = np.maximum(beyond, 0).max(axis=1)
    return farthest


def assert_agree(
    grid: pm.OccupancyGrid, world: DenseMap, origins: Floats, directions: Floats, max_range: float, unknown: Words
) -> pm.RayHits:
    """Holds rays against the naive program. A ray may stop earlier, in a voxel that it touches and that stops rays."""
    hits = grid.cast_rays(origins, directions, max_range, unknown)
    naive = naive_cast(world, origins, directions, max_range, unknown)
    assert len(hits) == len(origins)
    assert hits.distance.dtype == np.float64
    assert hits.state.dtype == np.int8
    assert hits.voxel.dtype == np.int32
    same = (hits.voxel == naive.voxel).all(axis=1) & (hits.state == naive.state)
    with np.errstate(invalid="ignore"):
        same &= (hits.distance == naive.distance) | (np.abs(hits.distance - naive.distance) < 1e-12)

    others = np.flatnonzero(~same)
    where = hits.distance[others]
    assert np.all(where <= naive.distance[others] + TOUCH), (origins[others], directions[others])
    stops = world.state(hits.voxel[others].astype(np.int64))
    assert np.all((stops == OCCUPIED) | ((stops == UNKNOWN) & (unknown == "stop")))
    np.testing.assert_array_equal(hits.state[others], stops)
    units = directions[others] / np.linalg.norm(directions[others], axis=1, keepdims=True)
    assert np.all(gap(world, hits.voxel[others], origins[others] + where[:, None] * units) < TOUCH)
    # Beyond the rays through edges, which are drawn on purpose in some tests, hardly any touches anything.
    if len(origins) > 10_000:
        assert len(others) < 1e-4 * len(origins)
    return hits


GRIDS = {
    "room": map_of(random_frames(6, seed=3), voxel_size=0.1),
    "biased": map_of(random_frames(3, seed=4), voxel_size=0.125, prior=0.3),
    "few": map_of(random_frames(1, seed=5), voxel_size=0.0625, max_range=1.5),
}
WORLDS = {name: dense_map(grid) for name, grid in GRIDS.items()}


@pytest.mark.parametrize("unknown", ["stop", "pass"])
@pytest.mark.parametrize("name", ["room", "biased"])
def test_a_million_random_rays(name: str, unknown: Words) -> None:
    rng = np.random.default_rng(11)
    grid, world = GRIDS[name], WORLDS[name]
    low, high = np.asarray(grid.bounds) + np.array([[-0.3], [0.3]])
    stopped = {UNKNOWN: 0, OCCUPIED: 0}
    for _ in range(25):
        origins = rng.uniform(low, high, (10_000, 3))
        # Half of them in free space: outside, the first voxel already stops most.
        free = grid.voxel_centres(rng.choice(grid.free_voxels(), 5_000))
        origins[:5_000] = free + rng.uniform(-0.5, 0.5, (5_000, 3)) * world.voxel_size
        directions = rng.standard_normal((10_000, 3)) * 10.0 ** rng.uniform(-3, 3, (10_000, 1))
        hits = assert_agree(grid, world, origins, directions, 2.0, unknown)
        for state in stopped:
            stopped[state] += int(np.sum((hits.state == state) & (hits.distance > 0)))
    # The test is about rays that get somewhere.
    assert stopped[OCCUPIED] > 10_000
    assert (stopped[UNKNOWN] > 10_000) == (unknown == "stop")


@settings(max_examples=300, deadline=None)
@given(
    name=st.sampled_from(["biased", "few"]),
    origin=st.tuples(*[st.integers(-100, 100)] * 3),
    direction=st.tuples(*[st.integers(-3, 3)] * 3).filter(any),
    max_range=st.sampled_from([0.01, 0.5, 4.0]),
    unknown=st.sampled_from(["stop", "pass"]),
)
def test_rays_through_faces_edges_and_corners(
    name: str,
    origin: tuple[int, int, int],
    direction: tuple[int, int, int],
    max_range: float,
    unknown: Words,
) -> None:
    """On a lattice of quarters of voxels whose sizes are powers of two: faces, edges and corners are met exactly."""
    world = WORLDS[name]
    origins = np.array([origin]) * world.voxel_size / 4
    assert_agree(GRIDS[name], world, origins, np.array([direction], float), max_range, unknown)


@pytest.mark.parametrize("name", ["biased", "few"])
@pytest.mark.parametrize("unknown", ["stop", "pass"])
def test_many_rays_through_faces_edges_and_corners(name: str, unknown: Words) -> None:
    """The same, as many at once as to be looked up in the other way."""
    rng = np.random.default_rng(15)
    grid, world = GRIDS[name], WORLDS[name]
    assert len(grid.block_coords()) < 10_000 / 8
    origins = rng.integers(4 * world.first, 4 * (world.first + world.states.shape), (10_000, 3)) * world.voxel_size / 4
    directions = rng.integers(-3, 4, (10_000, 3)).astype(float)
    directions[~directions.any(axis=1)] = [0, -1, 0]
    assert_agree(grid, world, origins, directions, 3.0, unknown)


def test_one_altered_voxel_is_noticed() -> None:
    grid = GRIDS["few"]
    origins = grid.voxel_centres(grid.free_voxels())
    directions = np.tile([0.3, -0.5, 1.0], (len(origins), 1))
    world = dense_map(grid)
    hits = assert_agree(grid, world, origins, directions, 3.0, "pass")
    x, y, z = hits.voxel[hits.state == OCCUPIED][0] - world.first
    world.states[x, y, z] = UNKNOWN
    with pytest.raises(AssertionError):
        assert_agree(grid, world, origins, directions, 3.0, "pass")


@pytest.mark.parametrize("name", sorted(GRIDS))
@pytest.mark.parametrize("unknown", ["stop", "pass"])
def test_rays_along_axes(name: str, unknown: Words) -> None:
    rng = np.random.default_rng(12)
    grid, world = GRIDS[name], WORLDS[name]
    low, high = np.asarray(grid.bounds)
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    for lattice in (False, True):
        origins = rng.uniform(low, high, (3_000, 3))
        if lattice:  # On faces, edges and corners of voxels.
            origins = np.round(origins / world.voxel_size) * world.voxel_size
            # Where sizes are no powers of two that may lie on either side of a face, for us and for the naive program.
            origins = origins if name != "room" else np.nextafter(origins, np.inf)
        assert_agree(grid, world, origins, axes[rng.integers(0, 6, 3_000)], 5.0, unknown)
        # Minus zero is zero.
        directions = np.where(axes == 0, -0.0, axes)[rng.integers(0, 6, 3_000)]
        assert_agree(grid, world, origins, directions, 5.0, unknown)


@pytest.mark.parametrize("unknown", ["stop", "pass"])
def test_a_ray_alone_is_a_ray_among_many(unknown: Words) -> None:
    """Few rays and many are looked up in different ways, with the same result to the last bit."""
    rng = np.random.default_rng(13)
    grid = GRIDS["room"]
    low, high = np.asarray(grid.bounds)
    origins = rng.uniform(low, high, (20_000, 3))
    directions = rng.standard_normal((20_000, 3))
    many = grid.cast_rays(origins, directions, 3.0, unknown)
    for row in range(0, 20_000, 40):
        one = grid.cast_rays(origins[row : row + 1], directions[row : row + 1], 3.0, unknown)
        assert (one.distance[0], one.state[0]) == (many.distance[row], many.state[row])
        np.testing.assert_array_equal(one.voxel[0], many.voxel[row])


def test_a_wall() -> None:
    grid = map_of([wall(2.0)])
    ahead = [0.0, 0.0, 1.0]
    hit = grid.cast_rays([[0.01, 0.01, 0.51]], [ahead], 5.0)
    # The first occupied voxel lies 1.48 sigma, that is, one voxel or two, in front of the wall (Eq. 7).
    distance = hit.distance[0]
    assert 1.4 <= distance + 0.01 <= 1.5
    assert hit.state[0] == OCCUPIED
    np.testing.assert_array_equal(hit.voxel[0], [0, 0, round((0.51 + distance) / 0.05)])
    # Inside what is occupied, and in what nobody has seen, with either word.
    behind: dict[Words, float] = {"stop": 0.0, "pass": np.inf}
    for unknown, distance in behind.items():
        inside = grid.cast_rays([grid.voxel_centres(hit.voxel)[0], [0, 0, 4.0]], [ahead, ahead], 5.0, unknown)
        np.testing.assert_array_equal(inside.distance, [0.0, distance])
        np.testing.assert_array_equal(inside.state, [OCCUPIED, UNKNOWN if unknown == "stop" else 0])
    # From behind, through the unknown, and from far outside.
    back = grid.cast_rays([[0.01, 0.01, 4.0], [0.01, 0.01, 1e6]], [[0, 0, -1]] * 2, math.inf, "pass")
    assert np.all(back.state == OCCUPIED)
    assert back.distance[1] - back.distance[0] == pytest.approx(1e6 - 4.0, abs=1e-6)
    np.testing.assert_array_equal(back.voxel[0], back.voxel[1])


def test_what_nothing_stops() -> None:
    grid = map_of([wall(2.0)])
    origins = [[0.0, 0.0, 1.0], [50.0, 0.0, 0.0], [1e8, 1e8, 1e8]]
    hits = grid.cast_rays(origins, [[0, 1, 0]] * 3, math.inf, "pass")
    np.testing.assert_array_equal(hits.distance, [np.inf] * 3)
    np.testing.assert_array_equal(hits.state, [0] * 3)
    np.testing.assert_array_equal(hits.voxel, np.full((3, 3), NOTHING))
    assert repr(hits) == "RayHits(3 rays, 0 stopped)"
    # Too short to get there.
    assert grid.cast_rays([[0, 0, 1.0]], [[0, 0, 1]], 0.5).distance[0] == np.inf
    # Nothing is known, or nothing is asked.
    empty = make_grid()
    np.testing.assert_array_equal(empty.cast_rays(origins, [[0, 1, 0]] * 3, 5.0, "pass").distance, [np.inf] * 3)
    np.testing.assert_array_equal(empty.cast_rays(origins, [[0, 1, 0]] * 3, 5.0).state, [UNKNOWN] * 3)
    assert len(grid.cast_rays(np.zeros((0, 3)), np.zeros((0, 3)), 5.0)) == 0


def test_max_range_is_where_the_voxel_is_entered() -> None:
    grid = map_of([wall(2.0)], voxel_size=0.0625)
    origin, ahead = [[0.03125, 0.03125, 1.0]], [[0, 0, 3.0]]
    distance = grid.cast_rays(origin, ahead, 5.0).distance[0]
    assert distance % 0.0625 == 0
    assert grid.cast_rays(origin, ahead, distance).distance[0] == distance
    assert grid.cast_rays(origin, ahead, np.nextafter(distance, 0)).distance[0] == np.inf


def test_one_origin_for_all() -> None:
    grid = GRIDS["room"]
    directions = np.random.default_rng(14).standard_normal((50, 3))
    one = grid.cast_rays([0.1, 0.2, 0.3], directions, 3.0)
    many = grid.cast_rays([[0.1, 0.2, 0.3]] * 50, directions, 3.0)
    np.testing.assert_array_equal(one.distance, many.distance)


def test_any_length_of_direction_will_do() -> None:
    grid = map_of([wall(2.0)])
    lengths = [1e-320, 1e-200, 1.0, 1e200, 1.7e308]
    hits = grid.cast_rays([0.01, 0.01, 0.5], [[0.0, 0.0, length] for length in lengths], 5.0)
    assert len(set(hits.distance)) == 1
    tilted = grid.cast_rays([0.01, 0.01, 0.5], [[1e-320, -1e-310, 1.0], [0.0, 0.0, 1.0]], 5.0)
    assert len(set(tilted.distance)) == 1


@pytest.mark.parametrize(
    ("origins", "directions", "max_range", "unknown", "message"),
    [
        ([[0, 0, 0]], [[0, 0, 0]], 1.0, "stop", r"directions is \[0.0, 0.0, 0.0\] in row 0, expected .* but zero"),
        ([[0, 0, 0]] * 2, [[0, 0, 1], [0, math.nan, 1]], 1.0, "stop", r"directions is \[0.0, NaN, 1.0\] in row 1"),
        ([[0, 0, 0]], [[math.inf, 0, 0]], 1.0, "stop", r"directions is \[inf, 0.0, 0.0\] in row 0"),
        ([[0, math.nan, 0]], [[0, 0, 1]], 1.0, "pass", r"origins is \[0.0, NaN, 0.0\] in row 0, expected finite"),
        (
            [[0, 0, 2e8]],
            [[0, 0, 1]],
            1.0,
            "pass",
            r"origins is \[0.0, 0.0, 200000000.0\] in row 0, .* within 134217728 m",
        ),
        ([[0, 0, 0]], [[0, 0, 1]] * 2, 1.0, "stop", "number of directions is 2, expected 1, one for each"),
        ([[0, 0, 0]], [[0, 0, 1]], 0.0, "stop", "max_range is 0, expected a positive"),
        ([[0, 0, 0]], [[0, 0, 1]], math.nan, "stop", "max_range is NaN"),
        ([[0, 0, 0]], [[0, 0, 1]], 1.0, "halt", 'unknown is "halt", expected "stop" or "pass"'),
        ([[0, 0]], [[0, 0, 1]], 1.0, "stop", r"origins have shape \[1, 2\], expected \(N, 3\)"),
        ([[0, 0, 0]], [0, 0, 1], 1.0, "stop", r"directions have shape \[3\], expected \(N, 3\)"),
        ("here", [[0, 0, 1]], 1.0, "stop", "origins is a str that is no array of numbers"),
        ([[0, 0, 0]], [["a", "b", "c"]], 1.0, "stop", "directions is a list that is no array of numbers"),
    ],
)
def test_bad_rays_are_refused(
    origins: ArrayLike, directions: ArrayLike, max_range: float, unknown: Words, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        GRIDS["few"].cast_rays(origins, directions, max_range, unknown)
