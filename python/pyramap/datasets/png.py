"""Depth images stored as 16-bit greyscale PNG."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from .._core import PinholeCamera
from .errors import DatasetError

_SIXTEEN_BIT_GREY = "I;16"


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
    mode, stored = _decode(path)
    if mode != _SIXTEEN_BIT_GREY:
        raise DatasetError(path, f"expected a 16-bit greyscale PNG, got Pillow's mode {mode!r}")
    height, width = stored.shape
    if (width, height) != (camera.width, camera.height):
        raise DatasetError(path, f"the image is {width}x{height}, but the camera {camera.width}x{camera.height}")
    depth = np.divide(stored, np.float32(units_per_metre), dtype=np.float32)
    if no_reading != 0:
        depth[stored == no_reading] = 0.0
    return depth


def read_png_size(path: Path) -> tuple[int, int]:
    """Width and height of a PNG, from its header alone. Raises `DatasetError` if it is missing or damaged."""
    try:
        with Image.open(path, formats=("PNG",)) as image:
            return image.size
    except _DECODING_ERRORS as error:
        raise _unreadable(path, error) from error


def _decode(path: Path) -> tuple[str, NDArray[np.uint16]]:
    try:
        data = path.read_bytes()
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


def _unreadable(path: Path, error: BaseException) -> DatasetError:
    if isinstance(error, FileNotFoundError):
        return DatasetError(path, "the depth image is missing")
    if isinstance(error, UnidentifiedImageError):
        return DatasetError(path, "not a PNG image, or cut off in its header")
    return DatasetError(path, f"damaged or truncated depth image ({error})")
