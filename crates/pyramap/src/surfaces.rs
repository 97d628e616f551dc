//! The layers as the sensor model sees them: where each texel puts its surface, how wide it is, and bounds over both.
//!
//! The bounds answer, for a rectangle of texels, from which distance on something is not free any more (`near`), up to
//! which distance something is not hidden yet (`far`), and whether a texel is a hole. They are what the cull asks.

mod quads;
mod texels;

use crate::pyramid::{Layer, num_layers};
use crate::sensor::{SensorModel, SensorTable};
use crate::simd::{Quad, Real, Simd};
use quads::{Planes, gather};
use rayon::prelude::*;
use std::ops::Range;

/// One layer, ready to be asked for log-odds.
#[derive(Clone, Debug, Default)]
pub struct SurfaceLayer {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Distance at which the model places each texel's surface, metres; NaN where there is no reading.
    pub surface: Vec<f32>,
    /// `1 / sigma` of each texel; a single number where sigma is the same for all.
    pub inv_sigma: Vec<f32>,
    /// For rules that interpolate: the texels between which a coordinate may lie, by the lower right one, of which one more
    /// row and column lie beyond the border; and, unless sigma is the same for all, four times `1 / sigma`.
    pub quads: [Vec<Quad>; 2],
    /// Whether the last column's neighbour is the first.
    wraps: bool,
    sampling: Sampling,
    /// Bounds over single cells, of rules that read texels.
    cells: Windows,
    /// Of rules that interpolate: over threes of texels in a row, and over 3 x 3.
    threes: Planes,
    squares: Planes,
    /// Bounds over every square of 2 x 2 cells, by the power of two of texels, or of quads, in a cell.
    windows: Vec<Windows>,
}

/// How an update rule reads layers: what the cells are of which there are bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// Texel by texel; a cell is a square of `2^finest` of them.
    Texels {
        /// A power of two.
        finest: usize,
    },
    /// Between four texels, a quad; a cell is what is read for a voxel that lies in it.
    Quads {
        /// Whether the next coarser layer is read as well. Then its texels are in the cell, too.
        blended: bool,
    },
}

impl Default for Sampling {
    fn default() -> Self {
        Sampling::Texels { finest: 0 }
    }
}

impl Sampling {
    fn finest(self) -> usize {
        match self {
            Sampling::Texels { finest } => finest,
            Sampling::Quads { .. } => 0,
        }
    }

    /// How many quads there are along a side beyond the number of texels.
    fn beyond(self) -> usize {
        usize::from(matches!(self, Sampling::Quads { .. }))
    }
}

/// Applies the model to those of the layers that are `wanted`, into these buffers. There are no layers beyond.
pub fn compute(
    surfaces: &mut Vec<SurfaceLayer>,
    layers: &[Layer],
    wanted: Range<usize>,
    (model, table): (&SensorModel, &SensorTable),
    sampling: Sampling,
    wraps: bool,
) {
    surfaces.resize_with(wanted.end, SurfaceLayer::default);
    for i in wanted.rev() {
        let (finer, coarser) = surfaces.split_at_mut(i + 1);
        finer[i].compute(&layers[i], coarser.first(), (model, table), sampling, wraps);
    }
}

/// Bounds over a rectangle of texels. All four are maxima, so that the bounds of two sets together are one vector
/// instruction.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(16))]
pub struct Bounds([f32; 4]);

impl Bounds {
    /// The bounds of no texel at all.
    pub const NONE: Self = Self([f32::NEG_INFINITY, f32::NEG_INFINITY, 0.0, 0.0]);
    /// The bounds of a texel without a reading.
    const HOLE: Self = Self([f32::NEG_INFINITY, f32::NEG_INFINITY, 1.0, 0.0]);
    /// Those of texels of a layer that is not there.
    const ABSENT: Self = Self([f32::NEG_INFINITY, f32::NEG_INFINITY, 0.0, 1.0]);

    /// Every voxel nearer than this is free, as far as valid texels are concerned.
    #[inline(always)]
    pub fn near(&self) -> f32 {
        -self.0[0]
    }

