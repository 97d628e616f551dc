"""Bytes of the maps and memory of the processes, each system alone."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from .frames import FrameFile
from .memory import Memory
from .systems import System
from .worker import open_workers


@dataclass(frozen=True)
class Footprint:
    """What one system needs for the map of all frames.

    Attributes:
        map_bytes: As the system tells them.
        memory: Of its process.
        seconds: Of each frame, fused alone and not in turns.
    """

    map_bytes: int
    memory: Memory
    seconds: list[float]


def measure(system: System, voxel_size: float, frames: FrameFile, threads: int = 1) -> Footprint:
    """Maps all frames in a new process."""
    with open_workers([(system, threads)], frames) as (worker,):
        seconds, map_bytes, memory = worker.map_all(voxel_size)
    return Footprint(map_bytes, memory, seconds)


def measure_all(
    systems: Sequence[System], voxel_sizes: Sequence[float], frames: FrameFile
) -> dict[float, dict[str, Footprint]]:
    """Every system at every voxel size; several at once, since nothing is timed."""
    cases = [(size, system) for size in voxel_sizes for system in systems if system.affords(size)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        footprints = list(pool.map(lambda case: measure(case[1], case[0], frames), cases))
    result: dict[float, dict[str, Footprint]] = {size: {} for size in voxel_sizes}
    for (size, system), footprint in zip(cases, footprints, strict=True):
        result[size][system.name] = footprint
    return result
