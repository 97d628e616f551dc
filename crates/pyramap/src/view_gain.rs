//! What a view would bring: the unknown volume that a camera would bring into sight, and how much less uncertain the map
//! would be.
//!
//! This is what the paper names as its next step, the suggestion of views within a probabilistic map. A ray through the
//! middle of each tile of pixels goes through the map until an occupied voxel stops it or it reaches the greatest range;
//! unknown voxels let it pass, so that the answer is the most that a view may bring, not what it will.
//!
//! **Volumes, not voxels, are counted.** The pixels' pyramids fill the frustum and do not overlap: a ray that is in a voxel
//! from depth `d_0` to `d_1` stands for `w h / (f_x f_y) (d_1^3 - d_0^3) / 3` of it, for a tile of `w x h` pixels. Thus
//! no voxel is counted twice, nor missed between two rays, one that is half in sight counts half, fewer rays only make
//! the answer rougher, and a block that nobody has seen is one step. A set of voxels visited would give none of that.
//!
//! **Entropy.** A voxel occupied with probability `p` has an entropy of `H(p) = -p log2 p - (1 - p) log2 (1 - p)` bits. One
//! reading adds `l_hit`, the log-odd of Eq. 7 at the surface, or `l_miss`, that in front of it. Just one binary sensor has
//! these log-likelihood ratios: with `P(hit | occupied) = e^l_hit P(hit | free)` and the same for misses,
//! `P(hit | free) = (1 - e^l_miss) / (e^l_hit - e^l_miss)`. What one reading of that sensor is expected to take off the
//! entropy, `H(p) - E[H(p after)]`, is the mutual information of voxel and reading, and never negative. What clamping
//! would forget again is not considered.

use crate::block::{BLOCK_EDGE, Block, Blocks, locate};
use crate::camera::PinholeCamera;
use crate::config::GridConfig;
use crate::error::{Error, Result};
use crate::grid::OccupancyGrid;
use crate::log_odds::{UNIT, to_probability};
use crate::pose::Pose;
use crate::ray::Ray;
use crate::sensor::{SensorModel, SensorTable};
use crate::state::{State, Threshold};
use crate::window::Lookup;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::iter::Sum;
use std::ops::Add;

/// What a view is expected to bring.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewGain {
    /// Unknown volume in sight, cubic metres.
    pub unknown_volume: f64,
    /// By how much the entropy of all voxels in sight is expected to fall, bits.
    pub entropy_reduction: f64,
}

impl Add for ViewGain {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            unknown_volume: self.unknown_volume + other.unknown_volume,
            entropy_reduction: self.entropy_reduction + other.entropy_reduction,
        }
    }
}

impl Sum for ViewGain {
    fn sum<I: Iterator<Item = Self>>(gains: I) -> Self {
        gains.fold(Self::default(), Add::add)
    }
}

impl OccupancyGrid {
    /// What a camera would bring at each of some poses, were it there alone.
    ///
    /// # Arguments
    /// * `max_range` - how far it sees, metres; `None`: as far as the map is updated
    /// * `stride` - rows and columns of pixels to a ray; `None`: as many as are at most one voxel apart at `max_range`
    ///
    /// # Errors
    /// [`Error::Parameter`] if `max_range` is not positive or more than [`GridConfig::MAX_VOXELS_IN_RANGE`], or `stride` is
    /// 0; [`Error::OutOfBounds`] if a camera could see beyond the coordinates of the map; and if the device fails.
    pub fn view_gain(
        &self,
        camera: &PinholeCamera,
        poses: &[Pose],
        max_range: Option<f64>,
        stride: Option<usize>,
    ) -> Result<Vec<ViewGain>> {
        let config = GridConfig { max_range: max_range.unwrap_or(self.config().max_range), ..self.config().clone() };
        let stride = stride.unwrap_or_else(|| voxel_stride(camera, &config));
        check(&config, poses, stride)?;
        self.fetch()?;

        let look = Look::new(self, &config, camera, stride);
        let rays = poses.len() * look.columns.len() * look.rows.len();
        Ok(look.views(&Lookup::new(self, rays), poses))
    }
}

/// Pixels to a voxel at the end of the range.
fn voxel_stride(camera: &PinholeCamera, config: &GridConfig) -> usize {
    ((camera.focal_length() * config.voxel_size / config.max_range) as usize).max(1)
}

fn check(config: &GridConfig, poses: &[Pose], stride: usize) -> Result<()> {
    let GridConfig { max_range, voxel_size, .. } = *config;
    let refuse = |name, got, expected| Err(Error::Parameter { name, got, expected });
    let most = GridConfig::MAX_VOXELS_IN_RANGE;
    if !(max_range > 0.0 && max_range <= most * voxel_size) {
        let expected = format!("more than 0 and at most {} m, {most} voxels", most * voxel_size);
        return refuse("max_range", format!("{max_range}"), expected);
    }
    if stride == 0 {
        return refuse("stride", "0".into(), "at least 1 pixel".into());
    }
    let limit = config.coordinate_limit();
    match poses.iter().flat_map(|pose| &pose.translation).find(|c| c.abs() > limit) {
        Some(&got) => Err(Error::OutOfBounds { what: "camera", got, limit, voxel_size }),
        None => Ok(()),
    }
}

