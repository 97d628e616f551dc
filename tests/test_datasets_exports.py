"""Readers of what other programs export: ScanNet, Replica, nerfstudio, Stray Scanner, Record3D."""

from __future__ import annotations

import json
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dataset_files import CAMERA, HEIGHT, WIDTH, intrinsics, metres, pose, stored_image, write_png
from export_files import (
    COLOR_HEIGHT,
    COLOR_WIDTH,
    color_intrinsics,
    levels,
    metric_depth,
    write_nerfstudio,
    write_record3d,
    write_replica,
    write_scannet,
    write_stray,
)
from numpy.typing import NDArray
from pyramap import PinholeCamera, datasets
from pyramap.datasets import DatasetError

# --- ScanNet ----------------------------------------------------------------------------------------------------------


def test_scannet_gives_depth_and_poses_by_their_numbers(tmp_path: Path) -> None:
    write_scannet(tmp_path, 12)  # unpadded names: 10.png must not come before 2.png
    (tmp_path / "color").mkdir()
    (tmp_path / "color" / "7.jpg").touch()
    dataset = datasets.open(tmp_path)
    assert (dataset.format, len(dataset)) == ("ScanNet", 12)
    assert intrinsics(dataset.camera) == intrinsics(CAMERA)
    for n, frame in enumerate(dataset):
        assert frame.index == n
        assert frame.depth.tolist() == metres(stored_image(n), 1000)
        assert np.array_equal(frame.world_from_camera, pose(n))
        assert frame.colour_path == (tmp_path / "color" / "7.jpg" if n == 7 else None)


def test_scannet_leaves_out_the_frames_where_the_camera_was_lost(tmp_path: Path) -> None:
    dataset = datasets.open(write_scannet(tmp_path, 6, lost=(0, 3)))
    assert [frame.index for frame in dataset] == [1, 2, 4, 5]
    assert list(dataset.skipped) == [0, 3]
    assert "the camera was lost" in dataset.skipped[3]


def test_scannet_without_any_pose(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"pose: the camera was lost in all 2 frames"):
        datasets.open(write_scannet(tmp_path, 2, lost=(0, 1)))
    for file in (tmp_path / "pose").iterdir():
        file.unlink()
    with pytest.raises(DatasetError, match=r"0\.txt: the file is missing"):
        list(datasets.open(tmp_path))


def test_scannet_without_intrinsics_or_images(tmp_path: Path) -> None:
    write_scannet(tmp_path, 2)
    (tmp_path / "intrinsic" / "intrinsic_depth.txt").unlink()
    with pytest.raises(DatasetError, match=r"intrinsic_depth\.txt: the file is missing"):
        datasets.open(tmp_path)
    assert len(list(datasets.open(tmp_path, camera=CAMERA))) == 2
    for kind in ("depth", "pose"):
        for file in (tmp_path / kind).iterdir():
            file.unlink()
    with pytest.raises(DatasetError, match=r"neither a N\.png in depth/ nor a N\.txt in pose/"):
        datasets.open(tmp_path)


# --- Replica ----------------------------------------------------------------------------------------------------------


def test_replica_takes_the_scale_and_the_camera_of_the_file_above(tmp_path: Path) -> None:
    folder = write_replica(tmp_path / "room0", 11)
    dataset = datasets.open(folder)
    assert (dataset.format, dataset.name, len(dataset)) == ("Replica", "room0", 11)
    assert intrinsics(dataset.camera) == intrinsics(CAMERA)
    for n, frame in enumerate(dataset):
        assert frame.index == n
        assert frame.depth.tolist() == metres(stored_image(n), 6553.5)
        assert np.array_equal(frame.world_from_camera, pose(n))
        assert frame.colour_path == folder / "results" / f"frame{n:06d}.jpg"


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda folder: (folder.parent / "cam_params.json").unlink(), r"cam_params\.json is missing, here and"),
        (lambda folder: (folder / "results" / "depth000001.png").unlink(), "3 poses, but 2 depth images"),
        (lambda folder: (folder / "traj.txt").write_text(""), r"traj\.txt: there is no pose in it"),
        (lambda folder: (folder.parent / "cam_params.json").write_text("{"), r"cam_params\.json: not a JSON file"),
        (lambda folder: (folder.parent / "cam_params.json").write_text('{"cam": 1}'), "there is no 'camera', only cam"),
        (lambda folder: (folder / "cam_params.json").write_text('{"camera": []}'), "camera: expected an object"),
    ],
)
def test_replica_that_cannot_be_used(tmp_path: Path, change: Callable[[Path], object], problem: str) -> None:
    folder = write_replica(tmp_path / "room0", 3)
    change(folder)
    with pytest.raises(DatasetError, match=problem):
        datasets.open(folder)


