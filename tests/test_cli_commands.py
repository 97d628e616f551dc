"""`pyramap info`, `mesh`, `slice` and `demo`, end to end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
import pytest
import trimesh
from pyramap import pictures
from pyramap.cli import outputs
from shell import FRAMES, RESOLUTION, json_of, png_bytes, run, write_office


@pytest.fixture
def office_map(tmp_path: Path) -> Path:
    path = tmp_path / "office.pmap"
    run("map", write_office(tmp_path / "office"), "-r", RESOLUTION, "-o", path)
    return path


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
    assert {path.name for path in tmp_path.iterdir()} == {"office", "office.pmap", path.name}
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
        ["--eye", "0,0,1.5", "--look-at", "3,0,1", "--angle", "40"],
        ["--look-along", "-z"],
        ["--look-along", "1,1,-0.5"],
    ]
    images = []
    for i, some in enumerate(options):
        path = tmp_path / f"{i}.png"
        run("mesh", office_map, "--png", path, "--size", "200,150", *some)
        images.append(png_bytes(path))
        assert images[-1].shape[1] <= 200
        assert np.any(images[-1] != 255, axis=-1).mean() > 0.02
    assert len({image.tobytes() for image in images}) == len(options)
    default_up = tmp_path / "z.png"
    run("mesh", office_map, "--png", default_up, "--up", "z", "--size", "200,150")
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


def test_slice_draws_any_plane(office_map: Path, tmp_path: Path) -> None:
    path = tmp_path / "s.png"
    grid = pm.OccupancyGrid.load(office_map)
    assert grid.bounds is not None
    options = ["--normal", "1,0.5,-0.2", "--through", "1.5,0.2,1.1", "--up", "x"]
    facts = json_of(run("slice", office_map, "-o", path, *options, "--json"))
    plane = pictures.plane_through((1.5, 0.2, 1.1), (1, 0.5, -0.2), up=(1, 0, 0))
    np.testing.assert_array_equal(png_bytes(path), pictures.slice_image(pictures.cut_plane(grid, plane)))
    assert facts["slice"]["axis"] is None
    assert facts["slice"]["through"] == [1.5, 0.2, 1.1]
    np.testing.assert_allclose(facts["slice"]["normal"], np.array([1, 0.5, -0.2]) / np.linalg.norm([1, 0.5, -0.2]))
    # By default it passes through the middle of the map.
    facts = json_of(run("slice", office_map, "-o", path, "--normal", "1,1,0", "--json"))
    np.testing.assert_allclose(facts["slice"]["through"], grid.bounds.mean(axis=0))
    assert "perpendicular to (0.707, 0.707, 0)" in run("slice", office_map, "-o", path, "--normal", "1,1,0").stdout


def test_options_that_do_not_go_together(office_map: Path, tmp_path: Path) -> None:
    png = tmp_path / "p.png"
    for command, words in {
        ("slice", "-o", png, "--through", "0,0,1"): "go with --normal",
        ("slice", "-o", png, "--normal", "1,1,0", "--at", "1"): "say --through",
        ("slice", "-o", png, "--normal", "up"): "0,0,1 or z or -y",
        ("mesh", "--png", png, "--angle", "50"): "goes with --eye",
        ("mesh", "--png", png, "--eye", "0,0,1"): "go together",
        ("mesh", "--png", png, "--eye", "0,0,1", "--look-at", "1,0,1", "--look-along", "z"): "name one",
    }.items():
        name, *rest = command
        # Messages are wrapped to the width of the terminal, in a frame.
        said = " ".join(run(name, office_map, *rest, code=2).stderr.replace("│", " ").split())
        assert words in said, said
    assert not png.exists()
    assert "expected a direction" in run("slice", office_map, "-o", png, "--normal", "0,0,0", code=1).stderr


@pytest.mark.parametrize(
    ("options", "views", "seed"), [(["--stride", "100"], 7, 1), (["--limit", "2", "--no-noise"], 2, None)]
)
def test_demo_maps_the_office(options: list[str], views: int, seed: int | None, tmp_path: Path) -> None:
    out = tmp_path / "deep" / "out"
    report = json_of(run("demo", "-o", out, "-r", "0.2", *options, "--json"))
    assert report["run"]["frames"] == views
    names = ["inside.png", "mesh.png", "office_loop.ply", "office_loop.pmap", "slice.png"]
    assert sorted(path.name for path in out.iterdir()) == names
    by_hand = pm.OccupancyGrid(0.2)
    frames = pm.scenes.office_loop().frames(noise=seed)
    for frame in frames[::100] if seed else frames[:2]:
        by_hand.integrate(frame.depth, frame.camera, frame.world_from_camera)
    by_hand.save(tmp_path / "by_hand.pmap")
    assert (out / "office_loop.pmap").read_bytes() == (tmp_path / "by_hand.pmap").read_bytes()


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
