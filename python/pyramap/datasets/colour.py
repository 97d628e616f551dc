"""Colour images that belong to depth images: where they are, and by which camera they were taken."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from .._core import PinholeCamera
from .errors import DatasetError

_FORMATS = ("JPEG", "PNG")
_MODES = ("RGB", "RGBA", "L", "P")
# As for depth images; a JPEG that ends early is an OSError.
_DECODING_ERRORS = (OSError, SyntaxError, ValueError, Image.DecompressionBombError)


@dataclass(frozen=True, slots=True)
class ColourRef:
    """Where a colour image comes from.

    Attributes:
        read: decodes it, (H, W, 3) uint8 of the camera's size, or raises `DatasetError`.
        camera: the camera that took it.
        depth_from_colour: (4, 4) float64, metres: the pose of that camera in the axes of the depth camera.
    """

    read: Callable[[], NDArray[np.uint8]]
    camera: PinholeCamera
    depth_from_colour: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))

    @classmethod
    def of_file(
        cls, path: Path, camera: PinholeCamera, depth_from_colour: NDArray[np.float64] | None = None
    ) -> ColourRef:
        """An image file of its own; registered to the depth, unless it is said where its camera was."""
        place = np.eye(4) if depth_from_colour is None else depth_from_colour
        return cls(partial(_read_file, path, camera), camera, place)


def same_view(camera: PinholeCamera, size: tuple[int, int] | None) -> PinholeCamera:
    """The camera of a picture that shows what `camera` shows, of another width and height; None stands for its own."""
    if size is None or size == (camera.width, camera.height):
        return camera
    x, y = size[0] / camera.width, size[1] / camera.height
    cx, cy = (camera.cx + 0.5) * x - 0.5, (camera.cy + 0.5) * y - 0.5
    return PinholeCamera(*size, camera.fx * x, camera.fy * y, cx, cy)


def first_size(paths: Iterable[Path | None]) -> tuple[int, int] | None:
    """Width and height of the first of these images whose header can be read; the others are reported when read."""
    return next((size for path in paths if path is not None and (size := _size_of(path)) is not None), None)


def size_in(data: bytes) -> tuple[int, int] | None:
    """Width and height of an image, from its header; None if that cannot be read."""
    try:
        with Image.open(BytesIO(data), formats=_FORMATS) as image:
            return image.size
    except _DECODING_ERRORS:
        return None


def decode_colour(data: bytes, path: Path, camera: PinholeCamera) -> NDArray[np.uint8]:
    """Decodes a JPEG or PNG that is, or is a part of, the file `path`.

    Returns:
        (H, W, 3) uint8, C-contiguous: red, green, blue.

    Raises:
        DatasetError: if the image is damaged, no colour image, or of another size than the camera's.
    """
    try:
        with Image.open(BytesIO(data), formats=_FORMATS) as image:
            if image.mode not in _MODES:
                raise DatasetError(path, f"expected a colour image, got Pillow's mode {image.mode!r}")
            pixels = np.array(image.convert("RGB"))
    except UnidentifiedImageError as error:
        raise DatasetError(path, "the colour image is neither JPEG nor PNG, or cut off in its header") from error
    except DatasetError:
        raise
    except _DECODING_ERRORS as error:
        raise DatasetError(path, f"damaged or truncated colour image ({error})") from error
    height, width, _ = pixels.shape
    if (width, height) != (camera.width, camera.height):
        there = f"the colour image is {width}x{height}"
        raise DatasetError(path, f"{there}, but the colour camera {camera.width}x{camera.height}")
    return pixels


def _read_file(path: Path, camera: PinholeCamera) -> NDArray[np.uint8]:
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise DatasetError(path, "the colour image is missing") from None
    except OSError as error:
        raise DatasetError(path, f"the colour image cannot be read ({error})") from error
    return decode_colour(data, path, camera)


def _size_of(path: Path) -> tuple[int, int] | None:
    try:
        with Image.open(path, formats=_FORMATS) as image:
            return image.size
    except _DECODING_ERRORS:
        return None
