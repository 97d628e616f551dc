"""Readers of data sets: what each format gives, on small ones written here and on real ones where they lie."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dataset_files import (
    CAMERA,
    intrinsics,
    metres,
    pose,
    rodrigues,
    stored_image,
    truth_line,
    write_png,
    write_redwood,
    write_seven_scenes,
    write_tum,
)
from PIL import Image
from pyramap import datasets
from pyramap.datasets import Dataset, DatasetError
from real_data import real

# --- 7-Scenes ---------------------------------------------------------------------------------------------------------


def test_seven_scenes_gives_every_frame_with_its_depth_pose_and_colour(tmp_path: Path) -> None:
    folder = write_seven_scenes(tmp_path / "kitchen", range(3, 12, 4))
    for name in ("frame-000003.color.jpg", "frame-000007.color.png", "frame-000099.color.png"):
        (folder / name).touch()
    dataset = datasets.open(folder)
    assert (dataset.format, dataset.name, len(dataset)) == ("7-Scenes", "kitchen", 3)
    assert intrinsics(dataset.camera) == intrinsics(CAMERA)
    frames = list(dataset)
    assert [f.index for f in frames] == [3, 7, 11]
    for f in frames:
        assert f.depth.tolist() == metres(stored_image(f.index), 1000, no_reading=(0, 65535))
        assert f.depth.dtype == np.float32
        assert f.depth.flags.c_contiguous
        assert f.world_from_camera.dtype == np.float64
        assert np.array_equal(f.world_from_camera, pose(f.index))
        assert f.timestamp is None
        assert intrinsics(f.camera) == intrinsics(CAMERA)
    assert [f.colour_path and f.colour_path.name for f in frames] == [
        "frame-000003.color.jpg",
        "frame-000007.color.png",
        None,
    ]
    assert not dataset.skipped


def test_seven_scenes_camera_of_the_file_above_of_the_caller_or_the_published_one(tmp_path: Path) -> None:
    folder = write_seven_scenes(tmp_path / "seq-01")
    shared = (folder / "camera-intrinsics.txt").rename(tmp_path / "camera-intrinsics.txt")
    assert intrinsics(datasets.open(folder).camera) == intrinsics(CAMERA)
    shared.unlink()
    assert intrinsics(datasets.open(folder).camera) == (640, 480, 585, 585, 320, 240)
    assert len(list(datasets.open(folder, camera=CAMERA))) == 5


def test_a_scene_of_several_sequences_says_which_to_open(tmp_path: Path) -> None:
    for name in ("seq-02", "seq-01"):
        write_seven_scenes(tmp_path / name, range(1))
    with pytest.raises(DatasetError, match=r"several sequences \(seq-01, seq-02\): open one of them"):
        datasets.open(tmp_path)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("7 0 3\n0 7 2\n", "expected a 3x3 matrix, got 2 rows"),
        ("7 1 3\n0 7 2\n0 0 1\n", "expected a matrix fx 0 cx"),
        ("7 0 3\n0 nan 2\n0 0 1\n", "line 2: expected a finite number, got 'nan'"),
        ("-7 0 3\n0 7 2\n0 0 1\n", "-7"),
    ],
)
def test_bad_intrinsics_are_an_error_that_names_the_file(tmp_path: Path, text: str, problem: str) -> None:
    (write_seven_scenes(tmp_path) / "camera-intrinsics.txt").write_text(text)
    with pytest.raises(DatasetError, match=problem) as caught:
        datasets.open(tmp_path, skip_bad=True)
    assert caught.value.path.name == "camera-intrinsics.txt"


# --- TUM RGB-D --------------------------------------------------------------------------------------------------------


def test_tum_interpolates_between_the_neighbouring_poses(tmp_path: Path) -> None:
    # At 10.0025, a quarter of the way; the second quaternion is written with the other sign, which changes nothing.
    truth = [truth_line(10.01, 0.9, (4, 8, -4), sign=-1), truth_line(10.0, 0.1), truth_line(10.02, 2.0)]
    dataset = datasets.open(write_tum(tmp_path, [10.0025, 10.01], truth), camera=CAMERA)
    first, second = dataset
    assert dataset.format == "TUM RGB-D"
    assert first.depth.tolist() == metres(stored_image(0), 5000)
    assert first.timestamp == 10.0025
    # Twelve decimals are written, and times near 10 are exact to 2e-15: 1e-9 leaves room for both.
    expected = np.eye(4)
    expected[:3, :3], expected[:3, 3] = rodrigues(0.1 + 0.8 / 4), (1, 2, -1)
    np.testing.assert_allclose(first.world_from_camera, expected, atol=1e-9)
    expected[:3, :3], expected[:3, 3] = rodrigues(0.9), (4, 8, -4)
    np.testing.assert_allclose(second.world_from_camera, expected, atol=1e-9)


def test_tum_interpolates_between_equal_rotations(tmp_path: Path) -> None:
    truth = [truth_line(5.0, 0.7), truth_line(5.01, 0.7, (0, 0, 1))]
    (frame,) = datasets.open(write_tum(tmp_path, [5.0075], truth), camera=CAMERA)
    np.testing.assert_allclose(frame.world_from_camera[:3, :3], rodrigues(0.7), atol=1e-9)
    np.testing.assert_allclose(frame.world_from_camera[:3, 3], (0, 0, 0.75), atol=1e-9)


def test_tum_drops_frames_far_from_any_pose_and_bridges_no_hole(tmp_path: Path) -> None:
    truth = [truth_line(10.0, position=(1, 0, 0)), truth_line(11.0, position=(2, 0, 0))]
    folder = write_tum(tmp_path, [9.9, 10.015, 10.5, 10.99, 11.03], truth)
    dataset = datasets.open(folder, camera=CAMERA)
    assert [(f.index, f.world_from_camera[0, 3]) for f in dataset] == [(1, 1.0), (3, 2.0)]
    assert len(dataset) == 2
    assert list(dataset.skipped) == [0, 2, 4]
    assert "9.9000.png" in dataset.skipped[0]
    assert "100.0 ms away; the limit is 20 ms" in dataset.skipped[0]
    assert len(datasets.open(folder, camera=CAMERA, max_gap=0.05)) == 3
    # With a wide limit both neighbours count, and what lies between them is interpolated.
    wide = datasets.open(folder, camera=CAMERA, max_gap=2.0)
    np.testing.assert_allclose(wide.poses()[:, 0, 3], [1, 1.015, 1.5, 1.99, 2], atol=1e-9)


def test_tum_parts_count_the_dropped_frames_among_them(tmp_path: Path) -> None:
    truth = [truth_line(t) for t in (1.0, 1.1, 1.3, 1.4, 1.6)]
    dataset = datasets.open(write_tum(tmp_path, [0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7], truth), camera=CAMERA)
    assert list(dataset.skipped) == [0, 3, 6, 8]
    assert list(dataset[::2].skipped) == [0, 3, 6, 8]
    assert list(dataset[:2].skipped) == [0, 3]
    assert list(dataset[:4:2].skipped) == [0, 3, 6]
    assert list(dataset[2:].skipped) == [6, 8]
    assert list(dataset[::-1].skipped) == [0, 3, 6, 8]
    assert list(dataset[5:].skipped) == []


def test_tum_without_any_match_is_an_error(tmp_path: Path) -> None:
    folder = write_tum(tmp_path, [1.0, 2.0], [truth_line(500.0)])
    with pytest.raises(DatasetError, match=r"depth\.txt: none of its 2 images can be used: .*499000\.0 ms away"):
        datasets.open(folder)


@pytest.mark.parametrize(
    ("comment", "expected"),
    [
        ("# file: 'rgbd_dataset_freiburg1_xyz.bag'", (517.3, 516.5, 318.6, 255.3)),
        ("# file: 'rgbd_dataset_freiburg2_desk.bag'", (520.9, 521.0, 325.1, 249.7)),
        ("# file: 'rgbd_dataset_freiburg3_long_office.bag'", (535.4, 539.2, 320.1, 247.6)),
        ("# file: 'my_own.bag'", (525.0, 525.0, 319.5, 239.5)),
    ],
)
def test_tum_camera_is_known_by_the_recording(tmp_path: Path, comment: str, expected: tuple[float, ...]) -> None:
    folder = write_tum(tmp_path / "recording", [1.0], [truth_line(1.0)], comment)
    assert intrinsics(datasets.open(folder).camera) == (640, 480, *expected)
    assert intrinsics(datasets.open(folder, camera=CAMERA).camera) == intrinsics(CAMERA)


def test_tum_camera_is_known_by_the_folder(tmp_path: Path) -> None:
    folder = write_tum(tmp_path / "my_fr2_desk", [1.0], [truth_line(1.0)])
    assert datasets.open(folder).camera.fx == 520.9


def test_tum_takes_the_nearest_colour_image(tmp_path: Path) -> None:
    folder = write_tum(tmp_path, [1.0, 1.1, 1.2], [truth_line(t) for t in (1.0, 1.1, 1.2)])
    (folder / "rgb.txt").write_text("1.109 rgb/c.png\n0.99 rgb/a.png\n1.004 rgb/b.png\n")
    colours = [f.colour_path for f in datasets.open(folder, camera=CAMERA)]
    assert colours == [folder / "rgb/b.png", folder / "rgb/c.png", None]


@pytest.mark.parametrize(
    ("bad", "problem"),
    [
        ("1.1 0 0 0 0 0 0", "line 3: expected 8 numbers, got 7"),
        ("1.1 0 0 0 0 0 NaN 1", "line 3: expected a finite number, got 'NaN'"),
        ("1.1 0 0 0 0 0 0 0", "line 3: expected a unit quaternion, got one of length 0"),
    ],
)
def test_tum_bad_pose_is_an_error_or_costs_its_frames(tmp_path: Path, bad: str, problem: str) -> None:
    folder = write_tum(tmp_path, [1.0, 1.1, 1.2], [truth_line(1.0), bad, truth_line(1.2)])
    with pytest.raises(DatasetError, match=problem):
        datasets.open(folder)
    dataset = datasets.open(folder, camera=CAMERA, skip_bad=True)
    assert [f.index for f in dataset] == [0, 2]
    assert list(dataset.skipped) == [1]


def test_tum_bad_line_in_the_list_of_images(tmp_path: Path) -> None:
    folder = write_tum(tmp_path, [1.0, 1.1], [truth_line(1.0), truth_line(1.1)])
    with (folder / "depth.txt").open("a") as file:
        file.write("\n1.15\nsoon depth/x.png\n")
    with pytest.raises(DatasetError, match=r"line 4: expected a time and a file name, got '1\.15'"):
        datasets.open(folder)
    dataset = datasets.open(folder, camera=CAMERA, skip_bad=True)
    assert len(list(dataset)) == 2
    assert "line 5: expected a finite number, got 'soon'" in dataset.skipped[3]


@pytest.mark.parametrize("skip_bad", [False, True])
def test_tum_without_poses_is_an_error(tmp_path: Path, skip_bad: bool) -> None:
    folder = write_tum(tmp_path, [1.0], [])
    with pytest.raises(DatasetError, match=r"groundtruth\.txt: there is no pose in it"):
        datasets.open(folder, skip_bad=skip_bad)
    (folder / "groundtruth.txt").unlink()
    with pytest.raises(DatasetError, match=r"groundtruth\.txt: the file is missing"):
        datasets.open(folder, skip_bad=skip_bad)


# --- Redwood ----------------------------------------------------------------------------------------------------------


def test_redwood_matches_images_and_poses_by_number(tmp_path: Path) -> None:
    write_redwood(tmp_path, 12)  # unpadded names: 10.png must not come before 2.png
    for i in range(12):
        write_png(tmp_path / "rgb" / f"{i}.jpg", np.zeros((2, 2), np.uint8))
    dataset = datasets.open(tmp_path, camera=CAMERA)
    assert (dataset.format, len(dataset)) == ("Redwood", 12)
    for i, f in enumerate(dataset):
        assert f.index == i
        assert f.depth.tolist() == metres(stored_image(i), 1000)
        assert np.array_equal(f.world_from_camera, pose(i))
        assert f.colour_path == tmp_path / "rgb" / f"{i}.jpg"
        assert f.timestamp is None
    assert intrinsics(datasets.open(tmp_path).camera) == (640, 480, 525, 525, 319.5, 239.5)


def test_redwood_takes_any_log_of_that_form_and_asks_which_of_several(tmp_path: Path) -> None:
    write_redwood(tmp_path, 3, trajectory="estimated.log")
    (tmp_path / "build.log").write_text("compiling\ndone\n")
    assert len(datasets.open(tmp_path)) == 3
    write_redwood(tmp_path, 3, trajectory="other.log")
    with pytest.raises(DatasetError, match=r"several trajectories \(estimated\.log, other\.log\)"):
        datasets.open(tmp_path)
    dataset = datasets.open(tmp_path / "other.log", camera=CAMERA)
    assert dataset.name == "other.log"
    assert len(list(dataset)) == 3
    # No colour images: none are made up.
    assert all(f.colour_path is None for f in dataset)


@pytest.mark.parametrize("skip_bad", [False, True])
def test_redwood_numbers_that_differ_are_an_error_naming_both(tmp_path: Path, skip_bad: bool) -> None:
    write_redwood(tmp_path, 4)
    (tmp_path / "depth/2.png").unlink()
    with pytest.raises(DatasetError, match=r"trajectory\.log: 4 poses, but 3 depth images in .*depth"):
        datasets.open(tmp_path, skip_bad=skip_bad)


@pytest.mark.parametrize("skip_bad", [False, True])
def test_redwood_without_poses_or_images_is_an_error(tmp_path: Path, skip_bad: bool) -> None:
    (tmp_path / "trajectory.log").touch()
    with pytest.raises(DatasetError, match=r"depth: the folder of images is missing"):
        datasets.open(tmp_path, skip_bad=skip_bad)
    (tmp_path / "depth").mkdir()
    with pytest.raises(DatasetError, match=r"trajectory\.log: there is no pose in it"):
        datasets.open(tmp_path, skip_bad=skip_bad)


@pytest.mark.parametrize(
    ("cut", "problem"),
    [
        (slice(7, 8), "line 6: expected 4 lines with a matrix after this one, got 3"),
        (slice(14, 15), "line 11: expected 4 lines with a matrix after this one, got 3"),
    ],
)
def test_redwood_missing_line_spoils_one_pose(tmp_path: Path, cut: slice, problem: str) -> None:
    log = write_redwood(tmp_path, 3) / "trajectory.log"
    lines = log.read_text().splitlines(keepends=True)
    del lines[cut]
    log.write_text("".join(lines))
    bad = cut.start // 5
    read: list[int] = []
    with pytest.raises(DatasetError, match=problem):
        read.extend(f.index for f in datasets.open(tmp_path, camera=CAMERA))
    dataset = datasets.open(tmp_path, camera=CAMERA, skip_bad=True)
    assert [f.index for f in dataset] == [i for i in range(3) if i != bad]
    assert problem in dataset.skipped[bad]


# --- Opening ----------------------------------------------------------------------------------------------------------


def test_unknown_folder_lists_what_was_looked_for_and_found(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="Found nothing: it is empty"):
        datasets.open(tmp_path)
    (tmp_path / "holiday.jpg").touch()
    (tmp_path / "scans").mkdir()
    with pytest.raises(DatasetError) as caught:
        datasets.open(tmp_path)
    looked_for = ["frame-NNNNNN.depth.png", "pose.txt", "depth.txt", "groundtruth.txt", "trajectory.log", "depth/"]
    for word in [str(tmp_path), *looked_for, "Found holiday.jpg, scans/"]:
        assert word in str(caught.value)
    for i in range(20):
        (tmp_path / f"{i:02d}").touch()
    with pytest.raises(DatasetError, match="and 14 more"):
        datasets.open(tmp_path)
    with pytest.raises(DatasetError, match="Found a file, not a folder"):
        datasets.open(tmp_path / "holiday.jpg")
    with pytest.raises(DatasetError, match="there is no such folder"):
        datasets.open(tmp_path / "nowhere")


def test_errors_are_os_errors() -> None:
    assert issubclass(DatasetError, OSError)


def read_indices(dataset: Dataset) -> list[int]:
    indices = [f.index for f in dataset]
    assert len(dataset) == len(indices)
    return indices


def test_stride_limit_and_slices(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path, range(10))
    assert read_indices(datasets.open(str(tmp_path), stride=3)) == [0, 3, 6, 9]
    assert read_indices(datasets.open(tmp_path, limit=4)) == [0, 1, 2, 3]
    assert read_indices(datasets.open(tmp_path, stride=3, limit=2)) == [0, 3]
    assert read_indices(datasets.open(tmp_path, limit=0)) == []
    assert read_indices(datasets.open(tmp_path, limit=99)) == list(range(10))
    dataset = datasets.open(tmp_path)
    assert read_indices(dataset[8:1:-3]) == [8, 5, 2]
    assert read_indices(dataset[2:][::4]) == [2, 6]
    assert dataset[-1].index == 9
    with pytest.raises(IndexError):
        dataset[10]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"stride": 0}, "stride must be at least 1, got 0"),
        ({"limit": -1}, "limit must be at least 0, got -1"),
        ({"max_gap": -0.1}, r"max_gap must be at least 0 seconds, got -0\.1"),
        ({"max_gap": math.nan}, "max_gap must be at least 0 seconds, got nan"),
    ],
)
def test_bad_arguments(tmp_path: Path, arguments: dict[str, Any], message: str) -> None:
    write_seven_scenes(tmp_path)
    with pytest.raises(ValueError, match=message):
        datasets.open(tmp_path, **arguments)


# --- Real data --------------------------------------------------------------------------------------------------------


def test_real_red_kitchen() -> None:
    folder = real("redkitchen")
    dataset = datasets.open(folder)
    assert (dataset.format, len(dataset)) == ("7-Scenes", 684)
    assert intrinsics(dataset.camera) == (640, 480, 585, 585, 320, 240)
    assert dataset.poses().shape == (684, 4, 4)
    first = dataset[0]
    assert np.array_equal(first.world_from_camera, np.loadtxt(folder / "frame-000000.pose.txt"))
    part = list(dataset[::57])
    assert len(part) == 12
    assert all(f.colour_path is not None for f in part if f.index % 6 == 0)
    for f in part:
        with Image.open(folder / f"frame-{f.index:06d}.depth.png") as image:
            stored = np.asarray(image).astype(int)
        missing = (stored == 0) | (stored == 65535)
        assert np.array_equal(f.depth == 0, missing)
        # float32 rounds by at most 6e-8 of the value, which is below 66 m.
        np.testing.assert_allclose(f.depth[~missing], stored[~missing] / 1000, atol=4e-6)
        assert 0.3 < f.depth[f.depth > 0].min() < f.depth.max() < 10


def test_real_freiburg1_xyz() -> None:
    folder = real("fr1_xyz")
    dataset = datasets.open(folder)
    truth = np.loadtxt(folder / "groundtruth.txt")
    times = np.loadtxt(folder / "depth.txt", usecols=0)
    matched = [t for t in times if np.abs(truth[:, 0] - t).min() <= 0.02]
    assert (dataset.format, len(dataset), len(matched)) == ("TUM RGB-D", 133, 133)
    assert len(dataset.skipped) == len(times) - len(matched)
    assert dataset.camera.fx == 517.3
    for t, matrix in zip(matched, dataset.poses(), strict=True):
        nearest = truth[np.abs(truth[:, 0] - t).argmin()]
        # The nearest pose is 10 ms away or less (100 Hz), and the hand moves below 1 m/s: 1 cm.
        assert np.linalg.norm(matrix[:3, 3] - nearest[1:4]) < 0.01
        np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)
    frames = list(dataset[::30])
    assert [f.timestamp for f in frames] == matched[::30]
    assert all(f.depth.shape == (480, 640) and 0.3 < np.median(f.depth[f.depth > 0]) < 3 for f in frames)


def test_real_icl_living_room() -> None:
    dataset = datasets.open(real("icl_livingroom1"))
    assert (dataset.format, len(dataset)) == ("Redwood", 211)
    assert np.array_equal(dataset[0].world_from_camera, np.eye(4))
    assert dataset.poses()[210, 0, 3] == 0.94759931
    frames = list(dataset[::70])
    assert [f.index for f in frames] == [0, 70, 140, 210]
    assert all(f.depth.shape == (480, 640) and 0.3 < np.median(f.depth[f.depth > 0]) < 5 for f in frames)
