//! Our rule: the mean log-odd over points spread evenly inside the voxel, each read from the pixel it falls on.
//!
//! The ideal (Eq. 8) weights each ray by its length inside the voxel, and rays through a volume have their length in
//! proportion to the volume around them: points spread evenly in the voxel are a sample of just that weight.

use super::{Frame, Pixels, Rule};
use crate::cull::{LayersRead, Reads};
use crate::sensors::{Projected, Projection};
use crate::simd::Simd;
use crate::surfaces::texel;
use crate::view::{Lanes, Points, View};

/// The sample points of a voxel, relative to its centre, in the camera's frame, metres.
pub struct Area {
    /// The points.
    pub samples: Points,
}

impl Area {
    /// The rule for one view: eight points of a lattice, so placed that along each axis all eight differ: they
    /// come nearer to the ideal than the middles of the voxel's eighths. `examples/area_sampling.py` is the experiment.
    pub fn new<P: Projection>(view: &View<P>) -> Self {
        let place = |sample: usize, step: f64| ((sample as f64 + 0.5) * step / 8.0).fract() - 0.5;
        Self { samples: view.voxel_offsets(|sample| [place(sample, 1.0), place(sample, 5.0), place(sample, 7.0)]) }
    }
}

impl Reads for Area {
    /// A point is read from the pixel whose centre is nearest.
    const REACH: f32 = 0.5;
    /// The outermost points lie half a step from the voxel's faces.
    const HALF_EDGE: f64 = 7.0 / 16.0;

    #[inline(always)]
    fn layers(&self, _near: f32, _far: f32) -> LayersRead {
        LayersRead { first: 0, last: 0, fallback: false, certain: true }
    }
}

impl<P: Projection> Rule<P> for Area {
    #[inline(always)]
    fn log_odds<S: Simd>(&self, frame: &Frame<P>, points: &Points, pixels: &Pixels) -> Lanes {
        let layer = &frame.layers[0];
        let (projection, last) = (&frame.view.projection, [(layer.width - 1) as f32, (layer.height - 1) as f32]);
        let mut sum = [0.0; 8];
        let mut count = [0.0; 8];
        for sample in 0..8 {
            let [dx, dy, dz] = self.samples.lane(sample);
            for n in 0..8 {
                let point = [points.x[n] + dx, points.y[n] + dy, points.z[n] + dz];
                let Projected { u, v, in_front, .. } = projection.project(point);
                let at = texel(v, last[1]) as usize * layer.width + texel(u, last[0]) as usize;
                // SAFETY: `texel` clamps to the layer.
                let surface = unsafe { *layer.surface.get_unchecked(at) };
                let inv_sigma = if layer.inv_sigma.len() == 1 {
                    layer.inv_sigma[0]
                } else {
                    unsafe { *layer.inv_sigma.get_unchecked(at) }
                };
                // Points of a voxel in sight may lie outside the image, and are read at its border, or behind the camera.
                let valid = if surface.is_nan() | !in_front { 0.0 } else { 1.0 };
                sum[n] += valid * frame.table.log_odds((pixels.range[n] - surface) * inv_sigma);
                count[n] += valid;
            }
        }
        std::array::from_fn(|n| if count[n] > 0.0 { sum[n] / count[n] } else { f32::NAN })
    }
}
