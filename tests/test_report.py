"""`pyramap report`: the page is whole, and what is on it is what the map holds."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
from base64 import b64decode
from dataclasses import dataclass
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
import pytest
import trimesh
from numpy.typing import NDArray
from PIL import Image
from pyramap import pictures, report
from pyramap.pictures import rendering
from pyramap.report.history import history
from real_data import real
from scipy.spatial import cKDTree
from shell import RESOLUTION, json_of, run, write_office

SCRIPT = Path(report.__file__).with_name("surface.js")
NODE = shutil.which("node")


@pytest.fixture(scope="module")
def office_map(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    path = folder / "office.pmap"
    run("map", write_office(folder / "office"), "-r", RESOLUTION, "-o", path)
    return path


TITLE = "Room <3 & more"


@pytest.fixture(scope="module")
def reported(office_map: Path) -> tuple[dict[str, Any], str]:
    """What the command said, and the page; by default that lies beside the map."""
    facts = json_of(run("report", office_map, "--title", TITLE, "--json"))
    return facts, office_map.with_suffix(".html").read_text(encoding="utf-8")


class Page(HTMLParser):
    """What is on a page: elements with their attributes, and the text in each kind of element."""

    VOID = frozenset({"meta", "img", "input", "br", "link"})

    def __init__(self, html: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text: dict[str, str] = {}
        self._open: list[str] = []
        self.feed(html)
        self.close()
        assert self._open == [], f"not closed: {self._open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        name = self._open[-1] if self._open else ""
        if name == "script":
            kind = self.elements[-1][1].get("type") or "javascript"
            name = f"script {kind}"
        self.text[name] = self.text.get(name, "") + data

    def pictures(self) -> list[NDArray[np.uint8]]:
        """The embedded pictures."""
        sources = [attrs["src"] or "" for tag, attrs in self.elements if tag == "img"]
        assert all(source.startswith("data:image/png;base64,") for source in sources)
        return [np.asarray(Image.open(BytesIO(b64decode(source.partition(",")[2])))) for source in sources]


@dataclass(frozen=True)
class Surface:
    """The mesh of a page, decoded."""

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    faces: NDArray[np.int64]
    colours: NDArray[np.uint8] | None


def decoded(data: dict[str, Any]) -> Surface:
    positions = np.frombuffer(b64decode(data["positions"]), "<u2").reshape(-1, 4)[:, :3]
    normals = np.frombuffer(b64decode(data["normals"]), np.int8).reshape(-1, 4)[:, :3] / 127
    faces = np.frombuffer(b64decode(data["faces"]), "<u4").reshape(-1, 3).astype(np.int64)
    colours = data["colours"] and np.frombuffer(b64decode(data["colours"]), np.uint8).reshape(-1, 4)[:, :3]
    return Surface(np.array(data["low"]) + data["step"] * positions, normals, faces, colours)


# --- the page ---------------------------------------------------------------------------------------------------------


def test_the_page_is_whole_and_says_what_the_map_is(office_map: Path, reported: tuple[dict[str, Any], str]) -> None:
    facts, html = reported
    page = Page(html)
    # It needs nothing else.
    for _, attributes in page.elements:
        for name in ("src", "href"):
            assert (attributes.get(name) or "data:").startswith("data:")
    assert not re.search(r"https?://|url\(|@import|fetch\(|XMLHttp", html)
    assert page.text["h1"] == page.text["title"] == TITLE

    grid = pm.OccupancyGrid.load(office_map)
    said = json_of(run("info", office_map, "--json"))["map"]
    assert facts["map"]["voxels_free"] == said["voxels_free"]
    assert grid.bounds is not None
    volume = float(RESOLUTION) ** 3
    within = round(float(np.prod(grid.bounds[1] - grid.bounds[0])) / volume)
    cells = page.text["td"]
    for voxels in (said["voxels_free"], said["voxels_occupied"], within - grid.num_observed):
        assert f"{voxels:,}" in cells
        assert f"{voxels * volume:,.2f}" in cells
        assert f"{voxels / within:.1%}" in cells
    for words in ("pyramid", "sigma 0.1 m", "up to 5 m", "0.1 m"):
        assert words in cells
    assert "12 frames were fused" in page.text["p"]
    assert "exact sum" in page.text["p"]
    area = trimesh.Trimesh(grid.mesh().vertices, grid.mesh().faces, process=False).area
    assert f"an area of {area:,.1f} m²" in page.text["p"]
    path = office_map.with_suffix(".html")
    assert facts["files"] == {str(path): path.stat().st_size}


def test_the_pictures_are_the_map_s(office_map: Path, reported: tuple[dict[str, Any], str]) -> None:
    facts, html = reported
    overview, *slices, histogram = Page(html).pictures()
    grid = pm.OccupancyGrid.load(office_map)
    mesh = grid.mesh()
    view = pictures.overview(mesh.vertices, mesh.faces, (0, 0, 1), (1200, 900))
    np.testing.assert_array_equal(overview, pictures.mesh_image(mesh.vertices, mesh.faces, view, mesh.normals))
    assert grid.bounds is not None
    middle = grid.bounds.mean(axis=0)
    for picture, axis, said in zip(slices, (2, 0, 1), facts["slices"], strict=True):
        layer = pictures.cut(grid, axis, middle[axis])
        np.testing.assert_array_equal(picture, pictures.slice_image(layer))
        assert said["axis"] == "xyz"[axis]
        assert said["at"] == layer.at
    assert histogram.std() > 10


def test_the_surface_is_the_mesh(office_map: Path, reported: tuple[dict[str, Any], str]) -> None:
    page = Page(reported[1])
    data = json.loads(page.text["script application/json"])
    surface, mesh = decoded(data), pm.OccupancyGrid.load(office_map).mesh()
    np.testing.assert_array_equal(surface.faces, mesh.faces)
    # Positions are rounded to steps of the largest extent over 65535: half of one, and float32's own rounding.
    extent = float(np.max(np.ptp(mesh.vertices, axis=0)))
    assert data["step"] == pytest.approx(extent / 65535)
    np.testing.assert_allclose(surface.vertices, mesh.vertices, atol=0.51 * data["step"])
    # Normals are rounded to 1/127, and are those of the faces about the vertex.
    normals = np.zeros((len(mesh.vertices), 3))
    a, b, c = (mesh.vertices[mesh.faces[:, corner]].astype(float) for corner in range(3))
    for corner in range(3):
        np.add.at(normals, mesh.faces[:, corner], np.cross(b - a, c - a))
    lengths = np.linalg.norm(normals, axis=1)
    # Normals of a sliver say nothing.
    sound = lengths > 1e-6
    cosines = np.sum(surface.normals * normals, axis=1)[sound] / lengths[sound]
    assert sound.mean() > 0.99
    assert cosines.min() > 0.98
    assert data["up"] == [0, 0, 1]
    assert f"The surface has {len(mesh.faces):,} triangles; all are shown." in page.text["p"]
    assert page.text["script javascript"].strip() == SCRIPT.read_text(encoding="utf-8").strip()


def test_a_large_surface_is_decimated(office_map: Path, tmp_path: Path) -> None:
    path = tmp_path / "r.html"
    facts = json_of(run("report", office_map, "-o", path, "--faces", "1000", "--json"))
    page = Page(path.read_text(encoding="utf-8"))
    surface, mesh = decoded(json.loads(page.text["script application/json"])), pm.OccupancyGrid.load(office_map).mesh()
    assert 300 < len(surface.faces) <= 1000 < len(mesh.faces)
    assert facts["mesh"] == {
        "vertices": len(mesh.vertices),
        "triangles": len(mesh.faces),
        "triangles_on_page": len(surface.faces),
    }
    said = re.search(r"made (\S+), by gathering the vertices in cells of (\S+) m", page.text["p"])
    assert said is not None
    assert said[1] == f"{len(surface.faces):,}"
    # A vertex is the mean of those in its cell, so it is no farther from one of them than the cell's diagonal.
    nearest = cKDTree(mesh.vertices).query(surface.vertices)[0]
    assert nearest.max() < math.sqrt(3) * float(said[2]) * 1.05


def test_without_embreex_the_page_lacks_one_picture(
    office_map: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rendering, "EmbreeScene", None)
    path = tmp_path / "r.html"
    run("report", office_map, "-o", path)
    page = Page(path.read_text(encoding="utf-8"))
    assert len(page.pictures()) == 4
    assert "WebGL 2" in page.text["p"]
    assert ("p", {"id": "picture"}) in page.elements


def test_decimation_by_hand() -> None:
    # Two squares of two triangles side by side in z = 0, and a sliver whose corners fall into one cell.
    vertices = np.array(
        [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0], [0.1, 0.1, 0], [0.2, 0.1, 0]], float
    )
    faces = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [0, 7, 6]])
    colours = np.array([[0, 0, 0]] + 5 * [[9, 9, 9]] + [[30, 60, 90], [60, 60, 90]])
    whole = report.decimated(vertices, faces, 5, 0.4, colours)
    assert whole.cell == 0
    np.testing.assert_array_equal(whole.faces, faces)
    np.testing.assert_array_equal(whole.colours, colours)
    fewer = report.decimated(vertices, faces, 4, 0.4, colours)
    assert 0.4 <= fewer.cell < 1
    assert len(fewer.faces) == 4
    # Three vertices have become one, which two of the squares' triangles end at.
    distances = np.linalg.norm(fewer.vertices - [0.1, 0.2 / 3, 0], axis=1)
    index = int(np.argmin(distances))
    assert distances[index] < 1e-6
    assert np.count_nonzero(fewer.faces == index) == 2
    assert fewer.colours is not None
    assert fewer.colours[index].tolist() == [30, 40, 60]
    # Orientation stays: all normals along +z.
    a, b, c = (fewer.vertices[fewer.faces[:, k]] for k in range(3))
    assert np.all(np.cross(b - a, c - a)[:, 2] > 0)


def test_history_of_a_map_that_was_changed() -> None:
    frame = next(iter(pm.scenes.box().frames()))
    grid = pm.OccupancyGrid(0.25, max_range=8.0)
    grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
    grid.decay(0.5)
    grid.clear([[-1, -1, 0], [1, 1, 1]])
    text = " ".join(history(grid))
    for words in ("1 frame was fused", "decayed once, to 0.5", "made unknown once", "no frame can be taken off"):
        assert words in text
    assert "exact sum" not in text
    clamped = pm.OccupancyGrid(0.25, max_range=8.0, clamp=(-2, 3.5))
    assert "clamped to -2 to 3.5" in " ".join(history(clamped))


def test_statistics_count_each_known_voxel_once(office_map: Path) -> None:
    grid = pm.OccupancyGrid.load(office_map)
    statistics = report.count(grid)
    log_odds = grid.block_log_odds(grid.block_coords())
    known = log_odds[log_odds != 0]
    assert statistics.free == np.count_nonzero(known < 0)
    assert statistics.occupied == np.count_nonzero(known > 0)
    assert statistics.counts.sum() == len(known)
    assert statistics.counts[0] == np.count_nonzero(known < statistics.edges[1])
    assert statistics.counts[-1] == np.count_nonzero(known >= statistics.edges[-2])


def test_nothing_to_report(office_map: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty.pmap"
    pm.OccupancyGrid(0.1).save(empty)
    assert "nothing to report" in run("report", empty, code=1).stderr
    assert not empty.with_suffix(".html").exists()
    assert "expected .html" in run("report", office_map, "-o", tmp_path / "r.pdf", code=2).stderr
    assert "does not exist" in run("report", office_map, "-o", tmp_path / "no" / "r.html", code=1).stderr


def test_the_red_kitchen_on_a_page(tmp_path: Path) -> None:
    path = tmp_path / "kitchen.pmap"
    run("map", real("redkitchen"), "-r", "0.06", "--stride", 60, "-o", path, "--backend", "cpu")
    facts = json_of(run("report", path, "--up", "-y", "--faces", "20000", "--json"))
    assert facts["mesh"]["triangles_on_page"] <= 20000
    assert [said["axis"] for said in facts["slices"]] == ["y", "x", "z"]
    # A page that can be sent by mail.
    assert path.with_suffix(".html").stat().st_size < 5e6


# --- the script -------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(NODE is None, reason="needs Node.js to run the page's script")
def test_the_script_looks_where_the_page_says() -> None:
    looking = [0.48, 0.64, -0.6]
    mesh = {"low": [-1, 2, 0], "high": [3, 8, 2.5], "up": [0, 0, 1], "forward": looking}
    calls = (
        "const view = startingView(mesh); JSON.stringify({view, axes: axesOf(view), m: [...clipFromWorld(view, 1.5)]})"
    )
    code = f"const mesh = {json.dumps(mesh)};\n{calls}"
    # Evaluated with the script as one program, as a page does.
    program = "process.stdout.write(require('vm').runInThisContext(require('fs').readFileSync(0, 'utf8')))"
    assert NODE is not None
    source = SCRIPT.read_text(encoding="utf-8") + code
    result = subprocess.run([NODE, "-e", program], input=source, capture_output=True, text=True, check=True)
    said = json.loads(result.stdout)
    axes = np.array([said["axes"][name] for name in ("right", "upward", "forward")])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(axes[2], looking, atol=1e-12)
    assert np.linalg.det(np.stack([axes[0], -axes[1], axes[2]])) == pytest.approx(1)
    assert axes[1, 2] > 0 and abs(axes[0, 2]) < 1e-12

    clip_from_world = np.array(said["m"]).reshape(4, 4).T

    def seen(point: list[float]) -> NDArray[np.float64]:
        x, y, z, w = clip_from_world @ [*point, 1]
        assert w > 0
        return np.array([x / w, y / w, z / w])

    middle = seen([1, 5, 1.25])
    np.testing.assert_allclose(middle[:2], 0, atol=1e-6)
    corners = [[x, y, z] for x in (-1, 3) for y in (2, 8) for z in (0, 2.5)]
    # All of it is in sight, and neither cut off in front nor behind.
    assert max(np.abs(seen(corner)).max() for corner in corners) < 1 + 1e-6
    # And no smaller than it has to be.
    assert max(np.abs(seen(corner)[:2]).max() for corner in corners) > 0.99
    assert seen([1, 5, 2.5])[1] > middle[1]
    ahead = np.array([1, 5, 1.25]) + 0.5 * axes[2]
    assert seen(ahead.tolist())[2] > middle[2]
    aside = np.array([1, 5, 1.25]) + 0.5 * axes[0]
    assert seen(aside.tolist())[0] > 0
