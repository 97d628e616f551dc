"""The shell: every command end to end on a small simulated data set, what it prints, and how it fails."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
import pytest
import trimesh
from numpy.typing import NDArray
from PIL import Image
from pyramap.cli import app, outputs, values
from pyramap.cli.interrupts import Interrupts
from typer import BadParameter
from typer.testing import CliRunner

CAMERA = pm.PinholeCamera(width=80, height=60, fx=60, fy=60, cx=39.5, cy=29.5)
FRAMES = 12
RESOLUTION = "0.1"


def run(*arguments: object, code: int = 0) -> Any:
    """Call the shell in this process; stdout, stderr and the exit code are in the result."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, f"{result.output}\n{result.exception!r}"
    assert "Traceback" not in result.output
    return result


def json_of(result: Any) -> Any:
    """The one JSON object on stdout; nothing else may be there or, as no one watches, on stderr."""
    assert result.stderr == ""
    (line,) = result.stdout.splitlines()
    return json.loads(line)


def rows(matrix: NDArray[np.float64]) -> str:
    return "\n".join(" ".join(repr(float(value)) for value in row) for row in matrix) + "\n"


def png_bytes(path: Path) -> NDArray[np.uint8]:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """12 views of the simulated office in the layout of 7-Scenes."""
    folder = tmp_path / "office"
    folder.mkdir()
    scene = pm.scenes.office_loop()
    for n, pose in enumerate(scene.poses()[: FRAMES * 4 : 4]):
        millimetres = np.round(1000 * scene.render(CAMERA, pose)).astype(np.uint16)
        Image.fromarray(millimetres).save(folder / f"frame-{n:06d}.depth.png")
        (folder / f"frame-{n:06d}.pose.txt").write_text(rows(pose))
    k = [[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]]
    (folder / "camera-intrinsics.txt").write_text(rows(np.array(k)))
    return folder


@pytest.fixture
def office_map(dataset: Path, tmp_path: Path) -> Path:
    path = tmp_path / "office.pmap"
    run("map", dataset, "-r", RESOLUTION, "-o", path)
    return path


# --- map --------------------------------------------------------------------------------------------------------------


def test_map_writes_all_that_is_asked_and_reports_it(dataset: Path, tmp_path: Path) -> None:
    out = {
        "-o": tmp_path / "m.pmap",
        "--mesh": tmp_path / "m.ply",
        "--png": tmp_path / "m.png",
        "--inside-png": tmp_path / "i.png",
        "--slice-png": tmp_path / "s.png",
    }
    options = [part for pair in out.items() for part in pair]
    report = json_of(run("map", dataset, "-r", RESOLUTION, *options, "--json"))

    by_hand = pm.OccupancyGrid(float(RESOLUTION))
    for frame in pm.datasets.open(dataset):
        by_hand.integrate(frame.depth, frame.camera, frame.world_from_camera)
    by_hand.save(tmp_path / "by_hand.pmap")
    assert out["-o"].read_bytes() == (tmp_path / "by_hand.pmap").read_bytes()

    assert report["run"]["frames"] == FRAMES
    assert report["run"]["left_out"] == {}
    assert not report["run"]["interrupted"]
    assert report["run"]["failure"] is None
    stages = ["ranges", "pyramid", "cull", "update", "commit", "integrate", "wait for frame"]
    assert list(report["run"]["median_ms"]) == stages
    assert all(milliseconds >= 0 for milliseconds in report["run"]["median_ms"].values())
    assert report["run"]["median_ms"]["integrate"] <= 1e3 * report["run"]["seconds"]
    assert report["files"] == {str(path): path.stat().st_size for path in out.values()}

    mesh = by_hand.mesh()
    assert report["mesh"] == {"vertices": len(mesh.vertices), "triangles": len(mesh.faces)}
    loaded = trimesh.load_mesh(out["--mesh"], process=False)
    np.testing.assert_array_equal(loaded.faces, mesh.faces)
    np.testing.assert_array_equal(loaded.vertices, mesh.vertices)
    # The scene's up is z, and its camera is held at 1.45 m.
    assert report["up"][2] > 0.95
    assert report["slice"]["axis"] == "z"
    assert abs(report["slice"]["at"] - 1.45) <= float(RESOLUTION) / 2 + 1e-9
    for name in ("--png", "--inside-png", "--slice-png"):
        image = png_bytes(out[name])
        assert image.shape[1] >= 500
        assert np.any(image != 255, axis=-1).mean() > 0.02
    assert {path.name for path in tmp_path.iterdir()} == {"office", "by_hand.pmap", *(p.name for p in out.values())}


