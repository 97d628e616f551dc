"""Close a loop: odometry drifts, the map shows walls twice, and all frames are moved to where they belong.

A walk through an office ends where it began. Its poses come from odometry, whose errors add up, so that the map does
not meet itself at the end. Once the place is recognised, the error is known and spread over the walk, and every frame
is moved to its corrected pose, in the map as it is. No trace of the drift is left: the map is to the last byte the one
that had the corrected poses from the start.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
import pyramap as pm
from numpy.typing import NDArray
from PIL import Image
from pyramap import pictures

VOXEL_SIZE = 0.05
TURN_DRIFT = np.radians(5.0)
"""By which odometry has turned too far at the end of the walk."""
TURN_NOISE, STEP_NOISE = np.radians(0.3), 0.02
"""Standard deviations of what random errors of turns (radians) and steps (metres) add up to by then."""
EYE_LEVEL = 1.2
"""Height of the slices, metres."""

Poses = NDArray[np.float64]
"""(N, 4, 4) `world_from_camera`."""


def main() -> None:
    parser = argparse.ArgumentParser(description="Correct the poses of a whole walk, and the map with them.")
    parser.add_argument("--frames", type=int, default=114, help="how many images to take along the loop")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()), help="where the pictures go")
    arguments = parser.parse_args()

    walk = pm.scenes.office_loop().frames(noise=1)
    chosen = np.linspace(0, len(walk) - 1, arguments.frames).round().astype(int)
    frames = [walk[i] for i in chosen.tolist()]
    truth = np.array([frame.world_from_camera for frame in frames])
    drifted = odometry(truth)
    # The last image shows the place of the first, whose pose is known.
    corrected = close_loop(drifted, truth[-1])

    grid = mapped(frames, drifted)
    ideal = mapped(frames, truth)
    report("odometry", grid, ideal, drifted, truth)
    draw(grid, arguments.folder / "loop_before.png")

    for frame, old_pose, new_pose in zip(frames, drifted, corrected, strict=True):
        grid.reintegrate(frame.depth, frame.camera, old_pose, new_pose)
    report("corrected", grid, ideal, corrected, truth)
    draw(grid, arguments.folder / "loop_after.png")

    same = saved(grid) == saved(mapped(frames, corrected))
    print(f"the map made with the corrected poses is {'the same to the last byte' if same else 'another'}")
    if not same:
        raise SystemExit(1)


def odometry(truth: Poses) -> Poses:
    """The walk as its steps add up, each measured with a random error and turned a little too far."""
    rng = np.random.default_rng(1)
    count = len(truth) - 1
    turns = TURN_DRIFT / count + TURN_NOISE / np.sqrt(count) * rng.standard_normal(count)
    shifts = STEP_NOISE / np.sqrt(count) * rng.standard_normal((count, 3))
    poses = [truth[0]]
    for before, after, turn, shift in zip(truth[:-1], truth[1:], turns, shifts, strict=True):
        step = np.linalg.inv(before) @ after
        step[:3, 3] += shift
        step[:3, :3] @= rotation(np.array([0.0, turn, 0.0]))  # the camera's y points down
        poses.append(poses[-1] @ step)
    return np.array(poses)


def close_loop(poses: Poses, last: NDArray[np.float64]) -> Poses:
    """Bend a walk so that it ends in a known pose, as surveyors adjust a traverse.

    First the error of the direction at the end is spread evenly over the steps, which also turns the steps; then what
    is left of the error in position.
    """
    share = np.linspace(0.0, 1.0, len(poses))[:, None]
    turns = np.array([rotation(vector) for vector in share * rotation_vector(last[:3, :3] @ poses[-1, :3, :3].T)])
    steps = np.einsum("nij,nj->ni", turns[1:], np.diff(poses[:, :3, 3], axis=0))
    positions = poses[0, :3, 3] + np.concatenate([np.zeros((1, 3)), steps.cumsum(axis=0)])
    corrected = poses.copy()
    corrected[:, :3, :3] = turns @ poses[:, :3, :3]
    corrected[:, :3, 3] = positions + share * (last[:3, 3] - positions[-1])
    return corrected


def rotation(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rotation about a vector by its length (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    cross: NDArray[np.float64] = np.cross(np.eye(3), vector / angle)
    matrix: NDArray[np.float64] = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return matrix


def rotation_vector(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """The inverse of `rotation`, for less than half a turn."""
    angle = np.arccos(np.clip((np.trace(matrix) - 1) / 2, -1, 1))
    axis = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    return axis * (0.5 if angle == 0 else angle / (2 * np.sin(angle)))


def mapped(frames: list[pm.datasets.Frame], poses: Poses) -> pm.OccupancyGrid:
    grid = pm.OccupancyGrid(VOXEL_SIZE)
    for frame, pose in zip(frames, poses, strict=True):
        grid.integrate(frame.depth, frame.camera, pose)
    return grid


def report(name: str, grid: pm.OccupancyGrid, ideal: pm.OccupancyGrid, poses: Poses, truth: Poses) -> None:
    """How far the poses are from the true ones, and how much of the office the map gets right."""
    off = np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1)
    blocks = ideal.block_coords()
    wanted = ideal.block_log_odds(blocks) > 0
    right = np.mean(grid.block_log_odds(blocks)[wanted] > 0)
    print(f"{name:9}: poses off by {off.mean():.3f} m, {right:.1%} of the occupied voxels are where they should be")


def draw(grid: pm.OccupancyGrid, path: Path) -> None:
    Image.fromarray(pictures.slice_image(pictures.cut(grid, axis=2, at=EYE_LEVEL))).save(path)
    print(f"wrote {path}")


def saved(grid: pm.OccupancyGrid) -> bytes:
    """The bytes of a map's file: equal maps give equal ones."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.pmap"
        grid.save(path)
        return path.read_bytes()


if __name__ == "__main__":
    main()
