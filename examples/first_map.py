"""A first map: depth images and poses in; free, occupied and unknown space and a mesh out.

The images are simulated: the first steps through an office, with a Kinect's noise. Frames from a folder come in the
same way: `pyramap.datasets.open(path)`.
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
    parser = argparse.ArgumentParser(description="Map a part of a simulated office.")
    parser.add_argument("--frames", type=int, default=60, help="how many images to fuse")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()), help="where the files go")
    arguments = parser.parse_args()

    grid = pm.OccupancyGrid(voxel_size=0.05)
    frames = pm.scenes.office_loop().frames(noise=1)[: arguments.frames]
    for frame in frames:
        grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
    print(f"{grid.num_frames} frames, {grid.num_observed} voxels seen, {grid.nbytes / 1e6:.1f} MB")

    # What lies along the ray of one pixel of the first image: free space, a surface, and then what nobody has seen.
    first, u, v = frames[0], 320, 400
    camera, pose, depth = first.camera, first.world_from_camera, first.depth[v, u]
    ray = pose[:3, :3] @ [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0]
    depths = np.array([0.5, 0.75, 1.0, 1.25]) * depth
    points = pose[:3, 3] + depths[:, None] * ray
    names = {-1: "unknown", 0: "free", 1: "occupied"}
    print(f"pixel ({u}, {v}) of the first image reads {depth:.2f} m")
    for z, state, probability in zip(depths, grid.state(points), grid.probability(points), strict=True):
        print(f"  at {z:.2f} m: {names[int(state)]}, occupied with a probability of {probability:.3f}")

    # Voxels of which hardly anything is known would only make the mesh ragged.
    mesh = grid.mesh(min_evidence=0.1)
    grid.save(arguments.folder / "first_map.pmap")
    mesh.to_trimesh().export(arguments.folder / "first_map.ply")
    print(f"{len(mesh.faces)} triangles in {arguments.folder / 'first_map.ply'}")
    eye_level = pictures.cut(grid, axis=2, at=float(pose[2, 3]))
    Image.fromarray(pictures.slice_image(eye_level)).save(arguments.folder / "first_map.png")
    print(f"a slice at the height of the camera in {arguments.folder / 'first_map.png'}")


if __name__ == "__main__":
    main()