    /// Every voxel farther than this is hidden; `-inf` if no texel is valid.
    #[inline(always)]
    pub fn far(&self) -> f32 {
        self.0[1]
    }

    /// Whether some texel has no reading: one that the next layer does not answer for, if that is let to.
    #[inline(always)]
    pub fn has_holes(&self, fallback: bool) -> bool {
        (self.0[2] > 0.0) & (!fallback | (self.0[3] > 0.0))
    }

    /// Up to where, and from where on, a texel decides nothing.
    #[inline(always)]
    fn of_texel(surface: f32, reach: f32) -> Self {
        if surface.is_nan() { Self::HOLE } else { Self([reach - surface, surface + reach, 0.0, 0.0]) }
    }

    /// The bounds of two sets of texels together.
    #[inline(always)]
    pub fn union(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
    }
}

/// The texel that holds a coordinate, which counts from the first texel's border, along a side of a layer; clamped to it,
/// NaN to the first.
#[inline(always)]
pub fn texel<R: Real>(coordinate: R, size: usize) -> R {
    coordinate.max(R::splat(0.0)).min(R::splat((size - 1) as f32)).floor()
}

/// More columns than any layer has.
const ANY_COLUMN: f32 = 1e6;

/// Rectangles of cells: first and last column and row of each.
pub struct Cells {
    columns: [[i32; 8]; 2],
    rows: [[i32; 8]; 2],
}

/// The cells of eight coordinates, within some range of cells; NaN is in the first.
#[inline(always)]
fn cell<S: Simd>(coordinate: S::Eight, scale: f32, offset: f32, [first, last]: [f32; 2]) -> [i32; 8] {
    let cell = coordinate * S::Eight::splat(scale) + S::Eight::splat(offset);
    let cell = cell.max(S::Eight::splat(first)).min(S::Eight::splat(last));
    // Cut off, for numbers that are not negative, is rounded down.
    let cell = if first < 0.0 { cell.floor() } else { cell };
    // SAFETY: in range of `i32`.
    unsafe { S::store_whole(cell) }
}

/// Rectangles are read as at most so many cells along a side, and one more where they do not begin with a cell: fewer
/// would read faster, and take in more of what lies around.
const CELLS_ACROSS: u32 = 5;

/// Where three squares start that cover the cells of `2^level` texels from the one that holds texel `low` to the one that
/// holds `high`, up to six of them. That some squares may be the same costs less than to find out.
#[inline(always)]
fn squares((low, high): (u32, u32), level: usize) -> [usize; 3] {
    let (low, high) = (low as usize >> level, high as usize >> level);
    let last = high.saturating_sub(1).max(low);
    [low, (low + 2).min(last), last]
}

/// Bounds over squares, row by row.
#[derive(Clone, Debug, Default)]
struct Windows {
    width: usize,
    height: usize,
    bounds: Vec<Bounds>,
}

impl SurfaceLayer {
    /// Applies the model to a layer, into these buffers; the next coarser one is done already.
    fn compute(
        &mut self,
        layer: &Layer,
        next: Option<&SurfaceLayer>,
        (model, table): (&SensorModel, &SensorTable),
        sampling: Sampling,
        wraps: bool,
    ) {
        (self.width, self.height, self.sampling, self.wraps) = (layer.width, layer.height, sampling, wraps);
        self.place_surfaces(layer, model);
        self.windows.resize_with(num_layers(self.width, self.height).max(sampling.finest() + 1), Windows::default);
        match sampling {
            Sampling::Texels { finest } => {
                self.bound_texels(table.cutoff(), finest);
                self.windows[finest].unite(&self.cells, 1);
            }
            Sampling::Quads { blended } => {
                self.gather_quads();
                self.bound_quads(table.cutoff(), next.filter(|_| blended));
            }
        }
        for level in sampling.finest() + 1..self.windows.len() {
            let (finer, coarser) = self.windows.split_at_mut(level);
            coarser[0].unite(&finer[level - 1], 2);
        }
    }

