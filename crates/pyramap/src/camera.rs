//! The pinhole camera: axes x right, y down, z forward; integer pixel coordinates are pixel centres.

use crate::error::{Error, Result};
use crate::sensors::{Distortion, Lens, PixelRay};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Pinhole intrinsics in pixels, with a lens that may distort.
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
    lens: Option<Lens>,
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
        Ok(Self { width, height, fx, fy, cx, cy, lens: None })
    }

    /// The same camera behind a lens that distorts. With coefficients that are all 0 it is a camera without.
    ///
    /// A lens whose image folds back within the picture is taken as far as it does not: pixels beyond see nothing.
    ///
    /// # Errors
    /// [`Error::Parameter`] if a coefficient is not finite, or the image folds back at its very middle.
    pub fn with_distortion(self, distortion: Distortion) -> Result<Self> {
        let coefficients = distortion.coefficients();
        let refuse = |expected: &str| {
            Err(Error::Parameter { name: "distortion", got: format!("{coefficients:?}"), expected: expected.into() })
        };
        if !coefficients.iter().all(|c| c.is_finite()) {
            return refuse("finite coefficients k1, k2, p1, p2, k3");
        }
        if distortion == Distortion::default() {
            return Ok(Self { lens: None, ..self });
        }
        if distortion.radius() == 0.0 {
            return refuse("a lens that has an image around its axis");
        }
        let (right, below) = (self.width as f64 - 0.5, self.height as f64 - 0.5);
        let columns = (0..=self.width).map(|u| u as f64 - 0.5).flat_map(|u| [[u, -0.5], [u, below]]);
        let rows = (0..=self.height).map(|v| v as f64 - 0.5).flat_map(|v| [[-0.5, v], [right, v]]);
        let lens = Lens::new(distortion, columns.chain(rows).map(|[u, v]| self.flat(u, v)));
        Ok(Self { lens: Some(lens), ..self })
    }

    /// The lens, if it distorts.
    pub fn lens(&self) -> Option<&Lens> {
        self.lens.as_ref()
    }

    /// The ray of a pixel, `K^-1 [u v 1]` made a unit vector; NaN for a pixel to which the lens brings nothing.
    pub fn ray(&self, column: usize, row: usize) -> PixelRay {
        let [x, y] = self.undistorted(column as f64, row as f64).unwrap_or([f64::NAN; 2]);
        PixelRay { start: Vector3::zeros(), direction: Vector3::new(x, y, 1.0).normalize() }
    }

    /// `|K^-1 [u v 1]|`: Euclidean distance per metre of z-depth at a pixel (Eq. 6); 0 for a pixel to which the lens brings
    /// nothing.
    pub fn range_per_depth(&self, u: f64, v: f64) -> f64 {
        self.undistorted(u, v).map_or(0.0, |[x, y]| (x * x + y * y + 1.0).sqrt())
    }

    /// `K^-1 [u v 1]` without the last component.
    fn flat(&self, u: f64, v: f64) -> [f64; 2] {
        [(u - self.cx) / self.fx, (v - self.cy) / self.fy]
    }

    /// What the lens makes of that.
    fn undistorted(&self, u: f64, v: f64) -> Option<[f64; 2]> {
        let flat = self.flat(u, v);
        self.lens.as_ref().map_or(Some(flat), |lens| lens.undo(flat))
    }

    /// `sqrt(fx fy)`: the one focal length that sizes pyramid layers (Eq. 11).
    pub fn focal_length(&self) -> f64 {
        (self.fx * self.fy).sqrt()
    }
}
