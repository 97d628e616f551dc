"""`python -m peers`: times every system on the same frames, and writes tables, JSON and a plot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer
from rich.console import Console

from . import source
from .accuracy import compare_rules
from .footprint import measure_all
from .frames import FrameFile
from .goals import goals
from .plot import save_plot
from .results import Results, load, machine, wide_console
from .systems import OPEN3D, PYRAMID, SYSTEMS, System
from .turns import MeshTimes, Turns, time_frames, time_meshes
from .worker import open_workers

ACCURACY_FRAMES = 3
"""Of how many frames the errors are taken; the ideal is slow."""


def main(
    data: Annotated[str, typer.Option(help="A data set's folder, or 'office' to simulate one.")] = "",
    frames: Annotated[int, typer.Option(min=1, help="How many frames, spread over the sequence.")] = 40,
    rounds: Annotated[int, typer.Option(min=1, help="How often each system maps them.")] = 5,
    resolutions: Annotated[str, typer.Option(help="Voxel sizes in metres.")] = "0.02,0.04,0.08,0.16",
    threads: Annotated[str, typer.Option(help="Numbers of threads.")] = "1,2",
    systems: Annotated[str, typer.Option(help="Only systems whose names begin with one of these.")] = "",
    out: Annotated[Path, typer.Option(help="Folder for results.json and frame_times.png.")] = Path("out/peers"),
) -> None:
    """Compares pyramap with Open3D and OctoMap on the same frames, in turns, in one run."""
    console = wide_console()
    sizes = [float(size) for size in resolutions.split(",")]
    counts = sorted(int(count) for count in threads.split(","))
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder:
        recorded = source.record(data or source.default_data(), Path(folder) / "depth", frames)
        console.print(f"{len(recorded)} frames of {recorded.name}, {rounds} rounds, voxels of {resolutions} m")
        usable = _usable(
            [each for each in SYSTEMS if each.name.startswith(tuple(systems.split(",")))], recorded, console
        )
        settings = {"data": recorded.name, "frames": len(recorded), "rounds": rounds, **machine()}
        turns = [_time(usable, counts, size, recorded, rounds, console) for size in sizes]
        meshes = _mesh(usable, counts, min(sizes), recorded, rounds)
        settings["load_at_end"] = load()
        console.print("memory and accuracy")
        footprints = measure_all(usable, sizes, recorded)
        errors = {size: compare_rules(recorded, min(ACCURACY_FRAMES, len(recorded)), size) for size in sizes}
    results = Results(settings, turns, footprints, errors, meshes, goals(turns, meshes, errors, max(counts)))
    results.print(console)
    results.save(out / "results.json")
    save_plot(out / "frame_times.png", f"{recorded.name}, {len(recorded)} frames", turns)
    console.print(f"load {settings['load']} before, {settings['load_at_end']} after (1 is this run alone)")
    console.print(f"wrote {out}/results.json and {out}/frame_times.png")


def _usable(systems: Sequence[System], frames: FrameFile, console: Console) -> list[System]:
    """Those that are installed and fuse a frame; of the others it is said why they are left out."""
    usable = []
    for system in systems:
        try:
            with open_workers([(system, 1)], frames) as (worker,):
                worker.new_map(system.finest or 0.16)
                worker.fuse([0])
            usable.append(system)
        except RuntimeError as error:
            console.print(f"left out: {error}", style="yellow")
    if not usable:
        raise typer.BadParameter("none of the systems asked for can be run")
    return usable


def _time(
    systems: Sequence[System], threads: Sequence[int], size: float, frames: FrameFile, rounds: int, console: Console
) -> Turns:
    pairs = [
        (system, count) for system in systems if system.affords(size) for count in (threads if system.parallel else [1])
    ]
    with open_workers(pairs, frames) as workers, console.status("") as status:
        return time_frames(workers, size, len(frames), rounds, status.update)


def _mesh(systems: Sequence[System], threads: Sequence[int], size: float, frames: FrameFile, rounds: int) -> MeshTimes:
    pairs = [(system, count) for system in (PYRAMID, OPEN3D) if system in systems for count in threads]
    with open_workers(pairs, frames) as workers:
        return time_meshes(workers, size, len(frames), rounds)


if __name__ == "__main__":
    typer.run(main)
