"""What a format must say about a data set: its frames, before any image is decoded."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera


@dataclass(frozen=True, slots=True)
class FrameRef:
    """Where one frame comes from; light enough to list a whole data set.

    Attributes:
        index: the frame's number in the data set.
        depth_path: its depth image.
        read_pose: gives `world_from_camera`, (4, 4) float64, or raises `DatasetError`.
        timestamp: seconds, or None.
        color_path: its colour image, or None.
    """

    index: int
    depth_path: Path
    read_pose: Callable[[], NDArray[np.float64]]
    timestamp: float | None = None
    color_path: Path | None = None


@dataclass(frozen=True, slots=True)
class Listing:
    """A data set before any image is decoded.

    Attributes:
        frames: in the order in which they are to be read.
        camera: that of every depth image.
        read_depth: decodes a depth image of that camera: (H, W) float32 metres, or raises `DatasetError`.
        dropped: the frames that are left out from the start, by index, with the reason.
    """

    frames: Sequence[FrameRef]
    camera: PinholeCamera
    read_depth: Callable[[Path, PinholeCamera], NDArray[np.float32]]
    dropped: Mapping[int, str] = field(default_factory=dict)


def part(listing: Listing, key: slice) -> Listing:
    """The frames `listing.frames[key]`, and of the dropped frames those that lie among them."""
    frames = listing.frames
    taken = range(len(frames))[key]
    if not taken:
        return replace(listing, frames=[], dropped={})
    start, stop = min(taken), max(taken) + abs(taken.step)
    first = frames[start].index if start > 0 else -math.inf
    end = frames[stop].index if stop < len(frames) else math.inf
    dropped = {index: reason for index, reason in listing.dropped.items() if first <= index < end}
    return replace(listing, frames=[frames[i] for i in taken], dropped=dropped)


@dataclass(frozen=True, slots=True)
class Options:
    """What the caller of `open` wants: see there."""

    camera: PinholeCamera | None
    skip_bad: bool
    max_gap: float


@dataclass(frozen=True, slots=True)
class Format:
    """A kind of data set.

    Attributes:
        name: what its users call it.
        looks_for: the files it is recognised by, in words, for the error that no format fits.
        recognise: whether a path is a data set of this kind; looks at names and first lines, and raises nothing.
        list_frames: lists a path that was recognised, or raises `DatasetError`.
    """

    name: str
    looks_for: str
    recognise: Callable[[Path], bool]
    list_frames: Callable[[Path, Options], Listing]
