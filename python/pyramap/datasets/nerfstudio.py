"""Nerfstudio: a `transforms.json` whose frames name depth images, with poses in OpenGL's camera axes."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera
from .colour import ColourRef, first_size, same_view
from .errors import DatasetError
from .intrinsics import GL_FROM_CAMERA, Intrinsics
from .listing import Format, FrameRef, Listing, Options
from .png import first_png_size, read_png_depth
from .records import Record, parse_record
from .text import read_bytes

TRANSFORMS = "transforms.json"
DEPTH = "depth_file_path"
PINHOLE_MODELS = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE")
DISTORTION = ("k1", "k2", "k3", "k4", "p1", "p2")

_read_depth = partial(read_png_depth, units_per_metre=1000.0)


def _recognise(path: Path) -> bool:
    return path.name == TRANSFORMS if path.is_file() else (path / TRANSFORMS).is_file()


def _list_frames(path: Path, options: Options) -> Listing[FrameRef]:
    file = path if path.is_file() else path / TRANSFORMS
    whole = parse_record(file, read_bytes(file))
    records = dict(enumerate(whole.records("frames")))
    with_depth = {index: record for index, record in records.items() if DEPTH in record}
    if not with_depth:
        raise DatasetError(file, f"none of its {len(records)} frames has a {DEPTH!r}: colour images alone do not do")
    files = {index: file.parent / record.text(DEPTH) for index, record in with_depth.items()}
    if options.camera:
        cameras = dict.fromkeys(with_depth, options.camera)
    else:
        size = first_png_size(file.parent, files.values())
        cameras = {index: _camera(whole, record, size) for index, record in with_depth.items()}
    colors = {
        index: file.parent / record.text("file_path") for index, record in with_depth.items() if "file_path" in record
    }
    colour_size = first_size(colors.values())
    frames = []
    for index, record in with_depth.items():
        color = colors.get(index)
        frames.append(
            FrameRef(
                index=index,
                camera=cameras[index],
                read_depth=partial(_read_depth, files[index]),
                read_pose=partial(_pose, record),
                colour_path=color,
                colour=None if color is None else ColourRef.of_file(color, same_view(cameras[index], colour_size)),
            )
        )
    dropped = {index: f"there is no {DEPTH!r}" for index in records if index not in with_depth}
    return Listing(frames, dropped)


def _pose(frame: Record) -> NDArray[np.float64]:
    return frame.array("transform_matrix", 4, 4) @ GL_FROM_CAMERA


def _camera(whole: Record, frame: Record, depth_size: tuple[int, int]) -> PinholeCamera:
    """The camera of a frame's own intrinsics, or of those of the whole file; these are the colour image's."""
    both = Record(frame.path, frame.place, {**whole.values, **frame.values})
    model = both.text("camera_model") if "camera_model" in both else PINHOLE_MODELS[0]
    if model not in PINHOLE_MODELS:
        raise both.error(f"the camera model is {model!r}; of {', '.join(PINHOLE_MODELS)} only pinholes can be mapped")
    bent = {key: both.values[key] for key in DISTORTION if key in both and both.number(key) != 0}
    if bent:
        raise both.error(f"the lens distorts ({bent}): undistort the images, or give the camera to take without that")
    fx, fy, cx, cy = (both.number(key) for key in ("fl_x", "fl_y", "cx", "cy"))
    intrinsics = Intrinsics.from_corner(fx, fy, cx, cy, size=both.size("w", "h"), depth_size=depth_size)
    return intrinsics.camera(frame.path, depth_size)


NERFSTUDIO = Format(
    name="nerfstudio",
    looks_for=f"{TRANSFORMS} with a {DEPTH} in its frames",
    recognise=_recognise,
    list_frames=_list_frames,
)
