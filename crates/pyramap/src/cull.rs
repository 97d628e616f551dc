//! Stage 3, cull: which parts of the frustum are hidden, which are free throughout, and which must be asked voxel by
//! voxel.
//!
//! A cube of voxels is classified from the interval of its distances and the rectangle of its projection: with the
//! bounds over exactly the texels that the update rule would read for it, it is skipped where all of it lies behind
//! every surface, and free where all of it lies in front of every surface. What is neither is asked by its eighths,
//! all eight at once: from cubes of many blocks down to blocks here, and from blocks down to cubes of 2 x 2 x 2 voxels
//! in the update stage. Because the sensor table is constant beyond its cut-off, skipping changes no bit of the result.
//! Bounds of all eight are read before any is judged: which way one goes no processor can predict.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together, by their number")]

use crate::block::{BLOCK_EDGE, BlockKey};
use crate::sensors::{Outline, Projection};
use crate::simd::{Instructions, Kernel, Real, Simd};
use crate::surfaces::{Bounds, SurfaceLayer};
use crate::view::{Lanes, Points, View};
use nalgebra::Vector3;
use rayon::prelude::*;

/// What is known of the eighths of a cube before any of their voxels is asked: a bit for each. Of the others no voxel
/// changes: they are out of sight, hidden, or nothing was read there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Classes {
    /// Every voxel gets the free log-odd.
    pub free: u32,
    /// Some voxels may differ.
    pub mixed: u32,
}

/// The numbers of the bits that are set.
#[inline(always)]
pub fn bits_of(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let first = (bits != 0).then_some(bits.trailing_zeros() as usize);
        bits &= bits.wrapping_sub(1);
        first
    })
}

/// The blocks of a frame that change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Culled {
    /// Blocks that are free throughout.
    pub free: Vec<BlockKey>,
    /// Blocks to be asked voxel by voxel.
    pub mixed: Vec<BlockKey>,
}

/// Which texels an update rule reads, as far as the cull must know.
pub trait Reads: Sync {
    /// The layers that voxels at distances `near..=far` read.
    fn layers(&self, near: f32, far: f32) -> LayersRead;
    /// How many texels beyond the one that holds a projected point are read, towards higher coordinates.
    const REACH: f32;
    /// Half the edge, in voxels, of the cube around a voxel's centre whose projection is read.
    const HALF_EDGE: f64;
}

/// The layers `first..=last`, and when a voxel is sure to be told something by them.
#[derive(Clone, Copy, Debug)]
pub struct LayersRead {
    /// The finest layer that serves a voxel.
    pub first: usize,
    /// The coarsest layer that serves a voxel. If the rule reads two neighbouring layers, one more is read.
    pub last: usize,
    /// Whether each voxel is served by the next layer where its own has holes, if there is a next one.
    pub fallback: bool,
    /// Whether each voxel reads at least one texel.
    pub certain: bool,
}

/// More layers than this are not worth a look: the cube is large or very near, and is split anyway.
pub const MAX_LAYERS: usize = 4;
/// Slack on distances, relative: some ten roundings of `f32`, well above what the voxels' own arithmetic errs by.
pub const DISTANCE_SLACK: f32 = 2e-6;
/// Slack on pixel coordinates: roundings at coordinates of up to some thousand pixels.
pub const PIXEL_SLACK: f32 = 1e-2;

/// The eighths of a cube: where they lie, and how far each reaches. The same serve all cubes of one size.
#[derive(Clone, Debug)]
pub struct Eighths<P: Projection> {
    /// Their centres relative to the cube's, in the camera's frame.
    pub offsets: Points,
    /// The world's axes in the camera's frame, along which the cubes lie.
    pub axes: [[f32; 3]; 3],
    /// Half the edge of the cube that holds an eighth's voxel centres, metres.
    pub voxels: f32,
    /// Half the edge of the cube that holds all that is projected for its voxels, metres.
    pub projected: f32,
    /// What the projection makes of that cube.
    pub size: P::Size,
}

/// Which half of a cube an eighth lies in along an axis: 0 or 1. Along z neighbours follow each other.
#[inline(always)]
pub const fn side(eighth: usize, axis: usize) -> usize {
    eighth >> (2 - axis) & 1
}

impl<P: Projection> Eighths<P> {
    /// The eighths of cubes of `edge` voxels along each side, for a rule that reads around each voxel.
    pub fn new<R: Reads>(view: &View<P>, edge: usize) -> Self {
        let eighth = edge as f64 / 2.0;
        let axes = [0, 1, 2].map(|k| view.to_camera(&Vector3::ith(k, 1.0)));
        let half = (eighth - 1.0) / 2.0 * view.voxel_size;
        let projected = (half + R::HALF_EDGE * view.voxel_size) as f32;
        Self {
            offsets: view.voxel_offsets(|n| std::array::from_fn(|axis| (side(n, axis) as f64 - 0.5) * eighth)),
            axes,
            voxels: half as f32,
            projected,
            size: view.projection.size(&axes, projected),
        }
    }

