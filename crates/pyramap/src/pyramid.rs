//! Stage 2, pyramid (Eq. 10, 11): coarser images that keep, of each window, the range that matters at their distance.
//!
//! Every layer is defined over the full-resolution ranges. It need not read them all: of a window, the range nearest
//! to `t_i` is the largest if all are nearer to the camera than `t_i`, the smallest if all are farther, and only where
//! `t_i` lies between does the search go down into the four halves of the window. So one pyramid of minima and maxima,
//! made once, gives every layer exactly, and most texels of a layer cost one comparison.

use crate::ranges::Ranges;
use rayon::prelude::*;
use std::ops::Range;

/// Which range of a window a layer keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// The one nearest to `t_i` (Eq. 10); of two equally near, the smaller.
    Nearest,
    /// The smallest (Andert 2009).
    Minimum,
}

/// One image of the pyramid.
#[derive(Clone, Debug, Default)]
pub struct Layer {
    /// Columns: `ceil(image width / 2^i)`.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Ranges row by row, metres; `0` where the window has no reading, `+inf` where it has no return and nothing else.
    pub values: Vec<f32>,
}

/// The layers `M_i`.
#[derive(Clone, Debug, Default)]
pub struct Pyramid {
    /// Layer `i` halves the image `i` times. Those not asked for are empty.
    pub layers: Vec<Layer>,
    extremes: Vec<Extremes>,
}

/// Smallest and largest valid range of each window of one size.
#[derive(Clone, Debug, Default)]
struct Extremes {
    width: usize,
    height: usize,
    /// `+inf` where no range is valid.
    min: Vec<f32>,
    /// `0` where no range is valid.
    max: Vec<f32>,
}

/// How many layers an image has: while `2^i <= min(width, height)`.
pub fn num_layers(width: usize, height: usize) -> usize {
    width.min(height).ilog2() as usize + 1
}

impl Pyramid {
    /// Builds those of the layers of `ranges` that are `wanted`; `t_0` is the distance, metres, at which a voxel is one
    /// pixel wide.
    pub fn compute(&mut self, ranges: &Ranges, t_0: f64, selection: Selection, wanted: Range<usize>) {
        self.layers.resize_with(num_layers(ranges.width, ranges.height), Layer::default);
        if wanted.end > 1 {
            self.extremes.resize_with(wanted.end, Extremes::default);
            self.extremes[0].copy(ranges);
            for i in 1..wanted.end {
                let (finer, coarser) = self.extremes.split_at_mut(i);
                coarser[0].halve(&finer[i - 1]);
            }
        }
        for (i, layer) in self.layers.iter_mut().enumerate() {
            if !wanted.contains(&i) {
                *layer = Layer::default();
                continue;
            }
            if i == 0 {
                // Windows of one pixel.
                (layer.width, layer.height) = (ranges.width, ranges.height);
                layer.values.clone_from(&ranges.values);
                continue;
            }
            let t_i = (t_0 / f64::from(1u32 << i)) as f32;
            let extremes = &self.extremes[..=i];
            let (width, height) = (extremes[i].width, extremes[i].height);
            (layer.width, layer.height) = (width, height);
            layer.values.resize(width * height, 0.0);
            layer.values.par_chunks_mut(width).with_min_len(64).enumerate().for_each(|(b, row)| match selection {
                Selection::Nearest => {
                    row.iter_mut().enumerate().for_each(|(a, out)| *out = nearest(extremes, a, b, t_i))
                }
                Selection::Minimum => {
                    let row_of = b * width..(b + 1) * width;
                    let min_max = extremes[i].min[row_of.clone()].iter().zip(&extremes[i].max[row_of]);
                    row.iter_mut()
                        .zip(min_max)
                        .for_each(|(out, (&min, &max))| *out = if max > 0.0 { min } else { 0.0 });
                }
            });
        }
    }
}

/// The range nearest to `t` in window `(a, b)` of the last of `extremes`; `0` if none is valid.
#[inline]
fn nearest(extremes: &[Extremes], a: usize, b: usize, t: f32) -> f32 {
    let (windows, finer) = extremes.split_last().expect("there is a layer 0");
    let (min, max) = (windows.min[b * windows.width + a], windows.max[b * windows.width + a]);
    if max <= t {
        max
    } else if min >= t {
        min
    } else {
        nearest_of_children(finer, a, b, t)
    }
}

/// The search goes on in the four windows of half the edge, those at the border only where they exist.
fn nearest_of_children(finer: &[Extremes], a: usize, b: usize, t: f32) -> f32 {
    let windows = finer.last().expect("a single range is its own minimum and maximum");
    let mut best = 0.0;
    let mut best_distance = f32::INFINITY;
    for child_b in 2 * b..(2 * b + 2).min(windows.height) {
        for child_a in 2 * a..(2 * a + 2).min(windows.width) {
            let range = nearest(finer, child_a, child_b, t);
            let distance = (range - t).abs();
            if range > 0.0 && (best == 0.0 || distance < best_distance || (distance == best_distance && range < best)) {
                (best, best_distance) = (range, distance);
            }
        }
    }
    best
}

impl Extremes {
    fn copy(&mut self, ranges: &Ranges) {
        self.fit(ranges.width, ranges.height);
        self.max.copy_from_slice(&ranges.values);
        let pixels = self.min.iter_mut().zip(&ranges.values);
        pixels.for_each(|(min, &range)| *min = if range > 0.0 { range } else { f32::INFINITY });
    }

    fn halve(&mut self, finer: &Extremes) {
        self.fit(finer.width.div_ceil(2), finer.height.div_ceil(2));
        let rows = self.min.par_chunks_mut(self.width).zip(self.max.par_chunks_mut(self.width));
        rows.with_min_len(32).enumerate().for_each(|(b, (min, max))| {
            let upper = 2 * b * finer.width..(2 * b + 1) * finer.width;
            // At the lower border of an odd height the one row stands for both.
            let second = (2 * b + 1).min(finer.height - 1);
            let lower = second * finer.width..(second + 1) * finer.width;
            reduce_pairs(&finer.min[upper.clone()], &finer.min[lower.clone()], min, |a, b| if a < b { a } else { b });
            reduce_pairs(&finer.max[upper], &finer.max[lower], max, |a, b| if a > b { a } else { b });
        });
    }

    fn fit(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.min.resize(width * height, 0.0);
        self.max.resize(width * height, 0.0);
    }
}

/// Each output is the reduction of a 2 x 2 window of two rows; the last window of an odd width has one column.
#[inline(always)]
fn reduce_pairs(upper: &[f32], lower: &[f32], out: &mut [f32], reduce: impl Fn(f32, f32) -> f32) {
    let windows = upper.chunks_exact(2).zip(lower.chunks_exact(2));
    out.iter_mut().zip(windows).for_each(|(out, (u, l))| *out = reduce(reduce(u[0], u[1]), reduce(l[0], l[1])));
    if upper.len() % 2 == 1 {
        out[upper.len() / 2] = reduce(upper[upper.len() - 1], lower[lower.len() - 1]);
    }
}
