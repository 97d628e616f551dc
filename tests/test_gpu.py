"""Maps on a GPU: the same as on the CPU, and every fault told. In CI the GPU is a software one."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
import pytest
from compare import Blocks, blocks_of_lists
from frames import CAMERA, IDENTITY, VOXEL_SIZE, Frame, make_grid, map_bytes, random_frames, wall
from numpy.typing import NDArray
from real_data import real
from shell import json_of, run

RULES = ("pyramid", "area", "min_layer")
RESOLUTIONS = (0.02, 0.04, 0.08, 0.16)

# CPU and GPU run the same steps in 32-bit arithmetic. A GPU may contract a product and a sum, and divide within 2.5
# units in the last place: distances of some metres differ by 1e-6 m then, which the steepest sensor model used here,
# sigma = 0.02 m, turns into 1e-4. Where rounding decides which pixel is read, or whether a voxel lies in the image at
# all, the whole reading differs: rounding error over pixel size, 1e-5 to 1e-4 of the voxels along borders and edges.
TOLERANCE = 1e-3
SHARE_WITHIN = 0.9999


@pytest.fixture(scope="module")
def adapter() -> str:
    """The name of the adapter to test on: a real GPU if there is one."""
    usable = [device for device in pm.devices() if device.problem is None]
    if not usable:
        reason = "no graphics adapter: install a Vulkan driver, such as Debian's mesa-vulkan-drivers"
        if os.environ.get("PYRAMAP_REQUIRE_GPU"):
            pytest.fail(reason)
        pytest.skip(reason)
    return min(usable, key=lambda device: device.kind == "software").name


@pytest.fixture
def on_gpu(adapter: str) -> Callable[..., pm.OccupancyGrid]:
    """Makes empty maps on the GPU."""
    return lambda **options: make_grid(backend="gpu", adapter=adapter, **options)


def blocks(grid: pm.OccupancyGrid) -> Blocks:
    coords = grid.block_coords()
    return blocks_of_lists(coords, grid.block_log_odds(coords))


def assert_agree(gpu: pm.OccupancyGrid, cpu: pm.OccupancyGrid, frames: int) -> None:
    """Both ways: the same blocks, and of the voxels that either knows nearly all within the tolerance a frame."""
    assert_blocks_agree(blocks(gpu), blocks(cpu), frames)


def assert_blocks_agree(got: Blocks, expected: Blocks, frames: int) -> None:
    assert got.keys() - expected.keys() == set(), "blocks that only the GPU's map has"
    assert expected.keys() - got.keys() == set(), "blocks that the GPU's map lacks"
    assert expected, "both maps are empty: nothing was compared"
    keys = sorted(expected)
    a, b = (np.stack([side[key] for key in keys]) for side in (got, expected))
    known, difference = (a != 0) | (b != 0), np.abs(a - b)
    outside = difference > TOLERANCE * frames
    share = 1 - np.count_nonzero(outside) / np.count_nonzero(known)
    worst = np.unravel_index(np.argmax(difference), difference.shape)
    report = (
        f"{np.count_nonzero(known)} voxels, {np.count_nonzero(difference > 0)} differ, {np.count_nonzero(outside)} by "
        f"more than {TOLERANCE:g} a frame; worst in block {keys[worst[0]]}: {a[worst]:.6f} for {b[worst]:.6f}"
    )
    assert share >= SHARE_WITHIN, report


@pytest.mark.parametrize("alter", ["a voxel", "a missing block", "another block"])
def test_the_comparison_notices(alter: str) -> None:
    rng = np.random.default_rng(3)
    expected: Blocks = {(x, 0, -2): rng.uniform(0.1, 3.0, (8, 8, 8)) for x in range(3)}
    got = {key: values.copy() for key, values in expected.items()}
    assert_blocks_agree(got, expected, 1)
    if alter == "a voxel":
        got[1, 0, -2][3, 4, 5] += 2 * TOLERANCE  # one in 1536 is more than one in 10,000
    elif alter == "a missing block":
        del got[2, 0, -2]
    else:
        got[9, 9, 9] = expected[0, 0, -2]
    with pytest.raises(AssertionError):
        assert_blocks_agree(got, expected, 1)


@pytest.mark.parametrize("update", RULES)
@pytest.mark.parametrize("voxel_size", [0.03, 0.08])
def test_parity_on_simulated_frames(on_gpu: Callable[..., pm.OccupancyGrid], update: str, voxel_size: float) -> None:
    """After one frame, after more on top of it, and when all but one are taken back."""
    options = {"update": update, "voxel_size": voxel_size}
    gpu, cpu = on_gpu(**options), make_grid(backend="cpu", **options)
    scene = pm.scenes.office_loop()
    frames = list(islice(scene.frames(noise=5), 0, 40, 8))
    for count, frame in enumerate(frames, start=1):
        arguments = (frame.depth, frame.camera, frame.world_from_camera)
        got, expected = gpu.integrate(*arguments), cpu.integrate(*arguments)
        assert got.voxels_updated == pytest.approx(expected.voxels_updated, rel=1e-4)
        assert_agree(gpu, cpu, count)
    for frame in frames[1:]:
        gpu.remove(frame.depth, frame.camera, frame.world_from_camera)
        cpu.remove(frame.depth, frame.camera, frame.world_from_camera)
    assert_agree(gpu, cpu, 1)
    gpu.remove(frames[0].depth, frames[0].camera, frames[0].world_from_camera)
    assert (gpu.num_blocks, gpu.num_frames) == (0, 0)


@pytest.mark.parametrize("update", RULES)
@pytest.mark.parametrize(
    "options",
    [
        {"sensor_model": pm.SensorModel((0.03, 0.001, 0.004), surface_offset="centred")},
        {"sensor_model": pm.SensorModel(0.1, k=0.05, surface_offset=-0.03)},
        {"clamp": (-2.0, 3.5)},
        {"beyond_max_range": "ignore", "max_range": 1.5},
        {"prior": 0.4},
    ],
    ids=["growing sigma", "offset", "clamp", "ignore", "prior"],
)
def test_parity_with_every_parameter(
    on_gpu: Callable[..., pm.OccupancyGrid], update: str, options: dict[str, Any]
) -> None:
    gpu, cpu = on_gpu(update=update, **options), make_grid(backend="cpu", update=update, **options)
    frames = random_frames(6, seed=11)
    for frame in frames:
        gpu.integrate(*frame)
        cpu.integrate(*frame)
    assert_agree(gpu, cpu, len(frames))


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.uint16])
def test_parity_for_every_number_type(on_gpu: Callable[..., pm.OccupancyGrid], dtype: type[np.generic]) -> None:
    gpu, cpu = on_gpu(), make_grid(backend="cpu")
    for depth, camera, pose in random_frames(3, seed=7):
        scale = 5000.0 if dtype == np.uint16 else None
        metres = np.nan_to_num(depth, nan=0.0, posinf=0.0).clip(0) if scale else depth
        image = (metres * (scale or 1.0)).astype(dtype)
        gpu.integrate(image, camera, pose, depth_scale=scale)
        cpu.integrate(image, camera, pose, depth_scale=scale)
    assert_agree(gpu, cpu, 3)


def kitchen(step: int) -> Iterator[tuple[NDArray[Any], pm.PinholeCamera, NDArray[np.float64]]]:
    for frame in pm.datasets.open(real("redkitchen"), stride=step):
        yield frame.depth, frame.camera, frame.world_from_camera


@pytest.mark.parametrize("voxel_size", RESOLUTIONS)
def test_parity_on_real_frames(adapter: str, voxel_size: float) -> None:
    """After one frame and after a hundred of the red kitchen."""
    gpu = pm.OccupancyGrid(voxel_size, backend="gpu", adapter=adapter)
    cpu = pm.OccupancyGrid(voxel_size, backend="cpu")
    for count, frame in enumerate(islice(kitchen(6), 100), start=1):
        gpu.integrate(*frame)
        cpu.integrate(*frame)
        if count in (1, 100):
            assert_agree(gpu, cpu, count)


@pytest.mark.parametrize("update", ["area", "min_layer"])
def test_parity_of_the_other_rules_on_real_frames(adapter: str, update: Any) -> None:
    gpu = pm.OccupancyGrid(0.04, update=update, backend="gpu", adapter=adapter)
    cpu = pm.OccupancyGrid(0.04, update=update, backend="cpu")
    for count, frame in enumerate(islice(kitchen(34), 20), start=1):
        gpu.integrate(*frame)
        cpu.integrate(*frame)
        if count in (1, 20):
            assert_agree(gpu, cpu, count)


def test_the_whole_kitchen(adapter: str) -> None:
    """All 684 frames at 4 cm: mesh and counts as on the CPU, within the tolerance."""
    gpu, cpu = pm.OccupancyGrid(0.04, backend="gpu", adapter=adapter), pm.OccupancyGrid(0.04, backend="cpu")
    for frame in kitchen(1):
        gpu.integrate(*frame)
        cpu.integrate(*frame)
    assert gpu.num_frames == cpu.num_frames == 684
    assert_agree(gpu, cpu, 684)
    assert gpu.num_observed == pytest.approx(cpu.num_observed, rel=1 - SHARE_WITHIN)
    states = [np.unique(np.sign(grid.block_log_odds(grid.block_coords())), return_counts=True) for grid in (gpu, cpu)]
    assert np.array_equal(states[0][0], states[1][0])
    np.testing.assert_allclose(states[0][1], states[1][1], rtol=1 - SHARE_WITHIN)
    meshes = [grid.mesh(min_evidence=1.0) for grid in (gpu, cpu)]
    # A voxel that differs by a unit may go from one side of the level to the other, and take a few faces along.
    assert len(meshes[0].faces) == pytest.approx(len(meshes[1].faces), rel=1e-3)


def test_what_reads_a_map_reads_a_gpus(on_gpu: Callable[..., pm.OccupancyGrid], tmp_path: Path) -> None:
    """Queries, mesh, files and merge give what a CPU map of the very same evidence gives."""
    gpu = on_gpu()
    for frame in random_frames(4, seed=2):
        gpu.integrate(*frame)
    path = tmp_path / "map.pmap"
    gpu.save(path)
    cpu = pm.OccupancyGrid.load(path, backend="cpu")
    assert (gpu.backend, cpu.backend) == ("gpu", "cpu") and gpu.adapter and cpu.adapter is None
    points = np.random.default_rng(4).uniform(-3, 3, (2000, 3))
    for question in ("log_odds", "probability", "state"):
        assert np.array_equal(getattr(gpu, question)(points), getattr(cpu, question)(points))
    assert np.array_equal(gpu.block_coords(), cpu.block_coords())
    assert np.array_equal(gpu.mesh().vertices, cpu.mesh().vertices)
    assert (gpu.num_blocks, gpu.num_observed, gpu.num_frames) == (cpu.num_blocks, cpu.num_observed, cpu.num_frames)
    assert gpu.bounds is not None and cpu.bounds is not None and np.array_equal(gpu.bounds, cpu.bounds)

    again = pm.OccupancyGrid.load(path, backend="gpu", adapter=gpu.adapter)
    assert map_bytes(again, tmp_path) == path.read_bytes()
    other = make_grid(backend="cpu")
    for frame in random_frames(3, seed=9):
        other.integrate(*frame)
    again.merge(other)
    cpu.merge(other)
    assert map_bytes(again, tmp_path) == map_bytes(cpu, tmp_path)
    other.merge(gpu)
    assert map_bytes(other, tmp_path) == map_bytes(cpu, tmp_path)


def test_reading_between_frames_changes_nothing(on_gpu: Callable[..., pm.OccupancyGrid], tmp_path: Path) -> None:
    frames = random_frames(8, seed=21)
    straight, read = on_gpu(), on_gpu()
    for frame in frames:
        straight.integrate(*frame)
        read.integrate(*frame)
        assert read.num_observed > 0
    assert map_bytes(straight, tmp_path) == map_bytes(read, tmp_path)


def test_frames_commute(on_gpu: Callable[..., pm.OccupancyGrid], tmp_path: Path) -> None:
    """Fixed-point sums: the order of frames, like that of the GPU's work, leaves no trace."""
    frames = random_frames(6, seed=31)
    maps = []
    for order in (frames, frames[::-1]):
        grid = on_gpu()
        for frame in order:
            grid.integrate(*frame)
        maps.append(map_bytes(grid, tmp_path))
    assert maps[0] == maps[1]


