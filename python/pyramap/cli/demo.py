"""`pyramap demo`: a simulated office, mapped and shown."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import scenes
from .._core import OccupancyGrid
from ..pictures.rendering import NO_EMBREEX, can_draw_meshes
from .conclusion import conclude
from .fusing import fuse
from .options import AdapterChoice, AsJson, BackendChoice, MinEvidence, Threads
from .outputs import check_writable
from .products import Products
from .values import Backend, Update

_NOISE_SEED = 1


def run_demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the files; made if it is missing.")] = Path(
        "out"
    ),
    resolution: Annotated[float, typer.Option("--resolution", "-r", help="Edge of a voxel, metres.")] = 0.05,
    noise: Annotated[bool, typer.Option(help="Measure as a Kinect does, or without any error.")] = True,
    update: Annotated[Update, typer.Option(help="How a voxel's log-odds come from the image.")] = Update.pyramid,
    backend: BackendChoice = Backend.auto,
    adapter: AdapterChoice = None,
    min_evidence: MinEvidence = 0.0,
    stride: Annotated[int, typer.Option(min=1, help="Take every n-th of the 684 views.")] = 1,
    limit: Annotated[int | None, typer.Option(min=1, help="Take at most n views.")] = None,
    threads: Threads = None,
    as_json: AsJson = False,
) -> None:
    """Walk through a simulated office, map it, and write the map, its mesh and pictures.

    The office has corridors of 60 m in a loop and a furnished meeting room.
    """
    grid = OccupancyGrid(resolution, update=update.value, backend=backend.value, adapter=adapter)
    output.mkdir(parents=True, exist_ok=True)
    scene = scenes.office_loop()
    drawn = can_draw_meshes()
    if not drawn:
        typer.echo(f"note: {NO_EMBREEX}; the slice is drawn, and the mesh saved", err=True)
    products = Products(
        map=output / f"{scene.name}.pmap",
        mesh=output / f"{scene.name}.ply",
        picture=output / "mesh.png" if drawn else None,
        inside=output / "inside.png" if drawn else None,
        slice=output / "slice.png",
    )
    check_writable(products.paths())
    frames = scene.frames(noise=_NOISE_SEED if noise else None)[::stride][:limit]
    run = fuse(grid, frames, len(frames))
    conclude(f"{scene.name} (simulated)", grid, run, {}, products, min_evidence, as_json)
