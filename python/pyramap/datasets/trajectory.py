"""Poses measured at times of their own, looked up at the times of the images."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Written with four decimals, a unit quaternion is off by 1e-4; more than this is another kind of number.
_UNIT_TOLERANCE = 1e-2


def unit_quaternion(xyzw: Sequence[float]) -> NDArray[np.float64]:
    """The (4,) quaternion x y z w, made of unit length. Raises `ValueError` if it is not so but for rounding."""
    quaternion = np.array(xyzw, dtype=np.float64)
    norm = float(np.linalg.norm(quaternion))
    if not abs(norm - 1) <= _UNIT_TOLERANCE:
        raise ValueError(f"expected a unit quaternion, got one of length {norm:g}")
    unit: NDArray[np.float64] = quaternion / norm
    return unit


@dataclass(frozen=True, slots=True)
class TimedPose:
    """A camera pose at one time: position (3,) in metres, unit quaternion (4,) as x y z w, both in the world."""

    time: float
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]

    def matrix(self) -> NDArray[np.float64]:
        """`world_from_camera`, (4, 4) float64."""
        x, y, z, w = self.quaternion
        world_from_camera = np.eye(4)
        world_from_camera[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        world_from_camera[:3, 3] = self.position
        return world_from_camera


class Trajectory:
    """Poses in the order of their times."""

    def __init__(self, poses: Sequence[TimedPose]) -> None:
        self._poses = sorted(poses, key=lambda pose: pose.time)
        self._times = [pose.time for pose in self._poses]

    def gap(self, time: float) -> float:
        """Seconds from `time` to the nearest pose."""
        return min(abs(neighbour.time - time) for neighbour in self._neighbours(time))

    def pose_at(self, time: float, max_gap: float) -> TimedPose:
        """The pose at `time`, whose `gap` must not exceed `max_gap` (seconds).

        Between two poses that both lie within `max_gap` the position is interpolated linearly and the rotation on the
        shortest arc. Where only one does (at an end, or beside a hole in the recording) that one is taken as it is:
        nothing is interpolated over a hole.
        """
        near = [pose for pose in self._neighbours(time) if abs(pose.time - time) <= max_gap]
        return near[0] if len(near) == 1 else _interpolate(near[0], near[1], time)

    def _neighbours(self, time: float) -> list[TimedPose]:
        """The last pose before `time` and the first one not before it, or the one of them that exists."""
        after = bisect_left(self._times, time)
        return self._poses[max(after - 1, 0) : after + 1]


def _interpolate(a: TimedPose, b: TimedPose, time: float) -> TimedPose:
    weight = (time - a.time) / (b.time - a.time)
    position = (1 - weight) * a.position + weight * b.position
    return TimedPose(time, position, _slerp(a.quaternion, b.quaternion, weight))


def _slerp(a: NDArray[np.float64], b: NDArray[np.float64], weight: float) -> NDArray[np.float64]:
    cosine = float(a @ b)
    if cosine < 0:  # b and -b are the same rotation; the nearer of them gives the shorter arc
        b, cosine = -b, -cosine
    angle = math.acos(min(cosine, 1.0))
    # Below this angle the chord and the arc differ by less than rounding, and the sines would cancel.
    mixed = (
        (1 - weight) * a + weight * b
        if angle < 1e-6
        else math.sin((1 - weight) * angle) * a + math.sin(weight * angle) * b
    )
    unit: NDArray[np.float64] = mixed / np.linalg.norm(mixed)
    return unit
