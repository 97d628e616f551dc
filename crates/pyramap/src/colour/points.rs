//! Questions at points: colours.

use super::Rgba;
use crate::block::Blocks;
use crate::error::{Error, Result};
use crate::grid::{OccupancyGrid, WITHOUT_COLOUR};
use crate::query::check_finite;
use crate::ray::{each, floor};
use rayon::prelude::*;

impl OccupancyGrid {
    /// The mean colours of the voxels that contain world points, metres. Whether a voxel is occupied plays no part: those
    /// just in front of a surface and just behind it have its colour too.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if the map was made without colour; [`Error::Parameter`] naming the first point that is not
    /// finite.
    pub fn colour(&self, points: &[[f64; 3]]) -> Result<Vec<Rgba>> {
        let Some(colours) = self.colours() else {
            return Err(Error::Unsupported { operation: "to ask for colour", reason: WITHOUT_COLOUR.into() });
        };
        check_finite("points", points)?;
        let voxel_size = self.voxel_size();
        let colour = |point: &[f64; 3]| colours.colour(each(|a| floor(point[a] / voxel_size)));
        Ok(points.par_iter().with_min_len(1024).map(colour).collect())
    }
}
