"""`pyramap mesh`: the surface of a map, as a file and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import pictures
from .._core import Mesh
from . import values
from .maps import open_map
from .options import AdapterChoice, AsJson, BackendChoice, MapFile, MinEvidence, PictureOut, Threads, Up
from .outputs import check_writable, mesh_path, write_mesh
from .products import draw_mesh, file_sizes, mesh_facts, which_way_up
from .summary import print_files, print_json, print_table, product_rows
from .terminal import working_on
from .values import Backend, Numbers

WIDTH, HEIGHT = pictures.SIZE


def mesh_map(
    file: MapFile,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", callback=mesh_path, help="Write the mesh: .ply, .obj, .stl or .glb."),
    ] = None,
    png: PictureOut = None,
    level: Annotated[float, typer.Option(help="Log-odds of the surface.")] = 0.0,
    min_evidence: MinEvidence = 0.0,
    up: Up = None,
    eye: Annotated[
        Numbers | None,
        typer.Option(parser=values.point, metavar="X,Y,Z", help="Take the picture from here, metres; with --look-at."),
    ] = None,
    look_at: Annotated[
        Numbers | None, typer.Option(parser=values.point, metavar="X,Y,Z", help="Middle of a picture from --eye.")
    ] = None,
    angle: Annotated[
        float | None,
        typer.Option(
            min=1,
            max=170,
            help=f"Horizontal angle of a picture from --eye, degrees; {pictures.ANGLE_DEG:g} by default.",
        ),
    ] = None,
    look_along: Annotated[
        Numbers | None,
        typer.Option(
            parser=values.direction,
            metavar="X,Y,Z",
            help="Take the picture of all of it along this direction: -z is a plan, y is from the front.",
        ),
    ] = None,
    size: Annotated[
        Numbers | None,
        typer.Option(
            parser=values.size, metavar="W,H", help=f"Most pixels in width and height; by default {WIDTH},{HEIGHT}."
        ),
    ] = None,
    backs: Annotated[
        bool, typer.Option("--backs", help="Draw surfaces seen from behind, in blue, instead of looking through them.")
    ] = False,
    backend: BackendChoice = Backend.auto,
    adapter: AdapterChoice = None,
    threads: Threads = None,
    as_json: AsJson = False,
) -> None:
    """Make the surface of MAP: a mesh file, a picture, or both."""
    paths = [path for path in (output, png) if path is not None]
    if not paths:
        raise typer.BadParameter("nothing to do: name a mesh file with --output, a picture with --png, or both")
    if (eye is None) != (look_at is None):
        raise typer.BadParameter("--eye and --look-at go together")
    if angle is not None and eye is None:
        raise typer.BadParameter("--angle goes with --eye: from outside, rays are parallel")
    if look_along is not None and eye is not None:
        raise typer.BadParameter("--look-along and --eye are two places to look from: name one")
    check_writable(paths)
    grid = open_map(file, backend=backend.value, adapter=adapter)
    with working_on("making the mesh"):
        mesh = grid.mesh(level=level, min_evidence=min_evidence)
    if output:
        with working_on("saving the mesh"):
            write_mesh(output, mesh)
    if png:
        pixels = (int(size[0]), int(size[1])) if size else pictures.SIZE
        view = _view(mesh, up, eye, look_at, angle or pictures.ANGLE_DEG, look_along, pixels)
        draw_mesh(png, mesh, view, hide_backs=not backs)
    facts = {"mesh": mesh_facts(mesh), "files": file_sizes(paths)}
    if as_json:
        print_json(facts)
    else:
        print_table(str(file), product_rows(facts))
        print_files(facts)


def _view(
    mesh: Mesh,
    up: Numbers | None,
    eye: Numbers | None,
    look_at: Numbers | None,
    angle: float,
    look_along: Numbers | None,
    size: tuple[int, int],
) -> pictures.View:
    upward = which_way_up(mesh, up)
    if eye is not None and look_at is not None:
        return pictures.looking_at(eye, look_at, upward, size, angle)
    if look_along is not None:
        return pictures.looking_along(mesh.vertices, look_along, upward, size)
    return pictures.overview(mesh.vertices, mesh.faces, upward, size)
