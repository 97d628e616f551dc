//! Rays through a map: how far one can look, or move, until something is in the way.
//!
//! Each ray goes from one cube of voxels that does not stop it to the next. A few rays find the cubes in the map: whole
//! blocks, or voxels. For many it pays to find out first how much room there is around every voxel (`clearance`), and to
//! keep that until the map changes (`kept`); then cubes are as large as can be, and many rays go at once (`lanes`). Either
//! way the voxel that stops a ray is the one that plain stepping would find, and the distance has the same bits (see the
//! module `ray`).

mod clearance;
mod kept;
mod lanes;

use crate::block::{BLOCK_EDGE, Block, BlockKey, Blocks, VoxelIndex, locate};
use crate::error::{Error, Result};
use crate::grid::OccupancyGrid;
use crate::mask::Mask;
use crate::query::first_row;
use crate::ray::{Place, Ray, each};
use crate::simd::Instructions;
use crate::state::{State, Threshold, Unknown};
use crate::window::bounds;
use clearance::Stops;
pub(crate) use kept::Kept;
use lanes::Lanes;
use rayon::prelude::*;

/// What stopped each ray: one entry a ray in each list.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RayHits {
    /// Metres from the origin to where the ray enters the voxel that stopped it: 0 if that voxel contains the origin,
    /// infinite if nothing stopped the ray.
    pub distance: Vec<f64>,
    /// What the map knows of that voxel: occupied or unknown; free, which stops no ray, if nothing did.
    pub state: Vec<State>,
    /// That voxel; [`NO_VOXEL`] if nothing stopped the ray.
    pub voxel: Vec<VoxelIndex>,
}

/// Stands for a voxel where there is none; no map reaches so far.
pub const NO_VOXEL: VoxelIndex = [i32::MIN; 3];

impl OccupancyGrid {
    /// Casts rays until an occupied voxel stops them, or an unknown one where unknown counts as occupied.
    ///
    /// A ray starts in the voxel that contains its origin, and enters every voxel of which it cuts a piece, however
    /// short; voxels that it only touches at an edge or a corner do not stop it. All beyond the map's blocks is unknown.
    ///
    /// Once so many rays were cast that it pays, how much room there is around each voxel is kept until the map changes:
    /// a byte a voxel, of all blocks and, where unknown counts as free, of their neighbours, for either way of counting.
    /// [`Self::nbytes`] does not count these.
    ///
    /// # Arguments
    /// * `origins` - world points, metres, within 2^31 voxels
    /// * `directions` - one for each origin, of any length but zero
    /// * `max_range` - metres, positive, possibly infinite; voxels that are entered beyond it do not count
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the first row that is not finite, too far away, or zero; or if there are not as many
    /// directions as origins, or `max_range` is not positive; or if the device fails.
    pub fn cast_rays(
        &self,
        origins: &[[f64; 3]],
        directions: &[[f64; 3]],
        max_range: f64,
        unknown: Unknown,
    ) -> Result<RayHits> {
        cast(self, &self.rays, origins, directions, max_range, unknown, Instructions::widest())
    }
}

/// As [`OccupancyGrid::cast_rays`], through any map; nothing is kept for the next call.
///
/// # Errors
/// As [`OccupancyGrid::cast_rays`].
pub fn cast_rays(
    blocks: &(impl Blocks + ?Sized),
    origins: &[[f64; 3]],
    directions: &[[f64; 3]],
    max_range: f64,
    unknown: Unknown,
) -> Result<RayHits> {
    cast(blocks, &Kept::default(), origins, directions, max_range, unknown, Instructions::widest())
}

fn cast(
    blocks: &(impl Blocks + ?Sized),
    kept: &Kept,
    origins: &[[f64; 3]],
    directions: &[[f64; 3]],
    max_range: f64,
    unknown: Unknown,
    instructions: Instructions,
) -> Result<RayHits> {
    let voxel_size = blocks.voxel_size();
    check(voxel_size, origins, directions, max_range)?;
    blocks.fetch()?;
    let threshold = Threshold::of(blocks);
    let space = Space { threshold, unknown, max_range: max_range / voxel_size, voxel_size, instructions };
    Ok(match kept.window(blocks, &space, origins.len()) {
        Some(window) => cast_chunks(origins, directions, Box::<Lanes>::default, |lanes, chunk| {
            lanes.cast(&space, window, chunk);
        }),
        None => {
            // Where unknown space lets rays pass they would go on for ever beyond the last block.
            let bounds = match unknown {
                Unknown::Occupied => [[i32::MIN / EDGE; 3], [i32::MAX / EDGE; 3]],
                Unknown::Free => bounds(&blocks.keys()).unwrap_or([[0; 3], [-1; 3]]),
            };
            cast_chunks(origins, directions, || (), |(), chunk| space.cast_each(blocks, bounds, chunk))
        }
    })
}

