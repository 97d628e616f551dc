//! The head of a `.pmap` file, as each version of the format writes it. What a version wrote stays readable: its struct
//! and those within are never changed but by a new variant at the end of an enum; what is new needs a new version.

use super::{Damage, damage};
use crate::config::GridConfig;
use crate::error::Error;
use crate::history::History;
use crate::ranges::BeyondMaxRange;
use crate::sensor::SensorModel;
use crate::update::UpdateRule;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// The version that is written.
pub const VERSION: u32 = 2;

/// Parameters and counts of a map, as version 2 writes them.
#[derive(Serialize, Deserialize)]
pub struct Head {
    pub config: GridConfig,
    pub num_frames: i64,
    pub saturated: u64,
    pub num_blocks: u64,
    pub history: History,
}

/// As version 1 wrote them: its maps could only be added to and subtracted from.
#[derive(Deserialize)]
struct Head1 {
    config: Config1,
    num_frames: i64,
    saturated: u64,
    num_blocks: u64,
}

#[derive(Deserialize)]
struct Config1 {
    voxel_size: f64,
    sensor_model: SensorModel,
    max_range: f64,
    beyond_max_range: BeyondMaxRange,
    update: UpdateRule,
    clamp: Option<(f64, f64)>,
    max_bytes: Option<usize>,
    prior: f64,
}

impl Head1 {
    fn current(self) -> Result<Head, Error> {
        let Self { config: old, num_frames, saturated, num_blocks } = self;
        let mut config = GridConfig::new(old.voxel_size)?;
        config.sensor_model = old.sensor_model;
        config.max_range = old.max_range;
        config.beyond_max_range = old.beyond_max_range;
        config.update = old.update;
        config.clamp = old.clamp;
        config.max_bytes = old.max_bytes;
        config.prior = old.prior;
        Ok(Head { config, num_frames, saturated, num_blocks, history: History::default() })
    }
}

impl Head {
    /// Reads the head of a file of a version up to [`VERSION`].
    pub fn read(version: u32, payload: &[u8]) -> Result<Self, Damage> {
        match version {
            1 => whole::<Head1>(payload)?.current().map_err(Damage::Parameter),
            _ => whole(payload),
        }
    }
}

/// What a payload holds, if that is all it holds.
fn whole<T: DeserializeOwned>(payload: &[u8]) -> Result<T, Damage> {
    match postcard::take_from_bytes(payload) {
        Ok((head, [])) => Ok(head),
        Ok((_, rest)) => damage(format!("unreadable parameters: {} bytes too many", rest.len())),
        Err(error) => damage(format!("unreadable parameters: {error}")),
    }
}
