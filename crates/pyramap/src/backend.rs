//! What a device must do: the stages of a frame, and a pool of dense blocks.
//!
//! The host owns the directory; a backend is told slots. Everything that reads a map reads blocks through here.

use crate::block::{Block, BlockData};
use crate::config::GridConfig;
use crate::cull::Culled;
use crate::depth::DepthImage;
use crate::error::{Error, Result};
use crate::log_odds::Limits;
use crate::pose::Pose;
use crate::sensors::Sensor;
use crate::stats::StageSeconds;
use crate::update::Change;

/// What a frame does to the blocks that it sees: all that the stages before commit have to say. The increments of dense
/// changes stay on the device.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// The blocks.
    pub culled: Culled,
    /// What happens to each mixed block.
    pub changes: Vec<Change>,
    /// How long each stage took, but for commit.
    pub seconds: StageSeconds,
}

/// One addition to a slot of the pool.
#[derive(Clone, Copy, Debug)]
pub struct Addition {
    /// The slot.
    pub slot: u32,
    /// What all voxels of a new slot start from; `None` adds to what the slot holds.
    pub base: Option<i32>,
    /// What is added.
    pub source: Source,
}

/// Where the increments of an addition come from.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// The same increment for all voxels.
    Uniform(i32),
    /// Those of the `n`-th mixed block of the frame last seen.
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
    /// How long the device worked on it beside the host.
    pub seconds: f64,
}

/// A device that maps.
///
/// A frame is begun ([`Backend::see`]), asked for ([`Backend::seen`]), and added ([`Backend::commit`]). Only the last
/// changes the map, so that a frame which fails before it has changed nothing. A pipelined device works on a frame while
/// the host does something else: the next frame is begun before this one is asked for. At most two are begun at a time,
/// and a commit's outcome is asked for before the next commit.
pub trait Backend: Send + Sync {
    /// What users call it: `"cpu"`, `"gpu"`.
    fn name(&self) -> &str;
    /// The device's own name, where that says more.
    fn adapter(&self) -> Option<&str>;
    /// Whether [`Backend::see`] returns before the device is done.
    fn pipelined(&self) -> bool;

    /// Begins with a frame: the stages ranges, pyramid, cull and update. The image was found to fit the sensor.
    ///
    /// # Errors
    /// If the device fails; [`Error::Unsupported`] on devices without that sensor.
    fn see(&mut self, config: &GridConfig, image: &DepthImage, sensor: &Sensor, pose: &Pose) -> Result<()>;
    /// Begins with a frame of points in the sensor's frame instead of an image, for the rule
    /// [`Rays`](crate::update::UpdateRule::Rays).
    ///
    /// # Errors
    /// [`Error::Unsupported`] on devices without that rule; [`Error::Parameter`] if no point says anything.
    fn see_points(&mut self, _config: &GridConfig, _points: &[[f64; 3]], _pose: &Pose) -> Result<()> {
        let reason = format!("the backend {} does not have the update rule \"rays\"", self.name());
        Err(Error::Unsupported { operation: "integrate_points", reason })
    }
    /// What the frame begun first does to the map; waits for it. Additions of the next commit refer to this frame.
    ///
    /// # Errors
    /// If the device fails.
    fn seen(&mut self, config: &GridConfig, seen: &mut Seen) -> Result<()>;
    /// Gives up all frames that were begun and not asked for.
    fn forget(&mut self);
    /// Begins to add to slots, times `sign`, within limits; each slot occurs once.
    ///
    /// # Errors
    /// If the device fails.
    fn commit(&mut self, additions: &[Addition], sign: i32, limits: Limits) -> Result<()>;
    /// What came of the last commit; waits for it.
    ///
    /// # Errors
    /// If the device fails.
    fn committed(&mut self, committed: &mut Committed) -> Result<()>;

    /// Bytes that the pool takes.
    fn pool_bytes(&self) -> usize;
    /// Gives up memory that is kept only to be used again.
    fn trim(&mut self) {}
    /// Bytes by which the pool would grow if so many slots were allocated, without what is in them.
    fn table_growth(&self, new: usize) -> usize;
    /// Bytes by which blocks would grow at most if so many additions were made to slots, and to new ones.
    fn most_growth(&self, to_slots: usize, to_new: usize) -> usize;
    /// Bytes by which a block would grow if an addition of the frame last seen were made.
    fn growth(&self, base: Base, source: Source, sign: i32, limits: Limits) -> usize;
    /// Bytes by which blocks would grow if one were stored in a slot, or a new one.
    fn growth_to(&self, slot: Option<u32>, values: &BlockData) -> usize;
    /// Makes sure that so many slots can be allocated.
    ///
    /// # Errors
    /// If the device has no room for them; nothing has changed then.
    fn reserve(&mut self, new: usize) -> Result<()>;
    /// A slot, which holds anything until it is written, or added to from a base.
    fn allocate(&mut self) -> u32;
    /// Gives a slot back.
    fn release(&mut self, slot: u32);

    /// Brings to the host what has changed since it was last read.
    ///
    /// # Errors
    /// If the device fails, or has taken the map along.
    fn fetch(&self) -> Result<()>;
    /// The voxels of a slot.
    ///
    /// # Panics
    /// If something has changed since [`Backend::fetch`], and cannot be fetched.
    fn read(&self, slot: u32) -> Block<'_>;
    /// Replaces the voxels of a slot.
    fn write(&mut self, slot: u32, values: &BlockData);
}
