"""Files that commands write: checked before the work, and written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import typer
from numpy.typing import NDArray
from PIL import Image

from .._core import Mesh
from . import maps

MAP_SUFFIXES = (maps.SUFFIX, *maps.OCTOMAP_SUFFIXES)
MESH_SUFFIXES = (".ply", ".obj", ".stl", ".glb")
PICTURE_SUFFIXES = (".png",)
RECORDING_SUFFIXES = (".rrd",)
PAGE_SUFFIXES = (".html",)


def map_path(path: Path | None) -> Path | None:
    """Typer callback: refuse a name that is not a map's."""
    return _with_suffix(path, MAP_SUFFIXES)


def mesh_path(path: Path | None) -> Path | None:
    """Typer callback: refuse a name of which no mesh format is known."""
    return _with_suffix(path, MESH_SUFFIXES)


def picture_path(path: Path | None) -> Path | None:
    """Typer callback: refuse a name that is not a PNG's."""
    return _with_suffix(path, PICTURE_SUFFIXES)


def recording_path(path: Path | None) -> Path | None:
    """Typer callback: refuse a name that is not a recording's."""
    return _with_suffix(path, RECORDING_SUFFIXES)


def page_path(path: Path | None) -> Path | None:
    """Typer callback: refuse a name that is not a page's."""
    return _with_suffix(path, PAGE_SUFFIXES)


def _with_suffix(path: Path | None, known: Collection[str]) -> Path | None:
    if path is not None and path.suffix.lower() not in known:
        raise typer.BadParameter(f"{str(path)!r} ends in {path.suffix!r}, expected {' or '.join(known)}")
    return path


def check_writable(paths: Iterable[Path | None]) -> None:
    """Find out before hours of work whether files can be written.

    Raises:
        OSError: A folder is missing or not writable, or a folder stands where the file should go.
        ValueError: Two outputs are the same file.
    """
    seen: set[Path] = set()
    for path in filter(None, paths):
        folder = path.parent
        if not folder.is_dir():
            raise FileNotFoundError(f"{path}: the folder {str(folder)!r} does not exist")
        if not os.access(folder, os.W_OK):
            raise PermissionError(f"{path}: the folder {str(folder)!r} is not writable")
        if path.is_dir():
            raise IsADirectoryError(f"{path}: is a folder, expected the name of a file")
        if path.resolve() in seen:
            raise ValueError(f"{path}: is named for two outputs")
        seen.add(path.resolve())


def write_picture(path: Path, image: NDArray[np.uint8]) -> None:
    """Write (height, width, 3) uint8 as PNG."""
    with written_whole(path) as temporary:
        Image.fromarray(image).save(temporary, format="PNG")


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Write a mesh in the format that the suffix names."""
    format = path.suffix.lower().removeprefix(".")
    with written_whole(path) as temporary:
        mesh.to_trimesh().export(temporary, file_type=format)


def write_page(path: Path, html: str) -> None:
    """Write a page."""
    with written_whole(path) as temporary:
        temporary.write_text(html, encoding="utf-8")


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A file beside `path` that takes its place when the block ends well: who reads `path` never meets half a file."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