    fn place_surfaces(&mut self, layer: &Layer, model: &SensorModel) {
        self.surface.resize(layer.values.len(), 0.0);
        let placed = |range: f32, surface: f32| if range > 0.0 { surface } else { f32::NAN };
        if model.is_constant() {
            self.inv_sigma.clear();
            self.inv_sigma.push((1.0 / model.sigma_at(0.0)) as f32);
            let offset = model.surface(0.0) as f32;
            let texels = self.surface.par_iter_mut().zip(&layer.values).with_min_len(4096);
            texels.for_each(|(out, &range)| *out = placed(range, range + offset));
        } else {
            self.inv_sigma.resize(layer.values.len(), 0.0);
            let texels = self.surface.par_iter_mut().zip(&mut self.inv_sigma).zip(&layer.values).with_min_len(4096);
            texels.for_each(|((surface, inv_sigma), &range)| {
                // No return lies at infinity, and is free whatever sigma is.
                let finite = if range.is_finite() { f64::from(range) } else { 0.0 };
                *inv_sigma = (1.0 / model.sigma_at(finite)) as f32;
                *surface = placed(range, if range.is_finite() { model.surface(finite) as f32 } else { range });
            });
        }
    }

    fn gather_quads(&mut self) {
        let Self { width, height, surface, inv_sigma, quads: [surfaces, inv_sigmas], wraps, .. } = self;
        gather(surface, [*width, *height], *wraps, surfaces);
        if inv_sigma.len() > 1 {
            gather(inv_sigma, [*width, *height], *wraps, inv_sigmas);
        } else {
            inv_sigmas.clear();
        }
    }

    /// The cells that are read for voxels which are projected into rectangles of the image, of which this layer's texels are
    /// `scale` as many along a side; texels are read up to `reach` beyond the one that holds a point.
    #[inline(always)]
    pub fn cells<S: Simd>(&self, scale: f32, columns: [S::Eight; 2], rows: [S::Eight; 2], reach: f32) -> Cells {
        let beyond = self.sampling.beyond();
        let (first, last) = (beyond as f32 - 0.5, reach - 0.5);
        let [width, height] = [self.width, self.height].map(|size| (size - 1 + beyond) as f32);
        let across = if self.wraps { [-ANY_COLUMN, ANY_COLUMN] } else { [0.0, width] };
        Cells {
            columns: [cell::<S>(columns[0], scale, first, across), cell::<S>(columns[1], scale, last, across)],
            rows: [cell::<S>(rows[0], scale, first, [0.0, height]), cell::<S>(rows[1], scale, last, [0.0, height])],
        }
    }

    /// Bounds over cells, and maybe over neighbouring ones: read are squares of a level at which few of them cover the
    /// rectangle.
    #[inline(always)]
    pub fn bounds(&self, cells: &Cells, n: usize) -> Bounds {
        let ([left, right], [top, bottom]) = (cells.columns, cells.rows);
        let (left, right, rows) = (left[n], right[n], (top[n] as u32, bottom[n] as u32));
        if !self.wraps {
            return self.rectangle((left as u32, right as u32), rows);
        }
        let (width, last) = (self.width as i32, (self.width - 1 + self.sampling.beyond()) as i32);
        let within =
            |low: i32, high: i32| self.rectangle((low.clamp(0, last) as u32, high.clamp(0, last) as u32), rows);
        if left < 0 {
            within(0, right).union(within(left + width, last))
        } else if right > last {
            within(left, last).union(within(0, right - width))
        } else {
            within(left, right)
        }
    }

    /// Bounds over cells `x.0..=x.1` by `y.0..=y.1`, all within the layer. What has no outline may end before it begins.
    #[inline(always)]
    fn rectangle(&self, x: (u32, u32), y: (u32, u32)) -> Bounds {
        let extent = x.1.saturating_sub(x.0).max(y.1.saturating_sub(y.0));
        let level =
            (extent / CELLS_ACROSS).checked_ilog2().map_or(0, |log| log as usize + 1).max(self.sampling.finest());
        let Some(windows) = self.windows.get(level) else { return self.everywhere() };
        let (columns, rows) = (squares(x, level), squares(y, level));
        let mut bounds = Bounds::NONE;
        for row in rows {
            for column in columns {
                bounds = bounds.union(windows.bounds[row * windows.width + column]);
            }
        }
        bounds
    }

