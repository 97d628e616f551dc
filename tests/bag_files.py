"""Writes small ROS 1 and ROS 2 bags with the package rosbags, for the tests of their reader."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
from dataset_files import AXIS, CAMERA, HEIGHT, WIDTH, rodrigues
from numpy.typing import NDArray
from PIL import Image
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

Kind = Literal["ros1", "ros2", "mcap"]
KINDS: tuple[Kind, ...] = ("ros1", "ros2", "mcap")
START = 1_700_000_000
"""Seconds: what is recorded begins then."""

DEPTH, INFO, POINTS, ODOMETRY, POSES = (
    "/camera/depth/image_rect",
    "/camera/depth/camera_info",
    "/lidar",
    "/odom",
    "/pose",
)
TF, TF_STATIC = "/tf", "/tf_static"
OPTICAL, BASE, WORLD = "camera_depth_optical_frame", "base_link", "odom"

_TYPES = {
    "image": "sensor_msgs/msg/Image",
    "compressed": "sensor_msgs/msg/CompressedImage",
    "info": "sensor_msgs/msg/CameraInfo",
    "points": "sensor_msgs/msg/PointCloud2",
    "odometry": "nav_msgs/msg/Odometry",
    "pose": "geometry_msgs/msg/PoseStamped",
    "tf": "tf2_msgs/msg/TFMessage",
}
Message = tuple[str, str, float, dict[str, Any]]
"""Topic, type (a key of `_TYPES`), seconds after START, and the fields that are not zero."""


def write_bag(path: Path, kind: Kind, messages: Sequence[Message]) -> Path:
    """Writes messages in their order; gives the path to open: a `.bag`, a folder, or the `.mcap` in a folder."""
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    if _TYPES["tf"] not in store.types:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", _TYPES["tf"]))
    path = path.with_suffix(".bag") if kind == "ros1" else path
    storage = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    writer: Any = Writer1(path) if kind == "ros1" else Writer2(path, version=9, storage_plugin=storage)
    with writer:
        connections: dict[str, Any] = {}
        for topic, name, time, fields in messages:
            kind_of_message = _TYPES[name]
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind_of_message, typestore=store)
            message = _make(store, kind_of_message, fields)
            serialize = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
            writer.write(connections[topic], nanoseconds(time), serialize(message, kind_of_message))
    return next(path.glob("*.mcap")) if kind == "mcap" else path


def _make(store: Any, name: str, values: dict[str, Any]) -> Any:
    """A message with these fields, and zeros in the others; the names of fields are ROS 2's."""
    fields = {}
    for field, (node, detail) in store.fielddefs[name][1]:
        value = values.get(field.lower())
        if node == Nodetype.NAME and (value is None or isinstance(value, dict)):
            value = _make(store, detail, value or {})
        elif node == Nodetype.SEQUENCE and isinstance(value, list) and detail[0][0] == Nodetype.NAME:
            value = [_make(store, detail[0][1], element) for element in value]
        fields[field] = _zero(node, detail) if value is None else value
    return store.types[name](**fields)


def _zero(node: Nodetype, detail: Any) -> Any:
    if node == Nodetype.BASE:
        return "" if detail[0] == "string" else 0
    (inner, (base, *_)), size = detail
    return [] if inner == Nodetype.NAME or base == "string" else np.zeros(size, base)


def nanoseconds(time: float) -> int:
    """Exact for the times of the tests, which are whole milliseconds."""
    return START * 10**9 + round(time * 1000) * 10**6


def header(time: float, frame: str) -> dict[str, Any]:
    second, nanosecond = divmod(nanoseconds(time), 10**9)
    return {"stamp": {"sec": second, "nanosec": nanosecond}, "frame_id": frame}


def image(time: float, stored: NDArray[Any], encoding: str, topic: str = DEPTH, frame: str = OPTICAL) -> Message:
    """Rows are padded by 6 bytes, as drivers may do."""
    rows = np.ascontiguousarray(stored).view(np.uint8).reshape(stored.shape[0], -1)
    padded = np.pad(rows, ((0, 0), (0, 6)), constant_values=7)
    fields = {"height": stored.shape[0], "width": stored.shape[1], "encoding": encoding, "step": padded.shape[1]}
    big = int(stored.dtype.byteorder == ">")
    return topic, "image", time, {"header": header(time, frame), "is_bigendian": big, "data": padded.ravel(), **fields}


