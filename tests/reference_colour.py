"""What one frame adds to the colours of voxels, voxel by voxel, as plainly as it can be said.

Nothing here hides a surface from the colour camera: only for colour cameras that are where the depth camera is, and for
scenes in which nothing hides anything.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pyramap as pm
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Colours = NDArray[np.uint8]


class Expected(NamedTuple):
    """For each point its colour, (N, 3), whether it gets one, (N,), and whether rounding decides that or the colour."""

    colour: Floats
    seen: NDArray[np.bool_]
    ambiguous: NDArray[np.bool_]


def near_edge(value: Floats, edges: Any, within: float) -> NDArray[np.bool_]:
    return np.asarray(np.abs(value - edges) < within)


def surfaces(points: Floats, depth: NDArray[Any], camera: pm.PinholeCamera) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Of points in the camera's frame: distance, the range read at their pixel or 0, and what is ambiguous."""
    with np.errstate(divide="ignore", invalid="ignore"):
        u = camera.fx * points[:, 0] / points[:, 2] + camera.cx
        v = camera.fy * points[:, 1] / points[:, 2] + camera.cy
    ahead = points[:, 2] > 0
    column, row = (np.nan_to_num(np.floor(x + 0.5), nan=-1, posinf=-1, neginf=-1) for x in (u, v))
    inside = ahead & (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    at = np.where(inside, row, 0).astype(int), np.where(inside, column, 0).astype(int)
    z = np.asarray(depth, np.float64)[at]
    flat = np.hypot((at[1] - camera.cx) / camera.fx, (at[0] - camera.cy) / camera.fy)
    measured = np.where(inside & np.isfinite(z) & (z > 0), z * np.hypot(flat, 1.0), 0.0)
    # 32-bit arithmetic on some tens of pixels.
    borders = near_edge(u + 0.5, np.round(u + 0.5), 1e-4) | near_edge(v + 0.5, np.round(v + 0.5), 1e-4)
    return np.linalg.norm(points, axis=1), measured, borders & ahead


def band(measured: Floats, sigma: float, offset: float, voxel_size: float, max_range: float) -> tuple[Floats, Floats]:
    """From where to where voxels have the colour of a surface, for k = sigma and an offset in metres.

    From a voxel's diagonal in front of the zero of log-odds to where these are within half a step of 2^-12 of nothing,
    or would be if they were as steep as in front: there they change by (a + 0.2) / (0.3 * 0.7) when g changes by one.
    """
    a = 1 / math.sqrt(2 * math.pi)
    zero = measured + offset - sigma * math.sqrt(2 * math.log((a + 0.2) / 0.2))
    end = measured + offset + sigma * math.sqrt(2 * math.log((a + 0.2) / (0.3 * 0.7) / 2.0**-13))
    diagonal = math.sqrt(3) * voxel_size
    return np.minimum(zero, measured) - diagonal, np.minimum(np.maximum(end, measured + diagonal), max_range)


def halved(image: Colours) -> Colours:
    """Means of 2 x 2 pixels, rounded half up; a last odd row or column is doubled first."""
    image = np.pad(image, ((0, image.shape[0] % 2), (0, image.shape[1] % 2), (0, 0)), mode="edge").astype(np.uint16)
    total = image[::2, ::2] + image[1::2, ::2] + image[::2, 1::2] + image[1::2, 1::2]
    return ((total + 2) // 4).astype(np.uint8)


def sample(image: Colours, u: float, v: float) -> Floats:
    """Bilinear; `u` and `v` count pixels from the border of the image."""
    height, width, _ = image.shape
    x, y = u - 0.5, v - 0.5
    total = np.zeros(3)
    for row, down in ((math.floor(y), 1 - y % 1), (math.floor(y) + 1, y % 1)):
        for column, across in ((math.floor(x), 1 - x % 1), (math.floor(x) + 1, x % 1)):
            pixel = image[min(max(row, 0), height - 1), min(max(column, 0), width - 1)]
            total += down * across * pixel.astype(np.float64)
    return total


def expected_colours(
    points: Floats,
    depth: NDArray[Any],
    camera: pm.PinholeCamera,
    world_from_camera: Floats,
    colour: Colours,
    colour_camera: pm.PinholeCamera,
    depth_from_colour: Floats,
    *,
    sigma: float,
    offset: float,
    voxel_size: float,
    max_range: float,
) -> Expected:
    """For voxels whose centres are `points`, (N, 3), in the world."""
    local = (points - world_from_camera[:3, 3]) @ world_from_camera[:3, :3]
    distance, measured, ambiguous = surfaces(local, depth, camera)
    measured[measured > max_range] = 0.0
    low, high = band(measured, sigma, offset, voxel_size, max_range)
    near = (measured > 0) & (distance >= low) & (distance <= high)
    ambiguous |= (measured > 0) & (near_edge(distance, low, 1e-5) | near_edge(distance, high, 1e-5))

    levels = [colour]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(halved(levels[-1]))
    colours, seen = np.zeros((len(points), 3)), near.copy()
    for n in np.flatnonzero(near):
        surface = local[n] * (measured[n] / distance[n])
        x, y, z = (surface - depth_from_colour[:3, 3]) @ depth_from_colour[:3, :3]
        if z <= 0:
            seen[n] = False
            continue
        u = colour_camera.fx * x / z + colour_camera.cx + 0.5
        v = colour_camera.fy * y / z + colour_camera.cy + 0.5
        ambiguous[n] |= min(abs(u), abs(v), abs(u - colour_camera.width), abs(v - colour_camera.height)) < 1e-4
        seen[n] = 0 <= u < colour_camera.width and 0 <= v < colour_camera.height
        if seen[n]:
            pixels = math.sqrt(colour_camera.fx * colour_camera.fy) * voxel_size / math.hypot(x, y, z)
            ambiguous[n] |= abs(math.log2(pixels) - round(math.log2(pixels))) < 1e-5
            level = min(max(math.floor(math.log2(pixels)), 0), len(levels) - 1)
            colours[n] = sample(levels[level], u / 2**level, v / 2**level)
    return Expected(colours, seen, ambiguous)
