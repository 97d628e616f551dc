//! The room around a map's voxels, kept with the map until that changes: who asks again finds it made.

use super::Space;
use super::clearance::{AROUND, Clearance, FARTHEST, Stops, UNKNOWN, clearance};
use crate::block::{BLOCK_VOXELS, Blocks};
use crate::mask::Mask;
use crate::state::Unknown;
use crate::window::Window;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What is kept, by what unknown voxels count as: nothing if the map is too scattered. And how many rays were cast without.
#[derive(Default)]
pub struct Kept {
    to_unknown: OnceLock<Option<Window<Clearance>>>,
    through_unknown: OnceLock<Option<Window<Clearance>>>,
    asked: AtomicUsize,
}

impl Kept {
    /// The clearance of all blocks, if it is there or so many rays, and those before, pay for it.
    pub(super) fn window(
        &self,
        blocks: &(impl Blocks + ?Sized),
        space: &Space,
        rays: usize,
    ) -> Option<&Window<Clearance>> {
        /// So many rays pay for the clearance of a block.
        const RAYS_PER_BLOCK: usize = 8;
        let kept = match space.unknown {
            Unknown::Occupied => &self.to_unknown,
            Unknown::Free => &self.through_unknown,
        };
        if kept.get().is_none() {
            let asked = self.asked.fetch_add(rays, Ordering::Relaxed).saturating_add(rays);
            if asked / RAYS_PER_BLOCK < blocks.count() {
                return None;
            }
            // Nobody waits for another thread that makes the same: a thread of a pool that waits may be given work that
            // waits for it.
            let _ = kept.set(window(blocks, space));
        }
        kept.get()?.as_ref()
    }
}

fn window(blocks: &(impl Blocks + ?Sized), space: &Space) -> Option<Window<Clearance>> {
    let everywhere = |clearance| [clearance; BLOCK_VOXELS];
    let all = if space.unknown == Unknown::Occupied { Mask::ALL } else { Mask::NONE };
    let stops = Window::new(blocks, [Stops { all, occupied: Mask::NONE }; 2], |block| space.stops(&block))?;
    let clearance = |stops: &_, key| clearance(stops, key, space.instructions);
    Some(match space.unknown {
        Unknown::Occupied => stops.map([everywhere(UNKNOWN); 2], clearance),
        Unknown::Free => stops.map_around([everywhere(FARTHEST), everywhere(AROUND)], clearance),
    })
}
