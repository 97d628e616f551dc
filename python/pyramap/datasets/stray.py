"""Stray Scanner: `depth/000000.png` and so on, `odometry.csv`, `camera_matrix.csv`, and perhaps `confidence/`."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera
from .arkit import without_low_confidence
from .errors import DatasetError
from .intrinsics import Intrinsics
from .listing import Format, FrameRef, Listing, Options
from .png import first_png_size, read_png_depth, read_png_levels
from .text import Line, matrix, read_lines
from .trajectory import TimedPose, unit_quaternion

ODOMETRY = "odometry.csv"
CAMERA_MATRIX = "camera_matrix.csv"
DEPTH_FOLDER = "depth"
CONFIDENCE_FOLDER = "confidence"
COLUMNS = ("timestamp", "frame", "x", "y", "z", "qx", "qy", "qz", "qw")
COLOR_SIZE = (1920, 1440)
"""Of the video that the app records beside the depth; the intrinsics that it writes are those of the video."""


def _recognise(path: Path) -> bool:
    return (path / ODOMETRY).is_file() and (path / DEPTH_FOLDER).is_dir()


def _list_frames(path: Path, options: Options) -> Listing[FrameRef]:
    rows = _read_rows(path / ODOMETRY)
    camera = options.camera or _camera(path, first_png_size(path, (_depth_file(path, row) for row in rows)))
    frames: list[FrameRef] = []
    dropped: dict[int, str] = {}
    for number, row in enumerate(rows):
        try:
            frames.append(_frame(path, row, camera))
        except DatasetError as error:
            if not options.skip_bad:
                raise
            dropped[number] = str(error)
    if not frames:
        raise DatasetError(path / ODOMETRY, f"not one of its {len(rows)} lines can be used: {dropped[0]}")
    return Listing(frames, dropped)


def _read_rows(path: Path) -> list[Line]:
    """The lines below the header, each cut to the columns that are known here."""
    lines = read_lines(path, ",")
    names = tuple(word.strip() for word in lines[0].words) if lines else ()
    if names[: len(COLUMNS)] != COLUMNS:
        raise DatasetError(path, f"expected the columns {', '.join(COLUMNS)}, got {', '.join(names)[:120]!r}")
    if len(lines) == 1:
        raise DatasetError(path, "there is no pose in it")
    return [Line(path, line.number, line.words[: len(COLUMNS)]) for line in lines[1:]]


def _frame(folder: Path, row: Line, camera: PinholeCamera) -> FrameRef:
    time, number, *pose = row.numbers(len(COLUMNS))
    depth = _depth_file(folder, row)
    return FrameRef(
        index=int(number),
        camera=camera,
        read_depth=partial(_read_depth, depth, folder / CONFIDENCE_FOLDER / depth.name),
        read_pose=partial(_pose, row, time, pose),
        timestamp=time,
    )


def _depth_file(folder: Path, row: Line) -> Path:
    digits = row.words[1].strip() if len(row.words) > 1 else ""
    return folder / DEPTH_FOLDER / f"{digits}.png"


def _read_depth(depth: Path, confidence: Path, camera: PinholeCamera) -> NDArray[np.float32]:
    metres = read_png_depth(depth, camera, units_per_metre=1000.0)
    return without_low_confidence(metres, read_png_levels(confidence, camera) if confidence.is_file() else None)


def _pose(row: Line, time: float, pose: list[float]) -> NDArray[np.float64]:
    try:
        return TimedPose(time, np.array(pose[:3]), unit_quaternion(pose[3:])).matrix()
    except ValueError as error:
        raise row.error(str(error)) from None


def _camera(folder: Path, depth_size: tuple[int, int]) -> PinholeCamera:
    path = folder / CAMERA_MATRIX
    k = Intrinsics.of_matrix(path, matrix(path, read_lines(path, ","), 3))
    return Intrinsics.from_corner(k.fx, k.fy, k.cx, k.cy, size=COLOR_SIZE, depth_size=depth_size).camera(
        path, depth_size
    )


STRAY = Format(
    name="Stray Scanner",
    looks_for=f"{ODOMETRY}, {CAMERA_MATRIX} and {DEPTH_FOLDER}/NNNNNN.png",
    recognise=_recognise,
    list_frames=_list_frames,
)
