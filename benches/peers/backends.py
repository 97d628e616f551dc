"""`python -m peers.backends`: milliseconds a frame by stage, on the CPU and on a GPU, in turns, in one run.

The frames are decoded before. Stages are timed one frame at a time; so is "whole", by the clock on the wall. In a row,
a frame is begun before the one before it is done, as `integrate` does by itself.
"""

from __future__ import annotations

import json
import os
from collections import defaultdict
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Annotated

import numpy as np
import pyramap as pm
import typer
from rich.table import Table

from . import source
from .frames import MAX_RANGE, Frame
from .results import machine, wide_console
from .systems import Backend, GpuRule, usable_adapters

TURN_FRAMES = 10
"""Frames that one backend fuses before it is the other's turn."""

WHOLE = "whole"
IN_A_ROW = "whole, in a row"

Times = dict[Backend, dict[str, list[float]]]
"""Milliseconds: of each frame, or in the case of the whole of each turn, by stage."""


def main(
    data: Annotated[str, typer.Option(help="A data set's folder, or 'office' to simulate one.")] = "",
    frames: Annotated[int, typer.Option(min=1, help="How many frames, spread over the sequence.")] = 40,
    rounds: Annotated[int, typer.Option(min=1, help="How often each backend maps them.")] = 5,
    resolutions: Annotated[str, typer.Option(help="Voxel sizes in metres.")] = "0.02,0.04,0.08,0.16",
    update: Annotated[GpuRule, typer.Option(help="The update rule.")] = "pyramid",
    adapter: Annotated[str, typer.Option(help="Part of the GPU's name; the first of all unless given.")] = "",
    out: Annotated[Path, typer.Option(help="Folder for backends.json.")] = Path("out/peers"),
) -> None:
    """Times every stage on the CPU and on a GPU."""
    try:
        name = usable_adapters(adapter)[0]
    except LookupError as error:
        raise typer.BadParameter(str(error)) from error
    console, results = wide_console(), {}
    with TemporaryDirectory() as folder:
        recorded = source.record(data or source.default_data(), Path(folder) / "frames", frames)
        images = [recorded[index] for index in range(len(recorded))]
    for size in map(float, resolutions.split(",")):
        times = time_backends(images, size, update, name, rounds)
        results[size] = times
        console.print(_table(f"{recorded.name}, {size:g} m, {update}: CPU, {os.cpu_count()} cores, and {name}", times))
    out.mkdir(parents=True, exist_ok=True)
    report = {"machine": machine(), "adapter": name, "update": update, "data": recorded.name, "ms": results}
    (out / "backends.json").write_text(json.dumps(report, indent=1) + "\n")


def time_backends(images: list[Frame], voxel_size: float, update: GpuRule, adapter: str, rounds: int) -> Times:
    """Every round maps all frames anew, twice: one at a time, and in a row. A first one warms up and is not counted."""
    height, width = images[0].depth.shape
    intrinsics = images[0].intrinsics
    fx, fy, cx, cy = (float(intrinsics[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
    camera = pm.PinholeCamera(width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy)
    turns = [images[start : start + TURN_FRAMES] for start in range(0, len(images), TURN_FRAMES)]
    times: Times = {"cpu": defaultdict(list), "gpu": defaultdict(list)}
    for number in range(2 * rounds + 1):
        maps = {
            backend: pm.OccupancyGrid(
                voxel_size,
                max_range=MAX_RANGE,
                update=update,
                backend=backend,
                adapter=adapter if backend == "gpu" else None,
            )
            for backend in times
        }
        one_at_a_time = number % 2 == 1
        for turn in turns:
            for backend, grid in maps.items():
                start, stats = perf_counter(), []
                for frame in turn:
                    stats.append(grid.integrate(frame.depth, camera, frame.world_from_camera))
                    if one_at_a_time:
                        grid.synchronize()
                grid.synchronize()
                ms = 1e3 * (perf_counter() - start) / len(turn)
                if number == 0:
                    continue
                times[backend][WHOLE if one_at_a_time else IN_A_ROW].append(ms)
                for stage, seconds in (item for one in stats if one_at_a_time for item in one.seconds.items()):
                    times[backend][stage].append(1e3 * seconds)
    return times


def _table(title: str, times: Times) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column("ms a frame")
    for backend in times:
        table.add_column(f"{backend}: median (quartiles)", justify="right")
    table.add_column("gpu / cpu", justify="right")
    wholes = [WHOLE, IN_A_ROW]
    for stage in [stage for stage in times["gpu"] if stage not in wholes] + wholes:
        cells = [_spread(times[backend][stage]) for backend in times]
        cpu, gpu = (median(times[backend][stage]) for backend in times)
        table.add_row(stage, *cells, f"{gpu / cpu:.2f}" if cpu > 0 else "")
    return table


def _spread(values: list[float]) -> str:
    low, middle, high = np.percentile(values, [25, 50, 75])
    return f"{middle:.3f} ({low:.3f} to {high:.3f})"


if __name__ == "__main__":
    typer.run(main)
