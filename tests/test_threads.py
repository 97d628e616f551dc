"""Maps among threads and processes: every answer is about whole frames, nothing waits for ever, the GIL is free."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyramap as pm
import pytest
from frames import CAMERA, make_grid, map_bytes, map_of, random_frames

FRAMES = random_frames(30, seed=10)
PATIENCE = 120.0
"""Seconds after which something that takes one is taken to hang."""


@pytest.fixture(autouse=True)
def two_threads() -> Iterator[None]:
    """More than one thread in the pool, whatever the machine."""
    before = pm.num_threads()
    pm.set_num_threads(2)
    yield
    pm.set_num_threads(before)


def together(*calls: Callable[[], object]) -> None:
    """Runs the calls at the same time, a thread each; fails if one raises or does not end."""
    barrier = threading.Barrier(len(calls))
    errors: list[BaseException] = []

    def run(call: Callable[[], object]) -> None:
        barrier.wait()
        try:
            call()
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=run, args=(call,), daemon=True) for call in calls]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    assert not any(thread.is_alive() for thread in threads), "threads wait for each other"
    if errors:
        raise errors[0]


@pytest.mark.parametrize("threads", [1, 2])
def test_every_answer_is_about_whole_frames(threads: int) -> None:
    pm.set_num_threads(threads)
    points = np.random.default_rng(11).uniform(-2, 2, (5000, 3))

    def counts(grid: pm.OccupancyGrid) -> object:
        return grid.num_observed

    def log_odds(grid: pm.OccupancyGrid) -> object:
        return grid.log_odds(points).tobytes()

    def coords(grid: pm.OccupancyGrid) -> object:
        return grid.block_coords().tobytes()

    def mesh(grid: pm.OccupancyGrid) -> object:
        mesh = grid.mesh()
        return mesh.vertices.tobytes() + mesh.faces.tobytes()

    questions = (counts, log_odds, coords, mesh)
    reference = make_grid()
    legal: dict[Callable[[pm.OccupancyGrid], object], list[object]] = {ask: [ask(reference)] for ask in questions}
    for frame in FRAMES:
        reference.integrate(*frame)
        for ask in questions:
            legal[ask].append(ask(reference))

    grid = make_grid()
    done = threading.Event()
    states_seen = set()

    def write() -> None:
        try:
            for frame in FRAMES:
                grid.integrate(*frame)
        finally:
            done.set()

    def reader(ask: Callable[[pm.OccupancyGrid], object]) -> Callable[[], None]:
        def read() -> None:
            answers = legal[ask]
            oldest = 0
            while not done.is_set():
                oldest = answers.index(ask(grid), oldest)  # ValueError if no state of the map, or an older one
                states_seen.add(oldest)

        return read

    together(write, *(reader(ask) for ask in questions))
    assert [ask(grid) == legal[ask][-1] for ask in questions] == [True] * len(questions)
    assert len(states_seen) > 1


def test_many_writers_make_the_same_map(tmp_path: Path) -> None:
    expected = map_bytes(map_of(FRAMES), tmp_path)
    grid = make_grid()
    together(*(lambda part=part: [grid.integrate(*frame) for frame in FRAMES[part::5]] for part in range(5)))
    assert map_bytes(grid, tmp_path) == expected


def test_maps_merged_into_each_other_do_not_wait_for_each_other() -> None:
    first, second, third = (map_of(FRAMES[i : i + 1]) for i in range(3))

    def merges(into: pm.OccupancyGrid, other: pm.OccupancyGrid) -> Callable[[], None]:
        def merge() -> None:
            for _ in range(50):
                into.merge(other)

        return merge

    together(*(merges(a, b) for a, b in itertools.permutations((first, second, third), 2)))
    coords = first.block_coords()
    assert first.num_frames > 100
    assert len(coords) >= len(map_of(FRAMES[:3]).block_coords())


def test_the_number_of_threads_may_change_while_they_work(tmp_path: Path) -> None:
    expected = map_bytes(map_of(FRAMES), tmp_path)
    grid = make_grid()
    done = threading.Event()

    def write() -> None:
        try:
            for frame in FRAMES:
                grid.integrate(*frame)
        finally:
            done.set()

    def change() -> None:
        for threads in itertools.cycle((1, 3, 2)):
            pm.set_num_threads(threads)
            if done.is_set():
                break

    together(write, change)
    assert map_bytes(grid, tmp_path) == expected


# ---- the GIL ----


@pytest.fixture
def no_switching() -> Iterator[None]:
    """Python takes the GIL from no thread: another gets it only from one that gives it up by itself."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(PATIENCE)
    yield
    sys.setswitchinterval(before)


