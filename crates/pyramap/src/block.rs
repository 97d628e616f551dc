//! Blocks of 8 x 8 x 8 voxels: the unit that is stored, culled, read and written.
//!
//! Voxel `(i, j, k)` spans `[i r, (i + 1) r)` in each axis; block `(a, b, c)` holds the voxels
//! `8a <= i < 8a + 8`, and likewise `j`, `k`. Inside a block, `z` runs fastest.

use crate::colour::Colours;
use crate::error::Result;

/// Voxels along one edge of a block.
pub const BLOCK_EDGE: usize = 8;
/// Voxels in a block.
pub const BLOCK_VOXELS: usize = BLOCK_EDGE * BLOCK_EDGE * BLOCK_EDGE;

/// The largest coordinate of a block, either way: voxel indices and their neighbours stay well inside `i32`.
pub const MAX_BLOCK: u32 = 1 << 27;

/// Coordinates of a block: those of its first voxel divided by [`BLOCK_EDGE`].
pub type BlockKey = [i32; 3];
/// Coordinates of a voxel in the whole grid.
pub type VoxelIndex = [i32; 3];
/// The stored evidence of one block's voxels, fixed point, in the order of [`voxel_offset`].
pub type BlockData = [i32; BLOCK_VOXELS];
/// The same in half the room, for evidence within +-8 log-odds.
pub type NarrowBlockData = [i16; BLOCK_VOXELS];

/// Where voxel `(x, y, z)` of a block, each in `0..8`, lies in [`BlockData`].
#[inline]
pub const fn voxel_offset(x: usize, y: usize, z: usize) -> usize {
    (x * BLOCK_EDGE + y) * BLOCK_EDGE + z
}

/// The block that holds a voxel, and where in the block it lies.
#[inline]
pub fn locate(voxel: VoxelIndex) -> (BlockKey, usize) {
    let (edge, [x, y, z]) = (BLOCK_EDGE as i32, voxel);
    let within = |i: i32| i.rem_euclid(edge) as usize;
    let key = [x.div_euclid(edge), y.div_euclid(edge), z.div_euclid(edge)];
    (key, voxel_offset(within(x), within(y), within(z)))
}

/// What a map holds for one block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Block<'a> {
    /// Every voxel has this one value; `0` is unknown.
    Uniform(i32),
    /// Each voxel has its own value, all of them small.
    Narrow(&'a NarrowBlockData),
    /// Each voxel has its own value.
    Dense(&'a BlockData),
}

impl Block<'_> {
    /// The value of the voxel at an offset given by [`voxel_offset`] or [`locate`].
    #[inline]
    pub fn value(&self, offset: usize) -> i32 {
        match self {
            Block::Uniform(value) => *value,
            Block::Narrow(values) => i32::from(values[offset]),
            Block::Dense(values) => values[offset],
        }
    }

    /// The values of all voxels, in the order of [`voxel_offset`].
    #[inline]
    pub fn to_data(&self) -> BlockData {
        match self {
            Block::Uniform(value) => [*value; BLOCK_VOXELS],
            Block::Narrow(values) => values.map(i32::from),
            Block::Dense(values) => **values,
        }
    }

    /// The one value of all voxels, if they have the same.
    pub fn uniform_value(&self) -> Option<i32> {
        let first = self.value(0);
        let uniform = match self {
            Block::Uniform(_) => true,
            Block::Narrow(values) => values.iter().all(|&value| i32::from(value) == first),
            Block::Dense(values) => values.iter().all(|&value| value == first),
        };
        uniform.then_some(first)
    }
}

/// Read access to the blocks of a map: all that queries, meshes and files need to know of it.
///
/// Values are fixed-point evidence ([`crate::log_odds`]); a block that is not there is unknown throughout.
pub trait Blocks: Sync {
    /// The keys of all blocks that hold something, in no order that is to be relied on.
    fn keys(&self) -> Vec<BlockKey>;
    /// How many blocks hold something.
    fn count(&self) -> usize {
        self.keys().len()
    }
    /// One block; `None` where nothing is stored.
    fn block(&self, key: BlockKey) -> Option<Block<'_>>;
    /// Brings to the host what a device has changed since it was last read. What reads a map calls this first; without,
    /// [`Blocks::block`] does so itself, and panics where this gives an error.
    ///
    /// # Errors
    /// If the device fails, or has taken the map along.
    fn fetch(&self) -> Result<()> {
        Ok(())
    }
    /// The colours of the voxels, if the map keeps any.
    fn colours(&self) -> Option<&Colours> {
        None
    }
    /// Edge of a voxel, metres.
    fn voxel_size(&self) -> f64;
    /// Log-odds of the prior (Eq. 4), to be added to the stored evidence.
    fn prior_log_odds(&self) -> f64;
}
