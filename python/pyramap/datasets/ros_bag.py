"""ROS 1 and ROS 2 bags, read by the package rosbags: no ROS needs to be installed."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from .errors import DatasetError


@dataclass(frozen=True, slots=True)
class Place:
    """Where a message is in its bag.

    Attributes:
        topic: its topic.
        time: when it was recorded, nanoseconds.
        nth: which of the messages of that topic with that very time it is, from 0.
    """

    topic: str
    time: int
    nth: int


class Bag:
    """An open bag; it is closed when nothing refers to it any more.

    Args:
        path: a `.bag`, `.mcap` or `.db3` file, or a ROS 2 bag's folder.

    Raises:
        DatasetError: if rosbags is not installed, or it cannot read the bag.
    """

    def __init__(self, path: Path) -> None:
        try:
            from rosbags.highlevel import AnyReader
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise DatasetError(path, "to read bags, install the extra: pip install pyramap[ros]") from None
        self.path = path
        with self._reading("not a bag that can be read"):
            # Bags recorded before ROS 2 Iron do not say what their types are; these have not changed since.
            self._reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
            self._reader.open()
        # Reentrant: the garbage collector may close a generator of `_raw` on the thread that reads just now.
        self._lock = threading.RLock()
        weakref.finalize(self, self._reader.close)

    def topics(self, *types: str) -> list[str]:
        """The topics of messages of these types, such as "sensor_msgs/msg/Image", that hold any; by name."""
        connections = self._reader.connections
        return sorted({c.topic for c in connections if c.msgtype in types and c.msgcount > 0})

    def content(self) -> str:
        """All topics with their types, in words, for errors."""
        listed = sorted({f"{c.topic} ({c.msgtype.replace('/msg/', '/')})" for c in self._reader.connections})
        return ", ".join(listed) or "nothing"

    def places(self, topic: str) -> Generator[tuple[Place, Any], None, None]:
        """The messages of one topic in the order of their recording, each with its place.

        A message that cannot be decoded comes as the `DatasetError` that says so.

        Raises:
            DatasetError: where the bag itself is damaged.
        """
        last, nth = -1, 0
        for time, kind, data in self._raw([topic]):
            nth = nth + 1 if time == last else 0
            last = time
            yield Place(topic, time, nth), self._decode_or_error(topic, kind, data)

    def messages(self, topics: Iterable[str]) -> Generator[tuple[str, Any], None, None]:
        """The messages of some topics in the order of their recording, as topic and message.

        Raises:
            DatasetError: where the bag or one of them is damaged.
        """
        for topic in topics:
            for _, message in self.places(topic):
                if isinstance(message, DatasetError):
                    raise message
                yield topic, message

    def first(self, topic: str) -> Any:
        """The first message of a topic. Raises `DatasetError` if the bag or that message is damaged."""
        for _, message in self.messages([topic]):
            return message
        raise DatasetError(self.path, f"{topic}: the bag is damaged: its messages are not there")

    def message_at(self, place: Place) -> Any:
        """The message at a place. Raises `DatasetError` if the bag or that message is damaged."""
        found = islice(self._raw([place.topic], place.time, place.time + 1), place.nth, place.nth + 1)
        for _, kind, data in found:
            message = self._decode_or_error(place.topic, kind, data)
            if isinstance(message, DatasetError):
                raise message
            return message
        raise DatasetError(self.path, f"{place.topic}: the message of {place.time} ns is not there any more")

    def _raw(
        self, topics: list[str], start: int | None = None, stop: int | None = None
    ) -> Generator[tuple[int, str, bytes], None, None]:
        """Time, type and bytes of each message. The file is read under a lock: frames are decoded on other threads."""
        connections = [c for c in self._reader.connections if c.topic in topics]
        found = self._reader.messages(connections, start, stop)
        try:
            while True:
                with self._lock, self._reading(f"{', '.join(topics)}: the bag is damaged"):
                    item = next(found, None)
                if item is None:
                    return
                connection, time, data = item
                yield time, connection.msgtype, data
        finally:
            with self._lock:
                found.close()

    def _decode_or_error(self, topic: str, kind: str, data: bytes) -> Any:
        try:
            with self._reading(f"{topic}: a message is damaged"):
                return self._reader.deserialize(data, kind)
        except DatasetError as error:
            return error

    @contextmanager
    def _reading(self, problem: str) -> Generator[None, None, None]:
        """What rosbags raises, as our error. It lets through what its many parsers and its storages raise."""
        try:
            yield
        except Exception as error:
            raise DatasetError(self.path, f"{problem}: {error or type(error).__name__}") from error
