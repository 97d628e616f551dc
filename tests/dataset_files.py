"""Writes small data sets of each format, for the tests of their readers."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
from numpy.typing import NDArray
from PIL import Image

WIDTH, HEIGHT = 8, 6
CAMERA = pm.PinholeCamera(width=WIDTH, height=HEIGHT, fx=7.0, fy=7.5, cx=3.5, cy=2.5)
IDENTITY = np.eye(4)


def intrinsics(camera: pm.PinholeCamera) -> tuple[float, ...]:
    return (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)


def stored_image(seed: int) -> NDArray[np.uint16]:
    """Any 16-bit image, with both values that may mean "no reading"."""
    image = np.random.default_rng(seed).integers(1, 65535, (HEIGHT, WIDTH), dtype=np.uint16)
    image[0, :2] = 0, 65535
    return image


def write_png(path: Path, stored: NDArray[Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(stored).save(path)


def pose(seed: int) -> NDArray[np.float64]:
    """A camera turned about z and moved; enough to tell rows from columns and frames from each other."""
    angle = 0.3 * seed + 0.1
    matrix = np.eye(4)
    matrix[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    matrix[:3, 3] = seed, -2.0, 0.5
    return matrix


def rows(matrix: NDArray[np.float64]) -> str:
    return "\n".join(" ".join(repr(float(value)) for value in row) for row in matrix) + "\n"


def write_seven_scenes(folder: Path, numbers: range = range(5)) -> Path:
    for n in numbers:
        write_png(folder / f"frame-{n:06d}.depth.png", stored_image(n))
        (folder / f"frame-{n:06d}.pose.txt").write_text(rows(pose(n)))
    k = [[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]]
    (folder / "camera-intrinsics.txt").write_text(rows(np.array(k)))
    return folder


def write_redwood(folder: Path, count: int = 5, trajectory: str = "trajectory.log") -> Path:
    for i in range(count):
        write_png(folder / "depth" / f"{i}.png", stored_image(i))
    (folder / trajectory).write_text("".join(f"{i} {i} {i + 1}\n{rows(pose(i))}" for i in range(count)))
    return folder


def write_tum(folder: Path, depth_times: list[float], truth: list[str], comment: str = "# depth maps") -> Path:
    for i, t in enumerate(depth_times):
        write_png(folder / f"depth/{t:.4f}.png", stored_image(i))
    lines = [comment, *(f"{t:.4f} depth/{t:.4f}.png" for t in depth_times)]
    (folder / "depth.txt").write_text("\n".join(lines))
    (folder / "groundtruth.txt").write_text("\n".join(["# timestamp tx ty tz qx qy qz qw", *truth]))
    return folder


AXIS = np.array([2.0, -1.0, 2.0]) / 3.0


def truth_line(t: float, angle: float = 0.0, position: tuple[float, float, float] = (0, 0, 0), sign: int = 1) -> str:
    """A ground-truth line: a turn by `angle` about AXIS; `sign` -1 writes the same turn as the negative quaternion."""
    x, y, z = sign * AXIS * math.sin(angle / 2)
    numbers = (*position, x, y, z, sign * math.cos(angle / 2))
    return f"{t:.4f} " + " ".join(f"{n:.12f}" for n in numbers)


def rodrigues(angle: float) -> NDArray[np.float64]:
    """The rotation by `angle` about AXIS, from its definition on vectors: no quaternion."""
    x, y, z = AXIS
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation: NDArray[np.float64] = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return rotation


def metres(stored: NDArray[np.uint16], units: float, no_reading: tuple[int, ...] = (0,)) -> list[list[float]]:
    """The meaning of a stored image, one pixel at a time; float32 as the nearest to the quotient."""
    return [[0.0 if v in no_reading else float(np.float32(int(v) / units)) for v in row] for row in stored]
