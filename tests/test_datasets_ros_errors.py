"""The reader of bags: what is missing, damaged or cannot be chosen is an error that says what there is."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_files import (
    BASE,
    DEPTH,
    KINDS,
    OPTICAL,
    TF_STATIC,
    WORLD,
    Kind,
    Message,
    Motion,
    cloud,
    compressed_depth,
    image,
    info,
    odometry,
    transform,
    write_bag,
)
from dataset_files import CAMERA, HEIGHT, WIDTH, stored_image
from pyramap import datasets
from pyramap.datasets import DatasetError

STILL: Motion = (0.0, (0, 0, 0))
MOVES = [transform(t, WORLD, OPTICAL, (t, (t, 0, 0))) for t in (0, 0.1, 0.2)]
IMAGES = [image(n / 10, stored_image(n), "16UC1") for n in range(3)]
COLOR = image(0, np.zeros((HEIGHT, 3 * WIDTH), np.uint8), "rgb8", "/camera/color/image")
MONO = image(0, np.zeros((HEIGHT, WIDTH), np.uint16), "mono16", "/camera/infra/image")
CLOUD = cloud(0, np.ones((2, 3), np.float32))


CASES: dict[str, tuple[list[Message], dict[str, Any], str]] = {
    "no depth": (
        [COLOR, MONO, info(), *MOVES],
        {},
        r"no image is depth .*color/image \(rgb8\), /camera/inf",
    ),
    "no image": ([info(), *MOVES], {}, r"no topic of depth images; there are: .*depth/camera_info \(sensor_msgs/Camer"),
    "no intrinsics": (
        [*IMAGES, *MOVES],
        {},
        r"no topic of intrinsics \(CameraInfo\); there are: /camera/depth",
    ),
    "no poses": (
        [*IMAGES, info()],
        {},
        r"there are no poses: neither tf nor .* moves 'camera_depth.*there is no tf",
    ),
    "two depths": (
        [*IMAGES, info(), *MOVES, image(0, stored_image(0), "16UC1", "/other/depth")],
        {},
        rf"several topics of depth images: {DEPTH}, /other/depth; name one with topics={{'depth': \.\.\.}}",
    ),
    "two intrinsics": (
        [*IMAGES, info("/a/camera_info"), info("/b/camera_info"), *MOVES],
        {},
        r"several topics of intrinsics \(CameraInfo\): /a/camera_info, /b/camera_info; name one with topics={'camera_i",
    ),
    "two poses": (
        [*IMAGES, info(), odometry(0, STILL, "/a", OPTICAL), odometry(0, STILL, "/b", OPTICAL)],
        {},
        r"several topics of poses \(Odometry or PoseStamped\): /a, /b; name one with topics={'pose': \.\.\.}",
    ),
    "no such topic": (
        [*IMAGES, info(), *MOVES],
        {"topics": {"depth": "/depth"}},
        rf"'/depth' is no topic of depth images; there are: .*{DEPTH} \(sensor_msgs/Image\)",
    ),
    "wrong kind of topic": (
        [*IMAGES, info(), *MOVES],
        {"topics": {"pose": DEPTH}},
        rf"'{DEPTH}' is no topic of poses \(Odometry or PoseStamped\); there are: ",
    ),
    "stands still": (
        [*IMAGES, info(), transform(0, BASE, OPTICAL, STILL, TF_STATIC)],
        {},
        r"no poses: .*\(if it stands still in 'base_link', name that as world_frame\); transforms: base_link > camera_",
    ),
    "no such world": (
        [*IMAGES, info(), *MOVES],
        {"world_frame": "map"},
        r"'map' is not above 'camera_depth_optical_frame': transforms: odom > camera_depth_optical_frame",
    ),
    "not connected": (
        [*IMAGES, info(), odometry(0, STILL)],
        {"topics": {"pose": "/odom"}},
        r"nothing joins 'camera_depth_optical_frame' to 'base_link', which /odom moves: transforms: odom > base_link",
    ),
    "two parents": (
        [*IMAGES, info(), *MOVES, transform(0.3, "map", OPTICAL, STILL)],
        {},
        r"/tf: 'camera_depth_optical_frame' hangs from 'odom' and from 'map'",
    ),
    "circle": (
        [*IMAGES, info(), *MOVES, transform(0, OPTICAL, WORLD, STILL)],
        {},
        "the transforms go round in a circle",
    ),
    "no rotation": (
        [
            *IMAGES,
            info(),
            ("/tf", "tf", 0, {"transforms": [{"header": {"frame_id": WORLD}, "child_frame_id": OPTICAL}]}),
        ],
        {},
        "/tf: expected a unit quaternion, got one of length 0",
    ),
    "distorted": (
        [image(0, stored_image(0), "16UC1", "/d/image"), info("/d/camera_info", distortion=(0.1, 0)), *MOVES],
        {},
        r"/d/camera_info: the lens distorts \(D = \[0\.1, 0\.0\]\) and the image is not rectified: .* give the camera",
    ),
    "not calibrated": (
        [image(0, stored_image(0), "16UC1", "/d/image"), info("/d/camera_info", scale=0), *MOVES],
        {},
        "not calibrated: its focal length is zero",
    ),
    "far from all poses": (
        [*IMAGES, info(), *[transform(t, WORLD, OPTICAL, (t, (t, 0, 0))) for t in (5, 6)]],
        {},
        r"none of its 3 messages can be used: .*4800\.0 ms away|none of its 3 messages can be used: .*5000\.0 ms away",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_bag_that_cannot_be_used_says_what_is_missing_and_what_there_is(tmp_path: Path, case: str) -> None:
    messages, options, problem = CASES[case]
    for kind in ("ros1", "ros2"):
        bag = write_bag(tmp_path / kind, kind, messages)
        with pytest.raises(DatasetError, match=problem) as caught:
            datasets.open(bag, skip_bad=True, **options)
        assert caught.value.path == bag


def test_point_clouds_and_depth_images_are_opened_by_their_own_function(tmp_path: Path) -> None:
    clouds = write_bag(tmp_path / "a", "ros2", [CLOUD, *MOVES])
    with pytest.raises(DatasetError, match=r"no topic of depth images; there are: /lidar \(sensor_msgs/PointCloud2\)"):
        datasets.open(clouds)
    images = write_bag(tmp_path / "b", "ros2", [*IMAGES, info(), *MOVES])
    with pytest.raises(DatasetError, match=r"no topic of point clouds \(PointCloud2\); there are: .*sensor_msgs/Image"):
        datasets.open_scans(images)


def test_a_colour_image_that_is_named_as_depth_is_refused_with_what_it_is(tmp_path: Path) -> None:
    color = [image(n / 10, np.zeros((HEIGHT, 3 * WIDTH), np.uint8), "rgb8", "/c/rect") for n in range(2)]
    bag = write_bag(tmp_path / "a", "ros1", [*color, info("/c/camera_info"), *MOVES])
    dataset = datasets.open(bag, topics={"depth": "/c/rect"})
    with pytest.raises(DatasetError, match=r"/c/rect: expected depth \(16UC1 or 32FC1\), got an image of 'rgb8'"):
        list(dataset)


def damaged(fields: dict[str, Any]) -> Message:
    topic, name, time, content = image(0.1, stored_image(1), "16UC1")
    return topic, name, time, {**content, **fields}


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"data": np.zeros(50, np.uint8)}, f"{DEPTH}: the image is cut off: 50 bytes"),
        ({"step": 3}, f"{DEPTH}: the image is cut off"),
        ({"width": 7}, f"{DEPTH}: the image is 7x6, but the camera 8x6"),
        ({"encoding": "bayer_rggb8"}, "got an image of 'bayer_rggb8'"),
    ],
)
def test_a_damaged_image_spoils_one_frame(tmp_path: Path, fields: dict[str, Any], problem: str) -> None:
    bag = write_bag(tmp_path / "a", "ros2", [info(), *MOVES, IMAGES[0], damaged(fields), IMAGES[2]])
    with pytest.raises(DatasetError, match=problem):
        list(datasets.open(bag))
    dataset = datasets.open(bag, skip_bad=True)
    assert [frame.index for frame in dataset] == [0, 2]
    assert problem in dataset.skipped[1]


def test_compressed_depth_of_another_kind(tmp_path: Path) -> None:
    metres = compressed_depth(0, stored_image(0), "32FC1; compressedDepth png")
    bag = write_bag(tmp_path / "a", "ros2", [metres, info(), *MOVES])
    with pytest.raises(DatasetError, match=r"no image is depth .*compressedDepth \(32FC1; compressedDepth png\)"):
        datasets.open(bag)
    jpeg = ("/c", "compressed", 0, {"format": "rgb8; jpeg compressed bgr8"})
    with pytest.raises(DatasetError, match=r"no image is depth .*/c \(rgb8; jpeg compressed bgr8\)"):
        datasets.open(write_bag(tmp_path / "b", "ros2", [jpeg, info(), *MOVES]))
    topic, name, time, content = compressed_depth(0, stored_image(0))
    cut = (topic, name, time, {**content, "data": content["data"][:60]})
    dataset = datasets.open(write_bag(tmp_path / "c", "ros2", [cut, info(), *MOVES]), camera=CAMERA)
    with pytest.raises(DatasetError, match="damaged or truncated depth image"):
        list(dataset)


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"fields": []}, "/lidar: expected points with x, y and z as floats, got none"),
        ({"data": np.zeros(5, np.uint8)}, "/lidar: the point cloud is damaged"),
        ({"point_step": 4}, "/lidar: the point cloud is damaged"),
        ({"row_step": 1}, "/lidar: the point cloud is damaged"),
    ],
)
def test_a_damaged_point_cloud_spoils_one_scan(tmp_path: Path, fields: dict[str, Any], problem: str) -> None:
    topic, name, time, content = CLOUD
    bad = (topic, name, time + 0.1, {**content, **fields})
    poses = [odometry(t, (t, (0, 0, 0)), child="lidar") for t in (0, 0.1)]
    scans = datasets.open_scans(write_bag(tmp_path / "a", "ros2", [CLOUD, bad, *poses]), skip_bad=True)
    assert [scan.index for scan in scans] == [0]
    assert problem in scans.skipped[1]


@pytest.mark.parametrize("kind", KINDS)
def test_an_unreadable_bag(tmp_path: Path, kind: Kind) -> None:
    bag = write_bag(tmp_path / "a", kind, [*IMAGES, info(), *MOVES])
    file = next(bag.glob("*.db3")) if bag.is_dir() else bag
    good = file.read_bytes()
    for data in (b"", b"not a bag", good[:200], good[: len(good) // 2], bytes(len(good))):
        file.write_bytes(data)
        for function in (datasets.open, datasets.open_scans):
            with pytest.raises(DatasetError) as caught:
                function(bag)
            assert caught.value.path == bag
    if bag.is_dir():
        (bag / "metadata.yaml").write_text("{")
        with pytest.raises(DatasetError, match="not a bag that can be read"):
            datasets.open(bag)


@pytest.mark.parametrize("kind", KINDS)
def test_damage_within_a_bag_is_never_another_error(tmp_path: Path, kind: Kind) -> None:
    bag = write_bag(tmp_path / "a", kind, [*IMAGES, info(), *MOVES])
    file = next(bag.glob("*.db3")) if bag.is_dir() else bag
    good = file.read_bytes()
    random = np.random.default_rng(0)
    noticed = 0
    for at in random.integers(len(good), size=25).tolist():
        data = bytearray(good)
        data[at : at + 8] = random.bytes(8)
        file.write_bytes(data)
        try:
            list(datasets.open(bag))
        except DatasetError:
            noticed += 1
    assert noticed > 0


def test_a_message_that_cannot_be_decoded_spoils_one_frame(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "a", "ros2", [info(), *MOVES, *IMAGES])
    file = next(bag.glob("*.db3"))
    data = file.read_bytes()
    # The length that CDR writes before a text, here that which says what pixels are: now longer than the message.
    at = data.index(b"16UC1") - 4
    file.write_bytes(data[:at] + b"\xff\xff\xff\x7f" + data[at + 4 :])
    dataset = datasets.open(bag, skip_bad=True)
    read = [frame.index for frame in dataset]
    assert len(read) == 2
    (reason,) = dataset.skipped.values()
    assert f"{DEPTH}: a message is damaged" in reason
    with pytest.raises(DatasetError, match="a message is damaged"):
        datasets.open(bag)


def test_without_the_package_the_error_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = write_bag(tmp_path / "a", "ros1", [*IMAGES, info(), *MOVES])
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    for function in (datasets.open, datasets.open_scans):
        with pytest.raises(DatasetError, match=r"to read bags, install the extra: pip install pyramap\[ros\]"):
            function(bag)


def test_unknown_roles_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="topics may name depth, camera_info, pose, got image"):
        datasets.open(tmp_path, topics={"image": "/d"})
    with pytest.raises(ValueError, match="topics may name points, pose, got depth"):
        datasets.open_scans(tmp_path, topics={"depth": "/d"})
