//! Stage 1, ranges (Eq. 6): Euclidean distances out of z-depths.

use crate::camera::PinholeCamera;
use crate::depth::{Depth, DepthImage};
use crate::error::{Error, Result};
use crate::sensors::Sensor;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What a reading beyond `max_range` says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum BeyondMaxRange {
    /// Free up to `max_range`, and no surface.
    #[default]
    Free,
    /// Nothing, as if there were no reading.
    Ignore,
}

impl BeyondMaxRange {
    /// The measurement that stands for such a reading.
    pub fn value(self) -> f32 {
        match self {
            BeyondMaxRange::Free => f32::INFINITY,
            BeyondMaxRange::Ignore => 0.0,
        }
    }
}

/// The measurements `M(u, v)`: distance from the camera centre, metres; `0` no reading, `+inf` no return.
#[derive(Clone, Debug, Default)]
pub struct Ranges {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row.
    pub values: Vec<f32>,
    /// `|K^-1 [u v 1]|` for each pixel of `camera`, kept from frame to frame.
    range_per_depth: Vec<f32>,
    camera: Option<PinholeCamera>,
}

impl Ranges {
    /// Measurements that are distances already, as a time-of-flight camera gives them.
    ///
    /// # Panics
    /// If there are not `width * height` values.
    pub fn from_values(width: usize, height: usize, values: Vec<f32>) -> Self {
        assert_eq!(values.len(), width * height, "ranges of a {height} x {width} image");
        Self { width, height, values, ..Self::default() }
    }

    /// Computes the measurements of a depth image into this buffer.
    ///
    /// # Errors
    /// [`Error::ImageSize`] if image and sensor differ; [`Error::Parameter`] if no pixel says anything.
    pub fn compute(
        &mut self,
        image: &DepthImage,
        sensor: &Sensor,
        max_range: f64,
        beyond: BeyondMaxRange,
    ) -> Result<()> {
        check(image, sensor, max_range, beyond)?;
        let Sensor::Pinhole(camera) = sensor;
        self.fit(camera);
        let measured = |depth, per_depth| range(depth, per_depth, max_range as f32, beyond.value());
        let width = self.width;
        let rows = self.values.par_chunks_mut(width).zip(self.range_per_depth.par_chunks(width)).enumerate();
        rows.with_min_len(16).for_each(|(row, (out, range_per_depth))| {
            let pixels = row * width..(row + 1) * width;
            let lanes = out.iter_mut().zip(range_per_depth);
            match image.depth {
                Depth::F32(values) => {
                    lanes.zip(&values[pixels]).for_each(|((out, &per), &depth)| *out = measured(depth, per));
                }
                Depth::F64(values) => {
                    lanes.zip(&values[pixels]).for_each(|((out, &per), &depth)| *out = measured(depth as f32, per));
                }
                Depth::U16 { values, scale } => {
                    let scale = scale as f32;
                    let metres = |raw| f32::from(raw) / scale;
                    lanes.zip(&values[pixels]).for_each(|((out, &per), &raw)| *out = measured(metres(raw), per));
                }
            }
        });
        Ok(())
    }

    /// Sizes the buffers to a camera; computes its distances per depth unless it is the last frame's.
    fn fit(&mut self, camera: &PinholeCamera) {
        if self.camera.as_ref() == Some(camera) {
            return;
        }
        (self.width, self.height) = (camera.width, camera.height);
        self.values.resize(camera.width * camera.height, 0.0);
        self.range_per_depth.clear();
        self.range_per_depth.extend(range_per_depth(camera));
        self.camera = Some(*camera);
    }
}

/// `|K^-1 [u v 1]|` for each pixel of a camera, row by row.
pub fn range_per_depth(camera: &PinholeCamera) -> impl Iterator<Item = f32> {
    let row = move |v| (0..camera.width).map(move |u| camera.range_per_depth(u as f64, v as f64) as f32);
    (0..camera.height).flat_map(row)
}

/// What a pixel measures (Eq. 6), with `beyond` for what lies beyond the range of the map.
#[inline(always)]
fn range(depth: f32, range_per_depth: f32, max_range: f32, beyond: f32) -> f32 {
    let range = depth * range_per_depth;
    let range = if range > 0.0 { range } else { 0.0 };
    if range > max_range { if range == f32::INFINITY { range } else { beyond } } else { range }
}

/// Checks that an image can be fused, without looking at more pixels than that takes.
///
/// # Errors
/// [`Error::ImageSize`] if image and camera differ; [`Error::Parameter`] if no pixel says anything.
pub fn check(image: &DepthImage, sensor: &Sensor, max_range: f64, beyond: BeyondMaxRange) -> Result<()> {
    let Sensor::Pinhole(camera) = sensor;
    if (image.width, image.height) != (camera.width, camera.height) {
        return Err(Error::ImageSize {
            got_width: image.width,
            got_height: image.height,
            width: camera.width,
            height: camera.height,
        });
    }
    let pixels = image.width * image.height;
    let says_something = |(pixel, per)| range(image.depth.metres(pixel), per, max_range as f32, beyond.value()) > 0.0;
    if !range_per_depth(camera).enumerate().any(says_something) {
        return Err(Error::Parameter {
            name: "depth image",
            got: format!("{pixels} pixels without a reading"),
            expected: "at least one reading that is neither 0, negative nor NaN".into(),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ranges(depth: &[f32], beyond: BeyondMaxRange) -> Result<Vec<f32>> {
        let camera = PinholeCamera::new(depth.len(), 1, 1.0, 1.0, 0.0, 0.0)?;
        let mut ranges = Ranges::default();
        ranges.compute(&DepthImage::new(Depth::F32(depth), depth.len(), 1)?, &Sensor::from(&camera), 5.0, beyond)?;
        Ok(ranges.values)
    }

    #[test]
    fn every_kind_of_reading() {
        let depth = [2.0, 0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3.0];
        let inf = f32::INFINITY;
        // The last pixel lies at sqrt(1 + 36) times its depth: 18 m, beyond the range.
        assert_eq!(ranges(&depth, BeyondMaxRange::Free).unwrap(), [2.0, 0.0, 0.0, 0.0, inf, 0.0, inf]);
        assert_eq!(ranges(&depth, BeyondMaxRange::Ignore).unwrap(), [2.0, 0.0, 0.0, 0.0, inf, 0.0, 0.0]);
    }

    #[test]
    fn an_image_that_says_nothing_is_refused() {
        assert!(ranges(&[0.0, f32::NAN, -3.0], BeyondMaxRange::Free).is_err());
    }

    #[test]
    fn every_number_type_gives_the_same() {
        let camera = Sensor::from(&PinholeCamera::new(3, 2, 2.0, 3.0, 1.0, 0.5).unwrap());
        let raw = [1000, 2000, 0, 500, 4000, 1];
        let metres = raw.map(|v: u16| f32::from(v) / 1000.0);
        let double = raw.map(|v: u16| f64::from(v) / 1000.0);
        let run = |depth| {
            let mut ranges = Ranges::default();
            ranges.compute(&DepthImage::new(depth, 3, 2).unwrap(), &camera, 5.0, BeyondMaxRange::Free).unwrap();
            ranges.values
        };
        assert_eq!(run(Depth::F32(&metres)), run(Depth::U16 { values: &raw, scale: 1000.0 }));
        assert_eq!(run(Depth::F32(&metres)), run(Depth::F64(&double)));
    }
}
