//! The colours of a map: for each voxel the sums of red, green and blue that were seen, and how often.
//!
//! 16 bits a number as long as that is enough for a block, 32 from then on: 4 KB a block, or 8 KB. A block without any
//! colour takes nothing. How a block is held is no part of what a map holds: it follows from the sums.

use super::{Paint, Rgba};
use crate::block::{BLOCK_VOXELS, BlockKey, VoxelIndex, locate};
use crate::directory;
use hashbrown::HashMap;
use hashbrown::hash_map::Entry;
use rayon::prelude::*;
use std::mem::size_of;

/// Sums of red, green and blue, and how many were added, for each voxel of a block.
pub type Sums = [[i32; 4]; BLOCK_VOXELS];
type NarrowSums = [[i16; 4]; BLOCK_VOXELS];

/// The sums, by block.
#[derive(Default)]
pub struct Colours {
    blocks: HashMap<BlockKey, Block>,
    num_narrow: usize,
    num_wide: usize,
}

#[derive(Debug, PartialEq)]
enum Block {
    Narrow(Box<NarrowSums>),
    Wide(Box<Sums>),
}

/// Blocks that are to be stored, once it is sure that everything else can be.
pub(crate) struct Prepared {
    /// `None` for blocks that have no colour any more.
    blocks: Vec<(BlockKey, Option<Block>)>,
    /// Voxels whose sums `i32` was too small for.
    pub lost: u64,
}

impl Colours {
    /// Bytes of all blocks, and of the table that finds them.
    pub fn bytes(&self) -> usize {
        directory::bytes(&self.blocks, self.blocks.len()) + Self::block_bytes(self.num_narrow, self.num_wide)
    }

    fn block_bytes(narrow: usize, wide: usize) -> usize {
        narrow * size_of::<NarrowSums>() + wide * size_of::<Sums>()
    }

    /// The keys of all blocks that hold a colour, in no order that is to be relied on.
    pub fn keys(&self) -> impl Iterator<Item = BlockKey> {
        self.blocks.keys().copied()
    }

    /// The sums of a block; nothing if it has no colour.
    pub fn sums(&self, key: BlockKey) -> Option<Sums> {
        self.blocks.get(&key).map(Block::sums)
    }

    /// The mean colour of a voxel.
    pub fn colour(&self, voxel: VoxelIndex) -> Rgba {
        let (key, offset) = locate(voxel);
        self.blocks.get(&key).map_or([0; 4], |block| mean(block.voxel(offset)))
    }

    /// Makes ready to add what a frame adds, times a sign.
    pub(crate) fn painted(&self, paint: &[(BlockKey, Box<Paint>)], sign: i32) -> Prepared {
        self.prepared(paint, |paint, sums| {
            let added = paint.iter().map(|voxel| voxel.map(|value| sign * i32::from(value)));
            add(sums, added)
        })
    }

    /// Makes ready to add another map's colours.
    pub(crate) fn merged(&self, other: &Self) -> Prepared {
        let theirs: Vec<_> = other.blocks.iter().map(|(&key, block)| (key, block)).collect();
        self.prepared(&theirs, |theirs, sums| add(sums, (0..BLOCK_VOXELS).map(|offset| theirs.voxel(offset))))
    }

    /// Makes ready to take the colours of some voxels away.
    pub(crate) fn erased<T: Sync>(&self, parts: &[(BlockKey, T)], erase: impl Fn(&T, &mut Sums) + Sync) -> Prepared {
        self.prepared(parts, |part, sums| {
            erase(part, sums);
            0
        })
    }

    /// Makes ready to store blocks, out of what each holds; `change` says how many voxels lost something.
    fn prepared<T: Sync>(&self, changes: &[(BlockKey, T)], change: impl Fn(&T, &mut Sums) -> u64 + Sync) -> Prepared {
        let changed = |(key, with): &(BlockKey, T)| {
            let mut sums = self.sums(*key).unwrap_or([[0; 4]; BLOCK_VOXELS]);
            let lost = change(with, &mut sums);
            ((*key, Block::holding(&sums)), lost)
        };
        let (blocks, lost): (Vec<_>, Vec<u64>) = changes.par_iter().with_min_len(16).map(changed).unzip();
        Prepared { blocks, lost: lost.iter().sum() }
    }

    /// Bytes that the colours would take with these blocks stored.
    pub(crate) fn bytes_with(&self, prepared: &Prepared) -> usize {
        let (mut narrow, mut wide, mut new) = (self.num_narrow, self.num_wide, 0);
        for (key, block) in &prepared.blocks {
            let before = self.blocks.get(key);
            new += usize::from(before.is_none() && block.is_some());
            // Blocks that go leave their place in the table.
            let count = |block: Option<&Block>| match block {
                None => (0, 0),
                Some(Block::Narrow(_)) => (1, 0),
                Some(Block::Wide(_)) => (0, 1),
            };
            let (from, to) = (count(before), count(block.as_ref()));
            (narrow, wide) = (narrow + to.0 - from.0, wide + to.1 - from.1);
        }
        directory::bytes(&self.blocks, self.blocks.len() + new) + Self::block_bytes(narrow, wide)
    }

    /// Whether any colour would be another with these blocks stored.
    pub(crate) fn changed_by(&self, prepared: &Prepared) -> bool {
        prepared.blocks.iter().any(|(key, block)| block.as_ref() != self.blocks.get(key))
    }

