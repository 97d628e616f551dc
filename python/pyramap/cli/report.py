"""`pyramap report`: a map on one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import report
from .facts import map_facts
from .maps import open_map
from .options import AsJson, MapFile, MinEvidence, Up
from .outputs import check_writable, page_path, write_page
from .products import file_sizes, mesh_facts, slice_facts, which_way_up
from .summary import map_rows, print_files, print_json
from .terminal import working_on


def report_map(
    file: MapFile,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", callback=page_path, help="Write the page; by default MAP with .html."),
    ] = None,
    title: Annotated[str | None, typer.Option(help="Its heading; by default the name of MAP.")] = None,
    most_faces: Annotated[
        int, typer.Option("--faces", min=1000, help="Most triangles of the surface on the page.")
    ] = report.MOST_FACES,
    up: Up = None,
    min_evidence: MinEvidence = 0.0,
    as_json: AsJson = False,
) -> None:
    """Describe MAP on one HTML page: what it holds, slices, its surface to turn with the mouse, how it was made.

    The page needs no other file and no network.
    """
    path = file.with_suffix(".html") if output is None else output
    check_writable([path])
    grid = open_map(file, backend="cpu")
    with working_on("making the mesh"):
        mesh = grid.mesh(min_evidence=min_evidence)
    with working_on("making the page"):
        facts = map_facts(grid)
        made = report.make(grid, mesh, title or file.stem, map_rows(facts), which_way_up(mesh, up), most_faces)
        write_page(path, made.html)
    said = {
        "map": facts,
        "mesh": {**mesh_facts(mesh), "triangles_on_page": len(made.geometry.faces)},
        "slices": [slice_facts(layer) for layer in made.slices],
        "files": file_sizes([path]),
    }
    if as_json:
        print_json(said)
    else:
        print_files(said)
