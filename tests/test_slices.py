"""Slices: a plane shows what the map answers there, and its picture says what it shows."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pyramap as pm
import pytest
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from pyramap import pictures
from pyramap.pictures import slice_drawing, slices

Corner = tuple[float, float, float]
WHITE = np.array([255, 255, 255])


@pytest.fixture(scope="module")
def grid() -> pm.OccupancyGrid:
    """Three views of a simulated room: known and unknown space, not a cube, with negative coordinates."""
    scene = pm.scenes.box()
    camera = pm.PinholeCamera(width=80, height=60, fx=60, fy=60, cx=39.5, cy=29.5)
    grid = pm.OccupancyGrid(0.25, max_range=8.0)
    for pose in scene.poses()[:31:15]:
        grid.integrate(scene.render(camera, pose), camera, pose)
    return grid


def points_of(layer: pictures.Slice, axis: int) -> NDArray[np.float64]:
    """Centres of the cells of an axis's slice in the world, (rows, columns, 3)."""
    rows, columns = layer.log_odds.shape
    across, upward = (other for other in range(3) if other != axis)
    points = np.empty((rows, columns, 3))
    points[..., axis] = layer.at
    points[..., across] = layer.origin[0] + (np.arange(columns) + 0.5) * layer.cell
    points[..., upward] = (layer.origin[1] + (np.arange(rows) + 0.5) * layer.cell)[:, None]
    return points


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("at", [-0.6, 0.0, 1.3])
def test_a_slice_is_what_the_map_answers(grid: pm.OccupancyGrid, axis: int, at: float) -> None:
    layer = pictures.cut(grid, axis, at)
    assert layer.cell == grid.voxel_size
    assert abs(layer.at - at) <= grid.voxel_size / 2
    points = points_of(layer, axis)
    unknown = grid.state(points.reshape(-1, 3)).reshape(points.shape[:2]) == -1
    np.testing.assert_array_equal(np.isnan(layer.log_odds), unknown)
    log_odds = grid.log_odds(points.reshape(-1, 3)).reshape(points.shape[:2])
    np.testing.assert_array_equal(layer.log_odds[~unknown], log_odds[~unknown])
    # It is cut to what is known, and holds all of it: as many voxels as the whole layer has.
    known = ~np.isnan(layer.log_odds)
    assert known[0].any()
    assert known[-1].any()
    assert known[:, 0].any()
    assert known[:, -1].any()
    coords = grid.block_coords()
    everywhere = grid.block_log_odds(coords)
    index = coords[:, axis, None] * 8 + np.arange(8)
    in_layer = np.moveaxis(everywhere, axis + 1, 1)[index == math.floor(at / grid.voxel_size)]
    assert known.sum() == np.count_nonzero(in_layer)


def test_a_large_slice_keeps_the_most_occupied_of_each_cell(
    grid: pm.OccupancyGrid, monkeypatch: pytest.MonkeyPatch
) -> None:
    fine = pictures.cut(grid, 2, 1.3)
    monkeypatch.setattr(slices, "_LONGEST_SIDE", 12)
    coarse = pictures.cut(grid, 2, 1.3)
    assert max(coarse.log_odds.shape) <= 12
    assert coarse.cell > fine.cell
    expected = np.full(coarse.log_odds.shape, np.nan, np.float32)
    points = points_of(fine, 2)
    for row, column in np.ndindex(fine.log_odds.shape):
        x, y = points[row, column, 0] - coarse.origin[0], points[row, column, 1] - coarse.origin[1]
        cell = math.floor(y / coarse.cell), math.floor(x / coarse.cell)
        expected[cell] = np.fmax(expected[cell], fine.log_odds[row, column])
    np.testing.assert_array_equal(coarse.log_odds, expected)


def test_a_slice_beside_the_map_says_where_the_map_is(grid: pm.OccupancyGrid) -> None:
    with pytest.raises(ValueError, match=r"no block of the map meets z = 100.125 m: the map spans .* to .* m"):
        pictures.cut(grid, 2, 100.0)
    with pytest.raises(ValueError, match="axis must be 0, 1 or 2"):
        pictures.cut(grid, 3, 0.0)
    with pytest.raises(ValueError, match="empty"):
        pictures.cut(pm.OccupancyGrid(0.1), 2, 0.0)


def test_an_oblique_plane_is_what_the_map_answers(grid: pm.OccupancyGrid) -> None:
    point, normal = np.array([0.3, -0.2, 1.1]), np.array([1.0, 2.0, 3.0]) / math.sqrt(14)
    plane = pictures.plane_through(point, 5 * normal)
    # Seen from where the normal points, with z upward as far as the plane allows.
    axes = np.stack([plane.right, plane.upward, plane.normal])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(plane.normal, normal, atol=1e-12)
    assert np.linalg.det(axes) > 0
    assert plane.upward[2] > 0
    assert abs(plane.right[2]) < 1e-12

    layer = pictures.cut_plane(grid, plane)
    assert layer.cell == grid.voxel_size
    rows, columns = layer.log_odds.shape
    # A margin of 3 m about the slice: there, nothing is known.
    margin = 12
    across = layer.origin[0] + (np.arange(-margin, columns + margin) + 0.5) * layer.cell
    upward = layer.origin[1] + (np.arange(-margin, rows + margin) + 0.5) * layer.cell
    points = np.array([[point + a * plane.right + b * plane.upward for a in across] for b in upward]).reshape(-1, 3)
    expected = np.where(grid.state(points) == -1, np.nan, grid.log_odds(points)).reshape(len(upward), len(across))
    inside = expected[margin:-margin, margin:-margin]
    np.testing.assert_array_equal(layer.log_odds, inside)
    assert np.isfinite(inside).sum() == np.isfinite(expected).sum() > 300


