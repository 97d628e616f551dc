"""`pyramap map`, how it ends early, and what it shows on a terminal."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyramap as pm
import pytest
import trimesh
from pyramap.cli.interrupts import Interrupts
from shell import FRAMES, RESOLUTION, json_of, png_bytes, rows, run, start_shell, write_office


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    return write_office(tmp_path / "office")


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
    if sys.platform != "win32":
        # Python with NumPy takes some 50 MB; the map of this little room does not take gigabytes.
        assert 5e7 < report["run"]["peak_memory_bytes"] < 2e9
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


def test_a_second_ctrl_c_does_not_wait_for_the_frame() -> None:
    before = signal.getsignal(signal.SIGINT)
    with Interrupts() as interrupts:
        assert not interrupts.requested
        signal.raise_signal(signal.SIGINT)
        assert interrupts.requested
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


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
