"""ROS 1 and ROS 2 bags: depth images with CameraInfo, or point clouds; poses from tf, Odometry or PoseStamped."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera
from . import ros_messages as messages
from .errors import DatasetError
from .listing import Format, FrameRef, Listing, Options, ScanRef
from .ros_bag import Bag, Place
from .ros_frames import Chain, find_chain
from .ros_topics import CAMERA_INFO, DEPTH, POINTS, POSE, choose, is_ros_bag

# Seconds between a message and a pose: odometry comes at 10 Hz and more.
MAX_GAP = 0.1

AnyRef = TypeVar("AnyRef", FrameRef, ScanRef)


def _list_depth(path: Path, options: Options) -> Listing[FrameRef]:
    bag = Bag(path)
    topic = _depth_topic(bag, options.topics.get(DEPTH))
    camera = options.camera or _camera(bag, topic, options.topics.get(CAMERA_INFO))

    def frame(index: int, place: Place, time: float, read_pose: Callable[[], NDArray[np.float64]]) -> FrameRef:
        return FrameRef(index, camera, partial(_read_depth, bag, place), read_pose, time)

    return _list(bag, topic, options, frame)


def _list_scans(path: Path, options: Options) -> Listing[ScanRef]:
    bag = Bag(path)
    candidates = bag.topics(messages.POINT_CLOUD)
    topic = choose(bag, options.topics.get(POINTS), candidates, POINTS, "point clouds (PointCloud2)")

    def scan(index: int, place: Place, time: float, read_pose: Callable[[], NDArray[np.float64]]) -> ScanRef:
        return ScanRef(index, partial(_read_points, bag, place), read_pose, time)

    return _list(bag, topic, options, scan)


def _list(
    bag: Bag,
    topic: str,
    options: Options,
    make: Callable[[int, Place, float, Callable[[], NDArray[np.float64]]], AnyRef],
) -> Listing[AnyRef]:
    """Every message of a topic whose sensor has a pose near enough in time."""
    max_gap = MAX_GAP if options.max_gap is None else options.max_gap
    chains: dict[str, Chain] = {}
    frames: list[AnyRef] = []
    dropped: dict[int, str] = {}
    for index, (place, message) in enumerate(bag.places(topic)):
        if isinstance(message, DatasetError):
            if not options.skip_bad:
                raise message
            dropped[index] = str(message)
            continue
        sensor, time = messages.frame_id(message.header), messages.stamp(message)
        if sensor not in chains:
            chains[sensor] = find_chain(bag, sensor, options.topics.get(POSE), options.world_frame)
        gap = chains[sensor].gap(time)
        if gap > max_gap:
            dropped[index] = (
                f"{topic} at {time:.3f} s: the nearest pose is {gap * 1e3:.1f} ms away; "
                f"the limit is {max_gap * 1e3:g} ms"
            )
            continue
        frames.append(make(index, place, time, partial(chains[sensor].pose_at, time, max_gap)))
    if not frames:
        raise DatasetError(bag.path, f"none of its {len(dropped)} messages can be used: {dropped[0]}")
    return Listing(frames, dropped)


def _depth_topic(bag: Bag, named: str | None) -> str:
    """The topic of depth images. What a topic holds is known by its first message."""
    images = bag.topics(messages.IMAGE, messages.COMPRESSED_IMAGE)
    if named is not None and named in images:
        return named  # an image that is no depth is refused when it is read, with what it is
    first = {topic: bag.first(topic) for topic in images}
    candidates = [topic for topic in images if messages.is_depth(first[topic])]
    if not candidates and images:
        kinds = ", ".join(f"{topic} ({messages.encoding(first[topic])})" for topic in images)
        raise DatasetError(bag.path, f"no image is depth (16UC1 or 32FC1); there are: {kinds}")
    return choose(bag, named, candidates, DEPTH, "depth images")


def _camera(bag: Bag, depth: str, named: str | None) -> PinholeCamera:
    """The camera of the CameraInfo that is named, else of the one beside the images, else of the only one."""
    candidates = bag.topics(messages.CAMERA_INFO)
    beside = f"{depth.rpartition('/')[0]}/camera_info"
    if named is None and beside in candidates:
        named = beside
    topic = choose(bag, named, candidates, CAMERA_INFO, "intrinsics (CameraInfo)")
    rectified = "rect" in depth.rpartition("/")[2]
    return messages.camera(bag.path, topic, bag.first(topic), rectified=rectified)


def _read_depth(bag: Bag, place: Place, camera: PinholeCamera) -> NDArray[np.float32]:
    return messages.depth_image(bag.path, place.topic, bag.message_at(place), camera)


def _read_points(bag: Bag, place: Place) -> NDArray[np.float32]:
    return messages.points(bag.path, place.topic, bag.message_at(place))


_LOOKS_FOR = "a file .bag, .mcap or .db3, or metadata.yaml"

ROS = Format(name="ROS bag", looks_for=_LOOKS_FOR, recognise=is_ros_bag, list_frames=_list_depth)
ROS_SCANS = Format(name="ROS bag", looks_for=_LOOKS_FOR, recognise=is_ros_bag, list_frames=_list_scans)
