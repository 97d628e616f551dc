//! The colours of a map in its file.

use super::{Damage, damage, pack, unpack};
use crate::block::{BLOCK_VOXELS, BlockKey, MAX_BLOCK};
use crate::colour::{Colours, Sums};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Blocks in a section.
pub const IN_SECTION: usize = 1024;
/// Numbers in a block.
const NUMBERS: usize = 4 * BLOCK_VOXELS;
/// A record's key takes at most 15 bytes, its numbers 5 each, their count a few.
const MAX_SECTION_BYTES: usize = IN_SECTION * (5 * NUMBERS + 32);

/// The sums of a block. All of red come first, then all of green, of blue, and how many they are of: in this order they
/// pack best.
#[derive(Serialize, Deserialize)]
pub struct Record {
    pub key: BlockKey,
    sums: Vec<i32>,
}

/// All blocks, sorted by key.
pub fn records(colours: &Colours) -> Vec<Record> {
    let mut keys: Vec<BlockKey> = colours.keys().collect();
    keys.par_sort_unstable();
    let record = |key: BlockKey| {
        let sums = colours.sums(key)?;
        Some(Record { key, sums: (0..4).flat_map(|channel| sums.iter().map(move |sum| sum[channel])).collect() })
    };
    keys.into_par_iter().filter_map(record).collect()
}

/// The sections that hold records.
pub fn packed(records: &[Record]) -> Vec<Vec<u8>> {
    records.par_chunks(IN_SECTION).map(|records| pack(&records)).collect()
}

/// What sections hold.
pub fn read(sections: &[&[u8]]) -> Result<Vec<Record>, Damage> {
    let sections = sections.par_iter().map(|payload| unpack(payload, IN_SECTION, MAX_SECTION_BYTES));
    let sections: Vec<Vec<Record>> = sections.collect::<Result<_, _>>()?;
    Ok(sections.into_iter().flatten().collect())
}

impl Record {
    /// The block as the map holds it.
    pub fn block(&self) -> Result<(BlockKey, Box<Sums>), Damage> {
        let Self { key, sums } = self;
        if key.iter().any(|k| k.unsigned_abs() > MAX_BLOCK) {
            return damage(format!("colours of block {key:?} lie beyond the coordinates of any map"));
        }
        if sums.len() != NUMBERS {
            return damage(format!("colours of block {key:?} are {} numbers, expected {NUMBERS}", sums.len()));
        }
        let block = std::array::from_fn(|voxel| std::array::from_fn(|channel| sums[channel * BLOCK_VOXELS + voxel]));
        Ok((*key, Box::new(block)))
    }
}
