"""Map files: our own, and OctoMap's."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from .._core import OccupancyGrid, load_octomap

SUFFIX = ".pmap"
OCTOMAP_SUFFIXES = (".bt", ".ot")


def open_map(path: Path, backend: Literal["auto", "cpu", "gpu"] = "auto", adapter: str | None = None) -> OccupancyGrid:
    """Read a map of either kind; a file with another ending is taken for one of ours."""
    if path.suffix.lower() in OCTOMAP_SUFFIXES:
        return load_octomap(path, backend=backend, adapter=adapter)
    return OccupancyGrid.load(path, backend=backend, adapter=adapter)


def save_map(grid: OccupancyGrid, path: Path) -> None:
    """Write a map as what its ending says."""
    if path.suffix.lower() in OCTOMAP_SUFFIXES:
        grid.save_octomap(path)
    else:
        grid.save(path)
