//! Lists of voxels: those that are occupied, those that are free, and the unknown ones beside free ones.

use crate::block::{BLOCK_EDGE, Block, BlockKey, Blocks, VoxelIndex};
use crate::error::Result;
use crate::grid::OccupancyGrid;
use crate::mask::Mask;
use crate::state::{State, Threshold};
use hashbrown::HashSet;
use rayon::prelude::*;

impl OccupancyGrid {
    /// Indices of all occupied voxels, sorted by block, and within a block by x, y, z.
    ///
    /// # Errors
    /// If the device fails.
    pub fn occupied_voxels(&self) -> Result<Vec<VoxelIndex>> {
        self.voxels_in(State::Occupied)
    }

    /// Indices of all free voxels, in the same order.
    ///
    /// # Errors
    /// If the device fails.
    pub fn free_voxels(&self) -> Result<Vec<VoxelIndex>> {
        self.voxels_in(State::Free)
    }

    /// Indices of all unknown voxels that share a face with a free one, in the same order: where the map can grow.
    ///
    /// # Errors
    /// If the device fails.
    pub fn unknown_voxels_next_to_free(&self) -> Result<Vec<VoxelIndex>> {
        self.fetch()?;
        let mut keys: HashSet<BlockKey> = self.keys().into_iter().collect();
        let around: Vec<_> = keys.iter().flat_map(|&key| neighbours(key).map(|(next, ..)| next)).collect();
        keys.extend(around);
        Ok(indices(keys.into_iter().collect(), |key| {
            let unknown = self.mask(key, State::Unknown);
            if unknown.is_empty() {
                return Mask::NONE;
            }
            let free = self.mask(key, State::Free);
            let beside = neighbours(key).fold(Mask::NONE, |beside, (next, axis, up)| {
                // Free voxels of this block, and those of the next one that a step back brings into it.
                beside | free.step(axis, up).0 | self.mask(next, State::Free).step(axis, !up).1
            });
            unknown & beside
        }))
    }

    fn voxels_in(&self, state: State) -> Result<Vec<VoxelIndex>> {
        self.fetch()?;
        Ok(indices(self.keys(), |key| self.mask(key, state)))
    }

    fn mask(&self, key: BlockKey, state: State) -> Mask {
        let threshold = Threshold::of(self);
        Mask::of(&self.block(key).unwrap_or(Block::Uniform(0)), |evidence| threshold.state(evidence) == state)
    }
}

/// The six blocks that share a face with one: which, along which axis, and whether upwards.
fn neighbours(key: BlockKey) -> impl Iterator<Item = (BlockKey, usize, bool)> {
    (0..6).map(move |n| {
        let (axis, up) = (n / 2, n % 2 == 1);
        let mut next = key;
        next[axis] += if up { 1 } else { -1 };
        (next, axis, up)
    })
}

/// The voxels of masks of blocks, sorted by block.
fn indices(mut keys: Vec<BlockKey>, mask: impl Fn(BlockKey) -> Mask + Sync) -> Vec<VoxelIndex> {
    keys.par_sort_unstable();
    let voxels = |key: BlockKey| {
        mask(key).offsets().map(move |offset| {
            let within = [offset / (BLOCK_EDGE * BLOCK_EDGE), offset / BLOCK_EDGE % BLOCK_EDGE, offset % BLOCK_EDGE];
            std::array::from_fn(|a| key[a] * BLOCK_EDGE as i32 + within[a] as i32)
        })
    };
    keys.into_par_iter().with_min_len(16).flat_map_iter(voxels).collect()
}
