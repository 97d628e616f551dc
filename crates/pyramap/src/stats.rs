//! What a frame did, and how long each stage took.

use crate::block::BLOCK_VOXELS;
use crate::cull::Culled;
use crate::update::Change;
use std::time::Instant;

/// Seconds spent in each stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageSeconds {
    /// Distances out of depths.
    pub ranges: f64,
    /// The layers and their bounds.
    pub pyramid: f64,
    /// Hidden, free and mixed blocks told apart.
    pub cull: f64,
    /// Log-odds of the voxels in mixed blocks.
    pub update: f64,
    /// Addition to the map.
    pub commit: f64,
}

impl StageSeconds {
    /// Names and values, in the order of the stages.
    pub fn named(&self) -> [(&'static str, f64); 5] {
        let Self { ranges, pyramid, cull, update, commit } = *self;
        [("ranges", ranges), ("pyramid", pyramid), ("cull", cull), ("update", update), ("commit", commit)]
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
    pub(crate) fn count(culled: &Culled, changes: &[Change]) -> Self {
        let voxels = |change: &Change| match *change {
            Change::None => 0,
            Change::Uniform(_) => BLOCK_VOXELS,
            Change::Dense { voxels } => voxels as usize,
        };
        Self {
            blocks_free: culled.free.len(),
            blocks_mixed: culled.mixed.len(),
            voxels_updated: culled.free.len() * BLOCK_VOXELS + changes.iter().map(voxels).sum::<usize>(),
            ..Self::default()
        }
    }
}

/// Takes the time of one stage after the other.
pub(crate) struct Stopwatch {
    last: Instant,
    seconds: StageSeconds,
}

impl Stopwatch {
    pub(crate) fn start() -> Self {
        Self { last: Instant::now(), seconds: StageSeconds::default() }
    }

    /// Books the time since the last lap to a stage.
    pub(crate) fn lap(&mut self, stage: impl Fn(&mut StageSeconds) -> &mut f64) {
        let now = Instant::now();
        *stage(&mut self.seconds) = (now - self.last).as_secs_f64();
        self.last = now;
    }

    pub(crate) fn seconds(&self) -> StageSeconds {
        self.seconds
    }
}
