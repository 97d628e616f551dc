//! A frame as Python gives it: an image, its sensor, and what else may come with it.

use crate::arrays::ImageArray;
use crate::colour::{ColourArguments, ColourArray};
use crate::sensor::SensorModel;
use crate::sensors::AnySensor;
use pyo3::prelude::*;
use pyramap::Sensor;

/// What Python says of a frame, but for its pose.
pub struct FrameArguments<'a, 'py> {
    pub depth: Option<&'a Bound<'py, PyAny>>,
    pub camera: Option<AnySensor>,
    pub depth_scale: Option<f64>,
    pub ranges: Option<&'a Bound<'py, PyAny>>,
    pub sensor_model: Option<SensorModel>,
    pub colour: ColourArguments<'a, 'py>,
}

/// A frame held for the length of a call.
pub struct CheckedFrame<'py> {
    array: ImageArray<'py>,
    model: Option<SensorModel>,
    colour: Option<ColourArray<'py>>,
    pub sensor: Sensor,
}

impl<'py> FrameArguments<'_, 'py> {
    /// Whether all is there, and of the right type.
    pub fn check(self) -> PyResult<CheckedFrame<'py>> {
        let array = ImageArray::depth_or_ranges(self.depth, self.ranges, self.depth_scale)?;
        let sensor = AnySensor::required(self.camera)?;
        let colour = self.colour.check(&sensor)?;
        Ok(CheckedFrame { array, model: self.sensor_model, colour, sensor })
    }
}

impl CheckedFrame<'_> {
    /// The image, with its own sensor model and its colour if it has them.
    pub fn image(&self) -> PyResult<pyramap::DepthImage<'_>> {
        let image = self.array.image()?;
        let image = self.model.map_or(image, |model| image.with_sensor_model(model.0));
        match &self.colour {
            None => Ok(image),
            Some(colour) => Ok(image.with_colour(colour.image()?)),
        }
    }
}
