"""7-Scenes: a folder with `frame-000000.depth.png`, `frame-000000.pose.txt` and so on."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np

from .._core import PinholeCamera
from .colour import ColourRef, first_size, same_view
from .errors import DatasetError
from .intrinsics import Intrinsics
from .listing import Format, FrameRef, Listing, Options
from .png import first_png_size, read_png_depth
from .text import read_matrix

# The intrinsics that the data set's authors publish for all its scenes.
KINECT = PinholeCamera(width=640, height=480, fx=585.0, fy=585.0, cx=320.0, cy=240.0)
# That of the Kinect's colour camera is not published. These numbers lay the edges of things in the depth images of the
# scene Red Kitchen best on edges in the colour images. The camera sits 26 mm to the right of the depth camera.
KINECT_COLOUR = PinholeCamera(width=640, height=480, fx=525.6, fy=525.6, cx=320.0, cy=240.0)
DEPTH_FROM_COLOUR = np.array(
    [
        [0.999971, 0.007534, -0.001064, 0.02624],
        [-0.007526, 0.999948, 0.006954, -0.00485],
        [0.001116, -0.006946, 0.999975, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
DEPTH = "depth.png"
POSE = "pose.txt"
COLOR = ("color.png", "color.jpg")
INTRINSICS = "camera-intrinsics.txt"

_FRAME_FILE = re.compile(r"frame-(\d+)\.(\w+\.\w+)")

# Millimetres; the Kinect's driver writes 65535, and fused copies write 0, where it measured nothing.
_read_depth = partial(read_png_depth, units_per_metre=1000.0, no_reading=65535)


def _recognise(path: Path) -> bool:
    return path.is_dir() and (_holds_frames(path) or bool(_sequences(path)))


def _list_frames(path: Path, options: Options) -> Listing[FrameRef]:
    files: dict[str, set[str]] = defaultdict(set)
    for match in _frame_files(path):
        files[match[1]].add(match[2])
    # A frame that has lost its pose or its image stays listed: reading it says so.
    digits = sorted((d for d, kinds in files.items() if kinds & {DEPTH, POSE}), key=int)
    if not digits:
        names = ", ".join(_sequences(path))
        raise DatasetError(path, f"a 7-Scenes scene of several sequences ({names}): open one of them")
    camera = options.camera or _camera(path, digits)
    colours = {d: _file(path, d, kind) for d in digits for kind in COLOR if kind in files[d]}
    colour_camera = same_view(KINECT_COLOUR, first_size(colours.values()))
    return Listing([_frame(path, d, camera, colours.get(d), colour_camera) for d in digits])


def _frame(
    folder: Path, digits: str, camera: PinholeCamera, colour: Path | None, colour_camera: PinholeCamera
) -> FrameRef:
    return FrameRef(
        index=int(digits),
        camera=camera,
        read_depth=partial(_read_depth, _file(folder, digits, DEPTH)),
        read_pose=partial(read_matrix, _file(folder, digits, POSE), 4),
        colour_path=colour,
        colour=None if colour is None else ColourRef.of_file(colour, colour_camera, DEPTH_FROM_COLOUR),
    )


def _file(folder: Path, digits: str, kind: str) -> Path:
    return folder / f"frame-{digits}.{kind}"


def _camera(folder: Path, digits: Iterable[str]) -> PinholeCamera:
    """The camera of `camera-intrinsics.txt` in the sequence's folder or, shared by a scene, above; else the Kinect."""
    path = next((p for p in (folder / INTRINSICS, folder.parent / INTRINSICS) if p.is_file()), None)
    if path is None:
        return KINECT
    intrinsics = Intrinsics.of_matrix(path, read_matrix(path, 3))
    return intrinsics.camera(path, first_png_size(folder, (_file(folder, d, DEPTH) for d in digits)))


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
