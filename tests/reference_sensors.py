"""A naive reference of the method for sensors other than the pinhole camera, from the paper's equations ("Eq. n").

It has the sensor model and the windows of layers from `reference.py`, and of its own what differs among sensors:
where a point lies in the image, where a pixel looks, and how images wrap. Everything is float64.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from reference import AREA_MORE_POINTS, AREA_POINTS, Array, Index, Mask, Model, layer, layer_index, mean_of_points

TAU = 2 * math.pi


class Sensor(Protocol):
    """What the rules ask of a sensor. Pixels are counted from the first one's centre."""

    @property
    def wraps(self) -> bool: ...
    @property
    def parallel(self) -> bool: ...
    @property
    def focal_length(self) -> float:
        """Pixels per radian, or, for parallel rays, per metre."""
        ...

    def shape(self) -> tuple[int, int]: ...
    def rays(self) -> tuple[Array, Array]:
        """Starts and unit directions of all pixels' rays, (H, W, 3) each, in the sensor's frame."""
        ...

    def project(self, points: Array) -> tuple[Array, Array, Array]:
        """Column, row and range of points (N, 3) in the sensor's frame; NaN where it could not see them."""
        ...


@dataclass(frozen=True)
class Lidar:
    """Columns are azimuths, rows are elevations; a full turn or a sector."""

    width: int
    elevations: Array
    first_azimuth: float
    azimuth_span: float
    parallel: bool = False

    @property
    def wraps(self) -> bool:
        return abs(self.azimuth_span) == TAU

    @property
    def focal_length(self) -> float:
        spacing = abs(self.elevations[-1] - self.elevations[0]) / (len(self.elevations) - 1)
        # The first and the last row are as high as the distance to their neighbours.
        rows = len(self.elevations) + 1
        ends = abs(self.elevations[1] - self.elevations[0]) + abs(self.elevations[-1] - self.elevations[-2])
        spacing = (spacing * (len(self.elevations) - 1) + ends) / rows
        return float(min(self.width / abs(self.azimuth_span), 1 / spacing))

    def shape(self) -> tuple[int, int]:
        return len(self.elevations), self.width

    def rays(self) -> tuple[Array, Array]:
        azimuth = self.first_azimuth + self.azimuth_span / self.width * np.arange(self.width)
        azimuth, elevation = np.meshgrid(azimuth, self.elevations)
        flat = np.cos(elevation)
        directions = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1)
        return np.zeros_like(directions), directions

    def project(self, points: Array) -> tuple[Array, Array, Array]:
        x, y, z = points.T
        # Of all columns a turn apart, the one nearest to the middle of the image.
        middle = (self.width - 1) / 2
        turn = TAU * self.width / abs(self.azimuth_span)
        u = (np.arctan2(y, x) - self.first_azimuth) * self.width / self.azimuth_span
        u = middle + (u - middle + turn / 2) % turn - turn / 2
        elevation = np.arctan2(z, np.hypot(x, y))
        order = np.argsort(self.elevations)
        knots, rows = self.elevations[order], np.arange(len(order))[order].astype(float)
        v = np.interp(elevation, knots, rows)
        for end, inner in ((0, 1), (-1, -2)):
            slope = (rows[end] - rows[inner]) / (knots[end] - knots[inner])
            beyond = elevation < knots[0] if end == 0 else elevation > knots[-1]
            v = np.where(beyond, rows[end] + slope * (elevation - knots[end]), v)
        return u, v, np.linalg.norm(points, axis=1)


