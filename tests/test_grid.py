"""The map as a group: frames add, in any order and on any number of threads, and what was added can be taken back.
And its other promises: queries, bounds, budgets, clamping, saturation."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyramap as pm
import pytest
from frames import CAMERA, IDENTITY, MAX_RANGE, VOXEL_SIZE, Frame, make_grid, map_bytes, map_of, random_frames, wall
from numpy.typing import NDArray

FREE = math.log(0.3 / 0.7)  # Eq. 7 well in front of a surface
UNIT = 2.0**-12  # of the stored log-odds
RULES = ("pyramid", "area", "min_layer")
FRAMES = random_frames(50, seed=1)


@pytest.fixture
def restore_threads() -> Iterator[None]:
    threads = pm.num_threads()
    yield
    pm.set_num_threads(threads)


def voxel_centres(coords: NDArray[np.int32], voxel_size: float) -> NDArray[np.float64]:
    """Centres of all voxels of the blocks, (B, 8, 8, 8, 3), metres."""
    within = np.stack(np.meshgrid(*[np.arange(8.0)] * 3, indexing="ij"), axis=-1)
    voxels = 8 * coords[:, None, None, None, :].astype(np.float64) + within
    centres: NDArray[np.float64] = (voxels + 0.5) * voxel_size
    return centres


# ---- the group ----


def test_order_and_threads_do_not_matter(tmp_path: Path, restore_threads: None) -> None:
    shuffled = [FRAMES[i] for i in np.random.default_rng(2).permutation(len(FRAMES))]
    files = set()
    for threads in (1, 2):
        pm.set_num_threads(threads)
        assert pm.num_threads() == threads
        files |= {map_bytes(map_of(frames), tmp_path) for frames in (FRAMES, FRAMES[::-1], shuffled)}
    assert len(files) == 1
    assert map_of(FRAMES).num_frames == 50


@pytest.mark.parametrize("rule", RULES)
def test_merged_halves_are_the_whole(rule: str, tmp_path: Path) -> None:
    frames = FRAMES[:12]
    whole = map_bytes(map_of(frames, update=rule), tmp_path)
    first, second = map_of(frames[:5], update=rule), map_of(frames[5:], update=rule)
    before = map_bytes(second, tmp_path)
    first.merge(second)
    assert map_bytes(first, tmp_path) == whole
    assert map_bytes(second, tmp_path) == before
    empty = make_grid(update=rule)
    empty.merge(first)
    assert map_bytes(empty, tmp_path) == whole
    first.merge(make_grid(update=rule))
    assert map_bytes(first, tmp_path) == whole


@pytest.mark.parametrize("rule", (*RULES, "ideal"))
def test_removal_is_exact(rule: str, tmp_path: Path) -> None:
    frames = FRAMES[:3] if rule == "ideal" else FRAMES[:10]
    for gone in (0, 2):
        grid = map_of(frames, update=rule)
        grid.remove(*frames[gone])
        never_seen = map_of(frames[:gone] + frames[gone + 1 :], update=rule)
        assert map_bytes(grid, tmp_path) == map_bytes(never_seen, tmp_path)
        assert grid.num_frames == never_seen.num_frames == len(frames) - 1
        np.testing.assert_array_equal(grid.block_coords(), never_seen.block_coords())


def test_removing_everything_leaves_nothing(tmp_path: Path) -> None:
    nothing = map_bytes(make_grid(), tmp_path)
    for remove_first in (False, True):
        grid = make_grid()
        for frame in FRAMES[:4]:
            (grid.remove if remove_first else grid.integrate)(*frame)
        assert abs(grid.num_frames) == 4
        for frame in FRAMES[3::-1]:
            (grid.integrate if remove_first else grid.remove)(*frame)
        assert map_bytes(grid, tmp_path) == nothing
        assert (grid.num_frames, grid.num_blocks, grid.num_observed, grid.bounds) == (0, 0, 0, None)


def test_a_frame_seen_twice_counts_twice() -> None:
    once, twice = map_of(FRAMES[:1]), map_of([FRAMES[0], FRAMES[0]])
    coords = once.block_coords()
    np.testing.assert_array_equal(twice.block_coords(), coords)
    np.testing.assert_array_equal(twice.block_log_odds(coords), 2 * once.block_log_odds(coords))


@pytest.mark.parametrize(
    ("mine", "theirs", "message"),
    [
        ({}, {"voxel_size": 0.06}, r"merge is not possible: voxel_size differs: 0\.05 here, 0\.06 in the other"),
        ({}, {"prior": 0.4}, r"prior differs: 0\.5 here, 0\.4 in the other"),
        ({}, {"clamp": (-2.0, 3.5)}, r"clamp differs: None here, .*-2.*3\.5.* in the other"),
    ],
)
def test_maps_that_differ_do_not_merge(
    mine: dict[str, object], theirs: dict[str, object], message: str, tmp_path: Path
) -> None:
    grid, other = map_of(FRAMES[:2], **mine), map_of(FRAMES[2:3], **theirs)
    before = map_bytes(grid, tmp_path)
    with pytest.raises(ValueError, match=message):
        grid.merge(other)
    assert map_bytes(grid, tmp_path) == before


def test_a_map_does_not_merge_with_itself(tmp_path: Path) -> None:
    grid = map_of(FRAMES[:1])
    before = map_bytes(grid, tmp_path)
    with pytest.raises(ValueError, match="other is the map itself"):
        grid.merge(grid)
    assert map_bytes(grid, tmp_path) == before


# ---- what it costs ----


def test_free_space_costs_an_entry_a_block() -> None:
    no_return = Frame(np.full((48, 64), np.inf, np.float32), CAMERA, IDENTITY)
    grid = make_grid(voxel_size=0.02)
    assert grid.nbytes == 0
    stats = grid.integrate(*no_return)
    values = grid.block_log_odds(grid.block_coords())
    full = int(np.all(values == values.min(), axis=(1, 2, 3)).sum())
    assert full > grid.num_blocks / 2
    assert 0 < stats.blocks_free <= full
    # Blocks on the border of the view are dense, 512 numbers of 4 bytes. All cost a place in the directory, 24 bytes or
    # so, of which there may be four times as many as are used.
    assert grid.nbytes <= 2048 * (grid.num_blocks - full) + 4 * 24 * grid.num_blocks
    assert grid.nbytes < 2048 * grid.num_blocks / 2


def test_more_frames_of_the_same_space_cost_nothing_more() -> None:
    grid = map_of([FRAMES[0]])
    nbytes = grid.nbytes
    grid.integrate(*FRAMES[0])
    assert grid.nbytes == nbytes


def test_byte_budget(tmp_path: Path) -> None:
    near, far = wall(0.5), wall(2.5)
    needed = map_of([near]).nbytes
    grid = make_grid(max_bytes=2 * needed)
    grid.integrate(*near)
    before = map_bytes(grid, tmp_path)
    with pytest.raises(pm.MapFullError, match=rf"needs \d+ bytes, max_bytes is {2 * needed}"):
        grid.integrate(*far)
    with pytest.raises(pm.MapFullError, match=rf"max_bytes is {2 * needed}"):
        grid.merge(map_of([far]))
    assert map_bytes(grid, tmp_path) == before
    assert grid.num_frames == 1

    grid.integrate(*near)
    assert grid.num_frames == 2
    assert grid.nbytes <= 2 * needed
    twice = map_of([near, near], max_bytes=2 * needed)
    assert map_bytes(grid, tmp_path) == map_bytes(twice, tmp_path)


def test_a_budget_is_kept_frame_after_frame() -> None:
    budget = map_of(FRAMES[:10]).nbytes
    grid = make_grid(max_bytes=budget)
    refused = 0
    for frame in FRAMES:
        try:
            grid.integrate(*frame)
        except pm.MapFullError:
            refused += 1
        assert grid.nbytes <= budget
    assert 0 < refused < len(FRAMES)
    assert grid.num_frames == len(FRAMES) - refused


def test_a_map_without_room_for_anything() -> None:
    grid = make_grid(max_bytes=0)
    with pytest.raises(pm.MapFullError, match="max_bytes is 0"):
        grid.integrate(*wall(1.0))
    assert grid.num_blocks == 0


# ---- clamp and saturation ----


def test_clamp_keeps_log_odds_within_its_bounds() -> None:
    low, high = -1.5, 2.25  # whole multiples of the unit, so that the map holds them exactly
    once = map_of([wall(2.0)])
    coords = once.block_coords()
    grid = map_of([wall(2.0)] * 10, clamp=(low, high))
    assert (grid.clamp, grid.saturated) == ((low, high), 0)
    values = grid.block_log_odds(coords)
    np.testing.assert_array_equal(values, np.clip(10 * once.block_log_odds(coords), low, high))
    assert (values.min(), values.max()) == (low, high)


def test_clamp_bounds_the_log_odds_with_the_prior() -> None:
    low, high = -2.0, 2.0
    grid = map_of([wall(2.0)] * 10, clamp=(low, high), prior=0.3)
    values = grid.block_log_odds(grid.block_coords())
    assert values.min() == pytest.approx(low, abs=UNIT)
    assert values.max() == pytest.approx(high, abs=UNIT)


def test_a_clamped_map_forgets_so_nothing_is_removed(tmp_path: Path) -> None:
    grid = map_of(FRAMES[:2], clamp=(-2.0, 3.5))
    before = map_bytes(grid, tmp_path)
    with pytest.raises(ValueError, match=r"remove is not possible: the map is clamped to \(-2, 3\.5\)"):
        grid.remove(*FRAMES[1])
    assert map_bytes(grid, tmp_path) == before


def doubled(grid: pm.OccupancyGrid, path: Path, times: int) -> pm.OccupancyGrid:
    for _ in range(times):
        grid.save(path)
        grid.merge(pm.OccupancyGrid.load(path))
    return grid


def test_saturation_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "doubled.pmap"
    once = map_of([wall(1.0)])
    coords = once.block_coords()
    most = np.float32(2.0**19)  # 32 bits in units of 2^-12; the last unit below it is too small for float32
    evidence = once.block_log_odds(coords)
    assert -1 < evidence.min() < 1 < evidence.max() < 2  # so 2^18 of it fit, and of 2^19 only what is free

    grid = doubled(once, path, 18)
    assert (grid.saturated, grid.num_frames) == (0, 2**18)
    np.testing.assert_array_equal(grid.block_log_odds(coords), evidence * 2**18)

    doubled(grid, path, 1)
    np.testing.assert_array_equal(grid.block_log_odds(coords), np.minimum(evidence * 2**19, most))
    assert grid.saturated == (evidence >= 1).sum() > 0

    before = map_bytes(grid, tmp_path)
    with pytest.raises(ValueError, match=rf"remove is not possible: {grid.saturated} additions"):
        grid.remove(*wall(1.0))
    assert map_bytes(grid, tmp_path) == before

    reported = grid.saturated
    stats = grid.integrate(*wall(1.0))
    assert stats.saturated > 0
    assert grid.saturated == reported + stats.saturated
    grid.save(path)
    assert pm.OccupancyGrid.load(path).saturated == grid.saturated


def test_no_count_overflows(tmp_path: Path) -> None:
    grid = doubled(map_of([wall(1.0)]), tmp_path / "doubled.pmap", 70)
    assert grid.num_frames == 2**63 - 1
    assert grid.saturated > 2**50
    assert grid.block_log_odds(grid.block_coords()).min() == -(2.0**19)


# ---- queries ----


def test_a_wall_is_seen_free_occupied_and_unknown() -> None:
    grid = map_of([wall(2.0)])
    points = [[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 2.9], [0.0, 0.0, -1.0], [2.0, 0.0, 1.0]]
    assert grid.state(points).tolist() == [0, 1, -1, -1, -1]
    assert grid.state(points).dtype == np.int8
    log_odds, probability = grid.log_odds(points), grid.probability(points)
    assert log_odds.dtype == probability.dtype == np.float32
    assert log_odds[0] == pytest.approx(FREE, abs=UNIT)
    assert log_odds[1] > 1
    assert log_odds[2:].tolist() == [0, 0, 0]
    assert probability.tolist() == pytest.approx([0.3, 1 / (1 + math.exp(-log_odds[1])), 0.5, 0.5, 0.5], abs=UNIT)


def test_prior_is_added_to_what_is_known() -> None:
    prior = 0.2
    l_0 = math.log(prior / (1 - prior))
    plain, grid = map_of(FRAMES[:3]), map_of(FRAMES[:3], prior=prior)
    coords = plain.block_coords()
    centres = voxel_centres(coords, VOXEL_SIZE).reshape(-1, 3)
    evidence = plain.log_odds(centres)
    known = evidence != 0
    assert known.any()
    assert not known.all()
    # Half a unit of float32 at log-odds below 16 is 2^-21.
    np.testing.assert_allclose(grid.log_odds(centres)[known], evidence[known] + l_0, atol=2**-20)
    assert not grid.log_odds(centres)[~known].any()
    np.testing.assert_allclose(grid.probability(centres)[known], 1 / (1 + np.exp(-evidence[known] - l_0)), atol=1e-6)
    np.testing.assert_array_equal(grid.probability(centres)[~known], np.float32(prior))
    expected = np.where(known, evidence + l_0 > 0, -1)
    np.testing.assert_array_equal(grid.state(centres), expected)
    assert (grid.state(centres) != plain.state(centres)).any()


def test_blocks_and_points_agree() -> None:
    grid = map_of(FRAMES[:5])
    coords = grid.block_coords()
    values = grid.block_log_odds(coords)
    assert values.shape == (len(coords), 8, 8, 8)
    assert values.dtype == np.float32
    centres = voxel_centres(coords, VOXEL_SIZE)
    np.testing.assert_array_equal(grid.log_odds(centres.reshape(-1, 3)).reshape(values.shape), values)
    assert (coords < 0).any()
    assert grid.num_observed == np.count_nonzero(values)
    assert (grid.state(centres.reshape(-1, 3)) >= 0).sum() == grid.num_observed


def test_block_coords_are_sorted_and_unique() -> None:
    grid = map_of(FRAMES[:5])
    coords = grid.block_coords()
    assert coords.dtype == np.int32
    assert coords.shape == (grid.num_blocks, 3)
    rows = [tuple(row) for row in coords.tolist()]
    assert rows == sorted(set(rows))
    assert grid.block_log_odds(coords).reshape(len(coords), -1).any(axis=1).all()


def test_block_log_odds_takes_any_integers_in_any_order() -> None:
    grid = map_of(FRAMES[:2])
    coords = grid.block_coords()
    values = grid.block_log_odds(coords)
    np.testing.assert_array_equal(grid.block_log_odds(coords[::-1]), values[::-1])
    np.testing.assert_array_equal(grid.block_log_odds(coords.astype(np.int64)), values)
    np.testing.assert_array_equal(grid.block_log_odds(coords.tolist()), values)
    np.testing.assert_array_equal(grid.block_log_odds(np.asfortranarray(coords)), values)
    assert not grid.block_log_odds([[1000, 0, 0], [2**31 - 1, -(2**31), 0]]).any()
    assert grid.block_log_odds(np.empty((0, 3), np.int32)).shape == (0, 8, 8, 8)


def test_bounds_enclose_all_blocks() -> None:
    grid = map_of(FRAMES[:5])
    coords = grid.block_coords()
    bounds = grid.bounds
    assert bounds is not None
    assert (bounds.shape, bounds.dtype) == ((2, 3), np.dtype(np.float64))
    edge = 8 * VOXEL_SIZE
    np.testing.assert_allclose(bounds, [coords.min(0) * edge, (coords.max(0) + 1) * edge], rtol=1e-15)


def test_an_empty_map_knows_nothing() -> None:
    grid = make_grid()
    assert (grid.bounds, grid.num_blocks, grid.num_observed, grid.num_frames, grid.nbytes) == (None, 0, 0, 0, 0)
    assert grid.block_coords().shape == (0, 3)
    assert grid.log_odds(np.empty((0, 3))).shape == (0,)
    assert grid.state([[0, 0, 0]]).tolist() == [-1]
    mesh = grid.mesh()
    assert mesh.vertices.shape == mesh.faces.shape == mesh.normals.shape == (0, 3)


def test_a_point_on_a_border_belongs_to_the_voxel_that_begins_there() -> None:
    # With voxels of 1/16 m every border is an exact number, on both sides of the origin.
    size = 1 / 16
    grid = map_of(FRAMES[:5], voxel_size=size)
    coords = grid.block_coords()
    voxels = np.floor(voxel_centres(coords, size) / size).reshape(-1, 3)
    values = grid.block_log_odds(coords).ravel()
    np.testing.assert_array_equal(grid.log_odds(voxels * size), values)
    last_inside = np.nextafter((voxels + 1) * size, -np.inf)
    np.testing.assert_array_equal(grid.log_odds(last_inside), values)
    assert (voxels < 0).any()


def test_points_beyond_all_coordinates_are_unknown() -> None:
    grid = map_of([wall(2.0)])
    far = [list(p) for p in itertools.product((0.0, 1e7, -1e12, 1.7e308), repeat=3)][1:]
    assert set(grid.state(far).tolist()) == {-1}
    assert not grid.log_odds(far).any()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_points_must_be_finite(bad: float) -> None:
    grid = map_of([wall(2.0)])
    for query in (grid.log_odds, grid.probability, grid.state):
        with pytest.raises(ValueError, match=r"points is \[0.0, (NaN|inf|-inf), 1.0\] in row 1, expected finite"):
            query([[0.0, 0.0, 1.0], [0.0, bad, 1.0]])


def test_num_observed_counts_what_the_first_frame_updated() -> None:
    grid = make_grid()
    stats = grid.integrate(*FRAMES[0])
    assert stats.voxels_updated == grid.num_observed > 0
    assert stats.blocks_free + stats.blocks_mixed >= grid.num_blocks
    assert list(stats.seconds) == ["upload", "ranges", "pyramid", "cull", "update", "readback", "colour", "commit"]
    assert all(0 <= seconds < 60 for seconds in stats.seconds.values())


def test_nothing_beyond_max_range_is_touched() -> None:
    grid = map_of(FRAMES[:1])
    coords = grid.block_coords()
    centres, values = voxel_centres(coords, VOXEL_SIZE), grid.block_log_odds(coords)
    distances = np.linalg.norm(centres - FRAMES[0].world_from_camera[:3, 3], axis=-1)
    # Float32 distances in the mapper: 3 m to within 1e-6.
    assert distances[values != 0].max() <= MAX_RANGE + 1e-6
    assert distances[values != 0].max() > MAX_RANGE - VOXEL_SIZE


def test_beyond_max_range_is_free_or_ignored() -> None:
    far = wall(2 * MAX_RANGE)
    free = map_of([far])
    assert free.state([[0.0, 0.0, 1.0], [0.0, 0.0, 2.9]]).tolist() == [0, 0]
    with pytest.raises(ValueError, match="3072 pixels without a reading"):
        make_grid(beyond_max_range="ignore").integrate(*far)
    half = Frame(far.depth.copy(), CAMERA, IDENTITY)
    half.depth[:, :20] = 2.0
    ignoring = map_of([half], beyond_max_range="ignore")
    assert ignoring.state([[0.0, 0.0, 1.0]]).tolist() == [-1]
    assert ignoring.state([[-0.4, 0.0, 1.0]]).tolist() == [0]


def test_depth_types_agree(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    millimetres = rng.integers(0, 4000, (48, 64)).astype(np.uint16)
    metres = (millimetres.astype(np.float32) / np.float32(1000)).astype(np.float32)
    expected = map_bytes(map_of([Frame(metres, CAMERA, IDENTITY)]), tmp_path)
    double = make_grid()
    double.integrate(metres.astype(np.float64), CAMERA, IDENTITY)
    assert map_bytes(double, tmp_path) == expected
    raw = make_grid()
    raw.integrate(millimetres, CAMERA, IDENTITY, depth_scale=1000.0)
    assert map_bytes(raw, tmp_path) == expected
    raw.remove(millimetres, CAMERA, IDENTITY, depth_scale=1000.0)
    assert raw.num_observed == 0


def test_the_largest_uint16_is_a_distance() -> None:
    grid = make_grid()
    depth = np.full((48, 64), 65535, np.uint16)
    grid.integrate(depth, CAMERA, IDENTITY, depth_scale=65535 / 2.0)
    assert grid.state([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]]).tolist() == [0, 1]


def test_a_map_far_from_the_origin_is_the_same_map() -> None:
    # 2^20 blocks of 8/16 m: every coordinate stays exact, so the map is the same one, moved by whole blocks.
    size, shift = 1 / 16, 2**20
    here = map_of(FRAMES[:3], voxel_size=size)
    there = make_grid(voxel_size=size)
    for depth, camera, pose in FRAMES[:3]:
        moved = pose.copy()
        moved[:3, 3] = np.round(pose[:3, 3] * 2**20) / 2**20 + np.array([shift, -shift, 0]) * 8 * size
        exact = pose.copy()
        exact[:3, 3] = np.round(pose[:3, 3] * 2**20) / 2**20
        there.integrate(depth, camera, moved)
        here.integrate(depth, camera, exact)
        here.remove(depth, camera, pose)
    coords = here.block_coords()
    np.testing.assert_array_equal(there.block_coords(), coords + np.array([shift, -shift, 0]))
    np.testing.assert_array_equal(there.block_log_odds(there.block_coords()), here.block_log_odds(coords))


def test_parameters_can_be_read_back() -> None:
    model = pm.SensorModel((0.01, 0.002, 0.003), k=0.012, surface_offset="centred")
    grid = pm.OccupancyGrid(
        0.03, model, 2.5, "area", "cpu", clamp=(-3.0, 4.0), max_bytes=10**9, prior=0.4, beyond_max_range="ignore"
    )
    assert (grid.voxel_size, grid.sensor_model, grid.max_range, grid.update) == (0.03, model, 2.5, "area")
    assert (grid.backend, grid.clamp, grid.max_bytes) == ("cpu", (-3.0, 4.0), 10**9)
    assert (grid.prior, grid.beyond_max_range) == (0.4, "ignore")
    default = pm.OccupancyGrid(0.03)
    assert default.sensor_model == pm.SensorModel(0.03)
    assert (default.max_range, default.update, default.clamp, default.prior) == (5.0, "pyramid", None, 0.5)
    assert "voxel_size=0.03" in repr(grid)
