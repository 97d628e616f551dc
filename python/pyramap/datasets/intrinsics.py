"""Intrinsics of pinhole cameras, as data sets write them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera
from .errors import DatasetError

GL_FROM_CAMERA = np.diag([1.0, -1.0, -1.0, 1.0])
"""Takes our camera axes (x right, y down, z forward) to those of OpenGL and ARKit (x right, y up, z backward)."""


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Focal lengths and principal point in pixels; integer coordinates are pixel centres."""

    fx: float
    fy: float
    cx: float
    cy: float

    @classmethod
    def of_matrix(cls, path: Path, k: NDArray[np.float64]) -> Intrinsics:
        """From a 3x3 matrix, or the upper left of a larger one, that `path` holds.

        Raises:
            DatasetError: if it is not of the form fx 0 cx / 0 fy cy / 0 0 1.
        """
        (fx, skew, cx), (zero, fy, cy), last_row = k[:3, :3].tolist()
        if skew != 0 or zero != 0 or last_row != [0, 0, 1]:
            raise DatasetError(path, "expected a matrix fx 0 cx / 0 fy cy / 0 0 1")
        return cls(fx, fy, cx, cy)

    @classmethod
    def from_corner(
        cls, fx: float, fy: float, cx: float, cy: float, *, size: tuple[float, float], depth_size: tuple[int, int]
    ) -> Intrinsics:
        """Of a depth image, from those of the colour image that shows the same view at another size.

        Args:
            fx: focal length of the colour image, pixels.
            fy: likewise, downwards.
            cx: principal point of the colour image, counted from the image's corner, not from a pixel's centre.
            cy: likewise, downwards.
            size: width and height of the colour image.
            depth_size: width and height of the depth image.
        """
        x, y = depth_size[0] / size[0], depth_size[1] / size[1]
        return cls(fx * x, fy * y, cx * x - 0.5, cy * y - 0.5)

    def camera(self, path: Path, size: tuple[int, int]) -> PinholeCamera:
        """The camera with these intrinsics, of a width and height.

        Raises:
            DatasetError: naming `path`, if there can be no such camera.
        """
        try:
            return PinholeCamera(size[0], size[1], self.fx, self.fy, self.cx, self.cy)
        except ValueError as error:
            raise DatasetError(path, str(error)) from error
