"""Redwood and ICL-NUIM: a `.log` trajectory (a line of three numbers, then a 4x4 matrix, per frame) beside `depth/`."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera
from .colour import ColourRef, first_size, same_view
from .errors import DatasetError
from .listing import Format, FrameRef, Listing, Options
from .png import read_png_depth
from .text import Line, matrix, read_lines

CAMERA = PinholeCamera(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5)
TRAJECTORY = "trajectory.log"
DEPTH_FOLDER = "depth"
COLOR_FOLDERS = ("color", "rgb", "image")

_read_depth = partial(read_png_depth, units_per_metre=1000.0)


def _recognise(path: Path) -> bool:
    return bool(_trajectories(path))


def _list_frames(path: Path, options: Options) -> Listing[FrameRef]:
    trajectories = _trajectories(path)
    if len(trajectories) > 1:
        names = ", ".join(t.name for t in trajectories)
        raise DatasetError(path, f"several trajectories ({names}): open one of these files instead of the folder")
    (trajectory,) = trajectories
    folder = trajectory.parent
    poses = _read_poses(trajectory)
    images = _images(folder / DEPTH_FOLDER, ("*.png",))
    if not poses:
        raise DatasetError(trajectory, "there is no pose in it")
    # Images and poses are matched by their order alone, so that one too many shifts all that follow.
    if len(images) != len(poses):
        raise DatasetError(trajectory, f"{len(poses)} poses, but {len(images)} depth images in {folder / DEPTH_FOLDER}")
    colors = _color_images(folder, len(images))
    camera = options.camera or CAMERA
    colour_camera = same_view(camera, first_size(colors))
    frames = []
    for i, color in enumerate(colors):
        colour = None if color is None else ColourRef.of_file(color, colour_camera)
        frames.append(FrameRef(i, camera, partial(_read_depth, images[i]), poses[i], colour_path=color, colour=colour))
    return Listing(frames)


def _trajectories(path: Path) -> list[Path]:
    """The trajectory at `path`, be it the file or the folder; several if the folder does not say which."""
    if path.is_file():
        return [path] if path.suffix == ".log" and _starts_as_trajectory(path) else []
    if (path / TRAJECTORY).is_file():
        return [path / TRAJECTORY]
    return sorted(p for p in path.glob("*.log") if p.is_file() and _starts_as_trajectory(p))


def _starts_as_trajectory(path: Path) -> bool:
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            lines = [line.split() for line in islice((line for line in file if line.strip()), 2)]
    except OSError:
        return False
    return len(lines) == 2 and _is_id_line(lines[0]) and len(lines[1]) == 4


def _is_id_line(words: Sequence[str]) -> bool:
    return len(words) == 3 and all(re.fullmatch(r"-?\d+", word) for word in words)


def _read_poses(path: Path) -> list[Callable[[], NDArray[np.float64]]]:
    """One reader a pose, each with the lines that follow its id line, so that a damaged pose spoils no other."""
    rows: list[tuple[Line, list[Line]]] = []
    for line in read_lines(path):
        if _is_id_line(line.words):
            rows.append((line, []))
        elif rows:
            rows[-1][1].append(line)
        else:
            raise line.error(f"expected three whole numbers before a pose, got {' '.join(line.words)[:80]!r}")
    return [partial(_pose, id_line, lines) for id_line, lines in rows]


def _pose(id_line: Line, lines: Sequence[Line]) -> NDArray[np.float64]:
    if len(lines) != 4:
        raise id_line.error(f"expected 4 lines with a matrix after this one, got {len(lines)}")
    return matrix(id_line.path, lines, 4)


def _images(folder: Path, patterns: Sequence[str]) -> list[Path]:
    if not folder.is_dir():
        raise DatasetError(folder, "the folder of images is missing")
    return sorted((path for pattern in patterns for path in folder.glob(pattern)), key=_number_aware)


def _number_aware(path: Path) -> tuple[list[int], str]:
    """Sorts 2.png before 10.png."""
    return [int(digits) for digits in re.findall(r"\d+", path.name)], path.name


def _color_images(folder: Path, count: int) -> Sequence[Path | None]:
    """The colour images, where there are as many as depth images: they too are matched by order."""
    for name in COLOR_FOLDERS:
        if (folder / name).is_dir():
            images = _images(folder / name, ("*.png", "*.jpg"))
            if len(images) == count:
                return images
    return [None] * count


REDWOOD = Format(
    name="Redwood",
    looks_for=f"{TRAJECTORY} or another .log trajectory, and {DEPTH_FOLDER}/",
    recognise=_recognise,
    list_frames=_list_frames,
)
