//! The layers as the sensor model sees them: where each texel puts its surface, how wide it is, and bounds over both.
//!
//! The bounds answer, for a rectangle of texels, from which distance on something is not free any more (`near`), up to
//! which distance something is not hidden yet (`far`), and whether a texel is a hole. They are what the cull asks.

use crate::pyramid::{Layer, reduce_pairs};
use crate::sensor::{SensorModel, SensorTable};
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
    mips: Vec<Mip>,
}

/// Bounds over a rectangle of texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Every voxel nearer than this is free, as far as valid texels are concerned.
    pub near: f32,
    /// Every voxel farther than this is hidden; `-inf` if no texel is valid.
    pub far: f32,
    /// `1` if some texel has no reading, else `0`.
    pub holes: f32,
}

#[derive(Clone, Debug, Default)]
struct Mip {
    width: usize,
    height: usize,
    bounds: Vec<Bounds>,
}

impl Bounds {
    /// The bounds of no texel at all.
    pub const NONE: Self = Self { near: f32::INFINITY, far: f32::NEG_INFINITY, holes: 0.0 };

    /// The bounds of two sets of texels together.
    #[inline(always)]
    pub fn union(self, other: Self) -> Self {
        Self {
            near: if self.near < other.near { self.near } else { other.near },
            far: if self.far > other.far { self.far } else { other.far },
            holes: if self.holes > other.holes { self.holes } else { other.holes },
        }
    }
}

impl SurfaceLayer {
    /// Applies the model to a layer, into these buffers.
    pub fn compute(&mut self, layer: &Layer, model: &SensorModel, table: &SensorTable) {
        (self.width, self.height) = (layer.width, layer.height);
        self.place_surfaces(layer, model);
        self.bound(table.cutoff());
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

    /// Bounds over windows of 2, 4, 8, ... texels.
    fn bound(&mut self, cutoff: f32) {
        let texel = |surface: f32, inv_sigma: f32| {
            let reach = cutoff / inv_sigma;
            if surface.is_nan() {
                Bounds { holes: 1.0, ..Bounds::NONE }
            } else {
                Bounds { near: surface - reach, far: surface + reach, holes: 0.0 }
            }
        };
        let levels = crate::pyramid::num_layers(self.width, self.height);
        self.mips.resize_with(levels, Mip::default);
        let base = &mut self.mips[0];
        base.fit(self.width, self.height);
        let inv_sigmas = self.inv_sigma.iter().cycle();
        let texels = base.bounds.iter_mut().zip(self.surface.iter().zip(inv_sigmas));
        texels.for_each(|(out, (&surface, &inv_sigma))| *out = texel(surface, inv_sigma));
        for level in 1..levels {
            let (finer, coarser) = self.mips.split_at_mut(level);
            coarser[0].halve(&finer[level - 1]);
        }
    }

    /// Bounds over texels `x.0..=x.1` by `y.0..=y.1`, all within the layer. The answer may take in neighbouring
    /// texels: it reads windows large enough that a few of them cover the rectangle.
    #[inline]
    pub fn bounds(&self, x: (usize, usize), y: (usize, usize)) -> Bounds {
        let extent = (x.1 - x.0).max(y.1 - y.0);
        let level = (extent.checked_ilog2().unwrap_or(0) as usize).saturating_sub(1).min(self.mips.len() - 1);
        let mip = &self.mips[level];
        let mut bounds = Bounds::NONE;
        for b in y.0 >> level..=y.1 >> level {
            let row = &mip.bounds[b * mip.width..(b + 1) * mip.width];
            bounds = row[x.0 >> level..=x.1 >> level].iter().fold(bounds, |all, &window| all.union(window));
        }
        bounds
    }
}

impl Mip {
    fn fit(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.bounds.resize(width * height, Bounds::NONE);
    }

    fn halve(&mut self, finer: &Mip) {
        self.fit(finer.width.div_ceil(2), finer.height.div_ceil(2));
        let width = self.width;
        self.bounds.par_chunks_mut(width).with_min_len(64).enumerate().for_each(|(b, out)| {
            let row = |r: usize| &finer.bounds[r * finer.width..(r + 1) * finer.width];
            reduce_pairs(row(2 * b), row((2 * b + 1).min(finer.height - 1)), out, Bounds::union);
        });
    }
}
