"""KITTI odometry: `velodyne/000000.bin` and so on, `calib.txt`, and the poses of the left grey camera beside it."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import DatasetError
from .listing import Format, Listing, Options, ScanRef
from .text import Line, read_bytes, read_lines

SCAN_FOLDER = "velodyne"
CALIBRATION = "calib.txt"
CAMERA_FROM_LIDAR = "Tr:"
TIMES = "times.txt"
POSES = "poses.txt"
_POINT = np.dtype("<f4")
_NUMBERS_A_POINT = 4  # x, y, z and how much came back


def _recognise(path: Path) -> bool:
    return (path / SCAN_FOLDER).is_dir() and (path / CALIBRATION).is_file()


def _list_scans(path: Path, options: Options) -> Listing[ScanRef]:
    scans = sorted(file for file in (path / SCAN_FOLDER).glob("*.bin") if file.stem.isdecimal())
    if not scans:
        raise DatasetError(path / SCAN_FOLDER, "there is no scan NNNNNN.bin in it")
    camera_from_lidar = _calibration(path / CALIBRATION)
    poses_file = _poses_file(path)
    poses = read_lines(poses_file)
    if not poses:
        raise DatasetError(poses_file, "there is no pose in it")
    times = read_lines(path / TIMES) if (path / TIMES).is_file() else []
    numbers = [int(scan.stem) for scan in scans]
    # A scan's number is its line in the poses.
    dropped = {n: f"{poses_file}: there are only {len(poses)} poses" for n in numbers if n >= len(poses)}
    frames = [
        ScanRef(
            index=n,
            read_points=partial(_read_points, scan),
            read_pose=partial(_pose, poses[n], camera_from_lidar),
            timestamp=times[n].numbers(1)[0] if n < len(times) else None,
        )
        for n, scan in zip(numbers, scans, strict=True)
        if n not in dropped
    ]
    if not frames:
        raise DatasetError(poses_file, f"{len(poses)} poses, but the first scan is number {numbers[0]}")
    return Listing(frames, dropped)


def _poses_file(sequence: Path) -> Path:
    """Where the data set has its poses, `poses/00.txt` beside `sequences/00`; or in the sequence itself."""
    sequence = sequence.resolve()
    places = (sequence.parent.parent / "poses" / f"{sequence.name}.txt", sequence / POSES)
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        raise DatasetError(sequence, f"there are no poses: neither {places[0]} nor {POSES} in it")
    return found


def _calibration(path: Path) -> NDArray[np.float64]:
    line = next((line for line in read_lines(path) if line.words[0] == CAMERA_FROM_LIDAR), None)
    if line is None:
        raise DatasetError(path, f"there is no line {CAMERA_FROM_LIDAR!r}, which says where the LiDAR is")
    return _rigid(Line(path, line.number, line.words[1:]))


def _pose(line: Line, camera_from_lidar: NDArray[np.float64]) -> NDArray[np.float64]:
    return _rigid(line) @ camera_from_lidar


def _rigid(line: Line) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3] = np.array(line.numbers(12)).reshape(3, 4)
    return matrix


def _read_points(path: Path) -> NDArray[np.float32]:
    data = read_bytes(path)
    if len(data) % (_NUMBERS_A_POINT * _POINT.itemsize) != 0:
        raise DatasetError(path, f"cut off: its {len(data)} bytes are not whole points of 16")
    points = np.frombuffer(data, _POINT).reshape(-1, _NUMBERS_A_POINT)[:, :3]
    return np.ascontiguousarray(points[np.isfinite(points).all(axis=1)], dtype=np.float32)


KITTI = Format(
    name="KITTI odometry",
    looks_for=f"{SCAN_FOLDER}/NNNNNN.bin and {CALIBRATION}",
    recognise=_recognise,
    list_frames=_list_scans,
)
