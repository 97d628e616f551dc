//! A bit for each voxel of a block: whole blocks are compared, moved and counted a few words at a time.

use crate::block::{BLOCK_EDGE, BLOCK_VOXELS, Block};
use std::ops::{BitAnd, BitOr, BitXor, Not};

/// A set of voxels of one block. Bit `i % 64` of word `i / 64` is the voxel at offset `i`: a word is a layer of one `x`,
/// a byte of it a row of one `y`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Mask([u64; BLOCK_EDGE]);

/// The bits of a word whose `z` is 0.
const FIRST_Z: u64 = 0x0101_0101_0101_0101;
/// The bits of a word whose `y` is 0.
const FIRST_Y: u64 = 0xff;

impl Mask {
    pub(crate) const NONE: Self = Self([0; BLOCK_EDGE]);
    pub(crate) const ALL: Self = Self([u64::MAX; BLOCK_EDGE]);

    /// The voxels whose evidence is such.
    pub(crate) fn of(block: &Block, such: impl Fn(i32) -> bool) -> Self {
        match block {
            Block::Uniform(evidence) => {
                if such(*evidence) {
                    Self::ALL
                } else {
                    Self::NONE
                }
            }
            Block::Narrow(values) => Self::of_values(values, |&evidence| such(i32::from(evidence))),
            Block::Dense(values) => Self::of_values(values, |&evidence| such(evidence)),
        }
    }

    /// Of the voxels that touch the block's face at one end of an axis, those whose evidence is such.
    pub(crate) fn of_face(block: &Block, axis: usize, high: bool, such: impl Fn(i32) -> bool) -> Self {
        let mut mask = Self::face(axis, high);
        for offset in mask.offsets() {
            if !such(block.value(offset)) {
                mask.0[offset / 64] &= !(1 << (offset % 64));
            }
        }
        mask
    }

    fn of_values<T>(values: &[T; BLOCK_VOXELS], such: impl Fn(&T) -> bool) -> Self {
        // Two loops, of each of which the compiler makes vectors: a byte a voxel first, then a bit.
        let bytes: [u8; BLOCK_VOXELS] = std::array::from_fn(|n| u8::from(such(&values[n])));
        let rows = bytes.as_chunks().0;
        // The product gathers the lowest bits of eight bytes in its highest byte, in their order.
        let bits = |row: [u8; BLOCK_EDGE]| u64::from_le_bytes(row).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        let row = |x, y| bits(rows[BLOCK_EDGE * x + y]) << (BLOCK_EDGE * y);
        Self(std::array::from_fn(|x| (0..BLOCK_EDGE).fold(0, |word, y| word | row(x, y))))
    }

    pub(crate) fn words(&self) -> &[u64; BLOCK_EDGE] {
        &self.0
    }

    /// The voxel at an offset.
    pub(crate) fn single(offset: usize) -> Self {
        let mut words = [0; BLOCK_EDGE];
        words[offset / 64] = 1 << (offset % 64);
        Self(words)
    }

    /// The voxels that touch the block's face at the low or high end of an axis.
    pub(crate) fn face(axis: usize, high: bool) -> Self {
        let last = BLOCK_EDGE - 1;
        match axis {
            0 => {
                let mut words = [0; BLOCK_EDGE];
                words[if high { last } else { 0 }] = u64::MAX;
                Self(words)
            }
            1 => Self([if high { FIRST_Y << (BLOCK_EDGE * last) } else { FIRST_Y }; BLOCK_EDGE]),
            _ => Self([if high { FIRST_Z << last } else { FIRST_Z }; BLOCK_EDGE]),
        }
    }

    /// The voxels one step up or down an axis from these: those in the block itself, and those in the next one.
    pub(crate) fn step(self, axis: usize, up: bool) -> (Self, Self) {
        // What leaves at one end enters the next block at the other: together, a rotation.
        let mut words = self.0;
        match (axis, up) {
            (0, true) => words.rotate_right(1),
            (0, false) => words.rotate_left(1),
            (1, true) => words = words.map(|word| word.rotate_left(8)),
            (1, false) => words = words.map(|word| word.rotate_right(8)),
            (_, true) => words = words.map(|word| (word << 1 & !FIRST_Z) | (word >> 7 & FIRST_Z)),
            (_, false) => words = words.map(|word| (word >> 1 & !(FIRST_Z << 7)) | (word << 7 & FIRST_Z << 7)),
        }
        let entered = Self::face(axis, !up);
        (Self(words) & !entered, Self(words) & entered)
    }

