"""The acceptance test of the mesh: the paper's SPHERES room, all 181 views, voxels of 20 mm (some 3 s).

The settings are the best of `examples/spheres_accuracy.py`; the truth is the scene's own signed distance.
"""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from pyramap import OccupancyGrid, scenes
from pyramap.datasets import Frame
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

EXAMPLE = Path(__file__).parents[1] / "examples" / "spheres_accuracy.py"


@pytest.fixture(scope="module")
def experiment() -> dict[str, Any]:
    return runpy.run_path(str(EXAMPLE))


@pytest.fixture(scope="module")
def views() -> list[Frame]:
    return list(scenes.spheres().frames())


@pytest.fixture(scope="module")
def mesh(experiment: dict[str, Any], views: list[Frame]) -> trimesh.Trimesh:
    best = experiment["BEST"]
    grid: OccupancyGrid = experiment["fuse"](scenes.spheres(), views, best)
    assert grid.voxel_size == 0.02
    return grid.mesh(min_evidence=best.min_evidence, min_faces=experiment["SPECK_FACES"]).to_trimesh()


def test_vertices_lie_on_the_true_surface(mesh: trimesh.Trimesh, views: list[Frame]) -> None:
    assert len(views) == 181
    distances = scenes.spheres().signed_distance(mesh.vertices)
    assert np.sqrt(np.mean(distances**2)) <= 0.005
    assert abs(np.mean(distances)) <= 0.002
    assert np.quantile(np.abs(distances), 0.99) <= 0.015


def test_the_mesh_covers_what_was_seen(mesh: trimesh.Trimesh, views: list[Frame]) -> None:
    """Leaving voxels out must not make the mesh accurate by leaving out the surface."""
    seen = np.concatenate([points_of(view)[::97] for view in views[::10]])
    distance, _ = cKDTree(mesh.vertices).query(seen)
    # Vertices lie a voxel apart or less: 1.5 voxels from all of them there is no mesh.
    assert np.mean(distance > 0.03) < 0.01


def test_what_lies_far_off_is_behind_an_edge(mesh: trimesh.Trimesh) -> None:
    """The camera never leaves the origin, so that a vertex far off can be told to be in a shadow."""
    scene = scenes.spheres()
    distances = scene.signed_distance(mesh.vertices)
    far = mesh.vertices[np.abs(distances) > 0.015]
    behind = np.linalg.norm(far, axis=1) - surface_along(scene, far)
    assert np.mean(behind > 0.01) > 0.95


def test_no_piece_is_stray(mesh: trimesh.Trimesh) -> None:
    edges = coo_matrix((np.ones(len(mesh.edges)), mesh.edges.T), shape=(len(mesh.vertices),) * 2)
    pieces, _ = connected_components(edges, directed=False)
    # The room, its box and the ball that the box all but touches are one piece; the other three balls float.
    assert pieces == 4


def test_the_paper_s_own_model_lies_in_front(experiment: dict[str, Any], views: list[Frame]) -> None:
    """With k = sigma and no offset log-odd zero lies 1.48 sigma in front of a reading; 0.1 sigma for the grid's own."""
    (paper,) = [settings for settings in experiment["PAPER"] if settings.sigma == 0.02]
    mesh = experiment["fuse"](scenes.spheres(), views[::10], paper).mesh()
    bias = np.median(scenes.spheres().signed_distance(mesh.vertices))
    assert bias == pytest.approx(1.48 * paper.sigma, abs=0.1 * paper.sigma)


def points_of(view: Frame) -> NDArray[np.float64]:
    """World points of the pixels of a view."""
    v, u = np.indices(view.depth.shape)
    camera = view.camera
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1)
    points = (rays * view.depth[..., None]).reshape(-1, 3)
    pose = view.world_from_camera
    return np.asarray(points @ pose[:3, :3].T + pose[:3, 3])


def surface_along(scene: scenes.Scene, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance from the origin to the surface towards each point: steps as long as the distance to any surface."""
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    length = np.zeros(len(points))
    for _ in range(200):
        length += np.maximum(scene.signed_distance(directions * length[:, None]), 0.0)
    return length
