//! Change: old evidence is weakened, a part of the map forgotten, or a frame moved to where it belongs. Nothing of this
//! happens on its own.
//!
//! Moving a frame is exact, since evidence is a sum. Weakening and forgetting cannot be undone, and are recorded in the
//! map's [`History`]; no frame can be taken off any more then. That holds for what was forgotten too: to take a frame
//! off there would leave the opposite of what it said, walls where it saw free space, and the map does not know which
//! frames came before that and which after.

use super::OccupancyGrid;
use crate::block::{BLOCK_VOXELS, Block, BlockData, BlockKey, Blocks, voxel_offset};
use crate::colour::Sums;
use crate::commit::budget;
use crate::depth::DepthImage;
use crate::error::{Error, Result};
use crate::history::History;
use crate::pose::Pose;
use crate::region::{Overlap, Region};
use crate::sensors::Sensor;
use crate::stats::FrameStats;
use rayon::prelude::*;
use std::ops::Range;

/// Blocks rewritten at a time: bounds the memory that it takes to 8 MB.
const BLOCKS_AT_ONCE: usize = 4096;

/// What is left of evidence after a time, if half of it is left after `half_life`: the factor for
/// [`OccupancyGrid::decay`].
///
/// # Errors
/// [`Error::Parameter`] if a time is not positive and finite, or the factor so near to 0 or 1 that it is rounded to it.
pub fn decay_factor(half_life: f64, elapsed: f64) -> Result<f64> {
    for (name, time) in [("half_life", half_life), ("elapsed", elapsed)] {
        if !(time > 0.0 && time.is_finite()) {
            let expected = "a positive, finite number of seconds".into();
            return Err(Error::Parameter { name, got: format!("{time}"), expected });
        }
    }
    let factor = libm::exp2(-elapsed / half_life);
    if factor > 0.0 && factor < 1.0 {
        return Ok(factor);
    }
    Err(Error::Parameter {
        name: "elapsed",
        got: format!("{elapsed} for a half_life of {half_life}, which makes a factor of {factor}"),
        expected: "a factor between 0 and 1, both excluded".into(),
    })
}

impl OccupancyGrid {
    /// Multiplies all evidence, or that of a region, by a factor, and rounds towards zero: what was seen long ago says
    /// less than what is seen now, until the voxel is unknown again.
    ///
    /// Rounding takes at least one step of 2^-12 from each voxel at each call, so that many small decays weaken more than
    /// one by their product. Colours stay: they are means, and say what was seen, not how surely.
    ///
    /// # Errors
    /// [`Error::Parameter`] unless the factor lies between 0 and 1, both excluded; [`Error::MapFull`], since blocks of
    /// one number that are partly in the region need many; [`Error::Device`].
    pub fn decay(&mut self, factor: f64, region: Option<&Region>) -> Result<()> {
        if !(factor > 0.0 && factor < 1.0) {
            let (got, expected) = (format!("{factor}"), "a number between 0 and 1, both excluded".into());
            return Err(Error::Parameter { name: "factor", got, expected });
        }
        self.synchronize()?;
        let voxels = region.map(|region| region.voxels(self.voxel_size()));
        let overlap = |key| voxels.map_or(Overlap::Whole, |voxels| voxels.overlap(key));
        let weaken = |evidence: &mut i32| *evidence = (f64::from(*evidence) * factor) as i32;
        let keys: Vec<_> = self.keys().into_iter().filter(|&key| overlap(key) != Overlap::None).collect();
        let changed = self.rewrite(&[], &keys, |key, values| match overlap(key) {
            Overlap::None => {}
            Overlap::Part(part) => offsets(part).for_each(|offset| weaken(&mut values[offset])),
            Overlap::Whole => values.iter_mut().for_each(weaken),
        })?;
        if changed {
            self.history = self.history.and(History { decays: 1, decay_product: factor, ..History::default() });
        }
        Ok(())
    }

    /// Forgets a region: its voxels are unknown again.
    ///
    /// # Errors
    /// [`Error::MapFull`], since blocks of one number that are partly in the region need many; [`Error::Device`].
    pub fn clear(&mut self, region: &Region) -> Result<()> {
        self.erase(region, Side::Inside)
    }

    /// Forgets all but a region, so that a map can be a window which moves along with a camera.
    ///
    /// # Errors
    /// As [`OccupancyGrid::clear`].
    pub fn crop(&mut self, region: &Region) -> Result<()> {
        self.erase(region, Side::Outside)
    }

    /// Moves a frame from one pose to another: the map is then as if it had been fused there from the start. Returns what
    /// the frame did at its new pose.
    ///
    /// # Errors
    /// As [`OccupancyGrid::remove`] and [`OccupancyGrid::integrate`]; whichever fails, the map is as before.
    pub fn reintegrate(
        &mut self,
        image: &DepthImage,
        sensor: impl Into<Sensor>,
        old_pose: &Pose,
        new_pose: &Pose,
    ) -> Result<FrameStats> {
        self.synchronize()?;
        self.check_exact("reintegrate")?;
        let sensor = &sensor.into();
        self.fuse(image, sensor, old_pose, -1)?;
        self.fuse(image, sensor, new_pose, 1).or_else(|error| {
            // The map held the frame before and may hold it again, even if a table has grown since then.
            let max_bytes = self.config.max_bytes.take();
            let undone = self.fuse(image, sensor, old_pose, 1);
            self.config.max_bytes = max_bytes;
            undone.and(Err(error))
        })
    }

