"""Live sources: what waits is bounded, what is dropped is counted, and the thread ends whatever happens."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator, Iterator
from typing import Any

import pytest
from pyramap.datasets import Live
from pyramap.datasets.live import THREAD_NAME


def wait_until(condition: Callable[[], bool]) -> None:
    """5 s is far more than any step here takes."""
    deadline = time.monotonic() + 5
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.001)
    assert condition()


def live_threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == THREAD_NAME]


@pytest.mark.parametrize(
    ("drop", "capacity", "left"),
    [("oldest", 1, [9]), ("oldest", 3, [7, 8, 9]), ("newest", 1, [0]), ("newest", 3, [0, 1, 2])],
)
def test_of_what_nobody_takes_some_waits_and_the_rest_is_dropped(drop: Any, capacity: int, left: list[int]) -> None:
    with Live(range(10), capacity=capacity, drop=drop) as stream:
        wait_until(lambda: not live_threads())
        assert (stream.received, stream.dropped) == (10, 10 - capacity)
        assert list(stream) == left
        assert list(stream) == []


def test_nothing_is_dropped_while_the_consumer_keeps_up() -> None:
    taken = threading.Semaphore(0)

    def source() -> Iterator[int]:
        for i in range(50):
            yield i
            taken.acquire()

    read = []
    with Live(source()) as stream:
        for item in stream:
            read.append(item)
            taken.release()
    assert read == list(range(50))
    assert (stream.received, stream.dropped) == (50, 0)


def test_the_consumer_waits_for_the_next_frame() -> None:
    give = threading.Event()

    def source() -> Iterator[str]:
        give.wait(5)
        yield "late"

    with Live(source()) as stream:
        timer = threading.Timer(0.05, give.set)
        timer.start()
        assert list(stream) == ["late"]
        timer.join()


def test_what_the_source_raises_comes_after_the_frames_before_it() -> None:
    def source() -> Iterator[int]:
        yield from range(3)
        raise OSError("the cable is out")

    with Live(source(), capacity=5) as stream:
        read = []
        with pytest.raises(OSError, match="the cable is out"):
            for item in stream:
                read.append(item)
        assert read == [0, 1, 2]
        assert list(stream) == []


def test_a_source_that_never_starts_raises_at_once() -> None:
    with pytest.raises(TypeError):
        Live(5)  # type: ignore[arg-type]
    assert not live_threads()


def test_closing_ends_the_source_and_its_thread() -> None:
    ended = threading.Event()

    def source() -> Generator[int, None, None]:
        try:
            i = 0
            while True:
                yield i
                i += 1
        finally:
            ended.set()

    stream = Live(source(), capacity=2)
    assert next(stream) >= 0
    with stream:
        pass
    assert list(stream) == []
    assert ended.wait(5)
    wait_until(lambda: not live_threads())


def test_an_error_while_the_source_is_closed_does_not_hang_the_consumer() -> None:
    class Source:
        def __iter__(self) -> Source:
            return self

        def __next__(self) -> int:
            raise StopIteration

        def close(self) -> None:
            raise RuntimeError("cannot stop the camera")

    with Live(Source()) as stream, pytest.raises(RuntimeError, match="cannot stop the camera"):
        next(stream)


def test_closing_wakes_a_consumer_that_waits() -> None:
    never = threading.Event()

    def source() -> Iterator[int]:
        never.wait(5)
        yield 1

    stream = Live(source())
    timer = threading.Timer(0.05, stream.close)
    timer.start()
    assert list(stream) == []
    timer.join()
    never.set()
    wait_until(lambda: not live_threads())
    assert (stream.received, stream.dropped) == (0, 0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"capacity": 0}, "capacity must be at least 1, got 0"),
        ({"drop": "random"}, """drop must be "oldest" or "newest", got 'random'"""),
    ],
)
def test_bad_arguments(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Live(range(3), **arguments)
