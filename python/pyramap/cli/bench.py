"""`pyramap bench`: how fast this machine maps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from .. import __version__, datasets, scenes
from .._core import OccupancyGrid
from ..datasets import Frame
from .benching import WHOLE_CALL, Contender, machine_facts, time_in_turns, times_facts, usable_gpus
from .facts import Facts
from .options import DATASET_HELP, AdapterChoice, AsJson, Threads
from .summary import print_columns, print_json
from .terminal import frame_progress, working_on
from .values import Backend, Update

_NOISE_SEED = 1
_OFFICE_STRIDE = 7
"""The walk through the office has 684 views; these steps take the usual number of frames through most of it."""


def bench(
    dataset: Annotated[
        Path | None,
        typer.Argument(metavar="DATASET", help=f"{DATASET_HELP} By default a simulated office.", show_default=False),
    ] = None,
    resolution: Annotated[float, typer.Option("--resolution", "-r", help="Edge of a voxel, metres.")] = 0.05,
    update: Annotated[Update, typer.Option(help="How a voxel's log-odds come from the image.")] = Update.pyramid,
    backend: Annotated[
        Backend, typer.Option(help="What to time; auto is the CPU and every GPU that there is.")
    ] = Backend.auto,
    adapter: AdapterChoice = None,
    limit: Annotated[int, typer.Option(min=1, help="Take at most n frames.")] = 90,
    stride: Annotated[int, typer.Option(min=1, help="Take every n-th frame of DATASET.")] = 1,
    passes: Annotated[int, typer.Option(min=1, help="Passes that count; one before them does not.")] = 3,
    threads: Threads = None,
    as_json: AsJson = False,
) -> None:
    """Time the mapping of DATASET, or of a simulated office, on this machine's processor and GPUs.

    All frames are read before the clock runs. The backends take turns, each pass begins a new map, and the first one
    warms up. Times are medians over the frames of all passes, with the quartiles about them. On a GPU the stages of one
    frame overlap with those of the next: frames a second say what counts.
    """
    name, frames = _frames(dataset, stride, limit)
    contenders = _contenders(
        backend,
        adapter,
        lambda kind, device: OccupancyGrid(resolution, update=update.value, backend=kind, adapter=device),
    )
    with frame_progress("passes") as progress:
        bar = progress.add_task("timing", total=len(contenders) * (passes + 1))
        times = time_in_turns(contenders, frames, passes, lambda: progress.advance(bar))
    depth = frames[0].depth
    facts = {
        "version": __version__,
        "machine": machine_facts(),
        "data": {"name": name, "frames": len(frames), "width": depth.shape[1], "height": depth.shape[0]},
        "voxel_size": resolution,
        "update": update.value,
        "passes": passes,
        "backends": {device: times_facts(measured) for device, measured in times.items()},
    }
    if as_json:
        print_json(facts)
    else:
        _print(facts)


def _frames(dataset: Path | None, stride: int, limit: int) -> tuple[str, list[Frame]]:
    """A name, and frames in memory."""
    with working_on("reading the frames"):
        if dataset is None:
            office = scenes.office_loop()
            return f"{office.name} (simulated)", list(office.frames(noise=_NOISE_SEED)[::_OFFICE_STRIDE][:limit])
        opened = datasets.open(dataset, stride=stride, limit=limit)
        return f"{opened.name} ({opened.format})", list(opened)


def _contenders(
    backend: Backend, adapter: str | None, make: Callable[[Literal["cpu", "gpu"], str | None], OccupancyGrid]
) -> list[Contender]:
    """What to time, as asked for.

    Raises:
        DeviceNotFoundError: A GPU is asked for, and there is none.
    """
    if adapter is not None:
        grid = make("gpu", adapter)
        return [Contender(grid.adapter or adapter, partial(make, "gpu", adapter))]
    gpus = [] if backend is Backend.cpu else usable_gpus()
    if backend is Backend.gpu and not gpus:
        make("gpu", None)  # raises, and says what there is
    cpu = [] if backend is Backend.gpu else [Contender("CPU", partial(make, "cpu", None))]
    return cpu + [Contender(name, partial(make, "gpu", name)) for name in gpus]


def _print(facts: Facts) -> None:
    machine, data, backends = facts["machine"], facts["data"], facts["backends"]
    typer.echo(f"{machine['processor']}, {machine['threads']} threads, {machine['system']}, pyramap {facts['version']}")
    typer.echo(
        f"{data['name']}, {data['frames']} frames of {data['width']} x {data['height']}; voxels of "
        f"{facts['voxel_size']:g} m, update rule {facts['update']}; passes: {facts['passes']}"
    )
    rows = [
        (
            "frames/s (least to most)",
            *("{median:.1f} ({least:.1f} to {most:.1f})".format(**b["frames_per_second"]) for b in backends.values()),
        )
    ]
    stages = dict.fromkeys(stage for b in backends.values() for stage in b["ms"])
    for stage in stages:
        measured = (b["ms"].get(stage) for b in backends.values())
        cells = ("" if ms is None else "{median:.2f} ({q25:.2f} to {q75:.2f})".format(**ms) for ms in measured)
        rows.append((f"{'whole call' if stage == WHOLE_CALL else stage} (ms)", *cells))
    rows.append(("map (MB)", *(f"{b['map_bytes'] / 1e6:.1f}" for b in backends.values())))
    print_columns(("", *backends), rows)