def another_thread_runs_during(call: Callable[[], object]) -> bool:
    go = threading.Event()
    calling = False
    ran_during_call = []

    def watch() -> None:
        go.wait()
        ran_during_call.append(calling)

    watcher = threading.Thread(target=watch)
    watcher.start()
    calling = True
    go.set()
    call()
    calling = False
    watcher.join()
    return ran_during_call[0]


def test_the_gil_is_released(no_switching: None, tmp_path: Path) -> None:
    grid, other = map_of(FRAMES), map_of(FRAMES[:10])
    path = tmp_path / "map.pmap"
    points = np.random.default_rng(12).uniform(-2, 2, (200_000, 3))
    grid.save(path)
    image = FRAMES[0].depth
    calls: dict[str, Callable[[], object]] = {
        "integrate": lambda: grid.integrate(*FRAMES[0]),
        "remove": lambda: grid.remove(*FRAMES[0]),
        "merge": lambda: grid.merge(other),
        "save": lambda: grid.save(path),
        "load": lambda: pm.OccupancyGrid.load(path),
        "mesh": lambda: grid.mesh(),
        "log_odds": lambda: grid.log_odds(points),
        "state": lambda: grid.state(points),
        "block_log_odds": lambda: grid.block_log_odds(grid.block_coords()),
        "ranges": lambda: pm.ranges(image, CAMERA),
        "pyramid": lambda: pm.pyramid(image, CAMERA, 0.05),
    }
    # A short call may end before the other thread has woken, so each has many chances. With the GIL held none would do.
    held = [name for name, call in calls.items() if not any(another_thread_runs_during(call) for _ in range(500))]
    assert held == []
    assert not another_thread_runs_during(lambda: sum(range(1_000_000)))


# ---- processes ----


def use_in_child(grid: pm.OccupancyGrid, folder: Path) -> None:
    """A map from before the fork and a new one, on a pool that must be new."""
    grid.integrate(*FRAMES[5])
    (folder / "inherited").write_bytes(map_bytes(grid, folder))
    (folder / "new").write_bytes(map_bytes(map_of(FRAMES[:5]), folder))
    pm.set_num_threads(1)
    (folder / "one thread").write_bytes(map_bytes(map_of(FRAMES[:5]), folder))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork.*:DeprecationWarning")
def test_a_forked_child_maps_too(tmp_path: Path) -> None:
    grid = map_of(FRAMES[:5])
    children = []
    for name in ("a", "b"):
        folder = tmp_path / name
        folder.mkdir()
        child = multiprocessing.get_context("fork").Process(target=use_in_child, args=(grid, folder), daemon=True)
        child.start()
        children.append((child, folder))
    expected_new = map_bytes(grid, tmp_path)
    for child, folder in children:
        child.join(PATIENCE)
        if child.is_alive():
            child.kill()
        assert child.exitcode == 0
        assert (folder / "new").read_bytes() == (folder / "one thread").read_bytes() == expected_new
        assert (folder / "inherited").read_bytes() == map_bytes(map_of(FRAMES[:6]), tmp_path)
    assert map_bytes(grid, tmp_path) == expected_new
    assert grid.num_frames == 5


def test_the_environment_sets_the_number_of_threads() -> None:
    code = "import pyramap; print(pyramap.num_threads())"
    environment = {**os.environ, "RAYON_NUM_THREADS": "3"}
    run = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=PATIENCE, check=True
    )
    assert run.stdout.strip() == "3"