def test_replica_short_pose_spoils_one_frame(tmp_path: Path) -> None:
    folder = write_replica(tmp_path / "room0", 3)
    lines = (folder / "traj.txt").read_text().splitlines()
    lines[1] = lines[1].rsplit(maxsplit=1)[0]
    (folder / "traj.txt").write_text("\n".join(lines))
    with pytest.raises(DatasetError, match="line 2: expected 16 numbers, got 15"):
        list(datasets.open(folder))
    assert [frame.index for frame in datasets.open(folder, skip_bad=True)] == [0, 2]


# --- nerfstudio -------------------------------------------------------------------------------------------------------


def rays_of_the_corners(camera: PinholeCamera) -> list[tuple[float, float]]:
    """The slopes of the rays through the image's corners, which lie half a pixel outside of the outer centres."""
    left, right = ((u - camera.cx) / camera.fx for u in (-0.5, camera.width - 0.5))
    top, bottom = ((v - camera.cy) / camera.fy for v in (-0.5, camera.height - 0.5))
    return [(left, top), (right, bottom)]


def rays_of_the_color_corners(numbers: dict[str, float], fx: str = "fx", fy: str = "fy") -> list[tuple[float, float]]:
    """The same of a colour image whose principal point is counted from the corner."""
    cx, cy = numbers["cx"], numbers["cy"]
    return [
        (-cx / numbers[fx], -cy / numbers[fy]),
        ((numbers["w"] - cx) / numbers[fx], (numbers["h"] - cy) / numbers[fy]),
    ]


def seen_from_opengl(matrix: NDArray[np.float64], point: tuple[float, float, float]) -> NDArray[np.float64]:
    """Where a point of our camera axes lies in the world, if the camera's pose is one of OpenGL's axes."""
    x, y, z = point
    world: NDArray[np.float64] = matrix @ [x, -y, -z, 1]
    return world


def test_nerfstudio_turns_the_axes_and_fits_the_intrinsics_to_the_depth(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path)
    for path in (tmp_path, tmp_path / "transforms.json"):
        dataset = datasets.open(path)
        assert (dataset.format, len(dataset)) == ("nerfstudio", 3)
    # Both images show the same: their corners look along the same rays.
    corners = rays_of_the_color_corners(color_intrinsics("fx", "fy"))
    np.testing.assert_allclose(rays_of_the_corners(dataset.camera), corners, rtol=1e-12)
    for n, frame in enumerate(dataset):
        assert frame.depth.tolist() == metres(stored_image(n), 1000)
        assert frame.colour_path == tmp_path / "images" / f"frame_{n:05d}.png"
        for point in ((1.0, 2.0, 3.0), (-0.5, 0.25, 2.0)):
            np.testing.assert_allclose(frame.world_from_camera @ [*point, 1], seen_from_opengl(pose(n), point))


