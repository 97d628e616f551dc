//! Axis-aligned boxes of the world, and the voxels that lie in them.

use crate::block::{BLOCK_EDGE, BlockKey, MAX_BLOCK, VoxelIndex};
use crate::error::{Error, Result};
use std::ops::Range;

/// A box along the world's axes. A voxel belongs to it if its centre lies in `[low, high)` on every axis, so that boxes
/// which share a face share no voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    low: [f64; 3],
    high: [f64; 3],
}

impl Region {
    /// The box between two corners, metres; a coordinate may be infinite.
    ///
    /// # Errors
    /// [`Error::Parameter`] unless `low` is below `high` on every axis.
    pub fn new(low: [f64; 3], high: [f64; 3]) -> Result<Self> {
        if low.iter().zip(&high).all(|(low, high)| low < high) {
            return Ok(Self { low, high });
        }
        Err(Error::Parameter {
            name: "region",
            got: format!("{low:?} to {high:?}"),
            expected: "a low corner below the high one on every axis, metres".into(),
        })
    }

    /// The voxels that belong to the box.
    pub(crate) fn voxels(&self, voxel_size: f64) -> VoxelBox {
        let first = |bound: f64| first_from(bound, voxel_size);
        VoxelBox { low: self.low.map(first), high: self.high.map(first) }
    }
}

/// The first voxel along an axis whose centre lies at `bound` or above, as far as there are voxels.
fn first_from(bound: f64, voxel_size: f64) -> i32 {
    let limit = (MAX_BLOCK as i32 + 1) * BLOCK_EDGE as i32;
    let near = (bound / voxel_size - 0.5).ceil().clamp(f64::from(-limit), f64::from(limit)) as i32;
    // The quotient is rounded: it may be one voxel off where a centre lies on the bound.
    let below = |index: i32| (f64::from(index) + 0.5) * voxel_size < bound;
    if near < limit && below(near) {
        near + 1
    } else if near > -limit && !below(near - 1) {
        near - 1
    } else {
        near
    }
}

/// A box of voxels: `low <= index < high` on every axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct VoxelBox {
    pub low: VoxelIndex,
    pub high: VoxelIndex,
}

/// How much of a block lies in a box.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Overlap {
    /// Nothing.
    None,
    /// The voxels whose coordinates within the block are in these ranges.
    Part([Range<usize>; 3]),
    /// Everything.
    Whole,
}

impl VoxelBox {
    /// How much of a block lies in this box.
    pub fn overlap(&self, key: BlockKey) -> Overlap {
        let edge = BLOCK_EDGE as i32;
        let part = std::array::from_fn(|axis| {
            let within = |index: i32| index.saturating_sub(key[axis] * edge).clamp(0, edge) as usize;
            within(self.low[axis])..within(self.high[axis])
        });
        match &part {
            part if part.iter().any(Range::is_empty) => Overlap::None,
            part if part.iter().all(|range| range.len() == BLOCK_EDGE) => Overlap::Whole,
            _ => Overlap::Part(part),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_voxel_belongs_where_its_centre_is() {
        // Bounds on centres, on faces, and a hair beside both; sizes that are no binary fractions.
        for voxel_size in [0.05, 0.1, 0.125, 1.0 / 3.0, 7.3] {
            for index in (-40..40).chain([1_000_003, -1_000_003]) {
                for place in [0.0, 0.5] {
                    let bound = (f64::from(index) + place) * voxel_size;
                    for bound in [bound.next_down(), bound, bound.next_up()] {
                        let centre = |i: i32| (f64::from(i) + 0.5) * voxel_size;
                        let naive = (index - 2..index + 3).find(|&i| centre(i) >= bound).unwrap();
                        assert_eq!(first_from(bound, voxel_size), naive, "{bound} in voxels of {voxel_size}");
                    }
                }
            }
        }
    }

    #[test]
    fn boxes_may_be_endless() {
        let all = Region::new([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]).unwrap().voxels(0.05);
        let far = MAX_BLOCK as i32;
        for key in [[0, 0, 0], [far, -far, far], [-far, far, 0]] {
            assert_eq!(all.overlap(key), Overlap::Whole);
        }
        let high = Region::new([-1e300; 3], [1e300, 1e300, 0.05]).unwrap().voxels(0.05);
        assert_eq!(high.overlap([far, -far, 0]), Overlap::Part([0..8, 0..8, 0..1]));
        assert_eq!(high.overlap([0, 0, 1]), Overlap::None);
    }

    #[test]
    fn boxes_without_an_inside_are_refused() {
        for (low, high) in [([0.0; 3], [1.0, 0.0, 1.0]), ([2.0; 3], [1.0; 3]), ([f64::NAN, 0.0, 0.0], [1.0; 3])] {
            let error = Region::new(low, high).unwrap_err();
            assert!(matches!(error, Error::Parameter { name: "region", .. }), "{error}");
        }
    }
}
