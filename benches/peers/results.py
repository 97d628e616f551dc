"""All that one run measured, as tables on the terminal and as JSON."""

from __future__ import annotations

import json
import os
import platform
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import Any

from rich.console import Console
from rich.table import Table

from .accuracy import Errors
from .footprint import Footprint
from .goals import Goal
from .systems import OPEN3D, PYOCTOMAP, SYSTEMS, Rule
from .turns import MeshTimes, Turns

CPU_INFO = Path("/proc/cpuinfo")
TABLE_WIDTH = 132


@dataclass
class Results:
    """Of one run.

    Attributes:
        settings: What was compared, on which machine.
        turns: Times, one of each voxel size.
        footprints: By voxel size and name.
        errors: By voxel size and rule; empty if they were not asked for.
        meshes: Of the smallest voxel size.
        goals: The ratios that are told apart.
    """

    settings: dict[str, Any]
    turns: list[Turns]
    footprints: dict[float, dict[str, Footprint]]
    errors: dict[float, dict[Rule, Errors]]
    meshes: MeshTimes
    goals: list[Goal]

    def print(self, console: Console) -> None:
        """Every table."""
        for turns in self.turns:
            console.print(self._times(turns))
        for table in (self._memory(), self._meshes(), self._accuracy(), self._goals()):
            if table.row_count:
                console.print(table)

    def save(self, path: Path) -> None:
        """Everything that the tables show, and the median of each round."""
        path.write_text(json.dumps(self._plain(), indent=1) + "\n")

    def _times(self, turns: Turns) -> Table:
        table = _table(f"{turns.voxel_size:g} m: ms a frame", "system", "threads", "median", "quartiles")
        most = max((threads for _, threads in turns.times), default=1)
        bases = [key for key in ((OPEN3D.name, most), (PYOCTOMAP.name, 1)) if key in turns.times]
        for name, threads in bases:
            table.add_column(f"/ {name}, {threads}T", justify="right")
        table.add_column("frames", justify="right")
        for key, times in turns.times.items():
            low, middle, high = turns.quartiles_ms(key)
            ratios = [f"{median(turns.ratios(key, base)):.3g}" for base in bases]
            fused = str(sum(len(round) for round in times))
            table.add_row(key[0], str(key[1]), f"{middle:.2f}", f"{low:.2f} to {high:.2f}", *ratios, fused)
        return table

    def _memory(self) -> Table:
        table = _table("Alone, all frames: MB", "voxel", "system", "map", "peak of the process", "risen by")
        for size, footprints in self.footprints.items():
            for name, footprint in footprints.items():
                peak, rise = footprint.memory
                table.add_row(f"{size:g} m", name, _mb(footprint.map_bytes, 2), _mb(peak), _mb(rise))
        return table

    def _meshes(self) -> Table:
        table = _table("Mesh at the smallest voxel size", "system", "threads", "triangles", "ms", "ns a triangle")
        for key, seconds in self.meshes.seconds.items():
            each = median(self.meshes.ns_per_triangle(key))
            triangles = f"{self.meshes.triangles[key]:,}"
            table.add_row(key[0], str(key[1]), triangles, f"{1e3 * median(seconds):.1f}", f"{each:.0f}")
        return table

    def _accuracy(self) -> Table:
        table = _table("Error to the ideal", "voxel", "rule", "mean |dp|", "99 %", "mean / pyramid")
        for column in ("mean where known", "missed", "added"):
            table.add_column(column, justify="right")
        for size, errors in self.errors.items():
            for rule, of in errors.items():
                row = f"{of.mean:.5f}", f"{of.p99:.3f}", f"{of.to_pyramid:.3f}", f"{of.mean_where_known:.5f}"
                table.add_row(f"{size:g} m", rule, *row, f"{of.missed:.1%}", f"{of.added:.1%}")
        return table

    def _goals(self) -> Table:
        table = _table("Ratios", "ratio of medians", "goal", "measured", "lowest to highest", "reached")
        for goal in self.goals:
            spread = f"{min(goal.ratios):.3g} to {max(goal.ratios):.3g}"
            reached = "[green]yes" if goal.reached else "[red]no"
            table.add_row(goal.what, f"{goal.at_most:.3g}", f"{goal.ratio:.3g}", spread, reached)
        return table

    def _plain(self) -> dict[str, Any]:
        return {
            **self.settings,
            "times": [
                {
                    "voxel_size": turns.voxel_size,
                    "system": key[0],
                    "threads": key[1],
                    "quartiles_ms": turns.quartiles_ms(key),
                    "round_medians_ms": turns.round_medians_ms(key),
                    "round_frames": [len(round) for round in turns.times[key]],
                }
                for turns in self.turns
                for key in turns.times
            ],
            "footprints": [
                {
                    "voxel_size": size,
                    "system": name,
                    "map_bytes": footprint.map_bytes,
                    "peak_bytes": footprint.memory.peak,
                    "rise_bytes": footprint.memory.rise,
                }
                for size, footprints in self.footprints.items()
                for name, footprint in footprints.items()
            ],
            "errors": [
                {"voxel_size": size, "rule": rule, **asdict(errors)}
                for size, rules in self.errors.items()
                for rule, errors in rules.items()
            ],
            "meshes": [
                {"system": key[0], "threads": key[1], "triangles": self.meshes.triangles[key], "seconds": seconds}
                for key, seconds in self.meshes.seconds.items()
            ],
            "ratios": [{**asdict(goal), "ratio": goal.ratio, "reached": goal.reached} for goal in self.goals],
        }


def wide_console() -> Console:
    """Wide enough for the tables, whatever the terminal or file says."""
    return Console(width=max(Console().width, TABLE_WIDTH))


def machine() -> dict[str, Any]:
    """What the run depends on beside the settings: processor, load, date and versions."""
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": {
            "processor": _processor(),
            "cpus": os.cpu_count(),
            "system": platform.platform(),
            "python": platform.python_version(),
        },
        "load": load(),
        "versions": {package: _version(package) for package in dict.fromkeys(each.package for each in SYSTEMS)},
    }


def load() -> float | None:
    """How many processes wanted to run, on average over the last minute; None on Windows."""
    return round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _processor() -> str:
    if CPU_INFO.exists():
        for line in CPU_INFO.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor()


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold")
    for number, column in enumerate(columns):
        words = column in ("system", "rule", "ratio of medians") or number == 0
        table.add_column(column, justify="left" if words else "right", no_wrap=words)
    return table


def _mb(nbytes: int | None, digits: int = 0) -> str:
    return "?" if nbytes is None else f"{nbytes / 1e6:.{digits}f}"