def test_nerfstudio_frames_may_have_intrinsics_of_their_own(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path)
    content = json.loads((tmp_path / "transforms.json").read_text())
    content["frames"][1] |= color_intrinsics("fl_x", "fl_y", scale=1.25)
    (tmp_path / "transforms.json").write_text(json.dumps(content))
    cameras = [frame.camera for frame in datasets.open(tmp_path)]
    assert cameras[0] == cameras[2]
    assert (cameras[1].fx, cameras[1].fy) == (1.25 * cameras[0].fx, 1.25 * cameras[0].fy)
    assert [frame.camera for frame in datasets.open(tmp_path, camera=CAMERA)] == [CAMERA] * 3


def test_nerfstudio_leaves_out_frames_without_depth(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path)
    content = json.loads((tmp_path / "transforms.json").read_text())
    del content["frames"][1]["depth_file_path"]
    (tmp_path / "transforms.json").write_text(json.dumps(content))
    dataset = datasets.open(tmp_path)
    assert [frame.index for frame in dataset] == [0, 2]
    assert dataset.skipped == {1: "there is no 'depth_file_path'"}


COLOR_ONLY = [{"file_path": "images/0.png", "transform_matrix": np.eye(4).tolist()}]


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"frames": COLOR_ONLY}, "none of its 1 frames has a 'depth_file_path': colour images alone do not do"),
        ({"frames": {}}, "expected a list for 'frames', got {}"),
        ({"frames": [5]}, r"frames\[0\]: expected an object with keys, got 5"),
        ({"fl_x": None}, r"frames\[0\]: there is no 'fl_x', only "),
        ({"fl_y": "20"}, r"frames\[0\]: expected a finite number for 'fl_y', got '20'"),
        ({"w": 31.5}, r"expected a width and a height in pixels for w and h, got 31\.5x18"),
        ({"fl_x": -1.0}, r"transforms\.json: .*fx"),
        ({"camera_model": "OPENCV_FISHEYE"}, "the camera model is 'OPENCV_FISHEYE'"),
        ({"k1": 0.1}, r"the lens distorts \({'k1': 0\.1}\): undistort the images, or give the camera"),
    ],
)
def test_nerfstudio_that_cannot_be_used(tmp_path: Path, changes: dict[str, Any], problem: str) -> None:
    write_nerfstudio(tmp_path, **changes)
    with pytest.raises(DatasetError, match=problem):
        datasets.open(tmp_path)


def test_nerfstudio_with_a_distorting_lens_is_read_with_a_given_camera(tmp_path: Path) -> None:
    assert len(list(datasets.open(write_nerfstudio(tmp_path, k1=0.1), camera=CAMERA))) == 3


def test_nerfstudio_bad_matrix_spoils_one_frame(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path)
    content = json.loads((tmp_path / "transforms.json").read_text())
    content["frames"][1]["transform_matrix"] = [[1, 0, 0], [0, 1, 0]]
    (tmp_path / "transforms.json").write_text(json.dumps(content))
    with pytest.raises(DatasetError, match=r"frames\[1\]: expected 4x4 finite numbers for 'transform_matrix'"):
        list(datasets.open(tmp_path))
    assert [frame.index for frame in datasets.open(tmp_path, skip_bad=True)] == [0, 2]


# --- Stray Scanner ----------------------------------------------------------------------------------------------------


def test_stray_scanner_leaves_out_readings_of_low_confidence(tmp_path: Path) -> None:
    dataset = datasets.open(write_stray(tmp_path))
    assert (dataset.format, len(dataset)) == ("Stray Scanner", 3)
    video = {"fx": 1500.0, "fy": 1510.0, "cx": 950.0, "cy": 730.0, "w": 1920.0, "h": 1440.0}
    np.testing.assert_allclose(rays_of_the_corners(dataset.camera), rays_of_the_color_corners(video), rtol=1e-12)
    for n, frame in enumerate(dataset):
        kept = np.where(levels(n) == 0, 0, metres(stored_image(n), 1000))
        assert frame.depth.dtype == np.float32
        assert np.array_equal(frame.depth, kept.astype(np.float32))
        assert frame.depth.flags.c_contiguous
        # Six decimals of the time are written; the rotation is that of a quaternion rounded to 1e-16.
        assert frame.timestamp == pytest.approx(100 + n / 60, abs=1e-6)
        np.testing.assert_allclose(frame.world_from_camera, pose(n), atol=1e-12)


