"""View gain against plain integration along each ray, against what a frame then brings, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pyramap as pm
import pytest
from frames import CAMERA, IDENTITY, MAX_RANGE, VOXEL_SIZE, Frame, make_grid, map_of, random_frames, random_pose, wall
from numpy.typing import NDArray

Array = NDArray[np.float64]


def random_poses(count: int, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return np.stack([random_pose(rng) for _ in range(count)])


def information(probability: Array, model: pm.SensorModel) -> Array:
    """Mutual information, bits, of a voxel and a binary sensor that adds the model's log-odds: from its joint
    distribution. Its rates solve `a = b e^hit` and `1 - a = (1 - b) e^miss`, a linear system."""
    hit, miss = math.exp(model.log_odds(1.0, 1.0)), math.exp(math.log(0.3 / 0.7))
    a, b = np.linalg.solve([[1.0, -hit], [-1.0, miss]], [0.0, miss - 1.0])
    total = np.zeros_like(probability)
    for p_voxel, rate in ((probability, a), (1.0 - probability, b)):
        for p_reading, p_both in (
            (a * probability + b * (1.0 - probability), p_voxel * rate),
            (1.0 - a * probability - b * (1.0 - probability), p_voxel * (1.0 - rate)),
        ):
            ratio = np.divide(p_both, p_voxel * p_reading, out=np.ones_like(p_both), where=p_both > 0)
            total += p_both * np.log2(ratio)
    return total


def along_ray(grid: pm.OccupancyGrid, origin: Array, direction: Array, reach: float) -> tuple[float, float]:
    """Integrals over depth squared, of unknown space and of information per voxel: the crossings of the ray with all
    planes between voxels, sorted, have a voxel between any two. `direction` is of depth 1, `reach` a depth."""
    planes = np.arange(-2000, 2000) * grid.voxel_size
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = ((planes[:, None] - origin) / direction).ravel()
    inside = crossings[np.isfinite(crossings) & (crossings > 0.0) & (crossings < reach)]
    depths = np.concatenate([[0.0], np.sort(inside), [reach]])
    middles = origin + 0.5 * (depths[1:] + depths[:-1])[:, None] * direction
    volumes = np.diff(depths**3) / 3.0
    states = grid.state(middles)
    # Up to and with the first occupied voxel.
    seen = np.cumsum(states == 1) - (states == 1) == 0
    bits = information(grid.probability(middles).astype(np.float64), grid.sensor_model)
    return float(np.sum(volumes[seen & (states == -1)])), float(np.sum((volumes * bits)[seen]))


def expected_gain(
    grid: pm.OccupancyGrid, camera: pm.PinholeCamera, pose: Array, max_range: float, stride: int
) -> tuple[float, float]:
    volume, entropy = 0.0, 0.0
    for top in range(0, camera.height, stride):
        for left in range(0, camera.width, stride):
            bottom, right = min(top + stride, camera.height), min(left + stride, camera.width)
            u, v = 0.5 * (left + right - 1), 0.5 * (top + bottom - 1)
            ray = np.array([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0])
            reach = max_range / float(np.linalg.norm(ray))
            unknown, bits = along_ray(grid, pose[:3, 3], pose[:3, :3] @ ray, reach)
            area = (right - left) * (bottom - top) / (camera.fx * camera.fy)
            volume += area * unknown
            entropy += area * bits / grid.voxel_size**3
    return volume, entropy


@pytest.mark.parametrize(
    ("options", "max_range", "stride"),
    [({}, None, 8), ({"prior": 0.3}, 1.7, 11), ({"sensor_model": pm.SensorModel(0.03, k=0.02)}, 4.0, 20)],
)
def test_rays_are_integrated(options: dict[str, Any], max_range: float | None, stride: int) -> None:
    grid = map_of(random_frames(3, seed=1), **options)
    poses = random_poses(6, seed=2)
    found = grid.view_gain(CAMERA, poses, max_range=max_range, stride=stride)
    expected = np.array([expected_gain(grid, CAMERA, pose, max_range or MAX_RANGE, stride) for pose in poses])
    assert np.ptp(expected[:, 0]) > 0.5
    # Sums of some thousand terms in another order; the oracle's directions are rounded after the turn.
    np.testing.assert_allclose(found.unknown_volume, expected[:, 0], rtol=1e-9)
    # Probabilities come as float32, and the library interpolates in a table to 1e-5 bits of some 0.2 a voxel.
    np.testing.assert_allclose(found.entropy_reduction, expected[:, 1], rtol=1e-4)


def test_a_view_into_the_unknown_brings_what_was_promised() -> None:
    # Nothing in sight up to the greatest range: a frame without return then sees the whole frustum.
    grid = make_grid()
    pose = random_pose(np.random.default_rng(3))
    gain = grid.view_gain(CAMERA, pose[None])
    grid.integrate(np.full((CAMERA.height, CAMERA.width), np.inf, np.float32), CAMERA, pose)
    observed = grid.num_observed * VOXEL_SIZE**3
    # Voxels count by their centres: of some 50,000, those at the border, an eighth of them, are in or out by chance.
    np.testing.assert_allclose(gain.unknown_volume, observed, rtol=0.01)
    # Nobody has seen a voxel of it: 1 - (1/3) H(0.899) - (2/3) H(0.3) = 0.25527 bits of each.
    np.testing.assert_allclose(gain.entropy_reduction, 0.255267 * gain.unknown_volume / VOXEL_SIZE**3, rtol=1e-5)
    # What is seen is unknown no more, but for voxels at the border; and there is less to be learned.
    again = grid.view_gain(CAMERA, pose[None])
    assert again.unknown_volume[0] < 0.05 * gain.unknown_volume[0]
    assert 0.0 < again.entropy_reduction[0] < gain.entropy_reduction[0]


def test_a_wall_hides_what_is_behind() -> None:
    grid = map_of([wall(1.5)] * 3)
    # The middle of the image: there the wall has no border past which a ray could go.
    camera = pm.PinholeCamera(width=8, height=8, fx=55.0, fy=55.0, cx=3.5, cy=3.5)
    front, behind = IDENTITY.copy(), IDENTITY.copy()
    behind[2, 3] = 1.9
    gain = grid.view_gain(camera, [front, behind], max_range=3.0)
    # But for the tip of the view, where the voxels' centres lie beside it: pixels up to a depth of two voxels at most.
    assert gain.unknown_volume[0] < 64 / 55**2 * (2 * VOXEL_SIZE) ** 3 / 3
    # All of it is unknown, up to a distance of 3 m; one pixel's solid angle is a little less than 1 / (fx fy).
    np.testing.assert_allclose(gain.unknown_volume[1], 64 / 55**2 * 3.0**3 / 3, rtol=0.02)


def test_a_camera_in_an_occupied_voxel_sees_only_that() -> None:
    grid = map_of([wall(1.5)] * 3)
    pose = IDENTITY.copy()
    pose[:3, 3] = [0.01, 0.01, 1.51]
    assert grid.state(pose[None, :3, 3])[0] == 1
    gain = grid.view_gain(CAMERA, pose[None])
    assert gain.unknown_volume[0] == 0.0
    assert 0.0 < gain.entropy_reduction[0] < 1.0


def test_rougher_is_about_the_same() -> None:
    grid = map_of(random_frames(3, seed=4))
    poses = random_poses(5, seed=5)
    fine = grid.view_gain(CAMERA, poses, stride=1)
    default = grid.view_gain(CAMERA, poses)
    rough = grid.view_gain(CAMERA, poses, stride=4)
    # 55 pixels a metre at 1 m, 5 cm voxels, 3 m: rays of single pixels are 1.1 voxels apart.
    np.testing.assert_array_equal(fine.unknown_volume, default.unknown_volume)
    np.testing.assert_allclose(rough.unknown_volume, fine.unknown_volume, rtol=0.2)
    np.testing.assert_allclose(rough.entropy_reduction, fine.entropy_reduction, rtol=0.2)
    assert np.any(rough.unknown_volume != fine.unknown_volume)


def test_threads_and_company_do_not_matter() -> None:
    grid, threads = map_of(random_frames(3, seed=6)), pm.num_threads()
    poses = random_poses(4, seed=7)
    try:
        pm.set_num_threads(1)
        one = grid.view_gain(CAMERA, poses)
        pm.set_num_threads(3)
        three = grid.view_gain(CAMERA, poses)
    finally:
        pm.set_num_threads(threads)
    single = [grid.view_gain(CAMERA, pose[None]) for pose in poses]
    for name in ("unknown_volume", "entropy_reduction"):
        np.testing.assert_array_equal(getattr(one, name), getattr(three, name))
        np.testing.assert_array_equal(getattr(one, name), np.concatenate([getattr(gain, name) for gain in single]))


def test_no_poses() -> None:
    gain = map_of(random_frames(1, seed=8)).view_gain(CAMERA, np.empty((0, 4, 4)))
    assert len(gain) == 0
    assert gain.unknown_volume.shape == gain.entropy_reduction.shape == (0,)
    assert gain.unknown_volume.dtype == gain.entropy_reduction.dtype == np.float64
    assert repr(gain) == "ViewGain(0 poses)"


def with_entry(row: int, column: int, value: float) -> Array:
    poses = np.stack([IDENTITY] * 3)
    poses[1, row, column] = value
    return poses


@pytest.mark.parametrize(
    ("poses", "options", "message"),
    [
        (IDENTITY, {}, r"poses have shape \[4, 4\], expected \(N, 4, 4\)"),
        (np.zeros((2, 3, 4)), {}, r"poses have shape \[2, 3, 4\]"),
        ([], {}, r"poses have shape \[0\]"),
        ("here", {}, "poses is a str that is no array of numbers"),
        (
            with_entry(0, 3, math.nan),
            {},
            r"poses\[1\] as a world_from_camera: \[0, 3\] is NaN, expected a finite",
        ),
        (with_entry(0, 0, 2.0), {}, r"poses\[1\] as a world_from_camera: column 0 . column 0 of the rotation is 4"),
        (with_entry(2, 3, 1e9), {}, "camera lies at 1000000000 m, expected within .* m of the origin"),
        (with_entry(2, 3, -1e300), {}, "camera lies at -1"),
        (with_entry(0, 3, 0.0), {"max_range": 0.0}, "max_range is 0, expected more than 0 and at most 204.8 m"),
        (with_entry(0, 3, 0.0), {"max_range": -1.0}, "max_range is -1, expected more than 0"),
        (with_entry(0, 3, 0.0), {"max_range": math.nan}, "max_range is NaN, expected more than 0"),
        (with_entry(0, 3, 0.0), {"max_range": math.inf}, "max_range is inf, expected more than 0"),
        (with_entry(0, 3, 0.0), {"max_range": 205.0}, "max_range is 205, expected .* 4096 voxels"),
        (with_entry(0, 3, 0.0), {"stride": 0}, "stride is 0, expected at least 1 pixel"),
        (with_entry(0, 3, 0.0), {"stride": -3}, "stride is -3, expected at least 1 pixel"),
    ],
)
def test_bad_input(poses: Any, options: dict[str, Any], message: str) -> None:
    grid = map_of([wall(1.5)])
    with pytest.raises(ValueError, match=message):
        grid.view_gain(CAMERA, poses, **options)


def test_the_range_may_be_another_than_the_maps() -> None:
    grid = map_of([Frame(np.full((CAMERA.height, CAMERA.width), np.inf, np.float32), CAMERA, IDENTITY)])
    near, far = (grid.view_gain(CAMERA, IDENTITY[None], max_range=reach) for reach in (1.0, 4.0))
    assert near.unknown_volume[0] < 0.1 < 9.0 < far.unknown_volume[0]
