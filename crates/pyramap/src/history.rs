//! What was done to a map beyond adding frames and taking them off. Evidence is no longer the sum of the frames then,
//! and no frame can be taken off exactly.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// How often evidence was decayed or erased, in this map and those merged into it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct History {
    /// Decays that changed something.
    pub decays: u64,
    /// The product of their factors: at least this much is left of the evidence that the map had before them.
    pub decay_product: f64,
    /// Times that clearing or cropping made something unknown.
    pub erasures: u64,
}

impl Default for History {
    fn default() -> Self {
        Self { decays: 0, decay_product: 1.0, erasures: 0 }
    }
}

impl History {
    /// This history and another's.
    pub fn and(self, other: Self) -> Self {
        Self {
            decays: self.decays.saturating_add(other.decays),
            decay_product: self.decay_product * other.decay_product,
            erasures: self.erasures.saturating_add(other.erasures),
        }
    }

    /// Why frames cannot be taken off; `None` if they can.
    pub fn loss(&self) -> Option<String> {
        let Self { decays, decay_product, erasures } = *self;
        if decays > 0 {
            Some(format!(
                "the map was decayed {decays} times, by {decay_product} in all, and holds less than its frames"
            ))
        } else if erasures > 0 {
            Some(format!(
                "parts of the map were cleared or cropped {erasures} times, and lack what the frame had there"
            ))
        } else {
            None
        }
    }

    /// Checks a history that came from a file.
    pub(crate) fn validate(&self) -> Result<()> {
        let Self { decays, decay_product, .. } = *self;
        let possible = if decays == 0 { decay_product == 1.0 } else { (0.0..1.0).contains(&decay_product) };
        if possible {
            return Ok(());
        }
        Err(Error::Parameter {
            name: "decay_product",
            got: format!("{decay_product} of {decays} decays"),
            expected: "1 without decays, and from 0 to less than 1 with some".into(),
        })
    }
}