def test_stray_scanner_without_confidence(tmp_path: Path) -> None:
    for n, frame in enumerate(datasets.open(write_stray(tmp_path, confidence=False))):
        assert frame.depth.tolist() == metres(stored_image(n), 1000)


def test_stray_scanner_bad_confidence_spoils_one_frame(tmp_path: Path) -> None:
    write_stray(tmp_path)
    write_png(tmp_path / "confidence" / "000001.png", np.zeros((WIDTH, HEIGHT), np.uint8))
    with pytest.raises(DatasetError, match=r"confidence/000001\.png: the image is 6x8, but the camera 8x6"):
        list(datasets.open(tmp_path))
    assert [frame.index for frame in datasets.open(tmp_path, skip_bad=True)] == [0, 2]


@pytest.mark.parametrize(
    ("row", "problem"),
    [
        ("100.1, 000001, 1, -2", "line 3: expected 9 numbers, got 4"),
        ("100.1, 000001, 1, -2, soon, 0, 0, 0, 1", "line 3: expected a finite number, got ' soon'"),
        ("100.1, 000001, 1, -2, 0.5, 0, 0, 0, 0", "line 3: expected a unit quaternion, got one of length 0"),
    ],
)
def test_stray_scanner_bad_pose_spoils_one_frame(tmp_path: Path, row: str, problem: str) -> None:
    lines = (write_stray(tmp_path) / "odometry.csv").read_text().splitlines()
    lines[2] = row
    (tmp_path / "odometry.csv").write_text("\n".join(lines))
    with pytest.raises(DatasetError, match=problem):
        list(datasets.open(tmp_path))
    dataset = datasets.open(tmp_path, skip_bad=True)
    assert [frame.index for frame in dataset] == [0, 2]
    assert problem in dataset.skipped[1]


@pytest.mark.parametrize("skip_bad", [False, True])
def test_stray_scanner_that_cannot_be_used(tmp_path: Path, skip_bad: bool) -> None:
    write_stray(tmp_path)
    text = (tmp_path / "odometry.csv").read_text()
    (tmp_path / "camera_matrix.csv").unlink()
    with pytest.raises(DatasetError, match=r"camera_matrix\.csv: the file is missing"):
        datasets.open(tmp_path, skip_bad=skip_bad)
    for content, problem in [
        (text.splitlines()[0], "there is no pose in it"),
        ("", "expected the columns timestamp, frame, x"),
        ("a, b, c\n" + text, "expected the columns timestamp, frame, x, .* got 'a, b, c'"),
    ]:
        (tmp_path / "odometry.csv").write_text(content)
        with pytest.raises(DatasetError, match=problem):
            datasets.open(tmp_path, skip_bad=skip_bad)


# --- Record3D ---------------------------------------------------------------------------------------------------------


def test_record3d_reads_the_archive(tmp_path: Path) -> None:
    dataset = datasets.open(write_record3d(tmp_path / "kitchen.r3d"))
    assert (dataset.format, dataset.name, len(dataset)) == ("Record3D", "kitchen.r3d", 3)
    corners = rays_of_the_color_corners(color_intrinsics("fx", "fy"))
    np.testing.assert_allclose(rays_of_the_corners(dataset.camera), corners, rtol=1e-12)
    for n, frame in enumerate(dataset):
        depth = metric_depth(n)
        assert np.array_equal(frame.depth, np.where((levels(n) == 0) | np.isnan(depth), 0, depth))
        assert frame.depth.dtype == np.float32
        assert frame.timestamp == n / 60
        point = (1.0, 2.0, 3.0)
        # Rotations of quaternions: rounded to 1e-16, of points a few metres away.
        np.testing.assert_allclose(frame.world_from_camera @ [*point, 1], seen_from_opengl(pose(n), point), atol=1e-12)