@pytest.mark.parametrize("normal", [(0, 0, 1), (0, 0, 7.5)])
def test_a_plane_along_the_axes_is_the_axis_s_slice(grid: pm.OccupancyGrid, normal: Corner) -> None:
    by_axis = pictures.cut(grid, 2, 1.3)
    by_normal = pictures.cut_plane(grid, pictures.plane_through((0, 0, by_axis.at), normal))
    np.testing.assert_array_equal(by_normal.log_odds, by_axis.log_odds)
    assert by_normal.origin == by_axis.origin
    assert by_axis.plane.title == "z = 1.375 m"
    assert by_normal.plane.title == "through (0, 0, 1.375) m, perpendicular to (0, 0, 1)"


def test_planes_that_cannot_be(grid: pm.OccupancyGrid) -> None:
    with pytest.raises(ValueError, match="points along the normal"):
        pictures.plane_through((0, 0, 0), (0, 1, 0), up=(0, -2, 0))
    with pytest.raises(ValueError, match="expected a direction"):
        pictures.plane_through((0, 0, 0), (0, 0, 0))
    with pytest.raises(ValueError, match="expected a point of three finite numbers"):
        pictures.plane_through((0, math.nan, 0), (0, 0, 1))
    with pytest.raises(ValueError, match=r"no block of the map meets the plane through .* the map spans"):
        pictures.cut_plane(grid, pictures.plane_through((50, 50, 50), (1, 1, 1)))


@pytest.fixture(scope="module")
def other(grid: pm.OccupancyGrid) -> pm.OccupancyGrid:
    """As `grid`, from other poses."""
    scene = pm.scenes.box()
    camera = pm.PinholeCamera(width=80, height=60, fx=60, fy=60, cx=39.5, cy=29.5)
    other = pm.OccupancyGrid(0.25, max_range=8.0)
    for index in (20, 50):
        pose = scene.poses()[index]
        other.integrate(scene.render(camera, pose), camera, pose)
    return other


def test_the_difference_of_two_maps(
    grid: pm.OccupancyGrid, other: pm.OccupancyGrid, monkeypatch: pytest.MonkeyPatch
) -> None:
    plane = pictures.axis_plane(1, 0.125)
    layer = pictures.cut_difference(grid, other, plane)
    points = points_of(layer, 1)
    flat = points.reshape(-1, 3)
    neither = (grid.state(flat) == -1) & (other.state(flat) == -1)
    expected = np.where(neither, np.nan, other.log_odds(flat) - grid.log_odds(flat)).reshape(points.shape[:2])
    np.testing.assert_array_equal(layer.log_odds, expected)
    assert np.nanmin(expected) < -0.1 and np.nanmax(expected) > 0.1
    # What only the one or only the other map knows lies in it too.
    assert np.any((grid.state(flat) == -1) & (other.state(flat) != -1))
    assert np.any((grid.state(flat) != -1) & (other.state(flat) == -1))

    monkeypatch.setattr(slices, "_LONGEST_SIDE", 12)
    coarse = pictures.cut_difference(grid, other, plane)
    assert coarse.cell > layer.cell
    gathered = np.full(coarse.log_odds.shape, np.nan, np.float32)
    for row, column in np.ndindex(layer.log_odds.shape):
        x, z = points[row, column, 0] - coarse.origin[0], points[row, column, 2] - coarse.origin[1]
        cell = math.floor(z / coarse.cell), math.floor(x / coarse.cell)
        value = layer.log_odds[row, column]
        if np.isfinite(value) and not abs(gathered[cell]) >= abs(value):
            gathered[cell] = value
    np.testing.assert_array_equal(coarse.log_odds, gathered)
    with pytest.raises(ValueError, match=r"0\.25 m and of 0\.5 m cannot be compared"):
        pictures.cut_difference(grid, pm.OccupancyGrid(0.5), plane)


def test_a_difference_has_its_colours() -> None:
    log_odds = np.array([[-4.0, 0.0, 4.0, np.nan]], np.float32)
    image = pictures.difference_image(pictures.Slice(log_odds, (0.0, 0.0), 0.1, pictures.axis_plane(2, 0.05)))
    less, same, more = (np.round(255 * np.array(slice_drawing.DIFFERENCES(p)[:3])) for p in (0.0, 0.5, 1.0))
    unknown = np.array([0xD9] * 3)
    columns = [np.nonzero(np.all(image == colour, axis=-1))[1].mean() for colour in (less, more, unknown)]
    assert columns == sorted(columns)
    assert np.array_equal(same, WHITE)
    # Nothing differs: all white, and no scale of zero length.
    pictures.difference_image(pictures.Slice(0 * log_odds, (0.0, 0.0), 0.1, pictures.axis_plane(2, 0.05)))


