"""One depth image with its camera and pose; one point cloud with its pose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera
from .colour import ColourRef


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A depth image, ready to be fused: `grid.integrate(frame.depth, frame.camera, frame.world_from_camera)`.

    For a map that keeps colours, give `integrate` the frame's `colour`, `colour_camera` and `depth_from_colour` too,
    under these names; all three are None if it has none.

    Attributes:
        index: the frame's number in its data set, whichever part of the data set is read.
        depth: (H, W) float32, C-contiguous, z-depth in metres; 0 where there is no reading.
        camera: the intrinsics that the depth image was taken with.
        world_from_camera: (4, 4) float64, as the data set gives it; camera axes x right, y down, z forward, metres.
        timestamp: seconds, or None if the data set has no times.
        colour_path: the file of this frame's colour image, or None; it is not opened.
        colour_ref: where the colour image comes from, and its camera; None if there is none that can be fused.
    """

    index: int
    depth: NDArray[np.float32]
    camera: PinholeCamera
    world_from_camera: NDArray[np.float64]
    timestamp: float | None = None
    colour_path: Path | None = None
    colour_ref: ColourRef | None = None

    @property
    def colour(self) -> NDArray[np.uint8] | None:
        """(H, W, 3) uint8, red, green, blue, of `colour_camera`, or None; decoded each time that it is asked for.

        Raises:
            DatasetError: if the image is missing, damaged, or of another size.
        """
        return None if self.colour_ref is None else self.colour_ref.read()

    @property
    def colour_camera(self) -> PinholeCamera | None:
        """The camera of the colour image, or None."""
        return None if self.colour_ref is None else self.colour_ref.camera

    @property
    def depth_from_colour(self) -> NDArray[np.float64] | None:
        """(4, 4) float64, metres: the pose of the colour camera in the axes of `camera`, or None."""
        return None if self.colour_ref is None else self.colour_ref.depth_from_colour


@dataclass(frozen=True, slots=True, eq=False)
class PointFrame:
    """A point cloud, as a LiDAR takes it in one turn.

    Attributes:
        index: the scan's number in its data set, whichever part of the data set is read.
        points: (N, 3) float32, C-contiguous, metres, finite, in the axes of the sensor.
        world_from_sensor: (4, 4) float64, metres, as the data set gives it.
        timestamp: seconds, or None if the data set has no times.
    """

    index: int
    points: NDArray[np.float32]
    world_from_sensor: NDArray[np.float64]
    timestamp: float | None = None
