//! The spherical sensor, such as a spinning LiDAR: columns are azimuths, rows are beams of one elevation each.
//!
//! Its axes are x forward, y left, z up; azimuth is measured from x towards y, elevation from the x-y plane upwards.

mod angle;
mod projection;
mod rows;

pub use angle::COEFFICIENTS as ATAN_COEFFICIENTS;
pub use projection::{BOUND_SLACK, Spherical};
pub use rows::Rows;

use crate::camera::PinholeCamera;
use crate::error::{Error, Result};
use crate::sensors::PixelRay;
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

/// A spherical sensor. It is cheap to clone.
#[derive(Clone, Debug)]
pub struct SphericalSensor(Arc<Made>);

/// What the sensor is, and what is computed from it once.
#[derive(Debug)]
struct Made {
    parameters: Parameters,
    /// Cosine and sine of each column's azimuth.
    azimuths: Vec<[f64; 2]>,
    /// Cosine and sine of each row's elevation.
    elevations: Vec<[f64; 2]>,
    /// By how many whole columns each row is shifted, and cosine and sine of what remains.
    shifts: Vec<(isize, [f64; 2])>,
    rows: Rows,
}

#[derive(Clone, Debug, PartialEq)]
struct Parameters {
    width: usize,
    first_azimuth: f64,
    azimuth_span: f64,
    elevations: Vec<f64>,
    row_offsets: Vec<f64>,
}

impl SphericalSensor {
    /// Columns and rows can be no narrower than this angle: single precision tells a hundredth of it.
    pub const FINEST: f64 = TAU / PinholeCamera::MAX_SIDE as f64;

    /// A sensor that turns around once, clockwise as seen from above, from azimuth 0, with beams at these elevations,
    /// radians, in the order of the rows.
    ///
    /// # Errors
    /// [`Error::Parameter`] if there is no column or row or more than 16384; if an elevation is not between -pi/2 and
    /// pi/2, or they do not all rise or all fall; or if columns or rows are narrower than [`Self::FINEST`].
    pub fn new(width: usize, elevations: &[f64]) -> Result<Self> {
        Parameters {
            width,
            first_azimuth: 0.0,
            azimuth_span: -TAU,
            elevations: elevations.to_vec(),
            row_offsets: Vec::new(),
        }
        .make()
    }

    /// The same sensor with other columns: the azimuth of the first one's centre, and the angle from there to one column
    /// past the last, radians; the angle is positive if columns go anticlockwise as seen from above, and 2 pi either way
    /// is a full turn.
    ///
    /// # Errors
    /// [`Error::Parameter`] if an angle is not finite, the second is 0 or more than a full turn, or columns are narrower
    /// than [`Self::FINEST`].
    pub fn with_azimuths(&self, first: f64, span: f64) -> Result<Self> {
        Parameters { first_azimuth: first, azimuth_span: span, ..self.0.parameters.clone() }.make()
    }

    /// The same sensor with beams that do not look to where their column does, but this angle further, radians, one for
    /// each row, in the sense in which azimuth is measured. Rows are aligned to whole columns before anything else is done
    /// with an image, so that they are off by half a column at most; the rules `ideal` and `rays` know the rest too.
    ///
    /// # Errors
    /// [`Error::Parameter`] if there is not one finite number a row, or the sensor does not make a full turn.
    pub fn with_row_offsets(&self, offsets: &[f64]) -> Result<Self> {
        Parameters { row_offsets: offsets.to_vec(), ..self.0.parameters.clone() }.make()
    }

    /// Elevations that lie evenly between that of the first row and that of the last.
    pub fn even_elevations(height: usize, first: f64, last: f64) -> Vec<f64> {
        let step = if height > 1 { (last - first) / (height - 1) as f64 } else { 0.0 };
        (0..height).map(|row| first + step * row as f64).collect()
    }

    /// Columns of the image.
    pub fn width(&self) -> usize {
        self.0.parameters.width
    }

    /// Rows of the image: beams.
    pub fn height(&self) -> usize {
        self.0.parameters.elevations.len()
    }

    /// Azimuth of the first column's centre, radians.
    pub fn first_azimuth(&self) -> f64 {
        self.0.parameters.first_azimuth
    }

    /// From the first column to one past the last, radians.
    pub fn azimuth_span(&self) -> f64 {
        self.0.parameters.azimuth_span
    }

    /// The elevation of each row, radians.
    pub fn elevations(&self) -> &[f64] {
        &self.0.parameters.elevations
    }

    /// How much further each row looks than its columns' azimuths, radians; empty if none does.
    pub fn row_offsets(&self) -> &[f64] {
        &self.0.parameters.row_offsets
    }

    /// From column to column, radians.
    pub fn column_width(&self) -> f64 {
        self.azimuth_span().abs() / self.width() as f64
    }

    /// Pixels per radian: the one focal length that sizes pyramid layers (Eq. 11). It is that of the wider pixels, columns
    /// or, on average, rows: where they differ much, as those of a spinning LiDAR do, a layer between the two would have
    /// texels higher than the voxels that they serve.
    pub fn focal_length(&self) -> f64 {
        1.0 / self.column_width().max(self.rows().mean_spacing())
    }

    /// Whether the last column's neighbour is the first.
    pub fn full_turn(&self) -> bool {
        self.azimuth_span().abs() == TAU
    }

