"""`pyramap slice`: a plane through a map, as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import pictures
from .._core import OccupancyGrid
from . import values
from .maps import open_map
from .options import AsJson, MapFile
from .outputs import check_writable, picture_path
from .products import file_sizes, write_slice
from .summary import print_files, print_json, print_table, product_rows
from .terminal import working_on
from .values import Axis, Numbers


def slice_map(
    file: MapFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", callback=picture_path, help="Write the picture, a .png file.")
    ],
    axis: Annotated[Axis, typer.Option(help="Axis that the plane is perpendicular to.")] = Axis.z,
    at: Annotated[
        float | None, typer.Option(help="Where the plane cuts the axis, metres; the middle of the map by default.")
    ] = None,
    normal: Annotated[
        Numbers | None,
        typer.Option(
            parser=values.direction,
            metavar="X,Y,Z",
            help="In the place of --axis: any direction that the plane is perpendicular to, seen from where it points.",
        ),
    ] = None,
    through: Annotated[
        Numbers | None,
        typer.Option(
            parser=values.point,
            metavar="X,Y,Z",
            help="A point of the plane with --normal, metres; the middle of the map by default.",
        ),
    ] = None,
    up: Annotated[
        Numbers | None,
        typer.Option(
            parser=values.direction,
            metavar="X,Y,Z",
            help="With --normal: which way is up in the picture; z by default, or y where the normal is along z.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Draw a plane through MAP: free, occupied and unknown space."""
    if normal is None and (through is not None or up is not None):
        raise typer.BadParameter("--through and --up go with --normal")
    if normal is not None and at is not None:
        raise typer.BadParameter("--at goes with --axis; with --normal, say --through")
    check_writable([output])
    grid = open_map(file)
    with working_on("drawing the slice"):
        if normal is not None:
            point = middle(grid, file) if through is None else through
            layer = pictures.cut_plane(grid, pictures.plane_through(point, normal, up))
        else:
            index = pictures.AXES.index(axis.value)
            layer = pictures.cut(grid, index, middle(grid, file)[index] if at is None else at)
        facts = {"slice": write_slice(output, layer), "files": file_sizes([output])}
    if as_json:
        print_json(facts)
    else:
        print_table(str(file), product_rows(facts))
        print_files(facts)


def middle(grid: OccupancyGrid, file: Path) -> tuple[float, ...]:
    """Of the bounds of a map, metres.

    Raises:
        ValueError: The map is empty.
    """
    if grid.bounds is None:
        raise ValueError(f"{file}: the map is empty: there is nothing to slice")
    return tuple(grid.bounds.mean(axis=0).tolist())
