//! The reference (Eq. 8, 9): every pixel ray that cuts the voxel, weighted by the length it has inside.

use super::{Frame, Pixels, Rule};
use crate::cull::{Eighths, LayersRead, Reads};
use crate::sensors::{Outline, PixelRay, Projection};
use crate::simd::Simd;
use crate::view::{Lanes, Points, View};
use nalgebra::Vector3;
use std::ops::Range;

/// The rule.
pub struct Ideal {
    /// Up to this distance, metres, every voxel in sight is cut by some ray.
    certain_within: f32,
}

impl Ideal {
    /// The rule for one view.
    pub fn new<P: Projection>(view: &View<P>) -> Self {
        Self { certain_within: view.projection.certain_within(view.voxel_size) }
    }
}

impl Reads for Ideal {
    const REACH: f32 = 0.0;
    const HALF_EDGE: f64 = 0.5;

    fn layers(&self, _near: f32, far: f32) -> LayersRead {
        LayersRead { first: 0, last: 0, fallback: false, certain: far <= self.certain_within }
    }
}

impl<P: Projection> Rule<P> for Ideal {
    #[inline(always)]
    fn log_odds<S: Simd>(&self, frame: &Frame<P>, points: &Points, pixels: &Pixels) -> Lanes {
        let voxel = Eighths::new::<Ideal>(frame.view, 2);
        std::array::from_fn(|n| ideal_log_odds(frame, &voxel, points.lane(n), pixels.range[n]))
    }
}

fn ideal_log_odds<P: Projection>(frame: &Frame<P>, voxel: &Eighths<P>, centre: [f32; 3], range: f32) -> f32 {
    let view = frame.view;
    let layer = &frame.layers[0];
    let outline = view.projection.outline(voxel, centre, range);
    if !outline.in_sight {
        return f32::NAN;
    }
    // Rays are cut with the voxel along the world's axes, relative to the sensor.
    let centre = view.pose.rotation * Vector3::from(centre.map(f64::from));
    let half = 0.5 * view.voxel_size;
    let (rows, columns) = pixels_in(view, &outline);
    let (mut sum, mut total) = (0.0, 0.0);
    for row in rows {
        for column in columns.clone() {
            // Beyond the border only where the image wraps.
            let column = column.rem_euclid(layer.width as isize) as usize;
            let texel = row * layer.width + column;
            let surface = layer.surface[texel];
            let length = if surface.is_nan() { 0.0 } else { chord(view, &centre, half, column, row) };
            if length > 0.0 {
                let inv_sigma = layer.inv_sigma[if layer.inv_sigma.len() == 1 { 0 } else { texel }];
                sum += length * f64::from(frame.table.log_odds((range - surface) * inv_sigma));
                total += length;
            }
        }
    }
    if total > 0.0 { (sum / total) as f32 } else { f32::NAN }
}

/// Length of a pixel's ray inside the cube of half an edge `half` around `centre`, metres.
fn chord<P: Projection>(view: &View<P>, centre: &Vector3<f64>, half: f64, column: usize, row: usize) -> f64 {
    let PixelRay { start, direction } = view.projection.ray(column, row);
    // With perspective all rays start where the sensor is.
    let start = if P::PERSPECTIVE { Vector3::zeros() } else { view.pose.rotation * start };
    let direction = (view.pose.rotation * direction).normalize();
    let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        // A ray along a face divides by zero: the infinities leave the interval as it is, or empty it.
        let a = (centre[axis] - start[axis] - half) / direction[axis];
        let b = (centre[axis] - start[axis] + half) / direction[axis];
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (leave - enter).max(0.0)
}

/// Rows and columns of the pixels whose rays may cut a voxel.
fn pixels_in<P: Projection>(view: &View<P>, outline: &Outline) -> (Range<usize>, Range<isize>) {
    let [width, height] = view.projection.image();
    if !outline.bounded {
        // Any pixel may see a cube that reaches behind the camera.
        return (0..height as usize, 0..width as isize);
    }
    let ([top, bottom], [left, right]) = (outline.rows, outline.columns);
    let rows = (top - 0.5).max(0.0) as usize..(bottom + 0.5).clamp(0.0, height) as usize;
    let columns = if !view.projection.wraps() {
        (left - 0.5).max(0.0) as isize..(right + 0.5).clamp(0.0, width) as isize
    } else if right - left < width - 3.0 {
        (left - 0.5).floor() as isize..(right + 0.5).ceil() as isize
    } else {
        0..width as isize
    };
    (rows, columns)
}
