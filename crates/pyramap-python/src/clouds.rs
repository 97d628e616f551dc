//! `range_image`: unorganised points as an image.

use crate::arrays::Rows;
use crate::sensors::AnySensor;
use crate::threads::run;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pyramap::sensors::RangeImage;

/// Puts an unorganised point cloud into a range image, so that it can be fused: of the points in one pixel the nearest stays.
///
/// Args:
///     points: (N, 3) metres in the sensor's frame.
///     camera: A sensor of any kind: its image has to be fine enough for the cloud, and not so fine that most pixels stay
///         empty.
///
/// Returns:
///     (H, W) float32 ranges for `integrate(ranges=...)`, metres, 0 where there is no point; and how many points are not in
///     it: "out_of_view", beside the image or behind the sensor; "hidden", no nearer than another in the same pixel; and
///     "unusable", not finite or where the sensor is.
///
/// Raises:
///     TypeError: If `camera` is no sensor.
///     ValueError: If the shape is another.
#[pyfunction]
pub fn range_image<'py>(
    points: &Bound<'py, PyAny>,
    camera: AnySensor,
) -> PyResult<(Bound<'py, PyArray2<f32>>, Bound<'py, PyDict>)> {
    let (py, sensor) = (points.py(), camera.0);
    let points = Rows::new(points, "points")?;
    let points = points.get()?;
    let RangeImage { ranges, lost } = run(py, || Ok(RangeImage::new(points, &sensor)))?;
    let counts = PyDict::new(py);
    counts.set_item("out_of_view", lost.out_of_view)?;
    counts.set_item("hidden", lost.hidden)?;
    counts.set_item("unusable", lost.unusable)?;
    Ok((PyArray1::from_vec(py, ranges).reshape([sensor.height(), sensor.width()])?, counts))
}
