//! Merging: maps are added, voxel by voxel.

use super::OccupancyGrid;
use crate::block::{Block, BlockData, BlockKey, Blocks};
use crate::commit::budget;
use crate::directory::Entry;
use crate::error::{Error, Result};

impl OccupancyGrid {
    /// Adds another map's evidence, and its colours, to this one: the result is that of all frames of both.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if voxel size, prior or clamp differ, the other map has colours that this one cannot keep, or
    /// frames under way;
    /// [`Error::MapFull`]; [`Error::Device`].
    pub fn merge(&mut self, other: &OccupancyGrid) -> Result<()> {
        let refuse = |what: &str, mine: String, theirs: String| {
            let reason = format!("{what} differs: {mine} here, {theirs} in the other map");
            Err(Error::Unsupported { operation: "merge", reason })
        };
        let (mine, theirs) = (&self.config, &other.config);
        if mine.voxel_size != theirs.voxel_size {
            return refuse("voxel_size", format!("{}", mine.voxel_size), format!("{}", theirs.voxel_size));
        }
        if mine.prior != theirs.prior {
            return refuse("prior", format!("{}", mine.prior), format!("{}", theirs.prior));
        }
        if mine.clamp != theirs.clamp {
            return refuse("clamp", format!("{:?}", mine.clamp), format!("{:?}", theirs.clamp));
        }
        if theirs.colour && !mine.colour {
            let reason = "the other map has colours, and this one was made without".into();
            return Err(Error::Unsupported { operation: "merge", reason });
        }
        if !other.is_synchronized() {
            let reason = "the other map has frames under way: synchronize it first".into();
            return Err(Error::Unsupported { operation: "merge", reason });
        }
        self.synchronize()?;
        self.fetch()?;
        other.fetch()?;
        let colours = self.colours.merged(&other.colours);
        if self.config.max_bytes.is_some() {
            self.backend.trim();
            let new = other.directory.keys().filter(|key| !self.directory.contains_key(*key)).count();
            let (mut new_slots, mut beside) = (0, self.colours.bytes_with(&colours));
            for &key in other.directory.keys() {
                let (values, slot) = (self.sums(other, key).0, self.slot(key));
                if Block::Dense(&values).uniform_value().is_none() {
                    new_slots += usize::from(slot.is_none());
                    beside += self.backend.growth_to(slot, &values);
                }
            }
            let entries = self.directory.len() + new;
            budget(&self.directory, entries, self.backend.as_ref(), new_slots, beside, self.config.max_bytes)?;
        }
        let dense = other.directory.iter().filter(|(_, entry)| matches!(entry, Entry::Dense(_)));
        self.backend.reserve(dense.filter(|(key, _)| self.slot(**key).is_none()).count())?;
        for &key in other.directory.keys() {
            let (values, lost) = self.sums(other, key);
            self.store(key, &values);
            self.saturated = self.saturated.saturating_add(lost);
        }
        let lost = colours.lost;
        self.colours.store(colours);
        self.num_frames = self.num_frames.saturating_add(other.num_frames);
        self.saturated = self.saturated.saturating_add(lost).saturating_add(other.saturated);
        self.history = self.history.and(other.history);
        Ok(())
    }

    /// A block of both maps together, and how many voxels `i32` was too small for.
    fn sums(&self, other: &Self, key: BlockKey) -> (BlockData, u64) {
        let limits = self.config.limits();
        let block = |grid: &Self| grid.block(key).unwrap_or(Block::Uniform(0)).to_data();
        let (mut sums, theirs) = (block(self), block(other));
        let mut lost = 0;
        for (sum, theirs) in sums.iter_mut().zip(theirs) {
            let (limited, overflow) = limits.add(*sum, theirs);
            *sum = limited;
            lost += u64::from(overflow);
        }
        (sums, lost)
    }
}
