//! Depth images as they come: z-depth per pixel, in the number type of the sensor.

use crate::error::{Error, Result};

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

/// A depth image and its size.
#[derive(Clone, Copy, Debug)]
pub struct DepthImage<'a> {
    pub(crate) depth: Depth<'a>,
    pub(crate) width: usize,
    pub(crate) height: usize,
}

impl<'a> DepthImage<'a> {
    /// Checks that there are `width * height` pixels.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the image is empty, the count is another, or the scale is not positive and finite.
    pub fn new(depth: Depth<'a>, width: usize, height: usize) -> Result<Self> {
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
                name: "depth image",
                got: format!("{pixels} pixels"),
                expected: format!("height x width = {height} x {width} pixels, at least one"),
            });
        }
        Ok(Self { depth, width, height })
    }

    /// The pixels.
    pub fn depth(&self) -> Depth<'a> {
        self.depth
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

impl Depth<'_> {
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
