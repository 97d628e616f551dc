"""Times of the backends on the same frames, taken in turns."""

from __future__ import annotations

import platform
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter

import numpy as np

from .._core import FrameStats, OccupancyGrid, devices, num_threads
from ..datasets import Frame
from .facts import Facts

WHOLE_CALL = "integrate"


@dataclass(frozen=True)
class Contender:
    """A backend to time.

    Attributes:
        name: The device.
        make: A new, empty map on it.
    """

    name: str
    make: Callable[[], OccupancyGrid]


@dataclass
class Times:
    """What was measured of one backend, over all passes.

    Attributes:
        seconds: Of each frame, by stage; and of whole calls of `integrate`.
        passes: Frames a second of each pass, until the last frame is in the map.
        nbytes: Of the map, in the end.
    """

    seconds: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    passes: list[float] = field(default_factory=list)
    nbytes: int = 0


def usable_gpus() -> list[str]:
    """Names of the GPUs that maps can run on, without those that a processor plays."""
    return [device.name for device in devices() if device.problem is None and device.kind != "software"]


def time_in_turns(
    contenders: Sequence[Contender], frames: Sequence[Frame], passes: int, progress: Callable[[], None]
) -> dict[str, Times]:
    """Time passes over the frames, each into a new map, the backends in turns so that they share what else goes on.

    Args:
        contenders: The backends.
        frames: Already in memory.
        passes: How many of each count; one more before them warms caches and compiles shaders.
        progress: Called after each pass.
    """
    times = {contender.name: Times() for contender in contenders}
    for number in range(passes + 1):
        for contender in contenders:
            _time_pass(contender, frames, times[contender.name] if number else Times())
            progress()
    return times


def _time_pass(contender: Contender, frames: Sequence[Frame], times: Times) -> None:
    grid = contender.make()
    stats: list[FrameStats] = []
    started = perf_counter()
    for frame in frames:
        asked = perf_counter()
        stats.append(grid.integrate(frame.depth, frame.camera, frame.world_from_camera))
        times.seconds[WHOLE_CALL].append(perf_counter() - asked)
    grid.synchronize()
    times.passes.append(len(frames) / (perf_counter() - started))
    for each in stats:
        for stage, seconds in each.seconds.items():
            times.seconds[stage].append(seconds)
    times.nbytes = grid.nbytes


def times_facts(times: Times) -> Facts:
    """Medians with the quartiles about them, milliseconds a frame; stages that took no time at all are left out."""
    return {
        "frames_per_second": {
            "median": float(np.median(times.passes)),
            "least": min(times.passes),
            "most": max(times.passes),
        },
        "ms": {
            stage: dict(
                zip(("q25", "median", "q75"), (1e3 * np.quantile(seconds, [0.25, 0.5, 0.75])).tolist(), strict=True)
            )
            for stage, seconds in times.seconds.items()
            if any(seconds)
        },
        "map_bytes": times.nbytes,
    }


def machine_facts() -> Facts:
    """What this machine is."""
    return {"processor": _processor(), "threads": num_threads(), "system": f"{platform.system()} {platform.machine()}"}


def _processor() -> str:
    """Its name, as far as the system tells."""
    return next(_names_in_cpuinfo(), platform.processor() or platform.machine())


def _names_in_cpuinfo(path: Path = Path("/proc/cpuinfo")) -> Iterator[str]:
    if path.exists():
        for line in path.read_text().splitlines():
            if line.startswith("model name"):
                yield line.partition(":")[2].strip()