    /// The nearest and farthest distance of the points in the cube around a centre, with slack for rounding.
    #[inline(always)]
    pub fn distances<R: Real>(&self, point: [R; 3]) -> [R; 2] {
        let (nothing, half, slack) = (R::splat(0.0), R::splat(self.voxels), R::splat(DISTANCE_SLACK));
        let (mut near, mut far) = (nothing, nothing);
        for axis in &self.axes {
            let away = dot(axis, &point).abs();
            let nearest = (away - half).max(nothing);
            near = near + nearest * nearest;
            far = far + (away + half) * (away + half);
        }
        let far = far.sqrt();
        [near.sqrt() - slack * far, far + slack * far]
    }
}

/// The scalar product.
#[inline(always)]
pub fn dot<R: Real>(a: &[f32; 3], b: &[R; 3]) -> R {
    R::splat(a[0]) * b[0] + R::splat(a[1]) * b[1] + R::splat(a[2]) * b[2]
}

/// What the cull asks: the frame's view, the surfaces in its layers, and the rule that will read them.
pub struct Scope<'a, R, P> {
    /// Where the camera is.
    pub view: &'a View<P>,
    /// The layers.
    pub layers: &'a [SurfaceLayer],
    /// The update rule.
    pub rule: &'a R,
    /// Whether hidden and free parts are told apart at all; without, every block in sight is mixed.
    pub enabled: bool,
    /// What the stages run with.
    pub instructions: Instructions,
}

impl<R: Reads, P: Projection> Scope<'_, R, P> {
    /// Classifies the eighths whose centres are given.
    #[inline(always)]
    pub fn classify<S: Simd>(&self, eighths: &Eighths<P>, centres: &Points) -> Classes {
        let ([near, far], outline) = self.view.projection.outline_eight::<S>(eighths, centres);
        let max_range = S::Eight::splat(self.view.max_range);
        let in_sight = outline.in_sight & max_range.at_least(near);
        let bits = S::bits(in_sight);
        if bits == 0 || !self.enabled {
            return Classes { free: 0, mixed: bits };
        }
        // Farther than max_range no voxel is asked, and the layers that would serve there are not made.
        let Some(found) = self.bounds::<S>(near, far.min(max_range), &outline) else {
            return Classes { free: 0, mixed: bits };
        };
        let hidden = in_sight & outline.bounded & near.greater(S::load(&found.hidden_beyond));
        let inside = in_sight & outline.bounded & outline.inside & max_range.at_least(far);
        let free = inside & S::load(&found.free_within).greater(far);
        let free = S::bits(free) & !S::bits(hidden);
        Classes { free, mixed: bits & !S::bits(hidden) & !free }
    }

    /// Bounds over the texels that are read for voxels at distances `near..=far` which are projected into outlines; `None` if
    /// these are too many layers.
    #[inline(always)]
    fn bounds<S: Simd>(&self, near: S::Eight, far: S::Eight, outline: &Outline<S::Eight>) -> Option<Found> {
        let apparent = |range| self.view.projection.apparent_distance(range);
        let read = self.rule.layers(apparent(S::least(near)), apparent(S::most(far)));
        if read.last - read.first >= MAX_LAYERS {
            return None;
        }
        let (near, far) = (S::store(near), S::store(far));
        let (mut all, mut gapless) = ([Bounds::NONE; 8], [read.certain; 8]);
        let mut found = Found { hidden_beyond: [0.0; 8], free_within: [0.0; 8] };
        for i in read.first..=read.last {
            let layer = &self.layers[i];
            let cells = layer.cells::<S>(1.0 / (1u32 << i) as f32, outline.columns, outline.rows, R::REACH);
            for n in 0..8 {
                // Which of several layers each reads: seldom asked, since neighbours mostly read the same.
                let one = read.first == read.last;
                let each = if one { read } else { self.rule.layers(apparent(near[n]), apparent(far[n])) };
                if each.first <= i && i <= each.last {
                    let bounds = layer.bounds(&cells, n);
                    gapless[n] &= !bounds.has_holes(each.fallback) & each.certain;
                    all[n] = all[n].union(bounds);
                }
            }
        }
        for n in 0..8 {
            found.hidden_beyond[n] = all[n].far();
            found.free_within[n] = if gapless[n] { all[n].near() } else { f32::NEG_INFINITY };
        }
        Some(found)
    }
}

