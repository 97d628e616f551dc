"""`pyramap map` on data sets that need more to be said, or that are files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_files import BASE, OPTICAL, WORLD, image, info, transform, write_bag
from dataset_files import HEIGHT, WIDTH
from export_files import write_kitti, write_nerfstudio
from shell import json_of, run

NEAR, FAR = (np.full((HEIGHT, WIDTH), depth, np.uint16) for depth in (500, 1500))
INTRINSICS = "7,7.5,3.5,2.5"


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Two cameras that move as one, of which one sees a wall three times as far as the other; not rectified."""
    messages = [info("/near/camera_info", (0.1,)), info("/far/camera_info", (0.1,))]
    for n in range(2):
        messages.append(transform(n / 10, WORLD, BASE, (0.1 * n, (5, 0, 0))))
        messages.append(transform(n / 10, BASE, OPTICAL, (0.1 * n, (1, 0, 0))))
        messages += [image(n / 10, NEAR, "16UC1", "/near/image"), image(n / 10, FAR, "16UC1", "/far/image")]
    return write_bag(tmp_path / "two", "ros1", messages)


def mapped(*arguments: object) -> Any:
    return json_of(run("map", *arguments, "-r", "0.1", "--json"))["map"]


def test_topics_and_the_world_of_a_bag(bag: Path) -> None:
    camera = ("--camera", f"{INTRINSICS},{WIDTH},{HEIGHT}")
    near, far = (mapped(bag, "--topic", f"depth=/{name}/image", *camera) for name in ("near", "far"))
    assert near["voxels_free"] < far["voxels_free"]
    based = mapped(bag, "--topic", "depth=/near/image", *camera, "--world-frame", BASE)
    assert based["bounds"] != near["bounds"]


def test_what_is_wrong_with_the_topics_is_said(bag: Path) -> None:
    error = run("map", bag, "-r", "0.1", code=1).stderr
    assert "several topics of depth images: /far/image, /near/image" in " ".join(error.split())
    error = run("map", bag, "-r", "0.1", "--topic", "depth", code=2).stderr
    assert "'depth' is not one of depth=NAME, camera_info=NAME, pose=NAME" in " ".join(error.replace("│", "").split())
    # Without a size the camera must be like the bag's own, which cannot be used.
    error = run("map", bag, "-r", "0.1", "--topic", "depth=/far/image", "--camera", INTRINSICS, code=1).stderr
    assert "the lens distorts" in " ".join(error.split())


def test_a_file_is_mapped_as_a_folder_is(tmp_path: Path) -> None:
    folder = write_nerfstudio(tmp_path)
    assert mapped(folder / "transforms.json") == mapped(folder)


def test_point_clouds_are_refused(tmp_path: Path) -> None:
    error = run("map", write_kitti(tmp_path), "-r", "0.1", code=1).stderr
    assert "KITTI odometry: these are point clouds" in " ".join(error.split())


def test_max_gap_decides_which_frames_have_a_pose(tmp_path: Path) -> None:
    moves = [transform(t, WORLD, OPTICAL, (t, (t, 0, 0))) for t in (0, 0.1)]
    images = [image(t, NEAR, "16UC1") for t in (0.01, 0.15)]
    bag = write_bag(tmp_path / "a", "mcap", [info(), *moves, *images])
    for gap, frames in (("0.02", 1), ("0.06", 2)):
        assert mapped(bag, "--max-gap", gap)["frames"] == frames
