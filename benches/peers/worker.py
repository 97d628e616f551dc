"""One system in a process of its own, which fuses when it is its turn and sleeps otherwise."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Sequence
from contextlib import contextmanager
from importlib import import_module
from multiprocessing.connection import Connection
from time import perf_counter
from typing import TYPE_CHECKING, Any

from .memory import Memory, MemoryProbe

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .frames import FrameFile
    from .systems import Map, System


class _Server:
    """What the process does on request; each public method is one."""

    def __init__(self, system: System, frames: FrameFile) -> None:
        self._system = system
        self._frames = frames
        self._map: Map

    def new_map(self, voxel_size: float) -> None:
        import_module(self._system.module)
        self._map = self._system.new_map(voxel_size)

    def fuse(self, indices: Sequence[int], limit: float | None) -> dict[int, float]:
        seconds: dict[int, float] = {}
        for index in indices:
            prepared = self._map.prepare(self._frames[index])
            start = perf_counter()
            self._map.integrate(prepared)
            seconds[index] = perf_counter() - start
            if limit is not None and sum(seconds.values()) > limit:
                break
        return seconds

    def mesh(self) -> tuple[float, int]:
        start = perf_counter()
        triangles = self._map.mesh()
        return perf_counter() - start, triangles

    def map_all(self, voxel_size: float) -> tuple[list[float], int, Memory]:
        import_module(self._system.module)
        probe = MemoryProbe()
        self.new_map(voxel_size)
        seconds = self.fuse(range(len(self._frames)), limit=None)
        return list(seconds.values()), self._map.nbytes(), probe.read()


class Worker:
    """A process that maps with one system; it lives until `close` and keeps its map between calls.

    The number of threads is that of the CPUs it may run on, which every system respects: Open3D 0.20 can be told in
    no other way. Where the operating system cannot do that, `RAYON_NUM_THREADS` limits pyramap, and Open3D uses all.
    """

    def __init__(self, system: System, threads: int, frames: FrameFile) -> None:
        self.system = system
        self.threads = threads
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, system, threads, frames), daemon=True)
        self._process.start()
        theirs.close()

    def new_map(self, voxel_size: float) -> None:
        """Begins an empty map."""
        self._call("new_map", voxel_size)

    def fuse(self, indices: Sequence[int], limit: float | None = None) -> dict[int, float]:
        """Seconds of each frame fused, by index; stops early once their sum is beyond `limit` seconds."""
        seconds: dict[int, float] = self._call("fuse", indices, limit)
        return seconds

    def mesh(self) -> tuple[float, int]:
        """Seconds that the surface took, and how many triangles it has."""
        seconds, triangles = self._call("mesh")
        return seconds, triangles

    def map_all(self, voxel_size: float) -> tuple[list[float], int, Memory]:
        """Fuses every frame into a new map: seconds of each, bytes of the map, and what the process needed for it."""
        seconds, nbytes, memory = self._call("map_all", voxel_size)
        return seconds, nbytes, memory

    def close(self) -> None:
        """Ends the process."""
        self._connection.close()
        self._process.join()

    def _call(self, method: str, *arguments: object) -> Any:
        self._connection.send((method, arguments))
        try:
            error, result = self._connection.recv()
        except EOFError:
            raise RuntimeError(f"the process of {self.system.name} ended while it ran {method}") from None
        if error is not None:
            raise RuntimeError(f"{self.system.name}: {method} failed: {error}")
        return result


@contextmanager
def open_workers(systems: Sequence[tuple[System, int]], frames: FrameFile) -> Iterator[list[Worker]]:
    """Workers for pairs of a system and a number of threads, ended when the block is left."""
    workers: list[Worker] = []
    try:
        workers.extend(Worker(system, threads, frames) for system, threads in systems)
        yield workers
    finally:
        for worker in workers:
            worker.close()


def _serve(connection: Connection, system: System, threads: int, frames: FrameFile) -> None:
    _limit_threads(threads)
    server = _Server(system, frames)
    while True:
        try:
            method, arguments = connection.recv()
        except EOFError:
            return
        answer: tuple[str | None, Any]
        try:
            answer = None, getattr(server, method)(*arguments)
        except Exception as error:  # Whatever a peer raises is for the parent to tell.
            answer = f"{type(error).__name__}: {error}", None
        connection.send(answer)


def _limit_threads(threads: int) -> None:
    """Before any of the systems is imported, since they ask only once."""
    os.environ["RAYON_NUM_THREADS"] = str(threads)
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:threads])
