//! What a device must do: the stages of a frame, and a pool of dense blocks.
//!
//! The host owns the directory; a backend is told slots. Everything that reads a map reads blocks through here.

use crate::block::{Block, BlockData, BlockKey};
use crate::camera::PinholeCamera;
use crate::config::GridConfig;
use crate::cull::Culled;
use crate::depth::DepthImage;
use crate::error::Result;
use crate::log_odds::Limits;
use crate::pose::Pose;
use crate::update::Change;

/// One addition to a slot of the pool.
#[derive(Clone, Copy, Debug)]
pub struct Addition {
    /// The slot.
    pub slot: u32,
    /// What is added.
    pub source: Source,
}

/// Where the increments of an addition come from.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// The same increment for all voxels.
    Uniform(i32),
    /// Those of the `n`-th mixed block of the frame.
    Mixed(usize),
}

/// What an addition starts from.
#[derive(Clone, Copy, Debug)]
pub enum Base {
    /// The voxels of a slot.
    Slot(u32),
    /// A new block, all of one value.
    Value(i32),
}

/// What came of a commit.
#[derive(Clone, Debug, Default)]
pub struct Committed {
    /// How many voxels `i32` was too small for.
    pub lost: u64,
    /// The additions, by their place in the list, after which all voxels of the slot have one value, and that value.
    pub uniform: Vec<(usize, i32)>,
}

/// A device that maps.
///
/// The stages of a frame are called in the order `ranges`, `pyramid`, `cull`, `update`, `commit`; none but `commit`
/// changes the map, so that a frame which fails before it has changed nothing.
pub trait Backend: Send + Sync {
    /// What users call it.
    fn name(&self) -> &'static str;

    /// Euclidean distances of a depth image (Eq. 6).
    ///
    /// # Errors
    /// If image and camera do not fit, or no pixel says anything.
    fn ranges(&mut self, config: &GridConfig, image: &DepthImage, camera: &PinholeCamera) -> Result<()>;
    /// The layers (Eq. 10), as the sensor model sees them.
    fn pyramid(&mut self, config: &GridConfig, pose: &Pose);
    /// The blocks that the frame changes.
    fn cull(&mut self, config: &GridConfig, culled: &mut Culled);
    /// What the frame does to each mixed block (Alg. 1). The increments stay on the device.
    fn update(&mut self, config: &GridConfig, mixed: &[BlockKey]) -> &[Change];
    /// Adds to slots, times `sign`, within limits; each slot occurs once.
    fn commit(&mut self, additions: &[Addition], sign: i32, limits: Limits) -> Committed;

    /// Bytes that the pool takes.
    fn pool_bytes(&self) -> usize;
    /// Bytes by which the pool would grow if so many slots were allocated, without what is in them.
    fn table_growth(&self, new: usize) -> usize;
    /// Bytes by which blocks would grow at most if so many additions were made to slots, and to new ones.
    fn most_growth(&self, to_slots: usize, to_new: usize) -> usize;
    /// Bytes by which a block would grow if an addition of the present frame were made.
    fn growth(&self, base: Base, source: Source, sign: i32, limits: Limits) -> usize;
    /// Bytes by which blocks would grow if one were stored in a slot, or a new one.
    fn growth_to(&self, slot: Option<u32>, values: &BlockData) -> usize;
    /// A slot whose voxels all have one value.
    fn allocate(&mut self, value: i32) -> u32;
    /// Gives a slot back.
    fn release(&mut self, slot: u32);
    /// The voxels of a slot.
    fn read(&self, slot: u32) -> Block<'_>;
    /// Replaces the voxels of a slot.
    fn write(&mut self, slot: u32, values: &BlockData);
}