def test_map_prints_a_table_for_people(dataset: Path) -> None:
    text = run("map", dataset, "-r", RESOLUTION).stdout
    for words in ("12 frames (all)", "ranges", "commit", "ms a frame (median)", "free", "occupied", "frames/s"):
        assert words in text
    if sys.platform != "win32":
        assert "peak memory" in text


def test_map_hands_every_option_on(dataset: Path, tmp_path: Path) -> None:
    path = tmp_path / "m.pmap"
    options = ["--sigma", "0.1,0.01,0.002", "-k", "0.08", "--surface-offset", "centred", "--max-range", "3.5"]
    options += ["--update", "area", "--backend", "cpu", "--clamp", "-2,3.5", "--prior", "0.4", "--max-bytes", "500MB"]
    options += ["--stride", "3", "--limit", "2", "--threads", "1", "--camera", "50,51,40,30", "-r", "0.2"]
    run("map", dataset, "-o", path, *options)
    by_hand = pm.OccupancyGrid(
        0.2,
        sensor_model=pm.SensorModel((0.1, 0.01, 0.002), k=0.08, surface_offset="centred"),
        max_range=3.5,
        update="area",
        backend="cpu",
        clamp=(-2, 3.5),
        prior=0.4,
        max_bytes=500_000_000,
    )
    camera = pm.PinholeCamera(width=80, height=60, fx=50, fy=51, cx=40, cy=30)
    for frame in pm.datasets.open(dataset, stride=3, limit=2):
        by_hand.integrate(frame.depth, camera, frame.world_from_camera)
    by_hand.save(tmp_path / "by_hand.pmap")
    assert by_hand.num_frames == 2
    assert path.read_bytes() == (tmp_path / "by_hand.pmap").read_bytes()


def test_a_mesh_with_more_evidence_asked_is_smaller(dataset: Path) -> None:
    mesh = ["map", dataset, "-r", RESOLUTION, "--mesh", dataset.parent / "m.stl", "--json"]
    whole, sure = (json_of(run(*mesh, "--min-evidence", e))["mesh"]["triangles"] for e in (0, 1.0))
    assert 0 < sure < whole


# --- runs that end early ----------------------------------------------------------------------------------------------


def cut_off(dataset: Path) -> None:
    image = dataset / "frame-000005.depth.png"
    image.write_bytes(image.read_bytes()[:-40])


def bend_the_pose(dataset: Path) -> None:
    (dataset / "frame-000005.pose.txt").write_text(rows(np.diag([1.0, 2.0, 1.0, 1.0])))


@pytest.mark.parametrize("spoil", [cut_off, bend_the_pose])
def test_a_bad_frame_ends_the_run_and_keeps_the_map_or_is_skipped(
    spoil: Callable[[Path], None], dataset: Path, tmp_path: Path
) -> None:
    spoil(dataset)
    path, mesh = tmp_path / "m.pmap", tmp_path / "m.ply"
    arguments = ["map", dataset, "-r", RESOLUTION, "-o", path, "--mesh", mesh]
    failed = run(*arguments, code=1)
    assert "frame" in failed.stderr
    assert "5" in failed.stderr
    assert f"the map of 5 frames is in {path}" in failed.stderr
    assert pm.OccupancyGrid.load(path).num_frames == 5
    assert not mesh.exists()

    report = json_of(run(*arguments, "--skip-bad", "--json"))
    assert report["run"]["frames"] == FRAMES - 1
    assert list(report["run"]["left_out"]) == ["5"]
    assert pm.OccupancyGrid.load(path).num_frames == FRAMES - 1
    assert mesh.exists()


