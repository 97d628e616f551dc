//! What rules that interpolate read: quads of texels, and bounds over squares of quads.

use super::{Bounds, SurfaceLayer};
use crate::simd::{Instructions, Kernel, Quad, Simd};
use rayon::prelude::*;

/// Bounds as three images, row by row.
#[derive(Clone, Debug, Default)]
pub struct Planes([Vec<f32>; 3]);

impl Planes {
    fn fit(&mut self, size: usize) {
        self.0.iter_mut().for_each(|plane| plane.resize(size, 0.0));
    }

    fn rows(&self, width: usize, row: usize) -> [&[f32]; 3] {
        self.0.each_ref().map(|plane| &plane[row * width..(row + 1) * width])
    }

    fn par_rows_mut(&mut self, width: usize) -> impl IndexedParallelIterator<Item = [&mut [f32]; 3]> {
        let [near, far, holes] = &mut self.0;
        let rows = near.par_chunks_mut(width).zip(far.par_chunks_mut(width)).zip(holes.par_chunks_mut(width));
        rows.map(|((near, far), holes)| [near, far, holes])
    }
}

/// Tasks of so many rows are worth their overhead.
const ROWS: usize = 32;

/// Puts texels beside each other that are read together: each texel and those before it, to the left and above, and one row
/// and column more. Beyond the border lies what lies at the border or, in an image that wraps, at the other end.
pub fn gather(texels: &[f32], [width, height]: [usize; 2], wraps: bool, quads: &mut Vec<Quad>) {
    quads.resize((width + 1) * (height + 1), Quad::default());
    quads.par_chunks_mut(width + 1).with_min_len(ROWS).enumerate().for_each(|(b, out)| {
        let row = |b: usize| &texels[b * width..(b + 1) * width];
        let (upper, lower) = (row(b.saturating_sub(1)), row(b.min(height - 1)));
        Instructions::widest().run(Gather { upper, lower, wraps, out });
    });
}

/// [`gather`] of one row.
struct Gather<'a> {
    upper: &'a [f32],
    lower: &'a [f32],
    wraps: bool,
    out: &'a mut [Quad],
}

impl Kernel for Gather<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { upper, lower, wraps, out } = self;
        let last = upper.len() - 1;
        let quad = |left: usize, right: usize| Quad([upper[left], upper[right], lower[left], lower[right]]);
        out[0] = quad(if wraps { last } else { 0 }, 0);
        let inside = upper.windows(2).zip(lower.windows(2));
        out[1..].iter_mut().zip(inside).for_each(|(out, (u, l))| *out = Quad([u[0], u[1], l[0], l[1]]));
        out[last + 1] = quad(last, if wraps { 0 } else { last });
    }
}

impl SurfaceLayer {
    /// Squares of 2 x 2 quads, which read 3 x 3 texels: of this layer those around the one that all four have in common. A
    /// coordinate in the quads `a` and `a + 1` lies, in the next layer, in the quads `a / 2` and `a / 2 + 1`, rounded down:
    /// what is read there are the texels around the one of `a / 2`.
    pub(super) fn bound_quads(&mut self, cutoff: f32, next: Option<&SurfaceLayer>) {
        let Self { width, height, surface, inv_sigma, wraps, threes, squares, windows, .. } = self;
        let (width, height, wraps) = (*width, *height, *wraps);
        // One texel more at the left, two at the right.
        let padded = width + 3;
        threes.fit(padded * height);
        threes.par_rows_mut(padded).with_min_len(ROWS).enumerate().for_each(|(b, out)| {
            let row = b * width..(b + 1) * width;
            let inv_sigma = if inv_sigma.len() == 1 { &inv_sigma[..] } else { &inv_sigma[row.clone()] };
            Instructions::widest().run(Threes { surface: &surface[row], inv_sigma, cutoff, wraps, out });
        });
        squares.fit((width + 1) * (height + 1));
        windows[0].fit(width + 1, height + 1);
        let out = squares.par_rows_mut(width + 1).zip(windows[0].bounds.par_chunks_mut(width + 1));
        out.with_min_len(ROWS).enumerate().for_each(|(b, (out, windows))| {
            let row = |b: usize| threes.rows(padded, b.min(height - 1));
            let next = next.map(|next| next.squares.rows(next.width + 1, b / 2));
            Instructions::widest().run(Squares {
                threes: [row(b.saturating_sub(1)), row(b), row(b + 1)],
                next,
                out,
                windows,
            });
        });
    }
}

