"""Which topic of a bag is to be taken: the caller's, or the only one there is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from .errors import DatasetError
from .ros_bag import Bag

DEPTH = "depth"
CAMERA_INFO = "camera_info"
POINTS = "points"
POSE = "pose"
DEPTH_ROLES = (DEPTH, CAMERA_INFO, POSE)
SCAN_ROLES = (POINTS, POSE)


def check_roles(topics: Mapping[str, str], roles: Sequence[str]) -> None:
    """Raises `ValueError` if a key of `topics` is none of `roles`."""
    unknown = set(topics) - set(roles)
    if unknown:
        raise ValueError(f"topics may name {', '.join(roles)}, got {', '.join(sorted(unknown))}")


def choose(bag: Bag, named: str | None, candidates: Sequence[str], role: str, wanted: str) -> str:
    """The topic for a role.

    Args:
        bag: the bag.
        named: the topic that the caller names, if one.
        candidates: the topics that could be it.
        role: what to call it, as a key of `topics`.
        wanted: what it is, in words, for errors.

    Raises:
        DatasetError: if the named one is no candidate, or none is named and there is not exactly one.
    """
    if named is not None:
        if named not in candidates:
            raise DatasetError(bag.path, f"{named!r} is no topic of {wanted}; there are: {bag.content()}")
        return named
    if not candidates:
        raise DatasetError(bag.path, f"there is no topic of {wanted}; there are: {bag.content()}")
    if len(candidates) > 1:
        raise DatasetError(
            bag.path, f"several topics of {wanted}: {', '.join(candidates)}; name one with topics={{{role!r}: ...}}"
        )
    return candidates[0]


def is_ros_bag(path: Path) -> bool:
    """Whether a path is a bag, by its name: `.bag`, `.mcap`, `.db3`, or a folder with a ROS 2 bag's metadata."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file()
    return path.suffix in (".bag", ".mcap", ".db3")
