//! Stage 1, ranges (Eq. 6): distances along the pixels' rays, out of depths unless they were measured.

use crate::depth::{Depth, DepthImage, Reading};
use crate::error::{Error, Result};
use crate::sensors::Sensor;
use crate::simd::{Instructions, Kernel, Simd};
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

/// The measurements `M(u, v)`: distance along the pixel's ray, metres; `0` no reading, `+inf` no return.
#[derive(Clone, Debug, Default)]
pub struct Ranges {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row.
    pub values: Vec<f32>,
    /// The distance for each metre that a pixel reads, kept from frame to frame.
    range_per_reading: Vec<f32>,
    made_for: Option<(Sensor, Reading)>,
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
        self.fit(sensor, image.reading);
        let (width, max_range, beyond) = (self.width, max_range as f32, beyond.value());
        let rows = self.values.par_chunks_mut(width).zip(self.range_per_reading.par_chunks(width)).enumerate();
        rows.with_min_len(16).for_each(|(row, (out, range_per_reading))| {
            let depth = image.depth.part(row * width..(row + 1) * width);
            Instructions::widest().run(Row { depth, range_per_reading, max_range, beyond, out });
        });
        self.align_rows(sensor);
        Ok(())
    }

    /// Sizes the buffers to a sensor; computes its distances per reading unless it is the last frame's.
    fn fit(&mut self, sensor: &Sensor, reading: Reading) {
        if self.made_for.as_ref().is_some_and(|(known, of)| known == sensor && *of == reading) {
            return;
        }
        (self.width, self.height) = (sensor.width(), sensor.height());
        self.values.resize(self.width * self.height, 0.0);
        self.range_per_reading.clear();
        self.range_per_reading.extend(range_per_reading(sensor, reading));
        self.made_for = Some((sensor.clone(), reading));
    }

    /// Moves rows that look further than their columns' azimuths to the columns to which they look.
    fn align_rows(&mut self, sensor: &Sensor) {
        let Sensor::Spherical(sensor) = sensor else { return };
        let width = self.width;
        self.values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
            let (columns, _) = sensor.shift(row);
            values.rotate_right(columns.rem_euclid(width as isize) as usize);
        });
    }
}

/// The ranges of one row.
struct Row<'a> {
    depth: Depth<'a>,
    range_per_reading: &'a [f32],
    max_range: f32,
    beyond: f32,
    out: &'a mut [f32],
}

impl Kernel for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let measured = |depth, per_depth| range(depth, per_depth, self.max_range, self.beyond);
        let lanes = self.out.iter_mut().zip(self.range_per_reading);
        match self.depth {
            Depth::F32(values) => lanes.zip(values).for_each(|((out, &per), &depth)| *out = measured(depth, per)),
            Depth::F64(values) => {
                lanes.zip(values).for_each(|((out, &per), &depth)| *out = measured(depth as f32, per))
            }
            Depth::U16 { values, scale } => {
                let scale = scale as f32;
                let metres = |raw| f32::from(raw) / scale;
                lanes.zip(values).for_each(|((out, &per), &raw)| *out = measured(metres(raw), per));
            }
        }
    }
}

/// How far the surface lies along the ray for each metre that a pixel reads, row by row.
pub fn range_per_reading(sensor: &Sensor, reading: Reading) -> impl Iterator<Item = f32> {
    let pixel = move |u, v| match reading {
        Reading::Depth => sensor.range_per_depth(u, v),
        Reading::Range if sensor.sees(u, v) => 1.0,
        Reading::Range => 0.0,
    };
    (0..sensor.height()).flat_map(move |v| (0..sensor.width()).map(move |u| pixel(u, v)))
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
    if (image.width, image.height) != (sensor.width(), sensor.height()) {
        return Err(Error::ImageSize {
            image: image.reading.image(),
            got_width: image.width,
            got_height: image.height,
            width: sensor.width(),
            height: sensor.height(),
        });
    }
    let pixels = image.width * image.height;
    let says_something = |(pixel, per)| range(image.depth.metres(pixel), per, max_range as f32, beyond.value()) > 0.0;
    if !range_per_reading(sensor, image.reading).enumerate().any(says_something) {
        return Err(Error::Parameter {
            name: image.reading.image(),
            got: format!("{pixels} pixels without a reading"),
            expected: "at least one reading that is neither 0, negative nor NaN".into(),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::PinholeCamera;

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