    fn erase(&mut self, region: &Region, side: Side) -> Result<()> {
        self.synchronize()?;
        let voxels = region.voxels(self.voxel_size());
        let all = if side == Side::Inside { Overlap::Whole } else { Overlap::None };
        let (mut dropped, mut cut) = (Vec::new(), Vec::new());
        for key in self.keys() {
            match voxels.overlap(key) {
                overlap if overlap == all => dropped.push(key),
                Overlap::Part(_) => cut.push(key),
                _ => {}
            }
        }
        let changed = self.rewrite(&dropped, &cut, |key, values| {
            let Overlap::Part(part) = voxels.overlap(key) else { return };
            match side {
                Side::Inside => offsets(part).for_each(|offset| values[offset] = 0),
                Side::Outside => {
                    let before = std::mem::replace(values, UNKNOWN);
                    offsets(part).for_each(|offset| values[offset] = before[offset]);
                }
            }
        })?;
        if changed | self.erase_colours(|key| voxels.overlap(key), side) {
            self.history = self.history.and(History { erasures: 1, ..History::default() });
        }
        Ok(())
    }

    /// Forgets the colours on one side of a region's border. Says whether there were any.
    fn erase_colours(&mut self, overlap: impl Fn(BlockKey) -> Overlap, side: Side) -> bool {
        let untouched = if side == Side::Inside { Overlap::None } else { Overlap::Whole };
        let overlaps = self.colours.keys().map(|key| (key, overlap(key)));
        let parts: Vec<_> = overlaps.filter(|(_, overlap)| *overlap != untouched).collect();
        let erased = self.colours.erased(&parts, |overlap, sums| {
            let before = std::mem::replace(sums, NO_COLOUR);
            let Overlap::Part(part) = overlap else { return };
            match side {
                Side::Inside => {
                    *sums = before;
                    offsets(part.clone()).for_each(|offset| sums[offset] = NO_COLOUR[offset]);
                }
                Side::Outside => offsets(part.clone()).for_each(|offset| sums[offset] = before[offset]),
            }
        });
        let changed = self.colours.changed_by(&erased);
        self.colours.store(erased);
        changed
    }

    /// Makes some blocks unknown and replaces the voxels of others: all of it, or nothing. Says whether any voxel is
    /// another now.
    fn rewrite(
        &mut self,
        dropped: &[BlockKey],
        cut: &[BlockKey],
        change: impl Fn(BlockKey, &mut BlockData) + Sync,
    ) -> Result<bool> {
        self.fetch()?;
        self.make_room(dropped, cut, &change)?;
        for &key in dropped {
            self.store(key, &UNKNOWN);
        }
        let mut changed = !dropped.is_empty();
        for keys in cut.chunks(BLOCKS_AT_ONCE) {
            let blocks: Vec<_> = keys.par_iter().filter_map(|&key| self.changed(key, &change)).collect();
            changed |= !blocks.is_empty();
            for (key, values) in blocks {
                self.store(key, &values);
            }
        }
        Ok(changed)
    }

    /// A block after a change; `None` if it stays as it is.
    fn changed(&self, key: BlockKey, change: impl Fn(BlockKey, &mut BlockData)) -> Option<(BlockKey, BlockData)> {
        let before = self.block(key)?.to_data();
        let mut values = before;
        change(key, &mut values);
        (values != before).then_some((key, values))
    }

    /// Sees to it that blocks which are one number now can become many, once others are dropped.
    fn make_room(
        &mut self,
        dropped: &[BlockKey],
        cut: &[BlockKey],
        change: impl Fn(BlockKey, &mut BlockData) + Sync,
    ) -> Result<()> {
        self.backend.trim();
        let bytes = |values: &BlockData| self.backend.growth_to(None, values);
        let (new_slots, needed): (usize, usize) = cut
            .par_iter()
            .filter(|key| self.slot(**key).is_none())
            .filter_map(|&key| self.changed(key, &change))
            .filter(|(_, values)| Block::Dense(values).uniform_value().is_none())
            .map(|(_, values)| (1, bytes(&values)))
            .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        let free_slots = dropped.iter().filter(|key| self.slot(**key).is_some()).count();
        let new_slots = new_slots.saturating_sub(free_slots);
        if self.config.max_bytes.is_some() {
            let dense = dropped.par_iter().filter(|key| self.slot(**key).is_some());
            let freed: usize = dense.filter_map(|&key| self.block(key)).map(|block| bytes(&block.to_data())).sum();
            let more = needed.saturating_sub(freed);
            if new_slots > 0 || more > 0 {
                let (directory, backend) = (&self.directory, self.backend.as_ref());
                let beside = more + self.colours.bytes();
                budget(directory, directory.len(), backend, new_slots, beside, self.config.max_bytes)?;
            }
        }
        self.backend.reserve(new_slots)
    }
}

/// A block without any colour.
const NO_COLOUR: Sums = [[0; 4]; BLOCK_VOXELS];

/// A block of which nothing is known.
const UNKNOWN: BlockData = [0; BLOCK_VOXELS];

/// The side of a region's border on which evidence is erased.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Inside,
    Outside,
}

/// Where the voxels lie in a block's data whose coordinates within the block are in these ranges.
fn offsets([x, y, z]: [Range<usize>; 3]) -> impl Iterator<Item = usize> {
    let row = move |(x, y)| z.clone().map(move |z| voxel_offset(x, y, z));
    x.flat_map(move |x| y.clone().map(move |y| (x, y))).flat_map(row)
}
