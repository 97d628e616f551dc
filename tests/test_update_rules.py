"""Every update rule of the extension against the naive reference, on random scenes, in both directions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyramap as pm
import pytest
import reference
from compare import assert_same_map, blocks_of_box, blocks_of_lists
from numpy.typing import NDArray

TOLERANCE = 1e-3  # log-odds, for each frame
WITHIN = 0.9999


@dataclass(frozen=True)
class Case:
    """A random sequence of frames, all from one seed."""

    seed: int
    camera: reference.Camera
    voxel_size: float
    model: reference.Model
    max_range: float = 3.0
    frames: int = 1
    noise: float = 0.01
    beyond_max_range: str = "free"


FINE = reference.Camera(96, 64, 81.0, 77.0, 46.3, 33.1)
SMALL = reference.Camera(40, 30, 37.0, 41.0, 20.2, 14.4)
ODD = reference.Camera(53, 37, 30.0, 26.0, 25.0, 19.5)  # a wide view, cut windows on both borders
TALL = reference.Camera(31, 64, 60.0, 44.0, 12.0, 40.0)

CASES = {
    "fine voxels": Case(1, FINE, 0.05, reference.Model((0.05, 0.0, 0.0)), max_range=2.5),
    "layer 0 alone": Case(2, SMALL, 0.06, reference.Model((0.09, 0.0, 0.0)), max_range=3.0),
    "coarse voxels": Case(3, FINE, 0.3, reference.Model((0.3, 0.0, 0.0)), max_range=6.0, frames=2),
    "growing sigma": Case(4, ODD, 0.1, reference.Model((0.04, 0.01, 0.015), 0.8), max_range=4.0),
    "centred": Case(5, TALL, 0.08, reference.Model((0.08, 0.0, 0.0), 1.0, "centred")),
    "centred, growing": Case(6, SMALL, 0.1, reference.Model((0.05, 0.02, 0.01), 1.2, "centred")),
    "shifted by metres": Case(7, ODD, 0.1, reference.Model((0.1, 0.0, 0.0), 0.6, 0.07)),
    "rough": Case(8, FINE, 0.1, reference.Model((0.1, 0.0, 0.0)), noise=0.3),
    "too far is ignored": Case(9, SMALL, 0.12, reference.Model((0.12, 0.0, 0.0)), beyond_max_range="ignore"),
    "several frames": Case(10, SMALL, 0.12, reference.Model((0.1, 0.0, 0.0)), max_range=2.5, frames=3),
}


def random_depth(rng: np.random.Generator, case: Case) -> NDArray[np.float32]:
    """Slanted planes, boxes before and behind them, noise, and holes and patches of every kind of reading."""
    height, width = case.camera.height, case.camera.width
    x, y = case.camera.rays()[..., 0], case.camera.rays()[..., 1]
    far = case.max_range

    def patch() -> tuple[slice, slice]:
        top, left = rng.integers(0, height - 4), rng.integers(0, width - 4)
        return (
            slice(top, top + rng.integers(2, height // 2)),
            slice(left, left + rng.integers(2, width // 2)),
        )

    depth = far * rng.uniform(0.5, 0.8) / (1 + rng.uniform(-0.3, 0.3) * x + rng.uniform(-0.3, 0.3) * y)
    for _ in range(6):
        depth[patch()] = far * rng.uniform(0.2, 0.95)
    depth += case.noise * rng.standard_normal(depth.shape)
    depth = np.maximum(depth, 0.05)
    for reading in (0.0, np.nan, -1.0, np.inf, 2 * far):
        depth[patch()] = reading
    scattered = rng.random(depth.shape)
    for n, reading in enumerate((0.0, np.nan, -0.5, np.inf)):
        depth[(scattered > 0.01 * n) & (scattered < 0.01 * (n + 1))] = reading
    return depth.astype(np.float32)


def random_pose(rng: np.random.Generator) -> reference.Array:
    """Any rotation, within a metre of the origin."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = q, rng.uniform(-1, 1, 3)
    return pose


def random_views(case: Case) -> list[reference.View]:
    rng = np.random.default_rng(case.seed)
    return [
        reference.View(
            random_depth(rng, case),
            case.camera,
            random_pose(rng),
            case.voxel_size,
            case.model,
            case.max_range,
            "free" if case.beyond_max_range == "free" else "ignore",
        )
        for _ in range(case.frames)
    ]


def camera_of(camera: reference.Camera) -> pm.PinholeCamera:
    return pm.PinholeCamera(
        width=camera.width, height=camera.height, fx=camera.fx, fy=camera.fy, cx=camera.cx, cy=camera.cy
    )


