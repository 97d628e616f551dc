"""`pyramap compare` and `pyramap bench`."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
import pytest
from numpy.typing import NDArray
from pyramap import pictures
from pyramap.cli import benching, comparing
from shell import FRAMES, RESOLUTION, json_of, png_bytes, run, write_office

EDGE = float(RESOLUTION)


@pytest.fixture(scope="module")
def office(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_office(tmp_path_factory.mktemp("compare") / "office")


@pytest.fixture(scope="module")
def maps(office: Path) -> tuple[Path, Path]:
    """Of all frames, and of the first nine within 3 m."""
    whole, part = office.parent / "whole.pmap", office.parent / "part.pmap"
    run("map", office, "-r", RESOLUTION, "-o", whole)
    run("map", office, "-r", RESOLUTION, "-o", part, "--limit", 9, "--max-range", 3)
    return whole, part


def all_voxels(*grids: pm.OccupancyGrid) -> NDArray[np.float64]:
    """(N, 3) centres of all voxels within the bounds of maps."""
    bounds = np.array([grid.bounds for grid in grids if grid.bounds is not None])
    low, high = np.round(bounds[:, 0].min(axis=0) / EDGE), np.round(bounds[:, 1].max(axis=0) / EDGE)
    indices = np.stack(np.meshgrid(*map(np.arange, low, high), indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray((indices + 0.5) * EDGE, dtype=np.float64)


# --- compare ----------------------------------------------------------------------------------------------------------


def test_a_map_is_the_same_as_itself(maps: tuple[Path, Path], tmp_path: Path) -> None:
    again, picture = tmp_path / "again.pmap", tmp_path / "d.png"
    again.write_bytes(maps[0].read_bytes())
    facts = json_of(run("compare", maps[0], again, "--png", picture, "--json"))
    assert facts["differing"] == 0
    assert facts["worst"] is None
    assert facts["parameters"] == {}
    assert facts["mean_difference"] == 0
    grid = pm.OccupancyGrid.load(again)
    assert facts["known"] == grid.num_observed
    assert facts["blocks"] == {"both": grid.num_blocks, "first": 0, "second": 0}
    assert picture.exists()
    assert "the maps are equal" in run("compare", maps[0], again).stdout


@pytest.mark.parametrize("swapped", [False, True])
def test_maps_are_compared_voxel_by_voxel(maps: tuple[Path, Path], swapped: bool) -> None:
    files = maps[::-1] if swapped else maps
    facts = json_of(run("compare", *files, "--json", code=3))
    first, second = (pm.OccupancyGrid.load(path) for path in files)
    centres = all_voxels(first, second)
    states = [grid.state(centres) for grid in (first, second)]
    names = {-1: "unknown", 0: "free", 1: "occupied"}
    for a, b in itertools.product(names, names):
        if (a, b) != (-1, -1):
            count = np.count_nonzero((states[0] == a) & (states[1] == b))
            assert facts["states"][f"{names[a]} -> {names[b]}"] == count
    known = (states[0] != -1) | (states[1] != -1)
    assert facts["known"] == known.sum()
    difference = np.abs(second.log_odds(centres).astype(float) - first.log_odds(centres))
    assert facts["differing"] == np.count_nonzero(difference) > 0
    for threshold, voxels in facts["exceeding"].items():
        assert voxels == np.count_nonzero(difference > float(threshold))
    assert facts["mean_difference"] == pytest.approx(difference[known].mean())
    worst = facts["worst"]
    assert worst["difference"] == difference.max()
    at = np.argmin(np.linalg.norm(centres - worst["centre"], axis=1))
    assert difference[at] == difference.max()
    assert worst["log_odds"] == [first.log_odds(centres)[at], second.log_odds(centres)[at]]
    np.testing.assert_array_equal(np.floor(centres[at] / EDGE), worst["voxel"])
    for state, name in ((0, "free"), (1, "occupied")):
        volumes = [np.count_nonzero(each == state) * EDGE**3 for each in states]
        assert facts["volumes"][name] == pytest.approx(volumes)
    blocks = [{tuple(block) for block in grid.block_coords().tolist()} for grid in (first, second)]
    counts = (len(blocks[0] & blocks[1]), len(blocks[0] - blocks[1]), len(blocks[1] - blocks[0]))
    assert tuple(facts["blocks"].values()) == counts
    ranges, frames = [5.0, 3.0], [FRAMES, 9]
    if swapped:
        ranges, frames = ranges[::-1], frames[::-1]
    assert facts["parameters"] == {"max_range": ranges, "frames": frames}


def test_blocks_are_read_in_parts(maps: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = (pm.OccupancyGrid.load(path) for path in maps)
    whole = comparing.compare_maps(first, second)
    monkeypatch.setattr(comparing, "_BLOCKS_AT_ONCE", 7)
    parts = comparing.compare_maps(first, second)
    np.testing.assert_array_equal(parts.states, whole.states)
    np.testing.assert_array_equal(parts.exceeding, whole.exceeding)
    assert parts.worst is not None and whole.worst is not None
    assert parts.worst.difference == whole.worst.difference


def test_one_altered_voxel_is_found(maps: tuple[Path, Path], tmp_path: Path) -> None:
    grid = pm.OccupancyGrid.load(maps[0])
    voxel = grid.occupied_voxels()[100]
    grid.clear([(voxel * EDGE).tolist(), ((voxel + 1) * EDGE).tolist()])
    altered = tmp_path / "altered.pmap"
    grid.save(altered)
    facts = json_of(run("compare", maps[0], altered, "--json", code=3))
    assert facts["differing"] == facts["states"]["occupied -> unknown"] == 1
    assert facts["worst"]["voxel"] == voxel.tolist()
    assert facts["worst"]["log_odds"][1] == 0


def test_a_tolerance_is_kept(maps: tuple[Path, Path], tmp_path: Path) -> None:
    grid = pm.OccupancyGrid.load(maps[0])
    grid.decay(0.99)
    decayed = tmp_path / "decayed.pmap"
    grid.save(decayed)
    worst = json_of(run("compare", maps[0], decayed, "--json", code=3))["worst"]["difference"]
    run("compare", maps[0], decayed, "--tolerance", 1.001 * worst)
    text = run("compare", maps[0], decayed, "--tolerance", 0.99 * worst, code=3).stdout
    assert f"differ by more than {0.99 * worst:g}" in text


def test_the_difference_is_drawn_where_it_is_most(maps: tuple[Path, Path], tmp_path: Path) -> None:
    picture = tmp_path / "d.png"
    facts = json_of(run("compare", *maps, "--png", picture, "--axis", "y", "--json", code=3))
    assert facts["slice"]["axis"] == "y"
    assert facts["slice"]["at"] == pytest.approx(facts["worst"]["centre"][1])
    first, second = (pm.OccupancyGrid.load(path) for path in maps)
    layer = pictures.cut_difference(first, second, pictures.axis_plane(1, facts["slice"]["at"]))
    np.testing.assert_array_equal(png_bytes(picture), pictures.difference_image(layer))
    assert facts["files"] == {str(picture): picture.stat().st_size}
    assert json_of(run("compare", *maps, "--png", picture, "--at", "1.23", "--json", code=3))["slice"][
        "at"
    ] == pytest.approx(1.25)


def test_what_cannot_be_compared(maps: tuple[Path, Path], tmp_path: Path) -> None:
    coarse = tmp_path / "coarse.pmap"
    pm.OccupancyGrid(0.2).save(coarse)
    assert "0.1 m and of 0.2 m cannot be compared" in run("compare", maps[0], coarse, code=1).stderr
    assert "No such file" in run("compare", maps[0], tmp_path / "none.pmap", code=1).stderr
    empty = tmp_path / "empty.pmap"
    pm.OccupancyGrid(EDGE).save(empty)
    facts = json_of(run("compare", empty, maps[0], "--json", code=3))
    assert facts["blocks"]["both"] == 0
    assert facts["states"]["free -> unknown"] == 0
    assert json_of(run("compare", empty, empty, "--json"))["known"] == 0
    assert "empty" in run("compare", empty, empty, "--png", tmp_path / "d.png", code=1).stderr


# --- bench ------------------------------------------------------------------------------------------------------------


def test_bench_times_a_data_set(office: Path) -> None:
    facts = json_of(run("bench", office, "-r", RESOLUTION, "--backend", "cpu", "--limit", 7, "--passes", 2, "--json"))
    assert facts["data"] == {"name": "office (7-Scenes)", "frames": 7, "width": 80, "height": 60}
    assert facts["machine"]["threads"] == pm.num_threads()
    assert facts["machine"]["processor"]
    (measured,) = facts["backends"].values()
    rate = measured["frames_per_second"]
    assert 0 < rate["least"] <= rate["median"] <= rate["most"]
    assert set(measured["ms"]) == {"ranges", "pyramid", "cull", "update", "commit", "integrate"}
    for times in measured["ms"].values():
        assert 0 <= times["q25"] <= times["median"] <= times["q75"]
    by_hand = pm.OccupancyGrid(EDGE, backend="cpu")
    for frame in pm.datasets.open(office, limit=7):
        by_hand.integrate(frame.depth, frame.camera, frame.world_from_camera)
    assert measured["map_bytes"] == by_hand.nbytes


def test_bench_without_data_times_the_office() -> None:
    text = run("bench", "-r", "0.2", "--backend", "cpu", "--limit", 2, "--passes", 1).stdout
    for words in (
        "office_loop (simulated), 2 frames of 640 x 480",
        "voxels of 0.2 m",
        "CPU",
        "whole call (ms)",
        "map (MB)",
    ):
        assert words in text


def test_backends_take_turns_and_the_first_pass_does_not_count(office: Path) -> None:
    made: list[str] = []

    def maker(name: str) -> pm.OccupancyGrid:
        made.append(name)
        return pm.OccupancyGrid(EDGE, backend="cpu")

    frames = list(pm.datasets.open(office, limit=3))
    contenders = [benching.Contender(name, lambda name=name: maker(name)) for name in "ab"]  # type: ignore[misc]
    ticks: list[None] = []
    times = benching.time_in_turns(contenders, frames, 2, lambda: ticks.append(None))
    assert made == ["a", "b"] * 3
    assert len(ticks) == 6
    for measured in times.values():
        assert len(measured.passes) == 2
        assert len(measured.seconds[benching.WHOLE_CALL]) == len(measured.seconds["update"]) == 6


def test_medians_and_quartiles() -> None:
    times = benching.Times({"update": [0.001, 0.002, 0.003, 0.004, 0.005], "upload": [0.0, 0.0]}, [10.0, 30.0, 20.0], 7)
    facts = benching.times_facts(times)
    assert facts["frames_per_second"] == {"median": 20, "least": 10, "most": 30}
    assert facts["ms"] == {"update": pytest.approx({"q25": 2, "median": 3, "q75": 4})}
    assert facts["map_bytes"] == 7


def test_bench_names_the_gpus_that_there_are(office: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usable = {device.name for device in pm.devices() if device.problem is None and device.kind != "software"}
    assert set(benching.usable_gpus()) == usable
    options: list[Any] = ["bench", office, "-r", RESOLUTION, "--limit", 2, "--passes", 1]
    if usable:
        assert set(json_of(run(*options, "--backend", "gpu", "--json"))["backends"]) == usable
    else:
        assert "GPU" in run(*options, "--backend", "gpu", code=1).stderr
        assert set(json_of(run(*options, "--json"))["backends"]) == {"CPU"}
