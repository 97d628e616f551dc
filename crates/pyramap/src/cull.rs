//! Stage 3, cull: which parts of the frustum are hidden, which are free throughout, and which must be asked voxel by
//! voxel.
//!
//! A cube of voxels is classified from the interval of its distances and the rectangle of its projection: with the
//! bounds over exactly the texels that the update rule would read for it, it is skipped where all of it lies behind
//! every surface, and free where all of it lies in front of every surface. The same question is put to cubes of many
//! blocks, to blocks, and by the update stage to the sub-blocks of a mixed block. Because the sensor table is constant
//! beyond its cut-off, skipping changes no bit of the result.

use crate::block::{BLOCK_EDGE, BlockKey};
use crate::surfaces::{Bounds, SurfaceLayer};
use crate::view::{Points, View};
use nalgebra::Vector3;
use rayon::prelude::*;

/// What is known of a cube of voxels before any of them is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// No voxel of it changes: out of sight, hidden, or nothing was read there.
    Skip,
    /// Every voxel of it gets the free log-odd.
    Free,
    /// Some voxels may differ.
    Mixed,
}

/// The blocks of a frame that change.
#[derive(Clone, Debug, Default)]
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
    /// The finest layer read.
    pub first: usize,
    /// The coarsest layer read.
    pub last: usize,
    /// Whether each voxel reads two neighbouring layers, and is served by one where the other has holes.
    pub fallback: bool,
    /// Whether each voxel reads at least one texel.
    pub certain: bool,
}

/// More layers than this are not worth a look: the cube is large or very near, and is split anyway.
const MAX_LAYERS: usize = 4;
/// Slack on distances, relative: some ten roundings of `f32`, well above what the voxels' own arithmetic errs by.
const DISTANCE_SLACK: f32 = 2e-6;
/// Slack on pixel coordinates: roundings at coordinates of up to some thousand pixels.
const PIXEL_SLACK: f32 = 1e-2;

/// A cube size to classify: the same corners serve all cubes of it.
#[derive(Clone, Debug)]
pub struct Cube {
    /// Half the edge of the cube that holds the voxels' centres, metres.
    half: f64,
    /// Corners of the cube that holds all that is projected, in the camera's frame.
    corners: Points,
}

impl Cube {
    /// A cube of `voxels` voxels along an edge, for a rule that reads around each voxel.
    pub fn new<R: Reads>(view: &View, voxels: f64) -> Self {
        let half = 0.5 * (voxels - 1.0);
        let projected = half + R::HALF_EDGE;
        let sign = |lane: usize, axis: usize| if lane >> axis & 1 == 0 { -projected } else { projected };
        let corners = view.voxel_offsets(|lane| [sign(lane, 0), sign(lane, 1), sign(lane, 2)]);
        Self { half: half * view.voxel_size, corners }
    }
}

/// What the cull asks: the frame's view, the surfaces in its layers, and the rule that will read them.
pub struct Scope<'a, R> {
    /// Where the camera is.
    pub view: &'a View,
    /// The layers.
    pub layers: &'a [SurfaceLayer],
    /// The update rule.
    pub rule: &'a R,
    /// Whether hidden and free parts are told apart at all; without, every block in sight is mixed.
    pub enabled: bool,
}

impl<R: Reads> Scope<'_, R> {
    /// Classifies a cube whose centre lies at `offset` from the camera along the world's axes, at `centre` in its frame.
    #[inline]
    pub fn classify(&self, cube: &Cube, offset: &Vector3<f64>, centre: [f32; 3]) -> Class {
        let corners = cube.corners.moved(centre);
        if corners.z.iter().all(|&z| z <= 0.0) {
            return Class::Skip;
        }
        let (near, far) = distances(cube.half, offset);
        if near > self.view.max_range {
            return Class::Skip;
        }
        let Some(rectangle) = project(self.view, &corners) else { return Class::Mixed };
        let [width, height] = self.view.image;
        let [left, top, right, bottom] = rectangle;
        if right < 0.0 || bottom < 0.0 || left >= width || top >= height {
            return Class::Skip;
        }
        if !self.enabled {
            return Class::Mixed;
        }
        // Farther than max_range no voxel is asked, and the layers that would serve there are not made.
        let read = self.rule.layers(near, far.min(self.view.max_range));
        if read.last - read.first >= MAX_LAYERS {
            return Class::Mixed;
        }
        let (bounds, gapless) = self.bounds(rectangle, read);
        if near > bounds.far {
            return Class::Skip;
        }
        let inside = left >= 0.0 && top >= 0.0 && right < width && bottom < height && far <= self.view.max_range;
        if inside && gapless && far < bounds.near { Class::Free } else { Class::Mixed }
    }

    /// Bounds over all texels that may be read, and whether every voxel is sure to find a valid one.
    fn bounds(&self, [left, top, right, bottom]: [f32; 4], read: LayersRead) -> (Bounds, bool) {
        let mut all = Bounds::NONE;
        let mut previous_has_holes = false;
        let mut gapless = read.certain;
        for i in read.first..=read.last {
            let layer = &self.layers[i];
            let scale = 1.0 / (1u32 << i) as f32;
            let texels = |low: f32, high: f32, size: usize| {
                let last = (size - 1) as f32;
                let low = (low * scale - 0.5).floor().clamp(0.0, last);
                let high = (high * scale - 0.5 + R::REACH).floor().clamp(0.0, last);
                (low as usize, high as usize)
            };
            let bounds = layer.bounds(texels(left, right, layer.width), texels(top, bottom, layer.height));
            let has_holes = bounds.holes > 0.0;
            gapless &= if read.fallback && read.first < read.last {
                i == read.first || !(has_holes && previous_has_holes)
            } else {
                !has_holes
            };
            previous_has_holes = has_holes;
            all = all.union(bounds);
        }
        (all, gapless)
    }
}

