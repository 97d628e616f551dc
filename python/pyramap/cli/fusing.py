"""The loop that maps: frames into a grid, with progress, timings and a clean stop."""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import DeviceError, FrameStats, MapFullError, OccupancyGrid
from ..datasets import DatasetError, Frame
from .failures import EXPECTED_ERRORS, explain
from .interrupts import Interrupts
from .terminal import frame_progress


@dataclass(frozen=True)
class Fused:
    """A frame that the map has taken."""

    index: int
    world_from_camera: NDArray[np.float64]
    stats: FrameStats


@dataclass
class Run:
    """What happened while frames were fused.

    Attributes:
        fused: The fused frames, in order.
        integrate_seconds: Seconds of each whole call of `integrate`.
        waited_seconds: Seconds that the mapper waited for each frame: what reading costs beyond the other thread.
        rejected: Frames that the map refused and that were left out, by index, with the reason.
        interrupted: Whether Ctrl-C ended it early.
        failure: Why it ended early, if an error did.
        peak_memory_bytes: The most memory that this process had until then; None where the system does not say.
    """

    fused: list[Fused] = field(default_factory=list)
    integrate_seconds: list[float] = field(default_factory=list)
    waited_seconds: list[float] = field(default_factory=list)
    total_seconds: float = 0.0
    rejected: dict[int, str] = field(default_factory=dict)
    interrupted: bool = False
    failure: str | None = None
    peak_memory_bytes: int | None = None

    @property
    def frames(self) -> int:
        """How many frames were fused."""
        return len(self.fused)

    @property
    def ended_early(self) -> bool:
        """Whether frames may be missing."""
        return self.interrupted or self.failure is not None

    @property
    def coloured(self) -> int:
        """How many of them with their colour."""
        return sum(frame.stats.seconds["colour"] > 0 for frame in self.fused)

    @property
    def poses(self) -> list[NDArray[np.float64]]:
        """`world_from_camera` of the fused frames, (4, 4) each."""
        return [frame.world_from_camera for frame in self.fused]

    def median_ms(self) -> dict[str, float]:
        """Median milliseconds a frame: each stage, the whole call, and the wait for the frame; empty without frames.

        Frames without a stage do not count for it, such as those without colour, and stages that none had are left out,
        such as the way to a GPU that is not there.
        """
        stages: dict[str, list[float]] = defaultdict(list)
        for frame in self.fused:
            for stage, seconds in frame.stats.seconds.items():
                stages[stage] += [seconds] if seconds else []
        named = {
            **stages,
            "integrate": self.integrate_seconds,
            "wait for frame": self.waited_seconds,
        }
        return {name: 1e3 * median(seconds) for name, seconds in named.items() if seconds}


def _ignore(_frame: Frame) -> None:
    """Nobody watches."""


def fuse(
    grid: OccupancyGrid,
    frames: Iterable[Frame],
    total: int,
    skip_bad: bool = False,
    watch: Callable[[Frame], None] = _ignore,
) -> Run:
    """Fuse frames until they end, Ctrl-C is pressed, or an error comes; the map keeps what was fused until then.

    Args:
        grid: The map to fuse into.
        frames: Where the frames come from.
        total: How many are expected, for the progress bar.
        skip_bad: Leave out a frame that the map refuses, instead of ending.
        watch: Called with each frame that the map has taken.
    """
    run = Run()
    source = iter(frames)
    start = perf_counter()
    with frame_progress() as progress, Interrupts() as interrupts:
        bar = progress.add_task("mapping", total=total)
        frame = None
        try:
            while not interrupts.requested:
                asked = perf_counter()
                frame = next(source, None)
                if frame is None:
                    break
                run.waited_seconds.append(perf_counter() - asked)
                if _fuse_one(grid, frame, run, skip_bad):
                    watch(frame)
                progress.advance(bar)
            grid.synchronize()
        except (MapFullError, DeviceError) as error:
            first = _drop_unfused(run) or frame
            run.failure = explain(error) if first is None else f"frame {first.index}: {explain(error)}"
        except EXPECTED_ERRORS as error:
            run.failure = explain(error)
        run.interrupted = interrupts.requested
    run.total_seconds = perf_counter() - start
    run.peak_memory_bytes = _peak_memory()
    return run


def _fuse_one(grid: OccupancyGrid, frame: Frame, run: Run, skip_bad: bool) -> bool:
    """Whether the map has taken the frame."""
    started = perf_counter()
    try:
        stats = grid.integrate(frame.depth, frame.camera, frame.world_from_camera, **_colour_of(frame, grid))
    except (ValueError, DatasetError) as error:
        if not skip_bad:
            raise ValueError(f"frame {frame.index}: {error}") from error
        run.rejected[frame.index] = str(error)
        return False
    run.integrate_seconds.append(perf_counter() - started)
    run.fused.append(Fused(frame.index, np.array(frame.world_from_camera), stats))
    return True


def _colour_of(frame: Frame, grid: OccupancyGrid) -> dict[str, Any]:
    """What `integrate` is told of a frame's colour: nothing where the map keeps none."""
    if not grid.has_colour:
        return {}
    return {
        "colour": frame.colour,
        "colour_camera": frame.colour_camera,
        "depth_from_colour": frame.depth_from_colour,
    }


def _drop_unfused(run: Run) -> Fused | None:
    """Take out the last frames if a GPU took but could not fuse them; the first of these."""
    first = None
    while run.fused and not _is_fused(run.fused[-1].stats):
        first = run.fused.pop()
    return first


def _is_fused(stats: FrameStats) -> bool:
    try:
        return stats.saturated >= 0
    except (MapFullError, DeviceError, RuntimeError):
        return False


def _peak_memory() -> int | None:
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
