"""Pictures: the mesh is where geometry says, and a slice shows what the map answers."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pyramap as pm
import pytest
import trimesh
from numpy.typing import NDArray
from pyramap import pictures
from pyramap.pictures import rendering, slice_drawing, slices

WHITE = np.array(rendering.BACKGROUND)
Corner = tuple[float, float, float]


def straight_down(width: float, pixels: int, height: float = 10.0) -> pictures.View:
    """Parallel rays along -z, x to the right, y upward, around the z axis."""
    axes = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
    return pictures.View(eye=np.array([0, 0, height]), axes=axes, width=width, size=(pixels, pixels))


def drawn(image: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return np.asarray(np.any(image != WHITE, axis=-1))


def box(low: Corner, high: Corner, seen_from_inside: bool = False) -> trimesh.Trimesh:
    mesh: trimesh.Trimesh = trimesh.creation.box(bounds=np.array([low, high], dtype=float))
    if seen_from_inside:
        mesh.invert()
    return mesh


def joined(*meshes: trimesh.Trimesh) -> trimesh.Trimesh:
    vertices, faces = trimesh.util.append_faces([m.vertices for m in meshes], [m.faces for m in meshes])
    return trimesh.Trimesh(vertices, faces, process=False)


def rotation(angle: float, axis: Corner) -> NDArray[np.float64]:
    """(3, 3), by Rodrigues' formula."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: NDArray[np.float64] = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return turned


ROOM = box((0, 0, 0), (4, 3, 2.5), seen_from_inside=True)
ROOM_WITH_CUBE = joined(ROOM, box((1, 1, 0), (1.5, 1.5, 0.5)))
FLOOR = trimesh.Trimesh([[-2, -4, 0], [2, -4, 0], [2, 0, 0], [-2, 0, 0]], [[0, 1, 2], [0, 2, 3]])
WALL = trimesh.Trimesh([[-2, 0, 0], [2, 0, 0], [2, 0, 2], [-2, 0, 2]], [[0, 1, 2], [0, 2, 3]])
"""Its front looks along -y."""