/// The nearest and farthest distance of a point in an axis-aligned cube, with slack for rounding.
#[inline]
fn distances(half: f64, offset: &Vector3<f64>) -> (f32, f32) {
    let away = offset.abs();
    let near = away.map(|d| (d - half).max(0.0)).norm() as f32;
    let far = away.map(|d| d + half).norm() as f32;
    let slack = DISTANCE_SLACK * far;
    (near - slack, far + slack)
}

/// Left, top, right and bottom of a cube's image, counted from the image's border, with slack; `None` if the cube
/// reaches behind the camera.
#[inline]
fn project(view: &View, corners: &Points) -> Option<[f32; 4]> {
    let mut rectangle = [f32::INFINITY, f32::INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY];
    if corners.z.iter().any(|&z| z <= 1e-3) {
        return None;
    }
    for i in 0..8 {
        let inverse = 1.0 / corners.z[i];
        let u = corners.x[i] * inverse * view.focal[0] + view.principal[0];
        let v = corners.y[i] * inverse * view.focal[1] + view.principal[1];
        rectangle = [rectangle[0].min(u), rectangle[1].min(v), rectangle[2].max(u), rectangle[3].max(v)];
    }
    let [left, top, right, bottom] = rectangle;
    Some([left - PIXEL_SLACK, top - PIXEL_SLACK, right + PIXEL_SLACK, bottom + PIXEL_SLACK])
}

/// Cubes of this many blocks start the descent when the frustum is large.
const ROOTS_ALONG_FRUSTUM: i32 = 6;

/// Sorts the blocks of the frustum into free and mixed ones; the others do not change.
pub fn cull<R: Reads>(scope: &Scope<R>) -> Culled {
    let (low, high) = frustum_blocks(scope.view);
    let extent = (0..3).map(|axis| high[axis] - low[axis] + 1).max().expect("three axes");
    let levels = (extent / ROOTS_ALONG_FRUSTUM).max(1).ilog2();
    let cubes: Vec<Cube> = (0..=levels)
        .map(|level| Cube::new::<R>(scope.view, f64::from(BLOCK_EDGE as i32) * f64::from(1 << level)))
        .collect();
    let edge = 1 << levels;
    let roots: Vec<BlockKey> = (low[0].div_euclid(edge)..=high[0].div_euclid(edge))
        .flat_map(|x| (low[1].div_euclid(edge)..=high[1].div_euclid(edge)).map(move |y| [x, y]))
        .flat_map(|[x, y]| (low[2].div_euclid(edge)..=high[2].div_euclid(edge)).map(move |z| [x, y, z]))
        .map(|root| root.map(|k| k * edge))
        .collect();
    roots
        .par_iter()
        .fold(Culled::default, |mut culled, &root| {
            descend(scope, &cubes, root, &mut culled);
            culled
        })
        .reduce(Culled::default, |mut left, mut right| {
            left.free.append(&mut right.free);
            left.mixed.append(&mut right.mixed);
            left
        })
}

/// Classifies a cube of `2^(cubes.len() - 1)` blocks, and its eighths where it is mixed.
fn descend<R: Reads>(scope: &Scope<R>, cubes: &[Cube], key: BlockKey, culled: &mut Culled) {
    let (cube, smaller) = cubes.split_last().expect("there is a cube of one block");
    let edge = 1 << smaller.len();
    let offset = scope.view.offset_of(key, edge);
    match scope.classify(cube, &offset, scope.view.to_camera(&offset)) {
        Class::Skip => {}
        Class::Free => culled.free.extend(blocks_of(key, edge)),
        Class::Mixed if edge == 1 => culled.mixed.push(key),
        Class::Mixed => {
            let half = edge / 2;
            for child in blocks_of([0, 0, 0], 2) {
                descend(scope, smaller, std::array::from_fn(|axis| key[axis] + child[axis] * half), culled);
            }
        }
    }
}

/// The keys of a cube of `edge` blocks along each axis.
fn blocks_of(first: BlockKey, edge: i32) -> impl Iterator<Item = BlockKey> {
    (0..edge).flat_map(move |x| {
        (0..edge).flat_map(move |y| (0..edge).map(move |z| [first[0] + x, first[1] + y, first[2] + z]))
    })
}

/// First and last block, along each axis, that the view can reach: the box around the camera and its range's end.
fn frustum_blocks(view: &View) -> (BlockKey, BlockKey) {
    let mut low = view.pose.translation;
    let mut high = low;
    let range = f64::from(view.max_range);
    // The pyramid of the four border rays, cut at z = max_range, holds every point within max_range.
    for (u, v) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let side = |axis: usize, end: i32| {
            let border = if end == 0 { 0.0 } else { view.image[axis] };
            f64::from((border - view.principal[axis]) / view.focal[axis])
        };
        let corner = view.pose.rotation * (Vector3::new(side(0, u), side(1, v), 1.0) * range) + view.pose.translation;
        low = low.inf(&corner);
        high = high.sup(&corner);
    }
    // Nothing farther than max_range from the camera along any axis is needed either.
    let reach = Vector3::repeat(range);
    low = low.sup(&(view.pose.translation - reach));
    high = high.inf(&(view.pose.translation + reach));
    let block = BLOCK_EDGE as f64 * view.voxel_size;
    // One voxel of slack: for rounding.
    let key = |p: Vector3<f64>, slack: f64| -> BlockKey {
        (p / block).map(|c| (c + slack / BLOCK_EDGE as f64).floor() as i32).into()
    };
    (key(low, -1.0), key(high, 1.0))
}
