//! Stage 4, update: the log-odd that a frame gives to each voxel of the mixed blocks (Alg. 1).
//!
//! One file a rule. A rule is asked for eight voxels at a time; everything around it is here. What is done to eight
//! voxels is written over the vectors of [`simd`](crate::simd): no allocation, no branch, and no reading through a bounds
//! check inside it. Rules that interpolate do so in both layers at once, so that the widest vectors are full.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together, by their number")]

pub mod area;
pub mod ideal;
pub mod min_layer;
pub mod pyramid;
pub mod rays;

use crate::block::{BLOCK_EDGE, BLOCK_VOXELS, BlockData, BlockKey, voxel_offset};
use crate::cull::{Eighths, Reads, Scope, bits_of, side};
use crate::log_odds::{self, STEPS};
use crate::pyramid::Selection;
use crate::sensor::SensorTable;
use crate::sensors::{Projected, Projection};
use crate::simd::{Kernel, Real, Simd};
use crate::surfaces::{Sampling, SurfaceLayer};
use crate::view::{Lanes, Points, View};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// How a voxel's log-odd is found in the depth image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum UpdateRule {
    /// The paper: four texels of two pyramid layers, interpolated (Eq. 12 to 17).
    #[default]
    Pyramid,
    /// The mean log-odd over points spread inside the voxel, each read at full resolution.
    Area,
    /// After Andert 2009: one layer of minimum ranges, interpolated within the layer.
    MinLayer,
    /// Every pixel ray that cuts the voxel, weighted by its length inside (Eq. 8, 9): slow, and exact.
    Ideal,
    /// As OctoMap: one ray a reading, which frees what it passes and occupies the voxel it ends in.
    Rays,
}

impl UpdateRule {
    /// Which range of a window the layers of this rule keep. Without perspective no layer has a distance of its own.
    pub fn selection<P: Projection>(self) -> Selection {
        match self {
            UpdateRule::MinLayer => Selection::Minimum,
            _ if !P::PERSPECTIVE => Selection::Minimum,
            _ => Selection::Nearest,
        }
    }

    /// The layers this rule can read within the range of a view, of an image with `count` of them.
    pub fn layers<P: Projection>(self, view: &View<P>, count: usize) -> Range<usize> {
        match self {
            UpdateRule::Pyramid | UpdateRule::MinLayer => {
                layer_of(view.t_0 as f32 / view.projection.apparent_distance(view.max_range), count)..count
            }
            UpdateRule::Area | UpdateRule::Ideal => 0..1,
            UpdateRule::Rays => 0..0,
        }
    }

    /// How this rule reads layers. Rules that read full resolution ask for rectangles of many pixels: finer cells are not worth
    /// their cost.
    pub fn sampling(self) -> Sampling {
        match self {
            UpdateRule::Pyramid => Sampling::Quads { blended: true },
            UpdateRule::MinLayer => Sampling::Quads { blended: false },
            UpdateRule::Area | UpdateRule::Ideal | UpdateRule::Rays => Sampling::Texels { finest: 1 },
        }
    }
}

/// What a frame does to one block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Nothing.
    None,
    /// The same increment for all voxels.
    Uniform(i32),
    /// An increment for each voxel.
    Dense {
        /// How many of them are not zero.
        voxels: u32,
    },
}

/// What a rule reads when it is asked.
pub struct Frame<'a, P> {
    /// Where the camera is.
    pub view: &'a View<P>,
    /// The layers.
    pub layers: &'a [SurfaceLayer],
    /// The sensor model.
    pub table: &'a SensorTable,
}

/// A rule: log-odds of eight voxels.
pub trait Rule<P>: Reads {
    /// Log-odds of the voxels whose centres are `points`, projected to `pixels`; NaN where nothing was read.
    /// Lanes out of sight hold anything, and what is answered for them is not used.
    fn log_odds<S: Simd>(&self, frame: &Frame<P>, points: &Points, pixels: &Pixels) -> Lanes;
}

/// Projected voxel centres.
#[derive(Clone, Copy, Debug)]
pub struct Pixels {
    /// Column, counted from the image's border: half a pixel more than from the first pixel's centre.
    pub u: Lanes,
    /// Row, likewise.
    pub v: Lanes,
    /// What the sensor measures of a surface there, metres: the `z` of the paper.
    pub range: Lanes,
    /// A bit for each that is in sight.
    pub seen: u32,
}

/// The layer `i` with `t_(i+1) < z <= t_i`, out of `count`, for `q = t_0 / z` (Eq. 12 with the inequality turned round,
/// since `t_i` falls with `i`): the exponent of `q`. Beyond `t_0` it is 0, nearer than the last layer's distance the last.
#[inline(always)]
pub fn layer_of(q: f32, count: usize) -> usize {
    let exponent = (q.to_bits() >> 23) as i32 - 127;
    exponent.clamp(0, count as i32 - 1) as usize
}

/// The first and last of the layers `i` of voxels at distances `near..=far`.
#[inline(always)]
fn layers_between(t_0: f32, count: usize, near: f32, far: f32) -> (usize, usize) {
    (layer_of(t_0 / far, count), if near > 0.0 { layer_of(t_0 / near, count) } else { count - 1 })
}

