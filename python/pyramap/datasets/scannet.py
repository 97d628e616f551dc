"""ScanNet: a folder with `depth/0.png`, `pose/0.txt` and so on, and `intrinsic/intrinsic_depth.txt`."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from .colour import ColourRef, first_size
from .errors import DatasetError
from .intrinsics import Intrinsics
from .listing import Format, FrameRef, Listing, Options
from .png import first_png_size, read_png_depth
from .text import read_lines, read_matrix

DEPTH_FOLDER = "depth"
POSE_FOLDER = "pose"
COLOR_FOLDER = "color"
INTRINSICS = "intrinsic/intrinsic_depth.txt"
COLOUR_INTRINSICS = "intrinsic/intrinsic_color.txt"

_read_depth = partial(read_png_depth, units_per_metre=1000.0)


def _recognise(path: Path) -> bool:
    return (path / DEPTH_FOLDER).is_dir() and (path / POSE_FOLDER).is_dir()


def _list_frames(path: Path, options: Options) -> Listing[FrameRef]:
    # A frame that has lost its pose's file or its image stays listed: reading it says so.
    numbers = sorted(_numbers(path / DEPTH_FOLDER, ".png") | _numbers(path / POSE_FOLDER, ".txt"))
    if not numbers:
        raise DatasetError(path, f"there is neither a N.png in {DEPTH_FOLDER}/ nor a N.txt in {POSE_FOLDER}/")
    lost = {n: "the camera was lost: its pose is not finite" for n in numbers if _is_lost(_pose_file(path, n))}
    if len(lost) == len(numbers):
        raise DatasetError(path / POSE_FOLDER, f"the camera was lost in all {len(lost)} frames: no pose is finite")
    camera = options.camera or Intrinsics.of_matrix(path / INTRINSICS, read_matrix(path / INTRINSICS, 4)).camera(
        path / INTRINSICS, first_png_size(path, (_depth_file(path, n) for n in numbers))
    )
    colors = {n: path / COLOR_FOLDER / f"{n}.jpg" for n in sorted(_numbers(path / COLOR_FOLDER, ".jpg"))}
    colours = _colours(path, colors)
    frames = [
        FrameRef(
            index=n,
            camera=camera,
            read_depth=partial(_read_depth, _depth_file(path, n)),
            read_pose=partial(read_matrix, _pose_file(path, n), 4),
            colour_path=colors.get(n),
            colour=colours.get(n),
        )
        for n in numbers
        if n not in lost
    ]
    return Listing(frames, lost)


def _colours(folder: Path, colors: dict[int, Path]) -> dict[int, ColourRef]:
    """The depth is registered to the colour, which has another size; without its intrinsics it cannot be fused."""
    intrinsics, size = folder / COLOUR_INTRINSICS, first_size(colors.values())
    if size is None or not intrinsics.is_file():
        return {}
    camera = Intrinsics.of_matrix(intrinsics, read_matrix(intrinsics, 4)).camera(intrinsics, size)
    return {n: ColourRef.of_file(color, camera) for n, color in colors.items()}


def _numbers(folder: Path, suffix: str) -> set[int]:
    return {int(file.stem) for file in folder.glob(f"*{suffix}") if file.stem.isdecimal()}


def _depth_file(folder: Path, number: int) -> Path:
    return folder / DEPTH_FOLDER / f"{number}.png"


def _pose_file(folder: Path, number: int) -> Path:
    return folder / POSE_FOLDER / f"{number}.txt"


def _is_lost(pose: Path) -> bool:
    """Whether the tracker has given the camera up: it then writes -inf or nan into every place of the matrix."""
    try:
        words = {word.lower().lstrip("+-") for line in read_lines(pose) for word in line.words}
    except DatasetError:
        return False
    return bool(words & {"inf", "nan"})


SCANNET = Format(
    name="ScanNet",
    looks_for=f"{DEPTH_FOLDER}/N.png, {POSE_FOLDER}/N.txt and {INTRINSICS}",
    recognise=_recognise,
    list_frames=_list_frames,
)
