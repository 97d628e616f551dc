"""`pyramap map`: a data set into a map."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from .. import datasets
from .._core import OccupancyGrid, SensorModel
from . import values
from .conclusion import conclude
from .fusing import fuse
from .options import DATASET_HELP, AdapterChoice, AsJson, BackendChoice, MeshOut, MinEvidence, PictureOut, Threads
from .outputs import check_writable, map_path, picture_path, recording_path
from .products import Products
from .values import Backend, Numbers, Topic, Update
from .watching import Watcher, recorders

NO_OFFSET = "0"


def map_dataset(
    dataset: Annotated[Path, typer.Argument(help=DATASET_HELP)],
    resolution: Annotated[float, typer.Option("--resolution", "-r", help="Edge of a voxel, metres.")] = 0.05,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", callback=map_path, help="Write the map: .pmap, or .bt or .ot for OctoMap."),
    ] = None,
    mesh: MeshOut = None,
    png: PictureOut = None,
    inside_png: Annotated[
        Path | None, typer.Option(callback=picture_path, help="Draw the mesh as seen from behind the first camera.")
    ] = None,
    slice_png: Annotated[
        Path | None, typer.Option(callback=picture_path, help="Draw the level slice at the height of the cameras.")
    ] = None,
    sigma: Annotated[
        Numbers | None,
        typer.Option(
            parser=values.sigma,
            metavar="S0[,S1,S2]",
            help="Standard deviation of a reading z, metres: S0 + S1 z + S2 z². By default the resolution.",
        ),
    ] = None,
    k: Annotated[
        float | None, typer.Option("--k", "-k", help="Importance of a reading, metres; S0 by default.")
    ] = None,
    surface_offset: Annotated[
        str, typer.Option(metavar="METRES|centred", help="Where the model puts the surface behind the reading.")
    ] = NO_OFFSET,
    max_range: Annotated[float, typer.Option(help="Readings count up to this distance, metres.")] = 5.0,
    update: Annotated[Update, typer.Option(help="How a voxel's log-odds come from the image.")] = Update.pyramid,
    backend: BackendChoice = Backend.auto,
    adapter: AdapterChoice = None,
    clamp: Annotated[
        Numbers | None, typer.Option(parser=values.pair, metavar="LO,HI", help="Keep log-odds within these bounds.")
    ] = None,
    prior: Annotated[float, typer.Option(help="Probability that a voxel never seen is occupied.")] = 0.5,
    max_bytes: Annotated[
        int | None,
        typer.Option(parser=values.byte_count, metavar="SIZE", help="Stop before the map takes more, such as 500MB."),
    ] = None,
    min_evidence: MinEvidence = 0.0,
    camera: Annotated[
        Numbers | None,
        typer.Option(
            parser=values.intrinsics,
            metavar="FX,FY,CX,CY[,W,H]",
            help="Intrinsics in pixels, in the place of the data set's own.",
        ),
    ] = None,
    topic: Annotated[
        list[Topic] | None,
        typer.Option(
            parser=values.topic,
            metavar="ROLE=NAME",
            help="Of a ROS bag: the topic to take for depth, camera_info or pose, where there are several.",
        ),
    ] = None,
    world_frame: Annotated[
        str | None, typer.Option(metavar="NAME", help="Of a ROS bag: the frame that is the world. By default the root.")
    ] = None,
    max_gap: Annotated[
        float | None,
        typer.Option(min=0, help="Seconds from an image to the nearest pose, where poses have times of their own."),
    ] = None,
    stride: Annotated[int, typer.Option(min=1, help="Take every n-th frame.")] = 1,
    limit: Annotated[int | None, typer.Option(min=1, help="Take at most n frames.")] = None,
    colour: Annotated[
        bool,
        typer.Option("--colour", help="Keep colours too, of frames that have a colour image: meshes then have them."),
    ] = False,
    skip_bad: Annotated[bool, typer.Option("--skip-bad", help="Leave out bad frames instead of stopping.")] = False,
    view: Annotated[bool, typer.Option("--view", help="Watch in Rerun's viewer, the extra `viz`.")] = False,
    save_view: Annotated[
        Path | None,
        typer.Option(callback=recording_path, help="Record what --view shows into an .rrd file, for the viewer."),
    ] = None,
    threads: Threads = None,
    as_json: AsJson = False,
) -> None:
    """Fuse the frames of DATASET into a map, and make a mesh and pictures of it.

    Ctrl-C stops after the frame in work. With `--output` the map so far is kept, and `pyramap mesh` and `pyramap slice`
    make the rest of it. The same holds when an error ends the run early.
    """
    products = Products(output, mesh, png, inside_png, slice_png)
    check_writable([*products.paths(), save_view])
    grid = OccupancyGrid(
        resolution,
        sensor_model=_sensor_model(resolution, sigma, k, surface_offset),
        max_range=max_range,
        update=update.value,
        backend=backend.value,
        clamp=None if clamp is None else (clamp[0], clamp[1]),
        max_bytes=max_bytes,
        prior=prior,
        adapter=adapter,
        colour=colour,
    )
    topics = dict(topic or ())
    read = partial(datasets.open, dataset, skip_bad=skip_bad, max_gap=max_gap, topics=topics, world_frame=world_frame)
    own = None if camera is None else values.camera(camera, like=lambda: read().camera)
    frames = read(stride=stride, limit=limit, camera=own)
    with recorders(view, save_view) as opened:
        watcher = Watcher(opened, grid)
        run = fuse(grid, frames, len(frames), skip_bad, watcher.fused)
        watcher.end(run, min_evidence)
    if colour and run.frames and not run.coloured:
        typer.echo("warning: none of the frames has a colour image that can be fused", err=True)
    conclude(f"{frames.name} ({frames.format})", grid, run, frames.skipped, products, min_evidence, as_json, save_view)


def _sensor_model(resolution: float, sigma: Numbers | None, k: float | None, offset: str) -> SensorModel | None:
    """The model that the options name; None, the grid's own, if they name none."""
    if sigma is None and k is None and offset == NO_OFFSET:
        return None
    s0, *growth = sigma or (resolution,)
    return SensorModel((s0, growth[0], growth[1]) if growth else s0, k, values.surface_offset(offset))
