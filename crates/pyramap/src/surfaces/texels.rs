//! Bounds over squares of single texels, for rules that do not interpolate.

use super::{Bounds, SurfaceLayer};
use crate::simd::{Instructions, Kernel, Simd};
use rayon::prelude::*;

/// So many columns at a time: first all of their rows, in wide instructions, and then what is side by side.
const COLUMNS: usize = 64;

impl SurfaceLayer {
    /// Bounds over squares of `2^finest` texels.
    pub(super) fn bound_texels(&mut self, cutoff: f32, finest: usize) {
        let Self { width, height, surface, inv_sigma, cells, .. } = self;
        let (edge, width) = (1 << finest, *width);
        assert!(edge <= COLUMNS, "squares of {edge} texels");
        cells.fit(width.div_ceil(edge), height.div_ceil(edge));
        let rows = cells.bounds.par_chunks_mut(cells.width).zip(surface.par_chunks(edge * width));
        rows.with_min_len(32).enumerate().for_each(|(b, (cells, surface))| {
            let constant = inv_sigma.len() == 1;
            let inv_sigma = if constant { &inv_sigma[..] } else { &inv_sigma[b * edge * width..][..surface.len()] };
            Instructions::widest().run(RowOfCells { surface, inv_sigma, width, edge, cutoff, cells });
        });
    }
}

struct RowOfCells<'a> {
    /// All rows of texels in the cells.
    surface: &'a [f32],
    /// As many numbers, or one for all.
    inv_sigma: &'a [f32],
    width: usize,
    edge: usize,
    cutoff: f32,
    cells: &'a mut [Bounds],
}

impl Kernel for RowOfCells<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { surface, inv_sigma, width, edge, cutoff, cells } = self;
        for (cells, first) in cells.chunks_mut(COLUMNS / edge).zip((0..).step_by(COLUMNS)) {
            let mut columns = Columns::new();
            for (row, texels) in surface.chunks(width).enumerate() {
                let texels = &texels[first..width.min(first + COLUMNS)];
                if let &[inv_sigma] = inv_sigma {
                    columns.take_in(texels, [cutoff / inv_sigma; COLUMNS]);
                } else {
                    let inv_sigma = &inv_sigma[row * width + first..][..texels.len()];
                    let mut reach = [0.0; COLUMNS];
                    reach.iter_mut().zip(inv_sigma).for_each(|(reach, inv_sigma)| *reach = cutoff / inv_sigma);
                    columns.take_in(texels, reach);
                }
            }
            for (a, cell) in cells.iter_mut().enumerate() {
                *cell = Bounds::NONE;
                for n in a * edge..(a + 1) * edge {
                    *cell = cell.union(Bounds([columns.near[n], columns.far[n], columns.hole[n], 0.0]));
                }
            }
        }
    }
}

/// Bounds over some rows of each column.
struct Columns {
    near: [f32; COLUMNS],
    far: [f32; COLUMNS],
    hole: [f32; COLUMNS],
}

impl Columns {
    #[inline(always)]
    fn new() -> Self {
        let Bounds([near, far, hole, _]) = Bounds::NONE;
        Self { near: [near; COLUMNS], far: [far; COLUMNS], hole: [hole; COLUMNS] }
    }

    #[inline(always)]
    fn take_in(&mut self, surface: &[f32], reach: [f32; COLUMNS]) {
        let Self { near, far, hole } = self;
        let columns = near.iter_mut().zip(far).zip(hole).zip(surface).zip(reach);
        for ((((near, far), hole), &surface), reach) in columns {
            let Bounds([of_near, of_far, of_hole, _]) = Bounds::of_texel(surface, reach);
            *near = if of_near > *near { of_near } else { *near };
            *far = if of_far > *far { of_far } else { *far };
            *hole = if of_hole > *hole { of_hole } else { *hole };
        }
    }
}
