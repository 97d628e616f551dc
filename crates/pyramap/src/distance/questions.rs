//! What is asked of a distance field: distances and gradients at points, and whole regions.

use super::DistanceField;
use crate::block::{BLOCK_EDGE, VoxelIndex, locate, voxel_offset};
use crate::dense::{Dense, room};
use crate::error::Result;
use crate::query::{Interpolation, check_finite};
use crate::region::{Region, VoxelBox};
use crate::state::Unknown;
use rayon::prelude::*;

impl DistanceField {
    /// Signed distances at world points, metres. Beyond the map all is as far from anything as unknown space is.
    ///
    /// # Errors
    /// [`Error::Parameter`](crate::Error::Parameter) naming the first point that is not finite.
    pub fn distance(&self, points: &[[f64; 3]], interpolation: Interpolation) -> Result<Vec<f32>> {
        let one = |point: &[f64; 3]| match interpolation {
            Interpolation::Nearest => self.voxel(self.in_voxels(point, 0.0).0),
            Interpolation::Trilinear => self.trilinear(point),
        };
        self.at(points, one)
    }

    /// Gradients of the trilinearly interpolated distance at world points: metres a metre along x, y and z.
    ///
    /// They point away from what is occupied, and are 0 where all around is cut off at `max_distance`. Across a surface
    /// the distance rises by two voxel sizes within one, so there the gradient's length is 2.
    ///
    /// # Errors
    /// As [`DistanceField::distance`].
    pub fn gradient(&self, points: &[[f64; 3]]) -> Result<Vec<[f32; 3]>> {
        self.at(points, |point| self.slope(point))
    }

    /// Signed distances of all voxels whose centres lie in a region, metres.
    ///
    /// # Errors
    /// [`Error::Parameter`](crate::Error::Parameter) if the region has more than
    /// [`MAX_DENSE_VOXELS`](crate::dense::MAX_DENSE_VOXELS), or more than there is memory for.
    pub fn dense(&self, region: &Region) -> Result<Dense> {
        let VoxelBox { low: first, high } = region.voxels(self.voxel_size);
        let shape @ [_, y, z] = std::array::from_fn(|a| high[a].abs_diff(first[a]) as usize);
        let mut values = room(shape)?;
        if !values.is_empty() {
            values.par_chunks_mut(z).enumerate().with_min_len(y.min(16)).for_each(|(row, values)| {
                self.row([first[0] + (row / y) as i32, first[1] + (row % y) as i32, first[2]], values);
            });
        }
        Ok(Dense { values, shape, first })
    }

    /// A row of voxels along z, a block at a time.
    fn row(&self, first: VoxelIndex, row: &mut [f32]) {
        let mut rest = row;
        let mut voxel = first;
        while !rest.is_empty() {
            let (key, offset) = locate(voxel);
            let count = (BLOCK_EDGE - offset % BLOCK_EDGE).min(rest.len());
            let (here, after) = rest.split_at_mut(count);
            match self.tiles.get(key) {
                Err(inside) => here.fill(self.signed(inside, self.reach.beyond())),
                Ok(tile) => {
                    here.iter_mut().enumerate().for_each(|(z, distance)| *distance = self.in_tile(tile, offset + z))
                }
            }
            rest = after;
            voxel[2] += count as i32;
        }
    }

    fn at<T: Send>(&self, points: &[[f64; 3]], answer: impl Fn(&[f64; 3]) -> T + Sync + Send) -> Result<Vec<T>> {
        check_finite("points", points)?;
        Ok(points.par_iter().with_min_len(1024).map(answer).collect())
    }

    /// The voxel that contains a point moved by so many voxels along each axis, and where in it the point lies, 0 to 1.
    /// Far beyond all maps it is the outermost one.
    fn in_voxels(&self, point: &[f64; 3], shift: f64) -> (VoxelIndex, [f64; 3]) {
        let limit = f64::from(i32::MAX / 2);
        let at = point.map(|c| (c / self.voxel_size + shift).clamp(-limit, limit));
        (at.map(|c| c.floor() as i32), at.map(|c| c - c.floor()))
    }

    fn voxel(&self, voxel: VoxelIndex) -> f32 {
        let (key, offset) = locate(voxel);
        match self.tiles.get(key) {
            Ok(tile) => self.in_tile(tile, offset),
            Err(inside) => self.signed(inside, self.reach.beyond()),
        }
    }

    fn trilinear(&self, point: &[f64; 3]) -> f32 {
        let (corners, [x, y, z]) = self.corners(point);
        let along_z: [f64; 4] = std::array::from_fn(|i| mix(corners[2 * i], corners[2 * i + 1], z));
        mix(mix(along_z[0], along_z[1], y), mix(along_z[2], along_z[3], y), x) as f32
    }

    fn slope(&self, point: &[f64; 3]) -> [f32; 3] {
        let (corners, at) = self.corners(point);
        std::array::from_fn(|axis| {
            // Of the corners' numbers, x is the highest bit and z the lowest.
            let bit = 4 >> axis;
            let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
            let rise = |corner: usize| corners[corner | bit] - corners[corner];
            let (next_b, next_c) = (4 >> b, 4 >> c);
            let rise = mix(mix(rise(0), rise(next_b), at[b]), mix(rise(next_c), rise(next_b | next_c), at[b]), at[c]);
            (rise / self.voxel_size) as f32
        })
    }

    /// The distances of the eight voxels whose centres surround a point, the last axis running fastest, and where the
    /// point lies between them.
    fn corners(&self, point: &[f64; 3]) -> ([f64; 8], [f64; 3]) {
        let (first, at) = self.in_voxels(point, -0.5);
        let (key, offset) = locate(first);
        let local = first.map(|i| i.rem_euclid(BLOCK_EDGE as i32) as usize);
        if local.iter().all(|&i| i + 1 < BLOCK_EDGE) {
            let corners = match self.tiles.get(key) {
                Ok(tile) => std::array::from_fn(|corner| {
                    let [x, y, z] = corner_steps(corner);
                    f64::from(self.in_tile(tile, offset + voxel_offset(x, y, z)))
                }),
                Err(inside) => [f64::from(self.signed(inside, self.reach.beyond())); 8],
            };
            return (corners, at);
        }
        let corner = |corner| {
            let steps = corner_steps(corner);
            f64::from(self.voxel(std::array::from_fn(|a| first[a] + steps[a] as i32)))
        };
        (std::array::from_fn(corner), at)
    }

    fn in_tile(&self, tile: &super::tile::Tile, offset: usize) -> f32 {
        let inside = tile.inside.contains(offset);
        self.signed(inside, tile.squared[2][offset])
    }

    /// Metres, negative if occupied.
    fn signed(&self, inside: bool, squared: u16) -> f32 {
        let metres = self.metres[usize::from(squared)];
        // Inside is what unknown space is not.
        if inside == (self.unknown == Unknown::Free) { -metres } else { metres }
    }
}

fn corner_steps(corner: usize) -> [usize; 3] {
    [corner >> 2 & 1, corner >> 1 & 1, corner & 1]
}

fn mix(from: f64, to: f64, at: f64) -> f64 {
    from + (to - from) * at
}
