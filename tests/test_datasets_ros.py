"""The reader of ROS 1 and ROS 2 bags: depth images and point clouds with the poses of tf, Odometry or PoseStamped."""

from __future__ import annotations

import gc
import threading
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from bag_files import (
    BASE,
    DEPTH,
    INFO,
    KINDS,
    OPTICAL,
    START,
    TF_STATIC,
    WORLD,
    Kind,
    Message,
    Motion,
    cloud,
    compressed_depth,
    image,
    info,
    motion_matrix,
    odometry,
    pose_stamped,
    transform,
    write_bag,
)
from dataset_files import CAMERA, HEIGHT, WIDTH, intrinsics, metres, stored_image
from numpy.typing import NDArray
from pyramap import datasets
from rosbags.highlevel import AnyReader

MOUNT: Motion = (0.6, (0.1, 0.2, 0.3))
"""Of the camera on the robot."""
MOUNTED = transform(0, BASE, OPTICAL, MOUNT, TF_STATIC)


def drive(n: float) -> Motion:
    """Of the robot at time n / 10: turns about one axis and goes straight, so that between two times it is half-way."""
    return 0.2 * n, (n, -n, 0.5 * n)


def at(n: float) -> NDArray[np.float64]:
    """The camera at time n / 10."""
    matrix: NDArray[np.float64] = motion_matrix(drive(n)) @ motion_matrix(MOUNT)
    return matrix


def recording(count: int = 4) -> list[Message]:
    """Depth images at n / 10, and tf at the same times."""
    messages = [info(), MOUNTED]
    for n in range(count):
        messages += [transform(n / 10, WORLD, BASE, drive(n)), image(n / 10, stored_image(n), "16UC1")]
    return messages


@pytest.mark.parametrize("kind", KINDS)
def test_depth_images_with_poses_of_a_chain_of_transforms(tmp_path: Path, kind: Kind) -> None:
    dataset = datasets.open(write_bag(tmp_path / "drive", kind, recording(5)))
    assert (dataset.format, len(dataset)) == ("ROS bag", 5)
    assert intrinsics(dataset.camera) == intrinsics(CAMERA)
    for n, frame in enumerate(dataset):
        assert frame.index == n
        assert frame.depth.tolist() == metres(stored_image(n), 1000)
        assert frame.depth.dtype == np.float32
        assert frame.depth.flags.c_contiguous
        # Seconds since 1970 leave 2.4e-7 s to a float64; poses a few metres away come of quaternions rounded to 1e-16.
        assert frame.timestamp == pytest.approx(START + n / 10, abs=3e-7)
        np.testing.assert_allclose(frame.world_from_camera, at(n), atol=1e-14)
    assert [frame.index for frame in dataset[3:0:-2]] == [3, 1]
    assert dataset[-1].depth.tolist() == metres(stored_image(4), 1000)


