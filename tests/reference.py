"""A naive reference of the whole method, straight from the paper's equations ("Eq. n").

Everything is float64 and works on a dense box of voxels. The one exception are the readings: depth is float32, and the
ranges of Eq. 6 are rounded to float32, because the pyramid chooses between ranges and a choice between two that are
nearly as good depends on their last bit.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.int64]

UNIT = 2.0**-12  # of the stored log-odds
FREE = math.log(0.3 / 0.7)  # Eq. 7 far in front of every surface


@dataclass(frozen=True)
class Camera:
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def rays(self) -> Array:
        """K^-1 [u v 1] of every pixel centre, (height, width, 3)."""
        v, u = np.mgrid[: self.height, : self.width]
        return np.stack([(u - self.cx) / self.fx, (v - self.cy) / self.fy, np.ones(u.shape)], axis=-1)


@dataclass(frozen=True)
class Model:
    """Eq. 7 with sigma(z_j) = s0 + s1 z_j + s2 z_j^2 and a constant ratio k / sigma."""

    sigma: tuple[float, float, float]
    k_per_sigma: float = 1.0
    surface_offset: float | Literal["centred"] = 0.0

    def log_odds(self, z: Array, measured: Array) -> Array:
        """Log-odds of occupancy at distance z for measured ranges z_j; +inf is "no return", free everywhere."""
        a = self.k_per_sigma / math.sqrt(2 * math.pi)
        z_j = np.where(np.isinf(measured), 1.0, measured)
        sigma = self.sigma[0] + self.sigma[1] * z_j + self.sigma[2] * z_j**2
        if self.surface_offset == "centred":
            offset = sigma * math.sqrt(2 * math.log((a + 0.2) / 0.2))
        else:
            offset = np.full_like(sigma, self.surface_offset)
        x = (z - (z_j + offset)) / sigma
        g = np.exp(-0.5 * x**2)
        p = np.where(x <= 0, 0.3 + (a + 0.2) * g, 0.5 + a * g)
        return np.asarray(np.where(np.isinf(measured), FREE, np.log(p / (1 - p))))


@dataclass(frozen=True)
class View:
    """One depth image with all that says how to read it. Metres; depth is (height, width), the pose 4x4."""

    depth: NDArray[np.float32]
    camera: Camera
    world_from_camera: Array
    voxel_size: float
    model: Model
    max_range: float = 5.0
    beyond_max_range: Literal["free", "ignore"] = "free"
    focal_scale: float = 1.0  # of the t_i, to probe choices that rounding may turn

    def ranges(self) -> Array:
        """M of Eq. 6, (height, width): NaN is no reading, +inf is free up to max_range."""
        with np.errstate(invalid="ignore"):
            exact = self.depth * np.linalg.norm(self.camera.rays(), axis=-1)
            m: Array = exact.astype(np.float32).astype(np.float64)
            m[~(m > 0)] = np.nan
            m[(m > self.max_range) & np.isfinite(m)] = np.inf if self.beyond_max_range == "free" else np.nan
        return m

    def thresholds(self) -> Array:
        """t_i of every layer (Eq. 11); layers exist while 2^i <= min(width, height)."""
        layers = int(math.log2(min(self.camera.width, self.camera.height))) + 1
        f = math.sqrt(self.camera.fx * self.camera.fy) * self.focal_scale
        return np.asarray(f * self.voxel_size / 2.0 ** np.arange(layers))

    def project(self, points: Array) -> tuple[Array, Array, Array, Mask]:
        """Pixel coordinates u, v (Eq. 13; NaN unless in front of the camera), distance z, and which points are visible,
        of world points (N, 3)."""
        r, c = self.world_from_camera[:3, :3], self.world_from_camera[:3, 3]
        x, y, forward = ((points - c) @ r).T
        z = np.sqrt(x**2 + y**2 + forward**2)
        forward = np.where(forward > 0, forward, np.nan)
        u = self.camera.fx * x / forward + self.camera.cx
        v = self.camera.fy * y / forward + self.camera.cy
        inside = (u >= -0.5) & (u < self.camera.width - 0.5) & (v >= -0.5) & (v < self.camera.height - 0.5)
        return u, v, z, inside & (z <= self.max_range)


def layer(ranges: Array, i: int, target: float | None) -> Array:
    """Eq. 10: of the ranges in each 2^i x 2^i window the one nearest to the target, the smaller of two equally near;
    the smallest of all if there is no target (Andert's pyramid). NaN where the window holds no valid range."""
    n = 2**i
    height, width = ranges.shape
    padded = np.full((-(-height // n) * n, -(-width // n) * n), np.nan)
    padded[:height, :width] = ranges
    tiles = padded.reshape(padded.shape[0] // n, n, -1, n).swapaxes(1, 2)
    windows = tiles.reshape(*tiles.shape[:2], n * n)
    distance = windows if target is None else np.abs(windows - target)
    nearest = np.fmin.reduce(distance, axis=-1, keepdims=True)
    return np.asarray(np.fmin.reduce(np.where(distance == nearest, windows, np.nan), axis=-1))


def interpolate(model: Model, texels: Array, i: int, u: Array, v: Array, z: Array) -> Array:
    """Eq. 15, 16: the log-odds of the four texels of layer i around (u, v); NaN where none is valid and has weight."""
    height, width = texels.shape
    a, b = (u + 0.5) / 2**i - 0.5, (v + 0.5) / 2**i - 0.5
    total, weights = np.zeros_like(z), np.zeros_like(z)
    for da, db in itertools.product((0, 1), repeat=2):
        column, row = np.floor(a) + da, np.floor(b) + db
        weight = (1 - np.abs(a - column)) * (1 - np.abs(b - row))
        measured = texels[np.clip(row, 0, height - 1).astype(int), np.clip(column, 0, width - 1).astype(int)]
        weight = np.where(np.isnan(measured), 0.0, weight)
        total += np.where(weight > 0, weight * model.log_odds(z, measured), 0.0)
        weights += weight
    return np.divide(total, weights, out=np.full_like(z, np.nan), where=weights > 0)


def layer_index(thresholds: Array, z: Array) -> Index:
    """i with t_(i+1) < z <= t_i; -1 beyond t_0."""
    return np.asarray((thresholds[:, None] >= z).sum(axis=0) - 1)


def pyramid(view: View, centres: Array) -> Array:
    """Algorithm 1: both layers around z, blended linearly in z (Eq. 17)."""
    u, v, z, _ = view.project(centres)
    ranges, t = view.ranges(), view.thresholds()
    index = layer_index(t, z)
    result = np.full(z.shape, np.nan)
    for i in range(-1, len(t)):
        here = index == i
        finer, coarser = (
            interpolate(view.model, layer(ranges, j, t[j]), j, u[here], v[here], z[here])
            for j in (max(i, 0), min(i + 1, len(t) - 1))
        )
        blend = (z[here] - t[i]) / (t[i + 1] - t[i]) if 0 <= i < len(t) - 1 else 0.0
        both = finer + blend * (coarser - finer)
        result[here] = np.where(np.isnan(finer), coarser, np.where(np.isnan(coarser), finer, both))
    return result


def min_layer(view: View, centres: Array) -> Array:
    """After Andert: layer i alone, made of the smallest ranges."""
    u, v, z, _ = view.project(centres)
    ranges = view.ranges()
    index = np.maximum(layer_index(view.thresholds(), z), 0)
    result = np.full(z.shape, np.nan)
    for i in np.unique(index):
        here = index == i
        result[here] = interpolate(view.model, layer(ranges, int(i), None), int(i), u[here], v[here], z[here])
    return result


def ideal(view: View, centres: Array) -> Array:
    """Eq. 8, 9: every valid pixel's ray, weighted by its length inside the voxel that has z at its centre."""
    r = view.voxel_size
    voxels = np.floor(centres / r).astype(np.int64)
    first = voxels.min(axis=0)
    shape = voxels.max(axis=0) - first + 1
    z = np.full(shape, np.nan)
    z[tuple((voxels - first).T)] = view.project(centres)[2]

    rotation, origin = view.world_from_camera[:3, :3], view.world_from_camera[:3, 3]
    ranges = view.ranges().ravel()
    directions = view.camera.rays().reshape(-1, 3)[~np.isnan(ranges)] @ rotation.T
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ranges = ranges[~np.isnan(ranges)]
    log_odds, eta = np.zeros(z.size), np.zeros(z.size)
    far = view.max_range + 2 * r  # a voxel's centre is within max_range, so its far corner is nearer than this
    for some in np.array_split(np.arange(len(ranges)), 1 + len(ranges) // 2000):  # all at once would not fit in memory
        d, z_j = directions[some], ranges[some]
        cuts = [np.zeros((len(d), 1)), np.full((len(d), 1), far)]
        for axis in range(3):
            planes = (first[axis] + np.arange(shape[axis] + 1)) * r - origin[axis]
            with np.errstate(divide="ignore", invalid="ignore"):
                cuts.append(np.clip(np.nan_to_num(planes / d[:, axis, None]), 0, far))
        s = np.sort(np.concatenate(cuts, axis=1), axis=1)  # where each ray passes from voxel to voxel
        length, middle = np.diff(s, axis=1), (s[:, 1:] + s[:, :-1]) / 2
        voxel = np.floor((origin + middle[..., None] * d[:, None]) / r).astype(np.int64) - first
        inside = ((voxel >= 0) & (voxel < shape)).all(axis=-1) & (length > 0)
        flat = np.ravel_multi_index(tuple(voxel[inside].T), tuple(shape))
        wanted = ~np.isnan(z.ravel()[flat])
        flat, length = flat[wanted], length[inside][wanted]
        measured = np.broadcast_to(z_j[:, None], inside.shape)[inside][wanted]
        log_odds += np.bincount(flat, view.model.log_odds(z.ravel()[flat], measured) * length, z.size)
        eta += np.bincount(flat, length, z.size)
    mean = np.divide(log_odds, eta, out=np.full(z.size, np.nan), where=eta > 0)
    return np.asarray(mean.reshape(shape)[tuple((voxels - first).T)])


# Where the rule `area` samples a voxel, from its centre, in edges: a lattice of eight points that differ in all three
# coordinates, so that a voxel seen face on is sampled at eight places of its face and not at four. Where their log-odds
# differ by more than the tolerance, or none is told anything, there are 48 more.
AREA_POINTS = np.array([[(k + 0.5) * g / 8 % 1 - 0.5 for g in (1, 5, 7)] for k in range(8)])
AREA_MORE_POINTS = np.array([[(k + 0.5) * g / 48 % 1 - 0.5 for g in (1, 13, 19)] for k in range(48)])
AREA_TOLERANCE = 0.5


def area(view: View, centres: Array) -> Array:
    """The mean over points spread evenly in the voxel, each giving the log-odds of the pixel that it falls in, at the z
    of the voxel's centre: what Eq. 8 and 9 are for infinitely many pixels and points. Points outside the image take the
    pixel next to them; those behind the camera or in a pixel without a valid range do not count."""
    z, ranges = view.project(centres)[2], view.ranges()

    def told(points: Array) -> Array:
        log_odds = np.full((len(points), len(z)), np.nan)
        for n, point in enumerate(points):
            u, v, _, _ = view.project(centres + point * view.voxel_size)
            before = ~np.isnan(u)
            column = np.clip(np.floor(u[before] + 0.5), 0, view.camera.width - 1).astype(int)
            row = np.clip(np.floor(v[before] + 0.5), 0, view.camera.height - 1).astype(int)
            measured = np.full(z.shape, np.nan)
            measured[before] = ranges[row, column]
            valid = ~np.isnan(measured)
            log_odds[n, valid] = view.model.log_odds(z[valid], measured[valid])
        return log_odds

    return mean_of_points(told(AREA_POINTS), told(AREA_MORE_POINTS))


def mean_of_points(few: Array, more: Array) -> Array:
    """Of what points were told, (points, N), NaN for nothing: the mean of few where they agree, else of all of them."""
    with np.errstate(all="ignore"):
        spread = np.fmax.reduce(few) - np.fmin.reduce(few)
    everything = np.concatenate([few, np.where(spread <= AREA_TOLERANCE, np.nan, more)])
    count = (~np.isnan(everything)).sum(axis=0)
    total = np.nansum(everything, axis=0)
    return np.asarray(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))


Rule = Callable[[View, Array], Array]
RuleName = Literal["pyramid", "area", "min_layer", "ideal"]
# A rule takes a view and the centres (N, 3) of voxels that project into it, and gives their N log-odds, NaN for
# "not touched".
RULES: dict[RuleName, Rule] = {"pyramid": pyramid, "area": area, "min_layer": min_layer, "ideal": ideal}


def evaluate(view: View, rule: RuleName, first: Index, shape: Sequence[int]) -> Array:
    """Log-odds, not rounded, of the voxels `first + [0, shape)`; NaN where the frame does not touch the voxel."""
    centres = np.asarray((np.moveaxis(np.indices(shape), 0, -1).reshape(-1, 3) + first + 0.5) * view.voxel_size, float)
    visible = view.project(centres)[3]
    result = np.full(len(centres), np.nan)
    if visible.any():
        result[visible] = RULES[rule](view, centres[visible])
    return result.reshape(shape)


# The code under test places a voxel relative to the camera in float32. In scenes that lie within 8 m of the origin one
# rounding is at most 2.4e-7 m; 2e-6 m leaves room for the handful of roundings on the way to the pixel.
POSITION_SLACK = 2e-6
# A range, and the t_i and max_range it is held against, come from at most five float32 operations of 6e-8 each.
RANGE_SLACK = 5e-7
# A frame's value may depend on rounding by half of the 1e-3 that the maps are held to.
VALUE_SLACK = 5e-4


def doubtful(view: View, rule: RuleName, first: Index, shape: Sequence[int], exact: Array) -> Mask:
    """Voxels whose value, or being touched at all, hangs on float32 rounding: those for which it changes when the
    camera moves by POSITION_SLACK along the eight diagonals and the thresholds by RANGE_SLACK. That finds, for every
    rule, voxels on the border of the image, at max_range, at a t_i beside a hole, with all valid weight in a vanishing
    corner, cut by one ray that grazes them, or looking at a texel with two ranges equally near to t_i."""
    doubt = np.zeros(tuple(shape), dtype=bool)
    for signs in itertools.product((-1, 1), repeat=3):
        pose = view.world_from_camera.copy()
        pose[:3, 3] += POSITION_SLACK * np.array(signs)
        scale = 1 + RANGE_SLACK * math.prod(signs)
        moved = replace(view, world_from_camera=pose, max_range=view.max_range * scale, focal_scale=scale)
        other = evaluate(moved, rule, first, shape)
        doubt |= np.isnan(other) != np.isnan(exact)
        doubt |= np.abs(other - exact) > VALUE_SLACK
    # Rounding to zero leaves the voxel unknown: whether it does is open where the value is within a quarter unit
    # (6e-5) of the half unit at which rounding turns. So far may a tabulated sensor model be off.
    return doubt | (np.abs(np.abs(exact) / UNIT - 0.5) < 0.25)


def integrate(views: Sequence[View], rule: RuleName, first: Index, shape: Sequence[int]) -> tuple[Array, Mask]:
    """The frames' map of the voxels `first + [0, shape)`: log-odds, 0 where unknown, and which voxels are doubtful."""
    units, touched = np.zeros(tuple(shape)), np.zeros(tuple(shape), dtype=int)
    doubt = np.zeros(tuple(shape), dtype=bool)
    for view in views:
        exact = evaluate(view, rule, first, shape)
        doubt |= doubtful(view, rule, first, shape, exact)
        increment = np.rint(np.nan_to_num(exact) / UNIT)
        units += increment
        touched += increment != 0
    # Two increments or more can cancel, and each may be off by a unit.
    return units * UNIT, doubt | ((touched > 1) & (np.abs(units) <= touched))


def frustum_blocks(views: Sequence[View]) -> tuple[Index, tuple[int, int, int]]:
    """First voxel and shape of a box of whole 8x8x8 blocks around all that these views can see."""
    corners = []
    for view in views:
        c = view.camera
        edge = [((u - c.cx) / c.fx, (v - c.cy) / c.fy, 1.0) for u in (-1, c.width) for v in (-1, c.height)]
        points = np.vstack([np.zeros(3), np.array(edge) * view.max_range])
        corners.append(points @ view.world_from_camera[:3, :3].T + view.world_from_camera[:3, 3])
    blocks = np.floor(np.vstack(corners) / (8 * views[0].voxel_size)).astype(np.int64)
    first, last = blocks.min(axis=0), blocks.max(axis=0)
    nx, ny, nz = ((last - first + 1) * 8).tolist()
    return first * 8, (nx, ny, nz)
