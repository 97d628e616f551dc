"""Writes small data sets as other programs export them, for the tests of their readers."""

from __future__ import annotations

import json
import math
import zipfile
from pathlib import Path
from typing import Any

import lzfse
import numpy as np
from dataset_files import CAMERA, HEIGHT, WIDTH, pose, rows, stored_image, write_png
from numpy.typing import NDArray

COLOR_WIDTH, COLOR_HEIGHT = 4 * WIDTH, 3 * HEIGHT
"""Of a colour image that shows the same as the depth image; the pixels of neither are square in the other."""


def write_scannet(folder: Path, count: int = 4, lost: tuple[int, ...] = ()) -> Path:
    for n in range(count):
        write_png(folder / "depth" / f"{n}.png", stored_image(n))
        (folder / "pose").mkdir(exist_ok=True)
        matrix = np.full((4, 4), -np.inf) if n in lost else pose(n)
        (folder / "pose" / f"{n}.txt").write_text(rows(matrix))
    k = np.eye(4)
    k[0, 0], k[1, 1], k[:2, 2] = CAMERA.fx, CAMERA.fy, (CAMERA.cx, CAMERA.cy)
    (folder / "intrinsic").mkdir()
    (folder / "intrinsic" / "intrinsic_depth.txt").write_text(rows(k))
    return folder


def write_replica(folder: Path, count: int = 4) -> Path:
    for n in range(count):
        write_png(folder / "results" / f"depth{n:06d}.png", stored_image(n))
        write_png(folder / "results" / f"frame{n:06d}.jpg", np.zeros((2, 2), np.uint8))
    lines = [" ".join(repr(float(value)) for value in pose(n).ravel()) for n in range(count)]
    (folder / "traj.txt").write_text("\n".join(lines) + "\n")
    camera = {key: getattr(CAMERA, key) for key in ("fx", "fy", "cx", "cy")}
    parameters = {"camera": {"w": WIDTH, "h": HEIGHT, **camera, "scale": 6553.5}}
    (folder.parent / "cam_params.json").write_text(json.dumps(parameters))
    return folder


def write_nerfstudio(folder: Path, count: int = 3, **changes: Any) -> Path:
    frames = []
    for n in range(count):
        write_png(folder / "depth" / f"frame_{n:05d}.png", stored_image(n))
        names = {"file_path": f"images/frame_{n:05d}.png", "depth_file_path": f"depth/frame_{n:05d}.png"}
        frames.append({**names, "transform_matrix": pose(n).tolist()})
    content = {"camera_model": "OPENCV", **color_intrinsics("fl_x", "fl_y"), "k1": 0.0, "frames": frames, **changes}
    (folder / "transforms.json").write_text(json.dumps(content))
    return folder


def color_intrinsics(fx: str, fy: str, scale: float = 1.0) -> dict[str, float]:
    numbers = {fx: 25.0 * scale, fy: 20.0 * scale, "cx": 15.0, "cy": 10.0}
    return {**numbers, "w": COLOR_WIDTH, "h": COLOR_HEIGHT}


def quaternion(axis: int, angle: float) -> list[float]:
    """The turn about one of the axes, as x y z w."""
    xyzw = [0.0, 0.0, 0.0, math.cos(angle / 2)]
    xyzw[axis] = math.sin(angle / 2)
    return xyzw


def turn(axis: int, angle: float) -> NDArray[np.float64]:
    """The same as a (4, 4) matrix, written from what it does to the other two axes."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(4)
    matrix[a, a] = matrix[b, b] = math.cos(angle)
    matrix[b, a] = math.sin(angle)
    matrix[a, b] = -math.sin(angle)
    return matrix


def write_stray(folder: Path, count: int = 3, confidence: bool = True) -> Path:
    lines = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    for n in range(count):
        write_png(folder / "depth" / f"{n:06d}.png", stored_image(n))
        if confidence:
            write_png(folder / "confidence" / f"{n:06d}.png", levels(n))
        numbers = [n, -2.0, 0.5, *quaternion(2, 0.3 * n + 0.1)]  # the pose of `dataset_files.pose`
        lines.append(f"{100 + n / 60:.6f}, {n:06d}, " + ", ".join(repr(float(value)) for value in numbers))
    (folder / "odometry.csv").write_text("\n".join(lines) + "\n")
    (folder / "camera_matrix.csv").write_text("1500.0, 0.0, 950.0\n0.0, 1510.0, 730.0\n0.0, 0.0, 1.0\n")
    return folder


def levels(seed: int) -> NDArray[np.uint8]:
    """Confidences of the three levels that there are."""
    return np.random.default_rng(1000 + seed).integers(0, 3, (HEIGHT, WIDTH), dtype=np.uint8)


def metric_depth(seed: int) -> NDArray[np.float32]:
    """A depth image in metres, with two pixels that were not measured."""
    depth = np.random.default_rng(seed).uniform(0.3, 5, (HEIGHT, WIDTH)).astype(np.float32)
    depth[0, :2] = 0, np.nan
    return depth


def write_record3d(path: Path, count: int = 3, without: tuple[str, ...] = (), **changes: Any) -> Path:
    metadata = {
        **color_intrinsics("fx", "fy"),
        "dw": WIDTH,
        "dh": HEIGHT,
        "K": [25.0, 0, 0, 0, 20.0, 0, 15.0, 10.0, 1],  # column by column
        "poses": [[*quaternion(2, 0.3 * n + 0.1), n, -2.0, 0.5] for n in range(count)],
        "frameTimestamps": [n / 60 for n in range(count)],
        **changes,
    }
    members = {"metadata": json.dumps(metadata).encode()}
    for n in range(count):
        members[f"rgbd/{n}.depth"] = lzfse.compress(metric_depth(n).tobytes())
        members[f"rgbd/{n}.conf"] = lzfse.compress(levels(n).tobytes())
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            if name not in without:
                archive.writestr(name, data)
    return path


def points(seed: int, count: int = 20) -> NDArray[np.float32]:
    return np.random.default_rng(seed).uniform(-40, 40, (count, 3)).astype(np.float32)


LIDAR = turn(0, 0.4) @ turn(1, -1.2)
LIDAR[:3, 3] = 0.27, -0.08, -0.01
"""A LiDAR as seen from the camera, for KITTI's calibration."""


def write_kitti(root: Path, count: int = 4) -> Path:
    """A sequence in its place in the data set; the poses lie beside it."""
    sequence = root / "sequences" / "07"
    (sequence / "velodyne").mkdir(parents=True)
    (root / "poses").mkdir()
    for n in range(count):
        reflectance = np.full((20, 1), 0.5, np.float32)
        np.hstack([points(n), reflectance]).tofile(sequence / "velodyne" / f"{n:06d}.bin")
    (root / "poses" / "07.txt").write_text("".join(line(pose(n)) for n in range(count)))
    (sequence / "calib.txt").write_text(f"P0: {line(np.eye(4))}Tr: {line(LIDAR)}")
    (sequence / "times.txt").write_text("".join(f"{n / 10:e}\n" for n in range(count)))
    return sequence


def line(matrix: NDArray[np.float64]) -> str:
    return " ".join(repr(float(value)) for value in matrix[:3].ravel()) + "\n"
