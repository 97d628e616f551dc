//! The paper's baseline, after Andert 2009: minimum ranges, one layer, bilinear within it.

use super::{Frame, Pixels, Rule, apparent_distances, bilinear, layers_between, layers_of, power_of_two};
use crate::cull::{LayersRead, Reads};
use crate::sensors::Projection;
use crate::simd::{Real, Simd};
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
    fn log_odds<S: Simd>(&self, frame: &Frame<P>, _: &Points, pixels: &Pixels) -> Lanes {
        let (splat, select) = (S::Eight::splat, S::Eight::select);
        let q = splat(self.t_0) / apparent_distances::<S, P>(pixels);
        let (first, last) = layers_of::<S>(q, self.count);
        let mut result = splat(f32::NAN);
        for i in (first..=last).step_by(2) {
            let [here, next] = bilinear::<S, P>(frame, [i, (i + 1).min(self.count - 1)], pixels);
            for (i, here) in [(i, here), (i + 1, next)] {
                result = if i == first { here } else { select(q.at_least(splat(power_of_two(i))), here, result) };
            }
        }
        S::store(result)
    }
}