/// Bounds over three neighbouring texels of a row, by the first one, of which one lies beyond the border.
struct Threes<'a> {
    surface: &'a [f32],
    inv_sigma: &'a [f32],
    cutoff: f32,
    wraps: bool,
    out: [&'a mut [f32]; 3],
}

impl Kernel for Threes<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { surface, inv_sigma, cutoff, wraps, out: [near, far, holes] } = self;
        let width = surface.len();
        let inside = near[1..=width].iter_mut().zip(&mut far[1..=width]).zip(&mut holes[1..=width]).zip(surface);
        if let &[inv_sigma] = inv_sigma {
            let reach = cutoff / inv_sigma;
            inside.for_each(|(((near, far), hole), &surface)| [*near, *far, *hole] = texel_bounds(surface, reach));
        } else {
            inside.zip(inv_sigma).for_each(|((((near, far), hole), &surface), inv_sigma)| {
                [*near, *far, *hole] = texel_bounds(surface, cutoff / inv_sigma);
            });
        }
        for row in [near, far, holes] {
            (row[0], row[width + 1]) = if wraps { (row[width], row[1]) } else { (row[1], row[width]) };
            row[width + 2] = if wraps { row[2] } else { row[width] };
            for a in 0..=width {
                row[a] = greatest(row[a], row[a + 1], row[a + 2]);
            }
        }
    }
}

#[inline(always)]
fn texel_bounds(surface: f32, reach: f32) -> [f32; 3] {
    let Bounds([near, far, hole, _]) = Bounds::of_texel(surface, reach);
    [near, far, hole]
}

#[inline(always)]
fn greatest(a: f32, b: f32, c: f32) -> f32 {
    let a = if a > b { a } else { b };
    if a > c { a } else { c }
}