@dataclass(frozen=True)
class Distorted:
    """A pinhole camera behind a radial-tangential lens that does not fold back within the image."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float]
    wraps: bool = False
    parallel: bool = False

    @property
    def focal_length(self) -> float:
        return math.sqrt(self.fx * self.fy)

    def shape(self) -> tuple[int, int]:
        return self.height, self.width

    def distorted(self, x: Array, y: Array) -> tuple[Array, Array]:
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x**2 + y**2
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        return (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2),
            y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y,
        )

    def rays(self) -> tuple[Array, Array]:
        v, u = np.mgrid[: self.height, : self.width].astype(float)
        x_d, y_d = (u - self.cx) / self.fx, (v - self.cy) / self.fy
        # The usual fixed point: what the lens adds is taken off again until nothing changes.
        x, y = x_d, y_d
        for _ in range(500):
            moved_x, moved_y = self.distorted(x, y)
            x, y = x + 0.7 * (x_d - moved_x), y + 0.7 * (y_d - moved_y)
        assert np.abs(np.stack(self.distorted(x, y)) - np.stack([x_d, y_d])).max() < 1e-12
        directions = np.stack([x, y, np.ones_like(x)], axis=-1)
        return np.zeros_like(directions), directions / np.linalg.norm(directions, axis=-1, keepdims=True)

    def project(self, points: Array) -> tuple[Array, Array, Array]:
        x, y, z = points.T
        # Beyond the corners of the image nothing is seen, wherever the polynomial leads.
        directions = self.rays()[1]
        corners = np.hypot(directions[..., 0], directions[..., 1]).max() / 0.99
        distance = np.linalg.norm(points, axis=1)
        before = np.where((z > 0) & (np.hypot(x, y) < corners * distance), 1.0, np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            x_d, y_d = self.distorted(before * x / z, before * y / z)
        return self.fx * x_d + self.cx, self.fy * y_d + self.cy, distance


@dataclass(frozen=True)
class Parallel:
    """Rays along z, `fx` and `fy` pixels a metre apart."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    wraps: bool = False
    parallel: bool = True

    @property
    def focal_length(self) -> float:
        return math.sqrt(self.fx * self.fy)

    def shape(self) -> tuple[int, int]:
        return self.height, self.width

    def rays(self) -> tuple[Array, Array]:
        v, u = np.mgrid[: self.height, : self.width]
        starts = np.stack([(u - self.cx) / self.fx, (v - self.cy) / self.fy, np.zeros(u.shape)], axis=-1)
        return starts, np.broadcast_to([0.0, 0.0, 1.0], starts.shape)

    def project(self, points: Array) -> tuple[Array, Array, Array]:
        x, y, z = points.T
        before = np.where(z > 0, 1.0, np.nan)
        return before * (self.fx * x + self.cx), before * (self.fy * y + self.cy), z


@dataclass(frozen=True)
class View:
    """One range image with all that says how to read it: (H, W) metres, the pose 4x4."""

    ranges: NDArray[np.float32]
    sensor: Sensor
    world_from_sensor: Array
    voxel_size: float
    model: Model
    max_range: float

    def measured(self) -> Array:
        """NaN is no reading, +inf is free up to max_range."""
        m: Array = self.ranges.astype(np.float64)
        with np.errstate(invalid="ignore"):
            m[~(m > 0)] = np.nan
            m[m > self.max_range] = np.inf
        return m

    def project(self, points: Array) -> tuple[Array, Array, Array]:
        rotation, origin = self.world_from_sensor[:3, :3], self.world_from_sensor[:3, 3]
        return self.sensor.project((points - origin) @ rotation)

    def visible(self, points: Array) -> Mask:
        u, v, z = self.project(points)
        height, width = self.sensor.shape()
        with np.errstate(invalid="ignore"):
            return np.asarray(
                (u >= -0.5) & (u < width - 0.5) & (v >= -0.5) & (v < height - 0.5) & (z > 0) & (z <= self.max_range)
            )

    def texel(self, column: Array, row: Array, shape: tuple[int, ...]) -> tuple[Index, Index]:
        """The texel for a number of a column and a row, which may be beyond the border."""
        height, width = shape
        columns = np.nan_to_num(column).astype(int)
        columns = columns % width if self.sensor.wraps else np.clip(columns, 0, width - 1)
        return np.clip(np.nan_to_num(row).astype(int), 0, height - 1), columns


def interpolate(view: View, texels: Array, i: int, u: Array, v: Array, z: Array) -> Array:
    """Eq. 15, 16: the log-odds of the four texels of layer i around (u, v); NaN where none is valid and has weight."""
    a, b = (u + 0.5) / 2**i - 0.5, (v + 0.5) / 2**i - 0.5
    total, weights = np.zeros_like(z), np.zeros_like(z)
    for da, db in itertools.product((0, 1), repeat=2):
        column, row = np.floor(a) + da, np.floor(b) + db
        weight = (1 - np.abs(a - column)) * (1 - np.abs(b - row))
        measured = texels[view.texel(column, row, texels.shape)]
        weight = np.where(np.isnan(measured), 0.0, weight)
        total += np.where(weight > 0, weight * view.model.log_odds(z, measured), 0.0)
        weights += weight
    return np.divide(total, weights, out=np.full_like(z, np.nan), where=weights > 0)