def compressed_depth(time: float, stored: NDArray[np.uint16], kind: str = "16UC1; compressedDepth png") -> Message:
    png = BytesIO()
    Image.fromarray(stored).save(png, "PNG")
    data = np.frombuffer(bytes(12) + png.getvalue(), np.uint8)
    return (
        f"{DEPTH}/compressedDepth",
        "compressed",
        time,
        {"header": header(time, OPTICAL), "format": kind, "data": data},
    )


def info(topic: str = INFO, distortion: Sequence[float] = (), scale: float = 1.0) -> Message:
    """CAMERA's; K is `scale` times larger than P."""
    k = np.array([CAMERA.fx, 0, CAMERA.cx, 0, CAMERA.fy, CAMERA.cy, 0, 0, 1])
    p = np.insert(k.reshape(3, 3), 3, 0, axis=1).ravel()
    k[:6] *= scale
    fields = {"height": HEIGHT, "width": WIDTH, "k": k, "p": p, "d": np.array(distortion, np.float64)}
    return topic, "info", 0, {"header": header(0, OPTICAL), **fields}


def cloud(time: float, points: NDArray[np.floating[Any]], frame: str = "lidar", topic: str = POINTS) -> Message:
    """Points with an intensity before the coordinates and four bytes of nothing after; in two rows, each padded."""
    kind = np.dtype({"names": ["i", "x", "y", "z"], "formats": [np.uint16, *[points.dtype] * 3]})
    step = kind.itemsize + 4
    data = np.full((2, len(points) // 2 * step + 3), 9, np.uint8)
    for n, point in enumerate(points):
        row, column = divmod(n, len(points) // 2)
        data[row, column * step :][: kind.itemsize] = np.frombuffer(np.array((n, *point), kind).tobytes(), np.uint8)
    datatype = 7 if points.dtype == np.float32 else 8
    size = points.dtype.itemsize
    fields = [{"name": "intensity", "offset": 0, "datatype": 4, "count": 1}]
    fields += [{"name": axis, "offset": 2 + size * i, "datatype": datatype, "count": 1} for i, axis in enumerate("xyz")]
    layout = {"height": 2, "width": len(points) // 2, "point_step": step, "row_step": data.shape[1]}
    return topic, "points", time, {"header": header(time, frame), "fields": fields, "data": data.ravel(), **layout}


Motion = tuple[float, Sequence[float]]
"""An angle about AXIS, and a position."""


def motion_matrix(motion: Motion) -> NDArray[np.float64]:
    angle, position = motion
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rodrigues(angle), position
    return matrix


def _rotation(angle: float) -> dict[str, float]:
    x, y, z = np.sin(angle / 2) * AXIS
    return {"x": float(x), "y": float(y), "z": float(z), "w": float(np.cos(angle / 2))}


def _xyz(position: Sequence[float]) -> dict[str, float]:
    return dict(zip("xyz", map(float, position), strict=True))


def transform(time: float, parent: str, child: str, motion: Motion, topic: str = TF) -> Message:
    angle, position = motion
    values = {"translation": _xyz(position), "rotation": _rotation(angle)}
    edge = {"header": header(time, parent), "child_frame_id": child, "transform": values}
    return topic, "tf", time, {"transforms": [edge]}


def odometry(time: float, motion: Motion, topic: str = ODOMETRY, child: str = BASE) -> Message:
    angle, position = motion
    pose = {"pose": {"position": _xyz(position), "orientation": _rotation(angle)}}
    return topic, "odometry", time, {"header": header(time, WORLD), "child_frame_id": child, "pose": pose}


def pose_stamped(time: float, motion: Motion) -> Message:
    angle, position = motion
    pose = {"position": _xyz(position), "orientation": _rotation(angle)}
    return POSES, "pose", time, {"header": header(time, WORLD), "pose": pose}
