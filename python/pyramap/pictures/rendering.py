"""Shaded picture of a mesh by ray casting: needs no display and no GPU."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .views import View, area_vectors

try:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene
except ImportError:  # Linux on ARM: embreex has no package for it
    EmbreeScene = None

Floats = NDArray[np.float32]

BACKGROUND = (255, 255, 255)
FRONT = (246, 240, 228)
"""Surface seen from free space: a warm white."""
BACK = (115, 140, 184)
"""Surface seen from behind: blue."""

NO_EMBREEX = "meshes cannot be drawn here: the package embreex is missing, which casts the rays"

_LIGHT = np.array([-0.33, -0.25, -0.91])
"""Direction to the light in picture axes (right, down, forward): a headlight a little above and to the left."""
_WRAP = 1.2
_SUPERSAMPLING = 2
_OCCLUSION_REACH = 0.03
"""How far corners and contacts darken, relative to the diagonal of the mesh."""
_DARKEST = 0.4
"""Brightness left where all is blocked."""
_TILE, _TILE_RAYS = 4, 4
"""Each pixel of a 4 x 4 tile sends its own 4 occlusion rays; the mean over a tile then has 64 and shows no grain."""
_RAYS_AT_ONCE = 400_000
"""Bounds the memory of a strip to some 100 MB."""


def can_draw_meshes() -> bool:
    """Whether embreex is there, which casts the rays of `mesh_image`."""
    return EmbreeScene is not None


def mesh_image(
    vertices: ArrayLike,
    faces: ArrayLike,
    view: View,
    normals: ArrayLike | None = None,
    hide_backs: bool = True,
    colours: ArrayLike | None = None,
) -> NDArray[np.uint8]:
    """Draw a mesh: shaded by a soft headlight, darker in corners and near contacts, antialiased, on white.

    Args:
        vertices: (V, 3) metres.
        faces: (F, 3) vertex indices, anticlockwise seen from free space.
        view: Where from; see `overview` and `from_pose`.
        normals: (V, 3) unit normals for smooth shading; without them each face is flat.
        hide_backs: Leave out the faces that show their back, so that one looks through ceilings and outer walls into
            rooms; otherwise they are drawn in blue.
        colours: (V, 3) uint8 RGB of fronts, or (V, 4) with 0 in the last column for vertices without one, as in a map's
            mesh; what has none is a warm white.

    Returns:
        (height, width, 3) uint8 image.

    Raises:
        OSError: The package embreex is missing.
    """
    if not can_draw_meshes():
        raise OSError(NO_EMBREEX)
    # Embree computes in float32: relative to the eye that is exact enough for maps far from the world's origin.
    points = (np.asarray(vertices, dtype=np.float64) - view.eye).astype(np.float32)
    triangles = np.asarray(faces).astype(np.int32).reshape(-1, 3)
    if hide_backs:
        triangles = triangles[_shows_front(points, triangles, view)]
    width, height = view.size
    image = np.full((height, width, 3), BACKGROUND, dtype=np.float32)
    if len(triangles) == 0:
        return image.astype(np.uint8)
    colours = None if colours is None else opaque(np.asarray(colours))
    at_vertices = (None if values is None else np.asarray(values, dtype=np.float32) for values in (normals, colours))
    surface = _Surface(points, triangles, *at_vertices)

    positions = np.full((height, width, 3), np.nan, dtype=np.float32)
    facing = np.zeros((height, width, 3), dtype=np.float32)
    openness = np.ones((height, width), dtype=np.float32)
    reach = _OCCLUSION_REACH * float(np.linalg.norm(np.ptp(points, axis=0)))
    strip = max(1, _RAYS_AT_ONCE // (width * _SUPERSAMPLING**2 * _TILE)) * _TILE
    for top in range(0, height, strip):
        rows = slice(top, min(top + strip, height))
        seen = surface.seen_by(view, rows)
        colours = seen.colours.reshape(rows.stop - top, _SUPERSAMPLING, width, _SUPERSAMPLING, 3)
        image[rows] = colours.mean(axis=(1, 3))
        # One sample a pixel is enough for the occlusion: it is smooth.
        positions[rows] = seen.positions[::_SUPERSAMPLING, ::_SUPERSAMPLING]
        facing[rows] = seen.facing[::_SUPERSAMPLING, ::_SUPERSAMPLING]
        openness[rows] = surface.openness(positions[rows], facing[rows], reach)
    openness = _mean_over_tiles(openness, positions, facing, reach)
    return np.asarray(np.round(image * (_DARKEST + (1 - _DARKEST) * openness[..., None])), dtype=np.uint8)


def opaque(colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(V, 3) colours for every vertex, out of the (V, 4) of a map's mesh: those that have none get that of a front."""
    return colours if colours.shape[1] == 3 else np.where(colours[:, 3:] > 0, colours[:, :3], np.array(FRONT, np.uint8))


@dataclass(frozen=True)
class _Seen:
    """What a grid of rays meets: (h, w, 3) each; NaN positions where a ray meets nothing."""

    colours: Floats
    positions: Floats
    facing: Floats


