"""Where the frames come from: a data set that pyramap reads, or its simulated office."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyramap as pm

from .frames import Frame, FrameFile, write

OFFICE = "office"
"""Names the simulated office in the place of a folder."""

OFFICE_NOISE = 1
"""Seed of the simulated sensor's noise."""

Frames = pm.datasets.Dataset | pm.scenes.SceneFrames


def default_data() -> str:
    """The Red Kitchen of 7-Scenes where it lies in `$PYRAMAP_DATA` or beside the project, else the office."""
    project = Path(__file__).resolve().parents[2]
    root = Path(os.environ.get("PYRAMAP_DATA", project.parent / "shared" / "data"))
    kitchen = root / "redkitchen"
    return str(kitchen) if kitchen.is_dir() else OFFICE


def open_frames(data: str) -> tuple[str, Frames]:
    """The frames of a data set in this folder, or of the office, and what they are called."""
    if data == OFFICE:
        return "office loop (simulated)", pm.scenes.office_loop().frames(noise=OFFICE_NOISE)
    frames = pm.datasets.open(data)
    return frames.name, frames


def record(data: str, path: Path, count: int | None = None) -> FrameFile:
    """Decodes or renders `count` frames spread evenly over the sequence (None: all) into the file `path`."""
    name, frames = open_frames(data)
    total = len(frames)
    indices = np.linspace(0, total, min(count or total, total), endpoint=False).astype(int)
    return write(name, _plain(frames, indices), path)


def _plain(frames: Frames, indices: np.ndarray) -> Iterator[Frame]:
    for index in indices:
        frame = frames[int(index)]
        camera = frame.camera
        intrinsics = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
        yield Frame(frame.depth, intrinsics, frame.world_from_camera)
