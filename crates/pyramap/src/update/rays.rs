//! One ray a point, as OctoMap has it: voxels that a ray passes are free, the one in which it ends is occupied.
//!
//! It is here to compare with, and to go on with OctoMap's maps. The map's sensor model is not asked; a hit and a miss are
//! worth what they are in OctoMap. In each scan a voxel is updated once, and one that was hit is not missed. A return
//! from beyond the range frees what lies within.
//!
//! Rays visit the voxels that OctoMap's `computeRayKeys` visits, a digital differential analyzer after Amanatides and
//! Woo. To the voxel this needs its arithmetic too: `f32` and `f64` where it has them. In `f32` a point is known to a
//! 512th of a voxel as far as OctoMap's keys reach, and the rule goes no farther.

use super::{Change, summary};
use crate::block::{BLOCK_VOXELS, BlockData, BlockKey, VoxelIndex, locate};
use crate::config::GridConfig;
use crate::error::{Error, Result};
use crate::log_odds;
use crate::mask::Mask;
use crate::pose::Pose;
use crate::ranges::{BeyondMaxRange, Ranges};
use crate::sensors::{PixelRay, Sensor};
use hashbrown::HashMap;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Probability of being occupied after one hit.
pub const HIT: f64 = 0.7;
/// Probability of being occupied after one miss.
pub const MISS: f64 = 0.4;
/// OctoMap numbers voxels with so many bits an axis.
pub const KEY_BITS: u32 = 16;
/// How far from the origin a voxel may be, in voxels.
pub const REACH: i32 = 1 << (KEY_BITS - 1);

/// A point in the world, metres.
type Point = [f32; 3];

/// The rays of one frame.
#[derive(Debug)]
pub struct Scan {
    rays: Vec<Ray>,
}

#[derive(Debug)]
struct Ray {
    start: Point,
    end: Point,
    /// Whether it ends at a surface.
    hit: bool,
}

impl Scan {
    /// The rays to what the pixels of an image measure.
    pub fn of_image(ranges: &Ranges, sensor: &Sensor, pose: &Pose, max_range: f64) -> Self {
        let rows = ranges.values.par_chunks(ranges.width).enumerate();
        let rays = rows.flat_map_iter(|(v, row)| {
            let measured = row.iter().enumerate().filter(|(_, range)| **range > 0.0);
            measured.map(move |(u, &range)| {
                let PixelRay { start, direction } = sensor.aligned_ray(u, v);
                let (start, along) = (pose.rotation * start + pose.translation, pose.rotation * direction);
                let end = start + along * f64::from(range).min(max_range);
                Ray { start: single(&start), end: single(&end), hit: range.is_finite() }
            })
        });
        Self { rays: rays.collect() }
    }

    /// The rays to points in the sensor's frame; those that are not finite say nothing.
    ///
    /// # Errors
    /// [`Error::Parameter`] if no point says anything.
    pub fn of_points(points: &[[f64; 3]], pose: &Pose, config: &GridConfig) -> Result<Self> {
        let start = single(&pose.translation);
        let ray = |point: &[f64; 3]| {
            let point = Vector3::from(*point);
            if !point.iter().all(|c| c.is_finite()) {
                return None;
            }
            let end = single(&(pose.rotation * point + pose.translation));
            match shortened(start, end, config.max_range) {
                None => Some(Ray { start, end, hit: true }),
                Some(end) => {
                    (config.beyond_max_range == BeyondMaxRange::Free).then_some(Ray { start, end, hit: false })
                }
            }
        };
        let rays: Vec<Ray> = points.par_iter().with_min_len(1024).filter_map(ray).collect();
        if rays.is_empty() {
            return Err(Error::Parameter {
                name: "points",
                got: format!("{} points that say nothing", points.len()),
                expected: "at least one of finite coordinates, and within max_range unless those beyond say free"
                    .into(),
            });
        }
        Ok(Self { rays })
    }

