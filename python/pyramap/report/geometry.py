"""A mesh small enough for a page: few faces, and few bytes for each."""

from __future__ import annotations

from base64 import b64encode
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..pictures.views import area_vectors

MOST_FACES = 150_000
"""Makes a page of some 5 MB, which any computer turns smoothly."""

_STEPS = 65535
"""Positions on the page are whole steps of the mesh's largest extent over this: 16 bits each."""


@dataclass(frozen=True)
class Geometry:
    """A mesh for the page.

    Attributes:
        vertices: (V, 3) float32, metres.
        faces: (F, 3) uint32 vertex indices, anticlockwise seen from free space.
        colours: (V, 3) uint8 RGB, or None.
        cell: Edge of the cells whose vertices were gathered into one, metres; 0 if the mesh is whole.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    colours: NDArray[np.uint8] | None
    cell: float


def decimated(
    vertices: ArrayLike, faces: ArrayLike, at_most: int, voxel_size: float, colours: ArrayLike | None = None
) -> Geometry:
    """A mesh of at most so many faces: where it has more, the vertices in each cell of a grid become their mean.

    Args:
        vertices: (V, 3) metres.
        faces: (F, 3) vertex indices.
        at_most: How many faces there may be, at least 1.
        voxel_size: About the distance between vertices, metres.
        colours: (V, 3) uint8, if it has any.
    """
    points = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
    triangles = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
    shades = None if colours is None else np.asarray(colours, dtype=np.float64)
    cell = 0.0
    fewer_points, fewer, fewer_shades = points, triangles, shades
    # Faces become fewer as the square of the cell; what comes out depends on the shape.
    size = voxel_size * max(1.0, np.sqrt(len(triangles) / at_most))
    while len(fewer) > at_most:
        cell, size = size, 1.2 * size
        owner = _cells(points, cell)
        count = np.bincount(owner)[:, None]
        fewer_points = _sums(points, owner) / count
        fewer_shades = None if shades is None else _sums(shades, owner) / count
        fewer = _distinct(owner[triangles])
    return Geometry(
        fewer_points.astype(np.float32),
        fewer.astype(np.uint32),
        None if fewer_shades is None else np.round(fewer_shades).astype(np.uint8),
        cell,
    )


def encoded(geometry: Geometry) -> dict[str, Any]:
    """Ready for JSON: little-endian numbers in base64; positions in steps from `low`, normals of -127 to 127."""
    points = geometry.vertices.astype(np.float64)
    low = points.min(axis=0) if len(points) else np.zeros(3)
    extent = float(np.max(np.ptp(points, axis=0))) if len(points) else 0.0
    step = max(extent, 1e-6) / _STEPS
    areas = area_vectors(points, geometry.faces)
    corners = geometry.faces.astype(np.int64)
    normals = sum((_sums(areas, corners[:, corner], len(points)) for corner in range(3)), start=np.zeros_like(points))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)
    # The fourth number fills each vertex up to a multiple of four bytes, as graphics cards like it.
    normal_bytes = np.pad(np.round(127 * normals), ((0, 0), (0, 1))).astype(np.int8)
    return {
        "low": low.tolist(),
        "step": step,
        "high": (points.max(axis=0) if len(points) else low).tolist(),
        "positions": _base64(np.pad(np.round((points - low) / step), ((0, 0), (0, 1))).astype("<u2")),
        "normals": _base64(normal_bytes),
        "faces": _base64(geometry.faces.astype("<u4")),
        "colours": None if geometry.colours is None else _base64(np.pad(geometry.colours, ((0, 0), (0, 1)))),
    }


def _cells(points: NDArray[np.float64], cell: float) -> NDArray[np.int64]:
    """(V,) number of the cell that each point lies in; cells without points have none."""
    indices = np.floor((points - points.min(axis=0)) / cell).astype(np.int64)
    numbers = np.ravel_multi_index(tuple(indices.T), tuple(int(n) for n in indices.max(axis=0) + 1))
    return np.asarray(np.unique(numbers, return_inverse=True)[1], dtype=np.int64)


def _sums(values: NDArray[np.float64], owner: NDArray[np.int64], owners: int = 0) -> NDArray[np.float64]:
    """(owners, 3) sums of the rows of each owner."""
    return np.stack([np.bincount(owner, weights=column, minlength=owners) for column in values.T], axis=1)


def _distinct(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those with three different corners; of several with the same corners, one."""
    a, b, c = triangles.T
    kept = triangles[(a != b) & (b != c) & (c != a)]
    first = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)[1]
    return np.asarray(kept[np.sort(first)])


def _base64(array: NDArray[Any]) -> str:
    return b64encode(np.ascontiguousarray(array).tobytes()).decode()
