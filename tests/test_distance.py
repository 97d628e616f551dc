"""Distance fields against scipy on dense arrays, kept up to date through every kind of change."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import pyramap as pm
import pytest
from frames import MAX_RANGE, VOXEL_SIZE, Frame, make_grid, map_of, random_frames, wall
from naive_map import OCCUPIED, UNKNOWN, dense_map
from numpy.typing import NDArray
from real_data import real
from scipy import ndimage
from scipy.interpolate import RegularGridInterpolator

Unknown = Literal["free", "occupied"]
UNKNOWN_AS: tuple[Unknown, Unknown] = ("free", "occupied")
Floats = NDArray[np.float64]

EXACT = 1e-5
"""Metres. Distances of a few metres as float32 are rounded by 1e-7."""


def by_scipy(grid: pm.OccupancyGrid, max_distance: float, unknown: Unknown) -> tuple[Floats, NDArray[np.int64]]:
    """Signed distances of all voxels within `max_distance` of the map and some beyond, and the index of the first."""
    world = dense_map(grid)
    reach = int(np.ceil(max_distance / grid.voxel_size)) + 9
    states = np.pad(world.states, reach, constant_values=UNKNOWN)
    occupied = (states == OCCUPIED) | ((states == UNKNOWN) & (unknown == "occupied"))
    outside = ndimage.distance_transform_edt(~occupied, sampling=grid.voxel_size)
    inside = ndimage.distance_transform_edt(occupied, sampling=grid.voxel_size)
    signed: Floats = np.clip(np.where(occupied, -inside, outside), -max_distance, max_distance)
    return signed, world.first - reach


def region_of(first: NDArray[np.int64], shape: tuple[int, ...], voxel_size: float) -> Floats:
    return np.array([first, first + shape]) * voxel_size


def assert_is_scipys(field: pm.DistanceField, grid: pm.OccupancyGrid) -> None:
    expected, first = by_scipy(grid, field.max_distance, field.unknown)
    got, got_first = field.dense(region_of(first, expected.shape, grid.voxel_size))
    assert got.shape == expected.shape
    assert (got_first == first).all()
    np.testing.assert_allclose(got, expected, rtol=0, atol=EXACT)
    within = np.abs(expected) < field.max_distance
    assert (within & (expected > 0)).sum() > 1000, "so little is near to anything that nothing is proved"
    assert (within & (expected < 0)).sum() > 100, "so little is inside of anything that nothing is proved"


def assert_same(one: pm.DistanceField, other: pm.DistanceField) -> None:
    """The same bits, wherever the maps of these tests come to from cameras within a metre of the origin."""
    reach = 1 + MAX_RANGE + one.max_distance
    region = [[-reach] * 3, [reach] * 3]
    assert one.dense(region)[0].tobytes() == other.dense(region)[0].tobytes()


@pytest.mark.parametrize("unknown", UNKNOWN_AS)
@pytest.mark.parametrize("max_distance", [VOXEL_SIZE, 0.34, 1.0])
def test_distances_are_those_of_scipy(unknown: Unknown, max_distance: float) -> None:
    grid = map_of(random_frames(3, seed=40))
    field = grid.distance_field(max_distance, unknown)
    expected, first = by_scipy(grid, max_distance, unknown)
    got, _ = field.dense(region_of(first, expected.shape, VOXEL_SIZE))
    np.testing.assert_allclose(got, expected, rtol=0, atol=EXACT)
    assert len(np.unique(np.abs(expected))) >= (1 if max_distance == VOXEL_SIZE else 20)


@pytest.mark.parametrize("unknown", UNKNOWN_AS)
def test_an_update_gives_the_bits_of_a_new_field(unknown: Unknown) -> None:
    frames = random_frames(8, seed=41)
    grid, other = make_grid(voxel_size=0.1), map_of(random_frames(2, seed=42), voxel_size=0.1)
    pose = random_frames(1, seed=43)[0].world_from_camera
    corner = np.array([[-0.7, -0.4, -1.0], [0.5, 0.9, 1.2]])
    changes: list[Callable[[], object]] = [
        *(lambda frame=frame: grid.integrate(*frame) for frame in frames[:6]),
        lambda: grid.remove(*frames[2]),
        lambda: grid.reintegrate(*frames[3], pose),
        lambda: grid.merge(other),
        lambda: grid.decay(0.5),
        lambda: grid.clear(corner),
        lambda: grid.integrate(*frames[6]),
        lambda: grid.crop(corner * 2),
        lambda: grid.integrate(*frames[7]),
    ]
    field = grid.distance_field(0.6, unknown)
    for change in changes:
        change()
        assert_same(field, grid.distance_field(0.6, unknown))
    assert_is_scipys(field, grid)
    grid.clear([[-np.inf] * 3, [np.inf] * 3])
    everything = 0.6 if unknown == "free" else -0.6
    assert (field.dense([[-3.0] * 3, [3.0] * 3])[0] == np.float32(everything)).all()


def test_questions_are_about_the_map_as_it_is() -> None:
    grid = make_grid()
    field = grid.distance_field(1.0)
    before_the_wall = [[0.0, 0.0, 1.0]]
    assert field.distance(before_the_wall) == [1.0]
    grid.integrate(*wall(1.5))
    assert 0.3 < field.distance(before_the_wall)[0] < 0.6
    grid.remove(*wall(1.5))
    assert field.update() > 1000
    assert field.update() == 0
    assert field.distance(before_the_wall) == [1.0]


def test_interpolated_distances_are_linear_between_centres() -> None:
    grid = map_of(random_frames(2, seed=44))
    field = grid.distance_field(0.5)
    distances, first = by_scipy(grid, 0.5, "free")
    axes = [(first[a] + 0.5 + np.arange(distances.shape[a])) * VOXEL_SIZE for a in range(3)]
    low, high = np.array([[axis[0], axis[-1]] for axis in axes]).T
    points = np.random.default_rng(45).uniform(low, high, (20_000, 3))
    expected = RegularGridInterpolator(axes, distances)(points)
    np.testing.assert_allclose(field.distance(points, "trilinear"), expected, rtol=0, atol=EXACT)

    voxels = np.floor(points / VOXEL_SIZE).astype(int) - first
    np.testing.assert_allclose(field.distance(points), distances[tuple(voxels.T)], rtol=0, atol=EXACT)
    assert (np.abs(expected) < 0.5).mean() > 0.05


def test_gradients_are_the_slope_of_what_is_interpolated() -> None:
    field = map_of(random_frames(2, seed=46)).distance_field(0.5)
    rng = np.random.default_rng(47)
    # Between centres the field is linear along each axis; points keep away from where the slope changes.
    cells, within = rng.integers(-40, 40, (5000, 3)), rng.uniform(0.1, 0.9, (5000, 3))
    points = (cells + 0.5 + within) * VOXEL_SIZE
    step = 1e-3
    slopes = [
        field.distance(points + offset, "trilinear").astype(float) - field.distance(points - offset, "trilinear")
        for offset in step * np.eye(3)
    ]
    gradients = field.gradient(points)
    assert gradients.shape == (5000, 3)
    assert gradients.dtype == np.float32
    # Either end is rounded by 3e-8.
    np.testing.assert_allclose(gradients, np.stack(slopes, axis=1) / (2 * step), rtol=0, atol=1e-4)
    assert (np.linalg.norm(gradients, axis=1) > 0.5).sum() > 500


def test_gradients_lead_away_from_a_wall() -> None:
    field = map_of([wall(1.5)]).distance_field(1.0)
    before, farther_than_a_metre = field.gradient([[0.01, 0.02, 1.0], [0.01, 0.02, 0.2]])
    # The wall's front is uneven by a voxel here and there: half a metre away that changes slopes by less than a tenth.
    np.testing.assert_allclose(before, [0, 0, -1], atol=0.1)
    assert farther_than_a_metre.tolist() == [0, 0, 0]


def test_unknown_space_is_free_or_occupied() -> None:
    grid = map_of([wall(1.5)])
    points = [[0.0, 0.0, 1.0], [0.0, 0.0, 2.5], [0.0, 0.0, -1.0]]
    seen, behind, beside = grid.distance_field(0.4, "free").distance(points)
    assert [seen, behind, beside] == [np.float32(0.4)] * 3
    seen, behind, beside = grid.distance_field(0.4, "occupied").distance(points)
    assert seen > 0
    assert [behind, beside] == [-np.float32(0.4)] * 2


def test_an_empty_map_has_a_field() -> None:
    grid = make_grid()
    assert grid.distance_field(1.0, "free").distance([[0.0, 0.0, 0.0], [1e9, -1e300, 0.0]]).tolist() == [1, 1]
    assert grid.distance_field(1.0, "occupied").distance([[0, 0, 0]], "trilinear").tolist() == [-1]
    field = grid.distance_field(1.0)
    assert field.distance(np.empty((0, 3))).shape == (0,)
    assert field.gradient(np.empty((0, 3))).shape == (0, 3)
    assert (field.max_distance, field.voxel_size, field.unknown) == (1.0, VOXEL_SIZE, "free")
    assert repr(field) == 'DistanceField(max_distance=1, unknown="free", voxel_size=0.05)'


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"max_distance": 0.0}, "max_distance is 0,"),
        ({"max_distance": -1.0}, "max_distance is -1,"),
        ({"max_distance": np.nan}, "max_distance is NaN,"),
        ({"max_distance": np.inf}, "max_distance is inf,"),
        ({"max_distance": 0.04}, "max_distance is 0.04, expected 0.05 to 12.7"),
        ({"max_distance": 1e6}, "max_distance is 1000000, expected 0.05 to 12.7"),
        ({"max_distance": 1.0, "unknown": "stop"}, 'unknown is "stop", expected "occupied" or "free"'),
    ],
)
def test_a_bad_field_is_refused(arguments: dict[str, Any], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        make_grid().distance_field(**arguments)


@pytest.mark.parametrize(
    ("ask", "named"),
    [
        (lambda field: field.distance([[0, 0, 0], [0, np.nan, 0]]), "points is .* in row 1"),
        (lambda field: field.gradient([[0, 0, -np.inf]]), "points is .* in row 0"),
        (lambda field: field.distance([0, 0, 0]), r"points have shape \[3\]"),
        (lambda field: field.gradient([[0, 0]]), r"points have shape \[1, 2\]"),
        (lambda field: field.distance("here"), "points"),
        (lambda field: field.distance([[0, 0, 0]], "cubic"), 'interpolation is "cubic"'),
        (lambda field: field.dense([[0, 0, 0], [1, 1, -1]]), "region"),
        (lambda field: field.dense([0, 0, 1]), "region has shape"),
        (lambda field: field.dense([[-np.inf] * 3, [np.inf] * 3]), "region is .* voxels"),
        (lambda field: field.dense([[0] * 3, [1e4] * 3]), "region is 200000 x 200000 x 200000 voxels"),
    ],
)
def test_bad_questions_are_refused(ask: Callable[[pm.DistanceField], object], named: str) -> None:
    field = map_of([wall(1.5)]).distance_field(0.5)
    before = field.distance([[0, 0, 1.4]])
    with pytest.raises(ValueError, match=named):
        ask(field)
    assert field.distance([[0, 0, 1.4]]) == before


def test_a_field_keeps_its_map_alive() -> None:
    grid = map_of([wall(1.5)])
    field = grid.distance_field(0.5)
    expected = field.distance([[0, 0, 1.4]])
    del grid
    gc.collect()
    assert field.distance([[0, 0, 1.4]]) == expected


def test_every_answer_is_about_whole_frames() -> None:
    frames = random_frames(20, seed=48)
    region = [[-1.5] * 3, [1.5] * 3]

    def answer(field: pm.DistanceField) -> bytes:
        return field.dense(region)[0].tobytes()

    reference = make_grid()
    legal = [answer(reference.distance_field(0.5))]
    for frame in frames:
        reference.integrate(*frame)
        legal.append(answer(reference.distance_field(0.5)))

    grid = make_grid()
    field = grid.distance_field(0.5)
    done = threading.Event()
    failures: list[BaseException] = []

    def write(frames: list[Frame]) -> None:
        try:
            for frame in frames:
                grid.integrate(*frame)
        finally:
            done.set()

    def ask() -> None:
        oldest = 0
        try:
            while not done.is_set():
                oldest = legal.index(answer(field), oldest)  # ValueError if no state of the map, or an older one
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=write, args=(frames,)), *(threading.Thread(target=ask) for _ in range(2))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    assert answer(field) == legal[-1]


@pytest.mark.parametrize("unknown", UNKNOWN_AS)
def test_a_real_room_is_as_scipy_has_it(unknown: Unknown) -> None:
    frames = pm.datasets.open(real("redkitchen"))
    grid = pm.OccupancyGrid(voxel_size=0.05)
    field = grid.distance_field(1.0, unknown)
    for index in (0, 1, 2, 200, 201, 400):
        frame = frames[index]
        grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
        field.update()
    assert_is_scipys(field, grid)
    region = grid.bounds
    assert region is not None
    assert field.dense(region)[0].tobytes() == grid.distance_field(1.0, unknown).dense(region)[0].tobytes()
