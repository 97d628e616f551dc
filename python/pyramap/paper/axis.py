"""The scene of Figures 2 and 5: two obstacles, at 6 m and 10 m, seen along the axis on which they meet.

The paper's camera has 400 x 400 pixels, f = 400 and its principal point at (200, 200); voxels of 0.1 m, k = sigma =
0.6 m. What the paper leaves open is a `Layout`.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import OccupancyGrid, PinholeCamera, pyramid
from .comparison import Rule, probability
from .figure1 import paper_model

Floats = NDArray[np.float64]

SIDE, FOCAL = 400, 400.0
VOXEL, LENGTH = 0.1, 14.0
NEAR, FAR = 6.0, 10.0
"""z-depths of the obstacles, metres."""


@dataclass(frozen=True)
class Layout:
    """How the obstacles, the axis and the voxels lie to each other.

    Attributes:
        name: What is special about it.
        near_columns: How many columns of pixels, from the left, see the near obstacle.
        cx: Column of the principal point, pixels.
        along: How far the camera stands behind the face of a voxel, metres.
    """

    name: str
    near_columns: int = 200
    cx: float = 200.0
    along: float = 0.0

    def depth(self) -> NDArray[np.float32]:
        """(400, 400) metres."""
        columns = np.where(np.arange(SIDE) < self.near_columns, NEAR, FAR)
        return np.tile(columns, (SIDE, 1)).astype(np.float32)

    def camera(self) -> PinholeCamera:
        """The paper's."""
        return PinholeCamera(SIDE, SIDE, fx=FOCAL, fy=FOCAL, cx=self.cx, cy=SIDE / 2)

    def world_from_camera(self) -> Floats:
        """The axis runs along z through the centres of voxels."""
        pose = np.eye(4)
        pose[:3, 3] = VOXEL / 2, VOXEL / 2, -self.along
        return pose

    def centres(self) -> Floats:
        """(N, 3) centres of the voxels on the axis, metres."""
        centres = np.full((round(LENGTH / VOXEL), 3), VOXEL / 2)
        centres[:, 2] = (np.arange(len(centres)) + 0.5) * VOXEL
        return centres

    def distances(self) -> Floats:
        """(N,) of those centres from the camera, metres."""
        return self.centres()[:, 2] + self.along


USUAL = Layout("border half a pixel left of the axis")
LAYOUTS = (
    USUAL,
    Layout("border half a pixel right of the axis", near_columns=201),
    Layout("border on the axis", cx=199.5),
    Layout("camera in the middle of a voxel", along=-VOXEL / 2),
)


def occupancies(layout: Layout, rule: Rule) -> Floats:
    """(N,) occupancies of the voxels on the axis after one image."""
    grid = OccupancyGrid(VOXEL, paper_model(), max_range=LENGTH, update=rule, backend="cpu")
    grid.integrate(layout.depth(), layout.camera(), layout.world_from_camera())
    return probability(grid.log_odds(layout.centres()))


def thresholds(layers: int) -> Floats:
    """t_i of Eq. 11, metres."""
    return np.asarray(FOCAL * VOXEL / 2.0 ** np.arange(layers))


def by_equations(layout: Layout, half_texel: bool) -> Floats:
    """The rule `pyramid` once more, for the axis alone, after Algorithm 1.

    Args:
        layout: The scene.
        half_texel: Whether pixel u lies at (u + 0.5) / 2^i - 0.5 of layer i, counted from the centres of texels, or at
            u / 2^i, as Eq. 14 has it.

    Returns:
        (N,) occupancies.
    """
    layers = pyramid(layout.depth(), layout.camera(), VOXEL)
    limits = thresholds(len(layers))
    pixel = np.array([layout.cx, SIDE / 2])
    log_odds = []
    for z in layout.distances():
        last = int(np.searchsorted(-limits, -z, side="right")) - 1  # t_(i + 1) < z <= t_i, turned round from Eq. 12
        finer, coarser = (
            _interpolated(layers[i], (pixel + 0.5) / 2**i - 0.5 if half_texel else pixel / 2**i, float(z))
            for i in (max(last, 0), min(last + 1, len(layers) - 1))
        )
        inner = 0 <= last < len(layers) - 1
        blend = (z - limits[last]) / (limits[last + 1] - limits[last]) if inner else 0.0  # Eq. 17
        log_odds.append(finer + blend * (coarser - finer))
    return probability(np.array(log_odds))


def _interpolated(layer: NDArray[np.float32], place: Floats, z: float) -> float:
    """Eq. 15 and 16: log-odds of the four texels around (u, v), each from its own reading."""
    model, total = paper_model(), 0.0
    for column, row in itertools.product(*((np.floor(x), np.floor(x) + 1) for x in place)):
        weight = (1 - abs(place[0] - column)) * (1 - abs(place[1] - row))
        u, v = (int(np.clip(x, 0, size - 1)) for x, size in zip((column, row), layer.shape[::-1], strict=True))
        total += weight * model.log_odds(z, float(layer[v, u]))
    return total
