//! The paper's baseline, after Andert 2009: minimum ranges, one layer, bilinear within it.

use super::{Frame, Pixels, Rule, apparent_distances, bilinear, layers_between, layers_of};
use crate::cull::{LayersRead, Reads};
use crate::sensors::Projection;
use crate::simd::Vector;
use crate::view::{Lanes, Points};

/// `t_0` and the number of layers.
pub struct MinLayer {
    /// The distance at which a voxel is one pixel wide, metres.
    pub t_0: f32,
    /// Layers in the pyramid.
    pub count: usize,
}

impl Reads for MinLayer {
    const REACH: f32 = 1.0;
    const HALF_EDGE: f64 = 0.0;

    #[inline(always)]
    fn layers(&self, near: f32, far: f32) -> LayersRead {
        let (first, last) = layers_between(self.t_0, self.count, near, far);
        LayersRead { first, last, fallback: false, certain: true }
    }
}

impl<P: Projection> Rule<P> for MinLayer {
    #[inline(always)]
    fn log_odds<V: Vector>(&self, frame: &Frame<P>, _: &Points, pixels: &Pixels) -> Lanes {
        let layers = layers_of(self.t_0, self.count, &apparent_distances(frame, pixels));
        let mut result = [f32::NAN; 8];
        for i in (layers.first..=layers.last).step_by(2) {
            let [here, next] = bilinear::<V, P>(frame, [i, (i + 1).min(self.count - 1)], pixels);
            for n in 0..8 {
                let served = if layers.each[n] == i as i32 + 1 { next[n] } else { result[n] };
                result[n] = if layers.each[n] == i as i32 { here[n] } else { served };
            }
        }
        result
    }
}
