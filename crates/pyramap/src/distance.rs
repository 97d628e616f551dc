//! The distance field: how far each voxel is from the nearest obstacle, kept up to date as the map grows.
//!
//! What is measured is the exact Euclidean distance between the centres of voxels. A voxel that is not occupied has the
//! distance to the nearest occupied one, an occupied voxel that to the nearest one that is not, with a minus sign. So the
//! voxels on either side of a surface have `+r` and `-r` for a voxel size `r`, and trilinear interpolation finds 0 on the
//! face between them. Beyond `max_distance` all is cut off at it. Unknown voxels count as free, or as occupied.
//!
//! An update runs through these stages:
//!
//! `sides` (which voxels changed from one side to the other) → `tiles` (which blocks hold distances) → `sweep`, once
//! along each axis (the distances, by `line`) → `tiles` again (those no longer needed go)
//!
//! Each sweep computes the lines that the one before touched, and only as far as the change reaches. Squared distances in
//! voxels are whole numbers, so the result has the same bits as a field made anew.

mod line;
mod questions;
mod reach;
mod sides;
mod sweep;
mod tile;
mod tiles;

use crate::block::Blocks;
use crate::error::{Error, Result};
use crate::state::Unknown;
use reach::Reach;
use tiles::Tiles;

/// Signed distances to the nearest occupied voxel, up to a largest one.
///
/// ```
/// use pyramap::{Depth, DepthImage, DistanceField, GridConfig, Interpolation, OccupancyGrid, PinholeCamera, Pose, Unknown};
///
/// let camera = PinholeCamera::new(64, 48, 58.5, 58.5, 31.5, 23.5)?;
/// let wall = vec![2.0; 64 * 48]; // metres
/// let mut grid = OccupancyGrid::new(GridConfig::new(0.05)?)?;
/// let mut field = DistanceField::new(&grid, 1.0, Unknown::Free)?;
/// grid.integrate(&DepthImage::new(Depth::F32(&wall), 64, 48)?, &camera, &Pose::identity())?;
/// field.update(&grid)?;
///
/// let distance = field.distance(&[[0.0, 0.0, 1.5]], Interpolation::Trilinear)?[0];
/// assert!((0.4..0.6).contains(&distance));
/// # Ok::<(), pyramap::Error>(())
/// ```
pub struct DistanceField {
    voxel_size: f64,
    max_distance: f64,
    unknown: Unknown,
    reach: Reach,
    tiles: Tiles,
    /// Metres of every squared distance in voxels up to that which is beyond reach.
    metres: Vec<f32>,
}

impl DistanceField {
    /// The field of a map as it is now.
    ///
    /// # Arguments
    /// * `max_distance` - metres, 1 to 254 voxels
    /// * `unknown` - what unknown voxels count as
    ///
    /// # Errors
    /// [`Error::Parameter`] if `max_distance` is out of its range; or if a device fails to give its map.
    pub fn new(blocks: &(impl Blocks + ?Sized), max_distance: f64, unknown: Unknown) -> Result<Self> {
        let voxel_size = blocks.voxel_size();
        let reach = Reach::new(max_distance, voxel_size)?;
        let metres = |squared| (voxel_size * f64::from(squared).sqrt()).min(max_distance) as f32;
        let metres = (0..reach.beyond()).map(metres).chain([max_distance as f32]).collect();
        let mut field = Self { voxel_size, max_distance, unknown, reach, tiles: Tiles::new(reach), metres };
        field.update(blocks)?;
        Ok(field)
    }

    /// Follows what has changed in the map since the last update. It is then as if made anew; it costs what the change
    /// reaches, and a look at each block.
    ///
    /// Returns how many voxels have become occupied or ceased to be, as unknown voxels count.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if the map is of another voxel size; or if a device fails to give its map.
    pub fn update(&mut self, blocks: &(impl Blocks + ?Sized)) -> Result<usize> {
        if blocks.voxel_size() != self.voxel_size {
            let reason = format!("the field's voxel size is {}, the map's {}", self.voxel_size, blocks.voxel_size());
            return Err(Error::Unsupported { operation: "update", reason });
        }
        blocks.fetch()?;
        let changes = sides::changes(blocks, &self.tiles, self.unknown);
        let (changed, left) = self.tiles.apply(&changes);
        let touched = sweep::sweep::<0>(&mut self.tiles, &changed, self.reach);
        let touched = sweep::sweep::<1>(&mut self.tiles, &touched, self.reach);
        sweep::sweep::<2>(&mut self.tiles, &touched, self.reach);
        self.tiles.settle(&changed, &left);
        Ok(changes.iter().map(|change| change.count()).sum())
    }

    /// The largest distance, metres: whatever is farther away, or nowhere, is this far.
    pub fn max_distance(&self) -> f64 {
        self.max_distance
    }

    /// Edge of a voxel, metres.
    pub fn voxel_size(&self) -> f64 {
        self.voxel_size
    }

    /// What unknown voxels count as.
    pub fn unknown(&self) -> Unknown {
        self.unknown
    }

    /// Blocks that hold distances: those within `max_distance` of a border between occupied and other voxels.
    pub fn num_blocks(&self) -> usize {
        self.tiles.len()
    }

    /// Bytes that the field takes.
    pub fn nbytes(&self) -> usize {
        self.tiles.nbytes()
    }
}

#[cfg(test)]
mod tests;
