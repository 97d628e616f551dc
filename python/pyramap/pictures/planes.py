"""Planes through the world, with directions of their own to the right and upward."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .views import unit

AXES = "xyz"


@dataclass(frozen=True)
class Plane:
    """A plane, as a picture shows it.

    Attributes:
        origin: (3,) where the plane's own coordinates are 0, metres.
        right: (3,) unit vector in the plane, to the right in the picture.
        upward: (3,) unit vector in the plane, upward in the picture.
        normal: (3,) unit vector perpendicular to it, along which `at` is measured.
        axis: The world axis that it is perpendicular to, 0, 1 or 2 for x, y or z, if it was made for one.
    """

    origin: NDArray[np.float64]
    right: NDArray[np.float64]
    upward: NDArray[np.float64]
    normal: NDArray[np.float64]
    axis: int | None = None

    @property
    def at(self) -> float:
        """Signed distance from the world's origin, metres: of an axis's plane, the position on the axis."""
        return float(self.origin @ self.normal)

    @property
    def title(self) -> str:
        """What plane it is."""
        if self.axis is not None:
            return f"{AXES[self.axis]} = {self.at:.6g} m"
        return f"through {_text(self.origin, 4)} m, perpendicular to {_text(self.normal, 3)}"

    @property
    def labels(self) -> tuple[str, str]:
        """What runs to the right, and what upward."""
        if self.axis is not None:
            across, upward = (AXES[axis] for axis in range(3) if axis != self.axis)
            return f"{across} (m)", f"{upward} (m)"
        return f"along {_text(self.right, 3)} (m)", f"along {_text(self.upward, 3)} (m)"

    def points(self, right: NDArray[np.float64], upward: NDArray[np.float64]) -> NDArray[np.float64]:
        """(len(upward), len(right), 3) world points at coordinates of the plane, metres."""
        return np.asarray(self.origin + right[:, None] * self.right + upward[:, None, None] * self.upward)


def axis_plane(axis: int, at: float) -> Plane:
    """The plane `axis = at`; the other two axes run to the right and upward, in their order.

    Args:
        axis: 0, 1 or 2 for x, y or z.
        at: Metres.

    Raises:
        ValueError: `axis` is none of the three.
    """
    if axis not in (0, 1, 2):
        raise ValueError(f"axis must be 0, 1 or 2 for x, y or z, got {axis!r}")
    across, upward = (other for other in range(3) if other != axis)
    unit_vectors = np.eye(3)
    return Plane(at * unit_vectors[axis], unit_vectors[across], unit_vectors[upward], unit_vectors[axis], axis)


def plane_through(point: ArrayLike, normal: ArrayLike, up: ArrayLike | None = None) -> Plane:
    """The plane through a point, seen from the side that its normal points to.

    Args:
        point: (3,) metres; the plane's own coordinates are 0 there.
        normal: (3,) direction, any length.
        up: (3,) direction that points upward in the picture; z by default, or y where the normal is along z.

    Raises:
        ValueError: One of them is not three finite numbers, or has no direction, or `normal` and `up` have the same.
    """
    point = np.asarray(point, dtype=np.float64)
    if point.shape != (3,) or not np.all(np.isfinite(point)):
        raise ValueError(f"expected a point of three finite numbers, got {point.tolist()}")
    normal = unit(normal)
    candidates = [up] if up is not None else [(0, 0, 1), (0, 1, 0)]
    for candidate in candidates:
        upward = unit(candidate)
        upward = upward - (upward @ normal) * normal
        if np.linalg.norm(upward) > 1e-6:
            upward = unit(upward)
            return Plane(point, np.cross(upward, normal), upward, normal)
    raise ValueError(f"up {up!r} points along the normal {normal.tolist()}: there is no upward direction in the plane")


def _text(vector: NDArray[np.float64], digits: int) -> str:
    # Adding 0 turns -0 into 0.
    return "(" + ", ".join(f"{value + 0.0:.{digits}g}" for value in np.round(vector, 6)) + ")"