def test_record3d_frames_may_have_intrinsics_of_their_own(tmp_path: Path) -> None:
    own = [[25.0 + n, 20.0, 15.0, 10.0] for n in range(3)]
    dataset = datasets.open(write_record3d(tmp_path / "a.r3d", perFrameIntrinsicCoeffs=own))
    assert [frame.camera.fx for frame in dataset] == [(25.0 + n) * WIDTH / COLOR_WIDTH for n in range(3)]
    assert dataset.camera.fy == pytest.approx(20.0 * HEIGHT / COLOR_HEIGHT, rel=1e-15)


def test_record3d_without_a_confidence_or_a_depth(tmp_path: Path) -> None:
    path = write_record3d(tmp_path / "a.r3d", without=("rgbd/0.conf", "rgbd/1.depth"))
    dataset = datasets.open(path)
    assert [frame.index for frame in dataset] == [0, 2]
    assert "there is no rgbd/1.depth" in dataset.skipped[1]
    assert np.array_equal(dataset[0].depth, np.nan_to_num(metric_depth(0), nan=0))


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"without": ("metadata",)}, "there is no metadata in it"),
        ({"without": [f"rgbd/{n}.depth" for n in range(3)]}, "3 poses, but no depth image"),
        ({"poses": []}, "expected Nx7 finite numbers for 'poses', got "),
        ({"poses": [[1, 2, 3]]}, "expected Nx7 finite numbers for 'poses'"),
        ({"dw": None}, "there is no 'dw', only "),
        ({"K": "none"}, "expected 9 numbers for 'K', got 'none'"),
        ({"frameTimestamps": [1, 2]}, "expected 3 finite numbers for 'frameTimestamps'"),
    ],
)
def test_record3d_that_cannot_be_used(tmp_path: Path, changes: dict[str, Any], problem: str) -> None:
    path = write_record3d(tmp_path / "a.r3d", **changes)
    with pytest.raises(DatasetError, match=problem) as caught:
        datasets.open(path)
    assert caught.value.path == path


def test_record3d_that_is_cut_off_or_no_archive(tmp_path: Path) -> None:
    path = write_record3d(tmp_path / "a.r3d")
    for data in (path.read_bytes()[:-40], b"", b"not an archive"):
        path.write_bytes(data)
        with pytest.raises(DatasetError, match=r"a\.r3d: not a zip archive, or cut off"):
            datasets.open(path)


def test_record3d_damaged_depth_spoils_one_frame(tmp_path: Path) -> None:
    path = write_record3d(tmp_path / "a.r3d", without=("rgbd/1.depth", "rgbd/2.depth"))
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("rgbd/1.depth", b"bvx2 and then nonsense")
        archive.writestr("rgbd/2.depth", zipfile.ZipFile(path).read("rgbd/0.conf"))
    dataset = datasets.open(path, skip_bad=True)
    assert [frame.index for frame in dataset] == [0]
    assert "rgbd/1.depth is damaged" in dataset.skipped[1]
    assert "rgbd/2.depth holds 12 pixels, but the camera 8x6" in dataset.skipped[2]


def test_record3d_bad_rotation_spoils_one_frame(tmp_path: Path) -> None:
    poses = [[0, 0, 0, 1, 0, 0, 0], [0, 0, 0, 3, 0, 0, 0]]
    dataset = datasets.open(write_record3d(tmp_path / "a.r3d", count=2, poses=poses), skip_bad=True)
    assert len(list(dataset)) == 1
    assert "poses: expected a unit quaternion, got one of length 3" in dataset.skipped[1]


def test_record3d_without_its_package_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_record3d(tmp_path / "a.r3d")
    monkeypatch.setitem(sys.modules, "lzfse", None)
    with pytest.raises(DatasetError, match=r"compressed with LZFSE: pip install pyramap\[datasets\]"):
        list(datasets.open(path))