def test_a_full_map_ends_the_run_and_is_kept(dataset: Path, tmp_path: Path) -> None:
    path = tmp_path / "m.pmap"
    whole = json_of(run("map", dataset, "-r", RESOLUTION, "--json"))["map"]["bytes"]
    budget = whole * 2 // 3
    result = run("map", dataset, "-r", RESOLUTION, "-o", path, "--max-bytes", budget, "--json", code=1)
    assert str(budget) in result.stderr
    report = json.loads(result.stdout)
    assert str(budget) in report["run"]["failure"]
    assert 0 < report["run"]["frames"] < FRAMES
    assert pm.OccupancyGrid.load(path).num_frames == report["run"]["frames"]


def test_nothing_fused_is_an_error_and_writes_nothing(dataset: Path, tmp_path: Path) -> None:
    for pose in dataset.glob("*.pose.txt"):
        pose.write_text(rows(np.zeros((4, 4))))
    path = tmp_path / "m.pmap"
    assert "no frame could be fused" in run("map", dataset, "-o", path, "--skip-bad", code=1).stderr
    assert "nothing is kept" in run("map", dataset, "-o", path, code=1).stderr
    assert not path.exists()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes to hold the mapper at a known frame")
@pytest.mark.parametrize("keep", [True, False])
def test_ctrl_c_stops_after_the_frame_in_work_and_keeps_the_map(keep: bool, dataset: Path, tmp_path: Path) -> None:
    held = dataset / "frame-000005.depth.png"
    image = held.read_bytes()
    held.unlink()
    os.mkfifo(held)
    path, mesh = tmp_path / "m.pmap", tmp_path / "m.ply"
    arguments = ["map", dataset, "-r", RESOLUTION, "--mesh", mesh, "--json", *(["-o", path] if keep else [])]
    process = start_shell(arguments)
    # Opening waits until the reader is at this frame, so the run is well under way.
    with held.open("wb") as pipe:
        process.send_signal(signal.SIGINT)
        pipe.write(image)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130, stderr
    report = json.loads(stdout)
    assert report["run"]["interrupted"]
    # The reader is at most three frames ahead of the mapper.
    assert 2 <= report["run"]["frames"] <= 6
    assert "Traceback" not in stderr
    assert not mesh.exists()
    if keep:
        assert f"interrupted: the map of {report['run']['frames']} frames is in {path}" in stderr
        assert pm.OccupancyGrid.load(path).num_frames == report["run"]["frames"]
    else:
        assert "nothing is kept" in stderr


