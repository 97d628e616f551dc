"""What is known of maps and runs, as plain data ready for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .._core import Device, OccupancyGrid
from ..report.statistics import known_log_odds
from .fusing import Run

Facts = dict[str, Any]


def map_facts(grid: OccupancyGrid) -> Facts:
    """Parameters and content of a map; metres, bytes."""
    model, bounds = grid.sensor_model, grid.bounds
    occupied = count_occupied(grid)
    return {
        "voxel_size": grid.voxel_size,
        "update": grid.update,
        "sigma": model.sigma,
        "k": model.k,
        "surface_offset": model.surface_offset,
        "max_range": grid.max_range,
        "beyond_max_range": grid.beyond_max_range,
        "clamp": grid.clamp,
        "prior": grid.prior,
        "backend": grid.backend,
        "adapter": grid.adapter,
        "colour": grid.has_colour,
        "frames": grid.num_frames,
        "bounds": None if bounds is None else bounds.tolist(),
        "blocks": grid.num_blocks,
        "voxels_free": grid.num_observed - occupied,
        "voxels_occupied": occupied,
        "saturated": grid.saturated,
        "decays": grid.num_decays,
        "decay_product": grid.decay_product,
        "erasures": grid.num_erasures,
        "bytes": grid.nbytes,
    }


def device_facts(device: Device) -> Facts:
    """What a graphics adapter is; bytes."""
    return {
        "name": device.name,
        "kind": device.kind,
        "api": device.api,
        "driver": device.driver,
        "max_buffer_bytes": device.max_buffer_bytes,
        "max_binding_bytes": device.max_binding_bytes,
        "problem": device.problem,
    }


def count_occupied(grid: OccupancyGrid) -> int:
    """How many voxels are more likely occupied than free."""
    return sum(int(np.count_nonzero(known > 0)) for known in known_log_odds(grid))


def run_facts(run: Run, skipped: Mapping[int, str]) -> Facts:
    """How a run went; `skipped` are the frames that were left out before the map saw them, with the reasons."""
    left_out = {**skipped, **run.rejected}
    return {
        "frames": run.frames,
        "coloured": run.coloured,
        "left_out": {str(index): reason for index, reason in sorted(left_out.items())},
        "interrupted": run.interrupted,
        "failure": run.failure,
        "seconds": run.total_seconds,
        "frames_per_second": run.frames / run.total_seconds if run.frames else None,
        "median_ms": run.median_ms(),
        "peak_memory_bytes": run.peak_memory_bytes,
    }