def test_the_scale_bar_of_a_slice_has_its_length() -> None:
    # 40 cells of 0.1 m are magnified to 30 pixels each: 4 m are 1200 pixels. Of a fifth of these, 0.5 m is the largest
    # round length.
    log_odds = np.full((20, 40), -2.0, np.float32)
    image = pictures.slice_image(pictures.Slice(log_odds, (0.0, 0.0), 0.1, pictures.axis_plane(2, 0.05)))
    ink = np.all(image[-100:] == 0x3C, axis=-1)
    # The line has caps: its length is known to their width. Right of column 246 there is its label.
    assert abs(max(int(np.ptp(np.flatnonzero(row))) for row in ink[:, :246] if row.any()) - 150) <= 4


def logit(p: float) -> float:
    return math.log(p / (1 - p))


def test_the_three_states_have_the_colours_of_the_legend() -> None:
    # The legend shows free at p = 0.1 and occupied at p = 0.9.
    log_odds = np.array([[logit(0.1), logit(0.9), np.nan]], np.float32)
    layer = pictures.Slice(log_odds, origin=(0.0, 0.0), cell=0.1, plane=pictures.axis_plane(2, 0.05))
    image = pictures.slice_image(layer)
    free, occupied, unknown = slice_drawing.colours(log_odds[0])
    assert len({tuple(colour) for colour in (free, occupied, unknown)}) == 3
    for colour in (free, occupied, unknown):
        rows, _ = np.nonzero(np.all(image == colour, axis=-1))
        # A cell in the map, 400 pixels wide and high, and a patch of the legend below it, apart from it.
        in_map = rows < image.shape[0] - 60
        assert 390 * 390 < in_map.sum() < 410 * 410
        assert 100 < (~in_map).sum() < 1000


def test_any_amount_of_evidence_has_a_colour() -> None:
    # 2^19 is the largest log-odds that a map holds.
    log_odds = np.array([-(2.0**19), -30, 30, 2.0**19], np.float32)
    colours = slice_drawing.colours(log_odds)
    np.testing.assert_array_equal(colours[0], colours[1])
    np.testing.assert_array_equal(colours[2], colours[3])
    # Eq. 5: p = 1 / (1 + exp(-l)); the scale has 256 steps.
    np.testing.assert_array_equal(
        slice_drawing.colours(np.array([1.2], np.float32))[0], shade(1 / (1 + math.exp(-1.2)))
    )


def shade(p: float) -> NDArray[np.float64]:
    return np.round(255 * np.array(slice_drawing.COLOURS(p)[:3]))


def test_a_slice_is_drawn_with_its_axes_the_right_way_round() -> None:
    # Two rows, three columns: occupied at the upper left.
    log_odds = np.full((2, 3), -2.0, np.float32)
    log_odds[1, 0] = 3.0
    image = pictures.slice_image(pictures.Slice(log_odds, (0.0, 0.0), 0.1, pictures.axis_plane(2, 0.05)))
    occupied = np.argwhere(np.all(image == slice_drawing.colours(log_odds[1, :1])[0], axis=-1))
    free = np.argwhere(np.all(image == slice_drawing.colours(log_odds[0, :1])[0], axis=-1))
    assert occupied.mean(axis=0)[0] < free.mean(axis=0)[0]
    assert occupied.mean(axis=0)[1] < free.mean(axis=0)[1]


# What people with each kind of colour blindness see of linear RGB (Machado, Oliveira and Fernandes 2009, severity 1).
COLOUR_VISIONS: dict[str, list[list[float]]] = {
    "full": [[1.0, 0, 0], [0, 1, 0], [0, 0, 1]],
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


@pytest.mark.parametrize("vision", COLOUR_VISIONS)
def test_the_states_can_be_told_apart_with_any_colour_vision(vision: str) -> None:
    log_odds = np.array([logit(0.1), logit(0.9), np.nan], np.float32)
    # Of the range 0 to 1 of each channel; a step of 0.1 is plain to see between areas side by side.
    assert least_distance(slice_drawing.colours(log_odds) / 255.0, vision) > 0.2


@pytest.mark.parametrize("vision", COLOUR_VISIONS)
def test_differences_can_be_told_apart_with_any_colour_vision(vision: str) -> None:
    scale = slice_drawing.DIFFERENCES
    ends = [scale(p)[:3] for p in (0.1, 0.5, 0.9)]
    assert least_distance(np.array([*ends, to_rgb(slice_drawing.UNKNOWN)]), vision) > 0.2


def least_distance(colours: NDArray[np.float64], vision: str) -> float:
    """Between any two of (N, 3) colours, 0 to 1 a channel, as someone with this colour vision sees them."""
    seen = np.clip(colours**2.2 @ np.transpose(COLOUR_VISIONS[vision]), 0, 1) ** (1 / 2.2)
    return min(float(np.linalg.norm(a - b)) for a, b in itertools.combinations(seen, 2))
