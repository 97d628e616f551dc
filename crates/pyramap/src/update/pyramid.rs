//! The paper's rule: bilinear in two neighbouring layers, linear between them (Eq. 12 to 17).

use super::{Frame, Pixels, Rule, bilinear, layer_of};
use crate::cull::{LayersRead, Reads};
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
        let first = layer_of(self.t_0 / far, self.count);
        let last = if near > 0.0 { layer_of(self.t_0 / near, self.count) } else { self.count - 1 };
        // Beyond t_0 layer 0 serves alone, within the last layer's distance the last: there is no other to fall back on.
        let alone = far > self.t_0 || last == self.count - 1;
        LayersRead { first, last: (last + 1).min(self.count - 1), fallback: !alone, certain: true }
    }
}

impl Rule for Pyramid {
    #[inline(always)]
    fn log_odds(&self, frame: &Frame, _: &Points, pixels: &Pixels) -> Lanes {
        let mut layer = [0; 8];
        let mut towards_next: Lanes = [0.0; 8];
        for n in 0..8 {
            let q = self.t_0 / pixels.range[n];
            layer[n] = layer_of(q, self.count);
            let alone = (q < 1.0) | (layer[n] == self.count - 1);
            // Eq. 17, with t_(i+1) = t_i / 2: (z - t_i) / (t_(i+1) - t_i) = 2 (1 - z / t_i), and z / t_i = 2^i / q.
            towards_next[n] = if alone { 0.0 } else { 2.0 - 2.0 * ((1u32 << layer[n]) as f32 / q) };
        }
        let first = layer.iter().fold(self.count, |least, &i| least.min(i));
        let last = layer.iter().fold(0, |most, &i| most.max(i));
        let mut result = [f32::NAN; 8];
        let mut here = bilinear(frame, first, pixels);
        for i in first..=last {
            let next = if i + 1 < self.count { bilinear(frame, i + 1, pixels) } else { [f32::NAN; 8] };
            for n in 0..8 {
                let alone = (i == self.count - 1) | (pixels.range[n] > self.t_0);
                let blended = here[n] + towards_next[n] * (next[n] - here[n]);
                let served = if next[n].is_nan() | alone {
                    here[n]
                } else if here[n].is_nan() {
                    next[n]
                } else {
                    blended
                };
                result[n] = if layer[n] == i { served } else { result[n] };
            }
            here = next;
        }
        result
    }
}
