"""Depth images and point clouds with poses, from the usual data sets.

```python
for frame in pyramap.datasets.open("redkitchen"):
    grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
```

To read another kind of data set, write a module with a `Format` and add it to `FORMATS` or `SCAN_FORMATS`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from .._core import PinholeCamera
from .colour import ColourRef
from .dataset import Dataset, Scans
from .errors import DatasetError
from .frame import Frame, PointFrame
from .kitti import KITTI
from .listing import AnyRef, Format, FrameRef, Listing, Options, Ref, ScanRef
from .live import Live
from .nerfstudio import NERFSTUDIO
from .record3d import RECORD3D
from .redwood import REDWOOD
from .replica import REPLICA
from .ros import ROS, ROS_SCANS
from .ros_topics import DEPTH_ROLES, SCAN_ROLES, check_roles
from .scannet import SCANNET
from .seven_scenes import SEVEN_SCENES
from .stray import STRAY
from .tum import TUM

__all__ = [
    "FORMATS",
    "SCAN_FORMATS",
    "ColourRef",
    "Dataset",
    "DatasetError",
    "Format",
    "Frame",
    "FrameRef",
    "Listing",
    "Live",
    "Options",
    "PointFrame",
    "ScanRef",
    "Scans",
    "open",
    "open_scans",
]


FORMATS: tuple[Format[FrameRef], ...] = (
    SEVEN_SCENES,
    TUM,
    REDWOOD,
    SCANNET,
    REPLICA,
    NERFSTUDIO,
    STRAY,
    RECORD3D,
    ROS,
)
"""The kinds of data set with depth images that `open` knows, in the order in which it tries them."""

SCAN_FORMATS: tuple[Format[ScanRef], ...] = (KITTI, ROS_SCANS)
"""The kinds of data set with point clouds that `open_scans` knows, in the order in which it tries them."""


def open(
    path: str | os.PathLike[str],
    *,
    skip_bad: bool = False,
    camera: PinholeCamera | None = None,
    stride: int = 1,
    limit: int | None = None,
    max_gap: float | None = None,
    topics: Mapping[str, str] | None = None,
    world_frame: str | None = None,
) -> Dataset:
    """Opens a data set of depth images, recognised by its content.

    Args:
        path: its folder: 7-Scenes, TUM RGB-D, Redwood/ICL-NUIM (there also the `.log` trajectory itself), ScanNet,
            Replica, nerfstudio (there also the `transforms.json` itself), or Stray Scanner; or its file: Record3D's
            `.r3d`, or a ROS 1 or ROS 2 bag (`.bag`, `.mcap`, `.db3`, or a ROS 2 bag's folder).
        skip_bad: leave out frames that cannot be read, and note them in `Dataset.skipped`, instead of raising.
        camera: the camera of the depth images, in the place of the data set's own or its usual one.
        stride: take every `stride`-th frame.
        limit: take at most that many frames (after the stride).
        max_gap: where poses have times of their own, how far the nearest pose may be from the image, in seconds; by
            default 0.02 for TUM RGB-D and 0.1 for bags. Frames without such a pose are not an error; they are noted in
            `Dataset.skipped`.
        topics: for bags, which topic to take where there are several: "depth" (sensor_msgs Image or, with the
            transport compressedDepth, CompressedImage), "camera_info", and "pose" (Odometry or PoseStamped, in the
            place of tf's edge to the same frame).
        world_frame: for bags, the frame that is the world: one above the sensor's in the tree of transforms, by
            default the root.

    Raises:
        DatasetError: if no format fits, or the data set as a whole cannot be used: no poses, no images, not as many of
            one as of the other where only their order matches them, or a package that its format needs is missing.
        ValueError: if `stride`, `limit` or `max_gap` is out of range, or a key of `topics` is none of these.
    """
    _check_part(stride, limit)
    _check_gap(max_gap)
    check_roles(topics or {}, DEPTH_ROLES)
    root = Path(path)
    format = _recognise(root, FORMATS, SCAN_FORMATS, "these are point clouds, for `open_scans`")
    listing = format.list_frames(root, Options(skip_bad, camera, max_gap, topics or {}, world_frame))
    dataset = Dataset(root, format.name, listing, listing.frames[0].camera, skip_bad=skip_bad)
    return dataset[::stride][:limit]


def open_scans(
    path: str | os.PathLike[str],
    *,
    skip_bad: bool = False,
    stride: int = 1,
    limit: int | None = None,
    max_gap: float | None = None,
    topics: Mapping[str, str] | None = None,
    world_frame: str | None = None,
) -> Scans:
    """Opens a data set of point clouds, recognised by its content.

    Args:
        path: the folder of a KITTI odometry sequence (`sequences/00`), or a ROS 1 or ROS 2 bag.
        skip_bad: leave out scans that cannot be read, and note them in `Scans.skipped`, instead of raising.
        stride: take every `stride`-th scan.
        limit: take at most that many scans (after the stride).
        max_gap: for bags, how far the nearest pose may be from the scan, in seconds; by default 0.1. Scans without such
            a pose are not an error; they are noted in `Scans.skipped`.
        topics: for bags, which topic to take where there are several: "points" (PointCloud2) and "pose" (as in `open`).
        world_frame: for bags, the frame that is the world, as in `open`.

    Raises:
        DatasetError: if no format fits, or the data set as a whole cannot be used.
        ValueError: if `stride`, `limit` or `max_gap` is out of range, or a key of `topics` is none of these.
    """
    _check_part(stride, limit)
    _check_gap(max_gap)
    check_roles(topics or {}, SCAN_ROLES)
    root = Path(path)
    format = _recognise(root, SCAN_FORMATS, FORMATS, "these are depth images, for `open`")
    listing = format.list_frames(root, Options(skip_bad, None, max_gap, topics or {}, world_frame))
    return Scans(root, format.name, listing, skip_bad=skip_bad)[::stride][:limit]


def _check_part(stride: int, limit: int | None) -> None:
    if stride < 1:
        raise ValueError(f"stride must be at least 1, got {stride}")
    if limit is not None and limit < 0:
        raise ValueError(f"limit must be at least 0, got {limit}")


def _check_gap(max_gap: float | None) -> None:
    if max_gap is not None and not max_gap >= 0:
        raise ValueError(f"max_gap must be at least 0 seconds, got {max_gap}")


def _recognise(
    path: Path, formats: Sequence[Format[AnyRef]], others: Sequence[Format[Ref[object]]], hint: str
) -> Format[AnyRef]:
    if not path.exists():
        raise DatasetError(path, "there is no such folder or file")
    for format in formats:
        if format.recognise(path):
            return format
    for other in others:
        if other.recognise(path):
            raise DatasetError(path, f"{other.name}: {hint}")
    wanted = "; ".join(f"{format.name} ({format.looks_for})" for format in formats)
    raise DatasetError(path, f"not a data set that is known here. Looked for {wanted}. Found {_content(path)}")


def _content(path: Path, at_most: int = 8) -> str:
    if not path.is_dir():
        return "a file, not a folder"
    names = sorted(entry.name + "/" * entry.is_dir() for entry in path.iterdir())
    more = f" and {len(names) - at_most} more" if len(names) > at_most else ""
    return ", ".join(names[:at_most]) + more if names else "nothing: it is empty"
