"""Frames of a live source, mapped with a bounded delay: what comes while the mapper is busy waits, or is dropped."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Generic, Literal, Self, TypeVar

Item = TypeVar("Item")

THREAD_NAME = "pyramap-live"


class Live(Generic[Item]):
    """Iterates over a source that does not wait: a camera's frames, say. The source runs on a thread of its own.

    At most `capacity` frames wait for the consumer, so that none is older than these take to be mapped. When one more
    comes, a frame is dropped, and counted: with "oldest" the one that has waited longest, so that the map follows the
    camera; with "newest" the one that has just come, so that what waits stays without a gap.

    ```python
    with pyramap.datasets.Live(camera_frames(), capacity=2) as stream:
        for frame in stream:
            grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
    print(stream.dropped, "frames dropped")
    ```

    Leaving the `with` block, or `close`, ends the source's thread after the frame in hand, and closes the source if it
    is a generator. What the source raises is raised in the consumer, after the frames that came before.

    Args:
        source: any iterable; its iterator is used on the other thread alone.
        capacity: how many frames may wait, at least 1.
        drop: "oldest" or "newest".

    Raises:
        ValueError: if `capacity` or `drop` is none of these.
    """

    def __init__(
        self, source: Iterable[Item], *, capacity: int = 1, drop: Literal["oldest", "newest"] = "oldest"
    ) -> None:
        if capacity < 1:
            raise ValueError(f"capacity must be at least 1, got {capacity}")
        if drop not in ("oldest", "newest"):
            raise ValueError(f'drop must be "oldest" or "newest", got {drop!r}')
        self._capacity = capacity
        self._drop = drop
        self._waiting: deque[Item] = deque()
        self._changed = threading.Condition()
        self._ended = False
        self._closed = False
        self._error: BaseException | None = None
        self._received = self._dropped = 0
        # A daemon: a camera that never gives another frame must not keep the program from ending.
        self._thread = threading.Thread(target=self._receive, args=(iter(source),), name=THREAD_NAME, daemon=True)
        self._thread.start()

    @property
    def received(self) -> int:
        """How many frames the source has given so far."""
        return self._received

    @property
    def dropped(self) -> int:
        """How many of these were dropped; without those that waited when the stream was closed."""
        return self._dropped

    def __iter__(self) -> Iterator[Item]:
        """The frames in the order in which they came; waits for the next one, and ends with the source."""
        return self

    def __next__(self) -> Item:
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._ended or self._closed)
            if self._closed:
                raise StopIteration
            if self._waiting:
                return self._waiting.popleft()
            if self._error is not None:
                error, self._error = self._error, None
                raise error
            raise StopIteration

    def close(self) -> None:
        """Ends the stream: no more frames; those that wait are let go. The source ends after the frame in hand."""
        with self._changed:
            self._closed = True
            self._waiting.clear()
            self._changed.notify_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _receive(self, source: Iterator[Item]) -> None:
        try:
            try:
                for item in source:
                    if not self._take(item):
                        break
            finally:
                _close(source)
        except BaseException as error:  # whatever it is, the consumer is to have it
            self._error = error
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def _take(self, item: Item) -> bool:
        """Lets a frame wait, or drops one; whether more are wanted."""
        with self._changed:
            if self._closed:
                return False
            self._received += 1
            if len(self._waiting) == self._capacity:
                self._dropped += 1
                if self._drop == "newest":
                    return True
                self._waiting.popleft()
            self._waiting.append(item)
            self._changed.notify_all()
            return True


def _close(source: Iterator[object]) -> None:
    close = getattr(source, "close", None)
    if callable(close):
        close()
