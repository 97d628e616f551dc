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

/// The latest version.
pub const VERSION: u32 = 3;
/// That of maps without colour.
const WITHOUT_COLOUR: u32 = 2;

/// As version 3 writes them, for maps that keep colours: the parameters of version 2, and how many blocks have a colour.
type Head3 = (Head, u64);

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
    /// The head in the earliest version that can say it, and that version. `num_coloured` says how many blocks have a
    /// colour, of a map that keeps any.
    pub fn written(self, num_coloured: Option<usize>) -> (u32, Vec<u8>) {
        let (version, bytes) = match num_coloured {
            None => (WITHOUT_COLOUR, postcard::to_allocvec(&self)),
            Some(count) => (VERSION, postcard::to_allocvec::<Head3>(&(self, count as u64))),
        };
        (version, bytes.expect("plain data can be written to memory"))
    }

    /// Reads the head of a file of a version up to [`VERSION`], and how many blocks have a colour.
    pub fn read(version: u32, payload: &[u8]) -> Result<(Self, u64), Damage> {
        match version {
            1 => Ok((whole::<Head1>(payload)?.current().map_err(Damage::Parameter)?, 0)),
            WITHOUT_COLOUR => Ok((whole(payload)?, 0)),
            _ => {
                let (mut head, num_coloured) = whole::<Head3>(payload)?;
                head.config.colour = true;
                Ok((head, num_coloured))
            }
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
