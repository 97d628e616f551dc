"""Frames in their order, of whatever kind, read when asked for."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from pathlib import Path
from typing import Generic, Self, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from .errors import DatasetError
from .listing import Listing, Ref, part
from .prefetch import prefetch

AnyFrame = TypeVar("AnyFrame")


class Recording(Generic[AnyFrame]):
    """What a `Dataset` of depth images and a `Scans` of point clouds have in common.

    Iterating decodes a few frames ahead on another thread; each iteration starts anew. A frame that cannot be read
    raises `DatasetError` in its place, or with `skip_bad` is left out and noted in `skipped`.

    Attributes:
        path: what was opened.
        format: what it was recognised as, for example "7-Scenes".
    """

    def __init__(self, path: Path, format: str, listing: Listing[Ref[AnyFrame]], *, skip_bad: bool) -> None:
        self.path = path
        self.format = format
        self._listing = listing
        self._skip_bad = skip_bad
        self._skipped = dict(listing.dropped)

    @property
    def name(self) -> str:
        """The name of the folder or file that was opened."""
        return self.path.resolve().name

    @property
    def skipped(self) -> Mapping[int, str]:
        """The frames left out so far, by index, with the reason; complete after one whole iteration.

        Holds the frames that have no pose, or none near enough in time, and, with `skip_bad`, those that could not be
        read.
        """
        return dict(sorted(self._skipped.items()))

    def __len__(self) -> int:
        """How many frames there are to read, the unreadable ones included: nothing is decoded to count them."""
        return len(self._listing.frames)

    def __iter__(self) -> Generator[AnyFrame, None, None]:
        for ref, result in prefetch(_try_load, self._listing.frames):
            if isinstance(result, DatasetError):
                self._note(ref, result)
            else:
                yield result

    @overload
    def __getitem__(self, key: int) -> AnyFrame: ...
    @overload
    def __getitem__(self, key: slice) -> Self: ...
    def __getitem__(self, key: int | slice) -> AnyFrame | Self:
        """Frame number `key` in reading order, decoded now (or raising `DatasetError`); or a part, not decoded."""
        if isinstance(key, int):
            return self._listing.frames[key].load()
        return self._with(part(self._listing, key))

    def poses(self) -> NDArray[np.float64]:
        """The poses of all frames, (N, 4, 4) float64 as the frames have them, without decoding any frame.

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

    def _with(self, listing: Listing[Ref[AnyFrame]]) -> Self:
        return type(self)(self.path, self.format, listing, skip_bad=self._skip_bad)

    def _note(self, ref: Ref[AnyFrame], error: DatasetError) -> None:
        if not self._skip_bad:
            raise error
        self._skipped[ref.index] = str(error)


def _try_load(ref: Ref[AnyFrame]) -> tuple[Ref[AnyFrame], AnyFrame | DatasetError]:
    """The error as a value, so that a bad frame ends neither the thread's work nor the iteration."""
    try:
        return ref, ref.load()
    except DatasetError as error:
        return ref, error
