"""The update rule `rays`: OctoMap's sensor model, voxel by voxel."""

from __future__ import annotations

import gzip
import math
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
import pytest
from frames import CAMERA, Frame, map_bytes, map_of, random_frames, wall
from numpy.typing import NDArray
from octomap_files import Voxel, known, voxels_of_pyoctomap
from real_data import real

UNIT = 2.0**-12
HIT, MISS = math.log(0.7 / 0.3), math.log(0.4 / 0.6)

Points = NDArray[np.float64]


def rays_grid(voxel_size: float = 0.1, **options: Any) -> pm.OccupancyGrid:
    return pm.OccupancyGrid(voxel_size=voxel_size, update="rays", **options)


def at(*translation: float) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, 3] = translation
    return pose


def steps(log_odds: float) -> float:
    """As it is stored."""
    return round(log_odds / UNIT) * UNIT


# ---- what OctoMap made of the same scans ----


def read_pcd(path: Path) -> tuple[Points, Points]:
    """Where the sensor was, and the points, which are in the world's frame."""
    text, _, data = path.read_bytes().partition(b"DATA binary\n")
    header = dict(line.split(" ", 1) for line in text.decode().splitlines() if not line.startswith("#"))
    assert header["FIELDS"] == "x y z intensity"
    points = np.frombuffer(data, "<f4", 4 * int(header["POINTS"])).reshape(-1, 4)[:, :3]
    return np.array(header["VIEWPOINT"].split()[:3], float), points.astype(float)