/// The first and last of the layers of voxels with these `q`.
#[inline(always)]
fn layers_of<S: Simd>(q: S::Eight, count: usize) -> (usize, usize) {
    (layer_of(S::least(q), count), layer_of(S::most(q), count))
}

/// The distances that say how large the voxels look.
#[inline(always)]
fn apparent_distances<S: Simd, P: Projection>(pixels: &Pixels) -> S::Eight {
    if P::PERSPECTIVE { S::load(&pixels.range) } else { S::Eight::splat(1.0) }
}

/// `2^i`, for the number of a layer.
#[inline(always)]
fn power_of_two(i: usize) -> f32 {
    (1u32 << i) as f32
}

/// A block by its eighths, theirs, and theirs, which are single voxels: positions are the same for all blocks of a frame.
struct BlockLayout<P: Projection> {
    /// Cubes of 4 x 4 x 4 voxels.
    quarters: Eighths<P>,
    /// Cubes of 2 x 2 x 2 voxels: eight lanes.
    pairs: Eighths<P>,
    voxels: Eighths<P>,
}

impl<P: Projection> BlockLayout<P> {
    fn new<R: Reads>(view: &View<P>) -> Self {
        let eighths = |edge| Eighths::new::<R>(view, edge);
        Self { quarters: eighths(BLOCK_EDGE), pairs: eighths(BLOCK_EDGE / 2), voxels: eighths(BLOCK_EDGE / 4) }
    }
}

/// Computes the increments of the mixed blocks: `changes[n]` and, where that is dense, `increments[n]` for `mixed[n]`.
pub fn update<R: Rule<P>, P: Projection>(
    scope: &Scope<R, P>,
    table: &SensorTable,
    mixed: &[BlockKey],
    increments: &mut Vec<BlockData>,
    changes: &mut Vec<Change>,
) {
    increments.resize(mixed.len().max(increments.len()), [0; BLOCK_VOXELS]);
    changes.resize(mixed.len(), Change::None);
    let frame = Frame { view: scope.view, layers: scope.layers, table };
    let layout = BlockLayout::new::<R>(scope.view);
    let blocks = mixed.par_iter().zip(&mut increments[..mixed.len()]).zip(changes);
    blocks.with_min_len(4).for_each(|((&key, out), change)| {
        *change = scope.instructions.run(UpdateBlock { scope, frame: &frame, layout: &layout, key, out });
    });
}

/// The increments of one block.
struct UpdateBlock<'a, R, P: Projection> {
    scope: &'a Scope<'a, R, P>,
    frame: &'a Frame<'a, P>,
    layout: &'a BlockLayout<P>,
    key: BlockKey,
    out: &'a mut BlockData,
}

impl<R: Rule<P>, P: Projection> Kernel for UpdateBlock<'_, R, P> {
    type Output = Change;

    #[inline(always)]
    fn run<S: Simd>(self) -> Change {
        update_eighths::<S, R, P>(self.scope, self.frame, self.layout, self.key, self.out);
        summary(self.out)
    }
}

#[inline(always)]
fn update_eighths<S: Simd, R: Rule<P>, P: Projection>(
    scope: &Scope<R, P>,
    frame: &Frame<P>,
    layout: &BlockLayout<P>,
    key: BlockKey,
    out: &mut BlockData,
) {
    let free = free_increment(frame.table);
    let centre = scope.view.to_camera(&scope.view.offset_of(key, 1));
    let quarters = layout.quarters.offsets.moved(centre);
    let classes = scope.classify::<S>(&layout.quarters, &quarters);
    out.fill(0);
    for q in bits_of(classes.free) {
        (0..8).for_each(|p| store(out, q, p, [free; 8]));
    }
    for q in bits_of(classes.mixed) {
        let pairs = layout.pairs.offsets.moved(quarters.lane(q));
        let classes = scope.classify::<S>(&layout.pairs, &pairs);
        bits_of(classes.free).for_each(|p| store(out, q, p, [free; 8]));
        for p in bits_of(classes.mixed) {
            let voxels = layout.voxels.offsets.moved(pairs.lane(p));
            store(out, q, p, update_lanes::<S, R, P>(scope, frame, &voxels));
        }
    }
}

/// Puts the eight voxels of pair cube `p` in quarter cube `q` where they lie in the block.
#[inline(always)]
fn store(out: &mut BlockData, q: usize, p: usize, values: [i32; 8]) {
    let first: [usize; 3] = std::array::from_fn(|axis| 4 * side(q, axis) + 2 * side(p, axis));
    for n in 0..8 {
        out[voxel_offset(first[0] + side(n, 0), first[1] + side(n, 1), first[2] + side(n, 2))] = values[n];
    }
}

