//! What lies near a surface: the part of each pixel's ray, and the blocks that hold these parts.

use crate::block::{BLOCK_EDGE, BlockKey};
use crate::pose::Pose;
use crate::ranges::Ranges;
use crate::sensor::{SensorModel, SurfaceOffset};
use crate::sensors::Sensor;
use hashbrown::HashSet;
use nalgebra::Vector3;
use rayon::prelude::*;

/// The part of a ray on which voxels take the colour of the surface that the ray meets: where the reading speaks for
/// occupied space, and a voxel's diagonal in front of that.
///
/// The mesh of a map lies where log-odds are zero, between the centres of neighbouring voxels. For one reading that is
/// where the sensor model crosses zero, in front of the surface; neighbours across a surface that is seen at up to 55
/// degrees from straight on lie no further apart along the ray than the diagonal. At the edges of things the mesh goes
/// back along the rays, as far as the reading says anything.
#[derive(Clone, Copy)]
pub(super) struct Near {
    /// Where the model crosses zero, and from where on it says nothing: from the reading, as polynomials of it.
    crossing: [f32; 3],
    hidden: [f32; 3],
    diagonal: f32,
    /// Farther off no voxel is mapped.
    max_range: f32,
}

impl Near {
    /// For a sensor model; without one (the rule `Rays`) all is at the reading.
    pub fn new(model: Option<&SensorModel>, voxel_size: f64, max_range: f64) -> Self {
        let [crossing, hidden] = model.map_or([[0.0; 3]; 2], |model| {
            let (zero, end) = (model.zero_crossing(), model.cutoff());
            let from_reading = |sigmas: f64| match model.surface_offset() {
                SurfaceOffset::Centred => model.sigma().map(|s| (zero + sigmas) * s),
                SurfaceOffset::Metres(offset) => {
                    let [s0, s1, s2] = model.sigma().map(|s| sigmas * s);
                    [offset + s0, s1, s2]
                }
            };
            [from_reading(-zero), from_reading(end)].map(|polynomial| polynomial.map(|c| c as f32))
        });
        Self { crossing, hidden, diagonal: (3.0f64.sqrt() * voxel_size) as f32, max_range: max_range as f32 }
    }

    /// From which distance to which, for a reading that is one. The reading itself lies within, whatever the model.
    #[inline(always)]
    pub fn part(&self, reading: f32) -> [f32; 2] {
        let at = |[c0, c1, c2]: [f32; 3]| c0 + reading * (c1 + reading * c2);
        let (crossing, hidden) = (at(self.crossing), at(self.hidden));
        let before = if crossing < 0.0 { crossing } else { 0.0 };
        let behind = if hidden > self.diagonal { hidden } else { self.diagonal };
        let to = reading + behind;
        [reading + before - self.diagonal, if to < self.max_range { to } else { self.max_range }]
    }
}

/// The rays of a sensor's pixels, kept from frame to frame.
#[derive(Default)]
pub(super) struct PixelRays {
    rays: Vec<Ray>,
    /// Row by row.
    tiles: Vec<Tile>,
    /// Pixels along the side of a tile.
    edge: usize,
    made_for: Option<Sensor>,
}

/// A pixel's ray in the sensor's frame; its direction is a unit vector, or NaN for a pixel that sees nothing.
#[derive(Clone, Copy)]
struct Ray {
    start: [f32; 3],
    direction: [f32; 3],
}

impl Ray {
    #[inline(always)]
    fn at(&self, range: f32) -> [f32; 3] {
        std::array::from_fn(|axis| self.start[axis] + range * self.direction[axis])
    }
}

/// A square of pixels: boxes that hold the starts of their rays, and the directions.
#[derive(Clone, Copy)]
struct Tile {
    start: Around,
    direction: Around,
}

/// A box by its middle, and half its extent.
#[derive(Clone, Copy)]
struct Around {
    middle: [f32; 3],
    half: [f32; 3],
}

/// A tile is at most so many pixels wide.
const MAX_EDGE: f64 = 16.0;

impl PixelRays {
    /// Makes the rays unless they are there, and tiles that are half as wide as a block, or less, where a pixel is so many
    /// metres wide.
    pub fn fit(&mut self, sensor: &Sensor, pixel: f64, block: f64) {
        let edge = (0.5 * block / pixel).clamp(1.0, MAX_EDGE) as usize;
        if self.made_for.as_ref() == Some(sensor) && self.edge == edge {
            return;
        }
        let (width, height) = (sensor.width(), sensor.height());
        let ray = |pixel: usize| {
            let ray = sensor.aligned_ray(pixel % width, pixel / width);
            let rounded = |v: Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
            Ray { start: rounded(ray.start), direction: rounded(ray.direction) }
        };
        (0..width * height).into_par_iter().map(ray).collect_into_vec(&mut self.rays);
        let (across, down) = (width.div_ceil(edge), height.div_ceil(edge));
        let rays = &self.rays;
        let tile = |n: usize| {
            let (top, left) = corner(n, width, edge);
            let rows = top..(top + edge).min(height);
            let rays = || rows.clone().flat_map(|row| &rays[row * width..][left..(left + edge).min(width)]);
            Tile {
                start: Around::all(rays().map(|ray| ray.start)),
                direction: Around::all(rays().map(|ray| ray.direction)),
            }
        };
        self.tiles = (0..across * down).into_par_iter().map(tile).collect();
        (self.edge, self.made_for) = (edge, Some(sensor.clone()));
    }