    /// The voxels that are one of these or touch one, by a face, an edge or a corner: those in the block that lies
    /// `away` from this one, by -1, 0 or 1 on each axis.
    pub(crate) fn touching(self, away: [i32; 3]) -> Self {
        (0..3).fold(self, |mask, axis| match away[axis] {
            0 => mask | mask.step(axis, true).0 | mask.step(axis, false).0,
            step => mask.step(axis, step > 0).1,
        })
    }

    /// Adds the voxel at an offset.
    #[inline(always)]
    pub(crate) fn insert(&mut self, offset: usize) {
        self.0[offset / 64] |= 1 << (offset % 64);
    }

    pub(crate) fn is_empty(self) -> bool {
        self == Self::NONE
    }

    pub(crate) fn count(self) -> u32 {
        self.0.iter().map(|word| word.count_ones()).sum()
    }

    /// The offsets of the voxels, in rising order.
    pub(crate) fn offsets(self) -> impl Iterator<Item = usize> {
        (0..BLOCK_EDGE).flat_map(move |x| {
            let mut word = self.0[x];
            std::iter::from_fn(move || {
                let bit = (word != 0).then(|| word.trailing_zeros() as usize);
                word &= word.wrapping_sub(1);
                bit.map(|bit| 64 * x + bit)
            })
        })
    }

    pub(crate) fn contains(self, offset: usize) -> bool {
        self.0[offset / 64] >> (offset % 64) & 1 == 1
    }
}

impl BitAnd for Mask {
    type Output = Self;
    fn bitand(self, other: Self) -> Self {
        Self(std::array::from_fn(|x| self.0[x] & other.0[x]))
    }
}

impl BitOr for Mask {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(std::array::from_fn(|x| self.0[x] | other.0[x]))
    }
}

impl BitXor for Mask {
    type Output = Self;
    fn bitxor(self, other: Self) -> Self {
        Self(std::array::from_fn(|x| self.0[x] ^ other.0[x]))
    }
}

impl Not for Mask {
    type Output = Self;
    fn not(self) -> Self {
        Self(self.0.map(|word| !word))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{locate, voxel_offset};

    fn coordinates(offset: usize) -> [i32; 3] {
        [offset / 64, offset / 8 % 8, offset % 8].map(|i| i as i32)
    }

    /// Every voxel, every direction: the mask moves as the voxel's coordinates do.
    #[test]
    fn a_step_is_one_voxel() {
        for offset in 0..BLOCK_VOXELS {
            for (axis, up) in (0..3).flat_map(|axis| [(axis, false), (axis, true)]) {
                let mut voxel = coordinates(offset);
                voxel[axis] += if up { 1 } else { -1 };
                let (key, moved) = locate(voxel);
                let (inside, outside) = Mask::single(offset).step(axis, up);
                let (full, empty) = if key == [0; 3] { (inside, outside) } else { (outside, inside) };
                assert_eq!(full.offsets().collect::<Vec<_>>(), [moved]);
                assert!(empty.is_empty());
                assert_eq!(Mask::face(axis, up).contains(offset), key != [0; 3]);
            }
        }
    }

    #[test]
    fn a_voxel_touches_27() {
        let cube = |at: i32| at - 1..=at + 1;
        for offset in [voxel_offset(0, 0, 0), voxel_offset(7, 3, 0), voxel_offset(7, 7, 7), voxel_offset(2, 4, 5)] {
            let [x, y, z] = coordinates(offset);
            let mut found = 0;
            for voxel in cube(x).flat_map(|x| cube(y).flat_map(move |y| cube(z).map(move |z| [x, y, z]))) {
                let (key, near) = locate(voxel);
                assert!(Mask::single(offset).touching(key).contains(near));
                found += 1;
            }
            let all = (0..27).map(|n| [n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1]);
            assert_eq!(all.map(|away| Mask::single(offset).touching(away).count()).sum::<u32>(), found);
        }
    }

    #[test]
    fn a_mask_holds_what_was_asked_for() {
        let values: [i32; BLOCK_VOXELS] = std::array::from_fn(|n| (n * 37 % 11) as i32 - 5);
        let narrow = values.map(|value| value as i16);
        for block in [Block::Dense(&values), Block::Narrow(&narrow)] {
            let mask = Mask::of(&block, |value| value == 0);
            assert!((0..BLOCK_VOXELS).all(|n| mask.contains(n) == (values[n] == 0)));
            assert!(mask.offsets().eq((0..BLOCK_VOXELS).filter(|&n| values[n] == 0)));
        }
        assert_eq!(Mask::of(&Block::Uniform(3), |value| value == 3), Mask::ALL);
        assert!(Mask::of(&Block::Uniform(3), |value| value == 0).is_empty());
    }
}
