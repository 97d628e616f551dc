"""The simulated scenes through Python: shapes, types, frames, noise, and errors. The geometry is tested in Rust."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyramap as pm
import pytest
from numpy.typing import NDArray
from pyramap.scenes import Scene

SCENES = [pm.scenes.box, pm.scenes.spheres, pm.scenes.office_loop]
NUM_POSES = {"box": 181, "spheres": 181, "office_loop": 684}


def back_project(
    depth: NDArray[np.float32], camera: pm.PinholeCamera, world_from_camera: NDArray[np.float64]
) -> NDArray[np.float64]:
    """World points of all pixels, (H * W, 3)."""
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1)
    points = (rays * depth[..., None].astype(np.float64)).reshape(-1, 3)
    return points @ world_from_camera[:3, :3].T + world_from_camera[:3, 3]


@pytest.mark.parametrize("make", SCENES)
def test_a_view_shows_points_on_the_surface(make: Callable[[], Scene]) -> None:
    scene = make()
    poses = scene.poses()
    assert poses.shape == (NUM_POSES[scene.name], 4, 4)
    assert poses.dtype == np.float64
    assert (poses[:, 3] == [0, 0, 0, 1]).all()
    for pose in poses[:: len(poses) // 4]:
        depth = scene.render(scene.camera, pose)
        assert depth.shape == (scene.camera.height, scene.camera.width)
        assert depth.dtype == np.float32
        assert (depth > 0).all()
        distance = scene.signed_distance(back_project(depth, scene.camera, pose)[::7])
        assert distance.dtype == np.float64
        # float32 rounds a depth of up to 23 m by up to 1e-6 m, on rays up to 1.3 times as long.
        assert np.abs(distance).max() < 2e-6


def test_views_of_another_camera_and_pose() -> None:
    scene = pm.scenes.spheres()
    camera = pm.PinholeCamera(width=31, height=17, fx=20, fy=22, cx=14, cy=9)
    pose = np.eye(4)
    pose[:3, 3] = [0.1, -0.3, 0.05]
    depth = scene.render(camera, pose)
    assert depth.shape == (17, 31)
    assert np.abs(scene.signed_distance(back_project(depth, camera, pose))).max() < 1e-6
    # The far wall is at z = 1.089 everywhere; the optical axis meets it above the objects.
    assert depth[9, 14] == pytest.approx(1.089 - 0.05, abs=1e-6)


def test_signed_distance_tells_free_from_solid() -> None:
    scene = pm.scenes.box()
    far_wall = 11.2 - 5.827
    points = [[0, 0, far_wall - 0.25], [0, 0, far_wall + 0.05], [0, 0, np.nan]]
    distance = scene.signed_distance(np.array(points))
    assert distance[:2] == pytest.approx([0.25, -0.05])
    assert np.isnan(distance[2])
    assert scene.signed_distance(np.empty((0, 3))).shape == (0,)


def test_frames_are_the_views_in_order() -> None:
    scene = pm.scenes.spheres()
    frames = scene.frames()
    assert len(frames) == 181
    for index, frame in zip([0, 1, 2], frames, strict=False):
        assert frame.index == index
        assert frame.camera == scene.camera
        assert np.array_equal(frame.world_from_camera, scene.poses()[index])
        assert np.array_equal(frame.depth, scene.render(scene.camera, scene.poses()[index]))
        assert frame.timestamp == pytest.approx(index / 30)
        assert frame.colour_path is None
    assert [frame.index for frame in frames[5:30:10]] == [5, 15, 25]
    assert frames[-1].index == 180
    assert [frame.index for frame in frames[10:20][::5]] == [10, 15]
    with pytest.raises(IndexError):
        frames[181]


def test_noise_is_that_of_a_kinect_and_follows_from_the_seed() -> None:
    scene = pm.scenes.office_loop()
    exact = scene.frames()[300].depth
    frame = scene.frames(noise=7)[300]
    noisy = frame.depth
    assert np.array_equal(noisy, scene.render(scene.camera, frame.world_from_camera, noise=307))
    assert not np.array_equal(noisy, scene.frames(noise=8)[300].depth)
    read = noisy > 0
    assert 0.5 < read.mean() < 0.999
    assert noisy[read].min() >= np.float32(0.8)
    assert noisy[read].max() <= 5
    # Noise and half a step of disparity: 0.0012 + 0.0019 (z - 0.4)^2 and z^2 / (16 * 585 * 0.075). The noise ends at
    # 3.5 standard deviations; both together move 1 / z, hence the margin.
    z = exact[read].astype(np.float64)
    bound = 3.5 * (0.0012 + 0.0019 * (z - 0.4) ** 2) + z**2 / (16 * 585 * 0.075)
    error = np.abs(noisy[read] - z)
    assert (error < 1.1 * bound).all()
    assert error.mean() > 0.002


def test_the_threads_do_not_change_an_image() -> None:
    scene = pm.scenes.office_loop()
    pose = scene.poses()[100]
    threads = pm.num_threads()
    try:
        images = []
        for n in (1, 2, 3):
            pm.set_num_threads(n)
            images.append(scene.render(scene.camera, pose, noise=1))
    finally:
        pm.set_num_threads(threads)
    assert np.array_equal(images[0], images[1])
    assert np.array_equal(images[0], images[2])


def test_errors_name_what_was_wrong() -> None:
    scene = pm.scenes.box()
    with pytest.raises(ValueError, match=r'scene is "boxes", expected "box", "spheres" or "office_loop"'):
        Scene("boxes")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"points have shape \[3\], expected \(N, 3\)"):
        scene.signed_distance(np.zeros(3))
    with pytest.raises(ValueError, match=r"world_from_camera has shape \[3, 3\]"):
        scene.render(scene.camera, np.eye(3))
    mirror = np.diag([1.0, 1.0, -1.0, 1.0])
    with pytest.raises(ValueError, match="mirror"):
        scene.render(scene.camera, mirror)
