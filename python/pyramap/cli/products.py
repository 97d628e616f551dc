"""Meshes and pictures of a map, into files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .. import pictures
from .._core import Mesh, OccupancyGrid
from .facts import Facts
from .maps import save_map
from .outputs import write_mesh, write_picture
from .terminal import working_on


@dataclass(frozen=True)
class Products:
    """Which files to make of a map; None: not made."""

    map: Path | None = None
    mesh: Path | None = None
    picture: Path | None = None
    inside: Path | None = None
    slice: Path | None = None

    def paths(self) -> list[Path]:
        """The files to be written."""
        return [path for path in vars(self).values() if path is not None]


def write_products(
    grid: OccupancyGrid, products: Products, poses: Sequence[NDArray[np.float64]], min_evidence: float
) -> Facts:
    """Make the files, the map first, so that it is safe should another fail.

    Args:
        grid: A map of at least one frame.
        products: What to make.
        poses: `world_from_camera` of its frames: they tell which way is up, and where the inside view is from.
        min_evidence: As for `OccupancyGrid.mesh`.

    Returns:
        `files`: path to bytes; `mesh`: its size, if one was made; `up`: the direction taken for up, if one was needed.
    """
    facts: Facts = {}
    if products.map:
        with working_on("saving the map"):
            save_map(grid, products.map)
    if products.mesh or products.picture or products.inside:
        with working_on("making the mesh"):
            mesh = grid.mesh(min_evidence=min_evidence)
        facts["mesh"] = mesh_facts(mesh)
        if products.mesh:
            with working_on("saving the mesh"):
                write_mesh(products.mesh, mesh)
        if products.picture:
            up = guess_up(mesh, poses)
            facts["up"] = up.tolist()
            draw_mesh(products.picture, mesh, pictures.overview(mesh.vertices, mesh.faces, up))
        if products.inside:
            draw_mesh(products.inside, mesh, pictures.from_pose(poses[0]))
    if products.slice:
        facts["slice"] = draw_slice(products.slice, grid, *eye_level(poses))
    facts["files"] = file_sizes(products.paths())
    return facts


def file_sizes(paths: Sequence[Path]) -> dict[str, int]:
    """Bytes of files by path."""
    return {str(path): path.stat().st_size for path in paths}


def mesh_facts(mesh: Mesh) -> Facts:
    """The size of a mesh."""
    return {"vertices": len(mesh.vertices), "triangles": len(mesh.faces)}


def draw_mesh(path: Path, mesh: Mesh, view: pictures.View, hide_backs: bool = True) -> None:
    """Write a shaded picture of a mesh, with a bar for scale where one scale holds."""
    with working_on("drawing the mesh"):
        image = pictures.mesh_image(mesh.vertices, mesh.faces, view, mesh.normals, hide_backs, mesh.colours)
        write_picture(path, pictures.with_scale_bar(image, view))


def draw_slice(path: Path, grid: OccupancyGrid, axis: int, at: float) -> Facts:
    """Write a picture of the layer of voxels at `at` metres along an axis, and say where its centre lies."""
    with working_on("drawing the slice"):
        return write_slice(path, pictures.cut(grid, axis, at))


def write_slice(path: Path, layer: pictures.Slice) -> Facts:
    """Write a picture of a slice, and say where it lies."""
    write_picture(path, pictures.slice_image(layer))
    return slice_facts(layer)


def slice_facts(layer: pictures.Slice) -> Facts:
    """Where a slice lies; metres."""
    plane = layer.plane
    return {
        "plane": plane.title,
        "axis": None if plane.axis is None else pictures.AXES[plane.axis],
        "at": plane.at,
        "through": plane.origin.tolist(),
        "normal": plane.normal.tolist(),
    }


def guess_up(mesh: Mesh, poses: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Which way is up: from how the camera was held or, if that says nothing, from the mesh."""
    try:
        return pictures.up_from_poses(poses)
    except ValueError:
        return pictures.up_from_mesh(mesh.vertices, mesh.faces)


def which_way_up(mesh: Mesh, up: Sequence[float] | None) -> NDArray[np.float64]:
    """The direction that was asked for, as a unit vector, or else the one that most of a mesh faces."""
    return pictures.up_from_mesh(mesh.vertices, mesh.faces) if up is None else pictures.unit(up)


def eye_level(poses: Sequence[NDArray[np.float64]]) -> tuple[int, float]:
    """Axis and position of the level slice at the cameras' median height; the axis is the nearest to up."""
    try:
        axis = int(np.argmax(np.abs(pictures.up_from_poses(poses))))
    except ValueError:
        axis = 2
    return axis, float(np.median([pose[axis, 3] for pose in poses]))
