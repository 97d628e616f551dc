//! Rays through a map: how far one can look, or move, until something is in the way.
//!
//! A ray goes from block to block; only where a block holds something in the box around the ray's way through it does
//! it go voxel by voxel. The voxel that stops it is the one that plain stepping would find (see the module `ray`).

use crate::block::{BLOCK_EDGE, Block, BlockKey, Blocks, VoxelIndex, locate, voxel_offset};
use crate::error::{Error, Result};
use crate::grid::OccupancyGrid;
use crate::mask::Mask;
use crate::ray::{Place, Ray, each};
use crate::state::{State, Threshold, Unknown};
use crate::window::{Window, bounds};
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
    /// # Arguments
    /// * `origins` - world points, metres, within 2^31 voxels
    /// * `directions` - one for each origin, of any length but zero
    /// * `max_range` - metres, positive, possibly infinite; voxels that are entered beyond it do not count
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the first row that is not finite, too far away, or zero; or if there are not as many
    /// directions as origins, or `max_range` is not positive.
    pub fn cast_rays(
        &self,
        origins: &[[f64; 3]],
        directions: &[[f64; 3]],
        max_range: f64,
        unknown: Unknown,
    ) -> Result<RayHits> {
        cast_rays(self, origins, directions, max_range, unknown)
    }
}

/// As [`OccupancyGrid::cast_rays`], through any map.
///
/// # Errors
/// As [`OccupancyGrid::cast_rays`]; or if the blocks cannot be read.
pub fn cast_rays(
    blocks: &(impl Blocks + ?Sized),
    origins: &[[f64; 3]],
    directions: &[[f64; 3]],
    max_range: f64,
    unknown: Unknown,
) -> Result<RayHits> {
    check(blocks.voxel_size(), origins, directions, max_range)?;
    blocks.fetch()?;
    let caster = Caster::new(blocks, max_range, unknown);
    Ok(match Window::new(blocks, origins.len(), |block| caster.obstacles(block).mask()) {
        Some(window) => caster.cast_all(|key| window.get(key).copied(), origins, directions),
        None => caster.cast_all(|key| Some(caster.obstacles(blocks.block(key)?)), origins, directions),
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
    let far = |origin: &[f64; 3]| !origin.iter().all(|c| c.abs() < limit);
    let aimless = |direction: &[f64; 3]| !direction.iter().all(|c| c.is_finite()) || *direction == [0.0; 3];
    let rays = origins.par_iter().zip(directions).with_min_len(4096);
    match rays.position_first(|(origin, direction)| far(origin) || aimless(direction)) {
        None => Ok(()),
        Some(row) if far(&origins[row]) => {
            let expected = format!("finite coordinates within {limit} m");
            refuse("origins", format!("{:?} in row {row}", origins[row]), expected)
        }
        Some(row) => {
            let expected = "finite vectors of any length but zero".into();
            refuse("directions", format!("{:?} in row {row}", directions[row]), expected)
        }
    }
}

/// What the rays of one call have in common.
struct Caster<'a, B: ?Sized> {
    blocks: &'a B,
    threshold: Threshold,
    unknown: Unknown,
    /// In voxels.
    max_range: f64,
    voxel_size: f64,
}

const EDGE: i32 = BLOCK_EDGE as i32;

impl<'a, B: Blocks + ?Sized> Caster<'a, B> {
    fn new(blocks: &'a B, max_range: f64, unknown: Unknown) -> Self {
        let voxel_size = blocks.voxel_size();
        Self { blocks, threshold: Threshold::of(blocks), unknown, max_range: max_range / voxel_size, voxel_size }
    }

    fn obstacles<'b>(&self, block: Block<'b>) -> Obstacles<'b> {
        Obstacles { block, threshold: self.threshold, unknown: self.unknown }
    }

    /// All rays; `find` gives a block's voxels that stop rays, `None` where there is no block.
    fn cast_all<S: Stops>(
        &self,
        find: impl Fn(BlockKey) -> Option<S> + Sync,
        origins: &[[f64; 3]],
        directions: &[[f64; 3]],
    ) -> RayHits {
        // Where unknown space lets rays pass they would go on for ever beyond the last block.
        let bounds = match self.unknown {
            Unknown::Occupied => None,
            Unknown::Free => Some(bounds(&self.blocks.keys()).unwrap_or([[0; 3], [-1; 3]])),
        };
        let cast = |(origin, direction): (&[f64; 3], &[f64; 3])| {
            let ray = Ray::new(each(|a| origin[a] / self.voxel_size), *direction);
            match bounds {
                None => self.cast(&find, |_| true, &ray, ray.start()),
                Some([low, high]) => {
                    let start = ray.enter(low.map(|k| k * EDGE), high.map(|k| k * EDGE + EDGE - 1))?;
                    let inside = |key: BlockKey| (0..3).all(|a| low[a] <= key[a] && key[a] <= high[a]);
                    self.cast(&find, inside, &ray, start)
                }
            }
        };

        let count = origins.len();
        let mut hits =
            RayHits { distance: vec![0.0; count], state: vec![State::Free; count], voxel: vec![NO_VOXEL; count] };
        let out = hits.distance.par_iter_mut().zip(&mut hits.state).zip(&mut hits.voxel);
        let rays = origins.par_iter().zip(directions).with_min_len(64);
        out.zip(rays).for_each(|(((distance, state), voxel), ray)| match cast(ray) {
            None => *distance = f64::INFINITY,
            Some(place) => {
                *distance = place.distance * self.voxel_size;
                *state = self.state(place.voxel);
                *voxel = place.voxel;
            }
        });
        hits
    }

    /// Goes from a place on, over blocks, as long as they are inside.
    #[inline(always)]
    fn cast<S: Stops>(
        &self,
        find: impl Fn(BlockKey) -> Option<S>,
        inside: impl Fn(BlockKey) -> bool,
        ray: &Ray,
        mut place: Place,
    ) -> Option<Place> {
        let block = |voxel: VoxelIndex| each(|a| voxel[a] >> EDGE.ilog2());
        let mut key = block(place.voxel);
        while place.distance <= self.max_range && inside(key) {
            let low = each(|a| key[a] * EDGE);
            let left = ray.leave(low, EDGE);
            match find(key) {
                None if self.unknown == Unknown::Occupied => return Some(place),
                Some(stops) if in_way(&stops, low, place.voxel, left.voxel) => {
                    if let Some(place) = walk(ray, place, low, &stops) {
                        return (place.distance <= self.max_range).then_some(place);
                    }
                }
                _ => {}
            }
            place = left;
            key = block(place.voxel);
        }
        None
    }

    fn state(&self, voxel: VoxelIndex) -> State {
        match self.unknown {
            Unknown::Free => State::Occupied,
            Unknown::Occupied => {
                let (key, offset) = locate(voxel);
                self.threshold.state(self.blocks.block(key).map_or(0, |block| block.value(offset)))
            }
        }
    }
}

