//! The directory: which blocks a map holds, and in what form.

use crate::block::BlockKey;
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

/// Bytes that a directory takes: every place of its table, used or not.
pub fn bytes(capacity: usize) -> usize {
    // The table holds seven entries in eight places, and one control byte a place.
    let places = if capacity == 0 { 0 } else { (capacity * 8).div_ceil(7).next_power_of_two() };
    places * (size_of::<(BlockKey, Entry)>() + 1)
}
