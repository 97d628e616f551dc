"""What a format must say about a data set: its frames, before anything is decoded."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera
from .colour import ColourRef
from .frame import Frame, PointFrame

Loaded = TypeVar("Loaded", covariant=True)


class Ref(Protocol[Loaded]):
    """Where one frame comes from; light enough to list a whole data set."""

    @property
    def index(self) -> int:
        """The frame's number in the data set."""

    @property
    def read_pose(self) -> Callable[[], NDArray[np.float64]]:
        """Gives the frame's pose, (4, 4) float64, or raises `DatasetError`."""

    def load(self) -> Loaded:
        """Decodes the frame, or raises `DatasetError`."""


@dataclass(frozen=True, slots=True)
class FrameRef:
    """Where one depth image comes from.

    Attributes:
        index: the frame's number in the data set.
        camera: the camera of its depth image.
        read_depth: decodes its depth image, which must be of that camera: (H, W) float32 metres, or raises
            `DatasetError`.
        read_pose: gives `world_from_camera`, (4, 4) float64, or raises `DatasetError`.
        timestamp: seconds, or None.
        colour_path: the file of its colour image, or None.
        colour: where its colour image comes from, or None.
    """

    index: int
    camera: PinholeCamera
    read_depth: Callable[[PinholeCamera], NDArray[np.float32]]
    read_pose: Callable[[], NDArray[np.float64]]
    timestamp: float | None = None
    colour_path: Path | None = None
    colour: ColourRef | None = None

    def load(self) -> Frame:
        """The frame, decoded; raises `DatasetError`."""
        return Frame(
            index=self.index,
            world_from_camera=self.read_pose(),
            depth=self.read_depth(self.camera),
            camera=self.camera,
            timestamp=self.timestamp,
            colour_path=self.colour_path,
            colour_ref=self.colour,
        )


@dataclass(frozen=True, slots=True)
class ScanRef:
    """Where one point cloud comes from.

    Attributes:
        index: the scan's number in the data set.
        read_points: decodes it: (N, 3) float32 metres, or raises `DatasetError`.
        read_pose: gives `world_from_sensor`, (4, 4) float64, or raises `DatasetError`.
        timestamp: seconds, or None.
    """

    index: int
    read_points: Callable[[], NDArray[np.float32]]
    read_pose: Callable[[], NDArray[np.float64]]
    timestamp: float | None = None

    def load(self) -> PointFrame:
        """The scan, decoded; raises `DatasetError`."""
        return PointFrame(
            index=self.index,
            world_from_sensor=self.read_pose(),
            points=self.read_points(),
            timestamp=self.timestamp,
        )


AnyRef = TypeVar("AnyRef", bound=Ref[object], covariant=True)


@dataclass(frozen=True, slots=True)
class Listing(Generic[AnyRef]):
    """A data set before anything is decoded.

    Attributes:
        frames: in the order in which they are to be read; a format lists at least one, or raises `DatasetError`.
        dropped: the frames that are left out from the start, by index, with the reason.
    """

    frames: Sequence[AnyRef]
    dropped: Mapping[int, str] = field(default_factory=dict)


def part(listing: Listing[AnyRef], key: slice) -> Listing[AnyRef]:
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
    """What the caller of `open` or `open_scans` wants: see there."""

    skip_bad: bool = False
    camera: PinholeCamera | None = None
    max_gap: float | None = None
    topics: Mapping[str, str] = field(default_factory=dict)
    world_frame: str | None = None


@dataclass(frozen=True, slots=True)
class Format(Generic[AnyRef]):
    """A kind of data set, of depth images (`Format[FrameRef]`) or of point clouds (`Format[ScanRef]`).

    Attributes:
        name: what its users call it.
        looks_for: the files it is recognised by, in words, for the error that no format fits.
        recognise: whether a path is a data set of this kind; looks at names and first lines, and raises nothing.
        list_frames: lists a path that was recognised, or raises `DatasetError`.
    """

    name: str
    looks_for: str
    recognise: Callable[[Path], bool]
    list_frames: Callable[[Path, Options], Listing[AnyRef]]