def test_numbers_of_a_frame_wait_for_it(on_gpu: Callable[..., pm.OccupancyGrid]) -> None:
    grid = on_gpu()
    first, second = (grid.integrate(*frame) for frame in random_frames(2, seed=41))
    assert first.voxels_updated > 0 and second.voxels_updated > 0
    assert grid.num_frames == 2
    assert set(second.seconds) == {"upload", "ranges", "pyramid", "cull", "update", "readback", "colour", "commit"}
    assert all(seconds >= 0 for seconds in second.seconds.values()) and second.seconds["update"] > 0


def test_a_full_map_says_so_and_stays_as_it_was(on_gpu: Callable[..., pm.OccupancyGrid], tmp_path: Path) -> None:
    """The error of a frame that the GPU was still at work on comes up in the next call."""
    near, far = wall(0.3), wall(2.9)
    # Room for the few blocks around the camera, not for those on the way to the far wall.
    grid = on_gpu(max_bytes=64_000)
    assert grid.integrate(*near).voxels_updated > 0
    before = map_bytes(grid, tmp_path)
    refused = grid.integrate(*far)
    with pytest.raises(pm.MapFullError, match="max_bytes is 64000"):
        grid.synchronize()
    with pytest.raises(RuntimeError, match="not fused"):
        repr(refused)
    grid.synchronize()
    assert map_bytes(grid, tmp_path) == before

    grid.integrate(*far)
    with pytest.raises(pm.MapFullError):
        grid.integrate(*near)
    assert map_bytes(grid, tmp_path) == before and grid.num_frames == 1
    assert grid.integrate(*near).voxels_updated > 0
    assert map_bytes(grid, tmp_path) != before and grid.nbytes <= 64_000


