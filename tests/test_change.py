"""Maps change: evidence decays, parts are forgotten, frames are moved; each held against a plain list of voxels."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
import pytest
from frames import CAMERA, IDENTITY, VOXEL_SIZE, Frame, make_grid, map_bytes, map_of, random_frames, wall
from numpy.typing import NDArray
from shell import json_of, run

FRAMES = random_frames(4, seed=31)
NAN, INF = math.nan, math.inf
EVERYWHERE = ((-INF, -INF, -INF), (INF, INF, INF))
ELSEWHERE = ((50.0, 50.0, 50.0), (60.0, 60.0, 60.0))

Voxels = tuple[NDArray[np.int64], NDArray[np.int64]]
"""(N, 3) indices of all known voxels, sorted, and (N,) their evidence in steps of 2^-12."""


def voxels(grid: pm.OccupancyGrid) -> Voxels:
    """All that a map with a prior of one half holds."""
    blocks = grid.block_coords().astype(np.int64)
    within = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1)
    index = (8 * blocks[:, None, None, None, :] + within).reshape(-1, 3)
    evidence = np.rint(4096 * grid.block_log_odds(blocks).astype(np.float64)).astype(np.int64).ravel()
    return sort_known(index, evidence)


def sort_known(index: NDArray[np.int64], evidence: NDArray[np.int64]) -> Voxels:
    order = np.lexsort(index.T[::-1])
    order = order[evidence[order] != 0]
    return index[order], evidence[order]


def lie_in(index: NDArray[np.int64], region: Any) -> NDArray[np.bool_]:
    """Which voxels have their centres in a box, upper faces excluded."""
    centres = (index + 0.5) * VOXEL_SIZE
    inside: NDArray[np.bool_] = ((np.asarray(region)[0] <= centres) & (centres < np.asarray(region)[1])).all(axis=1)
    return inside


def assert_holds(grid: pm.OccupancyGrid, expected: Voxels) -> None:
    for got, wanted in zip(voxels(grid), expected, strict=True):
        np.testing.assert_array_equal(got, wanted)


def random_regions(count: int) -> list[NDArray[np.float64]]:
    """Boxes around voxels of the first two frames, with corners anywhere, and on faces and centres of voxels."""
    rng = np.random.default_rng(32)
    index, _ = voxels(map_of(FRAMES[:2]))
    middles = (rng.choice(index, count) + 0.5) * VOXEL_SIZE
    corners = middles[:, None] + rng.uniform(0.2, 0.8, (count, 2, 3)) * [[[-1.0], [1.0]]]
    corners[1::3] = np.round(corners[1::3] / VOXEL_SIZE) * VOXEL_SIZE
    corners[2::3] = (np.round(corners[2::3] / VOXEL_SIZE) + 0.5) * VOXEL_SIZE
    return list(corners)


REGIONS = random_regions(9)


# ---- forgetting ----


@pytest.mark.parametrize("region", REGIONS)
def test_clear_and_crop(region: NDArray[np.float64]) -> None:
    index, evidence = voxels(map_of(FRAMES[:2]))
    inside = lie_in(index, region)
    assert 100 < inside.sum() < len(index) - 100
    for method, kept in (("clear", ~inside), ("crop", inside)):
        grid = map_of(FRAMES[:2])
        getattr(grid, method)(region)
        assert_holds(grid, (index[kept], evidence[kept]))
        assert (grid.num_observed, grid.num_erasures, grid.num_frames) == (kept.sum(), 1, 2)


def test_every_way_to_write_a_region(tmp_path: Path) -> None:
    files = set()
    corners = np.array([[-0.5, -0.25, 0.25], [0.5, 1.0, 1.75]])
    wide = np.zeros((4, 6))
    wide[::2, ::2] = corners
    for region in (
        *(corners, corners.tolist(), tuple(map(tuple, corners)), wide[::2, ::2], np.asfortranarray(corners)),
        *(corners.astype(np.float32), corners.astype(">f8")),
    ):
        grid = map_of(FRAMES[:1])
        grid.clear(region)
        files.add(map_bytes(grid, tmp_path))
    assert len(files) == 1
    grid = map_of(FRAMES[:1])
    grid.clear([[-1, -1, 0], [1, 1, 2]])
    assert not lie_in(voxels(grid)[0], [[-1, -1, 0], [1, 1, 2]]).any()


def test_the_bounds_are_a_region(tmp_path: Path) -> None:
    grid = map_of(FRAMES)
    before = map_bytes(grid, tmp_path)
    assert grid.bounds is not None
    grid.crop(grid.bounds)
    assert map_bytes(grid, tmp_path) == before
    grid.clear(grid.bounds)
    assert (grid.num_blocks, grid.num_erasures) == (0, 1)


def test_what_is_cleared_can_be_seen_again() -> None:
    grid = map_of(FRAMES[:2])
    grid.clear(EVERYWHERE)
    grid.integrate(*FRAMES[2])
    assert_holds(grid, voxels(map_of(FRAMES[2:3])))


def test_memory_follows_a_window() -> None:
    """A camera that moves on for ever, in a window around it."""
    frame = wall(2.0)
    grid = make_grid()
    observed, sizes = [], []
    for step in range(30):
        pose = IDENTITY.copy()
        pose[0, 3] = 0.4 * step  # a block
        grid.integrate(frame.depth, frame.camera, pose)
        grid.crop([[0.4 * step - 1.2, -1.2, 0.0], [0.4 * step + 1.2, 1.2, 2.4]])
        observed.append(grid.num_observed)
        sizes.append(grid.nbytes)
    assert len(set(observed[5:])) == 1
    assert max(sizes) < 2 * sizes[5]  # tables may have grown to their next size


def test_what_was_cut_through_free_space_keeps_the_rest() -> None:
    grid = map_of([wall(2.9)])
    before = grid.nbytes
    region = ((-0.03, -0.03, 1.0), (0.03, 0.03, 1.3))
    index, evidence = voxels(grid)
    kept = ~lie_in(index, region)
    grid.clear(region)
    assert_holds(grid, (index[kept], evidence[kept]))
    assert grid.nbytes > before


# ---- decay ----


@pytest.mark.parametrize("factor", [0.5, 0.9, 0.999999, 1e-4, np.nextafter(1.0, 0.0), 5e-324])
@pytest.mark.parametrize("region", [None, *REGIONS[:3]])
def test_decay(factor: float, region: NDArray[np.float64] | None) -> None:
    grid = map_of(FRAMES[:2])
    index, evidence = voxels(grid)
    inside = np.full(len(index), True) if region is None else lie_in(index, region)
    weaker = np.where(inside, np.trunc(evidence * factor), evidence).astype(np.int64)
    assert (np.abs(weaker[inside]) < np.abs(evidence[inside])).all()
    grid.decay(factor, region)
    assert_holds(grid, sort_known(index, weaker))
    assert (grid.num_decays, grid.decay_product, grid.num_erasures, grid.num_frames) == (1, factor, 0, 2)


def test_half_life(tmp_path: Path) -> None:
    by_time, by_factor = map_of(FRAMES[:1]), map_of(FRAMES[:1])
    by_time.decay(half_life=20.0, elapsed=60.0)
    by_factor.decay(0.125)
    assert map_bytes(by_time, tmp_path) == map_bytes(by_factor, tmp_path)
    by_time.decay(half_life=7.0, elapsed=2.0, region=REGIONS[0])
    # One rounding of the power and one of the product, both relative.
    assert math.isclose(by_time.decay_product, 0.125 * 0.5 ** (2.0 / 7.0), rel_tol=1e-15)
    assert by_time.num_decays == 2


def test_decay_ends_in_the_prior() -> None:
    grid = map_of(FRAMES[:1], prior=0.2)
    points = np.array([[0.0, 0.0, 0.0], *(voxels(map_of(FRAMES[:1]))[0][::50] + 0.5) * VOXEL_SIZE])
    known = grid.state(points) != -1
    assert known.any()
    while grid.num_observed:
        grid.decay(0.3)
    assert grid.num_blocks == 0
    np.testing.assert_array_equal(grid.state(points), -1)
    np.testing.assert_allclose(grid.probability(points), 0.2, rtol=1e-6)


def test_new_evidence_outweighs_decayed_evidence() -> None:
    """Someone put a cupboard before the wall: with decay the map believes it after a frame, without it does not."""
    stale, decayed = make_grid(), make_grid()
    for grid in (stale, decayed):
        for _ in range(10):
            grid.integrate(*wall(2.0))
    decayed.decay(0.02)
    for grid in (stale, decayed):
        grid.integrate(*wall(1.0))
    point = [[0.0, 0.0, 1.0]]
    assert (stale.state(point)[0], decayed.state(point)[0]) == (0, 1)


# ---- what is recorded ----


def decay_some(grid: pm.OccupancyGrid) -> None:
    grid.decay(0.5, REGIONS[0])


def clear_some(grid: pm.OccupancyGrid) -> None:
    grid.clear(REGIONS[0])


def crop_some(grid: pm.OccupancyGrid) -> None:
    grid.crop(REGIONS[0])


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (decay_some, "the map was decayed 1 times, by 0.5 in all"),
        (clear_some, "parts of the map were cleared or cropped 1 times"),
        (crop_some, "parts of the map were cleared or cropped 1 times"),
    ],
)
def test_changes_are_recorded_and_end_removal(
    change: Callable[[pm.OccupancyGrid], None], reason: str, tmp_path: Path
) -> None:
    grid = map_of(FRAMES[:2])
    change(grid)
    before = map_bytes(grid, tmp_path)
    loaded = pm.OccupancyGrid.load(tmp_path / "bytes.pmap")
    assert map_bytes(loaded, tmp_path) == before
    merged = map_of(FRAMES[2:])
    merged.merge(loaded)
    for other in (loaded, merged):
        for name in ("num_decays", "decay_product", "num_erasures"):
            assert getattr(other, name) == getattr(grid, name), name
    frame = FRAMES[1]
    for other in (grid, loaded, merged):
        before = map_bytes(other, tmp_path)
        with pytest.raises(ValueError, match=f"remove is not possible: {reason}"):
            other.remove(*frame)
        with pytest.raises(ValueError, match=f"reintegrate is not possible: {reason}"):
            other.reintegrate(frame.depth, frame.camera, frame.world_from_camera, IDENTITY)
        assert map_bytes(other, tmp_path) == before


def test_what_changes_nothing_is_not_recorded(tmp_path: Path) -> None:
    grid = map_of(FRAMES[:2])
    before = map_bytes(grid, tmp_path)
    grid.clear(ELSEWHERE)
    grid.crop(EVERYWHERE)
    grid.decay(0.5, ELSEWHERE)
    assert (grid.num_decays, grid.decay_product, grid.num_erasures) == (0, 1.0, 0)
    assert map_bytes(grid, tmp_path) == before
    grid.remove(*FRAMES[1])
    assert_holds(grid, voxels(map_of(FRAMES[:1])))


def test_histories_of_merged_maps_add_up() -> None:
    one, other = map_of(FRAMES[:1]), map_of(FRAMES[1:2])
    one.decay(0.5)
    one.crop(((-9.0, -9.0, -9.0), (0.0, 9.0, 9.0)))
    other.decay(0.25)
    other.decay(0.75)
    one.merge(other)
    assert (one.num_decays, one.decay_product, one.num_erasures) == (3, 0.09375, 1)


def test_info_tells_of_it(tmp_path: Path) -> None:
    grid = map_of(FRAMES[:1])
    path = tmp_path / "map.pmap"
    grid.save(path)
    assert not {"decayed", "erased"} & set(run("info", path).stdout.split())
    grid.decay(0.5)
    grid.decay(0.5)
    grid.clear(REGIONS[0])
    grid.save(path)
    facts = json_of(run("info", path, "--json"))["map"]
    assert (facts["decays"], facts["decay_product"], facts["erasures"]) == (2, 0.25, 1)
    text = " ".join(run("info", path).stdout.split())
    assert "2 times, by 0.25 in all" in text
    assert "1 times, by clear or crop" in text


# ---- moving frames ----


def test_reintegrate(tmp_path: Path) -> None:
    wrong = [frame.world_from_camera for frame in random_frames(4, seed=33)]
    grid = map_of([Frame(frame.depth, CAMERA, pose) for frame, pose in zip(FRAMES, wrong, strict=True)])
    for (depth, camera, right), pose in zip(FRAMES, wrong, strict=True):
        stats = grid.reintegrate(depth, camera, pose, right)
        assert stats.voxels_updated > 1000
    assert map_bytes(grid, tmp_path) == map_bytes(map_of(FRAMES), tmp_path)


def test_reintegrate_in_millimetres(tmp_path: Path) -> None:
    depth = np.full((CAMERA.height, CAMERA.width), 1500, np.uint16)
    moved, made = make_grid(), make_grid()
    other = FRAMES[0].world_from_camera
    moved.integrate(depth, CAMERA, IDENTITY, depth_scale=1000.0)
    moved.reintegrate(depth, CAMERA, IDENTITY, other, 1000.0)
    made.integrate(depth, CAMERA, other, depth_scale=1000.0)
    assert map_bytes(moved, tmp_path) == map_bytes(made, tmp_path)


def test_a_clamped_map_moves_no_frame(tmp_path: Path) -> None:
    grid = map_of(FRAMES[:1], clamp=(-2.0, 3.0))
    before = map_bytes(grid, tmp_path)
    with pytest.raises(ValueError, match=r"reintegrate is not possible: the map is clamped to \(-2, 3\)"):
        grid.reintegrate(FRAMES[0].depth, CAMERA, FRAMES[0].world_from_camera, IDENTITY)
    assert map_bytes(grid, tmp_path) == before


def test_a_move_for_which_there_is_no_room(tmp_path: Path) -> None:
    frame = FRAMES[0]
    grid = map_of([frame, frame], max_bytes=map_of([frame]).nbytes)
    before, size = map_bytes(grid, tmp_path), grid.nbytes
    with pytest.raises(pm.MapFullError, match="map is full"):
        grid.reintegrate(frame.depth, CAMERA, frame.world_from_camera, FRAMES[1].world_from_camera)
    assert (map_bytes(grid, tmp_path), grid.nbytes, grid.num_frames) == (before, size, 2)


# ---- bad input ----

Refuses = Callable[..., None]


@pytest.fixture
def refuses(tmp_path: Path) -> Refuses:
    """Fails unless a method refuses its arguments with an error that matches, and the map stays as it is."""
    grid = map_of(FRAMES[:2])
    before = map_bytes(grid, tmp_path)

    def check(message: str, method: str, *arguments: Any, **options: Any) -> None:
        with pytest.raises(ValueError, match=message):
            getattr(grid, method)(*arguments, **options)
        assert map_bytes(grid, tmp_path) == before

    return check


@pytest.mark.parametrize("factor", [0.0, 1.0, -0.5, 2.0, NAN, INF, -INF])
def test_bad_factors(factor: float, refuses: Refuses) -> None:
    got = str(factor).replace("nan", "NaN").removesuffix(".0")
    refuses(f"factor is {got}, expected a number between 0 and 1, both excluded", "decay", factor)
    refuses(f"factor is {got}, expected", "decay", factor, EVERYWHERE)


@pytest.mark.parametrize("time", [0.0, -1.0, NAN, INF])
def test_bad_times(time: float, refuses: Refuses) -> None:
    got = str(time).replace("nan", "NaN").removesuffix(".0")
    expected = "expected a positive, finite number of seconds"
    refuses(f"half_life is {got}, {expected}", "decay", half_life=time, elapsed=1.0)
    refuses(f"elapsed is {got}, {expected}", "decay", half_life=1.0, elapsed=time)


def test_times_that_leave_no_factor(refuses: Refuses) -> None:
    refuses("elapsed is 100000 for a half_life of 1, .* factor of 0, expected", "decay", half_life=1.0, elapsed=1e5)
    refuses("elapsed is .* factor of 1, expected", "decay", half_life=1e300, elapsed=1.0)


def test_a_factor_or_times_but_not_both(refuses: Refuses) -> None:
    expected = "expected either factor alone, or half_life and elapsed"
    refuses(f"factor is None, half_life None and elapsed None, {expected}", "decay")
    refuses(f"factor is 0.5, half_life 2 and elapsed 1, {expected}", "decay", 0.5, half_life=2.0, elapsed=1.0)
    refuses(f"factor is None, half_life 2 and elapsed None, {expected}", "decay", half_life=2.0)
    refuses(f"factor is 0.5, half_life None and elapsed 3, {expected}", "decay", 0.5, elapsed=3.0)


@pytest.mark.parametrize(
    ("region", "message"),
    [
        ([[0, 0, 0], [1, 1, 0]], r"region is \[0.0, 0.0, 0.0\] to \[1.0, 1.0, 0.0\], expected a low corner below"),
        ([[2, 0, 0], [1, 1, 1]], r"region is \[2.0, 0.0, 0.0\] to"),
        ([[0, NAN, 0], [1, 1, 1]], r"region is \[0.0, NaN, 0.0\] to"),
        ([[0, 0, 0], [1, 1, NAN]], r"region is .* to \[1.0, 1.0, NaN\]"),
        ([[INF] * 3, [INF] * 3], r"region is \[inf, inf, inf\] to"),
        ([0, 0, 0, 1, 1, 1], r"region has shape \[6\], expected \(2, 3\)"),
        ([[0, 0, 0, 1, 1, 1]], r"region has shape \[1, 6\]"),
        ([[0, 1], [0, 1], [0, 1]], r"region has shape \[3, 2\]"),
        (np.zeros((2, 2, 3)), r"region has shape \[2, 2, 3\]"),
        ([], r"region has shape \[0\]"),
        ("kitchen", "region is a str that is no array of numbers"),
        ([["a", "b", "c"], [1, 2, 3]], "region is a list that is no array of numbers"),
    ],
)
def test_bad_regions(region: object, message: str, refuses: Refuses) -> None:
    refuses(message, "clear", region)
    refuses(message, "crop", region)
    refuses(message, "decay", 0.5, region)


def test_bad_arguments_of_reintegrate(refuses: Refuses) -> None:
    depth, camera, pose = FRAMES[0]
    skewed = IDENTITY.copy()
    skewed[0, 1] = 0.1
    far = IDENTITY.copy()
    far[0, 3] = 1e12
    move = "reintegrate"
    refuses(r"old_pose: world_from_camera has shape \[3, 3\], expected \(4, 4\)", move, depth, camera, np.eye(3), pose)
    refuses("new_pose: world_from_camera: .* is 0.1", move, depth, camera, pose, skewed)
    refuses("camera lies at 1000000000000 m", move, depth, camera, pose, far)
    refuses("camera lies at 1000000000000 m", move, depth, camera, far, pose)
    refuses("depth image is 24 x 32", move, depth[::2, ::2].copy(), camera, pose, IDENTITY)
    refuses("depth has dtype int32", move, np.ones_like(depth, np.int32), camera, pose, IDENTITY)
    refuses("pixels without a reading", move, np.zeros_like(depth), camera, pose, IDENTITY)
    refuses("depth_scale is 1000 but depth is float32", move, depth, camera, pose, IDENTITY, 1000.0)


def test_a_full_map_is_not_cut(tmp_path: Path) -> None:
    free = map_of([wall(2.9)])
    grid = map_of([wall(2.9)], max_bytes=free.nbytes)
    before = map_bytes(grid, tmp_path)
    region = ((-0.03, -0.03, 1.0), (0.03, 0.03, 1.3))
    with pytest.raises(pm.MapFullError, match="map is full"):
        grid.clear(region)
    with pytest.raises(pm.MapFullError, match="map is full"):
        grid.decay(0.5, region)
    assert map_bytes(grid, tmp_path) == before
    grid.crop(region)
    assert 0 < grid.num_observed < free.num_observed
