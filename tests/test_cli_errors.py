"""How the shell fails: what it says, its exit code, and what it leaves behind."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from pyramap.cli import values
from shell import RESOLUTION, run, write_office
from typer import BadParameter


@pytest.fixture
def office_map(tmp_path: Path) -> Path:
    path = tmp_path / "office.pmap"
    run("map", write_office(tmp_path / "office"), "-r", RESOLUTION, "-o", path)
    return path


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
        (["mesh", "x.pmap", "--png", "x.png", "--size", "0,10"], "whole pixels", 2),
        (["mesh", "x.pmap", "--png", "x.png", "--size", "99999,10"], "whole pixels", 2),
        (["mesh", "x.pmap", "--png", "x.png", "--size", "1.5,10"], "whole pixels", 2),
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