    fn everywhere(&self) -> Bounds {
        let coarsest = self.windows.last().expect("there is a window of two texels");
        coarsest.bounds.iter().fold(Bounds::NONE, |all, &window| all.union(window))
    }
}

impl Windows {
    fn fit(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.bounds.resize(width * height, Bounds::NONE);
    }

    /// Makes each square of four smaller `parts`: the one at `step` times its own place and the next ones to the right
    /// and below, one `step` further, or at the border the last there is.
    fn unite(&mut self, parts: &Windows, step: usize) {
        self.fit(parts.width.div_ceil(step), parts.height.div_ceil(step));
        let width = self.width;
        self.bounds.par_chunks_mut(width).with_min_len(64).enumerate().for_each(|(b, out)| {
            let row = |y: usize| &parts.bounds[y * parts.width..(y + 1) * parts.width];
            let (upper, lower) = (row(b * step), row((b * step + step).min(parts.height - 1)));
            for (a, out) in out.iter_mut().enumerate() {
                let (left, right) = (a * step, (a * step + step).min(parts.width - 1));
                *out = upper[left].union(upper[right]).union(lower[left].union(lower[right]));
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::SensorModel;

    /// Every rectangle of a small layer: the bounds hold for all its texels, and take in none that is
    /// farther off than the rectangle, or the finest square, is large.
    #[test]
    fn bounds_hold_for_every_rectangle() {
        let (width, height) = (23, 17);
        let values: Vec<f32> = (0..width * height).map(|i| ((i * 7919) % 101) as f32 * 0.05).collect();
        let layer = Layer { width, height, values };
        let model = SensorModel::constant(0.02).unwrap();
        let table = SensorTable::new(&model);
        for finest in 0..3 {
            check_every_rectangle(&layer, &model, &table, finest);
        }
    }

    fn check_every_rectangle(layer: &Layer, model: &SensorModel, table: &SensorTable, finest: usize) {
        let (width, height, values) = (layer.width, layer.height, &layer.values);
        let mut surfaces = SurfaceLayer::default();
        surfaces.compute(layer, None, (model, table), Sampling::Texels { finest }, false);
        let reach = table.cutoff() * 0.02;
        for (x0, x1) in (0..width).flat_map(|x0| (x0..width).map(move |x1| (x0, x1))) {
            for (y0, y1) in (0..height).flat_map(|y0| (y0..height).map(move |y1| (y0, y1))) {
                let bounds = surfaces.rectangle((x0 as u32, x1 as u32), (y0 as u32, y1 as u32));
                let texels = |x: std::ops::RangeInclusive<usize>, y: std::ops::RangeInclusive<usize>| {
                    let inside = y.flat_map(move |y| x.clone().map(move |x| (x, y)));
                    inside.map(|(x, y)| values[y * width + x]).collect::<Vec<_>>()
                };
                let exact = texels(x0..=x1, y0..=y1);
                for &range in exact.iter().filter(|&&range| range > 0.0) {
                    assert!(bounds.near() <= range - 0.999 * reach && bounds.far() >= range + 0.999 * reach);
                }
                assert!(bounds.has_holes(false) || exact.iter().all(|&range| range > 0.0));
                let slack = (x1 - x0).max(y1 - y0).max((2 << finest) - 1);
                let (right, lower) = ((x1 + slack).min(width - 1), (y1 + slack).min(height - 1));
                let wider = texels(x0.saturating_sub(slack)..=right, y0.saturating_sub(slack)..=lower);
                let farthest = wider.iter().fold(0.0f32, |a, &b| a.max(b));
                assert!(x0 == x1 || y0 == y1 || bounds.far() <= farthest + 1.001 * reach);
            }
        }
    }
}
