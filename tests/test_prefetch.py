"""Decoding ahead: in order, only so far, and the thread ends whatever happens."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from dataset_files import CAMERA, write_seven_scenes
from pyramap import datasets
from pyramap.datasets import DatasetError
from pyramap.datasets.prefetch import THREAD_NAME, prefetch


def decoding_threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name.startswith(THREAD_NAME)]


def assert_decoding_stops() -> None:
    """The thread ends by itself once its item is done; 5 s is far more than any item here takes."""
    deadline = time.monotonic() + 5
    while decoding_threads() and time.monotonic() < deadline:
        time.sleep(0.001)
    assert not decoding_threads()


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 5
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.001)


def test_prefetch_keeps_the_order_though_durations_differ() -> None:
    def load(i: int) -> int:
        time.sleep(0.002 * (i % 3 == 0))
        return i * i

    assert list(prefetch(load, range(30))) == [i * i for i in range(30)]
    assert list(prefetch(load, [])) == []
    assert_decoding_stops()


def test_prefetch_works_ahead_on_another_thread_but_only_so_far() -> None:
    started: list[int] = []
    threads: set[int] = set()

    def load(i: int) -> int:
        started.append(i)
        threads.add(threading.get_ident())
        return i

    results = prefetch(load, range(100), ahead=3)
    assert not decoding_threads()  # nothing is begun before the first frame is asked for
    for consumed in range(1, 20):
        next(results)
        wait_until(lambda n=consumed: len(started) == n + 3)  # type: ignore[misc]
        time.sleep(0.002)  # and no further, though the thread has time to
        assert started == list(range(consumed + 3))
    assert len(threads) == 1
    assert threading.get_ident() not in threads
    results.close()
    assert_decoding_stops()
    assert len(started) == 22


def test_iteration_opens_no_image_far_ahead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_seven_scenes(tmp_path, range(30))
    read: list[str] = []
    read_bytes = Path.read_bytes

    def spy(path: Path) -> bytes:
        read.append(path.name)
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", spy)
    frames = iter(datasets.open(tmp_path, camera=CAMERA))
    assert read == []
    for consumed in range(1, 10):
        next(frames)
        time.sleep(0.005)
        assert consumed <= len(read) <= consumed + 4
    assert read == sorted(read)
    frames.close()
    assert_decoding_stops()


def test_thread_ends_when_iteration_ends_is_left_or_fails(tmp_path: Path) -> None:
    dataset = datasets.open(write_seven_scenes(tmp_path, range(20)))
    for _ in dataset:
        pass
    assert_decoding_stops()
    for frame in dataset:
        if frame.index == 3:
            break
    assert_decoding_stops()
    frames = iter(dataset)
    next(frames)
    assert decoding_threads()
    del frames
    gc.collect()
    assert_decoding_stops()
    (tmp_path / "frame-000005.pose.txt").unlink()
    with pytest.raises(DatasetError, match=r"frame-000005\.pose\.txt"):
        list(dataset)
    assert_decoding_stops()


def test_two_iterations_at_once_do_not_disturb_each_other(tmp_path: Path) -> None:
    dataset = datasets.open(write_seven_scenes(tmp_path, range(8)))
    pairs = [(a.index, b.index) for a, b in zip(dataset, dataset[::-1], strict=True)]
    assert pairs == [(i, 7 - i) for i in range(8)]


def test_other_errors_of_the_thread_surface_in_their_place() -> None:
    def load(i: int) -> float:
        return 1 / (i - 4)

    read: list[float] = []
    with pytest.raises(ZeroDivisionError):
        for value in prefetch(load, range(10)):
            read.append(value)
    assert len(read) == 4
    assert_decoding_stops()


def test_interrupt_between_frames_ends_the_thread(tmp_path: Path) -> None:
    dataset = datasets.open(write_seven_scenes(tmp_path, range(20)))
    read = 0
    with pytest.raises(KeyboardInterrupt):
        for _ in dataset:
            read += 1
            if read == 2:
                signal.raise_signal(signal.SIGINT)
    assert read == 2
    assert_decoding_stops()


@pytest.mark.skipif(sys.platform == "win32", reason="a wait on a lock cannot be interrupted on Windows")
def test_interrupt_while_waiting_for_a_frame_does_not_hang() -> None:
    release = threading.Event()
    started: list[int] = []

    def load(i: int) -> bool:
        started.append(i)
        return release.wait(30)

    timer = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    begun = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            next(prefetch(load, range(5)))
        assert time.monotonic() - begun < 10  # the item in hand would have taken 30 s
    finally:
        release.set()
        timer.join()
    assert_decoding_stops()
    assert started == [0]  # what was queued behind it is not begun any more
