"""Compares two maps in both directions. A voxel whose log-odds are zero is unknown; blocks that are absent are zero."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Scalar = TypeVar("Scalar", bound=np.generic)
Block = tuple[int, int, int]
Blocks = dict[Block, NDArray[np.float64]]
Masks = Mapping[Block, NDArray[np.bool_]]

BLOCK_SHAPE = (8, 8, 8)


def blocks_of_lists(coords: NDArray[np.int32], values: NDArray[np.float32]) -> Blocks:
    """What `block_coords` (B, 3) and `block_log_odds` (B, 8, 8, 8) give, as one block for each coordinate."""
    assert coords.shape == (len(values), 3), f"{coords.shape} coordinates for {values.shape} values"
    assert values.shape[1:] == BLOCK_SHAPE, f"blocks of shape {values.shape[1:]}"
    blocks = {(int(x), int(y), int(z)): np.asarray(v, np.float64) for (x, y, z), v in zip(coords, values, strict=True)}
    assert len(blocks) == len(coords), "a block is listed twice"
    return blocks


def blocks_of_box(values: NDArray[Scalar], first_voxel: NDArray[np.int64]) -> dict[Block, NDArray[Scalar]]:
    """Cuts a dense box of voxels, aligned to whole blocks, into its blocks that are not zero throughout."""
    assert not np.any(np.append(first_voxel, values.shape) % 8), "the box is not of whole blocks"
    blocks = {}
    for offset in np.ndindex(*(n // 8 for n in values.shape)):
        x, y, z = (8 * o for o in offset)
        block = values[x : x + 8, y : y + 8, z : z + 8]
        if block.any():
            i, j, k = (int(o + f // 8) for o, f in zip(offset, first_voxel, strict=True))
            blocks[i, j, k] = block
    return blocks


@dataclass(frozen=True)
class Comparison:
    """Voxel counts of a comparison. Those of `excused` fail, but lie in the mask and are in no other count."""

    compared: int
    missing: int
    spurious: int
    outside: int
    excused: int
    worst: float
    report: str

    @property
    def within(self) -> float:
        """Share of the compared voxels, 0 to 1, that both maps know and give the same value within the tolerance."""
        return 1.0 - (self.missing + self.spurious + self.outside) / max(self.compared, 1)


def compare(actual: Blocks, expected: Blocks, tolerance: float, ambiguous: Masks | None = None) -> Comparison:
    """Compares all voxels that either map knows, log-odds against log-odds, both ways."""
    keys = sorted(set(actual) | set(expected))
    nothing = np.zeros(BLOCK_SHAPE)
    a = np.array([actual.get(key, nothing) for key in keys]).reshape(-1, 8, 8, 8)
    e = np.array([expected.get(key, nothing) for key in keys]).reshape(-1, 8, 8, 8)
    excusable = np.array([(ambiguous or {}).get(key, nothing) for key in keys], dtype=bool).reshape(a.shape)

    difference = np.where(np.isfinite(a), np.abs(a - e), np.inf)
    missing, spurious = (e != 0) & (a == 0), (e == 0) & (a != 0)
    outside = (e != 0) & (a != 0) & (difference > tolerance)
    fails = missing | spurious | outside

    lines = []
    for name, kind in (("missing", missing), ("spurious", spurious), ("outside the tolerance", outside)):
        bad = kind & ~excusable
        if bad.any():
            block, *inner = np.unravel_index(np.argmax(np.where(bad, difference, -1)), a.shape)
            at = (block, *inner)
            voxel = tuple(int(8 * k + i) for k, i in zip(keys[block], inner, strict=True))
            lines.append(
                f"{bad.sum()} voxels {name}, worst at voxel {voxel} (block {keys[block]}): "
                f"got {a[at]:.6g}, expected {e[at]:.6g}"
            )
    compared = int(((a != 0) | (e != 0)).sum())
    excused = int((fails & excusable).sum())
    lines.append(f"{compared} voxels compared, {excused} failures excused as ambiguous")
    return Comparison(
        compared=compared,
        missing=int((missing & ~excusable).sum()),
        spurious=int((spurious & ~excusable).sum()),
        outside=int((outside & ~excusable).sum()),
        excused=excused,
        worst=float(np.max(difference[~excusable], initial=0.0)),
        report="\n".join(lines),
    )


# Most voxels that rounding decides lie where the evidence behind a surface fades to half a unit, and is stored as zero
# or one: 4.4 sigma behind it. There a tenth of a unit, which a tabulated sensor model may be off, is 0.05 sigma of way,
# of the 10 sigma or more of free space that a ray crosses. A few more are on the border of the image or of max_range, a
# share of rounding error over pixel size, 1e-5 to 1e-4. Where more than this fails it is not rounding.
MAX_EXCUSED = 5e-3


def assert_same_map(
    actual: Blocks,
    expected: Blocks,
    tolerance: float,
    ambiguous: Masks | None = None,
    within: float = 1.0,
    max_excused: float = MAX_EXCUSED,
) -> Comparison:
    """Fails unless no voxel is missing, none is spurious, and the share `within` of all voxels agrees within the
    tolerance. Voxels of the mask may fail, but at most the share `max_excused` of all."""
    result = compare(actual, expected, tolerance, ambiguous)
    assert result.compared > 0, "both maps are empty: nothing was compared"
    assert result.missing + result.spurious == 0, f"the maps know different voxels\n{result.report}"
    assert result.within >= within, f"only {result.within:.4%} of voxels agree within {tolerance}\n{result.report}"
    assert result.excused <= max_excused * result.compared, f"too many voxels are excused\n{result.report}"
    return result
