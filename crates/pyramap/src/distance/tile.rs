//! One block of a distance field, and how a pass along an axis sees it.

use crate::block::{BLOCK_EDGE, BLOCK_VOXELS, BlockKey};
use crate::mask::Mask;

/// For every place of every group of lines in a block, the least of what was and is there, if that is not the same. A pass
/// moves through places, at each of which eight lines of a group lie side by side.
pub type Touched = [u16; BLOCK_EDGE * BLOCK_EDGE];
/// Of a place: nothing changed.
pub const UNCHANGED: u16 = u16::MAX;
/// Of a block: nothing changed.
pub const UNTOUCHED: Touched = [UNCHANGED; BLOCK_EDGE * BLOCK_EDGE];

/// Distances in one block.
///
/// A voxel of the field is inside or outside, and holds the squared distance, in voxels, to the nearest voxel of the other
/// side, or one more than the largest that counts.
pub struct Tile {
    /// Which block.
    pub key: BlockKey,
    /// Which voxels are inside.
    pub inside: Mask,
    /// Squared distances along x, within the plane of x and y, and in space: the first and the last in the order of the
    /// map's blocks, the one between with `y` running fastest.
    pub squared: [[u16; BLOCK_VOXELS]; 3],
    /// Voxels that changed sides in the update that is under way.
    pub flips: Mask,
    /// Where the pass before changed something, for the next.
    pub touched: Touched,
}

impl Tile {
    /// A block that is on one side and near to nothing of the other.
    pub fn new(key: BlockKey, inside: Mask, beyond: u16) -> Self {
        Self { key, inside, squared: [[beyond; BLOCK_VOXELS]; 3], flips: Mask::NONE, touched: UNTOUCHED }
    }

    /// Whether the pass that is next has anything to do because of this block.
    pub fn is_touched(&self) -> bool {
        !self.flips.is_empty() || self.touched != UNTOUCHED
    }
}

/// Where a pass along `AXIS` puts its results. It goes through eight groups of lines; in each group it moves through eight
/// places, at each of which lie eight lanes side by side. Lanes and places change roles between the second pass and the
/// third, so that each finds the lanes of a place together where the one before has put them.
#[inline(always)]
pub const fn output<const AXIS: usize>(group: usize, place: usize, lane: usize) -> usize {
    match AXIS {
        0 => (place * BLOCK_EDGE + group) * BLOCK_EDGE + lane,
        _ => (group * BLOCK_EDGE + lane) * BLOCK_EDGE + place,
    }
}

/// Where the second and the third pass find the lanes of a place.
#[inline(always)]
pub const fn input(group: usize, place: usize) -> usize {
    (group * BLOCK_EDGE + place) * BLOCK_EDGE
}

/// The bits of the eight lanes at a place.
#[inline(always)]
pub fn bits<const AXIS: usize>(mask: &Mask, group: usize, place: usize) -> u8 {
    let mask = mask.words();
    match AXIS {
        0 => (mask[place] >> (BLOCK_EDGE * group)) as u8,
        1 => (mask[group] >> (BLOCK_EDGE * place)) as u8,
        // The lowest bit of each byte; the product gathers them in the highest byte, in their order.
        _ => (((mask[group] >> place & 0x0101_0101_0101_0101).wrapping_mul(0x0102_0408_1020_4080)) >> 56) as u8,
    }
}

/// Where [`Touched`] notes, for the pass along the next axis, the voxel at a place of this one.
#[inline(always)]
pub const fn next_place<const AXIS: usize>(group: usize, place: usize, lane: usize) -> usize {
    match AXIS {
        0 => place * BLOCK_EDGE + group,
        _ => group * BLOCK_EDGE + lane,
    }
}
