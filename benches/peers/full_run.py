"""`python -m peers.full_run`: whole sequences with pyramap, beside the paper's Table 1.

Reading and rendering are not timed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import typer
from pyramap.paper.table1 import PAPER
from rich.table import Table

from . import source
from .footprint import Footprint, measure
from .frames import FrameFile
from .results import machine, wide_console
from .systems import CLAMPED, PYRAMID, System

ROOM_VOXEL_SIZE = 0.02
"""Metres: how finely the data set is mapped."""


@dataclass(frozen=True)
class Run:
    """One sequence mapped by one system in a process of its own."""

    sequence: str
    frames: int
    system: str
    voxel_size: float
    footprint: Footprint

    @property
    def seconds(self) -> float:
        """Of all frames."""
        return sum(self.footprint.seconds)

    def plain(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "sequence": self.sequence,
            "frames": self.frames,
            "system": self.system,
            "voxel_size": self.voxel_size,
            "seconds": self.seconds,
            "median_ms": 1e3 * median(self.footprint.seconds),
            "map_bytes": self.footprint.map_bytes,
            "peak_bytes": self.footprint.memory.peak,
            "rise_bytes": self.footprint.memory.rise,
        }


def main(
    data: Annotated[str, typer.Option(help="A data set's folder, or 'office' for none beside the office loop.")] = "",
    frames: Annotated[int | None, typer.Option(min=1, help="How many frames, spread; all unless given.")] = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads.")] = os.cpu_count() or 1,
    out: Annotated[Path, typer.Option(help="Folder for full_run.json.")] = Path("out/peers"),
) -> None:
    """Maps the simulated office at the paper's resolutions, and a data set with and without clamping."""
    out.mkdir(parents=True, exist_ok=True)
    console = wide_console()
    runs = _map_all(source.OFFICE, frames, [(PYRAMID, size) for size in PAPER], threads)
    room = data or source.default_data()
    if room != source.OFFICE:
        runs += _map_all(room, frames, [(system, ROOM_VOXEL_SIZE) for system in (PYRAMID, CLAMPED)], threads)
    console.print(_table(runs))
    settings = {"threads": threads, **machine()}
    text = json.dumps({**settings, "runs": [run.plain() for run in runs]}, indent=1)
    (out / "full_run.json").write_text(text + "\n")
    console.print(f"{threads} threads, load {settings['load']}; wrote {out}/full_run.json")


def _map_all(data: str, count: int | None, cases: Sequence[tuple[System, float]], threads: int) -> list[Run]:
    with TemporaryDirectory() as folder:
        frames: FrameFile = source.record(data, Path(folder) / "depth", count)
        return [
            Run(frames.name, len(frames), system.name, size, measure(system, size, frames, threads))
            for system, size in cases
        ]


def _table(runs: Sequence[Run]) -> Table:
    table = Table(title="Whole sequences", title_justify="left", title_style="bold")
    for column in ("sequence", "system", "voxel"):
        table.add_column(column, no_wrap=True)
    for column in ("frames", "s", "frames/s", "map MB", "peak MB", "paper s", "paper GB"):
        table.add_column(column, justify="right")
    for run in runs:
        paper = PAPER[run.voxel_size] if run.sequence == runs[0].sequence else ("", "")
        peak = run.footprint.memory.peak
        table.add_row(
            run.sequence,
            run.system,
            f"{run.voxel_size:g} m",
            str(run.frames),
            f"{run.seconds:.2f}",
            f"{run.frames / run.seconds:.0f}",
            f"{run.footprint.map_bytes / 1e6:.2f}",
            "?" if peak is None else f"{peak / 1e6:.0f}",
            *(str(figure) for figure in paper),
        )
    return table


if __name__ == "__main__":
    typer.run(main)
