//! The directory: which blocks a map holds, and in what form.

use crate::block::{BLOCK_VOXELS, BlockData, BlockKey};
use hashbrown::HashMap;
use std::mem::size_of;

/// How a block is held. Free space costs an entry, not a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// All voxels have this value, which is not 0: what is unknown throughout has no entry.
    Uniform(i32),
    /// The voxels are in this slot of the backend's pool.
    Dense(u32),
}

/// From block coordinates to entries.
pub type Directory = HashMap<BlockKey, Entry>;

/// Bytes that a map takes: every slot of its pool and every place of its directory, used or not.
pub fn bytes(directory_capacity: usize, slots: usize) -> usize {
    // The table holds seven entries in eight places, and one control byte a place.
    let places = if directory_capacity == 0 { 0 } else { (directory_capacity * 8 / 7).next_power_of_two() };
    places * (size_of::<(BlockKey, Entry)>() + 1) + slots * BLOCK_VOXELS * size_of::<i32>()
}

/// The one value of a block, if all its voxels have the same.
pub fn uniform_value(values: &BlockData) -> Option<i32> {
    values.iter().all(|&value| value == values[0]).then_some(values[0])
}