/// What all views of one call have in common; lengths are in voxels.
struct Look<'a> {
    camera: &'a PinholeCamera,
    columns: Vec<Tile>,
    rows: Vec<Tile>,
    max_range: f64,
    voxel_size: f64,
    threshold: Threshold,
    information: Information,
}

/// Some neighbouring columns, or rows, of pixels.
struct Tile {
    middle: f64,
    width: f64,
}

/// All pixels from 0 to `count` in tiles; the last may be narrower.
fn tiles(count: usize, stride: usize) -> Vec<Tile> {
    let tile = |first: usize| {
        let width = stride.min(count - first) as f64;
        Tile { middle: first as f64 + 0.5 * (width - 1.0), width }
    };
    (0..count).step_by(stride).map(tile).collect()
}

impl<'a> Look<'a> {
    fn new(blocks: &OccupancyGrid, config: &GridConfig, camera: &'a PinholeCamera, stride: usize) -> Self {
        Self {
            camera,
            columns: tiles(camera.width, stride),
            rows: tiles(camera.height, stride),
            max_range: config.max_range / config.voxel_size,
            voxel_size: config.voxel_size,
            threshold: Threshold::of(blocks),
            information: Information::new(&config.sensor_model, blocks.prior_log_odds()),
        }
    }

    fn views(&self, blocks: &impl Blocks, poses: &[Pose]) -> Vec<ViewGain> {
        // By rows, so that all threads have work even for one pose; added up in order, so that threads change nothing.
        let count = self.rows.len();
        let row = |n: usize| self.row(blocks, &poses[n / count], &self.rows[n % count]);
        let rows: Vec<_> = (0..poses.len() * count).into_par_iter().map(row).collect();
        rows.chunks(count).map(|rows| rows.iter().copied().sum()).collect()
    }

    fn row(&self, blocks: &impl Blocks, pose: &Pose, row: &Tile) -> ViewGain {
        let (camera, position) = (self.camera, pose.translation / self.voxel_size);
        let ray = |column: &Tile| {
            let (u, v) = (column.middle, row.middle);
            let direction = Vector3::new((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0);
            let ray = Ray::new(position.into(), (pose.rotation * direction).into());
            // From distances along the ray to depths, and from depths to volume.
            let spread = column.width * row.width / (camera.fx * camera.fy * 3.0);
            self.along(blocks, &ray, spread / direction.norm().powi(3))
        };
        self.columns.iter().map(ray).sum()
    }

    /// What one ray meets; it stands for a volume of `spread d^3` up to a distance `d`.
    fn along(&self, blocks: &impl Blocks, ray: &Ray, spread: f64) -> ViewGain {
        let edge = BLOCK_EDGE as i32;
        let mut gain = ViewGain::default();
        let mut place = ray.start();
        let (mut key, _) = locate(place.voxel);
        let mut block = blocks.block(key);
        loop {
            let (entered, offset) = locate(place.voxel);
            if entered != key {
                (key, block) = (entered, blocks.block(entered));
            }
            let (evidence, next) = match block.unwrap_or(Block::Uniform(0)) {
                Block::Uniform(evidence) => (evidence, ray.leave(key.map(|k| k * edge), edge)),
                block => (block.value(offset), ray.leave(place.voxel, 1)),
            };
            // A block that is occupied throughout is seen one voxel deep.
            let state = self.threshold.state(evidence);
            let next = if state == State::Occupied { ray.leave(place.voxel, 1) } else { next };
            let end = next.distance.min(self.max_range);
            let voxels = spread * (end.powi(3) - place.distance.powi(3));
            gain.entropy_reduction += voxels * self.information.of(evidence);
            if state == State::Unknown {
                gain.unknown_volume += voxels * self.voxel_size.powi(3);
            }
            if state == State::Occupied || next.distance >= self.max_range {
                return gain;
            }
            place = next;
        }
    }
}

/// The information in bits that one reading is expected to give about a voxel, by the voxel's evidence: a table, for it is
/// asked of every voxel on every ray.
struct Information {
    /// For evidence from [`Self::FIRST`] on in steps of [`Self::STEP`].
    bits: Vec<f64>,
}

impl Information {
    /// Linear interpolation over steps of 2^-6 log-odds errs by h^2 / 8 max|I''| < 1e-5 bits.
    const STEP: i32 = 64;
    /// Beyond log-odds of +-32 what is left is less than 1e-11 bits: evidence counts as that much.
    const FIRST: i32 = -(32 << 12);

