"""The paper repeated: each figure's data against numbers found in another way, and the page as a whole."""

from __future__ import annotations

import itertools
import json
import math
import re
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
import pytest
import reference
import shell
from PIL import Image
from pyramap import paper, pictures
from pyramap.paper import axis, comparison, exact, figure1, figure2, figure4, figure5, figure6, rooms, volumes
from pyramap.pictures.rendering import FRONT

TINY = paper.Effort(room_stride=60, office_stride=171, voxel_sizes=(0.08, 0.16), views=1, picture_width=160)
SECTIONS = ["figure1", "figure2", "figure3", "figure4", "figure5", "figure6", "figure7", "table1", "volumes"]

Occupancies = dict[comparison.Rule, comparison.Floats]

STEP = 3e-5
"""Of probability: what the map's unit of log-odds, 2^-12, is worth at most."""


def eq7(distance: float, reading: float, sigma: float = 0.6) -> float:
    """p of Eq. 7 with k = sigma."""
    g = math.exp(-0.5 * ((distance - reading) / sigma) ** 2)
    a = 1 / math.sqrt(2 * math.pi)
    return 0.3 + (a + 0.2) * g if distance <= reading else 0.5 + a * g


def log_odds(p: float) -> float:
    return math.log(p / (1 - p))


def test_figure_1_is_eq_7() -> None:
    curves = figure1.compute()
    a = 1 / math.sqrt(2 * math.pi)
    for reading in (10.0, 25.0):
        # The model is a table that is off by at most half a unit of the map.
        expected = [eq7(float(z), reading) for z in curves.distances]
        np.testing.assert_allclose(curves.paper[reading], expected, atol=STEP)
    assert curves.lead == pytest.approx(0.6 * math.sqrt(2 * math.log((a + 0.2) / 0.2)), abs=1e-4)
    centred = dict(zip(curves.distances.round(2).tolist(), curves.centred[10.0], strict=True))
    assert centred[10.0] == pytest.approx(0.5, abs=STEP)


def test_figure_2_is_the_mean_of_the_rays() -> None:
    ideal = figure2.compute()
    assert ideal.columns.tolist() == [198, 199, 200, 201, 202]
    # Two columns of rays end 2.05 m before the voxel's centre, three pass it 1.95 m before their end. All are equally
    # long inside, and distances equal z-depths, to less than 0.1 %.
    mean = (2 * log_odds(eq7(8.05, 6.0)) + 3 * log_odds(eq7(8.05, 10.0))) / 5
    assert ideal.marked == pytest.approx(1 / (1 + math.exp(-mean)), abs=1e-3)


def reference_view(layout: axis.Layout) -> reference.View:
    camera = reference.Camera(400, 400, 400.0, 400.0, layout.cx, 200.0)
    model = reference.Model((0.6, 0.0, 0.0))
    return reference.View(layout.depth(), camera, layout.world_from_camera(), 0.1, model, max_range=14.0)


def literal_by_reference(view: reference.View, centres: reference.Array) -> reference.Array:
    """Algorithm 1 with u / 2^i. That is where the reference, which counts from the centres of texels, has the pixel
    u + 2^(i - 1) - 1/2."""
    u, v, z, _ = view.project(centres)
    ranges, t = view.ranges(), view.thresholds()

    def at(i: int) -> reference.Array:
        shift = 2.0 ** (i - 1) - 0.5
        texels = reference.layer(ranges, i, t[i])
        return reference.interpolate(view.model, texels, i, u + shift, v + shift, z)

    layers = [at(i) for i in range(len(t))]
    result = np.where(z > t[0], layers[0], layers[-1])
    for i, (finer, coarser) in enumerate(itertools.pairwise(layers)):
        blended = finer + (z - t[i]) / (t[i + 1] - t[i]) * (coarser - finer)
        result = np.where((t[i + 1] < z) & (z <= t[i]), blended, result)
    return result


@pytest.mark.parametrize("layout", [axis.USUAL, figure5.MOVED], ids=lambda layout: layout.name)
def test_figure_5_agrees_with_the_reference(layout: axis.Layout) -> None:
    view, centres = reference_view(layout), layout.centres()
    oracles: dict[comparison.Rule, reference.Rule] = {
        "pyramid": reference.pyramid,
        "min_layer": reference.min_layer,
        "area": reference.area,
    }
    for rule, oracle in oracles.items():
        p = 1 / (1 + np.exp(-oracle(view, centres)))
        np.testing.assert_allclose(axis.occupancies(layout, rule), p, atol=2.5e-4, err_msg=rule)
    for half_texel, values in ((True, reference.pyramid(view, centres)), (False, literal_by_reference(view, centres))):
        p = 1 / (1 + np.exp(-values))
        np.testing.assert_allclose(axis.by_equations(layout, half_texel), p, atol=2.5e-4)


