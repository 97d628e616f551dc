//! Questions at points: log-odds, probability, and whether a voxel is free, occupied or unknown.

use crate::block::{BLOCK_VOXELS, Block, BlockKey, Blocks, locate};
use crate::error::{Error, Result};
use crate::grid::OccupancyGrid;
use crate::log_odds;
use rayon::prelude::*;

/// What a map knows of a voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i8)]
pub enum State {
    /// Never seen, or seen with evidence that adds up to nothing.
    Unknown = -1,
    /// Seen, and not more likely occupied than free.
    Free = 0,
    /// More likely occupied than free.
    Occupied = 1,
}

impl OccupancyGrid {
    /// Log-odds at world points, metres: evidence plus prior, and 0 where unknown, as in [`Self::block_log_odds`].
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the first point that is not finite.
    pub fn log_odds(&self, points: &[[f64; 3]]) -> Result<Vec<f32>> {
        let l_0 = self.prior_log_odds();
        self.at(points, |evidence| known_log_odds(evidence, l_0))
    }

    /// Probabilities of being occupied at world points (Eq. 5); the prior where unknown.
    ///
    /// # Errors
    /// As [`OccupancyGrid::log_odds`].
    pub fn probability(&self, points: &[[f64; 3]]) -> Result<Vec<f32>> {
        let l_0 = self.prior_log_odds();
        self.at(points, |evidence| log_odds::to_probability(log_odds::from_fixed(evidence) + l_0) as f32)
    }

    /// Whether the voxels at world points are unknown, free or occupied.
    ///
    /// # Errors
    /// As [`OccupancyGrid::log_odds`].
    pub fn state(&self, points: &[[f64; 3]]) -> Result<Vec<State>> {
        let l_0 = self.prior_log_odds();
        self.at(points, |evidence| match evidence {
            0 => State::Unknown,
            _ if log_odds::from_fixed(evidence) + l_0 > 0.0 => State::Occupied,
            _ => State::Free,
        })
    }

    /// The keys of all blocks that hold something, sorted.
    pub fn block_coords(&self) -> Vec<BlockKey> {
        let mut keys = self.keys();
        keys.par_sort_unstable();
        keys
    }

    /// Log-odds of whole blocks, one after the other, each with `z` running fastest; 0 where unknown, evidence plus
    /// prior elsewhere.
    pub fn block_log_odds(&self, keys: &[BlockKey]) -> Vec<f32> {
        let l_0 = self.prior_log_odds();
        let mut out = vec![0.0; keys.len() * BLOCK_VOXELS];
        out.par_chunks_mut(BLOCK_VOXELS).zip(keys).for_each(|(out, &key)| match self.block(key) {
            None => {}
            Some(Block::Uniform(evidence)) => out.fill(known_log_odds(evidence, l_0)),
            Some(block) => {
                let voxels = out.iter_mut().zip(block.to_data());
                voxels.for_each(|(out, evidence)| *out = known_log_odds(evidence, l_0));
            }
        });
        out
    }

    fn at<T: Send>(&self, points: &[[f64; 3]], answer: impl Fn(i32) -> T + Sync) -> Result<Vec<T>> {
        let voxel_size = self.voxel_size();
        let one = |(row, point): (usize, &[f64; 3])| match point.iter().find(|c| !c.is_finite()) {
            Some(got) => Err(Error::Parameter {
                name: "points",
                got: format!("{got} in row {row}"),
                expected: "finite coordinates, metres".into(),
            }),
            None => Ok(answer(self.evidence(point.map(|c| c / voxel_size)))),
        };
        points.par_iter().with_min_len(1024).enumerate().map(one).collect()
    }

    /// Stored evidence at a point given in voxels; beyond all coordinates, as wherever nothing is stored, 0.
    fn evidence(&self, point: [f64; 3]) -> i32 {
        let index = point.map(f64::floor);
        if index.iter().any(|i| i.abs() > f64::from(i32::MAX)) {
            return 0;
        }
        let (key, offset) = locate(index.map(|i| i as i32));
        self.block(key).map_or(0, |block| block.value(offset))
    }
}

fn known_log_odds(evidence: i32, l_0: f64) -> f32 {
    if evidence == 0 { 0.0 } else { (log_odds::from_fixed(evidence) + l_0) as f32 }
}
