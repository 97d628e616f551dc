//! The inverse sensor model (Eq. 7): what one range reading says about a voxel at another distance.

use crate::error::{Error, Result};
use crate::log_odds;
use crate::simd::{Real, Simd};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Where along the ray the model places the surface, relative to the reading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum SurfaceOffset {
    /// Shift by this many metres away from the camera; `0` is the paper's model.
    Metres(f64),
    /// Shift by [`SensorModel::zero_crossing`], so that log-odd 0 lies on the measured surface.
    Centred,
}

/// The inverse sensor model of Eq. 7, with a `sigma` that may grow with the measured range.
///
/// With `a = k / (sigma sqrt(2 pi))` and `g = exp(-((z - z_j) / sigma)^2 / 2)`, the probability at distance `z` of a
/// reading `z_j` is `0.3 + (a + 0.2) g` up to the reading and `0.5 + a g` beyond it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorModel {
    sigma: [f64; 3],
    k_per_sigma: f64,
    surface_offset: SurfaceOffset,
}

/// Probability of being occupied well in front of a reading (Eq. 7).
const FREE_PROBABILITY: f64 = 0.3;
/// Probability of being occupied well behind a reading: nothing is known there (Eq. 7).
const HIDDEN_PROBABILITY: f64 = 0.5;

impl SensorModel {
    /// A model with `sigma(z_j) = sigma[0] + sigma[1] z_j + sigma[2] z_j^2`, metres.
    ///
    /// `k` is the importance factor, metres, at range zero: `k / sigma` is the same at every range. `None` takes
    /// `k = sigma`, as the paper does.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `sigma` is not positive at every range, if probabilities would leave (0, 1), which is
    /// so unless `0 < k / sigma < sqrt(2 pi) / 2`, or if the offset is not finite.
    pub fn new(sigma: [f64; 3], k: Option<f64>, surface_offset: SurfaceOffset) -> Result<Self> {
        let [s0, s1, s2] = sigma;
        let lowest = if s1 < 0.0 && s2 > 0.0 { s0 - s1 * s1 / (4.0 * s2) } else { s0 };
        let grows = s2 > 0.0 || (s2 == 0.0 && s1 >= 0.0);
        if !(sigma.iter().all(|s| s.is_finite()) && lowest > 0.0 && grows) {
            return Err(Error::Parameter {
                name: "sigma",
                got: if s1 == 0.0 && s2 == 0.0 { format!("{s0}") } else { format!("{sigma:?}") },
                expected: "finite metres, s0 + s1 z + s2 z^2 positive at every range z >= 0".into(),
            });
        }
        let k_per_sigma = k.unwrap_or(s0) / s0;
        let limit = (2.0 * PI).sqrt() / 2.0;
        if !(k_per_sigma > 0.0 && k_per_sigma < limit) {
            return Err(Error::Parameter {
                name: "k",
                got: format!("{}", k.unwrap_or(s0)),
                expected: format!("more than 0 and less than sigma sqrt(2 pi) / 2 = {}", s0 * limit),
            });
        }
        if let SurfaceOffset::Metres(offset) = surface_offset
            && !offset.is_finite()
        {
            return Err(Error::Parameter {
                name: "surface_offset",
                got: format!("{offset}"),
                expected: "finite metres".into(),
            });
        }
        Ok(Self { sigma, k_per_sigma, surface_offset })
    }

    /// Checks a model that came from outside, where nobody asked [`SensorModel::new`].
    pub(crate) fn validate(&self) -> Result<()> {
        Self::new(self.sigma, Some(self.k()), self.surface_offset).map(|_| ())
    }

    /// The paper's model: one `sigma` for all ranges, `k = sigma`, no offset.
    ///
    /// # Errors
    /// As [`SensorModel::new`].
    pub fn constant(sigma: f64) -> Result<Self> {
        Self::new([sigma, 0.0, 0.0], None, SurfaceOffset::Metres(0.0))
    }

    /// The polynomial of the measured range that gives sigma.
    pub fn sigma(&self) -> [f64; 3] {
        self.sigma
    }

    /// The importance factor at range zero, metres.
    pub fn k(&self) -> f64 {
        self.k_per_sigma * self.sigma[0]
    }

    /// Where the model places the surface.
    pub fn surface_offset(&self) -> SurfaceOffset {
        self.surface_offset
    }

    /// Whether sigma is the same at every range.
    pub fn is_constant(&self) -> bool {
        self.sigma[1] == 0.0 && self.sigma[2] == 0.0
    }

    /// Sigma of a reading, metres.
    pub fn sigma_at(&self, reading: f64) -> f64 {
        let [s0, s1, s2] = self.sigma;
        s0 + reading * (s1 + reading * s2)
    }

