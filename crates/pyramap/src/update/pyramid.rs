//! The paper's rule: bilinear in two neighbouring layers, linear between them (Eq. 12 to 17).

use super::{Frame, Pixels, Rule, apparent_distances, bilinear, layers_between, layers_of, power_of_two};
use crate::cull::{LayersRead, Reads};
use crate::sensors::Projection;
use crate::simd::Vector;
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
        // Beyond t_0 layer 0 serves alone, within the last layer's distance the last: there is no other to fall back on.
        let alone = far > self.t_0 || last == self.count - 1;
        LayersRead { first, last: (last + 1).min(self.count - 1), fallback: !alone, certain: true }
    }
}

impl<P: Projection> Rule<P> for Pyramid {
    #[inline(always)]
    fn log_odds<V: Vector>(&self, frame: &Frame<P>, _: &Points, pixels: &Pixels) -> Lanes {
        let distance = apparent_distances(frame, pixels);
        let layers = layers_of(self.t_0, self.count, &distance);
        let last = self.count as i32 - 1;
        let mut towards_next: Lanes = [0.0; 8];
        let mut served_alone = [false; 8];
        for n in 0..8 {
            // Eq. 17, with t_(i+1) = t_i / 2: (z - t_i) / (t_(i+1) - t_i) = 2 (1 - z / t_i).
            towards_next[n] = 2.0 - 2.0 * (distance[n] * power_of_two(layers.each[n]) / self.t_0);
            served_alone[n] = (distance[n] > self.t_0) | (layers.each[n] == last);
        }
        let mut result = [f32::NAN; 8];
        for i in layers.first..=layers.last {
            let [here, next] = bilinear::<V, P>(frame, [i, (i + 1).min(self.count - 1)], pixels);
            for n in 0..8 {
                let (l_i, l_next) = (here[n], next[n]);
                let has_next = !l_next.is_nan() & !served_alone[n];
                let blended = l_i + towards_next[n] * (l_next - l_i);
                let both = if l_i.is_nan() { l_next } else { blended };
                let served = if has_next { both } else { l_i };
                result[n] = if layers.each[n] == i as i32 { served } else { result[n] };
            }
        }
        result
    }
}
