//! The paper's rule: bilinear in two neighbouring layers, linear between them (Eq. 12 to 17).

use super::{Frame, Pixels, Rule, apparent_distances, bilinear, layers_between, layers_of, power_of_two};
use crate::cull::{LayersRead, Reads};
use crate::sensors::Projection;
use crate::simd::{Real, Simd};
use crate::view::{Lanes, Points};

/// `t_0` and the number of layers.
pub struct Pyramid {
    /// The distance at which a voxel is one pixel wide, metres.
    pub t_0: f32,
    /// Layers in the pyramid.
    pub count: usize,
}

impl Reads for Pyramid {
    const REACH: f32 = 1.0;
    const HALF_EDGE: f64 = 0.0;

    #[inline(always)]
    fn layers(&self, near: f32, far: f32) -> LayersRead {
        let (first, last) = layers_between(self.t_0, self.count, near, far);
        // Beyond t_0 layer 0 serves alone.
        LayersRead { first, last, fallback: far <= self.t_0, certain: true }
    }
}

impl<P: Projection> Rule<P> for Pyramid {
    #[inline(always)]
    fn log_odds<S: Simd>(&self, frame: &Frame<P>, _: &Points, pixels: &Pixels) -> Lanes {
        let (splat, select) = (S::Eight::splat, S::Eight::select);
        let distance = apparent_distances::<S, P>(pixels);
        let t_0 = splat(self.t_0);
        let q = t_0 / distance;
        let (first, last) = layers_of::<S>(q, self.count);
        let mut result = splat(f32::NAN);
        for i in first..=last {
            let is_last = i + 1 == self.count;
            let [here, next] = bilinear::<S, P>(frame, [i, if is_last { i } else { i + 1 }], pixels);
            // Eq. 17, with t_(i+1) = t_i / 2: (z - t_i) / (t_(i+1) - t_i) = 2 (1 - z / t_i).
            let towards_next = splat(2.0) - splat(2.0) * (distance * splat(power_of_two(i)) / t_0);
            let both = select(here.is_number(), here + towards_next * (next - here), next);
            // Beyond t_0 layer 0 serves alone, within the last layer's distance the last.
            let blended = select(next.is_number(), select(distance.greater(t_0), here, both), here);
            let served = if is_last { here } else { blended };
            // Of what is nearer a coarser layer answers, in a later round.
            result = if i == first { served } else { select(q.at_least(splat(power_of_two(i))), served, result) };
        }
        S::store(result)
    }
}
