"""`python -m peers.queries`: rays and points asked of pyramap, and of OctoMap with the same map.

OctoMap's tree is given the state of each voxel that pyramap knows, and pruned. It has no batch call: its `castRay` and
`search` are called in a loop, as users do. Rays start in free space and go all ways, points lie all over the map. What
pyramap finds out for rays in the first call after a change, and keeps, is not timed: some microseconds a block.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Annotated, Any, Literal

import numpy as np
import pyramap as pm
import typer
from numpy.typing import NDArray
from rich.table import Table

from . import source
from .frames import MAX_RANGE
from .goals import Goal
from .results import machine, wide_console

Floats = NDArray[np.float64]
Unknown = Literal["stop", "pass"]
RAYS: tuple[Unknown, Unknown] = ("stop", "pass")
OCTOMAP = "pyoctomap"
LOOPED = 4_000
"""How many rays or points OctoMap is asked in a round."""
AT_MOST = 1 / 50
"""Of OctoMap's time for a question."""


@dataclass(frozen=True)
class Questions:
    """Rays (N, 3), of lengths one, and points (N, 3); metres."""

    origins: Floats
    directions: Floats
    points: Floats


@dataclass(frozen=True)
class Times:
    """Nanoseconds for a question, an entry a round.

    Attributes:
        question: What was asked.
        threads: Of pyramap; OctoMap has one.
        pyramap: In one call.
        octomap: In a loop; empty if it is not installed.
        mean_distance: Of the rays that were stopped, metres.
        alike: Of the answers, how many are the same, as a share.
    """

    question: str
    threads: int
    pyramap: list[float]
    octomap: list[float]
    mean_distance: float | None
    alike: float | None

    def goal(self) -> Goal | None:
        """The ratio that was promised."""
        if not self.octomap:
            return None
        ratios = [ours / theirs for ours, theirs in zip(self.pyramap, self.octomap, strict=True)]
        return Goal(f"{self.question}, {self.threads} threads", AT_MOST, ratios)


def main(
    data: Annotated[str, typer.Option(help="A data set's folder, or 'office' to simulate one.")] = "",
    frames: Annotated[int | None, typer.Option(min=1, help="How many, spread over the sequence.")] = None,
    count: Annotated[int, typer.Option(min=1, help="How many rays and points pyramap is asked at a time.")] = 200_000,
    rounds: Annotated[int, typer.Option(min=1, help="How often each is timed.")] = 9,
    voxel_size: Annotated[float, typer.Option(help="Metres.")] = 0.05,
    threads: Annotated[str, typer.Option(help="Numbers of threads.")] = f"1,{os.cpu_count()}",
    out: Annotated[Path, typer.Option(help="Folder for queries.json.")] = Path("out/peers"),
) -> None:
    """Times rays and points in turns."""
    console = wide_console()
    name, sequence = source.open_frames(data or source.default_data())
    chosen = np.linspace(0, len(sequence), frames or len(sequence), endpoint=False).astype(int)
    grid = pm.OccupancyGrid(voxel_size)
    for index in chosen:
        frame = sequence[int(index)]
        grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
    try:
        tree = octomap_of(grid)
    except ImportError as error:
        console.print(f"left out: {OCTOMAP}: {error}", style="yellow")
        tree = None
    questions = ask_of(grid, count)
    counts = sorted({int(each) for each in threads.split(",")})
    times = [each for number in counts for each in time_all(grid, tree, questions, number, rounds)]

    console.print(f"{name}, {len(chosen)} frames, voxels of {voxel_size:g} m, {grid.num_observed:,} known")
    console.print(_table(times))
    out.mkdir(parents=True, exist_ok=True)
    report = {
        "data": name,
        "frames": len(chosen),
        "questions": count,
        **machine(),
        "times": [asdict(each) for each in times],
        "ratios": [{**asdict(goal), "ratio": goal.ratio, "reached": goal.reached} for goal in _goals(times)],
    }
    (out / "queries.json").write_text(json.dumps(report, indent=1) + "\n")
    console.print(f"load {report['load']}; wrote {out}/queries.json")


def octomap_of(grid: pm.OccupancyGrid) -> Any:
    """OctoMap's tree with the same voxels occupied, free and unknown."""
    tree: Any = import_module(OCTOMAP).OcTree(grid.voxel_size)
    for voxels, occupied in ((grid.free_voxels(), False), (grid.occupied_voxels(), True)):
        for centre in grid.voxel_centres(voxels):
            # Not lazily, so that voxels of one state are pruned: the tree is then as small and fast as can be.
            tree.updateNode(centre, occupied, False)
    return tree