/// All that can be wrong with rays.
fn check(voxel_size: f64, origins: &[[f64; 3]], directions: &[[f64; 3]], max_range: f64) -> Result<()> {
    let refuse = |name, got, expected| Err(Error::Parameter { name, got, expected });
    if directions.len() != origins.len() {
        let expected = format!("{}, one for each of the origins", origins.len());
        return refuse("number of directions", directions.len().to_string(), expected);
    }
    if max_range.is_nan() || max_range <= 0.0 {
        return refuse("max_range", max_range.to_string(), "a positive number of metres".into());
    }
    // Voxels beyond have no index.
    let limit = -f64::from(i32::MIN) * voxel_size;
    let far = |origin: &[f64; 3]| origin.iter().fold(false, |far, c| far | (c.is_nan() | (c.abs() >= limit)));
    if let Some(row) = first_row(origins, far) {
        let expected = format!("finite coordinates within {limit} m");
        return refuse("origins", format!("{:?} in row {row}", origins[row]), expected);
    }
    let aimless = |direction: &[f64; 3]| {
        let largest = direction.iter().fold(0.0, |largest, c| if c.abs() > largest { c.abs() } else { largest });
        (largest == 0.0) | direction.iter().fold(false, |any, c| any | !c.is_finite())
    };
    if let Some(row) = first_row(directions, aimless) {
        let expected = "finite vectors of any length but zero".into();
        return refuse("directions", format!("{:?} in row {row}", directions[row]), expected);
    }
    Ok(())
}

/// Some of the rays, and where their hits go.
struct Chunk<'a> {
    origins: &'a [[f64; 3]],
    directions: &'a [[f64; 3]],
    distance: &'a mut [f64],
    state: &'a mut [State],
    voxel: &'a mut [VoxelIndex],
}

/// So many rays at a time: enough to make lanes worth while, few enough to stay in the processor's nearest cache. Not a
/// power of two, which would put all that is known of a ray into the same few lines of that cache.
const CHUNK: usize = 248;

/// Casts all rays, a chunk at a time, with what a thread needs for that.
fn cast_chunks<T>(
    origins: &[[f64; 3]],
    directions: &[[f64; 3]],
    tools: impl Fn() -> T + Send + Sync,
    cast: impl Fn(&mut T, Chunk) + Send + Sync,
) -> RayHits {
    let count = origins.len();
    let (mut distance, mut state) = (vec![f64::INFINITY; count], vec![State::Free; count]);
    let mut voxel = vec![NO_VOXEL; count];
    let rays = origins.par_chunks(CHUNK).zip(directions.par_chunks(CHUNK));
    let hits = distance.par_chunks_mut(CHUNK).zip(state.par_chunks_mut(CHUNK)).zip(voxel.par_chunks_mut(CHUNK));
    rays.zip(hits).with_min_len(4).for_each_init(
        tools,
        |tools, ((origins, directions), ((distance, state), voxel))| {
            cast(tools, Chunk { origins, directions, distance, state, voxel });
        },
    );
    RayHits { distance, state, voxel }
}

impl Chunk<'_> {
    fn set(&mut self, row: usize, space: &Space, place: Place, state: State) {
        self.distance[row] = place.distance * space.voxel_size;
        self.state[row] = state;
        self.voxel[row] = place.voxel;
    }
}

/// What all rays of a call have in common.
struct Space {
    threshold: Threshold,
    unknown: Unknown,
    /// In voxels.
    max_range: f64,
    voxel_size: f64,
    instructions: Instructions,
}

const EDGE: i32 = BLOCK_EDGE as i32;

impl Space {
    fn stops(&self, block: &Block) -> Stops {
        let all = Mask::of(block, |evidence| self.threshold.blocked(evidence, self.unknown));
        let occupied = match self.unknown {
            Unknown::Free => all,
            Unknown::Occupied => Mask::of(block, |evidence| self.threshold.state(evidence) == State::Occupied),
        };
        Stops { all, occupied }
    }

