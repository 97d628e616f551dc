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

/// Bytes that a table of blocks takes, used or not, once it holds so many entries.
pub fn bytes<T>(directory: &HashMap<BlockKey, T>, entries: usize) -> usize {
    let now = directory.allocation_size();
    if entries <= directory.capacity() {
        return now;
    }
    // The table holds seven entries in eight places, a power of two of them and at least four, with one control byte a place and one
    // group of 16 more. It at least doubles when it grows, which places that were given up may bring about early.
    let places = (entries * 8).div_ceil(7).next_power_of_two().max(4);
    (places * (size_of::<(BlockKey, T)>() + 1) + 16).max(2 * now)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_size_is_known_before_it_comes() {
        let mut directory = Directory::default();
        for n in 0..30_000 {
            let predicted = bytes(&directory, directory.len() + 1);
            directory.insert([n, -n, 7 * n], Entry::Uniform(1));
            assert!(bytes(&directory, directory.len()) <= predicted, "at {n}: {predicted}");
            // Places that were given up are not free at once.
            if n % 3 == 0 {
                directory.remove(&[n / 2, -n / 2, 7 * (n / 2)]);
            }
        }
        assert_eq!(bytes(&directory, 0), directory.allocation_size());
    }
}
