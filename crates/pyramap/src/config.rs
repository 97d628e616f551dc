//! The parameters of a map, and what they may be.

use crate::block::{BLOCK_EDGE, MAX_BLOCK};
use crate::error::{Error, Result};
use crate::log_odds::{self, Limits, UNIT};
use crate::ranges::BeyondMaxRange;
use crate::sensor::SensorModel;
use crate::update::{UpdateRule, rays};
use serde::{Deserialize, Serialize};

/// The parameters of a map. Start from [`GridConfig::new`] and change what you need.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct GridConfig {
    /// Edge of a voxel, metres.
    pub voxel_size: f64,
    /// What a reading says (Eq. 7).
    pub sensor_model: SensorModel,
    /// Euclidean distance, metres, up to which voxels are updated.
    pub max_range: f64,
    /// What a reading beyond `max_range` says.
    pub beyond_max_range: BeyondMaxRange,
    /// How a voxel's log-odd is found in the depth image.
    pub update: UpdateRule,
    /// Log-odds are kept within these; `None` keeps all evidence, and with it exact removal.
    pub clamp: Option<(f64, f64)>,
    /// Bytes that blocks and directory may take.
    pub max_bytes: Option<usize>,
    /// Probability of being occupied before anything is seen (Eq. 4).
    pub prior: f64,
    /// Whether hidden and free parts of the frustum are told apart before voxels are asked. The map is the same
    /// without it, only slower; tests switch it off to show that. Not part of a map's file.
    #[serde(skip, default = "enabled")]
    pub cull: bool,
    /// Whether voxels near surfaces keep a mean colour, of frames that have one. A file says so by its version.
    #[serde(skip)]
    pub colour: bool,
}

impl GridConfig {
    /// Voxels of `voxel_size` metres, `k = sigma = voxel_size`, 5 m range, the paper's rule, no clamp, no byte budget,
    /// prior 0.5.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the voxel size is not positive and finite.
    pub fn new(voxel_size: f64) -> Result<Self> {
        check("voxel_size", voxel_size, voxel_size > 0.0 && voxel_size.is_finite(), "a positive number of metres")?;
        Ok(Self {
            voxel_size,
            sensor_model: SensorModel::constant(voxel_size)?,
            max_range: 5.0,
            beyond_max_range: BeyondMaxRange::Free,
            update: UpdateRule::Pyramid,
            clamp: None,
            max_bytes: None,
            prior: 0.5,
            cull: true,
            colour: false,
        })
    }

    /// The most voxels along the range of a map: more makes a single frame larger than memory.
    pub const MAX_VOXELS_IN_RANGE: f64 = 4096.0;

    /// Checks the parameters.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the first that is out of its range.
    pub fn validate(&self) -> Result<()> {
        let Self { voxel_size, max_range, prior, .. } = *self;
        check("voxel_size", voxel_size, voxel_size > 0.0 && voxel_size.is_finite(), "a positive number of metres")?;
        check("max_range", max_range, max_range > 0.0 && max_range.is_finite(), "a positive number of metres")?;
        let voxels = max_range / voxel_size;
        if !(1.0..=Self::MAX_VOXELS_IN_RANGE).contains(&voxels) {
            return Err(Error::Parameter {
                name: "voxel_size",
                got: format!("{voxel_size}"),
                expected: format!(
                    "between {} and {max_range} m for a max_range of {max_range} m",
                    max_range / Self::MAX_VOXELS_IN_RANGE
                ),
            });
        }
        check("prior", prior, prior > 0.0 && prior < 1.0, "a probability between 0 and 1")?;
        self.sensor_model.validate()?;
        if let Some((low, high)) = self.clamp {
            let l_0 = log_odds::from_probability(prior);
            // What is stored must not be 0 at either end, or everything seen would look like what was never seen.
            let limits = self.limits();
            if !(limits.low < 0 && limits.high > 0 && low.is_finite() && high.is_finite()) {
                return Err(Error::Parameter {
                    name: "clamp",
                    got: format!("({low}, {high})"),
                    expected: format!(
                        "two finite log-odds, one at least {UNIT} below and one as much above that of the prior, {l_0}"
                    ),
                });
            }
        }
        Ok(())
    }

    /// The range of the integers that are stored: evidence, without the prior.
    pub(crate) fn limits(&self) -> Limits {
        let l_0 = log_odds::from_probability(self.prior);
        match self.clamp {
            None => Limits { low: i32::MIN, high: i32::MAX },
            Some((low, high)) => Limits { low: log_odds::to_fixed(low - l_0), high: log_odds::to_fixed(high - l_0) },
        }
    }

    /// How far from the origin, metres, a camera may be: all that it sees then has block coordinates within
    /// [`MAX_BLOCK`], with a block or two to spare, or lies where OctoMap could see it too.
    pub(crate) fn coordinate_limit(&self) -> f64 {
        let voxels = match self.update {
            UpdateRule::Rays => f64::from(rays::REACH),
            _ => f64::from(MAX_BLOCK - 2) * BLOCK_EDGE as f64,
        };
        self.voxel_size * voxels - self.max_range
    }
}

fn enabled() -> bool {
    true
}

fn check(name: &'static str, got: f64, holds: bool, expected: &str) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::Parameter { name, got: format!("{got}"), expected: expected.into() }) }
}