def test_bad_frames_change_nothing(on_gpu: Callable[..., pm.OccupancyGrid], tmp_path: Path) -> None:
    grid = on_gpu()
    good = random_frames(1, seed=51)[0]
    grid.integrate(*good)
    before = map_bytes(grid, tmp_path)
    bad_pose = IDENTITY.copy()
    bad_pose[0, 3] = np.nan
    for frame, message in [
        (Frame(good.depth[:-1], CAMERA, IDENTITY), "height x width"),
        (Frame(np.zeros_like(good.depth), CAMERA, IDENTITY), "without a reading"),
        (Frame(good.depth, CAMERA, bad_pose), "world_from_camera"),
    ]:
        with pytest.raises(ValueError, match=message):
            grid.integrate(*frame)
    assert map_bytes(grid, tmp_path) == before


def test_memory_stays_flat(on_gpu: Callable[..., pm.OccupancyGrid]) -> None:
    """Ten thousand frames into a map that no longer grows. A software GPU's memory is this process's own."""
    statm = Path("/proc/self/statm")
    if not statm.exists():
        pytest.skip("this system does not tell how much memory a process has (/proc/self/statm)")
    camera = pm.PinholeCamera(width=16, height=12, fx=14.0, fy=14.0, cx=7.5, cy=5.5)
    depths = [np.full((12, 16), distance, np.float32) for distance in (1.0, 1.1, 1.2, 1.3)]
    grid = on_gpu(voxel_size=0.1)

    def fuse(frames: int) -> tuple[int, int]:
        for n in range(frames):
            grid.integrate(depths[n % len(depths)], camera, IDENTITY)
        grid.synchronize()
        return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE"), grid.nbytes

    memory, nbytes = fuse(2000)
    later_memory, later_nbytes = fuse(8000)
    assert later_nbytes == nbytes
    # A leak of one small object a frame, 100 bytes, were 0.8 MB; allocators keep a few MB more or less.
    assert later_memory - memory < 8e6


