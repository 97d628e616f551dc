//! Which voxels of a map are inside, and in which blocks that has changed.

use super::tiles::{Change, Tiles};
use crate::block::Blocks;
use crate::mask::Mask;
use crate::state::{Threshold, Unknown};
use rayon::prelude::*;

/// The blocks of a map in which voxels have changed sides since the tiles were made. Comparing all blocks takes much less
/// than the distances of a few, and relies on nobody's having noted what was changed.
pub fn changes(blocks: &(impl Blocks + ?Sized), tiles: &Tiles, unknown: Unknown) -> Vec<Change> {
    let threshold = Threshold::of(blocks);
    // Unknown space is outside: then what is not stored is, and blocks beyond the map need no thought.
    let is_inside = |evidence| threshold.blocked(evidence, unknown) != (unknown == Unknown::Occupied);
    let change = |&key| {
        let (old, new) = (tiles.inside(key), blocks.block(key).map_or(Mask::NONE, |block| Mask::of(&block, is_inside)));
        (old != new).then_some(Change { key, old, new })
    };
    let mut changes: Vec<_> = blocks.keys().par_iter().with_min_len(16).filter_map(change).collect();
    let gone = tiles.filled().filter(|&key| blocks.block(key).is_none());
    changes.extend(gone.map(|key| Change { key, old: tiles.inside(key), new: Mask::NONE }));
    changes
}
