"""7-Scenes: a folder with `frame-000000.depth.png`, `frame-000000.pose.txt` and so on."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from .._core import PinholeCamera
from .errors import DatasetError
from .listing import Format, FrameRef, Listing, Options
from .png import read_png_depth, read_png_size
from .text import read_matrix

# The intrinsics that the data set's authors publish for all its scenes.
KINECT = PinholeCamera(width=640, height=480, fx=585.0, fy=585.0, cx=320.0, cy=240.0)
DEPTH = "depth.png"
POSE = "pose.txt"
COLOR = ("color.png", "color.jpg")
INTRINSICS = "camera-intrinsics.txt"

_FRAME_FILE = re.compile(r"frame-(\d+)\.(\w+\.\w+)")

# Millimetres; the Kinect's driver writes 65535, and fused copies write 0, where it measured nothing.
_read_depth = partial(read_png_depth, units_per_metre=1000.0, no_reading=65535)


def _recognise(path: Path) -> bool:
    return path.is_dir() and (_holds_frames(path) or bool(_sequences(path)))


def _list_frames(path: Path, options: Options) -> Listing:
    files: dict[str, set[str]] = defaultdict(set)
    for match in _frame_files(path):
        files[match[1]].add(match[2])
    # A frame that has lost its pose or its image stays listed: reading it says so.
    digits = sorted((d for d, kinds in files.items() if kinds & {DEPTH, POSE}), key=int)
    if not digits:
        names = ", ".join(_sequences(path))
        raise DatasetError(path, f"a 7-Scenes scene of several sequences ({names}): open one of them")
    frames = [_frame(path, d, files[d]) for d in digits]
    return Listing(frames, options.camera or _camera(path, frames), _read_depth)


def _frame(folder: Path, digits: str, kinds: set[str]) -> FrameRef:
    def file(kind: str) -> Path:
        return folder / f"frame-{digits}.{kind}"

    return FrameRef(
        index=int(digits),
        depth_path=file(DEPTH),
        read_pose=partial(read_matrix, file(POSE), 4),
        color_path=next((file(kind) for kind in COLOR if kind in kinds), None),
    )


def _camera(folder: Path, frames: Iterable[FrameRef]) -> PinholeCamera:
    """The camera of `camera-intrinsics.txt` in the sequence's folder or, shared by a scene, above; else the Kinect."""
    path = next((p for p in (folder / INTRINSICS, folder.parent / INTRINSICS) if p.is_file()), None)
    if path is None:
        return KINECT
    (fx, skew, cx), (zero, fy, cy), last_row = read_matrix(path, 3).tolist()
    if skew != 0 or zero != 0 or last_row != [0, 0, 1]:
        raise DatasetError(path, "expected a matrix fx 0 cx / 0 fy cy / 0 0 1")
    width, height = _image_size(folder, frames)
    try:
        return PinholeCamera(width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy)
    except ValueError as error:
        raise DatasetError(path, str(error)) from error


def _image_size(folder: Path, frames: Iterable[FrameRef]) -> tuple[int, int]:
    for frame in frames:
        try:
            return read_png_size(frame.depth_path)
        except DatasetError:
            continue  # the first image that can be read decides; the others are reported when they are read
    raise DatasetError(folder, "not one depth image can be read")


def _frame_files(folder: Path) -> Iterable[re.Match[str]]:
    return filter(None, (_FRAME_FILE.fullmatch(entry.name) for entry in folder.iterdir()))


def _holds_frames(folder: Path) -> bool:
    return any(match[2] in (DEPTH, POSE) for match in _frame_files(folder))


def _sequences(scene: Path) -> list[str]:
    return sorted(entry.name for entry in scene.glob("seq-*") if entry.is_dir() and _holds_frames(entry))


SEVEN_SCENES = Format(
    name="7-Scenes",
    looks_for=f"frame-NNNNNN.{DEPTH} and frame-NNNNNN.{POSE}",
    recognise=_recognise,
    list_frames=_list_frames,
)
