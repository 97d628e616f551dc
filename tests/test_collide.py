"""Collisions of balls and boxes, held against a program that measures the distance to every voxel."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import pytest
from frames import make_grid, map_of, random_frames, wall
from naive_map import OCCUPIED, UNKNOWN, DenseMap, Floats, dense_map
from numpy.typing import NDArray

Words = Literal["occupied", "free"]
GRIDS = {
    "plain": map_of(random_frames(4, seed=31), voxel_size=0.125),
    "biased": map_of(random_frames(2, seed=32), voxel_size=0.1, prior=0.35),
}
WORLDS = {name: dense_map(grid) for name, grid in GRIDS.items()}
BOTH: tuple[Words, Words] = ("occupied", "free")


def naive(world: DenseMap, low: Floats, high: Floats, radius: float, unknown: Words) -> bool:
    """Whether a box and all within a radius of it come as near as that to a voxel that counts as occupied."""
    blocked = (world.states == OCCUPIED) | ((world.states == UNKNOWN) & (unknown == "occupied"))
    squared: NDArray[np.float64] = np.zeros((1, 1, 1))
    for axis in range(3):
        lowest = (world.first[axis] + np.arange(world.states.shape[axis])) * world.voxel_size
        gap = np.maximum(lowest - high[axis], low[axis] - (lowest + world.voxel_size))
        shape = [1, 1, 1]
        shape[axis] = -1
        squared = squared + np.maximum(gap, 0).reshape(shape) ** 2
    # Whatever reaches beyond the array reaches unknown voxels on its border first.
    return bool(np.any(blocked & (squared <= radius**2)))


def random_shapes(name: str, count: int, seed: int) -> tuple[Floats, Floats, Floats]:
    """Low and high corners and radii, some of which are 0; from a hundredth of a voxel to much of the map.

    They begin in free space; elsewhere most collide at once.
    """
    rng = np.random.default_rng(seed)
    grid, world = GRIDS[name], WORLDS[name]
    size = world.voxel_size
    low = grid.voxel_centres(rng.choice(grid.free_voxels(), count)) + size * rng.uniform(-0.5, 0.5, (count, 3))
    edges = size * 10.0 ** rng.uniform(-2, 1.2, (count, 3))
    radii = size * 10.0 ** rng.uniform(-2, 1.2, count)
    # To reach the border of the array is enough: all beyond is unknown too.
    border = (world.first + world.states.shape) * size - size / 2
    return low, np.minimum(low + edges, border), np.where(rng.random(count) < 0.1, 0.0, radii)


@pytest.mark.parametrize("name", sorted(GRIDS))
@pytest.mark.parametrize("unknown", BOTH)
def test_balls(name: str, unknown: Words) -> None:
    grid, world = GRIDS[name], WORLDS[name]
    centres, _, radii = random_shapes(name, 1_500, seed=1)
    expected = [naive(world, centre, centre, radius, unknown) for centre, radius in zip(centres, radii, strict=True)]
    spheres = np.column_stack([centres, radii])
    found = grid.collides(spheres=spheres, unknown=unknown)
    assert found.dtype == np.bool_
    assert found.shape == (1_500,)
    np.testing.assert_array_equal(found, expected)
    assert 100 < found.sum() < 1_400
    # Alone, shapes are looked up in another way.
    alone = [grid.collides(spheres=spheres[row : row + 1], unknown=unknown)[0] for row in range(300)]
    np.testing.assert_array_equal(alone, expected[:300])


@pytest.mark.parametrize("name", sorted(GRIDS))
@pytest.mark.parametrize("unknown", BOTH)
def test_boxes(name: str, unknown: Words) -> None:
    grid, world = GRIDS[name], WORLDS[name]
    lows, highs, _ = random_shapes(name, 1_500, seed=2)
    expected = [naive(world, low, high, 0.0, unknown) for low, high in zip(lows, highs, strict=True)]
    found = grid.collides(boxes=np.column_stack([lows, highs]), unknown=unknown)
    np.testing.assert_array_equal(found, expected)
    assert 100 < found.sum() < 1_400


@pytest.mark.parametrize("unknown", BOTH)
def test_points_collide_where_their_voxel_is_occupied(unknown: Words) -> None:
    """On a lattice of quarters of voxels: faces, edges and corners too belong to the voxels above them."""
    grid, world = GRIDS["plain"], WORLDS["plain"]
    lattice = np.random.default_rng(3).integers(4 * world.first, 4 * (world.first + world.states.shape), (20_000, 3))
    points = lattice * world.voxel_size / 4
    state = grid.state(points)
    expected = (state == OCCUPIED) | ((state == UNKNOWN) & (unknown == "occupied"))
    np.testing.assert_array_equal(grid.collides(boxes=np.hstack([points, points]), unknown=unknown), expected)
    balls = np.column_stack([points, np.zeros(len(points))])
    np.testing.assert_array_equal(grid.collides(spheres=balls, unknown=unknown), expected)


def test_to_stand_on_something_is_not_to_collide() -> None:
    grid = map_of([wall(2.0)], voxel_size=0.125)
    front = grid.cast_rays([[0.0625, 0.0625, 1.0]], [[0, 0, 1]], 5.0)
    face = float(front.voxel[0, 2] * 0.125)  # of the first occupied voxels; they are closed towards us
    box = [0.0, 0.0, 1.0, 0.1, 0.1]
    boxes = [[*box, np.nextafter(face, 0)], [*box, face]]
    np.testing.assert_array_equal(grid.collides(boxes=boxes), [False, True])
    balls = [[0.0625, 0.0625, face - 0.0625, radius] for radius in (0.0624999, 0.0625)]
    np.testing.assert_array_equal(grid.collides(spheres=balls), [False, True])
    # From the other side: the upper face of an occupied voxel belongs to the next one.
    behind = face + 0.125
    while grid.state([[0.05, 0.05, behind]])[0] == OCCUPIED:
        behind += 0.125
    above = [[0, 0, behind, 0.1, 0.1, behind + 1], [0, 0, np.nextafter(behind, 0), 0.1, 0.1, behind + 1]]
    np.testing.assert_array_equal(grid.collides(boxes=above, unknown="free"), [False, True])


@pytest.mark.parametrize("huge", [50.0, 1e6, 1e300])
def test_shapes_larger_than_the_map(huge: float) -> None:
    """They cost no more than the map, whatever their size."""
    grid = GRIDS["plain"]
    around = [[0, 0, 0, huge]]
    boxes = [[-huge] * 3 + [huge] * 3]
    for unknown in BOTH:
        np.testing.assert_array_equal(grid.collides(spheres=around, unknown=unknown), [True])
        np.testing.assert_array_equal(grid.collides(boxes=boxes, unknown=unknown), [True])
    # They may miss the map for all that.
    far = [[3 * huge, 0, 0, huge]]
    np.testing.assert_array_equal(grid.collides(spheres=far, unknown="free"), [False])
    np.testing.assert_array_equal(grid.collides(spheres=far, unknown="occupied"), [True])
    # Nothing is occupied in an empty map.
    np.testing.assert_array_equal(make_grid().collides(spheres=around, unknown="free"), [False])
    np.testing.assert_array_equal(make_grid().collides(boxes=boxes), [True])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "spheres and boxes are both missing, expected one of them"),
        ({"spheres": [[0, 0, 0, 1]], "boxes": [[0, 0, 0, 1, 1, 1]]}, "spheres and boxes are both given"),
        ({"spheres": [[0, 0, 0]]}, r"spheres have shape \[1, 3\], expected \(N, 4\)"),
        ({"boxes": [[0, 0, 0, 1]]}, r"boxes have shape \[1, 4\], expected \(N, 6\)"),
        (
            {"spheres": [[0, 0, 0, 1], [0, 0, 0, -1]]},
            r"spheres is \[0.0, 0.0, 0.0, -1.0\] in row 1, expected a radius of 0",
        ),
        ({"spheres": [[0, 0, 0, math.inf]]}, r"spheres is \[0.0, 0.0, 0.0, inf\] in row 0, expected finite"),
        ({"boxes": [[0, 0, 0, 1, -1, 1]]}, r"boxes is \[0.0, .*\] in row 0, expected the lowest corner first"),
        ({"boxes": [[0, math.nan, 0, 1, 1, 1]]}, r"boxes is \[0.0, NaN, .*\] in row 0, expected finite"),
        ({"spheres": [[0, 0, 0, 1]], "unknown": "stop"}, 'unknown is "stop", expected "occupied" or "free"'),
    ],
)
def test_bad_shapes_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        GRIDS["plain"].collides(**arguments)


def test_no_shapes() -> None:
    assert GRIDS["plain"].collides(spheres=np.zeros((0, 4))).shape == (0,)