    fn new(model: &SensorModel, prior_log_odds: f64) -> Self {
        let table = SensorTable::new(model);
        let (hit, miss) = (f64::from(table.log_odds(0.0)), f64::from(table.free()));
        let bits = |evidence: i32| expected_information(prior_log_odds + f64::from(evidence) * UNIT, hit, miss);
        Self { bits: (0..=-2 * Self::FIRST / Self::STEP).map(|n| bits(Self::FIRST + n * Self::STEP)).collect() }
    }

    #[inline]
    fn of(&self, evidence: i32) -> f64 {
        let above = evidence.clamp(Self::FIRST, -Self::FIRST - 1) - Self::FIRST;
        let (n, part) = ((above / Self::STEP) as usize, f64::from(above % Self::STEP) / f64::from(Self::STEP));
        self.bits[n] + part * (self.bits[n + 1] - self.bits[n])
    }
}

/// `H(p) - E[H(p after)]`, bits, for a voxel of these log-odds and a reading that adds `hit` or `miss` to them.
fn expected_information(log_odds: f64, hit: f64, miss: f64) -> f64 {
    let occupied = to_probability(log_odds);
    let hit_if_free = (1.0 - libm::exp(miss)) / (libm::exp(hit) - libm::exp(miss));
    let hit_if_occupied = libm::exp(hit) * hit_if_free;
    let is_hit = hit_if_occupied * occupied + hit_if_free * (1.0 - occupied);
    let after = is_hit * entropy(log_odds + hit) + (1.0 - is_hit) * entropy(log_odds + miss);
    // What is nearly certain has hardly any information to give: a difference of equal numbers, rounded.
    (entropy(log_odds) - after).max(0.0)
}

/// `H(p)` of a log-odd, bits.
fn entropy(log_odds: f64) -> f64 {
    let p = to_probability(log_odds);
    let bits = |p: f64| if p > 0.0 { -p * libm::log2(p) } else { 0.0 };
    bits(p) + bits(1.0 - p)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn information(model: &SensorModel) -> Information {
        Information::new(model, 0.0)
    }

    #[test]
    fn unknown_voxels_tell_most() {
        // k = sigma: p = 0.89894 at the surface and 0.3 in front of it, so that a hit has the probability
        // (0.5 - 0.3) / (0.89894 - 0.3) of a voxel at 0.5, and 1 - 0.33392 H(0.89894) - 0.66608 H(0.3) bits are gained.
        let information = information(&SensorModel::constant(0.05).unwrap());
        let h = |p: f64| -(p * p.log2() + (1.0 - p) * (1.0 - p).log2());
        let (hit, miss) = (0.5 + 1.0 / (2.0 * std::f64::consts::PI).sqrt(), 0.3);
        let is_hit = (0.5 - miss) / (hit - miss);
        // The table of the sensor model is in f32.
        assert!((information.of(0) - (1.0 - is_hit * h(hit) - (1.0 - is_hit) * h(miss))).abs() < 1e-6);
    }

    #[test]
    fn what_is_certain_tells_nothing() {
        let information = information(&SensorModel::constant(0.05).unwrap());
        for evidence in [i32::MIN, i32::MAX, -(40 << 12), 40 << 12] {
            assert!((0.0..1e-11).contains(&information.of(evidence)), "{}", information.of(evidence));
        }
        let at: Vec<f64> = (-(10 << 12)..10 << 12).map(|evidence| information.of(evidence)).collect();
        assert!(at.iter().all(|&bits| bits > 0.0 && bits < 1.0));
        // It falls off to both sides of one maximum.
        let top = at.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
        assert!(at[..top].is_sorted() && at[top..].iter().rev().is_sorted());
    }

    #[test]
    fn the_table_follows_the_formula() {
        let model = SensorModel::new([0.01, 0.0, 0.0], Some(0.012), crate::SurfaceOffset::Centred).unwrap();
        let table = SensorTable::new(&model);
        let information = information(&model);
        for evidence in (-(12 << 12)..12 << 12).step_by(17) {
            let exact = expected_information(
                f64::from(evidence) * UNIT,
                f64::from(table.log_odds(0.0)),
                f64::from(table.free()),
            );
            assert!((information.of(evidence) - exact).abs() < 1e-5);
        }
    }

    #[test]
    fn tiles_cover_every_pixel_once() {
        for (count, stride) in [(10, 1), (10, 4), (10, 10), (10, 99), (1, 3)] {
            let tiles = tiles(count, stride);
            let mut first = -0.5;
            for tile in &tiles {
                assert_eq!(tile.middle - 0.5 * tile.width, first);
                first += tile.width;
            }
            assert_eq!(first, count as f64 - 0.5);
        }
    }
}
