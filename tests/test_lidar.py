"""A spinning LiDAR of 64 beams and 2048 columns in the simulated office: no seam, and as exact as a camera."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import pyramap as pm
import pytest
from numpy.typing import NDArray

Rule = Literal["ideal", "pyramid", "area", "min_layer"]
Array = NDArray[np.float64]

WIDTH, HEIGHT = 2048, 64
VOXEL_SIZE = 0.16
FIRST_AZIMUTH = 0.3
# The LiDAR's axes, forward, left and up, in those of a camera: right, down and forward.
LIDAR_IN_CAMERA = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def scene() -> pm.scenes.Scene:
    return pm.scenes.office_loop()


@pytest.fixture(scope="module")
def poses(scene: pm.scenes.Scene) -> list[Array]:
    """Ten places around the loop, as the camera has them."""
    views = scene.poses()
    return [views[n] for n in np.linspace(0, len(views) - 1, 10).astype(int)]


def lidar(first_azimuth: float) -> pm.SphericalSensor:
    beams = (math.radians(22.5), math.radians(-22.5))
    return pm.SphericalSensor(WIDTH, beams, HEIGHT, first_azimuth=first_azimuth)


def make_grid(update: Rule) -> pm.OccupancyGrid:
    return pm.OccupancyGrid(VOXEL_SIZE, max_range=5.0, update=update, backend="cpu")


@pytest.fixture(scope="module")
def frames(scene: pm.scenes.Scene, poses: list[Array]) -> list[dict[str, Any]]:
    """What the LiDAR measures there: the arguments of `integrate`."""
    sensor = lidar(FIRST_AZIMUTH)
    return [
        {"ranges": scene.render_ranges(sensor, pose), "camera": sensor, "world_from_camera": pose}
        for pose in (pose @ LIDAR_IN_CAMERA for pose in poses)
    ]


@pytest.mark.parametrize("update", ["pyramid", "area", "min_layer"])
def test_there_is_no_seam(frames: list[dict[str, Any]], update: Rule) -> None:
    """Two maps of all ten places whose images begin half a turn apart. A seam would be a difference: what
    is on it in one map is far from it in the other."""
    whole, turned = make_grid(update), make_grid(update)
    for frame in frames:
        whole.integrate(**frame)
        # Columns go clockwise. Half a turn is a whole number of the windows of every layer.
        ranges = np.roll(frame["ranges"], WIDTH // 2, axis=1)
        turned.integrate(**{**frame, "ranges": ranges, "camera": lidar(FIRST_AZIMUTH + math.pi)})
    coords = whole.block_coords()
    np.testing.assert_array_equal(turned.block_coords(), coords)
    log_odds = whole.block_log_odds(coords)
    assert (log_odds != 0).sum() > 50_000
    np.testing.assert_array_equal(turned.block_log_odds(coords), log_odds)


def test_the_lidar_is_as_near_to_the_ideal_as_the_camera(
    scene: pm.scenes.Scene, poses: list[Array], frames: list[dict[str, Any]]
) -> None:
    camera, render = scene.camera, scene.render
    views = [{"depth": render(camera, pose), "camera": camera, "world_from_camera": pose} for pose in poses]
    of_lidar, of_camera = ([errors_of(frame) for frame in some] for some in (frames, views))
    (pyramid, area), (camera_pyramid, camera_area) = (np.mean(errors, axis=0) for errors in (of_lidar, of_camera))
    print(f"mean |dp|: LiDAR {pyramid:.5f} and {area:.5f}, camera {camera_pyramid:.5f} and {camera_area:.5f}")
    # The camera sees more of the walls that are near, and the LiDAR more of floor and ceiling at grazing angles.
    assert area <= 1.25 * camera_area
    assert pyramid <= 1.25 * camera_pyramid


def errors_of(frame: dict[str, Any]) -> tuple[float, float]:
    """Mean |dp| to the ideal of `pyramid` and `area`, over the voxels that any of the three knows."""
    rules: tuple[Rule, ...] = ("ideal", "pyramid", "area")
    grids = [make_grid(update) for update in rules]
    for grid in grids:
        grid.integrate(**frame)
    coords = np.unique(np.concatenate([grid.block_coords() for grid in grids]), axis=0)
    evidence = np.stack([grid.block_log_odds(coords).astype(np.float64) for grid in grids])
    p = 1.0 / (1.0 + np.exp(-evidence[:, (evidence != 0).any(axis=0)]))
    return float(np.abs(p[1] - p[0]).mean()), float(np.abs(p[2] - p[0]).mean())
