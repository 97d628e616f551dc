"""Where a picture of a mesh is taken from, and which way is up."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

_ELEVATION_DEG = 52.0
"""Steep enough to look over walls into rooms, flat enough to see the walls."""
_MARGIN = 1.04
"""Width of the picture relative to what it shows."""
_ENOUGH_FACES = 200_000
"""A statistic over directions needs no more faces than this."""
_PARALLEL = 1e-6
"""Sine of an angle below which two directions are the same."""

SIZE = (1600, 1200)
"""Width and height of pictures, pixels."""
ANGLE_DEG = 75.0
"""Horizontal angle of a perspective view: wide enough for a room."""


@dataclass(frozen=True)
class View:
    """A camera for pictures.

    Attributes:
        eye: (3,) position in the world, metres.
        axes: (3, 3) columns are the picture's right, down and forward directions in the world, orthonormal.
        width: Orthographic: width of the picture in metres. Perspective: width at distance 1, so 2 tan(angle / 2).
        size: Width and height in pixels.
        perspective: Whether rays start at `eye` (else they are parallel).
    """

    eye: NDArray[np.float64]
    axes: NDArray[np.float64]
    width: float
    size: tuple[int, int]
    perspective: bool = False

    def rays(self, rows: slice, samples: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Origins and unit directions, each (h * samples, w * samples, 3), of the rays through some rows of pixels."""
        w, h = self.size
        step = self.width / w
        x = ((np.arange(w * samples) + 0.5) / samples - w / 2) * step
        y = ((np.arange(rows.start * samples, rows.stop * samples) + 0.5) / samples - h / 2) * step
        plane = np.multiply.outer(y, np.ones_like(x))[..., None] * self.axes[:, 1] + x[:, None] * self.axes[:, 0]
        if self.perspective:
            directions = plane + self.axes[:, 2]
            directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
            return np.broadcast_to(self.eye, directions.shape), directions
        return self.eye + plane, np.broadcast_to(self.axes[:, 2], plane.shape)


def up_from_poses(poses: Iterable[ArrayLike]) -> NDArray[np.float64]:
    """Guess which way is up from how the camera was held.

    Args:
        poses: 4x4 `world_from_camera` matrices; camera axes x right, y down, z forward.

    Returns:
        (3,) unit vector: the mean of the cameras' upward axes.

    Raises:
        ValueError: There is no pose, or the cameras were held all ways so that their mean vanishes.
    """
    ups = [-np.asarray(pose, dtype=np.float64)[:3, 1] for pose in poses]
    mean = np.mean(ups, axis=0) if ups else np.zeros(3)
    length = float(np.linalg.norm(mean))
    if length < 1e-6:
        raise ValueError(
            f"the upward direction cannot be guessed from {len(ups)} poses: their mean upward axis vanishes"
        )
    return np.asarray(mean / length)


def up_from_mesh(vertices: ArrayLike, faces: ArrayLike) -> NDArray[np.float64]:
    """Guess which way is up: of the three directions that worlds have for it, the one that most of the surface faces.

    These are z (robots), y (graphics), and -y (the first camera's axes are the world's). Depth cameras see floors and
    table tops from above, and their undersides hardly ever.

    Args:
        vertices: (V, 3) metres.
        faces: (F, 3) vertex indices, anticlockwise seen from free space.

    Returns:
        (3,) unit vector; z for a mesh without faces.
    """
    areas = area_vectors(np.asarray(vertices), np.asarray(faces))
    candidates = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    along = areas @ candidates.T
    within_30_degrees = along > math.cos(math.radians(30)) * np.linalg.norm(areas, axis=1)[:, None]
    return np.asarray(candidates[np.argmax(np.sum(along * within_30_degrees, axis=0))])


