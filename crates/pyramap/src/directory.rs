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

/// Bytes that a directory takes, used or not, once it holds so many entries.
pub fn bytes(directory: &Directory, entries: usize) -> usize {
    let now = directory.allocation_size();
    if entries <= directory.capacity() {
        return now;
    }
    // The table holds seven entries in eight places, a power of two of them, with one control byte a place and one
    // group of 16 more. It at least doubles when it grows, which places that were given up may bring about early.
    let places = (entries * 8).div_ceil(7).next_power_of_two();
    (places * (size_of::<(BlockKey, Entry)>() + 1) + 16).max(2 * now)
}
