//! Our rule: the mean log-odd over points spread evenly inside the voxel, each read from the pixel it falls on.
//!
//! The ideal (Eq. 8) weights each ray by its length inside the voxel, and rays through a volume have their length in
//! proportion to the volume around them: points spread evenly in the voxel are a sample of just that weight. Eight are
//! enough where they agree, and they do in most voxels. Nearly all that is left to gain lies in the others: where the
//! points contradict each other, and where all fall into a hole that some ray escapes. These are asked at many more.

use super::{Frame, Pixels, Rule};
use crate::cull::{Eighths, LayersRead, Reads, bits_of};
use crate::sensors::Projection;
use crate::simd::{Places, Real, Simd};
use crate::surfaces::texel;
use crate::view::{Lanes, Points, View};
use std::array::from_fn;

/// How many times eight points are added where the first eight do not settle a voxel; an even number.
pub const MORE: usize = 6;

/// Log-odds that differ by more than this contradict each other.
pub const TOLERANCE: f32 = 0.5;

/// The sample points of a voxel, relative to its centre, in the camera's frame, metres.
pub struct Area<P: Projection> {
    /// Those at which each voxel is asked.
    pub few: Points,
    /// Those that are added where these do not settle it.
    pub more: [Points; MORE],
    /// A single voxel.
    voxel: Eighths<P>,
}

impl<P: Projection> Area<P> {
    /// The rule for one view. `examples/area_sampling.py` is the experiment that chose points and tolerance.
    pub fn new(view: &View<P>) -> Self {
        Self {
            few: view.voxel_offsets(|n| lattice(n, 8, [1, 5, 7])),
            more: from_fn(|eight| view.voxel_offsets(|n| lattice(8 * eight + n, 8 * MORE, [1, 13, 19]))),
            voxel: Eighths::new::<Self>(view, 2),
        }
    }

    /// Those of the voxels that have a pixel with a reading, a bit each. To ask for bounds is quicker than to ask all points.
    #[inline(always)]
    fn with_readings<S: Simd>(&self, frame: &Frame<P>, centres: &Points, voxels: u32) -> u32 {
        let layer = &frame.layers[0];
        let (_, outline) = frame.view.projection.outline_eight::<S>(&self.voxel, centres);
        let cells = layer.cells::<S>(1.0, outline.columns, outline.rows, Self::REACH);
        let mut readings = voxels & !S::bits(outline.bounded);
        for n in bits_of(voxels & !readings) {
            readings |= u32::from(layer.bounds(&cells, n).far() > f32::NEG_INFINITY) << n;
        }
        readings
    }
}

/// Point `n` of `count` in a lattice over the voxel, in voxels from its centre. Along each axis all points differ, if no
/// step has a factor in common with their number: they come nearer to the ideal than as many in a cube.
fn lattice(n: usize, count: usize, steps: [usize; 3]) -> [f64; 3] {
    steps.map(|step| ((n as f64 + 0.5) * step as f64 / count as f64).fract() - 0.5)
}

/// What some points of each lane were told: the sum of their log-odds, of how many, and the least and the greatest.
#[derive(Clone, Copy)]
struct Told<E> {
    sum: E,
    count: E,
    least: E,
    most: E,
}

impl<E: Real> Told<E> {
    #[inline(always)]
    fn nothing() -> Self {
        let (zero, infinite) = (E::splat(0.0), E::splat(f32::INFINITY));
        Self { sum: zero, count: zero, least: infinite, most: zero - infinite }
    }

    #[inline(always)]
    fn with(self, log_odds: E, valid: E::Mask) -> Self {
        let Self { sum, count, least, most } = self;
        Self {
            sum: sum + E::select(valid, log_odds, E::splat(0.0)),
            count: count + E::select(valid, E::splat(1.0), E::splat(0.0)),
            least: least.min(E::select(valid, log_odds, least)),
            most: most.max(E::select(valid, log_odds, most)),
        }
    }
}

