//! Whether shapes meet occupied space.
//!
//! A shape meets a voxel if any point of it, its surface included, belongs to the voxel. Voxels are closed below and
//! open above, as everywhere: a box that stands on the upper faces of a floor's voxels does not meet them.

use crate::block::{BLOCK_EDGE, Block, BlockKey, Blocks, VoxelIndex, locate};
use crate::error::{Error, Result};
use crate::grid::OccupancyGrid;
use crate::query::{check_finite, first_row};
use crate::ray::{each, floor};
use crate::state::{Threshold, Unknown};
use crate::window::Lookup;
use rayon::prelude::*;
use std::ops::RangeInclusive;
use std::sync::OnceLock;

impl OccupancyGrid {
    /// Whether balls meet an occupied voxel, or an unknown one where unknown counts as occupied; rows of x, y, z of the
    /// centre and the radius, metres.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the first row that is not finite or has a negative radius; or if the device fails.
    pub fn collides_spheres(&self, spheres: &[[f64; 4]], unknown: Unknown) -> Result<Vec<bool>> {
        check_finite("spheres", spheres)?;
        refuse("spheres", spheres, |&[_, _, _, radius]| radius < 0.0, "a radius of 0 or more")?;
        let size = self.voxel_size();
        self.collides(spheres, unknown, |&[x, y, z, radius]| {
            let centre = [x / size, y / size, z / size];
            Shape { low: centre, high: centre, radius: radius / size }
        })
    }

    /// Whether boxes along the world's axes meet an occupied voxel, or an unknown one where unknown counts as occupied;
    /// rows of x, y, z of the lowest corner and of the highest, metres.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the first row that is not finite or whose corners are the wrong way round; or if the
    /// device fails.
    pub fn collides_boxes(&self, boxes: &[[f64; 6]], unknown: Unknown) -> Result<Vec<bool>> {
        check_finite("boxes", boxes)?;
        let swapped = |corners: &[f64; 6]| (0..3).any(|a| corners[a] > corners[a + 3]);
        refuse("boxes", boxes, swapped, "the lowest corner first, then the highest")?;
        let size = self.voxel_size();
        self.collides(boxes, unknown, |corners| Shape {
            low: each(|a| corners[a] / size),
            high: each(|a| corners[a + 3] / size),
            radius: 0.0,
        })
    }

    fn collides<T: Sync>(&self, rows: &[T], unknown: Unknown, shape: impl Fn(&T) -> Shape + Sync) -> Result<Vec<bool>> {
        self.fetch()?;
        let (blocks, threshold, keys) = (Lookup::new(self, rows.len()), Threshold::of(self), OnceLock::new());
        let scene = Scene { blocks, threshold, unknown, keys };
        Ok(rows.par_iter().with_min_len(16).map(|row| scene.meets(&shape(row))).collect())
    }
}

fn refuse<const N: usize>(
    name: &'static str,
    rows: &[[f64; N]],
    bad: impl Fn(&[f64; N]) -> bool + Sync,
    expected: &str,
) -> Result<()> {
    match first_row(rows, bad) {
        None => Ok(()),
        Some(row) => {
            Err(Error::Parameter { name, got: format!("{:?} in row {row}", rows[row]), expected: expected.into() })
        }
    }
}

const EDGE: i32 = BLOCK_EDGE as i32;

/// What shapes may meet.
struct Scene<'a> {
    blocks: Lookup<'a, OccupancyGrid>,
    threshold: Threshold,
    unknown: Unknown,
    /// Of all blocks, once a shape is larger than the map.
    keys: OnceLock<Vec<BlockKey>>,
}

impl Scene<'_> {
    fn meets(&self, shape: &Shape) -> bool {
        // Where unknown counts as occupied, the first block that is not there settles it.
        if self.unknown == Unknown::Free && shape.num_blocks() > Self::MANY_BLOCKS {
            let keys = self.keys.get_or_init(|| self.blocks.keys());
            if shape.num_blocks() > keys.len() as u64 {
                return keys.iter().any(|&key| self.meets_within(shape, voxels(key)));
            }
        }
        self.meets_within(shape, [[i32::MIN; 3], [i32::MAX; 3]])
    }

    fn meets_within(&self, shape: &Shape, within: [VoxelIndex; 2]) -> bool {
        shape.any_row(EDGE, within, |x, y, mut row| row.any(|z| self.blocked(shape, [x, y, z])))
    }

    /// A shape that may meet more blocks than this is worth a look at how many there are.
    const MANY_BLOCKS: u64 = 512;

    /// Whether a shape meets anything in a block that it meets.
    fn blocked(&self, shape: &Shape, key: BlockKey) -> bool {
        let blocked = |evidence| self.threshold.blocked(evidence, self.unknown);
        match self.blocks.block(key).unwrap_or(Block::Uniform(0)) {
            Block::Uniform(evidence) => blocked(evidence),
            block => shape.any_row(1, voxels(key), |x, y, row| {
                let (_, first) = locate([x, y, *row.start()]);
                (first..=first + (row.end() - row.start()) as usize).any(|offset| blocked(block.value(offset)))
            }),
        }
    }
}

/// The first and the last voxel of a block.
fn voxels(key: BlockKey) -> [VoxelIndex; 2] {
    [each(|a| key[a] * EDGE), each(|a| key[a] * EDGE + EDGE - 1)]
}

/// All points within a radius of a box, in units of voxels: a ball where the box is a point, a box where the radius is 0.
struct Shape {
    low: [f64; 3],
    high: [f64; 3],
    radius: f64,
}

impl Shape {
    /// Whether `test` holds for any row along z of the cubes of `edge` voxels that the shape meets; only those are asked
    /// that reach into a box, which is given by its first and last voxels. No others are visited, however large the
    /// shape.
    fn any_row(
        &self,
        edge: i32,
        within: [VoxelIndex; 2],
        test: impl Fn(i32, i32, RangeInclusive<i32>) -> bool,
    ) -> bool {
        let most = self.radius * self.radius;
        let cells = |axis: usize, used: f64| {
            let [low, high] = self.reach(axis, used);
            let (first, last) = (low.max(within[0][axis]), high.min(within[1][axis]));
            // Divided, an empty range might become one cell.
            (first <= last).then(|| first.div_euclid(edge)..=last.div_euclid(edge))
        };
        // The squared distance between the box and a layer of cells.
        let gap = |axis: usize, cell: i32| {
            let low = f64::from(cell) * f64::from(edge);
            let gap = (low - self.high[axis]).max(self.low[axis] - (low + f64::from(edge))).max(0.0);
            gap * gap
        };
        cells(0, 0.0).into_iter().flatten().any(|x| {
            let used = gap(0, x);
            used <= most
                && cells(1, used).into_iter().flatten().any(|y| {
                    let used = used + gap(1, y);
                    used <= most && cells(2, used).is_some_and(|row| test(x, y, row))
                })
        })
    }

    /// The first and the last voxel of an axis that the shape reaches where the squared distance on other axes is given.
    fn reach(&self, axis: usize, used: f64) -> [i32; 2] {
        let radius = (self.radius * self.radius - used).sqrt();
        [floor(self.low[axis] - radius), floor(self.high[axis] + radius)]
    }

    /// How many blocks the box around the shape meets.
    fn num_blocks(&self) -> u64 {
        let along = |axis: usize| {
            let [low, high] = self.reach(axis, 0.0);
            (i64::from(high.div_euclid(EDGE)) - i64::from(low.div_euclid(EDGE)) + 1) as u64
        };
        (0..3).map(along).fold(1, u64::saturating_mul)
    }
}
