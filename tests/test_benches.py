"""The comparison with other systems runs from its frames to its plot; here with pyramap alone, in few frames."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
from PIL import Image

BENCHES = Path(__file__).parents[1] / "benches"
VOXEL_SIZE = 0.16
RULES = {"pyramid", "area", "min_layer", "ideal"}


def test_comparison_measures_every_rule(tmp_path: Path) -> None:
    options = ["--data", "office", "--systems", "pyramap", "--frames", "3", "--rounds", "2", "--threads", "1"]
    said = run("peers", *options, "--resolutions", str(VOXEL_SIZE), "--out", tmp_path)
    results = json.loads((tmp_path / "results.json").read_text())
    names = {f"pyramap {rule}" for rule in RULES} | {"pyramap pyramid, clamped"}
    on_a_gpu = {f"pyramap {rule}, GPU" for rule in RULES - {"ideal"}}
    if any(device.problem is None for device in pm.devices()):
        assert "left out" not in said
        names |= on_a_gpu
    else:
        assert all(f"left out: {name}" in said for name in on_a_gpu)
    assert {times["system"] for times in results["times"]} == names
    for times in results["times"]:
        low, middle, high = times["quartiles_ms"]
        assert 0 < low <= middle <= high
        assert len(times["round_medians_ms"]) == 2
    assert {footprint["system"] for footprint in results["footprints"]} == names
    assert all(footprint["map_bytes"] > 0 for footprint in results["footprints"])
    errors = {errors["rule"]: errors["mean"] for errors in results["errors"]}
    assert set(errors) == RULES - {"ideal"}
    assert 0 < errors["area"] < errors["pyramid"]
    assert [mesh["triangles"] > 0 for mesh in results["meshes"]] == [True]
    with Image.open(tmp_path / "frame_times.png") as picture:
        assert len(np.unique(np.asarray(picture.convert("L")))) > 50


def test_whole_sequences_stand_beside_the_paper(tmp_path: Path) -> None:
    run("peers.full_run", "--data", "office", "--frames", "2", "--threads", "1", "--out", tmp_path)
    runs: list[dict[str, Any]] = json.loads((tmp_path / "full_run.json").read_text())["runs"]
    assert [run["voxel_size"] for run in runs] == [0.02, 0.04, 0.08, 0.16]
    nbytes = [run["map_bytes"] for run in runs]
    assert nbytes == sorted(nbytes, reverse=True)
    assert all(run["frames"] == 2 and run["seconds"] > 0 for run in runs)


def test_distance_fields_are_timed_beside_scipy(tmp_path: Path) -> None:
    options = ["--data", "office", "--frames", "9", "--rounds", "2", "--threads", "1", "--voxel-size", str(VOXEL_SIZE)]
    said = run("peers.distance", *options, "--out", tmp_path)
    assert "whole / scipy" in said
    results = json.loads((tmp_path / "distance.json").read_text())
    assert [times["unknown"] for times in results["times"]] == ["free", "occupied"]
    for times in results["times"]:
        assert all(len(times[what]) == 2 and min(times[what]) > 0 for what in ("scipy", "whole", "dense", "update"))
    assert all(len(updates) == 9 for updates in results["updates_while_mapping"].values())


def test_queries_are_timed_and_compared(tmp_path: Path) -> None:
    options = ["--data", "office", "--frames", "3", "--rounds", "2", "--threads", "1", "--voxel-size", str(VOXEL_SIZE)]
    said = run("peers.queries", *options, "--count", "1000", "--out", tmp_path)
    assert "Nanoseconds for a question" in said
    results = json.loads((tmp_path / "queries.json").read_text())
    times = results["times"]
    assert [each["question"] for each in times] == ["rays, unknown: stop", "rays, unknown: pass", "points"]
    assert all(len(each["pyramap"]) == 2 and min(each["pyramap"]) > 0 for each in times)
    # The peer is there or is said to be missing; where it is, both give the same answers.
    assert ("left out: pyoctomap" in said) == (results["ratios"] == [])
    assert all(each["alike"] is None or each["alike"] > 0.999 for each in times)


def run(module: str, *arguments: object) -> str:
    """Runs `python -m module` with benches/ on the path and returns what it wrote."""
    command = [sys.executable, "-m", module, *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": str(BENCHES)}
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, done.stdout
    return done.stdout