    /// The ray of a pixel of an image as the sensor gives it; a unit vector.
    pub fn ray(&self, column: usize, row: usize) -> PixelRay {
        let (shift, _) = self.shift(row);
        self.aligned_ray((column as isize + shift).rem_euclid(self.width() as isize) as usize, row)
    }

    /// The ray of a pixel of an image whose rows are aligned; a unit vector.
    pub(crate) fn aligned_ray(&self, column: usize, row: usize) -> PixelRay {
        let ([cos, sin], [flat, up]) = (self.0.azimuths[column], self.0.elevations[row]);
        let (_, [c, s]) = self.shift(row);
        let direction = Vector3::new(flat * (cos * c - sin * s), flat * (sin * c + cos * s), up);
        PixelRay { start: Vector3::zeros(), direction }
    }

    /// By how many columns a row's readings are moved to the right to be aligned, and cosine and sine of what remains.
    pub(crate) fn shift(&self, row: usize) -> (isize, [f64; 2]) {
        self.0.shifts.get(row).copied().unwrap_or((0, [1.0, 0.0]))
    }

    /// Which row an elevation belongs to.
    pub(crate) fn rows(&self) -> &Rows {
        &self.0.rows
    }
}

impl PartialEq for SphericalSensor {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || self.0.parameters == other.0.parameters
    }
}

impl Parameters {
    fn make(mut self) -> Result<SphericalSensor> {
        self.validate()?;
        let circle = |angle: f64| [libm::cos(angle), libm::sin(angle)];
        let step = self.azimuth_span / self.width as f64;
        let azimuth = |column: usize| self.first_azimuth + step * column as f64;
        let shift = |&offset: &f64| {
            let columns = (offset / step).round();
            (columns as isize, circle(offset - columns * step))
        };
        Ok(SphericalSensor(Arc::new(Made {
            azimuths: (0..self.width).map(azimuth).map(circle).collect(),
            elevations: self.elevations.iter().copied().map(circle).collect(),
            shifts: self.row_offsets.iter().map(shift).collect(),
            rows: Rows::new(&self.elevations, step.abs()),
            parameters: self,
        })))
    }

    fn validate(&mut self) -> Result<()> {
        let refuse = |name, got: String, expected: &str| Err(Error::Parameter { name, got, expected: expected.into() });
        for (name, side) in [("width", self.width), ("height", self.elevations.len())] {
            if side == 0 || side > PinholeCamera::MAX_SIDE {
                return refuse(name, format!("{side}"), "1 to 16384 pixels");
            }
        }
        if !self.first_azimuth.is_finite() {
            return refuse("first_azimuth", format!("{}", self.first_azimuth), "a finite number of radians");
        }
        // A full turn however it was rounded.
        if (self.azimuth_span.abs() - TAU).abs() < 1e-6 {
            self.azimuth_span = TAU.copysign(self.azimuth_span);
        }
        let span = self.azimuth_span.abs();
        if !(span > 0.0 && span <= TAU) {
            return refuse(
                "azimuth_span",
                format!("{}", self.azimuth_span),
                "up to 2 pi radians either way, and not 0",
            );
        }
        if span < SphericalSensor::FINEST * self.width as f64 {
            let got = format!("{} for {} columns", self.azimuth_span, self.width);
            return refuse("azimuth_span", got, "at least 2 pi / 16384 for each column");
        }
        self.validate_rows()
    }

    fn validate_rows(&self) -> Result<()> {
        let refuse = |name, got: String, expected: &str| Err(Error::Parameter { name, got, expected: expected.into() });
        if let Some((row, got)) = self.elevations.iter().enumerate().find(|(_, e)| e.is_nan() || e.abs() >= FRAC_PI_2) {
            return refuse("elevations", format!("{got} in row {row}"), "between -pi/2 and pi/2 radians");
        }
        let sense = |a: f64, b: f64| if b > a { 1.0 } else { -1.0 };
        let first = self.elevations.first().zip(self.elevations.get(1)).map_or(1.0, |(&a, &b)| sense(a, b));
        for (row, pair) in self.elevations.windows(2).enumerate() {
            if (pair[1] - pair[0]) * first < SphericalSensor::FINEST * (1.0 - 1e-9) {
                let got = format!("{} in row {row} and {} in the next", pair[0], pair[1]);
                return refuse("elevations", got, "all rising or all falling, by at least 2 pi / 16384 each time");
            }
        }
        if self.row_offsets.is_empty() {
            return Ok(());
        }
        if self.row_offsets.len() != self.elevations.len() {
            let (got, expected) = (self.row_offsets.len(), self.elevations.len());
            return refuse("row_offsets", format!("{got} numbers"), &format!("one for each of {expected} rows"));
        }
        if let Some((row, got)) = self.row_offsets.iter().enumerate().find(|(_, o)| o.is_nan() || o.abs() > TAU) {
            return refuse("row_offsets", format!("{got} in row {row}"), "within 2 pi radians");
        }
        if self.azimuth_span.abs() != TAU {
            let got = format!("given for a sensor of {} radians", self.azimuth_span);
            return refuse("row_offsets", got, "none unless the sensor makes a full turn");
        }
        Ok(())
    }
}