@pytest.mark.parametrize("kind", KINDS)
def test_poses_are_interpolated_between_transforms(tmp_path: Path, kind: Kind) -> None:
    messages = [info(), MOUNTED]
    messages += [transform(n / 10, WORLD, BASE, drive(n)) for n in range(4)]
    messages += [image((n + 0.3) / 10, stored_image(n), "16UC1") for n in range(3)]
    for n, pose in enumerate(datasets.open(write_bag(tmp_path / "a", kind, messages)).poses()):
        # At 2.4e-7 s of rounding the robot, at 17 m/s, has moved 4e-6 m.
        np.testing.assert_allclose(pose, at(n + 0.3), atol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_point_clouds_of_a_bag(tmp_path: Path, kind: Kind) -> None:
    clouds = [np.random.default_rng(n).uniform(-9, 9, (8, 3)) for n in range(3)]
    clouds[1] = clouds[1].astype(np.float32)
    messages = [transform(0, BASE, "lidar", MOUNT, TF_STATIC)]
    for n, points in enumerate(clouds):
        messages += [transform(n / 10, WORLD, BASE, drive(n)), cloud(n / 10, points)]
    scans = datasets.open_scans(write_bag(tmp_path / "a", kind, messages))
    assert (scans.format, len(scans)) == ("ROS bag", 3)
    for n, scan in enumerate(scans):
        assert scan.points.dtype == np.float32
        assert scan.points.flags.c_contiguous
        assert np.array_equal(scan.points, clouds[n].astype(np.float32))
        np.testing.assert_allclose(scan.world_from_sensor, at(n), atol=1e-14)


def test_points_that_are_not_finite_are_left_out(tmp_path: Path) -> None:
    points = np.array([[1, 2, 3], [np.nan, 0, 0], [4, 5, np.inf], [7, 8, 9]], np.float32)
    messages = [cloud(0, points), pose_stamped(0, drive(0)), pose_stamped(0.1, drive(1))]
    assert datasets.open_scans(write_bag(tmp_path / "a", "ros2", messages))[0].points.tolist() == [[1, 2, 3], [7, 8, 9]]


def test_depth_in_metres_keeps_what_is_beyond_the_range(tmp_path: Path) -> None:
    depth = np.random.default_rng(0).uniform(0.5, 8, (HEIGHT, WIDTH)).astype(np.float32)
    depth[0, :4] = np.nan, np.inf, -np.inf, 0
    expected = depth.copy()
    expected[0, :4] = 0, np.inf, 0, 0
    for order in "<>":
        messages = [*recording(2), image(0, depth.astype(f"{order}f4"), "32FC1", "/d/rect")]
        bag = write_bag(tmp_path / f"metres{ord(order)}", "ros2", messages)
        frame = datasets.open(bag, topics={"depth": "/d/rect"}, camera=CAMERA)[0]
        assert np.array_equal(frame.depth, expected)
        assert frame.depth.dtype == np.float32


@pytest.mark.parametrize("kind", KINDS)
def test_compressed_depth(tmp_path: Path, kind: Kind) -> None:
    messages = [m for m in recording() if m[1] != "image"]
    messages += [compressed_depth(n / 10, stored_image(n)) for n in range(3)]
    dataset = datasets.open(write_bag(tmp_path / "a", kind, messages), camera=CAMERA)
    assert [frame.depth.tolist() for frame in dataset] == [metres(stored_image(n), 1000) for n in range(3)]


def test_odometry_serves_where_tf_says_only_how_the_camera_is_mounted(tmp_path: Path) -> None:
    moving = [odometry(n / 10, drive(n)) for n in range(3)]
    images = [image(n / 10, stored_image(n), "16UC1") for n in range(3)]
    # Many bags repeat what does not move among what moves: in the place of tf_static, now and then.
    for name, mounts in {
        "static": [MOUNTED],
        "repeated": [transform(t, BASE, OPTICAL, MOUNT) for t in (0, 5, 10)],
    }.items():
        dataset = datasets.open(write_bag(tmp_path / name, "ros1", [info(), *mounts, *moving, *images]))
        np.testing.assert_allclose(dataset.poses(), [at(n) for n in range(3)], atol=1e-14)


def test_odometry_that_is_named_takes_the_place_of_a_transform(tmp_path: Path) -> None:
    other = [odometry(n / 10, (0.05 * n, (0, n, 0)), "/visual") for n in range(4)]
    bag = write_bag(tmp_path / "a", "ros2", [*recording(), *other, *[odometry(n / 10, drive(n)) for n in range(4)]])
    np.testing.assert_allclose(datasets.open(bag).poses()[3], at(3), atol=1e-14)
    expected = motion_matrix((0.15, (0, 3, 0))) @ motion_matrix(MOUNT)
    named = datasets.open(bag, topics={"pose": "/visual"})
    np.testing.assert_allclose(named.poses()[3], expected, atol=1e-14)


def test_poses_of_nobody_are_those_of_the_camera(tmp_path: Path) -> None:
    images = [image(n / 10, stored_image(n), "16UC1") for n in range(2)]
    stamped = [pose_stamped(n / 10, drive(n)) for n in range(2)]
    nameless = [odometry(n / 10, drive(n), child="") for n in range(2)]
    for name, moving in {"stamped": stamped, "nameless": nameless}.items():
        poses = datasets.open(write_bag(tmp_path / name, "ros1", [info(), *moving, *images])).poses()
        np.testing.assert_allclose(poses, [motion_matrix(drive(n)) for n in range(2)], atol=1e-14)


def test_the_world_may_be_named(tmp_path: Path) -> None:
    messages = [*recording(3), *[transform(n / 10, "map", WORLD, (0.1 * n, (0, 0, n))) for n in range(3)]]
    bag = write_bag(tmp_path / "a", "ros2", messages)
    root = [motion_matrix((0.1 * n, (0, 0, n))) @ at(n) for n in range(3)]
    np.testing.assert_allclose(datasets.open(bag).poses(), root, atol=1e-14)
    np.testing.assert_allclose(datasets.open(bag, world_frame=WORLD).poses(), [at(n) for n in range(3)], atol=1e-14)
    # Named, the world may be one in which the camera stands still.
    still = datasets.open(bag, world_frame=BASE).poses()
    np.testing.assert_allclose(still, [motion_matrix(MOUNT)] * 3, atol=1e-14)


def test_frames_far_from_any_pose_are_left_out(tmp_path: Path) -> None:
    messages = recording(3) + [image(t, stored_image(3), "16UC1") for t in (0.29, 0.35)]
    bag = write_bag(tmp_path / "a", "mcap", messages)
    dataset = datasets.open(bag)
    assert [frame.index for frame in dataset] == [0, 1, 2, 3]
    assert "the nearest pose is 150.0 ms away; the limit is 100 ms" in dataset.skipped[4]
    assert len(datasets.open(bag, max_gap=0.2)) == 5
    assert len(datasets.open(bag, max_gap=0.001)) == 3


def test_slashes_before_the_names_of_frames_mean_nothing(tmp_path: Path) -> None:
    messages = [info(), transform(0, f"/{BASE}", f"/{OPTICAL}", MOUNT, TF_STATIC)]
    messages += [transform(n / 10, f"/{WORLD}", BASE, drive(n)) for n in range(2)]
    messages += [image(n / 10, stored_image(n), "16UC1", frame=f"/{OPTICAL}") for n in range(2)]
    dataset = datasets.open(write_bag(tmp_path / "a", "ros1", messages))
    np.testing.assert_allclose(dataset.poses()[1], at(1), atol=1e-14)


def test_the_camera_is_p_for_rectified_images_and_k_for_others(tmp_path: Path) -> None:
    raw = "/camera/depth/image_raw"
    bag = write_bag(tmp_path / "a", "ros2", [info(scale=2), *recording()[1:], image(0, stored_image(0), "16UC1", raw)])
    assert datasets.open(bag, topics={"depth": DEPTH}).camera == CAMERA
    assert datasets.open(bag, topics={"depth": raw}).camera.fx == 2 * CAMERA.fx


def test_intrinsics_are_those_beside_the_images(tmp_path: Path) -> None:
    messages = [*recording(), info("/camera/color/camera_info", distortion=(0.1, 0, 0, 0, 0))]
    bag = write_bag(tmp_path / "a", "ros2", messages)
    assert datasets.open(bag).camera == CAMERA
    assert datasets.open(bag, topics={"camera_info": INFO}).camera == CAMERA


def test_messages_of_the_same_time_are_told_apart(tmp_path: Path) -> None:
    messages = recording(1) + [image(0, stored_image(n), "16UC1") for n in (1, 2)]
    messages += [transform(0.1, WORLD, BASE, drive(1))]
    for kind in KINDS:
        dataset = datasets.open(write_bag(tmp_path / kind, kind, messages))
        assert [dataset[n].depth.tolist() for n in (2, 0, 1)] == [metres(stored_image(n), 1000) for n in (2, 0, 1)]


def test_a_bag_is_read_on_several_threads(tmp_path: Path) -> None:
    dataset = datasets.open(write_bag(tmp_path / "a", "ros1", recording(12)))
    wrong: list[bool] = []

    def read(step: int) -> None:
        expected = [metres(stored_image(n), 1000) for n in range(12)][::step]
        wrong.extend(a.depth.tolist() != b for a, b in zip(dataset[::step], expected, strict=True))

    threads = [threading.Thread(target=read, args=(step,)) for step in (1, -1, 2, 3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == [False] * (12 + 12 + 6 + 4)


def test_a_bag_is_closed_when_nothing_refers_to_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[Sequence[object]] = []
    monkeypatch.setattr(AnyReader, "close", lambda reader: closed.append(reader.paths))
    bag = write_bag(tmp_path / "a", "ros2", recording(2))
    dataset = datasets.open(bag)
    part = dataset[:1]
    del dataset
    gc.collect()
    assert not closed
    del part
    gc.collect()
    assert closed == [[bag]]


def test_a_bag_may_be_told_by_its_storage_or_its_folder(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "a", "ros2", recording())
    assert len(list(datasets.open(next(folder.glob("*.db3"))))) == 4
    mcap = write_bag(tmp_path / "b", "mcap", recording())
    assert len(list(datasets.open(mcap.parent))) == 4