    /// Computes what the scan does to the blocks that it passes: their keys, and for each a change and increments.
    pub fn update(
        &self,
        voxel_size: f64,
        blocks: &mut Vec<BlockKey>,
        increments: &mut Vec<BlockData>,
        changes: &mut Vec<Change>,
    ) {
        let marked = self.marks(voxel_size);
        blocks.clear();
        blocks.extend(marked.keys());
        blocks.par_sort_unstable();
        increments.resize(blocks.len().max(increments.len()), [0; BLOCK_VOXELS]);
        changes.resize(blocks.len(), Change::None);
        let [hit, miss] = [HIT, MISS].map(|p| log_odds::to_fixed(log_odds::from_probability(p)));
        let each = blocks.par_iter().zip(&mut increments[..blocks.len()]).zip(changes);
        each.with_min_len(16).for_each(|((key, increments), change)| {
            marked[key].increments(hit, miss, increments);
            *change = summary(increments);
        });
    }

    /// The voxels that rays pass or end in, by block.
    fn marks(&self, voxel_size: f64) -> Marked {
        let marker = |mut marker: Marker, ray: &Ray| {
            traverse(ray.start, ray.end, voxel_size, |voxel| marker.mark(voxel, false));
            if ray.hit {
                marker.mark(voxel_of(ray.end, voxel_size), true);
            }
            marker
        };
        let parts = self.rays.par_iter().with_min_len(2048).fold(Marker::default, marker).map(Marker::finish);
        parts.reduce(Marked::new, |a, b| {
            let (mut more, less) = if a.len() < b.len() { (b, a) } else { (a, b) };
            less.into_iter().for_each(|(key, marks)| add(&mut more, key, marks));
            more
        })
    }
}

fn single(point: &Vector3<f64>) -> Point {
    [point.x as f32, point.y as f32, point.z as f32]
}

/// The length of a vector.
fn norm([x, y, z]: [f32; 3]) -> f64 {
    f64::from(x * x + y * y + z * z).sqrt()
}

