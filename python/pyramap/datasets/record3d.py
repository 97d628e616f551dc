"""Record3D: an `.r3d` file, a zip archive of `metadata` and of depth images that are compressed with LZFSE."""

from __future__ import annotations

import importlib
import zipfile
import zlib
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera
from .arkit import without_low_confidence
from .colour import ColourRef, decode_colour, same_view, size_in
from .errors import DatasetError
from .intrinsics import GL_FROM_CAMERA, Intrinsics
from .listing import Format, FrameRef, Listing, Options
from .records import Record, parse_record
from .trajectory import TimedPose, unit_quaternion

METADATA = "metadata"
FOLDER = "rgbd"


def _recognise(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() == ".r3d"


def _list_frames(path: Path, options: Options) -> Listing[FrameRef]:
    metadata = parse_record(path, _read(path, METADATA))
    poses = metadata.array("poses", -1, 7)
    times = metadata.array("frameTimestamps", len(poses)) if "frameTimestamps" in metadata else None
    members = _members(path)
    numbers = [n for n in range(len(poses)) if _depth_name(n) in members]
    if not numbers:
        raise DatasetError(path, f"{len(poses)} poses, but no depth image ({_depth_name(0)} and so on) to them")
    cameras = [options.camera] * len(poses) if options.camera else _cameras(metadata, len(poses))
    colors = [n for n in numbers if _colour_name(n) in members]
    colour_size = next((size_in(_read(path, _colour_name(n))) for n in colors), None)
    frames = [
        FrameRef(
            index=n,
            camera=cameras[n],
            read_depth=partial(_read_depth, path, n, f"{FOLDER}/{n}.conf" in members),
            read_pose=partial(_pose, metadata, poses[n]),
            timestamp=None if times is None else float(times[n]),
            colour=_colour(path, n, same_view(cameras[n], colour_size)) if _colour_name(n) in members else None,
        )
        for n in numbers
    ]
    dropped = {n: f"{path}: there is no {_depth_name(n)} in it" for n in range(len(poses)) if n not in set(numbers)}
    return Listing(frames, dropped)


def _depth_name(number: int) -> str:
    return f"{FOLDER}/{number}.depth"


def _colour_name(number: int) -> str:
    return f"{FOLDER}/{number}.jpg"


def _colour(path: Path, number: int, camera: PinholeCamera) -> ColourRef:
    return ColourRef(lambda: decode_colour(_read(path, _colour_name(number)), path, camera), camera)


def _cameras(metadata: Record, count: int) -> list[PinholeCamera]:
    """The cameras of the depth images; the intrinsics that the app writes are those of the colour images."""
    size, depth_size = metadata.size("w", "h"), metadata.size("dw", "dh")
    if "perFrameIntrinsicCoeffs" in metadata:
        rows = metadata.array("perFrameIntrinsicCoeffs", count, 4).tolist()
    else:
        k = metadata.array("K", 9)  # column by column
        rows = [[k[0], k[4], k[6], k[7]]] * count
    return [
        Intrinsics.from_corner(*row, size=size, depth_size=depth_size).camera(metadata.path, depth_size) for row in rows
    ]


def _pose(metadata: Record, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    try:
        world_from_gl = TimedPose(0.0, numbers[4:], unit_quaternion(numbers[:4].tolist())).matrix()
    except ValueError as error:
        raise metadata.error(f"poses: {error}") from None
    return world_from_gl @ GL_FROM_CAMERA


def _read_depth(path: Path, number: int, has_confidence: bool, camera: PinholeCamera) -> NDArray[np.float32]:
    shape = (camera.height, camera.width)
    depth = _decompress(path, _depth_name(number), np.dtype("<f4"), shape)
    # What the sensor could not measure is not a number.
    metres = np.nan_to_num(depth.astype(np.float32), copy=False, nan=0.0)
    confidence = _decompress(path, f"{FOLDER}/{number}.conf", np.dtype("u1"), shape) if has_confidence else None
    return without_low_confidence(metres, confidence)


def _decompress(path: Path, name: str, dtype: np.dtype[Any], shape: tuple[int, int]) -> NDArray[Any]:
    lzfse = _lzfse(path)
    try:
        data: bytes = lzfse.decompress(_read(path, name))
    except lzfse.error as error:
        raise DatasetError(path, f"{name} is damaged: {error}") from error
    count, wanted = len(data) // dtype.itemsize, shape[0] * shape[1]
    if len(data) != wanted * dtype.itemsize:
        raise DatasetError(path, f"{name} holds {count} pixels, but the camera {shape[1]}x{shape[0]}")
    return np.frombuffer(data, dtype).reshape(shape)


def _lzfse(path: Path) -> ModuleType:
    try:
        return importlib.import_module("lzfse")
    except ImportError:
        raise DatasetError(path, "its depth is compressed with LZFSE: pip install pyramap[datasets]") from None


def _members(path: Path) -> set[str]:
    with _open(path) as archive:
        return set(archive.namelist())


def _read(path: Path, name: str) -> bytes:
    try:
        with _open(path) as archive:
            return archive.read(name)
    except KeyError:
        raise DatasetError(path, f"there is no {name} in it") from None
    except (zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise DatasetError(path, f"{name} is damaged: {error}") from error


def _open(path: Path) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(path)
    except (zipfile.BadZipFile, OSError) as error:
        raise DatasetError(path, f"not a zip archive, or cut off: {error}") from error


RECORD3D = Format(
    name="Record3D",
    looks_for="a file .r3d",
    recognise=_recognise,
    list_frames=_list_frames,
)
