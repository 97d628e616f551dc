//! The reference (Eq. 8, 9): every pixel ray that cuts the voxel, weighted by the length it has inside.

use super::{Frame, Pixels, Rule};
use crate::cull::{LayersRead, Reads};
use crate::view::{Lanes, Points, View};
use nalgebra::Vector3;

/// The rule.
pub struct Ideal {
    /// Up to this distance, metres, every voxel in sight is cut by some ray.
    certain_within: f32,
}

impl Ideal {
    /// The rule for one view.
    pub fn new(view: &View) -> Self {
        // A voxel holds a ball of diameter r, whose image is no smaller than a disc of diameter f r / z. A disc of
        // diameter sqrt(2) pixels holds a pixel centre wherever it lies; the rest is slack for rounding.
        let focal = view.focal[0].min(view.focal[1]);
        Self { certain_within: 0.999 * focal * view.voxel_size as f32 / std::f32::consts::SQRT_2 }
    }
}

impl Reads for Ideal {
    const REACH: f32 = 0.0;
    const HALF_EDGE: f64 = 0.5;

    fn layers(&self, _near: f32, far: f32) -> LayersRead {
        LayersRead { first: 0, last: 0, fallback: false, certain: far <= self.certain_within }
    }
}

impl Rule for Ideal {
    #[inline(always)]
    fn log_odds(&self, frame: &Frame, points: &Points, pixels: &Pixels) -> Lanes {
        std::array::from_fn(|n| ideal_log_odds(frame, points.lane(n), pixels.range[n]))
    }
}

fn ideal_log_odds(frame: &Frame, centre: [f32; 3], range: f32) -> f32 {
    let view = frame.view;
    let layer = &frame.layers[0];
    if centre[2] <= 0.0 || range > view.max_range {
        return f32::NAN;
    }
    // Rays are cut with the voxel along the world's axes, relative to the camera.
    let centre = view.pose.rotation * Vector3::from(centre.map(f64::from));
    let half = 0.5 * view.voxel_size;
    let (columns, rows) = projected_cube(view, &centre, half);
    let (mut sum, mut total) = (0.0, 0.0);
    for row in rows.0..rows.1 {
        for column in columns.0..columns.1 {
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
fn chord(view: &View, centre: &Vector3<f64>, half: f64, column: usize, row: usize) -> f64 {
    let in_camera = |axis: usize, pixel: usize| {
        (pixel as f64 + 0.5 - f64::from(view.principal[axis])) / f64::from(view.focal[axis])
    };
    let direction = (view.pose.rotation * Vector3::new(in_camera(0, column), in_camera(1, row), 1.0)).normalize();
    let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        // A ray along a face divides by zero: the infinities leave the interval as it is, or empty it.
        let a = (centre[axis] - half) / direction[axis];
        let b = (centre[axis] + half) / direction[axis];
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (leave - enter).max(0.0)
}

/// Pixels, first and one past the last along each axis, whose rays may cut a cube.
fn projected_cube(view: &View, centre: &Vector3<f64>, half: f64) -> ((usize, usize), (usize, usize)) {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for corner in 0..8 {
        let side = |axis: usize| if corner >> axis & 1 == 0 { -half } else { half };
        let p = view.pose.rotation.transpose() * (centre + Vector3::new(side(0), side(1), side(2)));
        for axis in 0..2 {
            // A cube that reaches behind the camera may be seen by any pixel.
            let (a, b) = if p.z > 1e-6 {
                let pixel = p[axis] / p.z * f64::from(view.focal[axis]) + f64::from(view.principal[axis]) - 0.5;
                (pixel, pixel)
            } else {
                (f64::NEG_INFINITY, f64::INFINITY)
            };
            (low[axis], high[axis]) = (low[axis].min(a), high[axis].max(b));
        }
    }
    let pixels = |axis: usize| {
        let size = f64::from(view.image[axis]);
        (low[axis].floor().clamp(0.0, size) as usize, (high[axis].floor() + 1.0).clamp(0.0, size) as usize)
    };
    (pixels(0), pixels(1))
}