    /// The surfaces that were measured, in the sensor's frame: of every `step`-th pixel of every `step`-th row.
    pub fn surfaces<'a>(&'a self, ranges: &'a Ranges, step: usize) -> impl ParallelIterator<Item = [f32; 3]> + 'a {
        let width = ranges.width;
        let rows = self.rays.par_chunks(step * width).zip(ranges.values.par_chunks(step * width)).with_min_len(8);
        rows.flat_map_iter(move |(rays, ranges)| {
            let pixels = rays[..width].iter().zip(&ranges[..width]).step_by(step);
            pixels.filter(|(_, range)| is_surface(**range)).map(|(ray, range)| ray.at(*range))
        })
    }

    /// The blocks that hold what lies near the surfaces. A voxel belongs to the pixel in which its centre is: `pixel` is
    /// how wide one is at a metre.
    pub fn blocks(&self, ranges: &Ranges, near: Near, pose: &Pose, voxel_size: f64, pixel: f32) -> Vec<BlockKey> {
        /// Tiles that share a set.
        const TILES: usize = 128;
        let place = Place::new(pose, voxel_size);
        let tiles = self.tiles.par_chunks(TILES).enumerate();
        let sets: Vec<HashSet<BlockKey>> = tiles
            .map(|(chunk, tiles)| {
                let (mut found, mut last) = (HashSet::new(), None);
                for (n, tile) in tiles.iter().enumerate() {
                    let Some([least, most]) = self.span(chunk * TILES + n, ranges) else { continue };
                    for piece in place.pieces([near.part(least)[0], near.part(most)[1]]) {
                        let blocks = place.blocks(tile, piece, pixel);
                        if last != Some(blocks) {
                            found.extend(all_between(blocks));
                            last = Some(blocks);
                        }
                    }
                }
                found
            })
            .collect();
        let mut keys: Vec<BlockKey> = sets.into_iter().flatten().collect();
        keys.par_sort_unstable();
        keys.dedup();
        keys
    }

    /// The nearest and the farthest surface of a tile; nothing if it has none.
    fn span(&self, tile: usize, ranges: &Ranges) -> Option<[f32; 2]> {
        let (top, left) = corner(tile, ranges.width, self.edge);
        let (mut least, mut most) = (f32::INFINITY, 0.0);
        for row in top..(top + self.edge).min(ranges.height) {
            for &range in &ranges.values[row * ranges.width..][left..(left + self.edge).min(ranges.width)] {
                least = if is_surface(range) & (range < least) { range } else { least };
                most = if is_surface(range) & (range > most) { range } else { most };
            }
        }
        (most > 0.0).then_some([least, most])
    }
}

/// The first row and column of a tile.
fn corner(tile: usize, width: usize, edge: usize) -> (usize, usize) {
    let across = width.div_ceil(edge);
    (tile / across * edge, tile % across * edge)
}

/// Whether a range is that of a surface: there is a reading, and it is finite.
#[inline(always)]
pub(super) fn is_surface(range: f32) -> bool {
    range > 0.0 && range < f32::INFINITY
}

impl Around {
    /// The box around some points; those that are NaN count for nothing.
    fn all(points: impl Iterator<Item = [f32; 3]>) -> Self {
        let none = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        let [low, high] = points.fold(none, |[low, high], point| {
            [std::array::from_fn(|a| low[a].min(point[a])), std::array::from_fn(|a| high[a].max(point[a]))]
        });
        Self {
            middle: std::array::from_fn(|a| 0.5 * (low[a] + high[a])),
            half: std::array::from_fn(|a| 0.5 * (high[a] - low[a])),
        }
    }
}

/// The sensor among the blocks.
struct Place {
    rotation: [[f32; 3]; 3],
    translation: Vector3<f64>,
    block: f64,
}

impl Place {
    fn new(pose: &Pose, voxel_size: f64) -> Self {
        let rotation = std::array::from_fn(|r| std::array::from_fn(|c| pose.rotation[(r, c)] as f32));
        Self { rotation, translation: pose.translation, block: BLOCK_EDGE as f64 * voxel_size }
    }

    /// Pieces of a quarter of a block or less, so that a box around one holds few blocks.
    fn pieces(&self, [from, to]: [f32; 2]) -> impl Iterator<Item = [f32; 2]> + use<> {
        let from = from.max(0.0);
        let count = ((to - from).max(0.0) / (0.25 * self.block as f32)).ceil();
        let step = (to - from) / count;
        (0..count as u32).map(move |n| [from + n as f32 * step, from + (n + 1) as f32 * step])
    }

    /// The first and last of the blocks around a piece of a tile's rays, and a pixel beyond it on all sides.
    #[inline(always)]
    fn blocks(&self, tile: &Tile, piece: [f32; 2], pixel: f32) -> [BlockKey; 2] {
        let beyond = pixel * piece[1];
        let (mut low, mut high) = ([0; 3], [0; 3]);
        for axis in 0..3 {
            let row = self.rotation[axis];
            let ends = piece.map(|range| {
                let (mut middle, mut half) = (0.0, beyond);
                for (a, along) in row.into_iter().enumerate() {
                    middle += along * (tile.start.middle[a] + range * tile.direction.middle[a]);
                    half += along.abs() * (tile.start.half[a] + range * tile.direction.half[a]);
                }
                [middle - half, middle + half]
            });
            let block = |x: f32| ((self.translation[axis] + f64::from(x)) / self.block).floor() as i32;
            (low[axis], high[axis]) = (block(ends[0][0].min(ends[1][0])), block(ends[0][1].max(ends[1][1])));
        }
        [low, high]
    }
}

fn all_between([low, high]: [BlockKey; 2]) -> impl Iterator<Item = BlockKey> {
    let plane = move |x| (low[1]..=high[1]).flat_map(move |y| (low[2]..=high[2]).map(move |z| [x, y, z]));
    (low[0]..=high[0]).flat_map(plane)
}
