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
    def views(camera: pm.PinholeCamera) -> list[dict[str, Any]]:
        return [{"depth": scene.render(camera, pose), "camera": camera, "world_from_camera": pose} for pose in poses]

    sensors = {"LiDAR": frames, "camera": views(scene.camera), "coarse camera": views(as_coarse_as_the_lidar())}
    errors = {name: np.mean([errors_of(frame) for frame in some], axis=0) for name, some in sensors.items()}
    for name, (pyramid, area) in errors.items():
        print(f"{name}: mean |dp| {pyramid:.5f} and {area:.5f}")
    pyramid, area = errors["LiDAR"]
    assert pyramid <= errors["camera"][0]
    # A voxel 5 m away is two and a half rows high: `area` has less to average than where a camera has 19. A camera with
    # as few rows errs as much.
    assert area <= 1.2 * errors["camera"][1]
    assert area <= 1.05 * errors["coarse camera"][1]


def as_coarse_as_the_lidar() -> pm.PinholeCamera:
    """A camera with as many columns and rows to a radian, which sees as high, and 80 degrees wide."""
    fx, fy = WIDTH / math.tau, (HEIGHT - 1) / math.radians(45.0)
    width, height = (int(2 * f * math.tan(math.radians(half))) for f, half in ((fx, 40.0), (fy, 22.5)))
    return pm.PinholeCamera(width, height, fx, fy, (width - 1) / 2, (height - 1) / 2)


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
