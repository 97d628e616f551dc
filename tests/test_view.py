"""`pyramap view` and `map --view`: what is in the recordings, read back with Rerun's own reader."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import sys
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
import pytest
import rerun
from numpy.typing import NDArray
from PIL import Image
from pyramap import viewer
from pyramap.datasets import Frame
from pyramap.viewer import opening
from real_data import real
from recordings import Row, read_recording
from rerun.chunk import RrdReader
from shell import CAMERA, FRAMES, RESOLUTION, json_of, run, start_shell, write_office

EDGE = float(RESOLUTION)


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """The simulated office with colour images, each of one colour."""
    folder = write_office(tmp_path / "office")
    for n in range(FRAMES):
        Image.new("RGB", (CAMERA.width, CAMERA.height), (20 * n, 100, 50)).save(folder / f"frame-{n:06d}.color.png")
    return folder


@pytest.fixture
def office_map(dataset: Path, tmp_path: Path) -> Path:
    path = tmp_path / "office.pmap"
    run("map", dataset, "-r", RESOLUTION, "-o", path)
    return path


def array(row: Row, component: str) -> NDArray[np.float64]:
    return np.array(row.components[component], dtype=np.float64)


def matrix(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) rotation of x, y, z, w."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def visible_voxels(grid: pm.OccupancyGrid) -> set[tuple[int, ...]]:
    """Occupied voxels of which not all six neighbours are occupied."""
    occupied = {tuple(voxel) for voxel in grid.occupied_voxels().tolist()}
    steps = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    return {(x, y, z) for x, y, z in occupied if not all((x + a, y + b, z + c) in occupied for a, b, c in steps)}


def assert_shows(rows: dict[str, list[Row]], grid: pm.OccupancyGrid) -> None:
    """The last state of voxels and mesh is that of the map."""
    boxes, surface = rows["world/map/voxels"][-1], rows["world/map/mesh"][-1]
    centres = array(boxes, "Boxes3D:centers")
    voxels = {tuple(voxel) for voxel in np.floor(centres / grid.voxel_size).astype(int).tolist()}
    assert voxels == visible_voxels(grid)
    assert len(voxels) == len(centres) == len(boxes.components["Boxes3D:colors"])
    np.testing.assert_allclose(array(boxes, "Boxes3D:half_sizes"), grid.voxel_size / 2, rtol=1e-6)
    mesh = grid.mesh()
    np.testing.assert_array_equal(array(surface, "Mesh3D:vertex_positions"), mesh.vertices)
    np.testing.assert_array_equal(array(surface, "Mesh3D:vertex_normals"), mesh.normals)
    np.testing.assert_array_equal(array(surface, "Mesh3D:triangle_indices"), mesh.faces)


def assert_shows_frames(rows: dict[str, list[Row]], dataset: Path) -> None:
    """Poses, way and images are those of the data set, at their frames."""
    frames = list(pm.datasets.open(dataset))
    assert len(frames) == FRAMES
    for entity, count in {"world/camera": FRAMES, "world/camera/depth": FRAMES, "colour": FRAMES}.items():
        assert [row.times["frame"] for row in rows[entity]] == [frame.index for frame in frames]
        assert len(rows[entity]) == count
    for row, frame in zip(rows["world/camera"], frames, strict=True):
        pose = frame.world_from_camera
        np.testing.assert_allclose(array(row, "Transform3D:translation")[0], pose[:3, 3], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(matrix(array(row, "Transform3D:quaternion")[0]), pose[:3, :3], atol=1e-6)
        k = array(row, "Pinhole:image_from_camera").reshape(3, 3).T
        assert k.tolist() == [[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]]
        assert array(row, "Pinhole:resolution").tolist() == [[CAMERA.width, CAMERA.height]]
    for n, row in enumerate(rows["world/camera/depth"]):
        depth = np.array(row.components["DepthImage:buffer"][0], dtype=np.uint8).view(np.uint16)
        with Image.open(dataset / f"frame-{n:06d}.depth.png") as image:
            np.testing.assert_array_equal(depth.reshape(CAMERA.height, CAMERA.width), np.asarray(image))
        assert row.components["DepthImage:meter"] == [1000.0]
    for n, row in enumerate(rows["colour"]):
        assert bytes(row.components["EncodedImage:blob"][0]) == (dataset / f"frame-{n:06d}.color.png").read_bytes()
    pieces = rows["world/trajectory"]
    assert [row.times["frame"] for row in pieces] == [frame.index for frame in frames[1:]]
    for row, before, after in zip(pieces, frames, frames[1:], strict=False):
        ends = [before.world_from_camera[:3, 3], after.world_from_camera[:3, 3]]
        np.testing.assert_allclose(array(row, "LineStrips3D:strips")[0], ends, rtol=1e-6, atol=1e-6)


# --- what is recorded -------------------------------------------------------------------------------------------------


def test_a_run_is_recorded(dataset: Path, office_map: Path, tmp_path: Path) -> None:
    recording, again = tmp_path / "run.rrd", tmp_path / "again.pmap"
    report = json_of(run("map", dataset, "-r", RESOLUTION, "-o", again, "--save-view", recording, "--json"))
    assert again.read_bytes() == office_map.read_bytes()
    assert report["files"] == {str(path): path.stat().st_size for path in (again, recording)}
    rows = read_recording(recording)
    assert_shows_frames(rows, dataset)
    assert_shows(rows, pm.OccupancyGrid.load(again))
    # The voxels after the first frame, and after the last.
    assert [row.times["frame"] for row in rows["world/map/voxels"]] == [0, FRAMES - 1]
    first = pm.OccupancyGrid(EDGE)
    frame = pm.datasets.open(dataset)[0]
    first.integrate(frame.depth, frame.camera, frame.world_from_camera)
    assert len(array(rows["world/map/voxels"][0], "Boxes3D:centers")) == len(visible_voxels(first))
    assert len(rows["world/map/mesh"]) == 1
    # The office's camera is held upright: z is up.
    assert rows["world"][0].components["ViewCoordinates:xyz"] == [[3, 5, 1]]
    assert rows["world"][0].times == {}
    assert len(RrdReader(recording).blueprints()) == 1


def test_a_map_is_recorded_for_all_times(office_map: Path, tmp_path: Path) -> None:
    recording = tmp_path / "map.rrd"
    facts = json_of(run("view", office_map, "--save", recording, "--json"))
    grid, rows = pm.OccupancyGrid.load(office_map), read_recording(recording)
    assert_shows(rows, grid)
    assert {entity for entity in rows if not entity.startswith("__")} == {"world", "world/map/voxels", "world/map/mesh"}
    assert all(row.times == {} for several in rows.values() for row in several)
    assert facts["boxes"] == len(visible_voxels(grid))
    assert facts["box_edge"] == EDGE
    assert facts["mesh"]["triangles"] == len(grid.mesh().faces)
    assert facts["frames"] == 0
    assert facts["files"] == {str(recording): recording.stat().st_size}
    assert rows["world"][0].components["ViewCoordinates:xyz"] == [[3, 5, 1]]
    text = run("view", office_map, "--save", recording, "--up", "0.2,-1,0").stdout
    assert read_recording(recording)["world"][0].components["ViewCoordinates:xyz"] == [[3, 2, 5]]
    for words in (f"{facts['boxes']:,} boxes of 0.1 m", f"wrote {recording}"):
        assert words in text


def test_a_map_is_recorded_with_the_frames_of_its_data_set(dataset: Path, office_map: Path, tmp_path: Path) -> None:
    recording = tmp_path / "map.rrd"
    facts = json_of(run("view", office_map, dataset, "--save", recording, "--json"))
    assert facts["frames"] == FRAMES
    rows = read_recording(recording)
    assert_shows_frames(rows, dataset)
    assert_shows(rows, pm.OccupancyGrid.load(office_map))
    assert rows["world/map/mesh"][0].times == {}
    assert json_of(run("view", office_map, dataset, "--save", recording, "--stride", 5, "--json"))["frames"] == 3
    assert [row.times["frame"] for row in read_recording(recording)["world/camera"]] == [0, 5, 10]


def test_times_odd_depths_and_skewed_poses(tmp_path: Path) -> None:
    camera = pm.PinholeCamera(width=4, height=2, fx=2, fy=3, cx=1.5, cy=0.5)
    depth = np.array([[0, np.nan, np.inf, -1], [1.2344, 65.535, 65.6, 0.0006]], dtype=np.float32)
    # As some data sets have it: a rotation, about z by 0.3, that is scaled by 1.001. The viewer wants true ones.
    pose = np.eye(4)
    pose[:2, :2] = 1.001 * np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    pose[2, 2] = 1.001
    recording = tmp_path / "r.rrd"
    with viewer.saving(recording) as recorder:
        for index, seconds in ((3, 1e9), (8, 1e9 + 0.25)):
            recorder.show_frame(Frame(index, depth, camera, pose, seconds))
    rows = read_recording(recording)
    assert [row.times["frame"] for row in rows["world/camera"]] == [3, 8]
    assert [row.times["time"] for row in rows["world/camera"]] == [timedelta(0), timedelta(seconds=0.25)]
    millimetres = np.array(rows["world/camera/depth"][0].components["DepthImage:buffer"][0], np.uint8).view(np.uint16)
    assert millimetres.tolist() == [0, 0, 0, 0, 1234, 65535, 0, 1]
    quaternion = array(rows["world/camera"][0], "Transform3D:quaternion")[0]
    np.testing.assert_allclose(quaternion, [0, 0, np.sin(0.15), np.cos(0.15)], atol=1e-6)
    # It is held with y down: -y is up.
    assert rows["world"][0].components["ViewCoordinates:xyz"] == [[3, 2, 5]]
    assert "colour" not in rows


def test_too_many_voxels_become_larger_boxes(office_map: Path) -> None:
    grid = pm.OccupancyGrid.load(office_map)
    whole = viewer.occupied_boxes(grid)
    assert whole.edge == EDGE
    some = viewer.occupied_boxes(grid, at_most=len(whole.centres) // 3)
    assert len(some.centres) <= len(whole.centres) // 3
    assert some.edge in (2 * EDGE, 4 * EDGE)
    cells = {
        tuple(cell) for cell in np.floor(grid.voxel_centres(grid.occupied_voxels()) / some.edge).astype(int).tolist()
    }
    shown = {tuple(cell) for cell in np.floor(some.centres / some.edge).astype(int).tolist()}
    assert len(shown) == len(some.centres)
    # Those that are not shown are between six others.
    for x, y, z in cells - shown:
        for a, b, c in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)):
            assert (x + a, y + b, z + c) in cells
    assert shown <= cells


def test_boxes_are_coloured_by_height(office_map: Path) -> None:
    grid = pm.OccupancyGrid.load(office_map)
    for up in ((0.0, 0.0, 1.0), (0.0, -1.0, 0.0)):
        boxes = viewer.occupied_boxes(grid, up)
        heights = boxes.centres @ np.array(up)
        # Viridis becomes lighter from its low to its high end.
        lightness = boxes.colours.astype(float) @ [0.2126, 0.7152, 0.0722]
        order = np.argsort(heights)
        assert np.corrcoef(heights, lightness)[0, 1] > 0.95
        assert lightness[order[0]] < 40 and lightness[order[-1]] > 200


def test_an_empty_map_has_no_boxes(tmp_path: Path) -> None:
    path = tmp_path / "empty.pmap"
    pm.OccupancyGrid(0.1).save(path)
    facts = json_of(run("view", path, "--save", tmp_path / "e.rrd", "--json"))
    assert facts["boxes"] == facts["mesh"]["triangles"] == 0


def test_the_red_kitchen_is_recorded(tmp_path: Path) -> None:
    folder, recording = real("redkitchen"), tmp_path / "kitchen.rrd"
    report = json_of(
        run("map", folder, "-r", "0.08", "--stride", 120, "--save-view", recording, "--backend", "cpu", "--json")
    )
    rows = read_recording(recording)
    assert report["run"]["frames"] == len(rows["world/camera"]) == len(rows["world/camera/depth"]) == 6
    assert len(rows["world/trajectory"]) == 5
    # Every sixth frame has colour.
    assert len(rows["colour"]) == 6
    assert len(array(rows["world/map/voxels"][-1], "Boxes3D:centers")) > 1000
    assert len(array(rows["world/map/mesh"][-1], "Mesh3D:vertex_positions")) > 1000


# --- what may go wrong ------------------------------------------------------------------------------------------------


@pytest.fixture
def no_viewer(monkeypatch: pytest.MonkeyPatch) -> None:
    """No viewer is open on this machine."""
    monkeypatch.setattr(opening, "_is_listening", lambda: False)


def test_without_a_display_there_is_the_file(
    office_map: Path, dataset: Path, tmp_path: Path, no_viewer: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    for arguments in (["view", office_map], ["map", dataset, "-r", RESOLUTION, "--view", "-o", tmp_path / "m.pmap"]):
        said = run(*arguments, code=1).stderr
        assert "no display" in said and "--save" in said and "rerun FILE.rrd" in said
    # Said before the work, not after it.
    assert not (tmp_path / "m.pmap").exists()


@pytest.mark.parametrize(
    ("environment", "platform", "has"),
    [
        ({}, "linux", False),
        ({"DISPLAY": ""}, "linux", False),
        ({"DISPLAY": ":0"}, "linux", True),
        ({"WAYLAND_DISPLAY": "wayland-0"}, "linux", True),
        ({}, "darwin", True),
        ({}, "win32", True),
    ],
)
def test_where_there_is_a_display(environment: dict[str, str], platform: str, has: bool) -> None:
    if has:
        opening.check_display(environment, platform)
    else:
        with pytest.raises(viewer.ViewerError, match="no display"):
            opening.check_display(environment, platform)


def test_without_rerun_it_is_said_what_to_install(
    office_map: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    said = run("view", office_map, "--save", tmp_path / "m.rrd", code=1).stderr
    assert "pip install 'pyramap[viz]'" in said
    assert not list(tmp_path.glob("*.rrd*"))


def test_rerun_switched_off_is_said(office_map: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rerun, "is_enabled", lambda _: False)
    assert "environment variable RERUN" in run("view", office_map, "--save", tmp_path / "m.rrd", code=1).stderr


def test_without_the_program_it_is_said(office_map: Path, no_viewer: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(shutil, "which", lambda *_, **__: None)
    assert "`rerun`, is not found" in run("view", office_map, code=1).stderr


def test_a_viewer_that_ends_at_once_is_said(office_map: Path, no_viewer: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    started: list[dict[str, Any]] = []
    monkeypatch.setattr(rerun, "spawn", lambda **options: started.append(options))
    said = run("view", office_map, code=1).stderr
    assert "ended, or did not answer" in said and "--save" in said
    (options,) = started
    assert Path(options["executable_path"]).exists()


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Something that takes recordings as a viewer does, on a port of its own."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    stream = rerun.RecordingStream("server")
    stream.serve_grpc(grpc_port=port)
    monkeypatch.setattr(opening, "PORT", port)
    yield port
    stream.disconnect()


def test_an_open_viewer_is_used(office_map: Path, server: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # No display is needed for it: it may be at the other end of a tunnel.
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(rerun, "spawn", lambda **_: pytest.fail("started another viewer"))
    facts = json_of(run("view", office_map, "--json"))
    assert facts["boxes"] > 0
    assert facts["files"] == {}


def test_names_and_folders_are_checked_first(office_map: Path, dataset: Path, tmp_path: Path) -> None:
    assert "expected .rrd" in run("view", office_map, "--save", tmp_path / "m.txt", code=2).stderr
    missing = tmp_path / "no" / "m.rrd"
    assert "does not exist" in run("view", office_map, "--save", missing, code=1).stderr
    assert "does not exist" in run("map", dataset, "--save-view", missing, code=1).stderr


def test_a_bad_frame_leaves_no_half_recording(dataset: Path, office_map: Path, tmp_path: Path) -> None:
    recording = tmp_path / "m.rrd"
    recording.write_text("the old one")
    (dataset / "frame-000005.depth.png").write_bytes(b"not a picture")
    said = run("view", office_map, dataset, "--save", recording, code=1).stderr
    assert "frame-000005" in said
    assert recording.read_text() == "the old one"
    assert {path.name for path in tmp_path.iterdir()} == {"office", "office.pmap", "m.rrd"}
    facts = json_of(run("view", office_map, dataset, "--save", recording, "--skip-bad", "--json"))
    assert facts["frames"] == FRAMES - 1
    assert list(facts["left_out"]) == ["5"]
    # A run that ends early keeps what it has recorded, as it keeps its map.
    said = run("map", dataset, "-r", RESOLUTION, "-o", tmp_path / "m.pmap", "--save-view", recording, code=1).stderr
    assert "frame-000005" in said
    rows = read_recording(recording)
    assert len(rows["world/camera"]) == 5
    assert "world/map/mesh" not in rows


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes to hold the mapper at a known frame")
def test_ctrl_c_keeps_the_recording_so_far(dataset: Path, tmp_path: Path) -> None:
    recording, held = tmp_path / "m.rrd", dataset / "frame-000005.depth.png"
    image = held.read_bytes()
    held.unlink()
    os.mkfifo(held)
    process = start_shell(["map", dataset, "-r", RESOLUTION, "--save-view", recording, "--json"])
    # Opening waits until the reader, which is at most three frames ahead, is at this frame.
    with held.open("wb") as pipe:
        process.send_signal(signal.SIGINT)
        pipe.write(image)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130, stderr
    assert f"interrupted: the recording is in {recording}" in stderr
    frames = json.loads(stdout)["run"]["frames"]
    assert 2 <= frames < FRAMES
    rows = read_recording(recording)
    assert len(rows["world/camera"]) == frames
    assert "world/map/mesh" not in rows
