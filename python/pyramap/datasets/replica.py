"""Replica as rendered for iMAP and NICE-SLAM: `results/depth000000.png` and so on, `traj.txt`, `cam_params.json`."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera
from .colour import ColourRef, first_size, same_view
from .errors import DatasetError
from .intrinsics import Intrinsics
from .listing import Format, FrameRef, Listing, Options
from .png import read_png_depth
from .records import parse_record
from .text import Line, read_bytes, read_lines

TRAJECTORY = "traj.txt"
IMAGES = "results"
PARAMETERS = "cam_params.json"


def _recognise(path: Path) -> bool:
    return (path / TRAJECTORY).is_file() and (path / IMAGES).is_dir()


def _list_frames(path: Path, options: Options) -> Listing[FrameRef]:
    poses = read_lines(path / TRAJECTORY)
    images = sorted((path / IMAGES).glob("depth*.png"))
    if not poses:
        raise DatasetError(path / TRAJECTORY, "there is no pose in it")
    # Images and poses are matched by their order alone, so that one too many shifts all that follow.
    if len(images) != len(poses):
        there = f"{len(images)} depth images (depth*.png) in {path / IMAGES}"
        raise DatasetError(path / TRAJECTORY, f"{len(poses)} poses, but {there}")
    written, units_per_metre = _parameters(path)
    camera = options.camera or written
    colors = [image.with_name(image.name.replace("depth", "frame")).with_suffix(".jpg") for image in images]
    colour_camera = same_view(camera, first_size(colors))
    frames = []
    for index, (image, color, pose) in enumerate(zip(images, colors, poses, strict=True)):
        has_color = color.is_file()
        frames.append(
            FrameRef(
                index=index,
                camera=camera,
                read_depth=partial(read_png_depth, image, units_per_metre=units_per_metre),
                read_pose=partial(_pose, pose),
                colour_path=color if has_color else None,
                colour=ColourRef.of_file(color, colour_camera) if has_color else None,
            )
        )
    return Listing(frames)


def _pose(line: Line) -> NDArray[np.float64]:
    return np.array(line.numbers(16)).reshape(4, 4)


def _parameters(folder: Path) -> tuple[PinholeCamera, float]:
    """The camera, and what one metre is in its images: of the scene's folder or, shared by all scenes, above it."""
    path = next((p for p in (folder / PARAMETERS, folder.resolve().parent / PARAMETERS) if p.is_file()), None)
    if path is None:
        raise DatasetError(folder, f"{PARAMETERS} is missing, here and in the folder above")
    camera = parse_record(path, read_bytes(path)).record("camera")
    intrinsics = Intrinsics(*(camera.number(key) for key in ("fx", "fy", "cx", "cy")))
    scale = camera.number("scale")
    if scale <= 0:
        raise camera.error(f"expected a scale above 0, got {scale:g}")
    return intrinsics.camera(path, camera.size("w", "h")), scale


REPLICA = Format(
    name="Replica",
    looks_for=f"{TRAJECTORY} and {IMAGES}/depthNNNNNN.png",
    recognise=_recognise,
    list_frames=_list_frames,
)
