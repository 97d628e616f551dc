"""Sensors other than the undistorted pinhole camera: every rule against a naive reference, and what is refused."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
import pytest
from compare import MAX_EXCUSED
from frames import CAMERA, IDENTITY, make_grid, map_bytes, random_frames, random_pose
from numpy.typing import NDArray
from reference import UNIT, Array, Model
from reference_sensors import RULES, TAU, Distorted, Lidar, Parallel, Sensor, View

NAN, INF = math.nan, math.inf
MAX_RANGE = 3.0
SIGMA = 0.04


def uneven(rows: int) -> Array:
    """Beams that lie closer at the top, as those of some sensors do."""
    n = np.arange(rows)
    return np.asarray(0.45 - 0.018 * n - 0.0004 * n**2)


SENSORS: dict[str, tuple[Any, Sensor]] = {
    "full turn": (
        pm.SphericalSensor(128, (0.5, -0.5), height=32, first_azimuth=0.4),
        Lidar(128, np.linspace(0.5, -0.5, 32), 0.4, -TAU),
    ),
    "uneven beams": (
        pm.SphericalSensor(144, uneven(24), azimuth_span=TAU),
        Lidar(144, uneven(24), 0.0, TAU),
    ),
    "sector of rising beams": (
        pm.SphericalSensor(60, np.linspace(-0.3, 0.4, 20), first_azimuth=-3.5, azimuth_span=1.4),
        Lidar(60, np.linspace(-0.3, 0.4, 20), -3.5, 1.4),
    ),
    "barrel lens": (
        pm.PinholeCamera(80, 60, 60.0, 61.0, 41.3, 27.9, (-0.28, 0.07, 0.001, -0.002)),
        Distorted(80, 60, 60.0, 61.0, 41.3, 27.9, (-0.28, 0.07, 0.001, -0.002, 0.0)),
    ),
    "pincushion lens": (
        pm.PinholeCamera(80, 60, 70.0, 69.0, 38.0, 30.2, (0.15, 0.02, 0.001, -0.002, 0.01)),
        Distorted(80, 60, 70.0, 69.0, 38.0, 30.2, (0.15, 0.02, 0.001, -0.002, 0.01)),
    ),
    "parallel rays": (
        pm.OrthographicCamera(90, 70, 31.0, 27.0, 40.3, 33.8),
        Parallel(90, 70, 31.0, 27.0, 40.3, 33.8),
    ),
}


def random_ranges(shape: tuple[int, int], rng: np.random.Generator) -> NDArray[np.float32]:
    """Smooth walls with boxes before them, noise and every kind of reading."""
    height, width = shape
    v, u = np.mgrid[:height, :width]
    ranges: NDArray[np.float64] = 1.6 + 0.4 * np.sin(TAU * u / width + 1) + 0.3 * np.cos(2 * v / height)
    for reading in (*rng.uniform(0.4, 2.5, 3), 0.0, np.nan, -1.0, np.inf, 2 * MAX_RANGE):
        top, left = rng.integers(0, height - 4), rng.integers(0, width - 8)
        ranges[top : top + rng.integers(2, 8), left : left + rng.integers(4, 16)] = reading
    ranges += 0.01 * rng.standard_normal(shape)
    return ranges.astype(np.float32)


def voxel_centres(view: View, rng: np.random.Generator, count: int) -> Array:
    """Centres of random voxels around the sensor, most of them in sight."""
    r, reach, origin = view.voxel_size, 1.05 * view.max_range, view.world_from_sensor[:3, 3]
    centres = (np.floor((origin + rng.uniform(-reach, reach, (30 * count, 3))) / r) + 0.5) * r
    visible = view.visible(centres)
    return np.concatenate([centres[visible][:count], centres[~visible][: count // 4]])


# The code under test places a voxel and finds its angles in float32: at 3 m 1e-6 rad are 3e-6 m.
ROUNDING = 1e-5
# Beams that lie unevenly are tabulated, and off by up to a 64th of a row: 0.0006 rad here, 2 mm at 3 m.
TABLE = 2e-3


def doubtful(view: View, rule: str, centres: Array, exact: Array, slack: float, tolerance: float) -> NDArray[np.bool_]:
    """Voxels whose value hangs on where the sensor is: those for which it changes when it moves a little."""
    doubt = np.zeros(len(centres), dtype=bool)
    for signs in np.ndindex(2, 2, 2):
        pose = view.world_from_sensor.copy()
        pose[:3, 3] += slack * (2 * np.array(signs) - 1)
        moved = View(view.ranges, view.sensor, pose, view.voxel_size, view.model, view.max_range)
        other = np.where(moved.visible(centres), RULES[rule](moved, centres), np.nan)
        doubt |= np.isnan(other) != np.isnan(exact)
        with np.errstate(invalid="ignore"):
            doubt |= np.abs(other - exact) > tolerance / 2
    return doubt | (np.abs(np.abs(exact) / UNIT - 0.5) < 0.25)


@pytest.mark.parametrize("voxel_size", [0.05, 0.2])
@pytest.mark.parametrize("rule", list(RULES))
@pytest.mark.parametrize("name", list(SENSORS))
def test_every_rule_follows_the_reference(name: str, rule: Any, voxel_size: float) -> None:
    sensor, reference = SENSORS[name]
    rng = np.random.default_rng(len(name))
    pose = random_pose(rng)
    ranges = random_ranges(reference.shape(), rng)
    grid = pm.OccupancyGrid(voxel_size, pm.SensorModel(SIGMA), MAX_RANGE, rule)
    grid.integrate(ranges=ranges, camera=sensor, world_from_camera=pose)

    view = View(ranges, reference, pose, voxel_size, Model((SIGMA, 0, 0)), MAX_RANGE)
    centres = voxel_centres(view, rng, 400 if rule == "ideal" else 2000)
    exact = np.where(view.visible(centres), RULES[rule](view, centres), np.nan)
    # 1e-3 is what maps are held to; weights that are off by a 64th may make that much of the step at a surface.
    tabulated = "beams" in name and rule != "ideal"
    slack, tolerance = (TABLE, 0.05) if tabulated else (ROUNDING, 1e-3)
    doubt = doubtful(view, rule, centres, exact, slack, tolerance)
    expected, got = np.nan_to_num(np.rint(exact / UNIT) * UNIT), grid.log_odds(centres)
    wrong = (np.abs(got - expected) > tolerance) | ((got == 0) != (expected == 0))
    assert (expected != 0).sum() > len(centres) / 8
    assert not (wrong & ~doubt).any(), (centres[wrong & ~doubt], got[wrong & ~doubt], expected[wrong & ~doubt])
    assert wrong.mean() < (0.03 if tabulated else MAX_EXCUSED)


# ---- images and models ----


def map_of_frames(*frames: dict[str, Any]) -> pm.OccupancyGrid:
    grid = make_grid()
    for frame in frames:
        grid.integrate(**frame)
    return grid


def test_ranges_of_a_pinhole_camera_are_its_depths(tmp_path: Path) -> None:
    depth, camera, pose = random_frames(1, seed=3)[0]
    v, u = np.mgrid[: camera.height, : camera.width]
    per_depth = np.sqrt(((u - camera.cx) / camera.fx) ** 2 + ((v - camera.cy) / camera.fy) ** 2 + 1)
    by_depth, by_ranges = make_grid(), make_grid()
    by_depth.integrate(depth, camera, pose)
    # The library rounds the ratio to float32 before it multiplies.
    by_ranges.integrate(camera=camera, world_from_camera=pose, ranges=depth * per_depth.astype(np.float32))
    assert map_bytes(by_depth, tmp_path) == map_bytes(by_ranges, tmp_path)
    assert by_depth.num_observed > 1000


def test_ranges_in_every_type_give_the_same(tmp_path: Path) -> None:
    sensor, reference = SENSORS["full turn"]
    ranges = random_ranges(reference.shape(), np.random.default_rng(1))
    raw = (np.nan_to_num(ranges, posinf=0).clip(0, 60) * 1000).astype(np.uint16)
    files = set()
    for values in (raw, raw.astype(np.float32) / np.float32(1000), raw / 1000.0):
        scale = {"depth_scale": 1000.0} if values is raw else {}
        for name in ("ranges", "depth"):
            frame: dict[str, Any] = {name: values, "camera": sensor, "world_from_camera": IDENTITY, **scale}
            files.add(map_bytes(map_of_frames(frame), tmp_path))
    assert len(files) == 1


def test_maps_of_several_sensors_are_sums(tmp_path: Path) -> None:
    """Each frame with its own sensor and its own model: as the sum of maps of one frame each, and taken off exactly."""
    frames = []
    for n, (sensor, reference) in enumerate(SENSORS.values()):
        rng = np.random.default_rng(n)
        ranges = random_ranges(reference.shape(), rng)
        model = pm.SensorModel((0.02 + 0.03 * n, 0.0, 0.001 * n), surface_offset="centred")
        pose = random_pose(rng)
        frames.append({"ranges": ranges, "camera": sensor, "world_from_camera": pose, "sensor_model": model})
    together, apart = map_of_frames(*frames), make_grid()
    for frame in frames:
        one = make_grid(sensor_model=frame["sensor_model"])
        one.integrate(**{**frame, "sensor_model": None})
        apart.merge(one)
    assert map_bytes(together, tmp_path) == map_bytes(apart, tmp_path)
    together.reintegrate(
        ranges=frames[0]["ranges"],
        camera=frames[0]["camera"],
        old_pose=frames[0]["world_from_camera"],
        new_pose=IDENTITY,
        sensor_model=frames[0]["sensor_model"],
    )
    together.remove(**{**frames[0], "world_from_camera": IDENTITY})
    for frame in frames[1:]:
        together.remove(**frame)
    assert together.num_blocks == 0


def test_more_models_than_are_kept(tmp_path: Path) -> None:
    frame = random_frames(1, seed=8)[0]
    models = [pm.SensorModel(0.02 + 0.005 * n) for n in range(20)]
    forth, back = make_grid(), make_grid()
    for a, b in zip(models, reversed(models), strict=True):
        forth.integrate(*frame, sensor_model=a)
        back.integrate(*frame, sensor_model=b)
    assert map_bytes(forth, tmp_path) == map_bytes(back, tmp_path)


def test_sensors_are_values() -> None:
    offsets = np.linspace(-0.1, 0.1, 16)
    sensor = pm.SphericalSensor(64, (0.3, -0.3), 16, first_azimuth=1.0, azimuth_span=TAU, row_offsets=offsets)
    same = pm.SphericalSensor(64, np.linspace(0.3, -0.3, 16), first_azimuth=1.0, azimuth_span=TAU, row_offsets=offsets)
    # The even elevations are computed by another formula here than there.
    np.testing.assert_allclose(sensor.elevations, same.elevations, atol=1e-15)
    for other in (sensor, pickle.loads(pickle.dumps(sensor))):
        assert other == sensor
        assert hash(other) == hash(sensor)
        assert (other.width, other.height, other.first_azimuth, other.azimuth_span) == (64, 16, 1.0, TAU)
        assert other.row_offsets is not None
        np.testing.assert_array_equal(other.row_offsets, offsets)
    assert sensor != pm.SphericalSensor(64, (0.3, -0.3), 16)
    assert sensor != "sensor"
    parallel = pm.OrthographicCamera(90, 70, 31.0, 27.0, 40.3, 33.8)
    assert pickle.loads(pickle.dumps(parallel)) == parallel
    assert hash(parallel) == hash(pm.OrthographicCamera(90, 70, 31.0, 27.0, 40.3, 33.8))
    assert parallel != pm.OrthographicCamera(90, 70, 31.0, 27.0, 40.3, 33.9)
    assert parallel != pm.PinholeCamera(90, 70, 31.0, 27.0, 40.3, 33.8)
    assert repr(parallel) == "OrthographicCamera(width=90, height=70, fx=31, fy=27, cx=40.3, cy=33.8)"
    assert repr(sensor).startswith("<SphericalSensor 16 x 64 (height x width), elevations 0.3 to -0.3")


# ---- what is refused ----


SPHERICAL = SENSORS["full turn"][0]
RANGES = np.full((32, 128), 2.0, np.float32)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"ranges": None}, ValueError, "depth is a NoneType, expected a .* or ranges instead"),
        ({"depth": RANGES}, ValueError, "depth and ranges are both given, expected one of them"),
        ({"camera": None}, TypeError, "camera is missing, expected a sensor"),
        ({"camera": "lidar"}, TypeError, "camera is a str, expected a PinholeCamera"),
        ({"world_from_camera": None}, ValueError, "world_from_camera is missing"),
        ({"world_from_camera": np.eye(3)}, ValueError, "world_from_camera has shape"),
        ({"camera": CAMERA}, ValueError, r"range image is 32 x 128 \(height x width\), expected the camera's 48 x 64"),
        ({"ranges": RANGES[:, :64]}, ValueError, r"range image is 32 x 64 .*, expected the camera's 32 x 128"),
        ({"ranges": RANGES[0]}, ValueError, r"ranges has shape \[128\]"),
        ({"ranges": RANGES.tolist()}, ValueError, "ranges is a list"),
        ({"ranges": RANGES.astype(np.int32)}, ValueError, "ranges has dtype int32"),
        ({"ranges": RANGES.astype(np.uint16)}, ValueError, "ranges is uint16 and depth_scale is missing"),
        ({"depth_scale": 1000.0}, ValueError, "depth_scale is 1000 but ranges is float32"),
        ({"ranges": np.zeros_like(RANGES)}, ValueError, "range image is 4096 pixels without a reading"),
        ({"sensor_model": 0.1}, TypeError, "sensor_model"),
    ],
)
def test_frames_that_are_refused(options: dict[str, Any], error: type[Exception], message: str, tmp_path: Path) -> None:
    grid = make_grid()
    good: dict[str, Any] = {"ranges": RANGES, "camera": SPHERICAL, "world_from_camera": IDENTITY}
    grid.integrate(**good)
    before = map_bytes(grid, tmp_path)
    for method in (grid.integrate, grid.remove):
        with pytest.raises(error, match=message):
            method(**{**good, **options})
    moved = {**good, **options, "old_pose": IDENTITY, "new_pose": IDENTITY}
    if moved.pop("world_from_camera") is IDENTITY:
        with pytest.raises(error, match=message):
            grid.reintegrate(**moved)
    assert map_bytes(grid, tmp_path) == before


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"width": 0}, "width is 0, expected 1 to 16384 pixels"),
        ({"width": -3}, "width is -3, expected 1 to 16384 pixels"),
        ({"width": 16385}, "width is 16385"),
        ({"height": 0}, "height is 0, expected 1 to 16384 pixels"),
        ({"height": -1}, "height is -1, expected 1 to 16384 pixels"),
        ({"height": 10**9}, "height is 1000000000, expected 1 to 16384 pixels"),
        ({"elevations": (0.1, 0.0, -0.1)}, "elevations are 3 numbers with a height, expected those of the first row"),
        ({"elevations": (0.1, 0.1)}, "elevations is 0.1 in row 0 and 0.1 in the next"),
        ({"elevations": (2.0, 0.1)}, "elevations is 2 in row 0, expected between -pi/2 and pi/2 radians"),
        ({"elevations": (NAN, 0.1)}, "elevations is NaN in row 0"),
        ({"elevations": 0.1}, r"elevations has shape \[\], expected \(N,\)"),
        ({"elevations": [[0.1]]}, r"elevations has shape \[1, 1\]"),
        ({"elevations": "many"}, "elevations is a str that is no array of numbers"),
        ({"first_azimuth": INF}, "first_azimuth is inf, expected a finite number of radians"),
        ({"azimuth_span": 0.0}, "azimuth_span is 0, expected up to 2 pi radians either way"),
        ({"azimuth_span": -6.4}, "azimuth_span is -6.4"),
        ({"azimuth_span": NAN}, "azimuth_span is NaN"),
        ({"azimuth_span": 1e-3}, "azimuth_span is 0.001 for 64 columns, expected at least 2 pi / 16384"),
        ({"row_offsets": [0.1]}, "row_offsets is 1 numbers, expected one for each of 8 rows"),
        ({"row_offsets": [INF] * 8}, "row_offsets is inf in row 0"),
        ({"azimuth_span": 1.0, "row_offsets": [0.1] * 8}, "row_offsets is given for a sensor of 1 radians"),
    ],
)
def test_parameters_of_a_spherical_sensor(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        pm.SphericalSensor(**{"width": 64, "elevations": (0.2, -0.2), "height": 8, **options})


@pytest.mark.parametrize(
    ("parameter", "value", "message"),
    [
        ("width", 0, "camera width is 0, expected 1 to 16384 pixels"),
        ("height", -1, "camera height is -1, expected at least 1"),
        ("fx", 0.0, "camera fx is 0, expected a positive, finite number of pixels a metre"),
        ("fy", NAN, "camera fy is NaN"),
        ("cx", INF, "camera cx is inf, expected a finite number of pixels"),
        ("cy", NAN, "camera cy is NaN"),
    ],
)
def test_parameters_of_an_orthographic_camera(parameter: str, value: float, message: str) -> None:
    good: dict[str, Any] = {"width": 64, "height": 8, "fx": 20.0, "fy": 20.0, "cx": 31.5, "cy": 3.5}
    with pytest.raises(ValueError, match=message):
        pm.OrthographicCamera(**{**good, parameter: value})


def test_places_that_a_map_cannot_hold(tmp_path: Path) -> None:
    """Parallel rays may see far aside, so that an image may be larger than a map."""
    grid = make_grid()
    before = map_bytes(grid, tmp_path)
    depth = np.full((8, 64), 2.0, np.float32)
    for fx, cx in ((0.1, 31.5), (20.0, -1e5)):
        with pytest.raises(ValueError, match=r"camera is one that sees places .* m off, expected no more than 4096"):
            grid.integrate(depth, pm.OrthographicCamera(64, 8, fx, 20.0, cx, 3.5), IDENTITY)
    pose = np.eye(4)
    pose[0, 3] = 53_687_000.0  # within what a pinhole camera may be at
    with pytest.raises(ValueError, match="camera lies at 53687000 m, expected within 536869"):
        grid.integrate(depth, pm.OrthographicCamera(64, 8, 2.0, 20.0, 300.0, 3.5), pose)
    assert map_bytes(grid, tmp_path) == before


# ---- point clouds and stereo ----


@pytest.mark.parametrize("name", list(SENSORS))
def test_clouds_become_images(name: str) -> None:
    """Points in random order, several in most pixels, against one pixel after the other."""
    sensor, reference = SENSORS[name]
    rng = np.random.default_rng(2)
    points = rng.uniform(-3, 3, (30_000, 3))
    u, v, z = reference.project(points)
    height, width = reference.shape()
    # Not on the border of two pixels, where rounding and the table of uneven beams decide.
    clear = (np.abs((u + 0.5) % 1 - 0.5) < 0.48) & (np.abs((v + 0.5) % 1 - 0.5) < 0.48) | np.isnan(u)
    points, u, v, z = points[clear], u[clear], v[clear], z[clear]
    with np.errstate(invalid="ignore"):
        seen = (np.rint(u) >= 0) & (np.rint(u) < width) & (np.rint(v) >= 0) & (np.rint(v) < height)
    expected = np.full((height, width), np.inf)
    np.minimum.at(expected, (np.rint(v[seen]).astype(int), np.rint(u[seen]).astype(int)), z[seen])
    expected[np.isinf(expected)] = 0

    useless = [[NAN, 1, 1], [0, 0, 0], [1, INF, 1]]
    ranges, lost = pm.range_image(np.concatenate([points, useless]), sensor)
    assert ranges.dtype == np.float32
    np.testing.assert_allclose(ranges, expected, rtol=1e-6)
    pixels = np.count_nonzero(ranges)
    assert lost == {"out_of_view": np.count_nonzero(~seen), "hidden": seen.sum() - pixels, "unusable": 3}
    assert pixels > 500
    grid = make_grid()
    grid.integrate(ranges=ranges, camera=sensor, world_from_camera=IDENTITY)
    assert grid.num_observed > 500


def test_clouds_that_are_refused() -> None:
    with pytest.raises(ValueError, match=r"points have shape \[3\]"):
        pm.range_image([1.0, 2.0, 3.0], SPHERICAL)
    with pytest.raises(TypeError, match="camera is a int, expected a PinholeCamera"):
        pm.range_image([[1.0, 2.0, 3.0]], 3)  # type: ignore[arg-type]


def test_depth_from_disparity() -> None:
    disparity = np.array([[10.0, 0.0, -1.0], [NAN, INF, 0.5]])
    for values in (disparity, disparity.astype(np.float32)):
        depth = pm.depth_from_disparity(values, focal_length=500.0, baseline=0.12)
        assert depth.dtype == np.float32
        np.testing.assert_allclose(depth, [[6.0, 0.0, 0.0], [0.0, 0.0, 120.0]], rtol=1e-7)
    assert np.isinf(pm.depth_from_disparity(np.array([[1e-300]]), 500.0, 0.12))
    for name, value in (("focal_length", 0.0), ("baseline", -0.1), ("baseline", NAN), ("focal_length", INF)):
        with pytest.raises(ValueError, match=f"{name} is {value}, expected a positive, finite number of"):
            pm.depth_from_disparity(disparity, **{"focal_length": 500.0, "baseline": 0.12, name: value})
    for wrong in (np.ones((2, 2), np.int16), np.ones(4)):
        with pytest.raises(ValueError, match=r"disparity has shape .* expected \(H, W\) float32 or float64 pixels"):
            pm.depth_from_disparity(wrong, 500.0, 0.12)  # type: ignore[arg-type]


# ---- lenses ----


def test_no_distortion_is_no_lens(tmp_path: Path) -> None:
    depth, camera, pose = random_frames(1, seed=9)[0]
    numbers = (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
    same = pm.PinholeCamera(*numbers, distortion=(0.0, 0.0, 0.0, 0.0, 0.0))
    assert same == camera
    assert same.distortion is None
    lens = pm.PinholeCamera(*numbers, distortion=(-0.1, 0.01, 0.0, 0.001))
    assert lens.distortion == (-0.1, 0.01, 0.0, 0.001, 0.0)
    assert lens != camera
    assert pickle.loads(pickle.dumps(lens)) == lens
    assert hash(lens) == hash(pm.PinholeCamera(*numbers, distortion=[-0.1, 0.01, 0.0, 0.001, 0.0]))
    assert repr(lens).endswith("cx=31.2, cy=23.9, distortion=(-0.1, 0.01, 0.0, 0.001, 0.0))")
    # A lens that does next to nothing makes next to the same map.
    maps = [make_grid(update="area") for _ in range(2)]
    for grid, one in zip(maps, (camera, pm.PinholeCamera(*numbers, distortion=(1e-12, 0.0, 0.0, 0.0))), strict=True):
        grid.integrate(depth, one, pose)
    coords = maps[0].block_coords()
    difference = np.abs(maps[0].block_log_odds(coords) - maps[1].block_log_odds(coords))
    assert (difference > 1e-3).mean() < 1e-3


def test_depth_and_ranges_of_a_lens() -> None:
    camera, reference = SENSORS["barrel lens"]
    directions = reference.rays()[1]
    depth = np.full((60, 80), 2.0, np.float32)
    np.testing.assert_allclose(pm.ranges(depth, camera), 2 / directions[..., 2], rtol=1e-6)
    scene = pm.scenes.spheres()
    pose = scene.poses()[0]
    depth, ranges = scene.render(camera, pose), scene.render_ranges(camera, pose)
    np.testing.assert_allclose(depth, ranges * directions[..., 2], rtol=1e-6)
    points = (ranges[..., None] * directions).reshape(-1, 3) @ pose[:3, :3].T + pose[:3, 3]
    assert np.abs(scene.signed_distance(points)).max() < 1e-5


def test_a_lens_that_folds_back_leaves_pixels_without_a_reading() -> None:
    camera = pm.PinholeCamera(80, 60, 60.0, 60.0, 39.5, 29.5, distortion=(-0.4, 0.0, 0.0, 0.0))
    ranges = pm.ranges(np.full((60, 80), 2.0, np.float32), camera)
    # r - 0.4 r^3 reaches 0.61 at most, at r = 0.91, and is taken as far as it still rises at a tenth of its rate.
    v, u = np.mgrid[:60, :80]
    distorted = np.hypot(u - 39.5, v - 29.5) / 60
    assert (ranges[distorted < 0.59] > 2).all()
    assert (ranges[distorted > 0.61] == 0).all()
    assert ((distorted > 0.61) & (distorted < 0.7)).any()


@pytest.mark.parametrize(
    ("distortion", "message"),
    [
        ((0.1,), "distortion is 1 numbers, expected k1, k2, p1, p2 and perhaps k3"),
        ((0.1,) * 8, "distortion is 8 numbers"),
        (0.1, r"distortion has shape \[\], expected \(N,\)"),
        ("wide", "distortion is a str that is no array of numbers"),
        ((NAN, 0, 0, 0), "distortion is .NaN, 0.0, 0.0, 0.0, 0.0., expected finite coefficients"),
        ((0, 0, 0, INF, 0), "distortion is .*inf.*, expected finite coefficients"),
        ((-1e6, 0, 0, 0), "distortion is .*, expected a lens that has an image around its axis"),
    ],
)
def test_distortions_that_are_refused(distortion: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        pm.PinholeCamera(80, 60, 60.0, 60.0, 39.5, 29.5, distortion)