def test_the_shell_lists_devices() -> None:
    listed = json_of(run("info", "--devices", "--json"))["devices"]
    assert [device["name"] for device in listed] == [device.name for device in pm.devices()]
    said = run("info", "--devices").stdout
    assert all(device["name"] in said for device in listed) or "no graphics adapters" in said
    assert "name a map, or ask for --devices" in run("info", code=2).stderr


def test_the_shell_maps_on_a_gpu(adapter: str, tmp_path: Path) -> None:
    """The whole way, and an adapter that is not there."""
    options = ["--limit", "2", "--json", "-o", tmp_path]
    report = json_of(run("demo", "--backend", "gpu", "--adapter", adapter, *options))
    assert (report["map"]["backend"], report["map"]["adapter"], report["map"]["frames"]) == ("gpu", adapter, 2)
    assert report["run"]["median_ms"]["update"] > 0
    assert "no such card" in run("demo", "--backend", "gpu", "--adapter", "no such card", *options, code=1).stderr


def test_a_missing_adapter_is_named_with_what_was_found() -> None:
    with pytest.raises(pm.DeviceNotFoundError, match='"no such card"') as raised:
        make_grid(backend="gpu", adapter="no such card")
    for device in pm.devices():
        assert device.name in str(raised.value)
    with pytest.raises(pm.DeviceNotFoundError):
        make_grid(backend="auto", adapter="no such card")
    with pytest.raises(ValueError, match='adapter is "x", expected none for backend "cpu"'):
        make_grid(backend="cpu", adapter="x")


