"""Progress on stderr, shown only where someone watches."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text


class _RateColumn(ProgressColumn):
    def __init__(self, unit: str) -> None:
        super().__init__()
        self.unit = unit

    def render(self, task: Task) -> Text:
        """Frames, or what else is counted, a second, once known."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.1f} {self.unit}/s")


def frame_progress(unit: str = "frames") -> Progress:
    """A bar with count, rate and time left; nothing at all where stderr is no terminal."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        _RateColumn(unit),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        disable=not _is_watched(),
    )


@contextmanager
def working_on(what: str) -> Iterator[None]:
    """Say what goes on during a step without countable parts."""
    if not _is_watched():
        yield
        return
    with Console(stderr=True).status(what):
        yield


def _is_watched() -> bool:
    # Not Rich's own notion, which FORCE_COLOR and the like make true for files and pipes.
    return sys.stderr.isatty()
