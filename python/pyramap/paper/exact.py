"""Pictures of the scenes themselves, from exact depth: the truth beside what the map makes of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import PinholeCamera, scenes
from ..pictures import View
from ..pictures.rendering import FRONT

Floats = NDArray[np.float64]

_SUPERSAMPLING = 2
_LIGHT = np.array([-0.33, -0.25, -0.91])
"""Direction to the light in camera axes: a headlight a little above and to the left."""


def world_from_view(view: View) -> Floats:
    """(4, 4) pose of a camera that sees what a perspective view shows."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = view.axes, view.eye
    return pose


def shaded(scene: scenes.Scene, view: View) -> NDArray[np.uint8]:
    """Draw a scene under a soft headlight.

    Args:
        scene: What to draw.
        view: From where; perspective.

    Returns:
        (height, width, 3) uint8.
    """
    width, height = (side * _SUPERSAMPLING for side in view.size)
    focal = width / view.width
    camera = PinholeCamera(width, height, fx=focal, fy=focal, cx=(width - 1) / 2, cy=(height - 1) / 2)
    depth = scene.render(camera, world_from_view(view)).astype(np.float64)
    v, u = np.indices(depth.shape)
    points = (
        np.stack([(u - camera.cx) / focal, (v - camera.cy) / focal, np.ones_like(depth)], axis=-1) * depth[..., None]
    )
    normals = np.cross(_step(points, axis=0), _step(points, axis=1))
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    brightness = (0.5 + 0.5 * np.clip(normals @ _LIGHT, -1, 1)) ** 1.2
    image = np.where(depth[..., None] > 0, brightness[..., None] * FRONT, 255.0)
    blocks = image.reshape(view.size[1], _SUPERSAMPLING, view.size[0], _SUPERSAMPLING, 3)
    return np.asarray(np.round(blocks.mean(axis=(1, 3))), dtype=np.uint8)


def _step(points: Floats, axis: int) -> Floats:
    """From pixel to pixel along the surface: the shorter of the steps before and after, which seldom leaps an edge."""
    difference = np.diff(points, axis=axis)
    first, last = np.take(difference, [0], axis), np.take(difference, [-1], axis)
    before, after = np.concatenate([first, difference], axis), np.concatenate([difference, last], axis)
    shorter = np.linalg.norm(before, axis=-1) < np.linalg.norm(after, axis=-1)
    return np.where(shorter[..., None], before, after)
