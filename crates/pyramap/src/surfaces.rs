//! The layers as the sensor model sees them: where each texel puts its surface, how wide it is, and bounds over both.
//!
//! The bounds answer, for a rectangle of texels, from which distance on something is not free any more (`near`), up to
//! which distance something is not hidden yet (`far`), and whether a texel is a hole. They are what the cull asks.

use crate::pyramid::Layer;
use crate::sensor::{SensorModel, SensorTable};
use crate::simd::Quad;
use rayon::prelude::*;

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
    /// For rules that interpolate, by the texel to the upper left, of which one more row and column lie beyond the border:
    /// four texels and, unless sigma is the same for all, four times `1 / sigma`.
    pub quads: [Vec<Quad>; 2],
    /// Bounds over single cells of `2^finest` texels.
    cells: Windows,
    windows: Vec<Windows>,
    finest: usize,
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

    /// Whether some texel has no reading.
    #[inline(always)]
    pub fn has_holes(&self) -> bool {
        self.0[2] > 0.0
    }

    /// The bounds of two sets of texels together.
    #[inline(always)]
    pub fn union(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
    }
}

/// The texel that holds a coordinate, which counts from the first texel's border; clamped to a layer, NaN to its start.
#[inline(always)]
pub fn texel(x: f32, last: f32) -> u32 {
    let x = if x > 0.0 { x } else { 0.0 };
    let x = if x < last { x } else { last };
    // SAFETY: between 0 and `last`, which is a size in texels. Cut off, for a number that is not negative, is rounded down.
    unsafe { x.to_int_unchecked() }
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

/// Bounds over every square of 2 x 2 cells, for cells of `2^level` texels.
#[derive(Clone, Debug, Default)]
struct Windows {
    width: usize,
    height: usize,
    bounds: Vec<Bounds>,
}

impl SurfaceLayer {
    /// Applies the model to a layer, into these buffers. Bounds will be no tighter than cells of `2^finest` texels.
    pub fn compute(&mut self, layer: &Layer, model: &SensorModel, table: &SensorTable, finest: usize) {
        (self.width, self.height) = (layer.width, layer.height);
        self.place_surfaces(layer, model);
        self.bound(table.cutoff(), finest);
    }

    fn place_surfaces(&mut self, layer: &Layer, model: &SensorModel) {
        self.surface.resize(layer.values.len(), 0.0);
        let placed = |range: f32, surface: f32| if range > 0.0 { surface } else { f32::NAN };
        if model.is_constant() {
            self.inv_sigma.clear();
            self.inv_sigma.push((1.0 / model.sigma_at(0.0)) as f32);
            let offset = model.surface(0.0) as f32;
            let texels = self.surface.iter_mut().zip(&layer.values);
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

    /// Puts texels beside each other that are read together. Beyond the border lies what lies at the border or, in an image
    /// whose last column's neighbour is the first, at the other end.
    pub fn interpolate(&mut self, wraps: bool) {
        let Self { width, height, surface, inv_sigma, quads: [surfaces, inv_sigmas], .. } = self;
        gather(surface, [*width, *height], wraps, surfaces);
        if inv_sigma.len() > 1 {
            gather(inv_sigma, [*width, *height], wraps, inv_sigmas);
        } else {
            inv_sigmas.clear();
        }
    }

    /// Bounds over squares of two cells, for cells of `2^finest` texels and all coarser ones.
    fn bound(&mut self, cutoff: f32, finest: usize) {
        let edge = 1 << finest;
        self.cells.fit(self.width.div_ceil(edge), self.height.div_ceil(edge));
        let (width, surface, inv_sigma) = (self.width, &self.surface, &self.inv_sigma);
        let constant = if inv_sigma.len() == 1 { Some(cutoff / inv_sigma[0]) } else { None };
        let texel = |i: usize, surface: f32| {
            let reach = constant.unwrap_or_else(|| cutoff / inv_sigma[i]);
            if surface.is_nan() { Bounds::HOLE } else { Bounds([reach - surface, surface + reach, 0.0, 0.0]) }
        };
        self.cells.bounds.par_chunks_mut(self.cells.width).with_min_len(32).enumerate().for_each(|(b, cells)| {
            cells.fill(Bounds::NONE);
            for row in b * edge..((b + 1) * edge).min(surface.len() / width) {
                let texels = surface[row * width..(row + 1) * width].chunks(edge);
                for (a, (cell, texels)) in cells.iter_mut().zip(texels).enumerate() {
                    for (i, &surface) in texels.iter().enumerate() {
                        *cell = cell.union(texel(row * width + a * edge + i, surface));
                    }
                }
            }
        });
        self.finest = finest;
        self.windows.resize_with(crate::pyramid::num_layers(self.width, self.height).max(finest + 1), Windows::default);
        self.windows[finest].unite(&self.cells, 1);
        for level in finest + 1..self.windows.len() {
            let (finer, coarser) = self.windows.split_at_mut(level);
            coarser[0].unite(&finer[level - 1], 2);
        }
    }

    /// Bounds over texels `x.0..=x.1` by `y.0..=y.1`, all within the layer. The answer may take in neighbouring
    /// texels: it reads the squares of a level at which few of them cover the rectangle.
    #[inline(always)]
    pub fn bounds(&self, x: (u32, u32), y: (u32, u32)) -> Bounds {
        let extent = (x.1 - x.0).max(y.1 - y.0);
        let level = (extent / CELLS_ACROSS).checked_ilog2().map_or(0, |log| log as usize + 1).max(self.finest);
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

    /// The same in an image whose last column's neighbour is the first, for columns `left..=right`, which may be beyond
    /// the border on one side.
    #[inline(always)]
    pub fn wrapped_bounds(&self, left: i32, right: i32, rows: (u32, u32)) -> Bounds {
        let (width, last) = (self.width as i32, self.width as i32 - 1);
        let columns = |low: i32, high: i32| self.bounds((low.clamp(0, last) as u32, high.clamp(0, last) as u32), rows);
        if left < 0 {
            columns(0, right).union(columns(left + width, last))
        } else if right > last {
            columns(left, last).union(columns(0, right - width))
        } else {
            columns(left, right)
        }
    }

    fn everywhere(&self) -> Bounds {
        let coarsest = self.windows.last().expect("there is a window of two texels");
        coarsest.bounds.iter().fold(Bounds::NONE, |all, &window| all.union(window))
    }
}

/// Each texel's quad, and those of the texels beyond the upper and the left border.
fn gather(texels: &[f32], [width, height]: [usize; 2], wraps: bool, quads: &mut Vec<Quad>) {
    quads.resize((width + 1) * (height + 1), Quad::default());
    quads.par_chunks_mut(width + 1).with_min_len(32).enumerate().for_each(|(b, out)| {
        let row = |b: usize| &texels[b * width..(b + 1) * width];
        let (upper, lower) = (row(b.saturating_sub(1)), row(b.min(height - 1)));
        let quad = |left: usize, right: usize| Quad([upper[left], upper[right], lower[left], lower[right]]);
        let last = width - 1;
        out[0] = quad(if wraps { last } else { 0 }, 0);
        let inside = upper.windows(2).zip(lower.windows(2));
        out[1..].iter_mut().zip(inside).for_each(|(out, (u, l))| *out = Quad([u[0], u[1], l[0], l[1]]));
        out[width] = quad(last, if wraps { 0 } else { last });
    });
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
        surfaces.compute(layer, model, table, finest);
        let reach = table.cutoff() * 0.02;
        for (x0, x1) in (0..width).flat_map(|x0| (x0..width).map(move |x1| (x0, x1))) {
            for (y0, y1) in (0..height).flat_map(|y0| (y0..height).map(move |y1| (y0, y1))) {
                let bounds = surfaces.bounds((x0 as u32, x1 as u32), (y0 as u32, y1 as u32));
                let texels = |x: std::ops::RangeInclusive<usize>, y: std::ops::RangeInclusive<usize>| {
                    let inside = y.flat_map(move |y| x.clone().map(move |x| (x, y)));
                    inside.map(|(x, y)| values[y * width + x]).collect::<Vec<_>>()
                };
                let exact = texels(x0..=x1, y0..=y1);
                for &range in exact.iter().filter(|&&range| range > 0.0) {
                    assert!(bounds.near() <= range - 0.999 * reach && bounds.far() >= range + 0.999 * reach);
                }
                assert!(bounds.has_holes() || exact.iter().all(|&range| range > 0.0));
                let slack = (x1 - x0).max(y1 - y0).max((2 << finest) - 1);
                let (right, lower) = ((x1 + slack).min(width - 1), (y1 + slack).min(height - 1));
                let wider = texels(x0.saturating_sub(slack)..=right, y0.saturating_sub(slack)..=lower);
                let farthest = wider.iter().fold(0.0f32, |a, &b| a.max(b));
                assert!(x0 == x1 || y0 == y1 || bounds.far() <= farthest + 1.001 * reach);
            }
        }
    }
}