fn difference(a: Point, b: Point) -> [f32; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

/// Where a ray leaves the range, if it does.
fn shortened(origin: Point, end: Point, max_range: f64) -> Option<Point> {
    let offset = difference(end, origin);
    let length = norm(offset);
    let along = |axis: usize| origin[axis] + offset[axis] / length as f32 * max_range as f32;
    (length > max_range).then(|| std::array::from_fn(along))
}

fn voxel_of(point: Point, voxel_size: f64) -> VoxelIndex {
    let voxels_per_metre = 1.0 / voxel_size;
    point.map(|c| (voxels_per_metre * f64::from(c)).floor() as i32)
}

/// Visits the voxels from that of `origin` up to, not including, that of `end`.
fn traverse(origin: Point, end: Point, voxel_size: f64, mut visit: impl FnMut(VoxelIndex)) {
    let (mut voxel, last) = (voxel_of(origin, voxel_size), voxel_of(end, voxel_size));
    if voxel == last {
        return;
    }
    visit(voxel);
    let offset = difference(end, origin);
    let length = norm(offset) as f32;
    let direction = offset.map(|c| c / length);
    let step = direction.map(|d| if d > 0.0 { 1 } else { -i32::from(d < 0.0) });
    // How far along the ray, in metres, it next crosses a face across each axis, and how far it goes between two.
    let (mut next, mut between) = ([f64::MAX; 3], [f64::MAX; 3]);
    for axis in (0..3).filter(|&axis| step[axis] != 0) {
        let centre = (f64::from(voxel[axis]) + 0.5) * voxel_size;
        let face = centre + f64::from((f64::from(step[axis]) * voxel_size * 0.5) as f32);
        next[axis] = (face - f64::from(origin[axis])) / f64::from(direction[axis]);
        between[axis] = voxel_size / f64::from(direction[axis].abs());
    }
    loop {
        let axis = nearest(&next);
        voxel[axis] += step[axis];
        next[axis] += between[axis];
        // Rounding errors add up, and may lead past the last voxel: the length of the ray ends it then.
        if voxel == last || next[nearest(&next)] > f64::from(length) {
            return;
        }
        visit(voxel);
    }
}

/// The axis whose face comes next; of several at once the last.
#[inline(always)]
fn nearest(next: &[f64; 3]) -> usize {
    let first = if next[0] < next[1] { 0 } else { 1 };
    if next[first] < next[2] { first } else { 2 }
}

/// What rays say of one block.
#[derive(Clone, Copy, Debug)]
struct Marks {
    passed: Mask,
    hit: Mask,
}

type Marked = HashMap<BlockKey, Marks>;

impl Default for Marks {
    fn default() -> Self {
        Self { passed: Mask::NONE, hit: Mask::NONE }
    }
}

impl Marks {
    fn and(self, other: Self) -> Self {
        Self { passed: self.passed | other.passed, hit: self.hit | other.hit }
    }

    fn increments(&self, hit: i32, miss: i32, out: &mut BlockData) {
        for (offset, out) in out.iter_mut().enumerate() {
            *out = if self.hit.contains(offset) {
                hit
            } else if self.passed.contains(offset) {
                miss
            } else {
                0
            };
        }
    }
}

fn add(marked: &mut Marked, key: BlockKey, more: Marks) {
    let marks = marked.entry(key).or_default();
    *marks = marks.and(more);
}

/// Gathers marks; those of the block where a ray is are at hand, since it stays there for some voxels.
#[derive(Default)]
struct Marker {
    marked: Marked,
    here: BlockKey,
    marks: Marks,
}

impl Marker {
    #[inline]
    fn mark(&mut self, voxel: VoxelIndex, hit: bool) {
        let (key, offset) = locate(voxel);
        if key != self.here {
            self.put_away();
            self.here = key;
        }
        let mask = if hit { &mut self.marks.hit } else { &mut self.marks.passed };
        mask.insert(offset);
    }

    fn put_away(&mut self) {
        let marks = std::mem::take(&mut self.marks);
        if !(marks.passed | marks.hit).is_empty() {
            add(&mut self.marked, self.here, marks);
        }
    }

    fn finish(mut self) -> Marked {
        self.put_away();
        self.marked
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EDGE: f64 = 0.125;

    fn visited(origin: Point, end: Point) -> Vec<VoxelIndex> {
        let mut voxels = Vec::new();
        traverse(origin, end, EDGE, |voxel| voxels.push(voxel));
        voxels
    }

    /// Whether a segment comes within a hair of a voxel.
    fn cuts(origin: Point, end: Point, voxel: VoxelIndex) -> bool {
        let (mut enter, mut leave) = (0.0f64, 1.0f64);
        for axis in 0..3 {
            let (from, along) = (f64::from(origin[axis]), f64::from(end[axis]) - f64::from(origin[axis]));
            let (low, high) = (f64::from(voxel[axis]) * EDGE - 1e-5, f64::from(voxel[axis] + 1) * EDGE + 1e-5);
            if along == 0.0 {
                if !(low..=high).contains(&from) {
                    return false;
                }
                continue;
            }
            let (a, b) = ((low - from) / along, (high - from) / along);
            (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
        }
        enter <= leave
    }

    #[test]
    fn a_ray_goes_from_voxel_to_voxel_up_to_its_end() {
        // A few hundred directions, by a sequence that fills the cube evenly, and every axis and diagonal.
        let spread =
            (0..400).map(|n| [0.819_172_5, 0.671_043_6, 0.549_700_5].map(|a: f32| (n as f32 * a).fract() - 0.5));
        let lattice = (0..27).map(|n| [n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1].map(|c| c as f32 / 4.0));
        for (n, direction) in spread.chain(lattice).enumerate() {
            let origin = [0.03, -0.4, 0.11 + n as f32 * 0.01];
            let end: Point = std::array::from_fn(|axis| origin[axis] + 8.0 * direction[axis]);
            let (first, last) = (voxel_of(origin, EDGE), voxel_of(end, EDGE));
            let mut way = visited(origin, end);
            assert!(!way.contains(&last));
            assert!(way.iter().all(|&voxel| cuts(origin, end, voxel)), "{origin:?} to {end:?}: {way:?}");
            way.push(last);
            assert_eq!(way[0], first);
            for step in way.windows(2) {
                let moved: i32 = (0..3).map(|axis| (step[1][axis] - step[0][axis]).abs()).sum();
                assert_eq!(moved, 1, "{origin:?} to {end:?}: {step:?}");
            }
        }
    }

    #[test]
    fn a_ray_within_a_voxel_passes_nothing() {
        assert!(visited([0.01, 0.02, 0.03], [0.1, 0.12, 0.001]).is_empty());
        assert!(visited([0.5; 3], [0.5; 3]).is_empty());
    }

    #[test]
    fn a_ray_ends_at_the_range() {
        assert_eq!(shortened([1.0, 2.0, 3.0], [1.0, 2.0, 7.0], 4.0), None);
        assert_eq!(shortened([1.0, 2.0, 3.0], [1.0, 2.0, 13.0], 4.0), Some([1.0, 2.0, 7.0]));
    }
}
