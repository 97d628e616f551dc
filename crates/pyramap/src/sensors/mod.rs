//! Range sensors: what users name, and how each projects.
//!
//! [`Sensor`] is any of them. A frame's stages are compiled for each [`Projection`] by itself; the pyramid, the cull and
//! the update rules are the same for all.

mod pinhole;
mod projection;

pub use pinhole::Pinhole;
pub use projection::{Outline, PixelRay, Projected, Projection};

use crate::camera::PinholeCamera;

/// A range sensor.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Sensor {
    /// A depth camera.
    Pinhole(PinholeCamera),
}

impl Sensor {
    /// Columns of its image.
    pub fn width(&self) -> usize {
        match self {
            Sensor::Pinhole(camera) => camera.width,
        }
    }

    /// Rows of its image.
    pub fn height(&self) -> usize {
        match self {
            Sensor::Pinhole(camera) => camera.height,
        }
    }
}

impl From<&PinholeCamera> for Sensor {
    fn from(camera: &PinholeCamera) -> Self {
        Sensor::Pinhole(*camera)
    }
}

impl From<&Sensor> for Sensor {
    fn from(sensor: &Sensor) -> Self {
        sensor.clone()
    }
}
