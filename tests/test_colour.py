"""Colours of voxels and meshes: against a naive program, against a painted scene, and as a group."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyramap as pm
import pytest
import trimesh
from frames import CAMERA, IDENTITY, MAX_RANGE, make_grid, map_bytes, random_frames, wall
from numpy.typing import NDArray
from pyramap import pictures, report
from reference_colour import expected_colours

Floats = NDArray[np.float64]
# Of another size than the depth, and narrower, so that some of what the depth shows is out of its sight.
COLOUR_CAMERA = pm.PinholeCamera(width=101, height=75, fx=120.0, fy=118.0, cx=49.0, cy=38.5)


class Painted(NamedTuple):
    """The arguments of `integrate` and `remove`, with colour."""

    depth: NDArray[np.float32]
    camera: pm.PinholeCamera
    world_from_camera: Floats
    colour: NDArray[np.uint8]
    colour_camera: pm.PinholeCamera
    depth_from_colour: Floats

    def fuse(self, method: Callable[..., Any]) -> None:
        depth, camera, pose, colour, colour_camera, depth_from_colour = self
        method(depth, camera, pose, colour=colour, colour_camera=colour_camera, depth_from_colour=depth_from_colour)


def turned(angle: float, translation: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Floats:
    """A pose turned about y, radians."""
    pose = np.eye(4)
    pose[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    pose[:3, 3] = translation
    return pose


def random_image(seed: int, camera: pm.PinholeCamera = COLOUR_CAMERA) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (camera.height, camera.width, 3), dtype=np.uint8)


def painted_frames(count: int, seed: int) -> list[Painted]:
    return [
        Painted(*frame, random_image(seed + n), COLOUR_CAMERA, turned(0.02 * n, (0.03, 0.01 * n, -0.01)))
        for n, frame in enumerate(random_frames(count, seed))
    ]


def coloured(frames: list[Painted], **options: Any) -> pm.OccupancyGrid:
    grid = make_grid(backend="cpu", colour=True, **options)
    for frame in frames:
        frame.fuse(grid.integrate)
    return grid


def all_voxels(grid: pm.OccupancyGrid) -> Floats:
    """(N, 3) centres of the voxels of all blocks, and of those around them."""
    blocks = grid.block_coords().astype(np.int64)
    around = np.stack(np.meshgrid(*[np.arange(-1, 2)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    blocks = np.unique((blocks[:, None] + around).reshape(-1, 3), axis=0)
    within = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(((8 * blocks[:, None] + within).reshape(-1, 3) + 0.5) * grid.voxel_size, np.float64)


FRAMES = painted_frames(4, seed=70)
GOOD = FRAMES[0]


@pytest.mark.parametrize(
    ("sigma", "offset", "voxel_size"), [(0.05, 0.0, 0.05), (0.01, 0.0, 0.05), (0.06, 0.2, 0.05), (0.03, 0.0, 0.02)]
)
@pytest.mark.parametrize("case", ["turned", "registered", "aside"])
def test_each_voxel_near_a_surface_has_its_colour(sigma: float, offset: float, voxel_size: float, case: str) -> None:
    """One frame, voxel by voxel, both ways: nothing has a colour that should have none."""
    depth, _, pose = random_frames(1, seed=71)[0]
    if case == "aside":  # nothing hides anything from there
        depth = wall(1.3).depth
    colour_camera = CAMERA if case == "registered" else COLOUR_CAMERA
    place = {"turned": turned(0.05), "registered": IDENTITY, "aside": turned(-0.06, (0.05, -0.02, 0.04))}[case]
    colour = random_image(72, colour_camera)
    model = pm.SensorModel(sigma, surface_offset=offset)
    grid = pm.OccupancyGrid(voxel_size, sensor_model=model, max_range=MAX_RANGE, backend="cpu", colour=True)
    if case == "registered":
        grid.integrate(depth, CAMERA, pose, colour=colour)
    else:
        grid.integrate(depth, CAMERA, pose, colour=colour, colour_camera=colour_camera, depth_from_colour=place)
    points = all_voxels(grid)
    options: dict[str, Any] = {"sigma": sigma, "offset": offset, "voxel_size": voxel_size, "max_range": MAX_RANGE}
    expected = expected_colours(points, depth, CAMERA, pose, colour, colour_camera, place, **options)

    got = grid.colour(points)
    sure = ~expected.ambiguous
    assert expected.ambiguous.mean() < 0.01
    np.testing.assert_array_equal(got[sure, 3], np.where(expected.seen[sure], 255, 0))
    assert np.count_nonzero(expected.seen) > 1000
    seen = sure & expected.seen
    # Places between pixels are told apart in 256 parts along each axis: neighbours differ by up to 255, which makes 2
    # levels; half a level more by rounding, and a little by 32-bit arithmetic on places, 1e-5 pixels.
    assert np.abs(got[seen, :3] - expected.colour[seen]).max() <= 2.6
    assert not got[got[:, 3] == 0].any()


def test_the_mean_of_all_frames_is_kept() -> None:
    nearby = [turned(0.02 * n, (0.01 * n, 0.0, 0.0)) for n in range(5)]
    frames = [
        GOOD._replace(world_from_camera=GOOD.world_from_camera @ pose, colour=random_image(n))
        for n, pose in enumerate(nearby)
    ]
    points = all_voxels(coloured(frames))
    each = [coloured([frame]).colour(points).astype(np.float64) for frame in frames]
    count = np.sum([colours[:, 3:] > 0 for colours in each], axis=0)
    mean = np.sum([colours[:, :3] for colours in each], axis=0) / np.maximum(count, 1)
    got = coloured(frames).colour(points)
    np.testing.assert_array_equal(got[:, 3:] > 0, count > 0)
    assert (count > 1).sum() > 1000, "frames overlap"
    # Rounded once; a half either way.
    assert np.abs(got[:, :3] - mean).max() <= 0.5


def test_frames_commute_and_can_be_taken_off(tmp_path: Path) -> None:
    grid = coloured(FRAMES)
    whole = map_bytes(grid, tmp_path)
    assert map_bytes(coloured(FRAMES[::-1]), tmp_path) == whole
    FRAMES[1].fuse(grid.remove)
    assert map_bytes(grid, tmp_path) == map_bytes(coloured([FRAMES[0], *FRAMES[2:]]), tmp_path)
    for frame in (FRAMES[0], *FRAMES[2:]):
        frame.fuse(grid.remove)
    assert map_bytes(grid, tmp_path) == map_bytes(coloured([]), tmp_path)
    # What was never fused can be taken off too, and comes back.
    FRAMES[2].fuse(grid.remove)
    assert not grid.colour(all_voxels(coloured(FRAMES)))[:, 3].any()
    FRAMES[2].fuse(grid.integrate)
    assert map_bytes(grid, tmp_path) == map_bytes(coloured([]), tmp_path)


def test_colours_do_not_depend_on_threads_culling_or_evidence(tmp_path: Path) -> None:
    before = pm.num_threads()
    try:
        files = []
        for threads in (1, 3):
            pm.set_num_threads(threads)
            files.append(map_bytes(coloured(FRAMES), tmp_path))
    finally:
        pm.set_num_threads(before)
    assert files[0] == files[1]
    points = all_voxels(coloured(FRAMES))
    for options in ({"update": "area"}, {"clamp": (-2.0, 2.0)}, {"prior": 0.3}):
        np.testing.assert_array_equal(coloured(FRAMES, **options).colour(points), coloured(FRAMES).colour(points))


def test_many_frames_of_one_place() -> None:
    """Sums that outgrow 16 bits, and shrink again."""
    image = np.full((CAMERA.height, CAMERA.width, 3), (255, 130, 1), np.uint8)
    grid = make_grid(backend="cpu", colour=True)
    few = wall(1.0)
    for _ in range(140):
        grid.integrate(*few, colour=image)
    surface = [[0.0, 0.0, 1.0]]
    assert grid.colour(surface).tolist() == [[255, 130, 1, 255]]
    wide = grid.nbytes
    for _ in range(139):
        grid.remove(*few, colour=image)
    assert grid.colour(surface).tolist() == [[255, 130, 1, 255]]
    assert grid.nbytes < wide


def test_merging_adds_colours(tmp_path: Path) -> None:
    grid = coloured(FRAMES[:2])
    grid.merge(coloured(FRAMES[2:]))
    assert map_bytes(grid, tmp_path) == map_bytes(coloured(FRAMES), tmp_path)
    plain = make_grid(backend="cpu")
    with pytest.raises(ValueError, match="the other map has colours, and this one was made without"):
        plain.merge(grid)
    assert plain.num_blocks == 0
    plain.integrate(*FRAMES[0][:3])
    grid.merge(plain)
    assert grid.num_frames == 5


def test_a_frame_can_be_moved(tmp_path: Path) -> None:
    grid = coloured(FRAMES)
    depth, camera, pose, colour, colour_camera, place = FRAMES[3]
    there = turned(0.4, (0.2, 0.0, -0.1))
    options: dict[str, Any] = {"colour": colour, "colour_camera": colour_camera, "depth_from_colour": place}
    grid.reintegrate(depth, camera, pose, there, **options)
    moved = coloured([*FRAMES[:3], FRAMES[3]._replace(world_from_camera=there)])
    assert map_bytes(grid, tmp_path) == map_bytes(moved, tmp_path)


def test_frames_without_colour_change_none(tmp_path: Path) -> None:
    grid = coloured(FRAMES[:2])
    points = all_voxels(grid)
    before = grid.colour(points)
    grid.integrate(*FRAMES[2][:3])
    np.testing.assert_array_equal(grid.colour(points), before)
    plain = make_grid(backend="cpu")
    for frame in FRAMES[:3]:
        plain.integrate(*frame[:3])
    np.testing.assert_array_equal(plain.block_log_odds(plain.block_coords()), grid.block_log_odds(grid.block_coords()))
    assert (grid.has_colour, plain.has_colour) == (True, False)


def test_forgetting_takes_colours_along_and_decay_leaves_them() -> None:
    points = all_voxels(coloured(FRAMES))
    whole = coloured(FRAMES).colour(points)
    region = np.array([[-0.43, -0.6, -0.7], [0.61, 0.52, 0.8]])
    inside = ((points >= region[0]) & (points < region[1])).all(axis=1)
    assert whole[inside, 3].any() and whole[~inside, 3].any()
    for method, kept in (("clear", ~inside), ("crop", inside)):
        grid = coloured(FRAMES)
        getattr(grid, method)(region)
        np.testing.assert_array_equal(grid.colour(points), np.where(kept[:, None], whole, 0))
        assert grid.num_erasures == 1
    grid = coloured(FRAMES)
    grid.decay(0.5)
    np.testing.assert_array_equal(grid.colour(points), whole)
    everything = coloured(FRAMES)
    everything.clear([[-np.inf] * 3, [np.inf] * 3])
    assert not everything.colour(points).any()
    assert everything.nbytes < coloured(FRAMES).nbytes / 4


def test_a_file_holds_the_colours(tmp_path: Path) -> None:
    grid = coloured(FRAMES)
    file = map_bytes(grid, tmp_path)
    assert struct.unpack_from("<I", file, 8) == (3,)
    again = pm.OccupancyGrid.load(tmp_path / "bytes.pmap", backend="cpu")
    points = all_voxels(grid)
    assert again.has_colour
    np.testing.assert_array_equal(again.colour(points), grid.colour(points))
    assert map_bytes(again, tmp_path) == file
    for frame in FRAMES:
        frame.fuse(again.remove)
    assert map_bytes(again, tmp_path) == map_bytes(coloured([]), tmp_path)


def test_a_map_without_colour_is_a_file_as_before(tmp_path: Path) -> None:
    """So that programs which know no colour read it."""
    grid = make_grid(backend="cpu")
    grid.integrate(*FRAMES[0][:3])
    assert struct.unpack_from("<I", map_bytes(grid, tmp_path), 8) == (2,)
    assert not pm.OccupancyGrid.load(tmp_path / "bytes.pmap").has_colour


def test_damage_to_a_file_with_colours_is_noticed(tmp_path: Path) -> None:
    good = map_bytes(coloured(FRAMES[:1]), tmp_path)
    path = tmp_path / "damaged.pmap"
    rng = np.random.default_rng(3)
    for position in {*range(12), *rng.integers(12, len(good), 60).tolist()}:
        path.write_bytes(good[:position] + bytes([good[position] ^ 1 << int(rng.integers(8))]) + good[position + 1 :])
        with pytest.raises(OSError, match=rf"^{path}: "):
            pm.OccupancyGrid.load(path)
    for length in rng.integers(0, len(good), 30).tolist():
        path.write_bytes(good[:length])
        with pytest.raises(OSError, match=rf"^{path}: "):
            pm.OccupancyGrid.load(path)
    path.write_bytes(good[:8] + struct.pack("<I", 2) + good[12:])
    with pytest.raises(OSError, match="unreadable parameters"):
        pm.OccupancyGrid.load(path)


def paint(points: Floats) -> Floats:
    """A colour for every place in the world, smooth: it changes by at most 60 levels a metre."""
    colours: Floats = 128 + 60 * np.sin(points)
    return colours


# A coarse picture of a scene whose rooms are some metres wide.
SCENE_CAMERA = pm.PinholeCamera(width=160, height=120, fx=140.0, fy=140.0, cx=80.0, cy=60.0)


def scene_frame(scene: pm.scenes.Scene, pose: Floats, camera: Any, place: Floats) -> dict[str, Any]:
    """What a depth camera and a colour camera at a place beside it see of a painted scene."""
    world_from_colour = pose @ place
    depth = scene.render(SCENE_CAMERA, world_from_colour).astype(np.float64)
    v, u = np.mgrid[: SCENE_CAMERA.height, : SCENE_CAMERA.width]
    rays = np.stack(
        [(u - SCENE_CAMERA.cx) / SCENE_CAMERA.fx, (v - SCENE_CAMERA.cy) / SCENE_CAMERA.fy, np.ones(u.shape)]
    )
    points = np.moveaxis(rays * depth, 0, -1) @ world_from_colour[:3, :3].T + world_from_colour[:3, 3]
    return {
        "ranges": scene.render_ranges(camera, pose),
        "camera": camera,
        "world_from_camera": pose,
        "colour": np.round(paint(points)).astype(np.uint8),
        "colour_camera": SCENE_CAMERA,
        "depth_from_colour": place,
    }


SENSORS = {
    "pinhole": pm.PinholeCamera(width=200, height=150, fx=180.0, fy=180.0, cx=99.5, cy=74.5),
    "lens": pm.PinholeCamera(200, 150, 180.0, 180.0, 99.5, 74.5, distortion=(-0.2, 0.05, 0.001, -0.002)),
    "orthographic": pm.OrthographicCamera(width=160, height=120, fx=60.0, fy=60.0, cx=79.5, cy=59.5),
}


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("update", ["pyramid", "rays"])
def test_the_mesh_of_a_painted_scene_has_its_colours(sensor: str, update: Any) -> None:
    scene = pm.scenes.box()
    grid = pm.OccupancyGrid(0.04, max_range=8.0, update=update, backend="cpu", colour=True)
    for pose in scene.poses()[::30]:
        grid.integrate(**scene_frame(scene, pose, SENSORS[sensor], turned(0.0, (0.06, 0.0, 0.0))))
    mesh = grid.mesh(min_faces=50)
    assert mesh.colours is not None
    assert mesh.colours.dtype == np.uint8
    assert mesh.colours.shape == (len(mesh.vertices), 4)
    seen = mesh.colours[:, 3] > 0
    assert seen.mean() > 0.6
    assert not mesh.colours[~seen].any()
    off = np.abs(mesh.colours[seen, :3] - paint(mesh.vertices[seen].astype(np.float64)))
    # A vertex may lie two voxels in front of the surface, and be seen from all sides, at up to 55 degrees or so: 0.14 m
    # along it, which is 8 levels. At the edges of things the next surface may be behind it: few vertices.
    assert np.quantile(off, 0.98) <= 8
    assert np.median(off) <= 3


def test_a_lidar_with_a_camera() -> None:
    scene = pm.scenes.office_loop()
    lidar = pm.SphericalSensor(512, (0.5, -0.5), 64)
    # The LiDAR's x is forward, y left, z up; the camera's z is forward, x right, y down.
    place = np.array([[0, 0, 1, 0.1], [-1, 0, 0, 0.05], [0, -1, 0, -0.05], [0, 0, 0, 1.0]])
    upright = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])
    grid = pm.OccupancyGrid(0.1, max_range=8.0, backend="cpu", colour=True)
    pose = scene.poses()[0] @ upright
    frame = scene_frame(scene, pose, lidar, place)
    grid.integrate(**frame)
    mesh = grid.mesh()
    assert mesh.colours is not None
    seen = mesh.colours[:, 3] > 0
    assert 50 < seen.sum() < 0.5 * len(seen), "the camera sees a part of the turn"
    off = np.abs(mesh.colours[seen, :3] - paint(mesh.vertices[seen].astype(np.float64)))
    # As above, with voxels of 0.1 m.
    assert np.quantile(off, 0.95) <= 20


def test_what_is_hidden_from_the_colour_camera_gets_no_colour() -> None:
    """A post hides a strip of the wall behind it from a camera 0.1 m to the right: its colour is not the wall's."""
    camera = pm.PinholeCamera(width=200, height=100, fx=200.0, fy=200.0, cx=99.5, cy=49.5)
    u = np.tile(np.arange(200), (100, 1))
    depth = np.where(np.abs(u - 99.5) < 20, 1.0, 2.0)
    # From 0.1 m to the right a pixel of the post moves 20 columns to the left, and one of the wall 10.
    post, ground = (255, 0, 0), (0, 0, 255)
    colour = np.where((np.abs(u - 79.5) < 20)[..., None], post, ground).astype(np.uint8)
    grid = pm.OccupancyGrid(0.05, backend="cpu", colour=True)
    grid.integrate(depth, camera, IDENTITY, colour=colour, depth_from_colour=turned(0.0, (0.1, 0.0, 0.0)))
    row = np.arange(-0.88, 0.88, 0.05) + 0.0049
    of_wall = grid.colour(np.stack([row, np.zeros_like(row), np.full_like(row, 2.0)], axis=1))
    of_post = grid.colour([[x, 0.0, 1.0] for x in (-0.01, 0.01)])
    assert (of_post == [*post, 255]).all()
    # The post's columns are 59.5 to 99.5 in the colour image: there the wall is hidden, x from -0.30 to 0.10 m. Half of
    # that lies behind the post for the depth camera too. What is left, and a voxel and the mixed colours of the
    # border's pixels from it, is the strip.
    columns = 99.5 + 200 * row / 2.0
    seen = np.abs(columns - 99.5) > 20
    hidden = seen & (columns > 69.5 + 2) & (columns < 79.5)
    assert hidden.any()
    assert not of_wall[hidden, 3].any()
    clear = seen & ((columns < 69.5 - 6) | (columns > 119.5 + 3)) & (columns > 16)
    assert clear.sum() > 15
    assert (of_wall[clear] == [*ground, 255]).all()