class _Surface:
    """Triangles, relative to the eye, ready for ray casting."""

    def __init__(
        self, points: Floats, triangles: NDArray[np.int32], normals: Floats | None, colours: Floats | None
    ) -> None:
        self.triangles = triangles
        self.normals = normals
        self.colours = colours
        self.scene: Any = EmbreeScene(robust=True)
        TriangleMesh(self.scene, points, triangles)

    def seen_by(self, view: View, rows: slice) -> _Seen:
        """Cast the rays of some rows of pixels, with `_SUPERSAMPLING` squared samples a pixel."""
        origins, rays = view.rays(rows, _SUPERSAMPLING)
        grid = rays.shape
        starts = (origins - view.eye).astype(np.float32).reshape(-1, 3)
        directions = rays.astype(np.float32).reshape(-1, 3)
        colours = np.full(starts.shape, BACKGROUND, dtype=np.float32)
        positions = np.full(starts.shape, np.nan, dtype=np.float32)
        facing = np.zeros(starts.shape, dtype=np.float32)

        hits = self.scene.run(starts, directions, output=True)
        met = np.flatnonzero(hits["primID"] >= 0)
        looking = directions[met]
        # Embree's Ng follows the right-hand rule of the corners, as the mesh's own orientation does.
        flat = _normalised(hits["Ng"][met])
        from_behind = np.sum(flat * looking, axis=1) > 0
        side = np.where(from_behind, -1, 1).astype(np.float32)[:, None]
        shading = flat if self.normals is None else _normalised(self._interpolated(self.normals, hits, met))
        cosine = np.sum(shading * side * (view.axes @ _LIGHT).astype(np.float32), axis=1)
        # Lambert's law wrapped round: grazing surfaces keep some light, so that none is lost in black.
        brightness = ((1 + np.clip(cosine, -1, 1)) / 2) ** _WRAP
        front = FRONT if self.colours is None else self._interpolated(self.colours, hits, met)
        colours[met] = np.where(from_behind[:, None], BACK, front) * brightness[:, None]
        positions[met] = starts[met] + hits["tfar"][met, None] * looking
        facing[met] = flat * side
        return _Seen(colours.reshape(grid), positions.reshape(grid), facing.reshape(grid))

    def _interpolated(self, values: Floats, hits: dict[str, Any], met: NDArray[np.intp]) -> Floats:
        """(N, 3) what the vertices of the faces have, at the hits."""
        u, v = hits["u"][met, None], hits["v"][met, None]
        a, b, c = (values[self.triangles[hits["primID"][met], corner]] for corner in range(3))
        return np.asarray((1 - u - v) * a + u * b + v * c, dtype=np.float32)

    def openness(self, positions: Floats, facing: Floats, reach: float) -> Floats:
        """(h, w) share of cosine-distributed rays that meet nothing within `reach` metres; 1 where nothing is seen.

        The rays of a pixel depend on its place in a `_TILE` x `_TILE` tile, so `positions` must start on a tile's row.
        """
        y, x = np.nonzero(np.isfinite(positions[..., 0]))
        normals = facing[y, x]
        # Step off the surface, so that no ray meets the face that it starts from.
        starts = positions[y, x] + normals * np.float32(1e-3 * reach)
        limit = np.full(len(starts), reach, dtype=np.float32)
        blocked = np.zeros(len(starts), dtype=np.float32)
        sphere = _sphere_points(_TILE * _TILE * _TILE_RAYS)
        for ray in range(_TILE_RAYS):
            # A normal plus a uniform point of the unit sphere is cosine-distributed about the normal (0.999 keeps the
            # sum from vanishing). Consecutive points lie far apart, so every pixel's few rays cover all directions.
            own = ((y % _TILE) * _TILE + x % _TILE) * _TILE_RAYS + ray
            directions = _normalised(normals + np.float32(0.999) * sphere[own])
            blocked += self.scene.run(starts, directions, dists=limit, query="OCCLUDED") >= 0
        openness = np.ones(positions.shape[:2], dtype=np.float32)
        openness[y, x] = 1 - blocked / _TILE_RAYS
        return openness


def _shows_front(points: Floats, triangles: NDArray[np.int32], view: View) -> NDArray[np.bool_]:
    """(F,) whether each face turns its front to the viewer, who is at the origin."""
    towards = -points[triangles[:, 0]] if view.perspective else -view.axes[:, 2]
    return np.asarray(np.sum(area_vectors(points, triangles) * towards, axis=1) > 0)


def _mean_over_tiles(values: Floats, positions: Floats, facing: Floats, reach: float) -> Floats:
    """Each pixel's mean over the tile around it, of the pixels on about the same plane."""
    height, width = values.shape
    before, after = _TILE // 2, _TILE - 1 - _TILE // 2
    pad = ((before, after), (before, after))
    padded = np.pad(values, pad, mode="edge")
    padded_positions = np.pad(positions, (*pad, (0, 0)), constant_values=np.nan)
    total = np.zeros_like(values)
    count = np.zeros_like(values)
    for dy in range(_TILE):
        for dx in range(_TILE):
            window = slice(dy, dy + height), slice(dx, dx + width)
            off_plane = np.abs(np.einsum("hwc,hwc->hw", padded_positions[window] - positions, facing))
            together = off_plane < 0.1 * reach
            total += np.where(together, padded[window], 0)
            count += together
    return np.divide(total, count, out=np.ones_like(values), where=count > 0)


def _sphere_points(count: int) -> Floats:
    """(count, 3) points evenly over the unit sphere, consecutive ones far apart: golden ratio and base 2 sequences."""
    index = np.arange(count)
    bits = int(math.log2(count))
    reversed_bits = sum(((index >> bit) & 1) << (bits - 1 - bit) for bit in range(bits))
    z = 2 * (reversed_bits + 0.5) / count - 1
    turn = 2 * math.pi * index * (math.sqrt(5) - 1) / 2
    ring = np.sqrt(1 - z * z)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1).astype(np.float32)


def _normalised(vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, np.float32(1e-20)), dtype=np.float32)
