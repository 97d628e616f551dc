//! Range sensors: what users name, and how each projects.
//!
//! [`Sensor`] is any of them. A frame's stages are compiled for each [`Projection`] by itself; the pyramid, the cull and
//! the update rules are the same for all.

mod distorted;
mod lens;
mod orthographic;
mod pinhole;
mod projection;
mod range_image;
mod spherical;

pub use distorted::DistortedPinhole;
pub use lens::{Distortion, Lens};
pub use orthographic::{Orthographic, OrthographicCamera};
pub use pinhole::Pinhole;
pub use projection::{Outline, PixelRay, Projected, Projection};
pub use range_image::{LostPoints, RangeImage};
pub use spherical::{ATAN_COEFFICIENTS, BOUND_SLACK, Rows, Spherical, SphericalSensor};

use crate::camera::PinholeCamera;

/// A range sensor.
#[derive(Clone, Debug, PartialEq)]
pub enum Sensor {
    /// A depth camera.
    Pinhole(PinholeCamera),
    /// A LiDAR, spinning or not.
    Spherical(SphericalSensor),
    /// Parallel rays.
    Orthographic(OrthographicCamera),
}

impl Sensor {
    /// Columns of its image.
    pub fn width(&self) -> usize {
        match self {
            Sensor::Pinhole(camera) => camera.width,
            Sensor::Spherical(sensor) => sensor.width(),
            Sensor::Orthographic(camera) => camera.width,
        }
    }

    /// Rows of its image.
    pub fn height(&self) -> usize {
        match self {
            Sensor::Pinhole(camera) => camera.height,
            Sensor::Spherical(sensor) => sensor.height(),
            Sensor::Orthographic(camera) => camera.height,
        }
    }

    /// The ray of a pixel of an image as the sensor gives it; its direction is a unit vector.
    pub fn ray(&self, column: usize, row: usize) -> PixelRay {
        match self {
            Sensor::Pinhole(camera) => camera.ray(column, row),
            Sensor::Spherical(sensor) => sensor.ray(column, row),
            Sensor::Orthographic(camera) => camera.ray(column, row),
        }
    }

    /// The same for images as [`Ranges`](crate::ranges::Ranges) hold them, with rows aligned.
    pub(crate) fn aligned_ray(&self, column: usize, row: usize) -> PixelRay {
        match self {
            Sensor::Spherical(sensor) => sensor.aligned_ray(column, row),
            _ => self.ray(column, row),
        }
    }

    /// How far the surface lies along the ray of a pixel for each metre of depth that the pixel reads (Eq. 6).
    pub(crate) fn range_per_depth(&self, column: usize, row: usize) -> f32 {
        match self {
            Sensor::Pinhole(camera) => camera.range_per_depth(column as f64, row as f64) as f32,
            Sensor::Spherical(_) | Sensor::Orthographic(_) => 1.0,
        }
    }

    /// Whether a pixel sees anything at all.
    pub(crate) fn sees(&self, column: usize, row: usize) -> bool {
        match self {
            Sensor::Pinhole(camera) if camera.lens().is_some() => self.range_per_depth(column, row) > 0.0,
            _ => true,
        }
    }

    /// How far from its pose along any axis the sensor sees, metres.
    pub(crate) fn reach(&self, max_range: f64) -> f64 {
        match self {
            Sensor::Pinhole(_) | Sensor::Spherical(_) => max_range,
            Sensor::Orthographic(camera) => camera.aside().hypot(max_range),
        }
    }

    /// By how many columns a row of an image as the sensor gives it is moved to the right, around the seam, to be aligned
    /// with the others.
    pub fn row_shift(&self, row: usize) -> isize {
        match self {
            Sensor::Spherical(sensor) => sensor.shift(row).0,
            _ => 0,
        }
    }
}

impl From<&PinholeCamera> for Sensor {
    fn from(camera: &PinholeCamera) -> Self {
        Sensor::Pinhole(*camera)
    }
}

impl From<&SphericalSensor> for Sensor {
    fn from(sensor: &SphericalSensor) -> Self {
        Sensor::Spherical(sensor.clone())
    }
}

impl From<&OrthographicCamera> for Sensor {
    fn from(camera: &OrthographicCamera) -> Self {
        Sensor::Orthographic(*camera)
    }
}

impl From<&Sensor> for Sensor {
    fn from(sensor: &Sensor) -> Self {
        sensor.clone()
    }
}