/// Increments of eight voxels: projects them (Eq. 13), asks the rule, and rounds.
#[inline(always)]
fn update_lanes<S: Simd, R: Rule<P>, P: Projection>(
    scope: &Scope<R, P>,
    frame: &Frame<P>,
    points: &Points,
) -> [i32; 8] {
    let (view, splat) = (frame.view, S::Eight::splat);
    let [width, height] = view.projection.image();
    let (nothing, max_range) = (splat(0.0), splat(view.max_range));
    let Projected { u, v, range, in_front } = view.projection.project_eight::<S>(points);
    let inside = u.at_least(nothing) & v.at_least(nothing) & splat(width).greater(u) & splat(height).greater(v);
    let seen = in_front & max_range.at_least(range) & inside;
    // Lanes out of range must not reach for layers that are not made.
    let range = S::store(range.min(max_range));
    let pixels = Pixels { u: S::store(u), v: S::store(v), range, seen: S::bits(seen) };
    let log_odds = S::load(&scope.rule.log_odds::<S>(frame, points, &pixels));
    let told = S::Eight::select(seen & log_odds.is_number(), log_odds, nothing);
    // SAFETY: rounded, and small.
    unsafe { S::store_whole(rounded(told)) }
}

/// The nearest fixed-point number. Adding and taking off 1.5 x 2^23 rounds any `f32` below 2^22 to an integer, ties to
/// even, with the same bits on every processor; log-odds of one reading stay below 2^6.
#[inline(always)]
fn rounded<R: Real>(log_odds: R) -> R {
    let round = R::splat(12_582_912.0);
    (log_odds * R::splat(STEPS) + round) - round
}

#[inline(always)]
fn summary(increments: &BlockData) -> Change {
    let first = increments[0];
    if increments.iter().fold(0, |differs, &value| differs | (value ^ first)) != 0 {
        Change::Dense { voxels: increments.iter().map(|&value| u32::from(value != 0)).sum() }
    } else if first == 0 {
        Change::None
    } else {
        Change::Uniform(first)
    }
}

/// The increment of a voxel in free space.
pub fn free_increment(table: &SensorTable) -> i32 {
    let increment = rounded(table.free()) as i32;
    debug_assert_eq!(increment, log_odds::to_fixed(f64::from(table.free())));
    increment
}

/// Bilinear interpolation of log-odds in two layers (Eq. 15, 16) over the texels that have a reading; NaN where none has.
/// Texel centres lie at half-integer `(u, v)`.
#[inline(always)]
fn bilinear<S: Simd, P: Projection>(frame: &Frame<P>, layers: [usize; 2], pixels: &Pixels) -> [S::Eight; 2] {
    let splat = S::Sixteen::splat;
    let scale = of_layers::<S>(layers.map(|i| 1.0 / power_of_two(i)));
    let layers = layers.map(|i| &frame.layers[i]);
    let (columns, right) =
        taps(of_voxels::<S>(&pixels.u) * scale, of_layers::<S>(layers.map(|layer| layer.width as f32)));
    let (rows, lower) =
        taps(of_voxels::<S>(&pixels.v) * scale, of_layers::<S>(layers.map(|layer| layer.height as f32)));
    for layer in layers {
        assert!(layer.quads[0].len() > layer.width * layer.height, "a layer that this rule reads");
    }
    // SAFETY: `taps` clamps to the layer.
    let places = unsafe { S::places(rows, columns, layers.map(|layer| layer.width as u32 + 1)) };
    let surfaces = unsafe { S::quads(layers.map(|layer| &layer.quads[0][..]), &places) };
    let inv_sigmas = if layers[0].inv_sigma.len() == 1 {
        [splat(layers[0].inv_sigma[0]); 4]
    } else {
        unsafe { S::quads(layers.map(|layer| &layer.quads[1][..]), &places) }
    };
    let (nothing, one, range) = (splat(0.0), splat(1.0), of_voxels::<S>(&pixels.range));
    let (rows, columns) = ([one - lower, lower], [one - right, right]);
    let (mut sum, mut weight) = (nothing, nothing);
    for k in 0..4 {
        let w = S::Sixteen::select(surfaces[k].is_number(), rows[k / 2] * columns[k % 2], nothing);
        sum = sum + w * frame.table.log_odds_of::<S>((range - surfaces[k]) * inv_sigmas[k]);
        weight = weight + w;
    }
    S::split(S::Sixteen::select(weight.greater(nothing), sum / weight, splat(f32::NAN)))
}

/// The same eight numbers for both layers.
#[inline(always)]
fn of_voxels<S: Simd>(lanes: &Lanes) -> S::Sixteen {
    S::join([S::load(lanes); 2])
}

/// A number for each layer.
#[inline(always)]
fn of_layers<S: Simd>(numbers: [f32; 2]) -> S::Sixteen {
    S::join([S::Eight::splat(numbers[0]), S::Eight::splat(numbers[1])])
}

/// The quad along one axis in which each coordinate lies, clamped to those of a layer of `size` texels, and the weight of
/// the second texel.
#[inline(always)]
fn taps<R: Real>(coordinate: R, size: R) -> (R, R) {
    let x = coordinate - R::splat(0.5);
    let floor = x.floor();
    // NaN becomes 0.
    let quad = (floor + R::splat(1.0)).max(R::splat(0.0)).min(size);
    (quad, x - floor)
}