@pytest.mark.parametrize("kind", ["ply", "glb"])
def test_mesh_files_hold_the_colours(kind: str) -> None:
    mesh = coloured(FRAMES).mesh()
    assert mesh.colours is not None
    file = mesh.to_trimesh().export(file_type=kind)
    assert isinstance(file, bytes)
    again: Any = trimesh.load(io.BytesIO(file), file_type=kind, force="mesh", process=False)
    seen = mesh.colours[:, 3] > 0
    assert 0 < seen.sum() < len(seen)
    np.testing.assert_array_equal(
        again.visual.vertex_colors, np.where(seen[:, None], mesh.colours, (128, 128, 128, 255))
    )


def test_meshes_of_maps_without_colour_have_none() -> None:
    grid = make_grid(backend="cpu")
    grid.integrate(*FRAMES[0][:3])
    assert grid.mesh().colours is None
    with pytest.raises(ValueError, match="made without colour"):
        grid.colour([[0.0, 0.0, 1.0]])


def test_small_pieces_go_with_their_colours() -> None:
    grid = coloured(FRAMES)
    whole, large = grid.mesh(), grid.mesh(min_faces=200)
    assert whole.colours is not None and large.colours is not None
    assert 0 < len(large.vertices) < len(whole.vertices)
    of_vertex = dict(zip(map(bytes, whole.vertices), map(bytes, whole.colours), strict=True))
    assert all(of_vertex[bytes(v)] == bytes(c) for v, c in zip(large.vertices, large.colours, strict=True))


MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])
LIDAR = pm.SphericalSensor(64, (0.4, -0.4), 48)
BAD: dict[str, tuple[dict[str, Any], type[Exception], str]] = {
    "another size": ({"colour": GOOD.colour[:, 1:]}, ValueError, r"75 x 100 .*expected the camera's 75 x 101"),
    "no camera": ({"colour_camera": None}, ValueError, r"75 x 101 .*expected the camera's 48 x 64"),
    "floats": ({"colour": GOOD.colour / 255.0}, ValueError, "dtype float64, expected .* uint8"),
    "grey": ({"colour": GOOD.colour[..., 0]}, ValueError, r"shape \[75, 101\], expected a \(H, W, 3\)"),
    "with alpha": ({"colour": np.zeros((75, 101, 4), np.uint8)}, ValueError, r"shape \[75, 101, 4\]"),
    "a list": ({"colour": GOOD.colour.tolist()}, ValueError, "colour is a list, expected"),
    "a file": ({"colour": Path("image.png")}, ValueError, "colour is a PosixPath, expected"),
    "no colour for the camera": (
        {"colour": None, "depth_from_colour": None},
        ValueError,
        "colour_camera is given without",
    ),
    "no colour for the pose": (
        {"colour": None, "colour_camera": None},
        ValueError,
        "depth_from_colour is given without",
    ),
    "a mirror": ({"depth_from_colour": MIRROR}, ValueError, "depth_from_colour .*mirror image"),
    "a scaled pose": ({"depth_from_colour": 2 * np.eye(4)}, ValueError, "depth_from_colour "),
    "a pose of 3 rows": ({"depth_from_colour": np.eye(4)[:3]}, ValueError, r"depth_from_colour .*\[3, 4\]"),
    "nowhere": ({"depth_from_colour": np.full((4, 4), np.nan)}, ValueError, "depth_from_colour .*finite"),
    "no depth": ({"depth": None}, ValueError, "depth is a NoneType"),
    "depth of nothing": ({"depth": np.zeros((48, 64), np.float32)}, ValueError, "without a reading"),
    "a sensor for colour": ({"colour_camera": LIDAR}, TypeError, "colour_camera"),
    "a LiDAR's own camera": ({"camera": LIDAR, "colour_camera": None}, ValueError, "colour_camera is missing"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_told_and_changes_nothing(case: str, tmp_path: Path) -> None:
    changes, error, message = BAD[case]
    grid = coloured(FRAMES[1:2])
    before = map_bytes(grid, tmp_path)
    arguments = {**GOOD._asdict(), **changes}
    for method in (grid.integrate, grid.remove):
        with pytest.raises(error, match=message):
            method(**arguments)
    poses: dict[str, Any] = {"old_pose": GOOD.world_from_camera, "new_pose": IDENTITY}
    with pytest.raises(error, match=message):
        grid.reintegrate(**{key: value for key, value in arguments.items() if key != "world_from_camera"}, **poses)
    assert map_bytes(grid, tmp_path) == before


def test_a_map_made_without_colour_takes_none(tmp_path: Path) -> None:
    grid = make_grid(backend="cpu")
    before = map_bytes(grid, tmp_path)
    with pytest.raises(ValueError, match="made without colour"):
        GOOD.fuse(grid.integrate)
    assert map_bytes(grid, tmp_path) == before


def test_colours_count_against_the_budget(tmp_path: Path) -> None:
    needed, plain = coloured(FRAMES[:2]).nbytes, make_grid(backend="cpu")
    for frame in FRAMES[:2]:
        plain.integrate(*frame[:3])
    assert needed > plain.nbytes
    # Tables are taken to double, with their 16 bytes of padding.
    assert coloured(FRAMES[:2], max_bytes=needed + 32).nbytes == needed
    grid = coloured(FRAMES[:1], max_bytes=plain.nbytes + (needed - plain.nbytes) // 2)
    before = map_bytes(grid, tmp_path)
    with pytest.raises(pm.MapFullError):
        for frame in FRAMES[1:]:
            frame.fuse(grid.integrate)
            before = map_bytes(grid, tmp_path)
    assert map_bytes(grid, tmp_path) == before
    assert grid.max_bytes is not None and grid.nbytes <= grid.max_bytes


def test_any_strides_will_do(tmp_path: Path) -> None:
    expected = map_bytes(coloured([GOOD]), tmp_path)
    for image in (np.asfortranarray(GOOD.colour), GOOD.colour[::-1][::-1], GOOD.colour[..., ::-1].copy()[..., ::-1]):
        image.setflags(write=False)
        assert map_bytes(coloured([GOOD._replace(colour=image)]), tmp_path) == expected


def test_pages_have_the_colours_of_the_mesh() -> None:
    red = np.full((CAMERA.height, CAMERA.width, 3), (230, 10, 20), np.uint8)
    painted, plain = make_grid(backend="cpu", colour=True), make_grid(backend="cpu")
    painted.integrate(*wall(1.3), colour=red)
    plain.integrate(*wall(1.3))
    mesh = painted.mesh()
    assert mesh.colours is not None
    opaque = pictures.opaque(mesh.colours)
    assert opaque.shape == (len(mesh.vertices), 3)
    assert (opaque[mesh.colours[:, 3] > 0] == (230, 10, 20)).all()
    assert (opaque[mesh.colours[:, 3] == 0] == pictures.FRONT).all()
    # The page's surface has no fewer vertices than the mesh, since it is small.
    shown = report.make(painted, mesh, "red", [], (0, -1, 0)).geometry.colours
    np.testing.assert_array_equal(shown, opaque)
    assert report.make(plain, plain.mesh(), "plain", [], (0, -1, 0)).geometry.colours is None
