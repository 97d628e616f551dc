"""Table 1: time and memory for the indoor walk at four resolutions."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from . import charts
from .section import Section, Table
from .walk import FRAMES, Walk

PAPER: dict[float, tuple[float, float]] = {
    0.02: (408, 4.23),
    0.04: (90.6, 0.99),
    0.08: (48.6, 0.30),
    0.16: (34.2, 0.06),
}
"""The paper's Table 1 by voxel size in metres: seconds and GB for 684 frames of its own office loop."""


@dataclass(frozen=True)
class Row:
    """One resolution.

    Attributes:
        voxel_size: Metres.
        frames: How many were mapped.
        seconds: That they took.
        nbytes: Of the map.
    """

    voxel_size: float
    frames: int
    seconds: float
    nbytes: int

    @property
    def seconds_of_all(self) -> float:
        """What the whole walk takes at this pace."""
        return self.seconds / self.frames * FRAMES


def compute(walk: Walk) -> list[Row]:
    """Read off the runs."""
    return [Row(run.grid.voxel_size, len(walk.frames), run.seconds, run.grid.nbytes) for run in walk.runs]


def draw(rows: list[Row]) -> Figure:
    """Time and memory over the voxel size, beside the paper's; both scales logarithmic."""
    figure = charts.figure(3.8)
    time, memory = figure.subplots(1, 2)
    sizes = [row.voxel_size for row in rows]
    _draw_pair(time, sizes, [row.seconds_of_all for row in rows], [PAPER[size][0] for size in sizes])
    time.set_ylabel(f"time for {FRAMES} frames (s)")
    _draw_pair(memory, sizes, [row.nbytes / 1e9 for row in rows], [PAPER[size][1] for size in sizes])
    memory.set_ylabel("memory of the map (GB)")
    time.legend(loc="upper right")
    return figure


def _draw_pair(axes: Axes, sizes: list[float], ours: list[float], papers: list[float]) -> None:
    axes.plot(sizes, papers, "s--", color=charts.BLUE, label="the paper, a GPU of 2011")
    axes.plot(sizes, ours, "o-", color=charts.VERMILION, label="pyramap, here")
    axes.set(xscale="log", yscale="log", xlabel="edge of a voxel (m)")
    axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
    axes.minorticks_off()
    axes.grid(alpha=0.3)


def section(rows: list[Row], walk: Walk) -> Section:
    """For the page."""
    grid = walk.runs[0].grid
    papers = [PAPER[row.voxel_size] for row in rows]
    return Section(
        name="table1",
        title="Table 1: time and memory",
        figures={"table1": draw(rows)},
        results={
            "frames": len(walk.frames),
            "backend": grid.backend,
            "threads": walk.threads,
            "rows": [
                {
                    "voxel_size_m": row.voxel_size,
                    "seconds": row.seconds,
                    f"seconds_of_{FRAMES}_frames": row.seconds_of_all,
                    "bytes": row.nbytes,
                    "paper_seconds": seconds,
                    "paper_bytes": gigabytes * 1e9,
                }
                for row, (seconds, gigabytes) in zip(rows, papers, strict=True)
            ],
        },
        values={
            "frames": str(len(walk.frames)),
            "all": str(FRAMES),
            "backend": grid.backend,
            "threads": f"{walk.threads} threads",
            "max_range": f"{grid.max_range:g}",
        },
        table=Table(
            ["", *(f"{row.voxel_size:g} m" for row in rows)],
            [
                ["the paper: time (min)", *(f"{seconds / 60:.2f}" for seconds, _ in papers)],
                [f"here: time of {FRAMES} frames (min)", *(f"{row.seconds_of_all / 60:.2f}" for row in rows)],
                ["the paper: frames a second", *(f"{FRAMES / seconds:.1f}" for seconds, _ in papers)],
                ["here: frames a second", *(f"{row.frames / row.seconds:.0f}" for row in rows)],
                ["the paper: memory (GB)", *(f"{gigabytes:.2f}" for _, gigabytes in papers)],
                ["here: memory (GB)", *(f"{row.nbytes / 1e9:.4f}" for row in rows)],
            ],
        ),
    )
