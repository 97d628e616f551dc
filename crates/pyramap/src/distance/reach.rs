//! How far a distance field reaches, in whole numbers.

use crate::block::{BLOCK_EDGE, BlockKey};
use crate::error::{Error, Result};

/// The largest radius in voxels: the square of the next one, and what a pass adds to it, still fit 16 bits.
pub const MAX_RADIUS: usize = 254;

/// The largest squared distance that counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    max_squared: u16,
}

impl Reach {
    /// That of a distance in metres.
    pub fn new(max_distance: f64, voxel_size: f64) -> Result<Self> {
        let limit = MAX_RADIUS as f64;
        let voxels = max_distance / voxel_size;
        if !(1.0..=limit).contains(&voxels) {
            let (got, highest) = (format!("{max_distance}"), limit * voxel_size);
            let expected = format!("{voxel_size} to {highest} metres, 1 to {MAX_RADIUS} voxels");
            return Err(Error::Parameter { name: "max_distance", got, expected });
        }
        Ok(Self { max_squared: (voxels * voxels).floor() as u16 })
    }

    /// In voxels along an axis.
    #[inline]
    pub fn radius(self) -> usize {
        self.max_squared.isqrt().into()
    }

    /// What stands for every squared distance that is too large to count.
    #[inline]
    pub fn beyond(self) -> u16 {
        self.max_squared + 1
    }

    /// Blocks along an axis, either way, that a change in one must read: its reach, and that of what it reaches.
    pub fn blocks_read(self) -> i32 {
        (2 * self.radius()).div_ceil(BLOCK_EDGE) as i32
    }

    /// From a block to all blocks, itself included, that have a voxel within reach of one of its own.
    pub fn ball(self) -> Vec<BlockKey> {
        let blocks = self.radius().div_ceil(BLOCK_EDGE) as i32;
        let gap = |blocks: i32| match blocks.unsigned_abs() as usize {
            0 => 0,
            blocks => (blocks - 1) * BLOCK_EDGE + 1,
        };
        let all = || -blocks..=blocks;
        let cube = all().flat_map(|x| all().flat_map(move |y| all().map(move |z| [x, y, z])));
        cube.filter(|at| at.map(|c| gap(c).pow(2)).iter().sum::<usize>() <= self.max_squared.into()).collect()
    }
}
