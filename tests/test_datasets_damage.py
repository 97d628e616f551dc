"""Readers of data sets: damaged frames are an error that names the file, or are skipped and counted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dataset_files import CAMERA, HEIGHT, IDENTITY, WIDTH, intrinsics, pose, rows, write_png, write_seven_scenes
from numpy.typing import NDArray
from pyramap import datasets
from pyramap.datasets import DatasetError


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-30])


def replace_image(stored: NDArray[Any]) -> Callable[[Path], None]:
    return lambda path: write_png(path, stored)


def replace_text(text: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(text)


DAMAGE: dict[str, tuple[str, Callable[[Path], object], str]] = {
    "no image": ("depth.png", Path.unlink, "the depth image is missing"),
    "no pose": ("pose.txt", Path.unlink, "the file is missing"),
    "truncated": ("depth.png", truncate, "damaged or truncated depth image"),
    "empty": ("depth.png", replace_text(""), "not a PNG image, or cut off in its header"),
    "not a PNG": ("depth.png", replace_text("P5 8 6 65535 "), "not a PNG image"),
    "8 bit": ("depth.png", replace_image(np.ones((HEIGHT, WIDTH), np.uint8)), "16-bit greyscale PNG, .* mode 'L'"),
    "colour": ("depth.png", replace_image(np.ones((HEIGHT, WIDTH, 3), np.uint8)), "mode 'RGB'"),
    "size": ("depth.png", replace_image(np.ones((WIDTH, HEIGHT), np.uint16)), "image is 6x8, but the camera 8x6"),
    "3 rows": ("pose.txt", replace_text(rows(IDENTITY[:3])), "expected a 4x4 matrix, got 3 rows"),
    "3 columns": ("pose.txt", replace_text(rows(IDENTITY[:, :3])), "line 1: expected 4 numbers, got 3"),
    "NaN": ("pose.txt", replace_text(rows(IDENTITY).replace("1.0", "nan")), "a finite number, got 'nan'"),
    "infinite": ("pose.txt", replace_text(rows(IDENTITY).replace("1.0", "1e999")), "a finite number, got '1e999'"),
    "words": ("pose.txt", replace_text("1 0 0 zero\n" * 4), "line 1: expected a finite number, got 'zero'"),
    "binary": ("pose.txt", lambda path: path.write_bytes(bytes(range(128, 256))), "expected a 4x4 matrix, got"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_frame_is_an_error_in_its_place_or_skipped(tmp_path: Path, damage: str) -> None:
    kind, spoil, problem = DAMAGE[damage]
    file = write_seven_scenes(tmp_path) / f"frame-000002.{kind}"
    spoil(file)
    read: list[int] = []
    with pytest.raises(DatasetError, match=problem) as caught:
        for frame in datasets.open(tmp_path):
            read.append(frame.index)
    assert read == [0, 1]
    assert caught.value.path == file
    assert str(file) in str(caught.value)

    dataset = datasets.open(tmp_path, skip_bad=True)
    for _ in range(2):  # reading twice counts a bad frame once
        assert [f.index for f in dataset] == [0, 1, 3, 4]
        assert list(dataset.skipped) == [2]
        assert str(file) in dataset.skipped[2]
    with pytest.raises(DatasetError, match=problem):
        dataset[2]


def test_the_size_of_the_images_is_that_of_the_first_one_that_can_be_read(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path, range(2))
    (tmp_path / "frame-000000.depth.png").unlink()
    assert intrinsics(datasets.open(tmp_path).camera) == intrinsics(CAMERA)
    (tmp_path / "frame-000001.depth.png").write_text("nothing")
    with pytest.raises(DatasetError, match="not one depth image can be read"):
        datasets.open(tmp_path, skip_bad=True)


def test_no_flipped_bit_changes_the_depth_unnoticed(tmp_path: Path) -> None:
    file = write_seven_scenes(tmp_path, range(1)) / "frame-000000.depth.png"
    good = file.read_bytes()
    dataset = datasets.open(tmp_path)
    depth = dataset[0].depth
    noticed = 0
    for at, bit in enumerate(np.random.default_rng(0).integers(8, size=len(good)).tolist()):
        data = bytearray(good)
        data[at] ^= 1 << bit
        file.write_bytes(data)
        try:
            read = dataset[0].depth
        except DatasetError:
            noticed += 1
        else:
            assert np.array_equal(read, depth), f"bit {bit} of byte {at} changes the image unnoticed"
    assert noticed > 0.9 * len(good)  # some mean nothing: those of the final, empty chunk


def test_poses_are_read_without_the_images(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path)
    dataset = datasets.open(tmp_path, skip_bad=True, camera=CAMERA)
    strict = datasets.open(tmp_path, camera=CAMERA)
    for file in tmp_path.glob("*.png"):
        file.unlink()
    assert np.array_equal(dataset.poses(), [pose(i) for i in range(5)])
    (tmp_path / "frame-000003.pose.txt").unlink()
    assert np.array_equal(dataset.poses(), [pose(i) for i in (0, 1, 2, 4)])
    assert list(dataset.skipped) == [3]
    with pytest.raises(DatasetError, match=r"frame-000003\.pose\.txt: the file is missing"):
        strict.poses()
    assert dataset[:0].poses().shape == (0, 4, 4)
