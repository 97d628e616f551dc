"""Depth out of stereo."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["depth_from_disparity"]


def depth_from_disparity(
    disparity: NDArray[np.float32] | NDArray[np.float64], focal_length: float, baseline: float
) -> NDArray[np.float32]:
    """The z-depth that a rectified stereo pair sees: `focal_length baseline / disparity`.

    Args:
        disparity: (H, W) float32 or float64 pixels, of the left image. Many matchers give integers, in 16ths or 256ths
            of a pixel: divide these first.
        focal_length: Of the rectified images along a row, `fx` of the camera that the depth is fused with, pixels.
        baseline: Distance between the cameras, metres.

    Returns:
        (H, W) float32 metres; 0, no reading, where the disparity is not positive and finite.

    Raises:
        ValueError: If shape or type are others, or a number is not positive and finite.
    """
    values: NDArray[Any] = np.asarray(disparity)
    if values.ndim != 2 or values.dtype not in (np.float32, np.float64):
        raise ValueError(
            f"disparity has shape {values.shape} and dtype {values.dtype}, expected (H, W) float32 or float64 pixels"
        )
    for name, value, unit in (("focal_length", focal_length, "pixels"), ("baseline", baseline, "metres")):
        if not (0 < value < float("inf")):
            raise ValueError(f"{name} is {value}, expected a positive, finite number of {unit}")
    valid = np.isfinite(values) & (values > 0)
    depth = np.zeros(values.shape)
    np.divide(focal_length * baseline, values, out=depth, where=valid, dtype=np.float64)
    # A disparity next to nothing makes a depth that float32 does not hold.
    with np.errstate(over="ignore"):
        return depth.astype(np.float32)
