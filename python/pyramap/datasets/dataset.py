"""A data set as an iterable of frames."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera
from .errors import DatasetError
from .frame import Frame
from .listing import FrameRef, Listing, part
from .prefetch import prefetch


class Dataset:
    """The frames of a data set: iterate, take `dataset[7]`, or slice: `dataset[::10]` is a data set again.

    Iterating decodes a few frames ahead on another thread; each iteration starts anew. A frame that cannot be read
    raises `DatasetError` in its place, or with `skip_bad` is left out and noted in `skipped`.

    Attributes:
        path: what was opened.
        format: what it was recognised as, for example "7-Scenes".
        camera: the camera of all its depth images.
    """

    def __init__(self, path: Path, format: str, listing: Listing, *, skip_bad: bool) -> None:
        self.path = path
        self.format = format
        self.camera: PinholeCamera = listing.camera
        self._listing = listing
        self._skip_bad = skip_bad
        self._skipped = dict(listing.dropped)

    @property
    def name(self) -> str:
        """The name of the folder (or trajectory file) that was opened."""
        return self.path.resolve().name

    @property
    def skipped(self) -> Mapping[int, str]:
        """The frames left out so far, by index, with the reason; complete after one whole iteration.

        Holds the frames that have no pose near enough in time and, with `skip_bad`, those that could not be read.
        """
        return dict(sorted(self._skipped.items()))

    def __len__(self) -> int:
        """How many frames there are to read, the unreadable ones included: nothing is decoded to count them."""
        return len(self._listing.frames)

    def __iter__(self) -> Generator[Frame, None, None]:
        for ref, result in prefetch(self._try_load, self._listing.frames):
            if isinstance(result, Frame):
                yield result
            else:
                self._note(ref, result)

    @overload
    def __getitem__(self, key: int) -> Frame: ...
    @overload
    def __getitem__(self, key: slice) -> Dataset: ...
    def __getitem__(self, key: int | slice) -> Frame | Dataset:
        """Frame number `key` in reading order, decoded now (or raising `DatasetError`); or a part, not decoded."""
        if isinstance(key, int):
            return self._load(self._listing.frames[key])
        return Dataset(self.path, self.format, part(self._listing, key), skip_bad=self._skip_bad)

    def poses(self) -> NDArray[np.float64]:
        """`world_from_camera` of all frames, (N, 4, 4) float64, without decoding any image.

        Raises:
            DatasetError: for a pose that cannot be read; with `skip_bad` it is left out and noted in `skipped`.
        """
        poses = []
        for ref in self._listing.frames:
            try:
                poses.append(ref.read_pose())
            except DatasetError as error:
                self._note(ref, error)
        return np.array(poses, dtype=np.float64).reshape(-1, 4, 4)

    def _note(self, ref: FrameRef, error: DatasetError) -> None:
        if not self._skip_bad:
            raise error
        self._skipped[ref.index] = str(error)

    def _try_load(self, ref: FrameRef) -> tuple[FrameRef, Frame | DatasetError]:
        """The error as a value, so that a bad frame ends neither the thread's work nor the iteration."""
        try:
            return ref, self._load(ref)
        except DatasetError as error:
            return ref, error

    def _load(self, ref: FrameRef) -> Frame:
        return Frame(
            index=ref.index,
            world_from_camera=ref.read_pose(),
            depth=self._listing.read_depth(ref.depth_path, self.camera),
            camera=self.camera,
            timestamp=ref.timestamp,
            color_path=ref.color_path,
        )
