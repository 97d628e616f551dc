"""Data sets of depth images, and of point clouds."""

from __future__ import annotations

from pathlib import Path
from typing import Self

from .._core import PinholeCamera
from .frame import Frame, PointFrame
from .listing import Listing, Ref
from .recording import Recording


class Dataset(Recording[Frame]):
    """The frames of a data set: iterate, take `dataset[7]`, or slice: `dataset[::10]` is a data set again.

    Iterating decodes a few frames ahead on another thread; each iteration starts anew. A frame that cannot be read
    raises `DatasetError` in its place, or with `skip_bad` is left out and noted in `skipped`.

    Attributes:
        path: what was opened.
        format: what it was recognised as, for example "7-Scenes".
        camera: the camera of the depth images; the first one's, where each has its own (`Frame.camera` counts).
    """

    def __init__(
        self, path: Path, format: str, listing: Listing[Ref[Frame]], camera: PinholeCamera, *, skip_bad: bool
    ) -> None:
        super().__init__(path, format, listing, skip_bad=skip_bad)
        self.camera = camera

    def _with(self, listing: Listing[Ref[Frame]]) -> Self:
        return type(self)(self.path, self.format, listing, self.camera, skip_bad=self._skip_bad)


class Scans(Recording[PointFrame]):
    """The point clouds of a data set: iterate, take `scans[7]`, or slice: `scans[::10]` are scans again.

    Iterating, errors and `skip_bad` are as in `Dataset`.

    Attributes:
        path: what was opened.
        format: what it was recognised as, for example "KITTI odometry".
    """
