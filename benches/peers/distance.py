"""`python -m peers.distance`: the distance field of a whole map beside scipy's transform, and its update after a frame.

Both transforms are exact. scipy's is of a dense array, the box around all blocks, and gives the distance outside
obstacles; pyramap's is of the sparse map as far as the radius goes, inside obstacles and outside. What a user of scipy
would have to do first, to read the map into an array, is not timed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Annotated, Literal

import numpy as np
import pyramap as pm
import typer
from numpy.typing import NDArray
from rich.table import Table
from scipy import ndimage

from . import source
from .goals import Goal
from .results import machine, wide_console

Unknown = Literal["free", "occupied"]
UNKNOWN_AS: tuple[Unknown, Unknown] = ("free", "occupied")

LAST_FRAMES = 8
"""How many frames at the end of the sequence are each taken off and fused again, to time the update after it."""


@dataclass(frozen=True)
class Times:
    """Milliseconds, a list entry a round.

    Attributes:
        unknown: What unknown voxels count as.
        threads: Of pyramap; scipy has one.
        scipy: To transform the box of the map as a dense array.
        whole: To make the field of the whole map.
        dense: To read it into a dense array of that box.
        update: To follow one more frame at the end of the sequence: the median of the last ones.
    """

    unknown: Unknown
    threads: int
    scipy: list[float]
    whole: list[float]
    dense: list[float]
    update: list[float]

    def goals(self) -> list[Goal]:
        """The ratios that were promised, with what is behind them."""
        what = f"unknown {self.unknown}, {self.threads} threads: "
        return [
            Goal(what + "whole / scipy", 1.0, _ratios(self.whole, self.scipy)),
            Goal(what + "whole and read as an array / scipy", 1.0, _ratios(_sums(self.whole, self.dense), self.scipy)),
            Goal(what + "update after one more frame / whole", 0.1, _ratios(self.update, self.whole)),
        ]


def main(
    data: Annotated[str, typer.Option(help="A data set's folder, or 'office' to simulate one.")] = "",
    frames: Annotated[
        int | None, typer.Option(min=LAST_FRAMES, help="How many, from the first on; all unless given.")
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, help="How often each is timed.")] = 15,
    voxel_size: Annotated[float, typer.Option(help="Metres.")] = 0.05,
    radius: Annotated[float, typer.Option(help="How far the field reaches, metres.")] = 1.0,
    threads: Annotated[str, typer.Option(help="Numbers of threads.")] = f"1,{os.cpu_count()}",
    out: Annotated[Path, typer.Option(help="Folder for distance.json.")] = Path("out/peers"),
) -> None:
    """Times the distance field of a whole sequence, in turns with scipy's transform."""
    console = wide_console()
    name, sequence = source.open_frames(data or source.default_data())
    sequence = sequence[:frames]
    grid = pm.OccupancyGrid(voxel_size)
    fields = [grid.distance_field(radius, unknown) for unknown in UNKNOWN_AS]
    on_the_way = map_all(grid, fields, sequence)
    last = [sequence[index] for index in range(len(sequence) - LAST_FRAMES, len(sequence))]
    counts = sorted({int(count) for count in threads.split(",")})
    times = [time_all(grid, field, last, count, rounds) for field in fields for count in counts]

    console.print(f"{name}, {len(sequence)} frames, voxels of {voxel_size:g} m, radius {radius:g} m")
    console.print(_times_table(times))
    for field, updates in zip(fields, on_the_way, strict=True):
        spread = ", ".join(f"{value:.2f}" for value in np.percentile(updates, [25, 50, 75]))
        console.print(f"updates while mapping, unknown {field.unknown}: quartiles {spread} ms")
    console.print(_goals_table([goal for each in times for goal in each.goals()]))
    out.mkdir(parents=True, exist_ok=True)
    report = {
        "data": name,
        "frames": len(sequence),
        **machine(),
        "times": [asdict(each) for each in times],
        "updates_while_mapping": {field.unknown: updates for field, updates in zip(fields, on_the_way, strict=True)},
    }
    (out / "distance.json").write_text(json.dumps(report, indent=1) + "\n")
    console.print(f"load {report['load']}; wrote {out}/distance.json")


def map_all(grid: pm.OccupancyGrid, fields: Sequence[pm.DistanceField], sequence: source.Frames) -> list[list[float]]:
    """Maps the sequence with fields that follow it; gives the milliseconds that each takes for it after each frame."""
    times: list[list[float]] = [[] for _ in fields]
    for frame in sequence:
        grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
        grid.synchronize()
        for field, updates in zip(fields, times, strict=True):
            updates.append(_milliseconds(field.update))
    return times


def time_all(
    grid: pm.OccupancyGrid, field: pm.DistanceField, last: Sequence[pm.datasets.Frame], threads: int, rounds: int
) -> Times:
    """Times the field of the finished map, in turns with scipy."""
    pm.set_num_threads(threads)
    box = grid.bounds
    assert box is not None, "the map is not empty"
    occupied = _occupied(grid, box, field.unknown)
    times = Times(field.unknown, threads, [], [], [], [])
    for _ in range(rounds):
        times.scipy.append(_milliseconds(lambda: ndimage.distance_transform_edt(~occupied, sampling=grid.voxel_size)))
        times.whole.append(_milliseconds(lambda: grid.distance_field(field.max_distance, field.unknown)))
        times.dense.append(_milliseconds(lambda: field.dense(box)))
        times.update.append(median(_update(grid, field, frame) for frame in last))
    return times


def _update(grid: pm.OccupancyGrid, field: pm.DistanceField, frame: pm.datasets.Frame) -> float:
    """After a frame that is taken off and fused again."""
    grid.remove(frame.depth, frame.camera, frame.world_from_camera)
    field.update()
    grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
    grid.synchronize()
    return _milliseconds(field.update)


def _occupied(grid: pm.OccupancyGrid, box: NDArray[np.float64], unknown: Unknown) -> NDArray[np.bool_]:
    """Where in the box anything is in the way."""
    log_odds, _ = grid.dense(box)
    occupied: NDArray[np.bool_] = log_odds > 0
    return occupied | (log_odds == 0) if unknown == "occupied" else occupied


def _milliseconds(call: Callable[[], object]) -> float:
    start = perf_counter()
    call()
    return 1e3 * (perf_counter() - start)


def _ratios(times: Sequence[float], base: Sequence[float]) -> list[float]:
    return [time / other for time, other in zip(times, base, strict=True)]


def _sums(one: Sequence[float], other: Sequence[float]) -> list[float]:
    return [a + b for a, b in zip(one, other, strict=True)]


def _times_table(times: Sequence[Times]) -> Table:
    table = Table(title="Milliseconds, median (least)", title_justify="left", title_style="bold")
    for column in ("unknown", "threads", "scipy", "whole", "read as an array", "update after a frame"):
        table.add_column(column, justify="right")
    for each in times:
        lists = (each.scipy, each.whole, each.dense, each.update)
        cells = [f"{median(values):.2f} ({min(values):.2f})" for values in lists]
        table.add_row(each.unknown, str(each.threads), *cells)
    return table


def _goals_table(goals: Sequence[Goal]) -> Table:
    table = Table(title="Ratios within a round, median", title_justify="left", title_style="bold")
    for column in ("of", "ratio", "at most", ""):
        table.add_column(column)
    for goal in goals:
        table.add_row(goal.what, f"{goal.ratio:.3f}", f"{goal.at_most:g}", "reached" if goal.reached else "missed")
    return table


if __name__ == "__main__":
    typer.run(main)