def test_figure_5_is_what_its_text_says() -> None:
    layouts = figure5.compute()
    usual, moved = (layouts[layout.name].mean_errors() for layout in (axis.USUAL, figure5.MOVED))
    assert usual["pyramid"] <= 0.002
    assert usual["min_layer"] > 3 * usual["pyramid"]
    assert usual["area"] < 1.5 * usual["pyramid"]
    assert usual["literal"] > 20 * usual["pyramid"]
    assert moved["pyramid"] > 10 * usual["pyramid"]
    assert moved["min_layer"] > 1.5 * moved["pyramid"]
    assert moved["area"] == pytest.approx(usual["area"], rel=0.2)
    on_the_axis = layouts["border on the axis"].mean_errors()
    assert max(on_the_axis[rule] for rule in figure5.RULES) < 2e-4
    hidden = layouts[figure5.MOVED.name].occupancies["min_layer"]
    assert abs(hidden[100] - 0.5) < 0.01  # at 10.05 m, where the far obstacle is
    np.testing.assert_allclose(figure5.layer_borders(), [10, 5, 2.5, 1.25, 0.625, 0.3125])


def test_the_exact_picture_is_lit_as_the_surface_stands() -> None:
    room = rooms.BOX.make()
    straight = pictures.looking_at((0, 0, 0), (0, 0, 1), rooms.UP, size=(60, 40), angle_deg=10.0)
    image = exact.shaded(room, straight)
    # The far wall is seen face on: its normal is (0, 0, -1) in the camera, and 0.91 of the light comes from there.
    np.testing.assert_allclose(image[20, 30], np.array(FRONT) * (0.5 + 0.5 * 0.91) ** 1.2, atol=1.0)
    # Ahead lie the wall and nothing else, as far as ten degrees reach.
    assert np.ptp(room.render(pm.PinholeCamera(60, 40, fx=343, fy=343, cx=29.5, cy=19.5), np.eye(4))) == 0
    assert image.std(axis=(0, 1)).max() == 0


def test_figure_4_measures_the_lead_of_the_model() -> None:
    effort = replace(TINY, room_stride=20)
    mapped = figure4._compute(rooms.SPHERES, effort)
    assert mapped.views == 10
    lead = {offset: surface.facts()["median"] for offset, surface in mapped.surfaces.items()}
    # As in the test of the mesh: 0.1 sigma for the grid's own, voxels being as large as sigma; half a voxel centred.
    assert lead["paper"] == pytest.approx(1.48 * figure4.SIGMA, abs=0.1 * figure4.SIGMA)
    assert abs(lead["centred"]) < figure4.VOXEL / 2
    images = [surface.image for surface in mapped.surfaces.values()]
    # Orange, too near, has more red than blue; what is right is pale.
    redness = [np.mean(image[..., 0].astype(float) - image[..., 2]) for image in images]
    assert redness[0] > redness[1] + 20


def dense(frame: pm.datasets.Frame, voxel: float, sigma: float, rules: Sequence[comparison.Rule]) -> Occupancies:
    """Occupancies by rule, asked point by point, of all voxels that any rule knows from the first view of BOX."""
    n = round(10 / voxel)  # that is how far behind the wall, at 5.4 m, something is known
    aside, ahead = (np.arange(n) + 0.5) * voxel - 5, (np.arange(n) + 0.5) * voxel
    points = np.stack(np.meshgrid(aside, aside, ahead), axis=-1).reshape(-1, 3)
    values = {}
    for rule in rules:
        grid = pm.OccupancyGrid(voxel, pm.SensorModel(sigma, k=sigma), max_range=15.0, update=rule, backend="cpu")
        grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
        values[rule] = grid.log_odds(points)
    known = np.any([value != 0 for value in values.values()], axis=0)
    return {rule: 1 / (1 + np.exp(-value[known].astype(np.float64))) for rule, value in values.items()}


def test_figure_6_counts_every_voxel() -> None:
    frame = pm.scenes.box().frames()[figure6.VIEW]
    paper_sigma, sharp = figure6.compute()
    p = dense(frame, 0.5, 0.6, figure6.RULES)
    for rule in figure6.RULES:
        assert paper_sigma.mean_errors[rule] == pytest.approx(np.abs(p[rule] - p["ideal"]).mean(), abs=STEP)
        undecided = np.abs(p[rule] - 0.5) < 0.02
        assert paper_sigma.free_undecided[rule] == pytest.approx(undecided[p["ideal"] < 0.4].mean())
    # What the text says: free space that minima call unseen, and surfaces too.
    assert sharp.free_undecided["min_layer"] > 2 * sharp.free_undecided["pyramid"]
    assert sharp.occupied_undecided["min_layer"] > 0.1
    assert sharp.occupied_undecided["pyramid"] < 0.01


