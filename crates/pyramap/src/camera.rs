//! The pinhole camera: axes x right, y down, z forward; integer pixel coordinates are pixel centres.

use crate::error::{Error, Result};
use crate::sensors::PixelRay;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Pinhole intrinsics without distortion, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PinholeCamera {
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
    /// Focal length along a row.
    pub fx: f64,
    /// Focal length along a column.
    pub fy: f64,
    /// Column of the principal point; `0` is the centre of the first pixel.
    pub cx: f64,
    /// Row of the principal point.
    pub cy: f64,
}

impl PinholeCamera {
    /// The largest width and height, pixels: coordinates stay exact in `f32` arithmetic with room for fractions.
    pub const MAX_SIDE: usize = 16_384;

    /// Checks the numbers and makes the camera.
    ///
    /// # Errors
    /// [`Error::Camera`] if a side is zero or above [`Self::MAX_SIDE`], a focal length is not positive and finite,
    /// or the principal point is not finite.
    pub fn new(width: usize, height: usize, fx: f64, fy: f64, cx: f64, cy: f64) -> Result<Self> {
        let refuse = |name, got: f64, expected| Err(Error::Camera { name, got, expected });
        for (name, side) in [("width", width), ("height", height)] {
            if side == 0 || side > Self::MAX_SIDE {
                return refuse(name, side as f64, "1 to 16384 pixels");
            }
        }
        for (name, f) in [("fx", fx), ("fy", fy)] {
            if !(f.is_finite() && f > 0.0) {
                return refuse(name, f, "a positive, finite number of pixels");
            }
        }
        for (name, c) in [("cx", cx), ("cy", cy)] {
            if !c.is_finite() {
                return refuse(name, c, "a finite number of pixels");
            }
        }
        Ok(Self { width, height, fx, fy, cx, cy })
    }

    /// `sqrt(fx fy)`: the one focal length that sizes pyramid layers (Eq. 11).
    pub fn focal_length(&self) -> f64 {
        (self.fx * self.fy).sqrt()
    }

    /// The ray of a pixel, `K^-1 [u v 1]` made a unit vector.
    pub fn ray(&self, column: usize, row: usize) -> PixelRay {
        let direction = Vector3::new((column as f64 - self.cx) / self.fx, (row as f64 - self.cy) / self.fy, 1.0);
        PixelRay { start: Vector3::zeros(), direction: direction.normalize() }
    }

    /// `|K^-1 [u v 1]|`: Euclidean distance per metre of z-depth at a pixel (Eq. 6).
    pub fn range_per_depth(&self, u: f64, v: f64) -> f64 {
        let (x, y) = ((u - self.cx) / self.fx, (v - self.cy) / self.fy);
        (x * x + y * y + 1.0).sqrt()
    }
}