def bluish(image: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Pixels in the tone of backs; fronts and background are warmer or white."""
    colour = image.astype(int)
    return np.asarray(colour[..., 2] > colour[..., 0] + 10)


# --- the mesh ---------------------------------------------------------------------------------------------------------


def test_a_ball_is_a_disc_of_its_size_lit_in_the_middle() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=1.0)
    image = pictures.mesh_image(ball.vertices, ball.faces, straight_down(width=3.0, pixels=300), ball.vertices)
    disc = drawn(image)
    # Pixels of 0.01 m: the rim's pixels, 2 pi / 0.01, count as drawn when the disc covers any sample of them: half of
    # them too many at most.
    assert math.pi * 1e4 <= disc.sum() <= math.pi * 1e4 + math.pi * 100
    assert disc[150, 150]
    assert not disc[0, 0]
    assert image[140:160, 140:160].mean() > image[150, 52:55].mean() + 40


def test_fronts_take_the_colours_of_their_vertices() -> None:
    red, blue = (200, 0, 0), (0, 0, 200)
    floor = trimesh.Trimesh([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], [[0, 1, 2], [0, 2, 3]])
    view = straight_down(width=3.2, pixels=64)
    image = pictures.mesh_image(floor.vertices, floor.faces, view, colours=[red, blue, blue, red]).astype(float)
    # x runs from -1.6 to 1.6 m over 64 pixels, and from red to blue over 4 m.
    x = (np.arange(64) + 0.5) / 64 * 3.2 - 1.6
    share = image[30, :, 2] / (image[30, :, 0] + image[30, :, 2])
    np.testing.assert_allclose(
        share, (x + 2) / 4, atol=0.01
    )  # two roundings of values near 200, or near 20 at the ends
    assert image[..., 1].max() == 0


def test_edges_are_antialiased() -> None:
    plate = trimesh.creation.box(extents=[1.0, 1.0, 0.01])
    # 100 pixels a metre, moved by half a pixel: the columns at the edge are half covered.
    plate.apply_translation([0.005, 0, 0])
    image = pictures.mesh_image(plate.vertices, plate.faces, straight_down(width=2.0, pixels=200))
    inside, edge = image[100, 100].astype(float), image[100, 50].astype(float)
    # Within 4 grey levels: the occlusion is not supersampled.
    np.testing.assert_allclose(edge, (inside + WHITE) / 2, atol=4)


def test_corners_are_darker_than_open_floor() -> None:
    corner = joined(FLOOR, WALL)
    # From above and in front, 45 degrees down; the line where the two meet runs through the middle of the picture.
    view = pictures.looking_at((0, -30, 30), (0, 0, 0))
    parallel = pictures.View(view.eye, view.axes, width=4.0, size=(400, 400))
    image = pictures.mesh_image(corner.vertices, corner.faces, parallel).mean(axis=-1)
    assert image[202:206, 100:300].mean() < image[280:300, 100:300].mean() - 15
    assert image[194:198, 100:300].mean() < image[100:120, 100:300].mean() - 15


def test_one_looks_through_ceilings_into_the_room() -> None:
    room, empty = ROOM_WITH_CUBE, ROOM
    view = pictures.overview(room.vertices, room.faces, size=(200, 200))
    inside = pictures.mesh_image(room.vertices, room.faces, view)
    assert not bluish(inside).any()
    assert np.any(pictures.mesh_image(empty.vertices, empty.faces, view) != inside)
    # With backs drawn, the room is a closed box that hides the cube.
    outside = pictures.mesh_image(room.vertices, room.faces, view, hide_backs=False)
    assert bluish(outside)[drawn(outside)].mean() > 0.99
    np.testing.assert_array_equal(pictures.mesh_image(empty.vertices, empty.faces, view, hide_backs=False), outside)


def test_a_picture_is_the_same_each_time_and_another_of_another_mesh() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    view = pictures.overview(ball.vertices, ball.faces, size=(120, 90))
    first, again = (pictures.mesh_image(ball.vertices, ball.faces, view) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    dented = ball.vertices.copy()
    dented[np.argmin(dented @ view.axes[:, 2])] *= 0.8
    assert np.any(pictures.mesh_image(dented, ball.faces, view) != first)


def test_the_shade_is_the_same_however_far_from_the_origin() -> None:
    room = ROOM_WITH_CUBE
    view = straight_down(width=8.0, pixels=100)
    # A power of two, so that moving rounds nothing in float64.
    far = np.array([2.0**20, -(2.0**20), 0])
    moved = pictures.View(eye=view.eye + far, axes=view.axes, width=view.width, size=view.size)
    here = pictures.mesh_image(room.vertices, room.faces, view)
    np.testing.assert_array_equal(pictures.mesh_image(room.vertices + far, room.faces, moved), here)


def test_a_mesh_without_faces_gives_a_white_picture_and_no_overview() -> None:
    none = np.empty((0, 3), np.uint32)
    assert not drawn(pictures.mesh_image(np.empty((0, 3)), none, straight_down(1.0, 8))).any()
    with pytest.raises(ValueError, match="no faces"):
        pictures.overview(np.empty((0, 3)), none)


# --- views ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("up", [(0, 0, 1), (0, -1, 0), (0.1, 0.2, -3)])
def test_an_overview_holds_the_whole_mesh_upright_and_from_above(up: tuple[float, float, float]) -> None:
    room = ROOM_WITH_CUBE
    view = pictures.overview(room.vertices, room.faces, up, size=(200, 150))
    width, height = view.size
    assert max(width / 200, height / 150) == 1
    at = (room.vertices - view.eye) @ view.axes
    metres_per_pixel = view.width / width
    assert np.all(np.abs(at[:, 0]) < view.width / 2)
    assert np.all(np.abs(at[:, 1]) < height * metres_per_pixel / 2)
    assert np.all(at[:, 2] > 0)
    right, down, forward = view.axes.T
    assert abs(right @ up) < 1e-9
    assert down @ up < 0
    assert forward @ up < 0
    np.testing.assert_allclose(view.axes.T @ view.axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(view.axes) > 0


def test_an_overview_turns_to_the_side_that_shows_most() -> None:
    # The wall is seen by who looks along +y.
    assert pictures.overview(WALL.vertices, WALL.faces).axes[1, 2] > 0.5
    assert pictures.overview(WALL.vertices, WALL.faces[:, ::-1]).axes[1, 2] < -0.5


@pytest.mark.parametrize("up", [(0, 0, 0), (math.nan, 0, 1), (1, 2)])
def test_an_overview_refuses_a_direction_that_is_none(up: tuple[float, ...]) -> None:
    ball = trimesh.creation.icosphere(subdivisions=1)
    with pytest.raises(ValueError, match="expected a direction"):
        pictures.overview(ball.vertices, ball.faces, up)


@pytest.mark.parametrize("backed", [0.0, 2.0])
def test_a_view_from_a_pose_sees_what_the_camera_sees(backed: float) -> None:
    pose = np.eye(4)
    pose[:3, :3] = rotation(0.7, (1, 2, 3))
    pose[:3, 3] = 5, -3, 1
    # A ball of 0.1 m, 4 m ahead, 1 m to the right and 0.5 m below the axis.
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    ball.apply_translation(pose[:3, :3] @ [1, 0.5, 4] + pose[:3, 3])
    view = pictures.from_pose(pose, size=(400, 300), angle_deg=90, back=backed)
    rows, columns = np.nonzero(drawn(pictures.mesh_image(ball.vertices, ball.faces, view)))
    # 90 degrees: the focal length is half the width. A sphere's outline is not quite centred on its centre: 1 pixel.
    focal = 200 / (4 + backed)
    assert columns.mean() + 0.5 == pytest.approx(200 + focal, abs=1)
    assert rows.mean() + 0.5 == pytest.approx(150 + 0.5 * focal, abs=1)


def test_looking_at_puts_the_target_in_the_middle_and_up_on_top() -> None:
    eye, target = np.array([3.0, 1, 2]), np.array([-1.0, 0, 0.5])
    view = pictures.looking_at(eye, target, up=(0, 0, 1))
    np.testing.assert_allclose(view.eye, eye)
    np.testing.assert_allclose((target - eye) @ view.axes, np.array([0, 0, np.linalg.norm(target - eye)]), atol=1e-12)
    assert view.axes[2, 1] < 0
    assert np.linalg.det(view.axes) == pytest.approx(1)
    with pytest.raises(ValueError, match="line of sight"):
        pictures.looking_at((0, 0, 1), (0, 0, 0), up=(0, 0, 1))
    with pytest.raises(ValueError, match="direction"):
        pictures.looking_at(eye, eye)


def test_up_is_guessed_from_how_the_camera_was_held() -> None:
    upright = np.eye(4)
    upright[:3, :3] = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]).T  # x right, y down is -z, looking along y
    leaning = upright.copy()
    leaning[:3, :3] = rotation(0.3, (1, 0, 0)) @ upright[:3, :3]
    np.testing.assert_allclose(pictures.up_from_poses([upright]), [0, 0, 1])
    np.testing.assert_allclose(pictures.up_from_poses([upright, leaning]), [0, -math.sin(0.15), math.cos(0.15)])
    upside_down = upright.copy()
    upside_down[:3, :3] *= -1
    for useless in ([], [upright, upside_down]):
        with pytest.raises(ValueError, match="cannot be guessed"):
            pictures.up_from_poses(useless)


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 1, 0), (0, -1, 0)])
def test_up_is_guessed_from_floors(up: tuple[float, float, float]) -> None:
    room = joined(FLOOR, WALL)
    about_x = math.atan2(-up[1], up[2])
    vertices = room.vertices @ rotation(about_x + 0.2, (1, 0, 0)).T  # a camera that is not quite level
    np.testing.assert_array_equal(pictures.up_from_mesh(vertices, room.faces), up)


@pytest.mark.parametrize(("width", "metres"), [(30.0, 5.0), (11.0, 2.0), (0.07, 0.01)])
def test_the_scale_bar_is_as_long_as_it_says(width: float, metres: float) -> None:
    view = straight_down(width, 1000)
    image = np.full((1000, 1000, 3), 255, np.uint8)
    with_bar = pictures.with_scale_bar(image, view)
    np.testing.assert_array_equal(with_bar[:1000], image)
    dark = drawn(with_bar[1000:])
    # The bar is the only dark run that long in its row; the text beside it stands apart.
    run = max(_longest_run(row) for row in dark)
    assert run * width / 1000 == pytest.approx(metres, abs=3 * width / 1000)


def _longest_run(row: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], row, [False]]).astype(int)))
    return int(np.max(np.diff(edges)[::2], initial=0))


def test_perspective_has_no_scale_bar() -> None:
    image = np.zeros((4, 4, 3), np.uint8)
    assert pictures.with_scale_bar(image, pictures.from_pose(np.eye(4))) is image


# --- slices -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def grid() -> pm.OccupancyGrid:
    """Three views of a simulated room: known and unknown space, not a cube, with negative coordinates."""
    scene = pm.scenes.box()
    camera = pm.PinholeCamera(width=80, height=60, fx=60, fy=60, cx=39.5, cy=29.5)
    grid = pm.OccupancyGrid(0.25, max_range=8.0)
    for pose in scene.poses()[:31:15]:
        grid.integrate(scene.render(camera, pose), camera, pose)
    return grid


def points_of(layer: pictures.Slice) -> NDArray[np.float64]:
    """Centres of the cells of a slice in the world, (rows, columns, 3)."""
    rows, columns = layer.log_odds.shape
    points = np.empty((rows, columns, 3))
    points[..., layer.axis] = layer.at
    points[..., layer.across] = layer.origin[0] + (np.arange(columns) + 0.5) * layer.cell
    points[..., layer.upward] = (layer.origin[1] + (np.arange(rows) + 0.5) * layer.cell)[:, None]
    return points


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("at", [-0.6, 0.0, 1.3])
def test_a_slice_is_what_the_map_answers(grid: pm.OccupancyGrid, axis: int, at: float) -> None:
    layer = pictures.cut(grid, axis, at)
    assert layer.cell == grid.voxel_size
    assert abs(layer.at - at) <= grid.voxel_size / 2
    points = points_of(layer)
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
    points = points_of(fine)
    for row, column in np.ndindex(fine.log_odds.shape):
        x, y = points[row, column, 0] - coarse.origin[0], points[row, column, 1] - coarse.origin[1]
        cell = math.floor(y / coarse.cell), math.floor(x / coarse.cell)
        expected[cell] = np.fmax(expected[cell], fine.log_odds[row, column])
    np.testing.assert_array_equal(coarse.log_odds, expected)


def test_a_slice_beside_the_map_says_where_the_map_is(grid: pm.OccupancyGrid) -> None:
    with pytest.raises(ValueError, match=r"no block of the map meets z = 100 m: the map spans .* to .* m"):
        pictures.cut(grid, 2, 100.0)
    with pytest.raises(ValueError, match="axis must be 0, 1 or 2"):
        pictures.cut(grid, 3, 0.0)
    with pytest.raises(ValueError, match="empty"):
        pictures.cut(pm.OccupancyGrid(0.1), 2, 0.0)


def logit(p: float) -> float:
    return math.log(p / (1 - p))


def test_the_three_states_have_the_colours_of_the_legend() -> None:
    # The legend shows free at p = 0.1 and occupied at p = 0.9.
    log_odds = np.array([[logit(0.1), logit(0.9), np.nan]], np.float32)
    layer = pictures.Slice(log_odds, origin=(0.0, 0.0), cell=0.1, axis=2, at=0.05)
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
    image = pictures.slice_image(pictures.Slice(log_odds, (0.0, 0.0), 0.1, 2, 0.05))
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
    linear = (slice_drawing.colours(log_odds) / 255.0) ** 2.2
    seen = np.clip(linear @ np.transpose(COLOUR_VISIONS[vision]), 0, 1) ** (1 / 2.2)
    distances = [np.linalg.norm(seen[i] - seen[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    # Of the range 0 to 1 of each channel; a step of 0.1 is plain to see between areas side by side.
    assert min(distances) > 0.2


def test_pictures_need_neither_a_display_nor_pyplot() -> None:
    code = "import sys, pyramap.pictures.slice_drawing; sys.exit('matplotlib.pyplot' in sys.modules)"
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, env={"PATH": ""})
