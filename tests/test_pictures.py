"""Pictures: the mesh is where geometry says, and a slice shows what the map answers."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from pyramap import pictures
from pyramap.pictures import rendering

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


@pytest.mark.parametrize(
    ("direction", "up", "right", "upward"),
    [
        ((0, 0, -2), (0, 0, 1), (1, 0, 0), (0, 1, 0)),  # a plan: y is up, since z is looked along
        ((0, 3, 0), (0, 0, 1), (1, 0, 0), (0, 0, 1)),
        ((0, 0, 1), (0, -1, 0), (1, 0, 0), (0, -1, 0)),  # as the first camera looks
        ((0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 0, 1)),
    ],
)
def test_looking_along_a_direction_shows_all(direction: Corner, up: Corner, right: Corner, upward: Corner) -> None:
    block = box((-1, -2, -3), (2, 2, 1))
    view = pictures.looking_along(block.vertices, direction, up, size=(120, 90))
    np.testing.assert_allclose(view.axes[:, 0], right, atol=1e-12)
    np.testing.assert_allclose(view.axes[:, 1], -np.array(upward), atol=1e-12)
    np.testing.assert_allclose(view.axes[:, 2] * np.linalg.norm(direction), direction, atol=1e-12)
    image = pictures.mesh_image(block.vertices, block.faces, view)
    height, width = image.shape[:2]
    assert width <= 120 and height <= 90 and (width == 120 or height == 90)
    rows, columns = np.nonzero(drawn(image))
    # The block fills the picture but for the margin, 2 % of it on each side.
    assert rows.min() <= 3 and rows.max() >= height - 4 and columns.min() <= 3 and columns.max() >= width - 4
    assert rows.min() > 0 and columns.min() > 0


def test_looking_along_nothing_is_an_error() -> None:
    with pytest.raises(ValueError, match="no faces"):
        pictures.looking_along(np.zeros((0, 3)), (0, 0, -1))
    with pytest.raises(ValueError, match="expected a direction"):
        pictures.looking_along(np.eye(3), (0, 0, 0))


def test_perspective_has_no_scale_bar() -> None:
    image = np.zeros((4, 4, 3), np.uint8)
    assert pictures.with_scale_bar(image, pictures.from_pose(np.eye(4))) is image


def test_pictures_need_neither_a_display_nor_pyplot() -> None:
    code = "import sys, pyramap.pictures.slice_drawing; sys.exit('matplotlib.pyplot' in sys.modules)"
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, env={"PATH": ""})
