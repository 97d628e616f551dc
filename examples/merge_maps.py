"""Two robots map parts of one building, and put their maps together.

Evidence adds up: the merged map is that of one robot which saw everything, also where both have been. Their poses
must be in one world frame, and voxel size, prior and clamp the same; the rest of the parameters may differ.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
import pyramap as pm
from PIL import Image
from pyramap import pictures


def mapped(frames: pm.scenes.SceneFrames) -> pm.OccupancyGrid:
    """The map of one robot."""
    grid = pm.OccupancyGrid(voxel_size=0.05)
    for frame in frames:
        grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
    return grid


def draw(grid: pm.OccupancyGrid, path: Path) -> None:
    Image.fromarray(pictures.slice_image(pictures.cut(grid, axis=2, at=1.2))).save(path)
    print(f"wrote {path}")


def main() -> None:
    parser = argparse.ArgumentParser(description="Merge the maps of two robots.")
    parser.add_argument("--frames", type=int, default=60, help="how many images both robots take together")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()), help="where the pictures go")
    arguments = parser.parse_args()
    count = arguments.frames

    # One begins where the other ends, and both have seen the place where they meet.
    frames = pm.scenes.office_loop().frames(noise=1)[:count]
    half = count // 2
    first, second = mapped(frames[:half]), mapped(frames[half:])
    for name, grid in (("first", first), ("second", second)):
        print(f"{name:6} robot: {grid.num_frames} frames, {grid.num_observed} voxels seen")
        draw(grid, arguments.folder / f"merge_maps_{name}.png")
    shared = np.count_nonzero(second.block_log_odds(first.block_coords()) * first.block_log_odds(first.block_coords()))
    print(f"both have seen {shared} voxels")

    first.merge(second)
    print(f"merged: {first.num_frames} frames, {first.num_observed} voxels seen")
    draw(first, arguments.folder / "merge_maps_merged.png")

    alone = mapped(frames)
    blocks = alone.block_coords()
    same = np.array_equal(blocks, first.block_coords()) and np.array_equal(
        alone.block_log_odds(blocks), first.block_log_odds(blocks)
    )
    print(f"the map of one robot that takes all images is {'the same' if same else 'another'}")
    if not same:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