def test_volumes_count_every_voxel() -> None:
    comparisons = volumes.compute(TINY)
    frame = pm.scenes.box().frames()[0]
    case = comparisons[0]
    p = dense(frame, 0.1, 0.6, volumes.RULES)
    for rule in volumes.RULES:
        error = np.abs(p[rule] - p["ideal"])
        assert len(case.errors[rule]) == len(error)
        assert case.errors[rule].mean() == pytest.approx(error.mean(), abs=1e-6)
        assert np.quantile(case.errors[rule], 0.99) == pytest.approx(np.quantile(error, 0.99), abs=1e-5)
    for scene in comparisons:
        assert scene.errors["ideal"].max() == 0
        means = {rule: errors.mean() for rule, errors in scene.errors.items()}
        assert means["area"] < means["pyramid"] / 2  # what the text says
        assert means["min_layer"] < means["pyramid"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the shell has written everything, with hardly any images."""
    folder = tmp_path_factory.mktemp("paper") / "not" / "there"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper, "QUICK", TINY)
        said = shell.json_of(shell.run("paper", "-o", folder, "--quick", "--backend", "cpu", "--json"))
    assert set(said["files"]) == {str(path) for path in folder.iterdir()}
    assert said["results"] == json.loads((folder / paper.RESULTS).read_text(encoding="utf-8"))
    return folder


def test_the_page_needs_nothing_else(folder: Path) -> None:
    page = (folder / paper.PAGE).read_text(encoding="utf-8")
    links = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert {link for link in links if not link.startswith("data:image/png;base64,")} == {
        f"#{name}" for name in SECTIONS
    }
    assert not re.findall(r"https?:|url\(|<script|<link|@import", page)
    assert [name for name in SECTIONS if f'<section id="{name}">' not in page] == []
    assert "$" not in page


def test_the_page_holds_every_picture(folder: Path) -> None:
    page = (folder / paper.PAGE).read_text(encoding="utf-8")
    files = sorted(folder.glob("*.png"))
    assert len(files) == page.count("<img ") == 13
    for file in files:
        assert b64encode(file.read_bytes()).decode() in page
        with Image.open(file) as image:
            assert image.width == 1500
            assert len(image.convert("RGB").getcolors(1 << 24) or ()) > 50, file.name


def test_the_page_says_that_it_is_quick(folder: Path) -> None:
    page = (folder / paper.PAGE).read_text(encoding="utf-8")
    assert "every 60th view" in page
    assert "every 171th image" in page


def test_results_are_complete_and_finite(folder: Path) -> None:
    results = json.loads((folder / paper.RESULTS).read_text(encoding="utf-8"))
    assert [name for name in results if name in SECTIONS] == SECTIONS
    assert results["quick"] is True

    def numbers(value: Any) -> list[float]:
        if isinstance(value, dict):
            return [number for item in value.values() for number in numbers(item)]
        if isinstance(value, list):
            return [number for item in value for number in numbers(item)]
        return [] if isinstance(value, str) else [float(value)]

    for name in SECTIONS:
        found = numbers(results[name])
        assert found
        assert np.isfinite(found).all(), name
    assert len(results["figure2"]["occupancies"]) == 140


def test_table_1_is_of_these_maps(folder: Path) -> None:
    table = json.loads((folder / paper.RESULTS).read_text(encoding="utf-8"))["table1"]
    frames = pm.scenes.office_loop().frames(noise=1)[::171]
    assert table["frames"] == len(frames) == 4
    assert table["backend"] == "cpu"
    for row in table["rows"]:
        size = row["voxel_size_m"]
        grid = pm.OccupancyGrid(size, pm.SensorModel(size, k=size), max_range=5.0, backend="cpu")
        for frame in frames:
            grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
        assert row["bytes"] == grid.nbytes
        assert row["seconds_of_684_frames"] == pytest.approx(row["seconds"] * 171)
    assert [(row["paper_seconds"], row["paper_bytes"]) for row in table["rows"]] == [(48.6, 0.3e9), (34.2, 0.06e9)]


def test_a_file_in_the_place_of_the_folder_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    assert "file" in shell.run("paper", "-o", tmp_path / "file", "--quick", code=1).stderr
    assert (tmp_path / "file").read_text() == "mine"