/// What bounds say of each of eight cubes.
struct Found {
    /// All of it is hidden if it lies farther off.
    hidden_beyond: Lanes,
    /// All of it is free if it lies nearer.
    free_within: Lanes,
}

/// [`Scope::classify`] by itself.
struct Classify<'a, R, P: Projection>(&'a Scope<'a, R, P>, &'a Eighths<P>, Points);

impl<R: Reads, P: Projection> Kernel for Classify<'_, R, P> {
    type Output = Classes;

    #[inline(always)]
    fn run<S: Simd>(self) -> Classes {
        self.0.classify::<S>(self.1, &self.2)
    }
}

/// The descent starts from so many cubes along the frustum, each of as many blocks as that takes.
const ROOTS_ALONG_FRUSTUM: i32 = 3;

/// The descent goes through at most so many sizes of cubes: enough for the longest range of a map, seen all around.
const MAX_LEVELS: usize = 10;

/// What the cull keeps from frame to frame, so that it need not be allocated again.
#[derive(Default)]
pub struct CullBuffers {
    /// The cubes that the descent starts from, and what was found in each.
    roots: Vec<(BlockKey, Culled)>,
}

/// Sorts the blocks of the frustum into free and mixed ones; the others do not change.
pub fn cull<R: Reads, P: Projection>(scope: &Scope<R, P>, buffers: &mut CullBuffers, culled: &mut Culled) {
    let (low, high) = frustum_blocks(scope.view);
    let extent = (0..3).map(|axis| high[axis] - low[axis] + 1).max().expect("three axes");
    let levels = ((extent / ROOTS_ALONG_FRUSTUM).max(2).ilog2() as usize).min(MAX_LEVELS);
    let sizes: [_; MAX_LEVELS] = std::array::from_fn(|n| Eighths::new::<R>(scope.view, BLOCK_EDGE << (n + 1)));
    let (sizes, roots) = (&sizes[..levels], &mut buffers.roots);

    let edge = 1 << levels;
    let along = |axis: usize| low[axis].div_euclid(edge)..=high[axis].div_euclid(edge);
    let keys = along(0).flat_map(|x| along(1).flat_map(move |y| along(2).map(move |z| [x, y, z].map(|k| k * edge))));
    let mut count = 0;
    for (n, key) in keys.enumerate() {
        if n == roots.len() {
            roots.push(Default::default());
        }
        roots[n].0 = key;
        count = n + 1;
    }
    roots[..count].par_iter_mut().for_each(|(root, found)| {
        found.clear();
        descend(scope, sizes, *root, found);
    });
    culled.clear();
    for (_, found) in &roots[..count] {
        culled.free.extend_from_slice(&found.free);
        culled.mixed.extend_from_slice(&found.mixed);
    }
}

impl Culled {
    fn clear(&mut self) {
        self.free.clear();
        self.mixed.clear();
    }
}

/// Classifies the eighths of a cube of `2^sizes.len()` blocks, and theirs where they are mixed.
fn descend<R: Reads, P: Projection>(scope: &Scope<R, P>, sizes: &[Eighths<P>], key: BlockKey, culled: &mut Culled) {
    let (eighths, smaller) = sizes.split_last().expect("a cube of two blocks' edge is the smallest that is split");
    let half = 1 << smaller.len();
    let centre = scope.view.to_camera(&scope.view.offset_of(key, 2 * half));
    let Classes { free, mixed } = scope.instructions.run(Classify(scope, eighths, eighths.offsets.moved(centre)));
    let child = |n: usize| std::array::from_fn(|axis| key[axis] + side(n, axis) as i32 * half);
    bits_of(free).for_each(|n| culled.free.extend(blocks_of(child(n), half)));
    for child in bits_of(mixed).map(child) {
        if half == 1 {
            culled.mixed.push(child);
        } else {
            descend(scope, smaller, child, culled);
        }
    }
}

/// The keys of a cube of `edge` blocks along each axis.
fn blocks_of([x, y, z]: BlockKey, edge: i32) -> impl Iterator<Item = BlockKey> {
    (0..edge).flat_map(move |i| (0..edge).flat_map(move |j| (0..edge).map(move |k| [x + i, y + j, z + k])))
}

/// First and last block, along each axis, that the view can reach.
pub fn frustum_blocks<P: Projection>(view: &View<P>) -> (BlockKey, BlockKey) {
    let [low, high] = view.projection.reach(&view.pose, f64::from(view.max_range));
    let block = BLOCK_EDGE as f64 * view.voxel_size;
    // One voxel of slack: for rounding.
    let key = |p: Vector3<f64>, slack: f64| -> BlockKey {
        (p / block).map(|c| (c + slack / BLOCK_EDGE as f64).floor() as i32).into()
    };
    (key(low, -1.0), key(high, 1.0))
}