def overview(vertices: ArrayLike, faces: ArrayLike, up: ArrayLike = (0, 0, 1), size: tuple[int, int] = SIZE) -> View:
    """A view from obliquely above, parallel rays, turned so that it shows much front surface, and shows it large.

    Args:
        vertices: (V, 3) metres.
        faces: (F, 3) vertex indices, anticlockwise seen from free space.
        up: (3,) direction, any length.
        size: Most pixels in width and height; the picture is cut to what it shows.

    Raises:
        ValueError: The mesh has no faces, or `up` is not a finite direction.
    """
    vertices, faces = np.asarray(vertices, dtype=np.float64), np.asarray(faces)
    if len(faces) == 0:
        raise ValueError("the mesh has no faces: there is nothing to look at")
    some = faces[:: max(1, len(faces) // _ENOUGH_FACES)]
    areas = area_vectors(vertices, some)
    sizes = np.linalg.norm(areas, axis=1)
    centres = vertices[some].mean(axis=1)

    def shown(axes: NDArray[np.float64]) -> float:
        """Area of front surface, that seen face on most (cosine squared), times how large it appears."""
        cosines = np.maximum(-areas @ axes[:, 2], 0.0) / np.maximum(sizes, 1e-20)
        return float(sizes @ cosines**2) * _scale(np.ptp(centres @ axes[:, :2], axis=0), size)

    axes = max((_looking_down(unit(up), math.radians(degrees)) for degrees in range(0, 360, 15)), key=shown)
    return _framing(vertices, axes, size)


def looking_along(
    vertices: ArrayLike, direction: ArrayLike, up: ArrayLike = (0, 0, 1), size: tuple[int, int] = SIZE
) -> View:
    """A view of all of a mesh along one direction, parallel rays: -z is a plan, y an elevation from the front.

    Args:
        vertices: (V, 3) metres.
        direction: (3,) where one looks, any length.
        up: (3,) direction that points upward in the picture; where one looks along it, y does, or z along y.
        size: Most pixels in width and height; the picture is cut to what it shows.

    Raises:
        ValueError: There are no vertices, or `direction` or `up` is not a finite direction.
    """
    vertices, forward = np.asarray(vertices, dtype=np.float64), unit(direction)
    if len(vertices) == 0:
        raise ValueError("the mesh has no faces: there is nothing to look at")
    sideways = (np.cross(forward, unit(upward)) for upward in (up, (0, 1, 0), (0, 0, 1)))
    right = unit(next(vector for vector in sideways if np.linalg.norm(vector) > _PARALLEL))
    return _framing(vertices, np.stack([right, np.cross(forward, right), forward], axis=1), size)


def _framing(vertices: NDArray[np.float64], axes: NDArray[np.float64], size: tuple[int, int]) -> View:
    """The view along given axes, parallel rays, that shows all vertices."""
    within = vertices @ axes
    low, high = within.min(axis=0), within.max(axis=0)
    extent = (high - low)[:2] * _MARGIN
    scale = _scale(extent, size)
    pixels = (max(1, round(extent[0] * scale)), max(1, round(extent[1] * scale)))
    # Half the depth of the scene in front of its nearest point: parallel rays need only start outside.
    start = np.array([*(low + high)[:2] / 2, low[2] - 0.5 * (high[2] - low[2]) - 1e-3])
    return View(eye=axes @ start, axes=axes, width=pixels[0] / scale, size=pixels)


def from_pose(
    world_from_camera: ArrayLike,
    size: tuple[int, int] = SIZE,
    angle_deg: float = ANGLE_DEG,
    back: float = 0.5,
) -> View:
    """A perspective view as a camera has it: inside the map.

    Args:
        world_from_camera: 4x4 pose; camera axes x right, y down, z forward.
        size: Width and height in pixels.
        angle_deg: Horizontal angle of view.
        back: Metres that the eye is moved back from the pose.
    """
    pose = np.asarray(world_from_camera, dtype=np.float64)
    axes = pose[:3, :3]
    width = 2 * math.tan(math.radians(angle_deg) / 2)
    return View(eye=pose[:3, 3] - back * axes[:, 2], axes=axes, width=width, size=size, perspective=True)


def looking_at(
    eye: ArrayLike,
    target: ArrayLike,
    up: ArrayLike = (0, 0, 1),
    size: tuple[int, int] = SIZE,
    angle_deg: float = ANGLE_DEG,
) -> View:
    """A perspective view from one point towards another.

    Args:
        eye: (3,) where from, metres.
        target: (3,) what is in the middle of the picture, metres.
        up: (3,) direction that points upward in the picture.
        size: Width and height in pixels.
        angle_deg: Horizontal angle of view.

    Raises:
        ValueError: `eye` and `target` coincide, or `up` points along the line of sight.
    """
    forward = unit(np.subtract(target, eye))
    right = np.cross(forward, unit(up))
    if np.linalg.norm(right) < _PARALLEL:
        raise ValueError(f"up {up!r} points along the line of sight from {eye!r} to {target!r}")
    right = unit(right)
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(forward, right), forward, np.asarray(eye, dtype=np.float64)], axis=1)
    return from_pose(pose, size, angle_deg, back=0.0)


def _looking_down(up: NDArray[np.float64], azimuth: float) -> NDArray[np.float64]:
    """Axes of a picture taken from azimuth `azimuth` (radians about `up`) and from `_ELEVATION_DEG` above."""
    side = np.eye(3)[np.argmin(np.abs(up))]
    east = unit(np.cross(side, up))
    north = np.cross(up, east)
    heading = math.cos(azimuth) * east + math.sin(azimuth) * north
    elevation = math.radians(_ELEVATION_DEG)
    forward = math.cos(elevation) * heading - math.sin(elevation) * up
    right = np.cross(forward, up) / math.cos(elevation)
    return np.stack([right, np.cross(forward, right), forward], axis=1)


def _scale(extent: NDArray[np.float64], size: tuple[int, int]) -> float:
    """Pixels a metre, so that an extent in metres fits into a picture."""
    return float(np.min(np.array(size) / np.maximum(extent, 1e-3)))


def unit(vector: ArrayLike) -> NDArray[np.float64]:
    """A direction's unit vector.

    Raises:
        ValueError: It is not three finite numbers, or all are zero.
    """
    vector = np.asarray(vector, dtype=np.float64)
    length = float(np.linalg.norm(vector)) if vector.shape == (3,) else math.nan
    if not (math.isfinite(length) and length > 0):
        raise ValueError(f"expected a direction of three finite numbers, not all zero, got {vector.tolist()}")
    return vector / length


def area_vectors(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> NDArray[np.float64]:
    """(F, 3) normals of the faces times their areas, m^2."""
    a, b, c = (vertices[faces[:, corner]].astype(np.float64) for corner in range(3))
    return np.asarray(np.cross(b - a, c - a) / 2)