    /// Stores the blocks.
    pub(crate) fn store(&mut self, prepared: Prepared) {
        for (key, block) in prepared.blocks {
            let before = match (self.blocks.entry(key), block) {
                (Entry::Vacant(_), None) => None,
                (Entry::Occupied(place), None) => Some(place.remove()),
                (place, Some(block)) => {
                    *Self::count(&mut self.num_narrow, &mut self.num_wide, &block) += 1;
                    match place {
                        Entry::Occupied(mut place) => Some(place.insert(block)),
                        Entry::Vacant(place) => {
                            place.insert(block);
                            None
                        }
                    }
                }
            };
            if let Some(before) = before {
                *Self::count(&mut self.num_narrow, &mut self.num_wide, &before) -= 1;
            }
        }
    }

    /// Takes blocks as [`Colours::sums`] gave them.
    pub(crate) fn restore(&mut self, blocks: impl Iterator<Item = (BlockKey, Box<Sums>)>) {
        let blocks = blocks.map(|(key, sums)| (key, Block::holding(&sums))).collect();
        self.store(Prepared { blocks, lost: 0 });
    }

    fn count<'a>(narrow: &'a mut usize, wide: &'a mut usize, block: &Block) -> &'a mut usize {
        match block {
            Block::Narrow(_) => narrow,
            Block::Wide(_) => wide,
        }
    }
}

/// Adds to all voxels; says for how many `i32` was too small.
fn add(sums: &mut Sums, added: impl Iterator<Item = [i32; 4]>) -> u64 {
    let mut lost = 0;
    for (sums, added) in sums.iter_mut().zip(added) {
        let mut overflow = false;
        for (sum, added) in sums.iter_mut().zip(added) {
            overflow |= sum.checked_add(added).is_none();
            *sum = sum.saturating_add(added);
        }
        lost += u64::from(overflow);
    }
    lost
}

/// The mean colour of sums, rounded; of a voxel that more frames were taken off than added to there is none.
pub(super) fn mean([r, g, b, count]: [i32; 4]) -> Rgba {
    if count <= 0 {
        return [0; 4];
    }
    let mean = |sum: i32| ((2 * i64::from(sum) + i64::from(count)) / (2 * i64::from(count))).clamp(0, 255) as u8;
    [mean(r), mean(g), mean(b), 255]
}

impl Block {
    /// In the form that fits; nothing for no colour.
    fn holding(sums: &Sums) -> Option<Self> {
        let flat = sums.as_flattened();
        let misfits = flat.iter().fold(0, |misfits, &value| misfits | (value ^ i32::from(value as i16)));
        if misfits != 0 {
            return Some(Block::Wide(Box::new(*sums)));
        }
        let any = flat.iter().fold(0, |any, &value| any | value) != 0;
        any.then(|| Block::Narrow(Box::new(sums.map(|voxel| voxel.map(|value| value as i16)))))
    }

    fn sums(&self) -> Sums {
        match self {
            Block::Narrow(sums) => sums.map(|voxel| voxel.map(i32::from)),
            Block::Wide(sums) => **sums,
        }
    }

    fn voxel(&self, offset: usize) -> [i32; 4] {
        match self {
            Block::Narrow(sums) => sums[offset].map(i32::from),
            Block::Wide(sums) => sums[offset],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paint(colour: [u8; 3]) -> Box<Paint> {
        let mut paint = Box::new([[0; 4]; BLOCK_VOXELS]);
        paint[7] = [colour[0], colour[1], colour[2], 1];
        paint
    }

    fn add(colours: &mut Colours, key: BlockKey, colour: [u8; 3], sign: i32) {
        let prepared = colours.painted(&[(key, paint(colour))], sign);
        let bytes = colours.bytes_with(&prepared);
        colours.store(prepared);
        assert!(colours.bytes() <= bytes, "{} of {bytes} bytes", colours.bytes());
    }

    #[test]
    fn sums_come_and_go_and_bytes_follow() {
        let mut colours = Colours::default();
        let empty = colours.bytes();
        (0..200).for_each(|n| add(&mut colours, [0, 0, 0], [255, n, 0], 1));
        // 200 * 255 takes more than 16 bits.
        assert_eq!((colours.num_narrow, colours.num_wide), (0, 1));
        assert_eq!(colours.colour([0, 0, 7]), [255, 100, 0, 255]);
        assert_eq!(colours.colour([0, 0, 6]), [0; 4]);
        (0..199).for_each(|n| add(&mut colours, [0, 0, 0], [255, n, 0], -1));
        assert_eq!((colours.num_narrow, colours.num_wide), (1, 0));
        assert_eq!(colours.colour([0, 0, 7]), [255, 199, 0, 255]);
        add(&mut colours, [0, 0, 0], [255, 199, 0], -1);
        assert_eq!(colours.keys().count(), 0);
        assert!(colours.bytes() - empty < size_of::<NarrowSums>());

        // What was never added can be taken off, and has no colour until it is added.
        add(&mut colours, [0, 0, 0], [9, 9, 9], -1);
        assert_eq!(colours.colour([0, 0, 7]), [0; 4]);
        assert_eq!(colours.keys().count(), 1);
    }

    #[test]
    fn sums_beyond_32_bits_are_counted() {
        let mut sums = [[0; 4]; BLOCK_VOXELS];
        sums[7] = [i32::MAX - 3, 0, 0, 1];
        assert_eq!(super::add(&mut sums, paint([4, 0, 0]).iter().map(|voxel| voxel.map(i32::from))), 1);
        assert_eq!(sums[7], [i32::MAX, 0, 0, 2]);
    }

    #[test]
    fn means_are_rounded() {
        assert_eq!(mean([3, 5, 510, 2]), [2, 3, 255, 255]);
        assert_eq!(mean([-5, 2, 3000, 2]), [0, 1, 255, 255]);
        assert_eq!(mean([1, 1, 1, 0]), [0; 4]);
    }
}
