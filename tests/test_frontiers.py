"""Frontiers of maps against scipy on dense arrays, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pyramap as pm
import pytest
from frames import CAMERA, MAX_RANGE, VOXEL_SIZE, make_grid, map_of, random_frames, wall
from numpy.typing import NDArray
from scipy import ndimage

UNKNOWN, FREE = -1, 0


def dense_states(grid: pm.OccupancyGrid) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
    """States of all voxels, one layer of unknown ones around, and the index of the first of them."""
    bounds = grid.bounds
    assert bounds is not None
    low, high = np.rint(bounds / grid.voxel_size).astype(np.int64)
    low, high = low - 1, high + 1
    indices = np.stack(np.meshgrid(*map(np.arange, low, high), indexing="ij"), axis=-1)
    states = grid.state((indices.reshape(-1, 3) + 0.5) * grid.voxel_size)
    return states.reshape(indices.shape[:3]), low


def unknown_neighbours(states: NDArray[np.int8]) -> dict[tuple[int, int], NDArray[np.bool_]]:
    """By axis and direction, the voxels whose neighbour there is unknown. The border is unknown, so nothing wraps."""
    return {(axis, step): np.roll(states, -step, axis) == UNKNOWN for axis in range(3) for step in (-1, 1)}


def clusters_of(grid: pm.OccupancyGrid) -> list[NDArray[np.int64]]:
    """Voxels of each frontier, by scipy."""
    states, low = dense_states(grid)
    frontier = (states == FREE) & np.any(list(unknown_neighbours(states).values()), axis=0)
    labels, count = ndimage.label(frontier, np.ones((3, 3, 3)))
    voxels, label = np.argwhere(frontier), labels[frontier]
    return [voxels[label == n] + low for n in range(1, count + 1)]


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("options", [{}, {"prior": 0.4}, {"update": "area"}])
def test_clusters_are_those_of_scipy(seed: int, options: dict[str, Any]) -> None:
    grid = map_of(random_frames(3, seed), **options)
    expected = clusters_of(grid)
    found = grid.frontiers()
    assert len(expected) > 1
    assert len(found) == len(expected)
    assert {voxels.tobytes() for voxels in found.voxels} == {voxels.astype(np.int32).tobytes() for voxels in expected}
    assert found.size.tolist() == [len(voxels) for voxels in found.voxels]
    assert np.all(np.diff(found.size) <= 0)


def test_numbers_follow_from_the_voxels() -> None:
    grid = map_of(random_frames(4, seed=5))
    states, low = dense_states(grid)
    unknown = unknown_neighbours(states)
    found = grid.frontiers()
    for n, voxels in enumerate(found.voxels):
        at = tuple((voxels - low).T)
        np.testing.assert_allclose(found.centre[n], (voxels.mean(axis=0) + 0.5) * VOXEL_SIZE, atol=1e-9)
        up, down = (np.stack([unknown[axis, step][at] for axis in range(3)], axis=1) for step in (1, -1))
        normal = np.sum(up.astype(float) - down, axis=0)
        np.testing.assert_allclose(found.normal[n], normal / max(np.linalg.norm(normal), 1.0), atol=1e-12)
        area = np.linalg.norm(up.astype(float) + down, axis=1).sum() * VOXEL_SIZE**2
        np.testing.assert_allclose(found.area[n], area, rtol=1e-12)


def test_the_sides_of_a_view() -> None:
    # A wall seen once: free space ends at the four sides of the frustum, and where the wall begins it does not.
    grid = map_of([wall(2.0)])
    (sheet,) = grid.frontiers(min_size=50).voxels
    assert sheet[:, 2].max() * VOXEL_SIZE < 2.0
    parts = grid.frontiers(min_size=50, max_extent=1.0)
    assert len(parts) >= 4
    # Unknown space lies away from the axis of the view, at whichever side a part is; one around the tip sees several.
    outwards = np.sum(parts.centre[:, :2] * parts.normal[:, :2], axis=1)
    assert np.all(outwards[parts.centre[:, 2] > 1.0] > 0.0)
    # The sides of a pyramid as high as free space goes. Stairs of voxels are up to 8 % too large.
    height = (sheet[:, 2].max() + 1) * VOXEL_SIZE
    u, v = CAMERA.width / CAMERA.fx, CAMERA.height / CAMERA.fy
    exact = height**2 * (u * math.hypot(1.0, v / 2.0) + v * math.hypot(1.0, u / 2.0))
    assert 0.98 * exact < grid.frontiers(min_size=50).area[0] < 1.1 * exact


def test_small_clusters_are_left_out() -> None:
    grid = map_of(random_frames(3, seed=7))
    whole = grid.frontiers()
    assert 0 < np.sum(whole.size < 10) < len(whole)
    assert grid.frontiers(min_size=10).size.tolist() == whole.size[whole.size >= 10].tolist()
    assert len(grid.frontiers(min_size=0)) == len(whole)
    assert len(grid.frontiers(min_size=10**9)) == 0


@pytest.mark.parametrize("voxels_long", [8, 13, 40])
def test_large_clusters_are_divided(voxels_long: int) -> None:
    grid = map_of(random_frames(3, seed=8))
    parts = grid.frontiers(min_size=10, max_extent=voxels_long * VOXEL_SIZE)
    assert all(np.ptp(voxels, axis=0).max() < voxels_long for voxels in parts.voxels)
    whole = grid.frontiers(min_size=10)
    assert len(parts) > len(whole)
    every_part, every_whole = (np.unique(np.concatenate(found.voxels), axis=0) for found in (parts, whole))
    np.testing.assert_array_equal(every_part, every_whole)
    assert sum(parts.size) == sum(whole.size)
    np.testing.assert_allclose(sum(parts.area), sum(whole.area), rtol=1e-12)


def test_threads_do_not_matter() -> None:
    grid, threads = map_of(random_frames(4, seed=9)), pm.num_threads()
    try:
        found = []
        for count in (1, 3):
            pm.set_num_threads(count)
            found.append(grid.frontiers(max_extent=0.5))
    finally:
        pm.set_num_threads(threads)
    for name in ("size", "area", "centre", "normal"):
        np.testing.assert_array_equal(getattr(found[0], name), getattr(found[1], name))
    np.testing.assert_array_equal(np.concatenate(found[0].voxels), np.concatenate(found[1].voxels))


def test_an_empty_map_has_none() -> None:
    found = make_grid().frontiers()
    assert len(found) == 0
    assert found.voxels == []
    assert found.size.shape == found.area.shape == (0,)
    assert found.centre.shape == found.normal.shape == (0, 3)
    assert repr(found) == "Frontiers(0 clusters)"
    types = [array.dtype for array in (found.size, found.area, found.centre, found.normal)]
    assert types == [np.int64, np.float64, np.float64, np.float64]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"min_size": -1}, "min_size is -1, expected 0 or more"),
        ({"max_extent": 0.39}, "max_extent is 0.39, expected at least the edge of a block, 0.4 m"),
        ({"max_extent": 0.0}, "max_extent is 0, expected at least"),
        ({"max_extent": -2.0}, "max_extent is -2, expected at least"),
        ({"max_extent": math.nan}, "max_extent is NaN, expected at least"),
    ],
)
def test_bad_options(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        map_of(random_frames(1, seed=10), max_range=MAX_RANGE).frontiers(**options)