/// Bounds over 3 x 3 texels out of those over threes of a row; and with what the next layer adds.
struct Squares<'a> {
    threes: [[&'a [f32]; 3]; 3],
    next: Option<[&'a [f32]; 3]>,
    out: [&'a mut [f32]; 3],
    windows: &'a mut [Bounds],
}

impl Kernel for Squares<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { threes: [upper, middle, lower], next, out, windows } = self;
        for k in 0..3 {
            let threes = upper[k].iter().zip(middle[k]).zip(lower[k]);
            out[k].iter_mut().zip(threes).for_each(|(out, ((&u, &m), &l))| *out = greatest(u, m, l));
        }
        let [near, far, holes] = out;
        let here = near.iter().zip(far.iter()).zip(holes.iter()).map(|((&near, &far), &hole)| [near, far, hole, 0.0]);
        let Some([near, far, holes]) = next else {
            windows.iter_mut().zip(here).for_each(|(window, here)| *window = Bounds(here).union(Bounds::ABSENT));
            return;
        };
        windows.iter_mut().zip(here).enumerate().for_each(|(a, (window, here))| {
            *window = Bounds(here).union(Bounds([near[a / 2], far[a / 2], 0.0, holes[a / 2]]));
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pyramid::Layer;
    use crate::sensor::{SensorModel, SensorTable};
    use crate::surfaces::{Sampling, compute};
    use crate::view::Lanes;

    /// Bounds over a rectangle of the image, eight times.
    struct Ask<'a> {
        surfaces: &'a SurfaceLayer,
        scale: f32,
        columns: [f32; 2],
        rows: [f32; 2],
    }

    impl Kernel for Ask<'_> {
        type Output = Bounds;

        #[inline(always)]
        fn run<S: Simd>(self) -> Bounds {
            let lanes = |number: f32| -> Lanes { [number; 8] };
            let [columns, rows] =
                [self.columns, self.rows].map(|[low, high]| [S::load(&lanes(low)), S::load(&lanes(high))]);
            let cells = self.surfaces.cells::<S>(self.scale, columns, rows, 1.0);
            self.surfaces.bounds(&cells, 5)
        }
    }

    /// Ranges that differ much from texel to texel, and some holes.
    fn layer(width: usize, height: usize, seed: usize) -> Layer {
        let range = |i: usize| {
            if (i * 31 + seed).is_multiple_of(11) { 0.0 } else { 0.2 + ((i * 7919 + seed) % 101) as f32 * 0.05 }
        };
        Layer { width, height, values: (0..width * height).map(range).collect() }
    }

    /// The four texels of Eq. 15 around a point of the image, and those `more` around them.
    fn texels(layer: &Layer, scale: f32, [u, v]: [f32; 2], wraps: bool, more: isize) -> Vec<f32> {
        let (x, y) = ((u * scale - 0.5).floor() as isize, (v * scale - 0.5).floor() as isize);
        let clamped = |i: isize, size: usize| i.clamp(0, size as isize - 1) as usize;
        let column =
            |i: isize| if wraps { i.rem_euclid(layer.width as isize) as usize } else { clamped(i, layer.width) };
        let rows = (y - more..=y + 1 + more).map(|row| clamped(row, layer.height));
        rows.flat_map(|row| (x - more..=x + 1 + more).map(move |i| (row, i)))
            .map(|(row, i)| layer.values[row * layer.width + column(i)])
            .collect()
    }

    #[test]
    fn bounds_hold_for_what_is_read_in_both_layers() {
        let model = SensorModel::constant(0.02).unwrap();
        let table = SensorTable::new(&model);
        let reach = 0.02 * table.cutoff();
        for (width, height, wraps) in [(23, 17, false), (24, 9, true), (1, 1, false), (2, 30, false)] {
            let halved = |side: usize, i: usize| side.div_ceil(1 << i);
            let layers: Vec<Layer> = (0..3).map(|i| layer(halved(width, i), halved(height, i), i)).collect();
            let mut surfaces = Vec::new();
            let sampling = Sampling::Quads { blended: true };
            compute(&mut surfaces, &layers, 0..layers.len(), (&model, &table), sampling, wraps);
            for n in 0..4000usize {
                let at = |step: usize, size: usize| ((n * step) % 8191) as f32 / 8191.0 * size as f32;
                let (u, v, i) = (at(3571, width), at(5077, height), n % layers.len());
                let size = [0.0, 0.3, 2.0, 7.5][n / 7 % 4];
                let (scale, next) = (1.0 / (1 << i) as f32, layers.get(i + 1));
                let ask =
                    Ask { surfaces: &surfaces[i], scale, columns: [u - size, u + size], rows: [v - size, v + size] };
                let bounds = Instructions::widest().run(ask);
                let point = [u + size * (at(911, 2) - 1.0), v + size * (at(613, 2) - 1.0)];
                let here = texels(&layers[i], scale, point, wraps, 0);
                let there = next.map_or(vec![0.0], |next| texels(next, scale / 2.0, point, wraps, 0));
                for &range in here.iter().chain(&there).filter(|&&range| range > 0.0) {
                    assert!(bounds.near() <= range - 0.999 * reach && bounds.far() >= range + 0.999 * reach);
                }
                let hole = |texels: &[f32]| texels.contains(&0.0);
                assert!(bounds.has_holes(false) || !hole(&here));
                assert!(bounds.has_holes(true) || !(hole(&here) && hole(&there)));
                if size == 0.0 {
                    // A square of 2 x 2 quads at least, and what is next to it.
                    let around = texels(&layers[i], scale, point, wraps, 2);
                    let beyond = next.map_or(vec![], |next| texels(next, scale / 2.0, point, wraps, 2));
                    let farthest = around.iter().chain(&beyond).fold(0.0f32, |most, &range| most.max(range));
                    assert!(bounds.far() <= farthest + 1.001 * reach);
                }
            }
        }
    }
}
