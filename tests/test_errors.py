"""What is refused: each with an error that names the value, and the map as it was."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
import pytest
from frames import CAMERA, IDENTITY, VOXEL_SIZE, make_grid, map_bytes, map_of, random_frames, wall
from numpy.typing import NDArray

DEPTH = wall(2.0).depth
NAN, INF = math.nan, math.inf

Refuses = Callable[..., None]


@pytest.fixture
def refuses(tmp_path: Path) -> Refuses:
    """Fails unless all that takes a frame refuses this one with an error that matches, and the map stays as it is."""
    grid = map_of(random_frames(2, seed=4))
    before = map_bytes(grid, tmp_path)

    def check(message: str, depth: Any = DEPTH, camera: Any = CAMERA, pose: Any = IDENTITY, **options: Any) -> None:
        for method in (grid.integrate, grid.remove):
            with pytest.raises(ValueError, match=message):
                method(depth, camera, pose, **options)
            assert map_bytes(grid, tmp_path) == before

    return check


@contextmanager
def as_it_was(grid: pm.OccupancyGrid, folder: Path) -> Iterator[None]:
    before = map_bytes(grid, folder)
    yield
    assert map_bytes(grid, folder) == before


def pose_with(row: int, column: int, value: float) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[row, column] = value
    return pose


# ---- depth images ----


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ((48,), r"depth has shape \[48\], expected a \(H, W\) numpy array"),
        ((48, 64, 1), r"depth has shape \[48, 64, 1\]"),
        ((), r"depth has shape \[\]"),
        ((64, 48), r"depth image is 64 x 48 \(height x width\), expected the camera's 48 x 64"),
        ((24, 32), r"depth image is 24 x 32 \(height x width\), expected the camera's 48 x 64"),
        ((1, 3072), "depth image is 1 x 3072"),
        ((0, 64), r"depth image is 0 pixels, expected height x width = 0 x 64 pixels, at least one"),
        ((0, 0), "depth image is 0 pixels"),
    ],
)
def test_shape_of_depth(refuses: Refuses, shape: tuple[int, ...], message: str) -> None:
    refuses(message, depth=np.full(shape, 2.0, np.float32))


@pytest.mark.parametrize("dtype", ["int32", "int16", "uint8", "int64", "bool", "float16", "complex64", "object", "S4"])
def test_type_of_depth(refuses: Refuses, dtype: str) -> None:
    name = {"S4": r"\|S4"}.get(dtype, dtype)
    refuses(f"depth has dtype {name}, expected .* float32 or float64 metres", depth=DEPTH.astype(dtype))


def test_depth_of_another_byte_order(refuses: Refuses) -> None:
    for dtype in ("f4", "f8"):
        swapped = DEPTH.astype(np.dtype(dtype).newbyteorder("S"))
        refuses(rf"depth has dtype [<>]{dtype}, expected", depth=swapped)


@pytest.mark.parametrize(
    ("depth", "name"), [(DEPTH.tolist(), "list"), (None, "NoneType"), (2.0, "float"), ("depth.png", "str")]
)
def test_depth_that_is_no_array(refuses: Refuses, depth: object, name: str) -> None:
    refuses(f"depth is a {name}, expected a", depth=depth)


def test_depth_scale_belongs_to_uint16(refuses: Refuses) -> None:
    raw = np.full((48, 64), 2000, np.uint16)
    refuses("depth is uint16 and depth_scale is missing, expected steps a metre", depth=raw)
    refuses("depth_scale is 1000 but depth is float32, expected no scale for metres", depth_scale=1000.0)
    for scale in (0.0, -1000.0, NAN, INF):
        got = str(scale).replace("nan", "NaN").removesuffix(".0")
        refuses(f"depth_scale is {got}, expected a positive, finite number", depth=raw, depth_scale=scale)


@pytest.mark.parametrize("reading", [0.0, NAN, -1.0, -INF])
def test_a_frame_that_sees_nothing(refuses: Refuses, reading: float) -> None:
    refuses("depth image is 3072 pixels without a reading", depth=np.full((48, 64), reading, np.float32))


class Subclass(np.ndarray[Any, Any]):
    pass


def layouts(array: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """The same numbers, laid out in memory in every way that numpy knows."""
    height, width = array.shape
    padded = np.zeros((2 * height, 3 * width), array.dtype)
    padded[::2, ::3] = array
    record = np.zeros(array.shape, np.dtype([("pad", "u1"), ("values", array.dtype)]))
    record["values"] = array
    frozen = array.copy()
    frozen.flags.writeable = False
    return {
        "contiguous": array.copy(),
        "fortran": np.asfortranarray(array),
        "strided": padded[::2, ::3],
        "backwards": array[::-1, ::-1].copy()[::-1, ::-1],
        "in a record": record["values"],
        "unaligned": np.frombuffer(b"\0" + array.tobytes(), array.dtype, offset=1).reshape(array.shape),
        "read-only": frozen,
        "subclass": array.view(Subclass),
    }


@pytest.mark.parametrize("dtype", ["float32", "float64", "uint16"])
def test_every_layout_of_depth_gives_the_same(dtype: str, tmp_path: Path) -> None:
    depth, camera, pose = random_frames(1, seed=5)[0]
    options: dict[str, Any] = {"depth_scale": 1000.0} if dtype == "uint16" else {}
    depth = (np.nan_to_num(depth, posinf=0).clip(0, 60) * 1000 if options else depth).astype(dtype)
    files = {}
    for name, array in layouts(depth).items():
        grid = make_grid()
        grid.integrate(array, camera, pose, **options)
        files[name] = map_bytes(grid, tmp_path)
        np.testing.assert_array_equal(array, depth)
    assert not layouts(depth)["unaligned"].flags.aligned
    assert [name for name, file in files.items() if file != files["contiguous"]] == []


def test_every_layout_of_a_pose_gives_the_same(tmp_path: Path) -> None:
    depth, camera, pose = random_frames(1, seed=6)[0]
    swapped = pose.astype(pose.dtype.newbyteorder("S"))
    files = set()
    for world_from_camera in [*layouts(pose).values(), swapped, pose.tolist()]:
        grid = make_grid()
        grid.integrate(depth, camera, world_from_camera)
        files.add(map_bytes(grid, tmp_path))
    assert len(files) == 1


# ---- poses ----


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (np.eye(4)[:3], r"world_from_camera has shape \[3, 4\], expected \(4, 4\)"),
        (np.eye(3), r"world_from_camera has shape \[3, 3\]"),
        (np.zeros(16), r"world_from_camera has shape \[16\]"),
        (np.eye(4)[None], r"world_from_camera has shape \[1, 4, 4\]"),
        (None, "world_from_camera"),
        ("identity", "world_from_camera is a str that is no array of numbers"),
        ([[1, 2], [3]], "world_from_camera is a list that is no array of numbers"),
        (pose_with(0, 3, NAN), r"world_from_camera: \[0, 3\] is NaN, expected a finite number"),
        (pose_with(2, 1, INF), r"\[2, 1\] is inf, expected a finite number"),
        (pose_with(1, 3, -INF), r"\[1, 3\] is -inf, expected a finite number"),
        (pose_with(3, 2, 0.5), r"\[3, 2\] is 0\.5, expected a last row of 0 0 0 1"),
        (pose_with(3, 3, 2.0), r"\[3, 3\] is 2, expected a last row of 0 0 0 1"),
        (np.eye(4).T + pose_with(3, 0, 1.0) - np.eye(4), r"\[3, 0\] is 1, expected a last row"),
        (pose_with(1, 1, 1.1), r"column 1 \. column 1 of the rotation is 1\.21.*, expected 1 within 0\.002"),
        (pose_with(0, 1, 0.01), r"column 0 \. column 1 of the rotation is 0\.01, expected 0 within 0\.002"),
        (np.diag([0.0, 0.0, 0.0, 1.0]), r"column 0 \. column 0 of the rotation is 0, expected 1"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "determinant of the rotation is -1, expected 1 .*mirror"),
        (np.diag([1000.0, 1000.0, 1000.0, 1.0]), r"column 0 \. column 0 of the rotation is 1000000"),
    ],
)
def test_poses_that_are_none(refuses: Refuses, pose: object, message: str) -> None:
    refuses(message, pose=pose)


def test_nearly_rigid_poses_are_taken() -> None:
    depth, camera, pose = random_frames(1, seed=7)[0]
    nearly = pose.copy()
    nearly[:3, :3] *= 1 + 4e-4  # R^T R is then off by 8e-4
    exact, grid = make_grid(), make_grid()
    exact.integrate(depth, camera, pose)
    grid.integrate(depth, camera, nearly)
    # The nearest rotation is the one that was scaled: the same map, but for voxels on a border by 1e-16 of rounding.
    coords = exact.block_coords()
    off = np.abs(grid.block_log_odds(coords) - exact.block_log_odds(coords)) > 1e-3
    assert off.sum() <= 2


def test_a_camera_beyond_all_coordinates(refuses: Refuses) -> None:
    limit = VOXEL_SIZE * 8 * (2**27 - 2) - 3.0
    for axis, sign in ((0, 1), (1, -1), (2, 1)):
        place = sign * limit * 1.001
        refuses(rf"camera lies at {place:.0f}[\d.]* m, expected within 53687", pose=pose_with(axis, 3, place))
        refuses("camera lies at -?10* m, expected within 53687", pose=pose_with(axis, 3, sign * 1e300))


def test_a_camera_at_the_end_of_all_coordinates() -> None:
    limit = VOXEL_SIZE * 8 * (2**27 - 2) - 3.0
    for axis, sign in ((0, 1), (1, -1), (2, 1)):
        grid = make_grid()
        grid.integrate(DEPTH, CAMERA, pose_with(axis, 3, sign * limit))
        coords = grid.block_coords()
        assert np.abs(coords[:, axis].astype(np.int64)).max() <= 2**27
        assert np.sign(coords[:, axis]).tolist() == [sign] * len(coords)
        grid.remove(DEPTH, CAMERA, pose_with(axis, 3, sign * limit))
        assert grid.num_blocks == 0


def test_a_camera_of_another_type(tmp_path: Path) -> None:
    grid = map_of([wall(1.0)])
    with as_it_was(grid, tmp_path), pytest.raises(TypeError, match="camera"):
        grid.integrate(DEPTH, (64, 48), IDENTITY)  # type: ignore[arg-type]


# ---- parameters ----


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"voxel_size": 0.0}, "voxel_size is 0, expected a positive number of metres"),
        ({"voxel_size": -0.05}, r"voxel_size is -0\.05, expected a positive"),
        ({"voxel_size": NAN}, "voxel_size is NaN, expected a positive"),
        ({"voxel_size": INF}, "voxel_size is inf, expected a positive"),
        ({"voxel_size": 1e-7}, r"voxel_size is 0\.0000001, expected between 0\.0007\d* and 3 m for a max_range of 3 m"),
        ({"voxel_size": 5e-324}, "voxel_size is 0.0*5, expected"),
        ({"voxel_size": 3.1}, r"voxel_size is 3\.1, expected between .* and 3 m"),
        ({"max_range": 0.0}, "max_range is 0, expected a positive number of metres"),
        ({"max_range": -1.0}, "max_range is -1, expected"),
        ({"max_range": NAN}, "max_range is NaN, expected"),
        ({"max_range": INF}, "max_range is inf, expected"),
        ({"prior": 0.0}, "prior is 0, expected a probability between 0 and 1"),
        ({"prior": 1.0}, "prior is 1, expected"),
        ({"prior": -0.5}, r"prior is -0\.5, expected"),
        ({"prior": NAN}, "prior is NaN, expected"),
        ({"clamp": (1.0, -1.0)}, r"clamp is \(1, -1\), expected two finite log-odds"),
        ({"clamp": (0.0, 1.0)}, r"clamp is \(0, 1\), expected"),
        ({"clamp": (-1.0, 0.0)}, r"clamp is \(-1, 0\), expected"),
        ({"clamp": (-1e-5, 1.0)}, r"clamp is \(-0\.00001, 1\), expected two finite log-odds, one at least"),
        ({"clamp": (-1.0, INF)}, r"clamp is \(-1, inf\), expected"),
        ({"clamp": (NAN, 1.0)}, r"clamp is \(NaN, 1\), expected"),
        ({"clamp": (-1.0, 1.0), "prior": 0.9}, r"clamp is \(-1, 1\), expected .* prior, 2\.197"),
        ({"max_bytes": -1}, "max_bytes is -1, expected 0 or more"),
        ({"update": "fast"}, 'update is "fast", expected "pyramid" or "area" or "min_layer" or "ideal"'),
        ({"update": ""}, 'update is "", expected'),
        ({"backend": "cuda"}, 'backend is "cuda", expected "auto" or "cpu" or "gpu"'),
        ({"beyond_max_range": "occupied"}, 'beyond_max_range is "occupied", expected "free" or "ignore"'),
    ],
)
def test_parameters_of_a_map(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_grid(**options)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0,), "sigma is 0, expected finite metres, .* positive at every range"),
        ((-0.1,), r"sigma is -0\.1, expected"),
        ((NAN,), "sigma is NaN, expected"),
        ((INF,), "sigma is inf, expected"),
        (((0.1, -0.1, 0.0),), r"sigma is \[0\.1, -0\.1, 0\.0\], expected"),
        (((0.1, 0.0, -0.001),), r"sigma is \[0\.1, 0\.0, -0\.001\], expected"),
        (((0.1, NAN, 0.0),), r"sigma is \[0\.1, NaN, 0\.0\], expected"),
        ((0.1, 0.0), "k is 0, expected more than 0 and less than"),
        ((0.1, -0.1), r"k is -0\.1, expected more than 0"),
        ((0.1, 0.126), r"k is 0\.126, expected more than 0 and less than sigma sqrt\(2 pi\) / 2 = 0\.12533"),
        ((0.1, NAN), "k is NaN, expected"),
        ((0.1, INF), "k is inf, expected"),
        ((0.1, None, NAN), "surface_offset is NaN, expected finite metres"),
        ((0.1, None, INF), "surface_offset is inf, expected finite metres"),
        ((0.1, None, "centered"), 'surface_offset is "centered", expected metres or "centred"'),
    ],
)
def test_sensor_models_that_give_no_probabilities(arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        pm.SensorModel(*arguments)


@pytest.mark.parametrize(
    ("parameter", "value", "message"),
    [
        ("width", 0, "camera width is 0, expected 1 to 16384 pixels"),
        ("height", 16385, "camera height is 16385, expected 1 to 16384 pixels"),
        ("width", -640, "camera width is -640, expected"),
        ("fx", 0.0, "camera fx is 0, expected a positive, finite number of pixels"),
        ("fy", -585.0, "camera fy is -585, expected"),
        ("fx", NAN, "camera fx is NaN, expected"),
        ("fy", INF, "camera fy is inf, expected"),
        ("cx", NAN, "camera cx is NaN, expected a finite number of pixels"),
        ("cy", INF, "camera cy is inf, expected"),
    ],
)
def test_parameters_of_a_camera(parameter: str, value: Any, message: str) -> None:
    parameters: dict[str, Any] = {"width": 64, "height": 48, "fx": 58.0, "fy": 58.0, "cx": 32.0, "cy": 24.0}
    with pytest.raises(ValueError, match=message):
        pm.PinholeCamera(**{**parameters, parameter: value})


@pytest.mark.parametrize("value", [1e-300, 1e-6, 1e6, 1e300])
@pytest.mark.parametrize("parameter", ["fx", "fy", "cx", "cy"])
def test_absurd_cameras_do_no_harm(parameter: str, value: float) -> None:
    parameters: dict[str, Any] = {"width": 64, "height": 48, "fx": 58.0, "fy": 58.0, "cx": 32.0, "cy": 24.0}
    camera = pm.PinholeCamera(**{**parameters, parameter: value})
    for rule in ("pyramid", "area", "min_layer"):
        grid = make_grid(update=rule, voxel_size=0.2)
        try:
            grid.integrate(DEPTH, camera, IDENTITY)
        except ValueError as error:
            assert "without a reading" in str(error)
        values = grid.block_log_odds(grid.block_coords())
        assert np.isfinite(values).all()


@pytest.mark.parametrize("threads", [0, -1, 2**40])
def test_number_of_threads(threads: int) -> None:
    before = pm.num_threads()
    with pytest.raises(ValueError, match=f"number of threads is {threads}, expected 1 to"):
        pm.set_num_threads(threads)
    assert pm.num_threads() == before


# ---- questions ----


@pytest.mark.parametrize("points", [np.zeros(3), np.zeros((3, 4)), np.zeros((2, 2, 3)), np.zeros((0, 2)), 1.0, []])
def test_shape_of_points(points: Any) -> None:
    grid = map_of([wall(1.0)])
    shape = str(list(np.shape(points))).replace("[", r"\[").replace("]", r"\]")
    for query in (grid.log_odds, grid.probability, grid.state):
        with pytest.raises(ValueError, match=rf"points have shape {shape}, expected \(N, 3\)"):
            query(points)


def test_points_that_are_no_numbers() -> None:
    with pytest.raises(ValueError, match=r"points is a list that is no array of numbers: .*could not convert string"):
        make_grid().log_odds([["a", "b", "c"]])


@pytest.mark.parametrize(
    ("coords", "message"),
    [
        (np.zeros((2, 3)), r"coords have dtype float64 and shape \[2, 3\], expected an \(N, 3\) array of integers"),
        (np.zeros(3, int), r"coords have dtype int64 and shape \[3\], expected"),
        (np.zeros((3, 2), int), r"shape \[3, 2\], expected"),
        (np.zeros((1, 3), bool), "coords have dtype bool"),
        (np.full((1, 3), 2**64 - 1, np.uint64), "coords have dtype uint64"),
        ([[0, 0, 2**31]], "coords hold 2147483648, expected numbers of 32 bits"),
        ([[0, -(2**31) - 1, 0]], "coords hold -2147483649, expected numbers of 32 bits"),
    ],
)
def test_coordinates_of_blocks(coords: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_grid().block_log_odds(coords)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"level": NAN}, "level is NaN, expected a log-odd within"),
        ({"level": INF}, "level is inf, expected"),
        ({"level": -1e6}, "level is -1000000, expected"),
        ({"min_evidence": -0.1}, r"min_evidence is -0\.1, expected a log-odd from 0"),
        ({"min_evidence": NAN}, "min_evidence is NaN, expected"),
        ({"min_faces": -1}, "min_faces is -1, expected 0 or more"),
    ],
)
def test_options_of_a_mesh(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        map_of([wall(1.0)]).mesh(**options)


def test_stages_on_their_own_refuse_the_same() -> None:
    stages: list[Callable[..., Any]] = [pm.ranges, lambda depth, camera: pm.pyramid(depth, camera, 0.05)]
    for stage in stages:
        with pytest.raises(ValueError, match=r"depth image is 64 x 48 .*, expected the camera's 48 x 64"):
            stage(DEPTH.T, CAMERA)
        with pytest.raises(ValueError, match="depth has dtype int32"):
            stage(DEPTH.astype(np.int32), CAMERA)
        with pytest.raises(ValueError, match="3072 pixels without a reading"):
            stage(np.zeros_like(DEPTH), CAMERA)
    for voxel_size in (0.0, -0.05, NAN, INF):
        with pytest.raises(ValueError, match=r"voxel_size is .*, expected a positive number of metres"):
            pm.pyramid(DEPTH, CAMERA, voxel_size)
