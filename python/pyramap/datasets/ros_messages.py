"""What the messages of ROS say, as arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera
from .errors import DatasetError
from .intrinsics import Intrinsics
from .png import decode_png_16
from .trajectory import TimedPose, unit_quaternion

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE_STAMPED = "geometry_msgs/msg/PoseStamped"
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")

MILLIMETRES, METRES = "16UC1", "32FC1"
_PIXELS: dict[str, np.dtype[Any]] = {MILLIMETRES: np.dtype("u2"), METRES: np.dtype("f4")}
_MILLIMETRES_A_METRE = np.float32(1000)
# The transport compressedDepth writes this many bytes, for 32FC1, before the PNG.
_COMPRESSED_DEPTH_HEADER = 12
_COMPRESSED_DEPTH = "compressedDepth"

# PointField's numbers for the types that coordinates come in.
_FLOATS: dict[int, np.dtype[Any]] = {7: np.dtype("f4"), 8: np.dtype("f8")}


def stamp(message: Any) -> float:
    """When a message with a header was measured, seconds."""
    time = message.header.stamp
    return float(time.sec + time.nanosec * 1e-9)


def frame_id(header: Any) -> str:
    """The name of the frame that a header names; ROS 1 may write it with a slash before it."""
    return str(header.frame_id).lstrip("/")


def encoding(message: Any) -> str:
    """The kind of pixels of an Image, such as "16UC1" or "rgb8"; of a CompressedImage with the kind of compression."""
    return str(message.encoding if hasattr(message, "encoding") else message.format)


def is_depth(message: Any) -> bool:
    """Whether an Image or CompressedImage is a depth image that can be read."""
    if hasattr(message, "encoding"):
        return message.encoding in _PIXELS
    pixels, _, transport = str(message.format).partition(";")
    return pixels.strip() == MILLIMETRES and transport.split()[:1] == [_COMPRESSED_DEPTH]


def depth_image(path: Path, topic: str, message: Any, camera: PinholeCamera) -> NDArray[np.float32]:
    """The depth of an Image (16UC1 in millimetres, 32FC1 in metres) or CompressedImage (compressedDepth, 16UC1).

    Returns:
        (H, W) float32, C-contiguous, metres; 0 where there is no reading, +inf where nothing was within the range
        (REP 118).

    Raises:
        DatasetError: if it is of another kind or size, or damaged.
    """
    if not is_depth(message):
        raise DatasetError(path, f"{topic}: expected depth (16UC1 or 32FC1), got an image of {encoding(message)!r}")
    if not hasattr(message, "encoding"):
        png = bytes(message.data[_COMPRESSED_DEPTH_HEADER:])
        return _metres(decode_png_16(png, path, camera))
    if (message.width, message.height) != (camera.width, camera.height):
        size = f"{message.width}x{message.height}"
        raise DatasetError(path, f"{topic}: the image is {size}, but the camera {camera.width}x{camera.height}")
    dtype = _PIXELS[message.encoding].newbyteorder(">" if message.is_bigendian else "<")
    row = message.width * dtype.itemsize
    if message.step < row or len(message.data) < message.step * message.height:
        raise DatasetError(path, f"{topic}: the image is cut off: {len(message.data)} bytes")
    rows = np.frombuffer(message.data, np.uint8, message.step * message.height).reshape(message.height, message.step)
    stored = np.ascontiguousarray(rows[:, :row]).view(dtype)
    if message.encoding == MILLIMETRES:
        return _metres(stored)
    depth = stored.astype(np.float32)
    depth[np.isnan(depth) | (depth < 0)] = 0.0
    return depth


def _metres(millimetres: NDArray[Any]) -> NDArray[np.float32]:
    metres: NDArray[np.float32] = np.divide(millimetres, _MILLIMETRES_A_METRE, dtype=np.float32)
    return metres


def points(path: Path, topic: str, message: Any) -> NDArray[np.float32]:
    """The finite points of a PointCloud2, (N, 3) float32, C-contiguous, metres.

    Raises:
        DatasetError: if it has no coordinates x, y and z of floating point, or is damaged.
    """
    fields = {field.name: field for field in message.fields}
    order: Literal["<", ">"] = ">" if message.is_bigendian else "<"
    try:
        chosen = [fields[name] for name in "xyz"]
        types = [_FLOATS[field.datatype].newbyteorder(order) for field in chosen]
        layout = np.dtype(
            {
                "names": ["x", "y", "z"],
                "formats": types,
                "offsets": [field.offset for field in chosen],
                "itemsize": message.point_step,
            }
        )
        rows = np.frombuffer(message.data, np.uint8, message.row_step * message.height)
        used = rows.reshape(message.height, message.row_step)[:, : message.width * message.point_step]
        stored = np.ascontiguousarray(used).reshape(-1).view(layout)
    except KeyError:
        there = ", ".join(fields) or "none"
        raise DatasetError(path, f"{topic}: expected points with x, y and z as floats, got {there}") from None
    except ValueError as error:
        raise DatasetError(path, f"{topic}: the point cloud is damaged: {error}") from None
    xyz = np.stack([stored[name].astype(np.float32) for name in "xyz"], axis=1)
    return np.ascontiguousarray(xyz[np.isfinite(xyz).all(axis=1)])


def camera(path: Path, topic: str, message: Any, *, rectified: bool) -> PinholeCamera:
    """The camera of a CameraInfo: its P for rectified images, else its K.

    Raises:
        DatasetError: if it is not calibrated, or the images are not rectified and the lens distorts.
    """
    if rectified:
        matrix = np.array(_either(message, "p")).reshape(3, 4)[:, :3]
    else:
        matrix = np.array(_either(message, "k")).reshape(3, 3)
        distortion = np.array(_either(message, "d"))
        if distortion.any():
            raise DatasetError(
                path,
                f"{topic}: the lens distorts (D = {distortion.tolist()}) and the image is not rectified: rectify it, "
                "or give the camera to take without that",
            )
    if matrix[0, 0] == 0:
        raise DatasetError(path, f"{topic}: the camera is not calibrated: its focal length is zero")
    return Intrinsics.of_matrix(path, matrix).camera(path, (message.width, message.height))


def timed_pose(path: Path, topic: str, time: float, position: Any, quaternion: Any) -> TimedPose:
    """A pose out of a message's position and rotation. Raises `DatasetError` if the rotation is none."""
    xyzw = [quaternion.x, quaternion.y, quaternion.z, quaternion.w]
    try:
        return TimedPose(time, np.array([position.x, position.y, position.z]), unit_quaternion(xyzw))
    except ValueError as error:
        raise DatasetError(path, f"{topic}: {error}") from None


def _either(message: Any, name: str) -> Any:
    """A field that ROS 2 writes small and ROS 1 writes large."""
    return getattr(message, name, None) if hasattr(message, name) else getattr(message, name.upper())
