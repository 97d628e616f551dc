"""The comparator notices every kind of difference between two maps, and excuses only what it may."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from compare import BLOCK_SHAPE, Blocks, assert_same_map, blocks_of_box, blocks_of_lists, compare
from numpy.typing import NDArray

TOLERANCE = 1e-3


def make_map() -> Blocks:
    rng = np.random.default_rng(1)
    blocks = {}
    for key in [(0, 0, 0), (0, 0, -1), (5, -3, 2)]:
        values = rng.uniform(0.1, 2, BLOCK_SHAPE) * rng.choice([-1, 1], BLOCK_SHAPE)
        values[rng.random(BLOCK_SHAPE) < 0.3] = 0
        values[1, 2, 3], values[4, 5, 6] = 0.5, 0  # one voxel known, one unknown, in every block
        blocks[key] = values
    return blocks


def altered(voxel: tuple[int, int, int], value: float) -> Blocks:
    actual = make_map()
    actual[5, -3, 2][voxel] = value
    return actual


def mask_of(*voxels: tuple[int, int, int]) -> dict[tuple[int, int, int], NDArray[np.bool_]]:
    mask = np.zeros(BLOCK_SHAPE, dtype=bool)
    for voxel in voxels:
        mask[voxel] = True
    return {(5, -3, 2): mask}


def test_identical_maps_pass() -> None:
    result = assert_same_map(make_map(), make_map(), tolerance=0)
    assert result.worst == 0
    assert result.within == 1
    assert result.compared == sum(int((block != 0).sum()) for block in make_map().values())


def test_a_difference_within_the_tolerance_passes_and_is_measured() -> None:
    result = assert_same_map(altered((1, 2, 3), 0.5009), make_map(), TOLERANCE)
    assert result.worst == pytest.approx(0.0009)


@pytest.mark.parametrize(
    ("actual", "message"),
    [
        (altered((1, 2, 3), 0.5011), r"only .*\n1 voxels outside .* voxel \(41, -22, 19\) .*got 0.5011, expected 0.5"),
        (altered((1, 2, 3), 0), r"1 voxels missing, worst at voxel \(41, -22, 19\)"),
        (altered((4, 5, 6), 0.001), r"1 voxels spurious, worst at voxel \(44, -19, 22\)"),
        (altered((1, 2, 3), np.nan), "1 voxels outside"),
        (altered((4, 5, 6), np.nan), "1 voxels spurious"),
    ],
)
def test_one_voxel_is_noticed(actual: Blocks, message: str) -> None:
    with pytest.raises(AssertionError, match=message):
        assert_same_map(actual, make_map(), TOLERANCE)


def without_a_block(blocks: Blocks) -> Blocks:
    return {key: block for key, block in blocks.items() if key != (0, 0, -1)}


def with_a_block(blocks: Blocks) -> Blocks:
    return blocks | {(0, 0, 1): np.full(BLOCK_SHAPE, -0.85)}


def moved_by_a_block(blocks: Blocks) -> Blocks:
    return {(x + 1, y, z): block for (x, y, z), block in blocks.items()}


def with_axes_swapped(blocks: Blocks) -> Blocks:
    return {key: block.transpose(2, 1, 0) for key, block in blocks.items()}


def with_signs_turned(blocks: Blocks) -> Blocks:
    return {key: -block for key, block in blocks.items()}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without_a_block, "voxels missing"),
        (with_a_block, "512 voxels spurious"),
        (moved_by_a_block, "voxels missing"),
        (with_axes_swapped, "voxels missing"),
        (with_signs_turned, "only 0.0000% of voxels"),
    ],
)
def test_a_changed_map_is_noticed(change: Callable[[Blocks], Blocks], message: str) -> None:
    with pytest.raises(AssertionError, match=message):
        assert_same_map(change(make_map()), make_map(), TOLERANCE)


def test_empty_maps_are_no_comparison() -> None:
    with pytest.raises(AssertionError, match="nothing was compared"):
        assert_same_map({}, {}, TOLERANCE)
    with pytest.raises(AssertionError, match="voxels missing"):
        assert_same_map({}, make_map(), TOLERANCE)
    with pytest.raises(AssertionError, match="voxels spurious"):
        assert_same_map(make_map(), {}, TOLERANCE)


def test_a_block_of_zeros_is_an_absent_block() -> None:
    assert_same_map(make_map() | {(9, 9, 9): np.zeros(BLOCK_SHAPE)}, make_map(), tolerance=0)


def test_the_mask_excuses_its_voxels_alone() -> None:
    for actual in (altered((1, 2, 3), 0), altered((4, 5, 6), 1), altered((1, 2, 3), -3)):
        result = assert_same_map(actual, make_map(), TOLERANCE, mask_of((1, 2, 3), (4, 5, 6)))
        assert result.excused == 1
        assert result.worst == 0
        with pytest.raises(AssertionError, match="1 voxels"):
            assert_same_map(actual, make_map(), TOLERANCE, mask_of((0, 0, 0)))


def test_excuses_are_limited() -> None:
    everything = {key: np.ones(BLOCK_SHAPE, dtype=bool) for key in make_map()}
    with pytest.raises(AssertionError, match="too many voxels are excused"):
        assert_same_map(with_signs_turned(make_map()), make_map(), TOLERANCE, everything)
    two_of_all = 2.5 / compare(make_map(), make_map(), TOLERANCE).compared
    actual = altered((1, 2, 3), 0)
    actual[0, 0, 0][1, 2, 3] = 0
    assert_same_map(actual, make_map(), TOLERANCE, everything, max_excused=two_of_all)
    actual[0, 0, -1][1, 2, 3] = 0
    with pytest.raises(AssertionError, match="too many voxels are excused"):
        assert_same_map(actual, make_map(), TOLERANCE, everything, max_excused=two_of_all)


def test_a_share_of_voxels_may_differ_but_none_may_be_missing() -> None:
    compared = compare(make_map(), make_map(), TOLERANCE).compared
    assert_same_map(altered((1, 2, 3), -1), make_map(), TOLERANCE, within=1 - 1.5 / compared)
    with pytest.raises(AssertionError, match="only"):
        assert_same_map(altered((1, 2, 3), -1), make_map(), TOLERANCE, within=1 - 0.5 / compared)
    with pytest.raises(AssertionError, match="know different voxels"):
        assert_same_map(altered((1, 2, 3), 0), make_map(), TOLERANCE, within=0.5)


def test_a_box_and_lists_give_the_same_blocks() -> None:
    box = np.arange(16 * 8 * 24, dtype=np.float64).reshape(16, 8, 24)
    box[:8, :, 8:16] = 0
    blocks = blocks_of_box(box, np.array([-8, 16, 0]))
    assert sorted(blocks) == [(-1, 2, 0), (-1, 2, 2), (0, 2, 0), (0, 2, 1), (0, 2, 2)]
    assert blocks[0, 2, 1][3, 4, 5] == box[8 + 3, 4, 8 + 5]
    coords = np.array(sorted(blocks), dtype=np.int32)
    values = np.array([blocks[key] for key in sorted(blocks)], dtype=np.float32)
    assert_same_map(blocks_of_lists(coords, values), {key: block.astype(float) for key, block in blocks.items()}, 0)
    with pytest.raises(AssertionError, match="listed twice"):
        blocks_of_lists(np.repeat(coords, 2, axis=0), np.repeat(values, 2, axis=0))
    with pytest.raises(AssertionError, match="whole blocks"):
        blocks_of_box(box, np.array([-7, 16, 0]))
