//! A region of the map as a dense array.

use crate::block::{BLOCK_EDGE, Blocks, VoxelIndex, locate};
use crate::error::{Error, Result};
use crate::grid::OccupancyGrid;
use crate::query::known_log_odds;
use crate::region::{Region, VoxelBox};
use crate::window::Lookup;
use rayon::prelude::*;

/// All voxels of a region.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    /// Log-odds, evidence plus prior, 0 where unknown; or distances in metres. Of the axes x, y, z the last runs fastest.
    pub values: Vec<f32>,
    /// Voxels along x, y, z.
    pub shape: [usize; 3],
    /// Index of the first voxel.
    pub first: VoxelIndex,
}

/// The largest region, in voxels: 8 GiB of values.
pub const MAX_DENSE_VOXELS: usize = 1 << 31;

impl OccupancyGrid {
    /// The log-odds of all voxels whose centres lie in a region.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the region has more than [`MAX_DENSE_VOXELS`], or more than there is memory for; or if the
    /// device fails.
    pub fn dense(&self, region: &Region) -> Result<Dense> {
        let VoxelBox { low: first, high } = region.voxels(self.voxel_size());
        // An endless side is longer than an i32 can say.
        let side = |a: usize| usize::try_from(i64::from(high[a]) - i64::from(first[a])).unwrap_or(0);
        let shape: [usize; 3] = std::array::from_fn(side);
        let mut values = room(shape)?;
        self.fetch()?;
        if values.is_empty() {
            return Ok(Dense { values, shape, first });
        }
        let l_0 = self.prior_log_odds();
        let blocks = Lookup::new(self, values.len() / BLOCK_EDGE);
        let [_, y, z] = shape;
        values.par_chunks_mut(z).enumerate().with_min_len(y.min(16)).for_each(|(row, values)| {
            let mut voxel = [first[0] + (row / y) as i32, first[1] + (row % y) as i32, first[2]];
            let mut rest = values;
            while !rest.is_empty() {
                let (key, offset) = locate(voxel);
                let count = (BLOCK_EDGE - offset % BLOCK_EDGE).min(rest.len());
                let run = rest.split_off_mut(..count).expect("no more than the rest");
                if let Some(block) = blocks.block(key) {
                    let values = run.iter_mut().zip(offset..);
                    values.for_each(|(value, offset)| *value = known_log_odds(block.value(offset), l_0));
                }
                voxel[2] += count as i32;
            }
        });
        Ok(Dense { values, shape, first })
    }
}

/// Zeros for a shape, or an error that says how large it is.
pub(crate) fn room(shape: [usize; 3]) -> Result<Vec<f32>> {
    let [x, y, z] = shape;
    let refuse = |expected: String| {
        let bytes = shape.into_iter().fold(size_of::<f32>() as u128, |bytes, n| bytes * n as u128);
        Err(Error::Parameter { name: "region", got: format!("{x} x {y} x {z} voxels, {bytes} bytes"), expected })
    };
    let count = shape.into_iter().try_fold(1, usize::checked_mul).filter(|&count| count <= MAX_DENSE_VOXELS);
    let Some(count) = count else {
        return refuse(format!("at most {MAX_DENSE_VOXELS} voxels"));
    };
    let mut values = Vec::new();
    if values.try_reserve_exact(count).is_err() {
        return refuse("what there is memory for".into());
    }
    values.resize(count, 0.0);
    Ok(values)
}
