"""A run shown in the viewer, or recorded for it, while it goes on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from .. import viewer
from .._core import OccupancyGrid
from ..datasets import Frame
from .fusing import Run
from .outputs import written_whole
from .terminal import working_on

if TYPE_CHECKING:
    from ..viewer.recorder import Recorder

_MAP_EVERY = 30
"""Frames from one picture of the voxels to the next: a second of most cameras."""


@contextmanager
def recorders(live: bool, save: Path | None, frames: bool = True) -> Iterator[list[Recorder]]:
    """The viewer, a file, both or none; the file stands there once the block ends well.

    Args:
        live: Show in the viewer.
        save: The file.
        frames: Whether frames will be shown.

    Raises:
        ViewerError: The viewer cannot be used.
    """
    with ExitStack() as stack:
        opened = []
        if live:
            opened.append(stack.enter_context(viewer.live(frames=frames)))
        if save is not None:
            temporary = stack.enter_context(written_whole(save))
            opened.append(stack.enter_context(viewer.saving(temporary, frames=frames)))
        yield opened


@dataclass
class Watcher:
    """Shows a map as it grows.

    Attributes:
        recorders: Where to; none: nothing is done.
        grid: The map.
        frames: How many were shown.
    """

    recorders: list[Recorder]
    grid: OccupancyGrid
    frames: int = 0

    def fused(self, frame: Frame) -> None:
        """Show a frame that the map has taken, and now and then the map."""
        for recorder in self.recorders:
            recorder.show_frame(frame)
            if self.frames % _MAP_EVERY == 0:
                recorder.show_map(self.grid)
        self.frames += 1

    def end(self, run: Run, min_evidence: float) -> None:
        """Show the map as it has become; its surface too, unless the run ended early: who pressed Ctrl-C waits."""
        if not self.recorders or self.frames == 0:
            return
        with working_on("showing the map"):
            mesh = None if run.ended_early else self.grid.mesh(min_evidence=min_evidence)
            for recorder in self.recorders:
                recorder.show_map(self.grid, mesh)
