"""Images stored as greyscale PNG: depth with 16 bits, confidence with 8."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from .._core import PinholeCamera
from .errors import DatasetError

_SIXTEEN_BIT_GREY = "I;16"
_EIGHT_BIT_GREY = "L"
_BITS = {_SIXTEEN_BIT_GREY: 16, _EIGHT_BIT_GREY: 8}


def read_png_depth(
    path: Path, camera: PinholeCamera, *, units_per_metre: float, no_reading: int = 0
) -> NDArray[np.float32]:
    """Decodes a depth image.

    Args:
        path: a 16-bit greyscale PNG of the camera's size.
        camera: the camera that took it.
        units_per_metre: what one metre is in the image, for example 1000 for millimetres.
        no_reading: a value that means "no reading", besides 0.

    Returns:
        (H, W) float32, C-contiguous, metres; 0 where there is no reading.

    Raises:
        DatasetError: if the image is missing, damaged, of another kind, or of another size than the camera's.
    """
    stored = _of_camera(_read(path, "depth image"), path, camera, _SIXTEEN_BIT_GREY)
    depth: NDArray[np.float32] = np.divide(stored, np.float32(units_per_metre), dtype=np.float32)
    if no_reading != 0:
        depth[stored == no_reading] = 0.0
    return depth


def decode_png_16(data: bytes, path: Path, camera: PinholeCamera) -> NDArray[np.uint16]:
    """Decodes a 16-bit greyscale PNG of the camera's size that is a part of the file `path`.

    Raises:
        DatasetError: if the image is damaged, of another kind, or of another size than the camera's.
    """
    return _of_camera(data, path, camera, _SIXTEEN_BIT_GREY)


def read_png_levels(path: Path, camera: PinholeCamera) -> NDArray[np.uint8]:
    """Decodes an 8-bit greyscale PNG of the camera's size: (H, W) uint8, as stored. Raises as `read_png_depth`."""
    return _of_camera(_read(path, "confidence image"), path, camera, _EIGHT_BIT_GREY)


def read_png_size(path: Path) -> tuple[int, int]:
    """Width and height of a PNG, from its header alone. Raises `DatasetError` if it is missing or damaged."""
    try:
        with Image.open(path, formats=("PNG",)) as image:
            return image.size
    except FileNotFoundError:
        raise _missing(path, "depth image") from None
    except _DECODING_ERRORS as error:
        raise _unreadable(path, error) from error


def first_png_size(folder: Path, paths: Iterable[Path]) -> tuple[int, int]:
    """Width and height of the first of these PNGs that can be read; the others are reported when they are read.

    Raises:
        DatasetError: naming the folder, if none can be read.
    """
    for path in paths:
        try:
            return read_png_size(path)
        except DatasetError:
            continue
    raise DatasetError(folder, "not one depth image can be read")


def _read(path: Path, kind: str) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise _missing(path, kind) from None
    except OSError as error:
        raise _unreadable(path, error) from error


def _of_camera(data: bytes, path: Path, camera: PinholeCamera, wanted: str) -> NDArray[Any]:
    mode, stored = _decode(data, path)
    if mode != wanted:
        raise DatasetError(path, f"expected a {_BITS[wanted]}-bit greyscale PNG, got Pillow's mode {mode!r}")
    height, width = stored.shape
    if (width, height) != (camera.width, camera.height):
        raise DatasetError(path, f"the image is {width}x{height}, but the camera {camera.width}x{camera.height}")
    return stored


def _decode(data: bytes, path: Path) -> tuple[str, NDArray[Any]]:
    try:
        # Decoding alone misses some damage (4 % of single flipped bits), the checksums miss none, and cost 1 % of the
        # decoding. Pillow wants the image opened anew after that.
        with Image.open(BytesIO(data), formats=("PNG",)) as image:
            image.verify()
        with Image.open(BytesIO(data), formats=("PNG",)) as image:
            return image.mode, np.asarray(image)
    except _DECODING_ERRORS as error:
        raise _unreadable(path, error) from error


# Pillow reports a broken chunk as SyntaxError or ValueError, broken or missing pixels as OSError.
_DECODING_ERRORS = (OSError, SyntaxError, ValueError, Image.DecompressionBombError)


def _missing(path: Path, kind: str) -> DatasetError:
    return DatasetError(path, f"the {kind} is missing")


def _unreadable(path: Path, error: BaseException) -> DatasetError:
    if isinstance(error, UnidentifiedImageError):
        return DatasetError(path, "not a PNG image, or cut off in its header")
    return DatasetError(path, f"damaged or truncated depth image ({error})")