def grid_of(views: list[reference.View], rule: reference.RuleName, **options: Any) -> pm.OccupancyGrid:
    """The extension's map of these views, on the CPU."""
    view = views[0]
    model = view.model
    sensor = pm.SensorModel(
        sigma=model.sigma if any(model.sigma[1:]) else model.sigma[0],
        k=model.k_per_sigma * model.sigma[0],
        surface_offset=model.surface_offset,
    )
    settings: dict[str, Any] = {
        "voxel_size": view.voxel_size,
        "sensor_model": sensor,
        "max_range": view.max_range,
        "update": rule,
        "backend": "cpu",
        "beyond_max_range": view.beyond_max_range,
    }
    grid = pm.OccupancyGrid(**settings | options)
    for each in views:
        grid.integrate(each.depth, camera_of(each.camera), each.world_from_camera)
    return grid


def assert_agrees(grid: pm.OccupancyGrid, views: list[reference.View], rule: reference.RuleName) -> None:
    first, shape = reference.frustum_blocks(views)
    expected, doubt = reference.integrate(views, rule, first, shape)
    coords = grid.block_coords()
    result = assert_same_map(
        blocks_of_lists(coords, grid.block_log_odds(coords)),
        blocks_of_box(expected, first),
        TOLERANCE * len(views),
        blocks_of_box(doubt, first),
        WITHIN,
    )
    assert result.compared > 1000, "the scene shows too little to prove anything"
    print(f"{rule}: {result.report}, {result.within:.5%} within, worst {result.worst:.2g}")


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("rule", reference.RULES)
def test_rule_agrees_with_the_reference(rule: reference.RuleName, name: str) -> None:
    views = random_views(CASES[name])
    assert_agrees(grid_of(views, rule), views, rule)


def test_defaults_are_sigma_of_a_voxel_and_k_of_sigma() -> None:
    views = random_views(Case(11, SMALL, 0.1, reference.Model((0.1, 0.0, 0.0))))
    assert_agrees(grid_of(views, "pyramid", sensor_model=None), views, "pyramid")
    assert_agrees(grid_of(views, "pyramid", sensor_model=pm.SensorModel(sigma=0.1)), views, "pyramid")


def test_pyramid_is_the_default_rule_and_five_metres_the_default_range() -> None:
    views = random_views(Case(12, SMALL, 0.2, reference.Model((0.2, 0.0, 0.0)), max_range=5.0))
    grid = pm.OccupancyGrid(0.2, backend="cpu")
    grid.integrate(views[0].depth, camera_of(SMALL), views[0].world_from_camera)
    assert_agrees(grid, views, "pyramid")


def test_a_frame_twice_is_twice_the_evidence() -> None:
    views = random_views(Case(13, SMALL, 0.15, reference.Model((0.15, 0.0, 0.0)))) * 2
    assert_agrees(grid_of(views, "pyramid"), views, "pyramid")


def test_integer_depth_with_a_scale() -> None:
    view = random_views(Case(14, SMALL, 0.1, reference.Model((0.1, 0.0, 0.0))))[0]
    readable = np.isfinite(view.depth) & (view.depth > 0)
    raw = np.where(readable, view.depth * 1000, 0).astype(np.uint16)
    grid = pm.OccupancyGrid(0.1, max_range=3.0, update="min_layer", backend="cpu")
    grid.integrate(raw, camera_of(SMALL), view.world_from_camera, depth_scale=1000.0)
    metres = (raw.astype(np.float64) / 1000).astype(np.float32)
    seen = reference.View(metres, SMALL, view.world_from_camera, 0.1, view.model, 3.0)
    assert_agrees(grid, [seen], "min_layer")


def test_float64_depth_is_read_as_float32() -> None:
    views = random_views(Case(15, ODD, 0.1, reference.Model((0.1, 0.0, 0.0))))
    grid = pm.OccupancyGrid(0.1, max_range=3.0, backend="cpu")
    grid.integrate(views[0].depth.astype(np.float64), camera_of(ODD), views[0].world_from_camera)
    assert_agrees(grid, views, "pyramid")


def test_the_prior_is_added_by_queries_and_not_stored() -> None:
    views = random_views(Case(16, SMALL, 0.15, reference.Model((0.15, 0.0, 0.0))))
    neutral, doubting = grid_of(views, "pyramid"), grid_of(views, "pyramid", prior=0.3)
    assert_agrees(neutral, views, "pyramid")
    coords = neutral.block_coords()
    blocks, voxels = np.nonzero(neutral.block_log_odds(coords).reshape(len(coords), -1))
    inner = np.stack(np.unravel_index(voxels, (8, 8, 8)), axis=-1)
    centres = (coords[blocks] * 8 + inner + 0.5) * 0.15
    prior = np.log(0.3 / 0.7)
    np.testing.assert_allclose(doubting.log_odds(centres), neutral.log_odds(centres) + prior, atol=1e-5)