def test_auto_takes_no_software_adapter() -> None:
    real = [device for device in pm.devices() if device.kind != "software" and device.problem is None]
    assert make_grid(backend="auto").backend == ("gpu" if real else "cpu")


def test_without_a_driver() -> None:
    """No driver at all: auto is the CPU, gpu an error that says what to install."""
    program = """
import pyramap as pm
assert pm.devices() == []
assert pm.OccupancyGrid(0.1).backend == "cpu"
try:
    pm.OccupancyGrid(0.1, backend="gpu")
except pm.DeviceNotFoundError as error:
    print(error)
"""
    nothing = {**os.environ, "VK_DRIVER_FILES": "/nonexistent", "VK_ICD_FILENAMES": "/nonexistent"}
    if sys.platform != "linux":
        pytest.skip("drivers are hidden through the Vulkan loader of Linux")
    done = subprocess.run([sys.executable, "-c", program], env=nothing, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "no GPU was found" in done.stdout and "mesa-vulkan-drivers" in done.stdout


@pytest.mark.parametrize("update", ["ideal", "rays"])
def test_some_rules_stay_on_the_cpu(on_gpu: Callable[..., pm.OccupancyGrid], update: str) -> None:
    with pytest.raises(ValueError, match=f'update="{update}" on a GPU is not possible'):
        on_gpu(update=update)
    assert make_grid(update=update, backend="auto").backend == "cpu"


def _use_in_child(grid: pm.OccupancyGrid, answers: Any) -> None:
    try:
        grid.integrate(*wall(1.0))
        answers.put("no error")
    except pm.DeviceForkedError as error:
        answers.put(str(error))
    # What needs no device goes on.
    cpu = pm.OccupancyGrid(VOXEL_SIZE, backend="auto")
    cpu.integrate(*wall(1.0))
    answers.put(cpu.backend)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_child_is_told(on_gpu: Callable[..., pm.OccupancyGrid]) -> None:
    grid = on_gpu()
    assert grid.integrate(*wall(1.0)).voxels_updated > 0
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    child = context.Process(target=_use_in_child, args=(grid, answers))
    child.start()
    assert "forked" in answers.get(timeout=60)
    assert answers.get(timeout=60) == "cpu"
    child.join(timeout=60)
    assert child.exitcode == 0
    grid.integrate(*wall(1.2))
    assert grid.num_frames == 2


@pytest.mark.parametrize("update", RULES)
def test_frames_of_several_sensors(on_gpu: Callable[..., pm.OccupancyGrid], update: str) -> None:
    """In turns into one map, some with a sensor model of their own; each can be taken off again."""
    rng = np.random.default_rng(8)
    offsets = [0.03 * (-1) ** row for row in range(32)]
    sensors: list[Any] = [
        CAMERA,
        pm.SphericalSensor(512, (0.5, -0.5), height=32, row_offsets=offsets),
        pm.OrthographicCamera(90, 70, 31.0, 27.0, 40.3, 33.8),
        pm.SphericalSensor(100, np.linspace(-0.3, 0.4, 20), first_azimuth=-3.5, azimuth_span=1.4),
    ]
    gpu, cpu = on_gpu(update=update), make_grid(backend="cpu", update=update)
    frames: list[tuple[dict[str, Any], Any]] = []
    for n in range(8):
        sensor = sensors[n % 4]
        columns = 1 + np.arange(sensor.width) // 20 % 4
        ranges = columns * 0.5 + 0.01 * rng.standard_normal((sensor.height, sensor.width))
        model = pm.SensorModel(0.08) if n > 4 else None
        frames.append(({"ranges": ranges.astype(np.float32), "sensor_model": model}, sensor))
    for arguments, sensor in frames:
        for grid in (gpu, cpu):
            grid.integrate(camera=sensor, world_from_camera=IDENTITY, **arguments)
    assert_agree(gpu, cpu, len(frames))
    for arguments, sensor in frames:
        gpu.remove(camera=sensor, world_from_camera=IDENTITY, **arguments)
    assert (gpu.num_blocks, gpu.num_frames) == (0, 0)


def test_colours_are_those_of_the_cpu(on_gpu: Callable[..., pm.OccupancyGrid], tmp_path: Path) -> None:
    """In every bit, whatever the device: they are worked out beside it. Frames overlap, and are taken off."""
    frames = random_frames(4, seed=60)
    images = [
        np.random.default_rng(n).integers(0, 256, (*frame.depth.shape, 3), dtype=np.uint8)
        for n, frame in enumerate(frames)
    ]
    place = np.eye(4)
    place[0, 3] = 0.03
    gpu, cpu = on_gpu(colour=True), make_grid(backend="cpu", colour=True)
    empty = map_bytes(on_gpu(colour=True), tmp_path)
    for grid in (gpu, cpu):
        for frame, image in zip(frames, images, strict=True):
            grid.integrate(*frame, colour=image, depth_from_colour=place)
    points = np.random.default_rng(61).uniform(-2.5, 2.5, (200_000, 3))
    colours = cpu.colour(points)
    assert np.count_nonzero(colours[:, 3]) > 1000
    np.testing.assert_array_equal(gpu.colour(points), colours)
    gpu.save(tmp_path / "gpu.pmap")
    np.testing.assert_array_equal(pm.OccupancyGrid.load(tmp_path / "gpu.pmap", backend="cpu").colour(points), colours)
    mesh = gpu.mesh()
    assert mesh.colours is not None and mesh.colours[:, 3].any()
    for frame, image in zip(frames, images, strict=True):
        gpu.remove(*frame, colour=image, depth_from_colour=place)
    assert map_bytes(gpu, tmp_path) == empty


def test_a_frame_that_does_not_fit_leaves_its_colours_out_too(on_gpu: Callable[..., pm.OccupancyGrid]) -> None:
    image = np.full((CAMERA.height, CAMERA.width, 3), 200, np.uint8)
    grid = on_gpu(colour=True, max_bytes=500_000)
    grid.integrate(*wall(1.0), colour=image)
    with pytest.raises(pm.MapFullError):
        grid.integrate(*wall(2.5), colour=image)
        grid.synchronize()
    assert grid.colour([[0.0, 0.0, 1.0], [0.0, 0.0, 2.5]]).tolist() == [[200, 200, 200, 255], [0, 0, 0, 0]]
    assert grid.num_frames == 1
    grid.integrate(*wall(2.5))
    assert grid.num_frames == 2, "without its colour it fits"
