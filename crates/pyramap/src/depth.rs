//! Images as they come: depth or range per pixel, in the number type of the sensor.

use crate::colour::ColourImage;
use crate::error::{Error, Result};
use crate::sensor::SensorModel;
use std::ops::Range;

/// The pixels of a depth image, row by row.
///
/// `0`, negative and NaN mean no reading. `+inf` means no return: free as far as the sensor reaches.
#[derive(Clone, Copy, Debug)]
pub enum Depth<'a> {
    /// Metres.
    F32(&'a [f32]),
    /// Metres.
    F64(&'a [f64]),
    /// Steps of `1 / scale` metres: 1000 for millimetres.
    U16 {
        /// Raw readings; every value but `0` is a distance, 65535 too.
        values: &'a [u16],
        /// Steps in a metre.
        scale: f64,
    },
}

/// What the pixels of an image measure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reading {
    /// Depth along the camera's z axis. A spherical sensor has none: it means ranges.
    #[default]
    Depth,
    /// Distance along the pixel's ray, as time-of-flight cameras and LiDARs give it.
    Range,
}

impl Reading {
    /// What an image of these is called.
    pub(crate) fn image(self) -> &'static str {
        match self {
            Reading::Depth => "depth image",
            Reading::Range => "range image",
        }
    }
}

/// A depth image, or one of ranges, its size, and what else belongs to it.
#[derive(Clone, Copy, Debug)]
pub struct DepthImage<'a> {
    pub(crate) depth: Depth<'a>,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) reading: Reading,
    pub(crate) sensor_model: Option<SensorModel>,
    pub(crate) colour: Option<ColourImage<'a>>,
}

impl<'a> DepthImage<'a> {
    /// Checks that there are `width * height` pixels.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the image is empty, the count is another, or the scale is not positive and finite.
    pub fn new(depth: Depth<'a>, width: usize, height: usize) -> Result<Self> {
        Self::with_reading(depth, width, height, Reading::Depth)
    }

    /// An image of distances along the pixels' rays instead of depths.
    ///
    /// # Errors
    /// As [`DepthImage::new`].
    pub fn of_ranges(ranges: Depth<'a>, width: usize, height: usize) -> Result<Self> {
        Self::with_reading(ranges, width, height, Reading::Range)
    }

    fn with_reading(depth: Depth<'a>, width: usize, height: usize, reading: Reading) -> Result<Self> {
        let pixels = match depth {
            Depth::F32(values) => values.len(),
            Depth::F64(values) => values.len(),
            Depth::U16 { values, scale } => {
                if !(scale.is_finite() && scale > 0.0) {
                    return Err(Error::Parameter {
                        name: "depth_scale",
                        got: format!("{scale}"),
                        expected: "a positive, finite number of steps a metre".into(),
                    });
                }
                values.len()
            }
        };
        if pixels == 0 || Some(pixels) != width.checked_mul(height) {
            return Err(Error::Parameter {
                name: reading.image(),
                got: format!("{pixels} pixels"),
                expected: format!("height x width = {height} x {width} pixels, at least one"),
            });
        }
        Ok(Self { depth, width, height, reading, sensor_model: None, colour: None })
    }

    /// The same image, fused with a model of its own instead of the map's: a map may be made with several sensors. The rule
    /// [`Rays`](crate::update::UpdateRule::Rays) asks no model.
    #[must_use]
    pub fn with_sensor_model(self, model: SensorModel) -> Self {
        Self { sensor_model: Some(model), ..self }
    }

    /// The same image with a colour image, for a map that keeps colours.
    #[must_use]
    pub fn with_colour(self, colour: ColourImage<'a>) -> Self {
        Self { colour: Some(colour), ..self }
    }

    /// The colour image, if there is one.
    pub fn colour(&self) -> Option<&ColourImage<'a>> {
        self.colour.as_ref()
    }

    /// The model that the image is fused with, if not the map's.
    pub fn sensor_model(&self) -> Option<SensorModel> {
        self.sensor_model
    }

    /// The pixels.
    pub fn depth(&self) -> Depth<'a> {
        self.depth
    }

    /// What the pixels measure.
    pub fn reading(&self) -> Reading {
        self.reading
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }
}

impl<'a> Depth<'a> {
    /// Some of the pixels.
    pub(crate) fn part(&self, pixels: Range<usize>) -> Depth<'a> {
        match *self {
            Depth::F32(values) => Depth::F32(&values[pixels]),
            Depth::F64(values) => Depth::F64(&values[pixels]),
            Depth::U16 { values, scale } => Depth::U16 { values: &values[pixels], scale },
        }
    }

    /// The depth of a pixel, metres.
    #[inline]
    pub(crate) fn metres(&self, pixel: usize) -> f32 {
        match *self {
            Depth::F32(values) => values[pixel],
            Depth::F64(values) => values[pixel] as f32,
            Depth::U16 { values, scale } => f32::from(values[pixel]) / scale as f32,
        }
    }
}
