"""Correct a pose after the fact: take the frame out of the map, and fuse it again where it belongs.

A map is a sum of whole numbers, so what is taken out is gone to the last bit: the corrected map is the one that never
saw the wrong pose. A loop closure corrects many poses in the same way.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
import pyramap as pm
from PIL import Image
from pyramap import pictures


def main() -> None:
    parser = argparse.ArgumentParser(description="Remove a misplaced frame from a map.")
    parser.add_argument("--frames", type=int, default=20, help="how many images to fuse")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()), help="where the pictures go")
    arguments = parser.parse_args()
    frames = list(pm.scenes.office_loop().frames(noise=1)[: arguments.frames])

    slipped = frames[len(frames) // 2]
    wrong_pose = slipped.world_from_camera.copy()
    wrong_pose[:3, 3] += [0.3, -0.2, 0.05]  # metres

    grid = pm.OccupancyGrid(voxel_size=0.05)
    for frame in frames:
        pose = wrong_pose if frame is slipped else frame.world_from_camera
        grid.integrate(frame.depth, frame.camera, pose)

    truth = pm.OccupancyGrid(voxel_size=0.05)
    for frame in frames:
        truth.integrate(frame.depth, frame.camera, frame.world_from_camera)

    blocks = truth.block_coords()
    before = np.abs(grid.block_log_odds(blocks) - truth.block_log_odds(blocks))
    print(
        f"with the wrong pose {np.mean(before > 0):.1%} of the voxels differ, by up to {before.max():.2f} in log-odds"
    )
    draw(grid, arguments.folder / "correct_a_pose_before.png")

    grid.remove(slipped.depth, slipped.camera, wrong_pose)
    grid.integrate(slipped.depth, slipped.camera, slipped.world_from_camera)
    draw(grid, arguments.folder / "correct_a_pose_after.png")
    same = saved(grid) == saved(truth)
    print(f"after the correction the files are {'the same to the last byte' if same else 'different'}")
    if not same:
        raise SystemExit(1)


def draw(grid: pm.OccupancyGrid, path: Path) -> None:
    Image.fromarray(pictures.slice_image(pictures.cut(grid, axis=2, at=1.2))).save(path)
    print(f"wrote {path}")


def saved(grid: pm.OccupancyGrid) -> bytes:
    """The bytes of a map's file: equal maps give equal ones."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.pmap"
        grid.save(path)
        return path.read_bytes()


if __name__ == "__main__":
    main()
