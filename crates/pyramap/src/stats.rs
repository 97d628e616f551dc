//! What a frame did, and how long each stage took.

use crate::backend::Seen;
use crate::block::BLOCK_VOXELS;
use crate::update::Change;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// Seconds spent in each stage. A device that cannot tell its kernels apart books them all to `update`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageSeconds {
    /// The image on its way to a device.
    pub upload: f64,
    /// Distances out of depths.
    pub ranges: f64,
    /// The layers and their bounds.
    pub pyramid: f64,
    /// Hidden, free and mixed blocks told apart.
    pub cull: f64,
    /// Log-odds of the voxels in mixed blocks.
    pub update: f64,
    /// What was found on its way back from a device.
    pub readback: f64,
    /// Colours of the voxels near surfaces, of a frame that has them; on the host, beside a device.
    pub colour: f64,
    /// Addition to the map.
    pub commit: f64,
}

impl StageSeconds {
    /// Names and values, in the order of the stages.
    pub fn named(&self) -> [(&'static str, f64); 8] {
        let Self { upload, ranges, pyramid, cull, update, readback, colour, commit } = *self;
        [
            ("upload", upload),
            ("ranges", ranges),
            ("pyramid", pyramid),
            ("cull", cull),
            ("update", update),
            ("readback", readback),
            ("colour", colour),
            ("commit", commit),
        ]
    }
}

/// What a frame did to the map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameStats {
    /// Blocks found free throughout without asking a voxel.
    pub blocks_free: usize,
    /// Blocks asked voxel by voxel.
    pub blocks_mixed: usize,
    /// Voxels whose evidence changed.
    pub voxels_updated: usize,
    /// Voxels whose evidence was too large to be stored whole.
    pub saturated: u64,
    /// Time by stage.
    pub seconds: StageSeconds,
}

impl FrameStats {
    pub(crate) fn count(Seen { culled, changes, seconds }: &Seen) -> Self {
        let voxels = |change: &Change| match *change {
            Change::None => 0,
            Change::Uniform(_) => BLOCK_VOXELS,
            Change::Dense { voxels } => voxels as usize,
        };
        Self {
            blocks_free: culled.free.len(),
            blocks_mixed: culled.mixed.len(),
            voxels_updated: culled.free.len() * BLOCK_VOXELS + changes.iter().map(voxels).sum::<usize>(),
            saturated: 0,
            seconds: *seconds,
        }
    }
}

/// What a submitted frame did, once that is known.
#[derive(Clone, Debug, Default)]
pub struct Submitted(Arc<OnceLock<FrameStats>>);

impl Submitted {
    /// What the frame did; `None` until it is fused, and for ever if it could not be.
    pub fn stats(&self) -> Option<FrameStats> {
        self.0.get().copied()
    }

    pub(crate) fn settle(&self, stats: FrameStats) {
        self.0.set(stats).expect("a frame is fused once");
    }
}

/// Takes the time of one stage after the other.
pub struct Stopwatch(Instant);

impl Stopwatch {
    /// Starts with the first stage.
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// Seconds since the last lap.
    pub fn lap(&mut self) -> f64 {
        let now = Instant::now();
        (now - std::mem::replace(&mut self.0, now)).as_secs_f64()
    }
}
