"""The page, put together."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from io import BytesIO
from string import Template

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from .. import __version__, pictures
from .._core import Mesh, OccupancyGrid
from ..pictures import rendering
from .geometry import MOST_FACES, Geometry, decimated, encoded
from .history import history
from .statistics import Statistics, count

_PICTURE = (1200, 900)


@dataclass(frozen=True)
class Report:
    """A page, and what is on it.

    Attributes:
        html: All of it.
        statistics: The counts.
        geometry: The surface as it is on the page.
        slices: The planes that were drawn.
    """

    html: str
    statistics: Statistics
    geometry: Geometry
    slices: Sequence[pictures.Slice]


def make(
    grid: OccupancyGrid,
    mesh: Mesh,
    title: str,
    parameters: Iterable[tuple[str, str]],
    up: ArrayLike,
    most_faces: int = MOST_FACES,
) -> Report:
    """Make the page of a map.

    Args:
        grid: The map.
        mesh: Its surface.
        title: Its heading.
        parameters: Names and values to list below how it was made; plain text.
        up: (3,) unit vector.
        most_faces: Of the surface on the page.

    Raises:
        ValueError: The map or its surface is empty.
    """
    # Matplotlib takes half a second to load: only who draws waits for it.
    from .histogram import histogram_image

    if grid.bounds is None or len(mesh.faces) == 0:
        raise ValueError("the map has no surface: there is nothing to report")
    view = pictures.overview(mesh.vertices, mesh.faces, up, _PICTURE)
    colours = None if mesh.colours is None else pictures.opaque(mesh.colours)
    geometry = decimated(mesh.vertices, mesh.faces, most_faces, grid.voxel_size, colours)
    statistics = count(grid)
    layers = [pictures.cut(grid, axis, at) for axis, at in enumerate(grid.bounds.mean(axis=0))]
    # The level plane first: it is the one that people know from plans.
    layers.insert(0, layers.pop(int(np.argmax(np.abs(np.asarray(up))))))
    surface = {
        **encoded(geometry),
        "up": np.asarray(up, dtype=np.float64).tolist(),
        "forward": view.axes[:, 2].tolist(),
        "front": rendering.FRONT,
        "back": rendering.BACK,
    }
    html = _template("page.html").substitute(
        title=escape(title),
        summary=escape(_summary(grid)),
        overview=_overview(mesh, view),
        faces=escape(_faces(mesh, geometry)),
        slices="\n".join(_figure(pictures.slice_image(layer), layer.plane.title) for layer in layers),
        content=_content(statistics, _area(mesh)),
        histogram=_source(histogram_image(statistics)),
        history="\n".join(f"<p>{escape(sentence)}</p>" for sentence in history(grid)),
        parameters="\n".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in parameters),
        version=escape(__version__),
        mesh=json.dumps(surface),
        script=_template("surface.js").template,
    )
    return Report(html, statistics, geometry, layers)


def _template(name: str) -> Template:
    return Template(files(__package__).joinpath(name).read_text(encoding="utf-8"))


def _summary(grid: OccupancyGrid) -> str:
    assert grid.bounds is not None
    extent = " x ".join(f"{span:.2f}" for span in grid.bounds[1] - grid.bounds[0])
    return (
        f"A probabilistic occupancy map of {extent} m in voxels of {grid.voxel_size:g} m, made of {grid.num_frames:,} "
        "frames. It knows of each voxel whether it is free, occupied, or has never been seen."
    )


def _faces(mesh: Mesh, geometry: Geometry) -> str:
    whole, shown = f"{len(mesh.faces):,} triangles", f"{len(geometry.faces):,}"
    if geometry.cell == 0:
        return f"The surface has {whole}; all are shown."
    return (
        f"The surface has {whole}; for this page they were made {shown}, by gathering the vertices in cells of "
        f"{geometry.cell:.2g} m."
    )


def _content(statistics: Statistics, area: float) -> str:
    within = statistics.free + statistics.occupied + statistics.unknown
    states = (
        ("free", statistics.free),
        ("occupied", statistics.occupied),
        ("unknown, within the bounds", statistics.unknown),
    )
    rows = []
    for name, voxels in states:
        numbers = f"{voxels:,}", f"{voxels * statistics.voxel_volume:,.2f}", f"{voxels / within:.1%}"
        cells = "".join(f'<td class="number">{number}</td>' for number in numbers)
        rows.append(f"<tr><th>{name}</th>{cells}</tr>")
    head = "<tr><th></th><th>voxels</th><th>m³</th><th>share</th></tr>"
    return f"<table>\n{head}\n" + "\n".join(rows) + f"\n</table>\n<p>The surface has an area of {area:,.1f} m².</p>"


def _area(mesh: Mesh) -> float:
    """Of all faces, m^2."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    return float(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    )


def _overview(mesh: Mesh, view: pictures.View) -> str:
    """What stands in the place of the surface until the page's script runs, and where it cannot."""
    if not rendering.can_draw_meshes():
        return '<p id="picture">To see the surface, open this page in a browser with WebGL 2.</p>'
    image = pictures.mesh_image(mesh.vertices, mesh.faces, view, mesh.normals, colours=mesh.colours)
    return f'<img id="picture" alt="The surface of the map from obliquely above" src="{_source(image)}">'


def _figure(image: NDArray[np.uint8], title: str) -> str:
    return f'<figure><img alt="Slice {escape(title)}" src="{_source(image)}"></figure>'


def _source(image: NDArray[np.uint8]) -> str:
    """The picture itself, as an address."""
    buffer = BytesIO()
    Image.fromarray(image).save(buffer, format="PNG")
    return f"data:image/png;base64,{b64encode(buffer.getvalue()).decode()}"