def read_leaves(path: Path, voxel_size: float) -> dict[Voxel, float]:
    """Probabilities of all voxels. The file has the centres of leaves, which are odd multiples of half an edge."""
    found = {}
    with gzip.open(path, "rt") as file:
        for line in file:
            *centre, probability = map(float, line.split(","))
            halves = [round(2 * c / voxel_size) for c in centre]
            edge = halves[0] & -halves[0]
            assert all((h & -h) == edge for h in halves)
            for n in np.ndindex(edge, edge, edge):
                x, y, z = ((h - edge) // 2 + i for h, i in zip(halves, n, strict=True))
                found[x, y, z] = probability
    return found


def test_octomap_made_the_same_of_twelve_scans() -> None:
    folder = real("octomap_oracle")
    expected = read_leaves(folder / "sim_structured_octomap.csv.gz", 0.1)
    grid = rays_grid(max_range=8.0, clamp=pm.OCTOMAP_CLAMP)
    for n in range(1, 13):
        origin, points = read_pcd(folder / f"sim_structured_{n}.pcd")
        grid.integrate_points(points - origin, at(*origin))
    actual = known(grid)
    assert len(expected) == 197_291
    assert actual.keys() == expected.keys()
    # Twelve updates, each rounded by half a unit of log-odds, at a slope of 1/4 at most; and six digits in the file.
    tolerance = 12 * UNIT / 2 / 4 + 5e-7
    probability = {voxel: 1 / (1 + math.exp(-value)) for voxel, value in actual.items()}
    assert max(abs(probability[voxel] - expected[voxel]) for voxel in expected) <= tolerance
    assert all((actual[voxel] > 0) == (expected[voxel] >= 0.5) for voxel in expected)


@pytest.mark.parametrize("voxel_size", [0.1, 0.07, 0.25])
@pytest.mark.parametrize("max_range", [2.5, 5.0])
def test_octomap_makes_the_same_of_random_points(voxel_size: float, max_range: float) -> None:
    pyoctomap = pytest.importorskip("pyoctomap", reason="pyoctomap, OctoMap itself, is not installed")
    rng = np.random.default_rng(round(1000 * voxel_size + max_range))
    grid = rays_grid(voxel_size, max_range=max_range, clamp=pm.OCTOMAP_CLAMP)
    tree = pyoctomap.OcTree(voxel_size)
    for _ in range(6):
        # OctoMap has single precision, and so must what both get; some points repeat, lie in the sensor's own voxel, or
        # on the borders of voxels.
        origin = rng.uniform(-1.0, 1.0, 3).astype(np.float32).astype(float)
        points = origin + rng.normal(0.0, 2.0, (400, 3))
        points[:20] = points[20:40]
        points[40:50] = origin
        points[50:80] = np.round(points[50:80] / voxel_size) * voxel_size
        points[80:100, 1] = origin[1]
        points = points.astype(np.float32).astype(float)
        grid.integrate_points(points - origin, at(*origin))
        tree.insertPointCloud(points, origin, max_range=max_range)
    actual, expected = known(grid), voxels_of_pyoctomap(tree)
    assert actual.keys() == expected.keys()
    # Each of the six updates is rounded by at most half a unit, and so is the bound it may be clamped to.
    assert max(abs(actual[voxel] - expected[voxel]) for voxel in expected) <= 3.5 * UNIT


# ---- what a scan does ----


def test_one_ray() -> None:
    grid = rays_grid()
    stats = grid.integrate_points([[1.0, 0.0, 0.0]], at(0.05, 0.25, -0.15))
    assert known(grid) == {(i, 2, -2): steps(HIT if i == 10 else MISS) for i in range(11)}
    assert (stats.blocks_free, stats.blocks_mixed, stats.voxels_updated, grid.num_frames) == (0, 2, 11, 1)


def test_a_scan_counts_once_and_hits_win() -> None:
    """Rays through each other's ends, and the same ray many times: each voxel is updated once."""
    grid = rays_grid()
    points = [[1.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    pose = at(0.05, 0.05, 0.05)
    grid.integrate_points(points, pose)
    once = {(i, 0, 0): steps(HIT if i in (0, 5, 10) else MISS) for i in range(11)}
    assert known(grid) == once
    grid.integrate_points(points, pose)
    assert known(grid) == {voxel: 2 * value for voxel, value in once.items()}


def test_clamping() -> None:
    grid = rays_grid(clamp=pm.OCTOMAP_CLAMP)
    for _ in range(20):
        grid.integrate_points([[0.3, 0.0, 0.0]], at(0.05, 0.05, 0.05))
    low, high = map(steps, pm.OCTOMAP_CLAMP)
    assert known(grid) == {(0, 0, 0): low, (1, 0, 0): low, (2, 0, 0): low, (3, 0, 0): high}


def test_points_turn_with_the_sensor() -> None:
    turned = at(0.05, 0.05, 0.05)
    turned[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]  # the sensor's x is the world's y
    grid = rays_grid()
    grid.integrate_points([[0.2, 0.0, 0.1]], turned)
    assert grid.state([[0.05, 0.25, 0.15], [0.25, 0.05, 0.15]]).tolist() == [1, -1]


@pytest.mark.parametrize("beyond", ["free", "ignore"])
def test_beyond_the_range(beyond: str) -> None:
    grid = rays_grid(max_range=1.0, beyond_max_range=beyond)
    grid.integrate_points([[0.0, 0.5, 0.0], [3.0, 0.0, 0.0]], at(0.05, 0.05, 0.05))
    along_x = {voxel for voxel in known(grid) if voxel[0] > 0}
    # The ray ends 1.05 m from the origin: up to the voxel before that it is free.
    assert along_x == ({(i, 0, 0) for i in range(1, 10)} if beyond == "free" else set())
    assert set(known(grid).values()) == {steps(HIT), steps(MISS)}


def test_points_that_are_not_finite_say_nothing() -> None:
    grid, expected = rays_grid(), rays_grid()
    points = np.random.default_rng(3).normal(0, 1, (50, 3))
    expected.integrate_points(points, np.eye(4))
    bad = [[np.nan, 0.0, 0.0], [0.0, np.inf, 0.0], [0.0, 0.0, -np.inf]]
    grid.integrate_points(np.concatenate([points[:20], bad, points[20:]]), np.eye(4))
    assert known(grid) == known(expected)


# ---- depth images ----


def pixels_as_points(frame: Frame) -> Points:
    """Points in the camera's frame, for the pixels with a reading."""
    depth = frame.depth.astype(float)
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(depth)], axis=-1)
    points: Points = (rays * depth[..., None])[np.isfinite(depth) & (depth > 0)]
    return points


def test_an_image_is_its_points() -> None:
    for frame in random_frames(3, seed=4):
        frame.depth[frame.depth == np.inf] = 0
        image, points = rays_grid(max_range=3.0), rays_grid(max_range=3.0)
        image.integrate(*frame)
        points.integrate_points(pixels_as_points(frame), frame.world_from_camera)
        a, b = known(image), known(points)
        # Ends differ in the last bits of single precision, 1e-7 of metres: it takes an end that near to a border, or a
        # ray that near to an edge of a voxel, for the maps to differ. Of 3000 rays none or a few come so close.
        differing = {voxel for voxel in a.keys() | b.keys() if a.get(voxel) != b.get(voxel)}
        assert len(a) > 1000
        assert len(differing) <= 3


def test_a_wall() -> None:
    grid = rays_grid(max_range=4.0)
    grid.integrate(*wall(2.03))
    assert grid.state([[0.01, 0.01, 1.0], [0.01, 0.01, 2.05], [0.01, 0.01, 2.2]]).tolist() == [0, 1, -1]
    assert set(known(grid).values()) == {steps(HIT), steps(MISS)}


def test_no_return_is_free_up_to_the_range() -> None:
    grid = rays_grid(max_range=2.0)
    grid.integrate(np.full((CAMERA.height, CAMERA.width), np.inf, np.float32), CAMERA, np.eye(4))
    assert set(known(grid).values()) == {steps(MISS)}
    assert grid.state([[0.01, 0.01, 1.85], [0.01, 0.01, 2.05]]).tolist() == [0, -1]


def test_frames_are_a_sum_as_with_other_rules(tmp_path: Path) -> None:
    frames = random_frames(3, seed=6)
    grid = map_of(frames, update="rays")
    assert map_bytes(map_of(frames[::-1], update="rays"), tmp_path) == map_bytes(grid, tmp_path)
    threads = pm.num_threads()
    try:
        pm.set_num_threads(1)
        assert map_bytes(map_of(frames, update="rays"), tmp_path) == map_bytes(grid, tmp_path)
    finally:
        pm.set_num_threads(threads)
    loaded = pm.OccupancyGrid.load(tmp_path / "bytes.pmap", backend="cpu")
    assert loaded.update == "rays"
    for frame in frames:
        loaded.remove(*frame)
    assert loaded.num_blocks == 0


# ---- errors ----


@pytest.mark.parametrize("update", ["pyramid", "area", "min_layer", "ideal"])
def test_other_rules_read_images(update: Any) -> None:
    grid = pm.OccupancyGrid(voxel_size=0.1, update=update, backend="cpu")
    with pytest.raises(ValueError, match=r"integrate_points is not possible: .* update rule .*, and only Rays"):
        grid.integrate_points([[1.0, 0.0, 0.0]], np.eye(4))
    assert grid.num_frames == 0


@pytest.mark.parametrize(
    ("points", "pose", "message"),
    [
        (np.zeros((3, 2)), np.eye(4), r"points have shape \[3, 2\]"),
        ("cloud", np.eye(4), "points is a str"),
        (np.zeros((0, 3)), np.eye(4), "points is 0 points that say nothing"),
        (np.full((4, 3), np.nan), np.eye(4), "points is 4 points that say nothing"),
        ([[1.0, 0.0, 0.0]], np.eye(3), "shape"),
        ([[1.0, 0.0, 0.0]], np.diag([1.0, 1.0, 2.0, 1.0]), "rotation"),
        ([[1.0, 0.0, 0.0]], at(3272.0, 0.0, 0.0), "lies at 3272 m, expected within 3271.8 m"),
    ],
)
def test_what_cannot_be_fused(points: Any, pose: Any, message: str, tmp_path: Path) -> None:
    grid = rays_grid()
    grid.integrate_points([[1.0, 0.0, 0.0]], np.eye(4))
    before = map_bytes(grid, tmp_path)
    with pytest.raises(ValueError, match=message):
        grid.integrate_points(points, pose)
    assert map_bytes(grid, tmp_path) == before


def test_a_full_map_is_left_as_it_is(tmp_path: Path) -> None:
    grid = rays_grid(max_bytes=100_000)
    grid.integrate_points([[1.0, 0.0, 0.0]], np.eye(4))
    before = map_bytes(grid, tmp_path)
    with pytest.raises(pm.MapFullError, match="max_bytes is 100000"):
        grid.integrate_points(np.random.default_rng(0).normal(0, 5, (2000, 3)), np.eye(4))
    assert map_bytes(grid, tmp_path) == before