    #[inline(always)]
    fn ray(&self, origin: &[f64; 3], direction: &[f64; 3]) -> Ray {
        Ray::new(each(|a| origin[a] / self.voxel_size), *direction)
    }

    /// Where a ray begins that is asked for within blocks from `low` to `high` alone.
    #[inline(always)]
    fn start(&self, ray: &Ray, [low, high]: [BlockKey; 2]) -> Option<Place> {
        match self.unknown {
            Unknown::Occupied => Some(ray.start()),
            Unknown::Free => ray.enter(each(|a| low[a] * EDGE), each(|a| high[a] * EDGE + EDGE - 1)),
        }
    }

    /// One ray after the other, through the map as it is.
    fn cast_each(&self, blocks: &(impl Blocks + ?Sized), bounds: [BlockKey; 2], mut chunk: Chunk) {
        for row in 0..chunk.origins.len() {
            let ray = self.ray(&chunk.origins[row], &chunk.directions[row]);
            let place = self.start(&ray, bounds).and_then(|start| self.cast(blocks, bounds, &ray, start));
            if let Some((place, state)) = place {
                chunk.set(row, self, place, state);
            }
        }
    }

    fn cast(
        &self,
        blocks: &(impl Blocks + ?Sized),
        [low, high]: [BlockKey; 2],
        ray: &Ray,
        mut place: Place,
    ) -> Option<(Place, State)> {
        let mut key = locate(place.voxel).0;
        while (0..3).all(|a| (low[a]..=high[a]).contains(&key[a])) {
            let block = blocks.block(key).unwrap_or(Block::Uniform(0));
            // Through this block, voxel by voxel or as one.
            let here = key;
            while key == here {
                if place.distance > self.max_range {
                    return None;
                }
                let evidence = block.value(locate(place.voxel).1);
                if self.threshold.blocked(evidence, self.unknown) {
                    return Some((place, self.threshold.state(evidence)));
                }
                place = match block {
                    Block::Uniform(_) => ray.leave(key.map(|k| k * EDGE), EDGE),
                    _ => ray.leave(place.voxel, 1),
                };
                key = locate(place.voxel).0;
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::PinholeCamera;
    use crate::config::GridConfig;
    use crate::depth::{Depth, DepthImage};
    use crate::pose::Pose;

    /// Rays through a map, whatever instructions cast them: chunks that are full, one that is not, both kinds of unknown.
    #[test]
    fn every_set_of_instructions_finds_the_same() {
        let mut grid = OccupancyGrid::new(GridConfig::new(0.1).unwrap()).unwrap();
        let values: Vec<f32> = (0..64 * 48).map(|i| 1.0 + 0.02 * (i % 64) as f32 + 0.3 * (i / 640) as f32).collect();
        let image = DepthImage::new(Depth::F32(&values), 64, 48).unwrap();
        let camera = PinholeCamera::new(64, 48, 50.0, 50.0, 31.5, 23.5).unwrap();
        grid.integrate(&image, &camera, &Pose::identity()).unwrap();
        let turn = |n: usize, by: f64| (n as f64 * by).sin();
        let count = 20 * CHUNK + 3;
        let origins: Vec<_> =
            (0..count).map(|n| [0.3 * turn(n, 0.7), 0.3 * turn(n, 1.3), 0.8 + 0.5 * turn(n, 2.1)]).collect();
        let directions: Vec<_> = (0..count).map(|n| [turn(n, 3.1), turn(n, 0.17), 0.01 + turn(n, 5.3)]).collect();
        for unknown in [Unknown::Occupied, Unknown::Free] {
            let found = |instructions| {
                let hits = cast(&grid, &Kept::default(), &origins, &directions, 4.0, unknown, instructions).unwrap();
                (hits.distance.iter().map(|d| d.to_bits()).collect::<Vec<_>>(), hits.state, hits.voxel)
            };
            let expected = found(Instructions::widest());
            assert!(expected.1.contains(&State::Occupied), "no ray hits anything");
            for instructions in Instructions::all() {
                assert!(found(instructions) == expected, "{instructions:?}, {unknown:?}");
            }
        }
    }
}
