//! On which side of the surface the voxels of a block lie.
//!
//! Voxels are taken as bits, a slab of constant `x` at a time, so that one operation treats many.

use crate::block::{BLOCK_EDGE, Block};

/// The surface sought, in fixed-point evidence.
pub(super) struct Surface {
    /// Evidence on the surface, within the range of `i32`.
    pub level: f64,
    /// The least evidence, up or down, that counts as known; at least 1.
    pub min_evidence: u32,
    /// Edge of a voxel, metres.
    pub voxel_size: f64,
}

impl Surface {
    #[inline]
    pub fn is_known(&self, evidence: i32) -> bool {
        evidence.unsigned_abs() >= self.min_evidence
    }

    /// Whether evidence lies above the level; no integer lies between the level and its floor.
    #[inline]
    pub fn is_inside(&self, evidence: i32) -> bool {
        evidence > self.level.floor() as i32
    }
}

/// One bit for each voxel of a slab of a block: bit `8 y + z`.
pub(super) type BlockSlab = u64;

/// Which voxels of a block are known, and which of those lie inside and outside the surface.
#[derive(Clone, Copy)]
pub(super) struct Sides {
    pub inside: [BlockSlab; BLOCK_EDGE],
    pub outside: [BlockSlab; BLOCK_EDGE],
    /// See [`Self::may_cross`].
    inside_parts: u8,
    outside_parts: u8,
}

impl Sides {
    pub const UNKNOWN: Self =
        Self { inside: [0; BLOCK_EDGE], outside: [0; BLOCK_EDGE], inside_parts: 0, outside_parts: 0 };
    const INSIDE: Self = Self { inside: [BlockSlab::MAX; BLOCK_EDGE], inside_parts: u8::MAX, ..Self::UNKNOWN };
    const OUTSIDE: Self = Self { outside: [BlockSlab::MAX; BLOCK_EDGE], outside_parts: u8::MAX, ..Self::UNKNOWN };

    pub fn of(block: &Block, surface: &Surface) -> Self {
        match *block {
            Block::Uniform(evidence) if !surface.is_known(evidence) => Self::UNKNOWN,
            Block::Uniform(evidence) if surface.is_inside(evidence) => Self::INSIDE,
            Block::Uniform(_) => Self::OUTSIDE,
            block => {
                let values = block.to_data();
                let mut sides = Self::UNKNOWN;
                for (x, slab) in values.as_chunks().0.iter().enumerate() {
                    let known = bits(slab, |evidence| surface.is_known(evidence));
                    let inside = bits(slab, |evidence| surface.is_inside(evidence));
                    (sides.inside[x], sides.outside[x]) = (known & inside, known & !inside);
                }
                Self { inside_parts: parts(&sides.inside), outside_parts: parts(&sides.outside), ..sides }
            }
        }
    }

    pub fn any_known(&self) -> bool {
        self.inside_parts | self.outside_parts != 0
    }

    /// Whether cells of a block may cross the surface, from the blocks that they reach: those at the offsets
    /// `(dx, dy, dz)` of 0 or 1, numbered `4 dx + 2 dy + dz`.
    pub fn may_cross(behind: &[&Self; 8]) -> bool {
        let any = |parts: fn(&Self) -> u8| behind.iter().enumerate().any(|(d, sides)| parts(sides) >> d & 1 == 1);
        any(|sides| sides.inside_parts) && any(|sides| sides.outside_parts)
    }
}

/// Voxels in a slab.
pub(super) const SLAB: usize = BLOCK_EDGE * BLOCK_EDGE;

/// The voxels of a slab that pass a test.
fn bits(slab: &[i32; SLAB], test: impl Fn(i32) -> bool) -> BlockSlab {
    let flags: [u8; SLAB] = std::array::from_fn(|i| u8::from(test(slab[i])));
    let mut rows = [0; BLOCK_EDGE];
    for (row, flags) in rows.iter_mut().zip(flags.as_chunks().0) {
        // The product moves flag z from bit 8z to bit 56 + z, and no two other terms to the same bit.
        *row = (u64::from_le_bytes(*flags).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8;
    }
    BlockSlab::from_le_bytes(rows)
}

/// Bit `4 dx + 2 dy + dz` says that a voxel is set where the block at `-(dx, dy, dz)` has cells that reach it: those
/// with `x = 0` if `dx = 1`, and so on.
fn parts(slabs: &[BlockSlab; BLOCK_EDGE]) -> u8 {
    let all = slabs.iter().fold(0, |all, slab| all | slab);
    let reached = |d: usize| {
        let slab = if d & 4 != 0 { slabs[0] } else { all };
        let row = if d & 2 != 0 { 0xFF } else { BlockSlab::MAX };
        let column = if d & 1 != 0 { 0x0101_0101_0101_0101 } else { BlockSlab::MAX };
        slab & row & column
    };
    (0..8).fold(0, |parts, d| parts | u8::from(reached(d) != 0) << d)
}