def layers(view: View, nearest: bool) -> tuple[list[Array], Array]:
    """The layers and their distances (Eq. 10, 11). With parallel rays a voxel is as many pixels wide at every distance:
    layers have no distance of their own, and keep the smallest range."""
    height, width = view.sensor.shape()
    count = int(math.log2(min(width, height))) + 1
    if view.sensor.wraps:
        count = min(count, next(i for i in range(20) if width % 2 ** (i + 1)) + 1)
    t = view.sensor.focal_length * view.voxel_size / 2.0 ** np.arange(count)
    targets = [float(t_i) if nearest and not view.sensor.parallel else None for t_i in t]
    measured = view.measured()
    return [layer(measured, i, target) for i, target in enumerate(targets)], np.asarray(t)


def apparent(view: View, z: Array) -> Array:
    """The distance that says how large a voxel looks."""
    return np.ones_like(z) if view.sensor.parallel else z


def pyramid(view: View, centres: Array) -> Array:
    """Algorithm 1: both layers around z, blended linearly in z (Eq. 17)."""
    u, v, z = view.project(centres)
    texels, t = layers(view, nearest=True)
    distance = apparent(view, z)
    index = layer_index(t, distance)
    result = np.full(z.shape, np.nan)
    for i in range(-1, len(t)):
        here = index == i
        finer, coarser = (
            interpolate(view, texels[j], j, u[here], v[here], z[here]) for j in (max(i, 0), min(i + 1, len(t) - 1))
        )
        blend = (distance[here] - t[i]) / (t[i + 1] - t[i]) if 0 <= i < len(t) - 1 else 0.0
        both = finer + blend * (coarser - finer)
        result[here] = np.where(np.isnan(finer), coarser, np.where(np.isnan(coarser), finer, both))
    return result


def min_layer(view: View, centres: Array) -> Array:
    """After Andert: layer i alone, made of the smallest ranges."""
    u, v, z = view.project(centres)
    texels, t = layers(view, nearest=False)
    index = np.maximum(layer_index(t, apparent(view, z)), 0)
    result = np.full(z.shape, np.nan)
    for i in np.unique(index):
        here = index == i
        result[here] = interpolate(view, texels[i], int(i), u[here], v[here], z[here])
    return result


def area(view: View, centres: Array) -> Array:
    """The mean over points spread evenly in the voxel, each giving the log-odds of the pixel that it falls in."""
    z, measured = view.project(centres)[2], view.measured()

    def told(points: Array) -> Array:
        log_odds = np.full((len(points), len(z)), np.nan)
        for n, point in enumerate(points):
            u, v, _ = view.project(centres + point * view.voxel_size)
            before = ~np.isnan(u)
            reading = np.full(z.shape, np.nan)
            reading[before] = measured[view.texel(np.floor(u[before] + 0.5), np.floor(v[before] + 0.5), measured.shape)]
            valid = ~np.isnan(reading)
            log_odds[n, valid] = view.model.log_odds(z[valid], reading[valid])
        return log_odds

    return mean_of_points(told(AREA_POINTS), told(AREA_MORE_POINTS))


def ideal(view: View, centres: Array) -> Array:
    """Eq. 8, 9: every valid pixel's ray, weighted by its length inside the voxel: each voxel is cut with all rays."""
    z, half = view.project(centres)[2], view.voxel_size / 2
    rotation, origin = view.world_from_sensor[:3, :3], view.world_from_sensor[:3, 3]
    measured = view.measured().ravel()
    starts, directions = (rays.reshape(-1, 3)[~np.isnan(measured)] @ rotation.T for rays in view.sensor.rays())
    measured = measured[~np.isnan(measured)]
    result = np.full(len(centres), np.nan)
    for n, centre in enumerate(centres - origin):
        # Rays that pass the voxel's middle at more than half its diagonal cannot cut it.
        offset = centre - starts
        along = (offset * directions).sum(axis=1)
        passing = ((offset**2).sum(axis=1) - along**2 <= 3 * half**2 + 1e-9) & (along > -2 * half)
        with np.errstate(divide="ignore"):
            a, b = ((offset[passing] + side) / directions[passing] for side in (-half, half))
        enter = np.maximum(np.minimum(a, b).max(axis=1), 0)
        length = np.maximum(np.maximum(a, b).min(axis=1) - enter, 0)
        if length.sum() > 0:
            values = view.model.log_odds(np.full(length.shape, z[n]), measured[passing])
            result[n] = (values * length).sum() / length.sum()
    return result


RULES: dict[str, Callable[[View, Array], Array]] = {
    "pyramid": pyramid,
    "area": area,
    "min_layer": min_layer,
    "ideal": ideal,
}