/// Asks two points of each lane what the pixels they fall on say of its range.
#[inline(always)]
fn ask<S: Simd, P: Projection>(
    frame: &Frame<P>,
    points: [Points; 2],
    range: S::Eight,
    told: Told<S::Eight>,
) -> Told<S::Eight> {
    let layer = &frame.layers[0];
    let [first, second] =
        [frame.view.projection.project_eight::<S>(&points[0]), frame.view.projection.project_eight::<S>(&points[1])];
    // Points of a voxel in sight may lie outside the image, and are read at its border, or behind the camera.
    let rows = texel(S::join([first.v, second.v]), layer.height);
    let columns = texel(S::join([first.u, second.u]), layer.width);
    // SAFETY: `texel` clamps to the layer.
    let (surface, inv_sigma) = unsafe {
        let places = S::places(rows, columns, [layer.width as u32; 2]);
        let constant = layer.inv_sigma.len() == 1;
        let inv_sigma =
            if constant { S::Sixteen::splat(layer.inv_sigma[0]) } else { gather::<S>(&layer.inv_sigma, &places) };
        (gather::<S>(&layer.surface, &places), inv_sigma)
    };
    let log_odds = frame.table.log_odds_of::<S>((S::join([range; 2]) - surface) * inv_sigma);
    let ([log_odds, more_log_odds], [surface, more_surface]) = (S::split(log_odds), S::split(surface));
    told.with(log_odds, surface.is_number() & first.in_front)
        .with(more_log_odds, more_surface.is_number() & second.in_front)
}

/// Reads a list.
///
/// # Safety
/// The places are within it.
#[inline(always)]
unsafe fn gather<S: Simd>(list: &[f32], places: &Places) -> S::Sixteen {
    let mut numbers = [[0.0; 8]; 2];
    for n in 0..8 {
        // SAFETY: the caller's.
        numbers[0][n] = unsafe { *list.get_unchecked(places[n] as usize) };
        numbers[1][n] = unsafe { *list.get_unchecked(places[8 + n] as usize) };
    }
    S::join([S::load(&numbers[0]), S::load(&numbers[1])])
}

impl<P: Projection> Reads for Area<P> {
    /// A point is read from the pixel whose centre is nearest.
    const REACH: f32 = 0.5;
    /// The outermost points lie half a step from the voxel's faces.
    const HALF_EDGE: f64 = 0.5 - 0.5 / (8 * MORE) as f64;

    #[inline(always)]
    fn layers(&self, _near: f32, _far: f32) -> LayersRead {
        LayersRead { first: 0, last: 0, fallback: false, certain: true }
    }
}

impl<P: Projection> Rule<P> for Area<P> {
    #[inline(always)]
    fn log_odds<S: Simd>(&self, frame: &Frame<P>, points: &Points, pixels: &Pixels) -> Lanes {
        let mut told = Told::nothing();
        for n in 0..4 {
            let points = [points.moved(self.few.lane(2 * n)), points.moved(self.few.lane(2 * n + 1))];
            told = ask::<S, P>(frame, points, S::load(&pixels.range), told);
        }
        let nothing = S::bits(S::Eight::splat(0.0).at_least(told.count)) & pixels.seen;
        let contradicted = S::bits((told.most - told.least).greater(S::Eight::splat(TOLERANCE))) & pixels.seen;
        let (mut sum, mut count) = (S::store(told.sum), S::store(told.count));
        let holes = if nothing != 0 { self.with_readings::<S>(frame, points, nothing) } else { 0 };
        for n in bits_of(contradicted | holes) {
            let (centre, range) = (points.lane(n), S::Eight::splat(pixels.range[n]));
            let mut more = Told::nothing();
            for pair in self.more.chunks_exact(2) {
                more = ask::<S, P>(frame, [pair[0].moved(centre), pair[1].moved(centre)], range, more);
            }
            sum[n] += S::store(more.sum).iter().fold(0.0, |sum, one| sum + one);
            count[n] += S::store(more.count).iter().fold(0.0, |sum, one| sum + one);
        }
        from_fn(|n| if count[n] > 0.0 { sum[n] / count[n] } else { f32::NAN })
    }
}