def start_shell(arguments: list[Any]) -> subprocess.Popen[str]:
    command = [sys.executable, "-W", "error", "-m", "pyramap", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_a_second_ctrl_c_does_not_wait_for_the_frame() -> None:
    before = signal.getsignal(signal.SIGINT)
    with Interrupts() as interrupts:
        assert not interrupts.requested
        signal.raise_signal(signal.SIGINT)
        assert interrupts.requested
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_while_a_file_is_written_leaves_the_old_one(
    office_map: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = tmp_path / "m.ply"
    mesh.write_text("the old one")

    def write_half(self: trimesh.Trimesh, path: Path, **_: Any) -> None:
        path.write_text("half")
        raise KeyboardInterrupt

    monkeypatch.setattr(trimesh.Trimesh, "export", write_half)
    assert "interrupted" in run("mesh", office_map, "-o", mesh, code=130).stderr
    assert mesh.read_text() == "the old one"
    assert {path.name for path in tmp_path.iterdir()} == {"office", "office.pmap", "m.ply"}


# --- info, mesh, slice, demo ------------------------------------------------------------------------------------------


def test_info_counts_what_the_map_answers(office_map: Path) -> None:
    grid = pm.OccupancyGrid.load(office_map)
    facts = json_of(run("info", office_map, "--json"))
    assert grid.bounds is not None
    low, high = np.round(grid.bounds / grid.voxel_size).astype(int)
    centres = (np.stack(np.meshgrid(*map(np.arange, low, high)), axis=-1).reshape(-1, 3) + 0.5) * grid.voxel_size
    states = grid.state(centres)
    assert facts["map"]["voxels_free"] == np.count_nonzero(states == 0)
    assert facts["map"]["voxels_occupied"] == np.count_nonzero(states == 1)
    assert facts["map"]["bounds"] == grid.bounds.tolist()
    assert facts["map"]["blocks"] == grid.num_blocks
    assert facts["map"]["frames"] == FRAMES
    assert facts["map"]["voxel_size"] == float(RESOLUTION)
    assert facts["map"]["clamp"] is None
    assert facts["files"] == {str(office_map): office_map.stat().st_size}
    text = run("info", office_map).stdout
    for words in ("0.1 m", "pyramid", f"{facts['map']['voxels_free']:,} free", "bounds", "up to 5 m"):
        assert words in text


def test_info_of_an_empty_map(tmp_path: Path) -> None:
    path = tmp_path / "empty.pmap"
    pm.OccupancyGrid(0.1, sensor_model=pm.SensorModel((0.1, 0, 0.01)), clamp=(-2, 3), prior=0.4).save(path)
    assert json_of(run("info", path, "--json"))["map"]["bounds"] is None
    text = run("info", path).stdout
    for words in ("0 free, 0 occupied", "0.1 + 0 z + 0.01 z² m", "log-odds -2 to 3", "0.4"):
        assert words in text
    assert "nothing to slice" in run("slice", path, "-o", tmp_path / "s.png", code=1).stderr
    assert "no faces" in run("mesh", path, "--png", tmp_path / "m.png", code=1).stderr


@pytest.mark.parametrize("suffix", outputs.MESH_SUFFIXES)
def test_mesh_in_every_format(suffix: str, office_map: Path, tmp_path: Path) -> None:
    path = tmp_path / f"m{suffix}"
    facts = json_of(run("mesh", office_map, "-o", path, "--json"))
    mesh = pm.OccupancyGrid.load(office_map).mesh()
    loaded = trimesh.load_mesh(path)
    assert facts["mesh"]["triangles"] == len(loaded.faces) == len(mesh.faces)
    # OBJ is text of 8 digits.
    np.testing.assert_allclose(loaded.bounds, [mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], atol=1e-6)


def test_level_and_evidence_choose_the_surface(office_map: Path, tmp_path: Path) -> None:
    run("mesh", office_map, "-o", tmp_path / "m.ply", "--level", "0.8", "--min-evidence", "0.5")
    loaded = trimesh.load_mesh(tmp_path / "m.ply", process=False)
    grid = pm.OccupancyGrid.load(office_map)
    np.testing.assert_array_equal(loaded.vertices, grid.mesh(level=0.8, min_evidence=0.5).vertices)
    assert len({len(grid.mesh(level=a, min_evidence=b).vertices) for a, b in ((0.8, 0.5), (0.8, 0), (0, 0.5))}) == 3


def test_pictures_of_a_mesh_from_where_one_wants(office_map: Path, tmp_path: Path) -> None:
    options: list[list[str]] = [
        [],
        ["--up", "-y"],
        ["--eye", "0,0,1.5", "--look-at", "3,0,1"],
        ["--eye", "0,0,1.5", "--look-at", "3,1,1"],
        ["--eye", "0,-9,1.5", "--look-at", "3,0,1", "--backs"],
    ]
    images = []
    for i, some in enumerate(options):
        path = tmp_path / f"{i}.png"
        run("mesh", office_map, "--png", path, *some)
        images.append(png_bytes(path))
        assert np.any(images[-1] != 255, axis=-1).mean() > 0.02
    assert len({image.tobytes() for image in images}) == len(options)
    default_up = tmp_path / "z.png"
    run("mesh", office_map, "--png", default_up, "--up", "z")
    np.testing.assert_array_equal(png_bytes(default_up), images[0])


def test_slice_draws_the_plane_asked_for(office_map: Path, tmp_path: Path) -> None:
    path = tmp_path / "s.png"
    at = {}
    images = set()
    for options in (["--at", "1.2"], ["--axis", "x", "--at", "1.25"], []):
        facts = json_of(run("slice", office_map, "-o", path, *options, "--json"))
        at[facts["slice"]["axis"], facts["slice"]["at"]] = True
        images.add(path.read_bytes())
    bounds = pm.OccupancyGrid.load(office_map).bounds
    assert bounds is not None
    (axes, positions) = zip(*at, strict=True)
    assert axes == ("z", "x", "z")
    np.testing.assert_allclose(positions, [1.2, 1.25, bounds[:, 2].mean()], atol=float(RESOLUTION) / 2 + 1e-9)
    assert len(images) == 3
    assert f"wrote {path} (" in run("slice", office_map, "-o", path).stdout
    assert "no block of the map" in run("slice", office_map, "-o", path, "--at", "99", code=1).stderr


def test_demo_maps_the_office(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "out"
    report = json_of(run("demo", "-o", out, "-r", "0.2", "--stride", "100", "--json"))
    assert report["run"]["frames"] == 7
    assert {path.name for path in out.iterdir()} == {
        "office_loop.pmap", "office_loop.ply", "mesh.png", "inside.png", "slice.png"
    }  # fmt: skip
    exact = json_of(run("demo", "-o", out, "-r", "0.2", "--stride", "100", "--no-noise", "--json"))
    assert exact["map"]["voxels_occupied"] != report["map"]["voxels_occupied"]
    assert json_of(run("demo", "-o", out, "-r", "0.2", "--limit", "2", "--json"))["run"]["frames"] == 2


# --- errors -----------------------------------------------------------------------------------------------------------


def test_outputs_are_checked_before_the_work(tmp_path: Path) -> None:
    # The data set does not exist either: what is wrong with the outputs is found first.
    nowhere = tmp_path / "nowhere"
    bad_suffix = run("map", nowhere, "--mesh", tmp_path / "m.xyz", code=2).stderr
    assert ".xyz" in bad_suffix
    assert ".ply" in bad_suffix
    assert ".pmap" in run("map", nowhere, "-o", tmp_path / "m.ply", code=2).stderr
    assert ".png" in run("map", nowhere, "--png", tmp_path / "m.jpg", code=2).stderr
    assert ".png" in run("slice", nowhere, "-o", tmp_path / "m", code=2).stderr
    missing = run("map", nowhere, "-o", tmp_path / "no" / "m.pmap", code=1).stderr
    assert "does not exist" in missing
    assert str(tmp_path / "no") in missing
    (tmp_path / "d.ply").mkdir()
    assert "is a folder" in run("map", nowhere, "--mesh", tmp_path / "d.ply", code=1).stderr
    twice = ["--png", tmp_path / "a.png", "--slice-png", tmp_path / "." / "a.png"]
    assert "two outputs" in run("map", nowhere, *twice, code=1).stderr
    assert [path.name for path in tmp_path.iterdir()] == ["d.ply"]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="needs a user who may not write everywhere")
def test_a_folder_that_is_not_writable(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        assert "not writable" in run("map", "nowhere", "-o", tmp_path / "m.pmap", code=1).stderr
    finally:
        tmp_path.chmod(0o700)


def test_missing_and_foreign_input_is_named(office_map: Path, tmp_path: Path) -> None:
    assert str(tmp_path / "nowhere") in run("map", tmp_path / "nowhere", code=1).stderr
    for command in (["info"], ["mesh", "-o", tmp_path / "m.ply"], ["slice", "-o", tmp_path / "s.png"]):
        assert "no.pmap" in run(*command, tmp_path / "no.pmap", code=1).stderr
    data = bytearray(office_map.read_bytes())
    data[len(data) // 2] ^= 1
    office_map.write_bytes(data)
    for command in (["info"], ["mesh", "-o", tmp_path / "m.ply"], ["slice", "-o", tmp_path / "s.png"]):
        error = run(*command, office_map, code=1)
        assert str(office_map) in error.stderr
        assert error.stdout == ""
    assert {path.name for path in tmp_path.iterdir()} == {"office", "office.pmap"}


@pytest.mark.parametrize(
    ("arguments", "word", "code"),
    [
        (["map", "x", "-r", "-1"], "voxel_size", 1),
        (["map", "x", "-r", "nan"], "voxel_size", 1),
        (["map", "x", "--sigma", "0"], "sigma", 1),
        (["map", "x", "-k", "99"], "k", 1),
        (["map", "x", "--max-range", "0"], "max_range", 1),
        (["map", "x", "--clamp", "3,-3"], "clamp", 1),
        (["map", "x", "--prior", "1"], "prior", 1),
        (["map", "x", "--sigma", "1,2"], "1,2", 2),
        (["map", "x", "--sigma", "a"], "'a'", 2),
        (["map", "x", "--surface-offset", "middle"], "middle", 2),
        (["map", "x", "--clamp", "3"], "'3'", 2),
        (["map", "x", "--max-bytes", "5 apples"], "apples", 2),
        (["map", "x", "--camera", "1,2,3"], "1,2,3", 2),
        (["map", "x", "--update", "guess"], "guess", 2),
        (["map", "x", "--backend", "abacus"], "abacus", 2),
        (["map", "x", "--stride", "0"], "stride", 2),
        (["map", "x", "--threads", "0"], "threads", 2),
        (["map"], "dataset", 2),
        (["fly"], "fly", 2),
        (["mesh", "x.pmap"], "nothing to do", 2),
        (["mesh", "x.pmap", "--png", "x.png", "--eye", "1,2,3"], "go together", 2),
        (["mesh", "x.pmap", "--png", "x.png", "--up", "w"], "'w'", 2),
        (["slice", "x.pmap", "-o", "x.png", "--axis", "w"], "'w'", 2),
        (["slice", "x.pmap"], "--output", 2),
    ],
)
def test_bad_values_are_named(arguments: list[str], word: str, code: int) -> None:
    result = run(*arguments, code=code)
    assert word.lower() in result.stderr.lower()
    assert result.stdout == ""


@pytest.mark.parametrize(
    ("text", "count"),
    [("0", 0), ("1000", 1000), ("500MB", 500_000_000), ("1.5 GiB", 3 * 2**29), ("2kb", 2000), ("1TiB", 2**40)],
)
def test_byte_counts(text: str, count: int) -> None:
    assert values.byte_count(text) == count


@pytest.mark.parametrize("text", ["", "MB", "-1", "1.2.3", "5XB", "1e3", "500 M B"])
def test_what_is_no_byte_count(text: str) -> None:
    with pytest.raises(BadParameter, match="number of bytes"):
        values.byte_count(text)


def test_directions_are_axes_or_components() -> None:
    assert values.direction("z") == (0, 0, 1)
    assert values.direction("-y") == (0, -1, 0)
    assert values.direction("0.1,0,1") == (0.1, 0, 1)


# --- the terminal -----------------------------------------------------------------------------------------------------


def test_version_and_help_without_a_command() -> None:
    assert run("--version").stdout.strip() == f"pyramap {pm.__version__}"
    for command in ("demo", "map", "info", "mesh", "slice"):
        assert command in run("--help").stdout
        assert (
            "--json"
            in run(
                command,
                "--help",
            ).stdout
        )


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_progress_shows_on_a_terminal_and_stdout_stays_clean(dataset: Path) -> None:
    import pty

    terminal, ours = pty.openpty()
    command = [sys.executable, "-W", "error", "-m", "pyramap", "map", str(dataset), "-r", RESOLUTION, "--json"]
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "120"}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=ours, env=environment)
    os.close(ours)
    seen = []
    reader = threading.Thread(target=lambda: seen.append(read_all(terminal)))
    reader.start()
    stdout, _ = process.communicate(timeout=60)
    reader.join(timeout=60)
    os.close(terminal)
    assert process.returncode == 0, seen
    assert json.loads(stdout)["run"]["frames"] == FRAMES
    assert f"{FRAMES}/{FRAMES}" in seen[0]
    assert "frames/s" in seen[0]


def read_all(terminal: int) -> str:
    data = b""
    while True:
        try:
            more = os.read(terminal, 65536)
        except OSError:  # the other end is closed
            break
        if not more:
            break
        data += more
    return data.decode(errors="replace")