    /// How far in front of a reading the model crosses log-odd zero, in units of sigma: `sqrt(2 ln((a + 0.2) / 0.2))`.
    pub fn zero_crossing(&self) -> f64 {
        let rise = HIDDEN_PROBABILITY - FREE_PROBABILITY;
        (2.0 * libm::log((self.peak() + rise) / rise)).sqrt()
    }

    /// Where the model places the surface of a reading: the reading plus the offset, metres.
    pub fn surface(&self, reading: f64) -> f64 {
        reading
            + match self.surface_offset {
                SurfaceOffset::Metres(offset) => offset,
                SurfaceOffset::Centred => self.zero_crossing() * self.sigma_at(reading),
            }
    }

    /// The log-odd that a reading gives to a voxel at `distance` from the camera (Eq. 7 in Eq. 16).
    /// A reading of `+inf`, no return, says free.
    pub fn log_odds(&self, distance: f64, reading: f64) -> f64 {
        if reading == f64::INFINITY {
            return self.free_log_odds();
        }
        self.log_odds_at((distance - self.surface(reading)) / self.sigma_at(reading))
    }

    /// The log-odd well in front of a reading.
    pub fn free_log_odds(&self) -> f64 {
        log_odds::from_probability(FREE_PROBABILITY)
    }

    /// The log-odd at `s` sigmas behind (negative: in front of) the surface.
    fn log_odds_at(&self, s: f64) -> f64 {
        let a = self.peak();
        let g = libm::exp(-0.5 * s * s);
        log_odds::from_probability(if s <= 0.0 {
            FREE_PROBABILITY + (a + HIDDEN_PROBABILITY - FREE_PROBABILITY) * g
        } else {
            HIDDEN_PROBABILITY + a * g
        })
    }

    /// `a = k / (sigma sqrt(2 pi))`.
    fn peak(&self) -> f64 {
        self.k_per_sigma / (2.0 * PI).sqrt()
    }

    /// How many sigmas from the surface the model is within half a fixed-point step of its limits, so that what lies
    /// beyond may be called free or hidden without a change to the map. From `dl/dp = 1 / (p (1 - p))` at the limits.
    pub(crate) fn cutoff(&self) -> f64 {
        let half_step = 0.5 * log_odds::UNIT;
        let slope = |p: f64| 1.0 / (p * (1.0 - p));
        let in_front = (self.peak() + HIDDEN_PROBABILITY - FREE_PROBABILITY) * slope(FREE_PROBABILITY);
        let behind = self.peak() * slope(HIDDEN_PROBABILITY);
        (2.0 * libm::log(in_front.max(behind) / half_step)).sqrt()
    }
}

/// The model as a table over `s`, the distance behind the surface in sigmas: log-odds depend on nothing else, so one
/// table serves every voxel. Beyond the cut-off it is exactly the free log-odd or exactly zero: culling whole regions
/// by their distance from the surface then gives, bit for bit, what asking the table for each voxel would.
#[derive(Clone, Debug)]
pub struct SensorTable {
    /// Log-odd at the start of each interval, and its rise over the interval.
    entries: Vec<[f32; 2]>,
    cutoff: f32,
    intervals_per_sigma: f32,
    free: f32,
}

impl SensorTable {
    /// Linear interpolation over 2048 intervals of some 9 / 2048 sigma errs by h^2 / 8 max|l''| < 2e-5.
    const INTERVALS: usize = 2048;

    /// Tabulates a model.
    pub fn new(model: &SensorModel) -> Self {
        let cutoff = model.cutoff();
        let at = |i: usize| match i {
            0 => model.free_log_odds() as f32,
            Self::INTERVALS => 0.0,
            _ => model.log_odds_at(cutoff * (2.0 * i as f64 / Self::INTERVALS as f64 - 1.0)) as f32,
        };
        let entries =
            (0..=Self::INTERVALS).map(|i| [at(i), if i < Self::INTERVALS { at(i + 1) - at(i) } else { 0.0 }]).collect();
        let cutoff = cutoff as f32;
        let intervals_per_sigma = Self::INTERVALS as f32 / (2.0 * cutoff);
        Self { entries, cutoff, intervals_per_sigma, free: model.free_log_odds() as f32 }
    }

    /// Sigmas from the surface beyond which everything is free or hidden.
    pub fn cutoff(&self) -> f32 {
        self.cutoff
    }

    /// Log-odd at the start of each interval, and its rise over the interval.
    pub fn entries(&self) -> &[[f32; 2]] {
        &self.entries
    }

