"""Readers of point clouds: KITTI odometry."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from dataset_files import pose, write_seven_scenes
from export_files import LIDAR, points, write_kitti
from pyramap import datasets
from pyramap.datasets import DatasetError


def test_kitti_gives_scans_in_the_world_of_the_first_camera(tmp_path: Path) -> None:
    scans = datasets.open_scans(write_kitti(tmp_path, 5))
    assert (scans.format, scans.name, len(scans)) == ("KITTI odometry", "07", 5)
    for n, scan in enumerate(scans):
        assert (scan.index, scan.timestamp) == (n, n / 10)
        assert scan.points.dtype == np.float32
        assert scan.points.flags.c_contiguous
        assert np.array_equal(scan.points, points(n))
        assert scan.world_from_sensor.dtype == np.float64
        # The LiDAR's origin and axes, taken through the camera one after the other.
        for column in range(4):
            np.testing.assert_allclose(scan.world_from_sensor[:, column], pose(n) @ LIDAR[:, column], atol=1e-15)


def test_kitti_poses_may_lie_in_the_sequence_and_times_be_missing(tmp_path: Path) -> None:
    sequence = write_kitti(tmp_path, 3)
    (tmp_path / "poses" / "07.txt").rename(sequence / "poses.txt")
    (sequence / "times.txt").unlink()
    assert [scan.timestamp for scan in datasets.open_scans(sequence)] == [None] * 3


def test_scans_are_sliced_and_skipped_as_frames_are(tmp_path: Path) -> None:
    sequence = write_kitti(tmp_path, 8)
    scans = datasets.open_scans(sequence, stride=2)
    assert [scan.index for scan in scans] == [0, 2, 4, 6]
    assert [scan.index for scan in scans[::-2]] == [6, 2]
    assert scans[-1].index == 6
    assert len(datasets.open_scans(sequence, limit=3)) == 3
    assert np.array_equal(scans.poses()[1], scans[1].world_from_sensor)
    cut = sequence / "velodyne" / "000004.bin"
    cut.write_bytes(cut.read_bytes()[:-3])
    with pytest.raises(DatasetError, match=r"000004\.bin: cut off: its 317 bytes are not whole points of 16"):
        list(scans)
    scans = datasets.open_scans(sequence, skip_bad=True)
    assert [scan.index for scan in scans] == [0, 1, 2, 3, 5, 6, 7]
    assert "000004.bin" in scans.skipped[4]


def test_kitti_points_that_are_not_finite_are_left_out(tmp_path: Path) -> None:
    sequence = write_kitti(tmp_path, 1)
    stored = np.array([[1, 2, 3, 0], [np.nan, 2, 3, 0], [4, np.inf, 6, 0], [7, 8, 9, 0]], np.float32)
    stored.tofile(sequence / "velodyne" / "000000.bin")
    assert datasets.open_scans(sequence)[0].points.tolist() == [[1, 2, 3], [7, 8, 9]]


def test_kitti_with_fewer_poses_than_scans(tmp_path: Path) -> None:
    sequence = write_kitti(tmp_path, 4)
    poses = tmp_path / "poses" / "07.txt"
    poses.write_text("".join(poses.read_text().splitlines(keepends=True)[:3]))
    scans = datasets.open_scans(sequence)
    assert [scan.index for scan in scans] == [0, 1, 2]
    assert "there are only 3 poses" in scans.skipped[3]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda s: (s.parent.parent / "poses" / "07.txt").unlink(), r"07: there are no poses: neither .*poses/07\.txt"),
        (lambda s: (s.parent.parent / "poses" / "07.txt").write_text(""), r"07\.txt: there is no pose in it"),
        (lambda s: (s / "calib.txt").write_text("P0: 1 2 3"), r"calib\.txt: there is no line 'Tr:'"),
        (lambda s: (s / "calib.txt").write_text("Tr: 1 2 3"), r"calib\.txt: line 1: expected 12 numbers, got 3"),
        (lambda s: [f.unlink() for f in (s / "velodyne").iterdir()], "velodyne: there is no scan"),
    ],
)
def test_kitti_that_cannot_be_used(tmp_path: Path, change: Callable[[Path], object], problem: str) -> None:
    sequence = write_kitti(tmp_path, 2)
    change(sequence)
    with pytest.raises(DatasetError, match=problem):
        datasets.open_scans(sequence, skip_bad=True)


def test_scans_and_depth_images_are_opened_by_their_own_function(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="KITTI odometry: these are point clouds, for `open_scans`"):
        datasets.open(write_kitti(tmp_path / "kitti"))
    with pytest.raises(DatasetError, match="7-Scenes: these are depth images, for `open`"):
        datasets.open_scans(write_seven_scenes(tmp_path / "scenes"))
    with pytest.raises(DatasetError, match=r"Looked for KITTI odometry .*velodyne.*; ROS bag"):
        datasets.open_scans(tmp_path)
