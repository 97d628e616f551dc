//! How a sensor sees: what the stages must know of it, and all that they know.
//!
//! The kernels are compiled for each projection by itself. What is asked of single points here is asked in loops over
//! eight lanes: an implementation has no branch, no allocation and no call in it, and is marked `#[inline(always)]`.

use crate::cull::Eighths;
use crate::pose::Pose;
use crate::pyramid;
use crate::simd::{Real, Simd};
use crate::view::{Lanes, Points};
use nalgebra::Vector3;

/// A projected point.
#[derive(Clone, Copy, Debug)]
pub struct Projected<R: Real = f32> {
    /// Column, counted from the image's border: half a pixel more than from the first pixel's centre.
    pub u: R,
    /// Row, likewise.
    pub v: R,
    /// What the sensor measures of a surface there, metres: the `z` of the paper.
    pub range: R,
    /// Whether the sensor could see the point if its image were large enough.
    pub in_front: R::Mask,
}

/// Where a cube lies in the image. Bounds may be wide, and are never too tight.
#[derive(Clone, Copy, Debug)]
pub struct Outline<R: Real = f32> {
    /// First and last column, first and last row: between them lies the projection of all that is projected for the
    /// voxels of the cube. Only to be used where `bounded`; columns may lie beyond the image, or across its seam.
    pub columns: [R; 2],
    /// First and last row.
    pub rows: [R; 2],
    /// Whether all of the cube is in front of the sensor, so that it has an outline.
    pub bounded: R::Mask,
    /// Whether some of the cube may be in the image.
    pub in_sight: R::Mask,
    /// Whether all of it is.
    pub inside: R::Mask,
}

/// The ray of a pixel in the sensor's frame: what the pixel measures lies on it, as far from its start as the reading says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelRay {
    /// Where it starts.
    pub start: Vector3<f64>,
    /// Of any length but zero.
    pub direction: Vector3<f64>,
}

/// A sensor as the stages see it.
pub trait Projection: Clone + Sync {
    /// Whether what is farther off looks smaller. If not, a voxel is as many pixels wide at every distance.
    const PERSPECTIVE: bool;
    /// What bounds the projection of a cube of one size, wherever it lies.
    type Size: Clone + Sync;

    /// Columns and rows of the image.
    fn image(&self) -> [f32; 2];
    /// How many pixels a metre at one metre's distance is wide; without perspective, at every distance.
    fn focal_length(&self) -> f64;
    /// Whether the last column's neighbour is the first.
    fn wraps(&self) -> bool;

    /// Projects a point in the sensor's frame.
    fn project(&self, point: [f32; 3]) -> Projected;
    /// Projects eight points.
    #[inline(always)]
    fn project_eight<S: Simd>(&self, points: &Points) -> Projected<S::Eight> {
        let [mut u, mut v, mut range, mut in_front] = [[0.0; 8]; 4];
        for n in 0..8 {
            let point = self.project(points.lane(n));
            (u[n], v[n], range[n]) = (point.u, point.v, point.range);
            in_front[n] = if point.in_front { 1.0 } else { 0.0 };
        }
        let in_front = S::load(&in_front).greater(S::Eight::splat(0.0));
        Projected { u: S::load(&u), v: S::load(&v), range: S::load(&range), in_front }
    }
    /// The ray of a pixel.
    fn ray(&self, column: usize, row: usize) -> PixelRay;
    /// Up to this range every voxel in sight is cut by some pixel's ray.
    fn certain_within(&self, voxel_size: f64) -> f32;

    /// Measures cubes that lie along these axes: `half` an edge, metres, holds all that is projected.
    fn size(&self, axes: &[[f32; 3]; 3], half: f32) -> Self::Size;
    /// The least and greatest range of the voxel centres in the cube around a centre, with slack for rounding.
    fn ranges(&self, cubes: &Eighths<Self>, centre: [f32; 3]) -> [f32; 2];
    /// Where the cube around a centre lies in the image; `far` is the greatest of its ranges.
    fn outline(&self, cubes: &Eighths<Self>, centre: [f32; 3], far: f32) -> Outline;
    /// The ranges and outlines of the cubes around eight centres.
    #[inline(always)]
    fn outline_eight<S: Simd>(&self, cubes: &Eighths<Self>, centres: &Points) -> ([S::Eight; 2], Outline<S::Eight>) {
        let [mut near, mut far, mut left, mut right, mut top, mut bottom] = [[0.0; 8]; 6];
        let [mut bounded, mut in_sight, mut inside] = [[0.0; 8]; 3];
        let flag = |is: bool| if is { 1.0 } else { 0.0 };
        for n in 0..8 {
            let centre = centres.lane(n);
            [near[n], far[n]] = self.ranges(cubes, centre);
            let outline = self.outline(cubes, centre, far[n]);
            [left[n], right[n]] = outline.columns;
            [top[n], bottom[n]] = outline.rows;
            (bounded[n], in_sight[n], inside[n]) =
                (flag(outline.bounded), flag(outline.in_sight), flag(outline.inside));
        }
        let is = |flags: &Lanes| S::load(flags).greater(S::Eight::splat(0.0));
        let outline = Outline {
            columns: [S::load(&left), S::load(&right)],
            rows: [S::load(&top), S::load(&bottom)],
            bounded: is(&bounded),
            in_sight: is(&in_sight),
            inside: is(&inside),
        };
        ([S::load(&near), S::load(&far)], outline)
    }
    /// Lowest and highest corner of a box, in the world, that holds all that is seen up to `max_range`.
    fn reach(&self, pose: &Pose, max_range: f64) -> [Vector3<f64>; 2];

    /// How many layers an image has. Where it wraps, all windows are whole ones: the one beside the seam would show less
    /// than its neighbours otherwise.
    fn num_layers(&self) -> usize {
        let [width, height] = self.image().map(|side| side as usize);
        let all = pyramid::num_layers(width, height);
        if self.wraps() { all.min(width.trailing_zeros() as usize + 1) } else { all }
    }

    /// The distance that says how large a voxel looks: its range, or, without perspective, always one metre.
    #[inline(always)]
    fn apparent_distance(&self, range: f32) -> f32 {
        if Self::PERSPECTIVE { range } else { 1.0 }
    }
}