def ask_of(grid: pm.OccupancyGrid, count: int) -> Questions:
    """Rays from all over the free space, in all directions; points all over the box around the map."""
    rng = np.random.default_rng(0)
    start = grid.voxel_centres(rng.choice(grid.free_voxels(), count))
    directions = rng.standard_normal((count, 3))
    assert grid.bounds is not None, "the map is not empty"
    low, high = grid.bounds
    return Questions(
        start + grid.voxel_size * rng.uniform(-0.5, 0.5, (count, 3)),
        directions / np.linalg.norm(directions, axis=1, keepdims=True),
        rng.uniform(low, high, (count, 3)),
    )


def time_all(grid: pm.OccupancyGrid, tree: Any, asked: Questions, threads: int, rounds: int) -> Iterator[Times]:
    """Rays that unknown voxels stop, rays that they let pass, and points; `tree` may be None."""
    pm.set_num_threads(threads)
    some = Questions(*(each[:LOOPED] for each in (asked.origins, asked.directions, asked.points)))
    for unknown in RAYS:

        def cast(unknown: Unknown = unknown) -> pm.RayHits:
            return grid.cast_rays(asked.origins, asked.directions, MAX_RANGE, unknown)

        def cast_in_a_loop(unknown: Unknown = unknown) -> list[bool]:
            return [hit for hit, _ in octomap_rays(tree, some, unknown)]

        hits = cast()
        ours, theirs = _in_turns(cast, len(hits), cast_in_a_loop if tree else None, rounds)
        mean = float(hits.distance[np.isfinite(hits.distance)].mean())
        alike = _rays_alike(grid, hits, octomap_rays(tree, some, unknown)) if tree else None
        yield Times(f"rays, unknown: {unknown}", threads, ours, theirs, mean, alike)

    def search() -> NDArray[np.int8]:
        return grid.state(asked.points)

    def search_in_a_loop() -> list[int]:
        return [*octomap_points(tree, some)]

    ours, theirs = _in_turns(search, len(asked.points), search_in_a_loop if tree else None, rounds)
    alike = float(np.mean(search()[:LOOPED] == search_in_a_loop())) if tree else None
    yield Times("points", threads, ours, theirs, None, alike)


def octomap_rays(tree: Any, asked: Questions, unknown: Unknown) -> Iterator[tuple[bool, Floats]]:
    """Whether an occupied voxel stopped each ray; and the voxel's centre, to be read before the next ray is cast."""
    end = np.zeros(3)
    passes = unknown == "pass"
    for origin, direction in zip(asked.origins, asked.directions, strict=True):
        yield tree.castRay(origin, direction, end, ignoreUnknownCells=passes, maxRange=MAX_RANGE), end


def octomap_points(tree: Any, asked: Questions) -> Iterator[int]:
    """States of points as pyramap has them."""
    for point in asked.points:
        node = tree.search(point)
        yield -1 if node is None else int(tree.isNodeOccupied(node))


def _rays_alike(grid: pm.OccupancyGrid, hits: pm.RayHits, theirs: Iterator[tuple[bool, Floats]]) -> float:
    """How many rays are stopped by the same occupied voxel, or in both maps by none."""
    centres = grid.voxel_centres(hits.voxel)
    near = 0.1 * grid.voxel_size
    alike = [
        hit == (state == 1) and (not hit or np.abs(end - centre).max() < near)
        for (hit, end), state, centre in zip(theirs, hits.state, centres, strict=False)
    ]
    return float(np.mean(alike))


def _in_turns(
    ours: Callable[[], object], count: int, theirs: Callable[[], object] | None, rounds: int
) -> tuple[list[float], list[float]]:
    """Nanoseconds for a question, of each round."""
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(rounds):
        times[0].append(_nanoseconds(ours) / count)
        if theirs:
            times[1].append(_nanoseconds(theirs) / LOOPED)
    return times


def _nanoseconds(call: Callable[[], object]) -> float:
    start = perf_counter()
    call()
    return 1e9 * (perf_counter() - start)


def _goals(times: Sequence[Times]) -> list[Goal]:
    return [goal for each in times if (goal := each.goal())]


def _table(times: Sequence[Times]) -> Table:
    table = Table(title="Nanoseconds for a question, median (least)", title_justify="left", title_style="bold")
    for column in ("question", "threads", "mean distance", "pyramap", OCTOMAP, "times as fast", "reached", "alike"):
        table.add_column(column, justify="left" if column == "question" else "right", no_wrap=True)
    for each in times:
        cells = [
            f"{median(values):,.0f} ({min(values):,.0f})" if values else "" for values in (each.pyramap, each.octomap)
        ]
        mean = "" if each.mean_distance is None else f"{each.mean_distance:.2f} m"
        goal = each.goal()
        ratio = [f"{1 / goal.ratio:.1f}", "yes" if goal.reached else "no"] if goal else ["", ""]
        alike = "" if each.alike is None else f"{each.alike:.4%}"
        table.add_row(each.question, str(each.threads), mean, *cells, *ratio, alike)
    return table


if __name__ == "__main__":
    typer.run(main)