    /// How many intervals lie in a sigma.
    pub fn intervals_per_sigma(&self) -> f32 {
        self.intervals_per_sigma
    }

    /// The log-odd in front of every surface.
    pub fn free(&self) -> f32 {
        self.free
    }

    /// The log-odd at `s` sigmas behind the surface; any value of `s` is taken, NaN as free.
    #[inline(always)]
    pub fn log_odds(&self, s: f32) -> f32 {
        // Written as selects so that NaN ends at the lower bound, and never outside the table.
        let s = if s > -self.cutoff { s } else { -self.cutoff };
        let s = if s < self.cutoff { s } else { self.cutoff };
        let position = (s + self.cutoff) * self.intervals_per_sigma;
        // SAFETY: 0 <= position <= INTERVALS (1 + 2^-22), far from the next integer, and finite.
        let index = unsafe { position.to_int_unchecked::<i32>() };
        let [value, rise] = unsafe { *self.entries.get_unchecked(index as usize) };
        value + (position - index as f32) * rise
    }

    /// [`SensorTable::log_odds`] of eight voxels in two layers.
    #[inline(always)]
    pub fn log_odds_of<S: Simd>(&self, s: S::Sixteen) -> S::Sixteen {
        let cutoff = S::Sixteen::splat(self.cutoff);
        let s = s.max(S::Sixteen::splat(-self.cutoff)).min(cutoff);
        // SAFETY: 0 <= position <= INTERVALS (1 + 2^-22), as above.
        let [value, rise, behind] =
            unsafe { S::pairs(&self.entries, (s + cutoff) * S::Sixteen::splat(self.intervals_per_sigma)) };
        value + behind * rise
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_follows_equation_7() {
        for model in [
            SensorModel::constant(0.6).unwrap(),
            SensorModel::new([0.01, 0.0, 0.002], Some(0.005), SurfaceOffset::Centred).unwrap(),
        ] {
            let table = SensorTable::new(&model);
            for i in -8000..8000 {
                let s = f64::from(i) * 1e-3;
                let difference = (f64::from(table.log_odds(s as f32)) - model.log_odds_at(s)).abs();
                // Half a fixed-point step at the cut-off, less elsewhere.
                assert!(difference <= 0.5 * log_odds::UNIT * 1.01, "s = {s}: off by {difference}");
            }
            assert_eq!(table.log_odds(f32::NEG_INFINITY), table.free());
            assert_eq!(table.log_odds(f32::NAN), table.free());
            assert_eq!(table.log_odds(f32::INFINITY), 0.0);
            assert_eq!(table.log_odds(-table.cutoff()), table.free());
            assert_eq!(table.log_odds(table.cutoff()), 0.0);
        }
    }

    #[test]
    fn figure_1_values() {
        // k = sigma = 0.6 and a reading at 10 m: 0.3 far in front, 0.5 + 1/sqrt(2 pi) = 0.8989 at it, 0.5 far behind.
        let model = SensorModel::constant(0.6).unwrap();
        let p = |z| log_odds::to_probability(model.log_odds(z, 10.0));
        assert!((p(1.0) - 0.3).abs() < 1e-12);
        assert!((p(10.0) - 0.898_942_280_4).abs() < 1e-9);
        assert!((p(20.0) - 0.5).abs() < 1e-12);
        assert!((p(10.0 - 0.6 * model.zero_crossing()) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn centred_puts_zero_on_the_reading() {
        let model = SensorModel::new([0.02, 0.001, 0.003], None, SurfaceOffset::Centred).unwrap();
        for reading in [0.5, 2.0, 4.0] {
            assert!(model.log_odds(reading, reading).abs() < 1e-12);
        }
    }

    #[test]
    fn refuses_what_is_no_probability() {
        assert!(SensorModel::constant(0.0).is_err());
        assert!(SensorModel::constant(f64::NAN).is_err());
        assert!(SensorModel::new([0.1, -0.1, 0.0], None, SurfaceOffset::Metres(0.0)).is_err());
        assert!(SensorModel::new([0.1, -0.1, 0.1], None, SurfaceOffset::Metres(0.0)).is_ok());
        assert!(SensorModel::new([0.1, 0.0, 0.0], Some(0.126), SurfaceOffset::Metres(0.0)).is_err());
        assert!(SensorModel::new([0.1, 0.0, 0.0], Some(0.125), SurfaceOffset::Metres(0.0)).is_ok());
        assert!(SensorModel::new([0.1, 0.0, 0.0], Some(-0.1), SurfaceOffset::Metres(0.0)).is_err());
        assert!(SensorModel::new([0.1, 0.0, 0.0], None, SurfaceOffset::Metres(f64::INFINITY)).is_err());
    }
}
