"""`pyramap slice`: a plane through a map, as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import pictures
from .maps import open_map
from .options import AsJson, MapFile
from .outputs import check_writable, picture_path
from .products import draw_slice, file_sizes
from .summary import print_files, print_json, print_table, product_rows
from .values import Axis


def slice_map(
    file: MapFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", callback=picture_path, help="Write the picture, a .png file.")
    ],
    axis: Annotated[Axis, typer.Option(help="Axis that the plane is perpendicular to.")] = Axis.z,
    at: Annotated[
        float | None, typer.Option(help="Where the plane cuts the axis, metres; the middle of the map by default.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Draw a plane through MAP: free, occupied and unknown space."""
    check_writable([output])
    grid = open_map(file)
    index = pictures.AXES.index(axis.value)
    if at is None:
        if grid.bounds is None:
            raise ValueError(f"{file}: the map is empty: there is nothing to slice")
        at = float(grid.bounds[:, index].mean())
    facts = {"slice": draw_slice(output, grid, index, at), "files": file_sizes([output])}
    if as_json:
        print_json(facts)
    else:
        print_table(str(file), product_rows(facts))
        print_files(facts)
