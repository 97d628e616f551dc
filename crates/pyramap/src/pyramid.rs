//! Stage 2, pyramid (Eq. 10, 11): coarser images that keep, of each window, the range that matters at their distance.
//!
//! Every layer is defined over the full-resolution ranges. It need not read them all: of a window, the range nearest
//! to `t_i` is the largest if all are nearer to the camera than `t_i`, the smallest if all are farther, and only where
//! `t_i` lies between does the search go down into the four halves of the window. So one pyramid of minima and maxima,
//! made once, gives every layer exactly, and most texels of a layer cost one comparison.

use crate::ranges::Ranges;
use crate::simd::{Instructions, Kernel, Simd};
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
    /// From windows of 2 x 2 pixels on.
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
        self.extremes.resize_with(wanted.end.saturating_sub(1), Extremes::default);
        for i in 0..self.extremes.len() {
            let (finer, coarser) = self.extremes.split_at_mut(i);
            match finer.last() {
                None => coarser[0].of_pixels(ranges),
                Some(finer) => coarser[0].halve(finer),
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
            let windows = Windows { ranges, extremes: &self.extremes[..i] };
            let Extremes { width, height, ref min, ref max } = self.extremes[i - 1];
            (layer.width, layer.height) = (width, height);
            layer.values.resize(width * height, 0.0);
            layer.values.par_chunks_mut(width).with_min_len(64).enumerate().for_each(|(b, row)| {
                let row_of = b * width..(b + 1) * width;
                let (min, max) = (&min[row_of.clone()], &max[row_of]);
                Instructions::widest().run(Choose { min, max, t: t_i, selection, out: row });
                if selection == Selection::Nearest {
                    for (a, out) in row.iter_mut().enumerate().filter(|(_, out)| out.is_nan()) {
                        *out = windows.nearest_of_parts(a, b, t_i);
                    }
                }
            });
        }
    }
}

/// What the extremes of each window of a row say of the range that a layer keeps; NaN where they do not tell.
struct Choose<'a> {
    min: &'a [f32],
    max: &'a [f32],
    t: f32,
    selection: Selection,
    out: &'a mut [f32],
}

impl Kernel for Choose<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let windows = self.out.iter_mut().zip(self.min.iter().zip(self.max));
        match self.selection {
            Selection::Nearest => windows.for_each(|(out, (&min, &max))| *out = nearest_extreme(min, max, self.t)),
            Selection::Minimum => windows.for_each(|(out, (&min, &max))| *out = if max > 0.0 { min } else { 0.0 }),
        }
    }
}

/// The range nearest to `t` of a window with these extremes, `0` if none is valid; NaN if `t` lies between them.
#[inline(always)]
fn nearest_extreme(min: f32, max: f32, t: f32) -> f32 {
    let nearer = if min >= t { min } else { f32::NAN };
    if max <= t { max } else { nearer }
}

/// The windows in which the search goes on, smaller and smaller.
#[derive(Clone, Copy)]
struct Windows<'a> {
    ranges: &'a Ranges,
    extremes: &'a [Extremes],
}

impl Windows<'_> {
    /// The range nearest to `t` in window `(a, b)` of the last of these; `0` if none is valid.
    fn nearest(self, a: usize, b: usize, t: f32) -> f32 {
        let Some(Extremes { width, min, max, .. }) = self.extremes.last() else {
            return self.ranges.values[b * self.ranges.width + a];
        };
        let found = nearest_extreme(min[b * width + a], max[b * width + a], t);
        if found.is_nan() { self.nearest_of_parts(a, b, t) } else { found }
    }

    /// The search in the four windows of half the edge, those at the border only where they exist.
    fn nearest_of_parts(self, a: usize, b: usize, t: f32) -> f32 {
        let (_, finer) = self.extremes.split_last().expect("a pixel is its own nearest");
        let parts = Self { extremes: finer, ..self };
        let (width, height) = finer.last().map_or((self.ranges.width, self.ranges.height), |w| (w.width, w.height));
        let mut best = 0.0;
        let mut best_distance = f32::INFINITY;
        for part_b in 2 * b..(2 * b + 2).min(height) {
            for part_a in 2 * a..(2 * a + 2).min(width) {
                let range = parts.nearest(part_a, part_b, t);
                let distance = (range - t).abs();
                let nearer = distance < best_distance || (distance == best_distance && range < best);
                if range > 0.0 && (best == 0.0 || nearer) {
                    (best, best_distance) = (range, distance);
                }
            }
        }
        best
    }
}

impl Extremes {
    fn of_pixels(&mut self, ranges: &Ranges) {
        let Ranges { width, height, ref values, .. } = *ranges;
        self.halve_rows([width, height], [values, values], true);
    }

    fn halve(&mut self, finer: &Extremes) {
        self.halve_rows([finer.width, finer.height], [&finer.min, &finer.max], false);
    }

    fn halve_rows(&mut self, [width, height]: [usize; 2], [min, max]: [&[f32]; 2], pixels: bool) {
        self.fit(width.div_ceil(2), height.div_ceil(2));
        let rows = self.min.par_chunks_mut(self.width).zip(self.max.par_chunks_mut(self.width));
        rows.with_min_len(32).enumerate().for_each(|(b, (out_min, out_max))| {
            let upper = 2 * b * width..(2 * b + 1) * width;
            // At the lower border of an odd height the one row stands for both.
            let second = (2 * b + 1).min(height - 1);
            let lower = second * width..(second + 1) * width;
            let [min, max] = [min, max].map(|values| [&values[upper.clone()], &values[lower.clone()]]);
            Instructions::widest().run(Halve { min, max, pixels, out_min, out_max });
        });
    }

    fn fit(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.min.resize(width * height, 0.0);
        self.max.resize(width * height, 0.0);
    }
}

/// The extremes of the 2 x 2 windows of two rows of windows, or of pixels, of which those without a reading are 0.
struct Halve<'a> {
    min: [&'a [f32]; 2],
    max: [&'a [f32]; 2],
    pixels: bool,
    out_min: &'a mut [f32],
    out_max: &'a mut [f32],
}

impl Kernel for Halve<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let least = |a: f32, b: f32| if a < b { a } else { b };
        if self.pixels {
            let valid = |range: f32| if range > 0.0 { range } else { f32::INFINITY };
            reduce_pairs(self.min, self.out_min, valid, least);
        } else {
            reduce_pairs(self.min, self.out_min, |range| range, least);
        }
        reduce_pairs(self.max, self.out_max, |range| range, |a, b| if a > b { a } else { b });
    }
}

/// Each output is the reduction of a 2 x 2 window of two rows; the last window of an odd width has one column.
#[inline(always)]
fn reduce_pairs(
    [upper, lower]: [&[f32]; 2],
    out: &mut [f32],
    value: impl Fn(f32) -> f32,
    reduce: impl Fn(f32, f32) -> f32,
) {
    let (last, windows) = (upper.len() - 1, upper.chunks_exact(2).zip(lower.chunks_exact(2)));
    let column = |upper: f32, lower: f32| reduce(value(upper), value(lower));
    out.iter_mut().zip(windows).for_each(|(out, (u, l))| *out = reduce(column(u[0], l[0]), column(u[1], l[1])));
    if upper.len() % 2 == 1 {
        out[last / 2] = column(upper[last], lower[last]);
    }
}