/// The voxels of a block that stop rays.
trait Stops {
    /// Whether any voxel of a box may; both corners, in coordinates of the block, belong to it.
    fn any_in(&self, low: [usize; 3], high: [usize; 3]) -> bool;
    /// Whether the voxel at an offset does.
    fn contains(&self, offset: usize) -> bool;
}

/// Taken out of the block, which is worth while for many rays.
impl Stops for Mask {
    #[inline(always)]
    fn any_in(&self, low: [usize; 3], high: [usize; 3]) -> bool {
        Mask::any_in(self, low, high)
    }

    #[inline(always)]
    fn contains(&self, offset: usize) -> bool {
        Mask::contains(*self, offset)
    }
}

/// As they are in the block.
struct Obstacles<'a> {
    block: Block<'a>,
    threshold: Threshold,
    unknown: Unknown,
}

impl Obstacles<'_> {
    fn mask(&self) -> Mask {
        Mask::of(&self.block, |evidence| self.threshold.blocked(evidence, self.unknown))
    }
}

impl Stops for Obstacles<'_> {
    fn any_in(&self, _: [usize; 3], _: [usize; 3]) -> bool {
        // To look is as dear as to go there.
        !matches!(self.block, Block::Uniform(_)) || self.contains(0)
    }

    fn contains(&self, offset: usize) -> bool {
        self.threshold.blocked(self.block.value(offset), self.unknown)
    }
}

/// Whether a voxel that stops rays lies in the box around a way through a block, from a voxel of it to one beyond.
#[inline(always)]
fn in_way(stops: &impl Stops, low: VoxelIndex, from: VoxelIndex, to: VoxelIndex) -> bool {
    let from = each(|a| from[a] - low[a]);
    let to = each(|a| (to[a] - low[a]).clamp(0, EDGE - 1));
    stops.any_in(each(|a| from[a].min(to[a]) as usize), each(|a| from[a].max(to[a]) as usize))
}

/// Goes through a block voxel by voxel: the first that stops the ray.
#[inline(always)]
fn walk(ray: &Ray, mut place: Place, low: VoxelIndex, stops: &impl Stops) -> Option<Place> {
    loop {
        let at = each(|a| (place.voxel[a] - low[a]) as usize);
        if (at[0] | at[1] | at[2]) >= BLOCK_EDGE {
            return None;
        }
        if stops.contains(voxel_offset(at[0], at[1], at[2])) {
            return Some(place);
        }
        place = ray.leave(place.voxel, 1);
    }
}
