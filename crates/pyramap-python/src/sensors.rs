//! Sensors other than the pinhole camera, and whatever Python passes as `camera`.

use crate::arrays;
use crate::camera::PinholeCamera;
use crate::errors::to_py;
use crate::grid::count;
use crate::orthographic::OrthographicCamera;
use numpy::PyArray1;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyramap::Sensor;
use std::f64::consts::TAU;

/// Any sensor, as the argument `camera`.
pub struct AnySensor(pub Sensor);

impl<'py> FromPyObject<'_, 'py> for AnySensor {
    type Error = PyErr;

    fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(camera) = value.cast::<PinholeCamera>() {
            Ok(Self(Sensor::from(&camera.get().0)))
        } else if let Ok(sensor) = value.cast::<SphericalSensor>() {
            Ok(Self(Sensor::from(&sensor.get().0)))
        } else if let Ok(camera) = value.cast::<OrthographicCamera>() {
            Ok(Self(Sensor::from(&camera.get().0)))
        } else {
            let got = arrays::type_name(&value);
            Err(PyTypeError::new_err(format!(
                "camera is a {got}, expected a PinholeCamera, SphericalSensor or OrthographicCamera"
            )))
        }
    }
}

impl AnySensor {
    /// What is said where an argument of this type is left out.
    pub fn required(sensor: Option<Self>) -> PyResult<Sensor> {
        sensor.map(|sensor| sensor.0).ok_or_else(|| PyTypeError::new_err("camera is missing, expected a sensor"))
    }
}

/// A sensor whose columns are azimuths and whose rows are beams of one elevation each, such as a spinning LiDAR.
///
/// Its axes are x forward, y left, z up. Azimuth is measured from x towards y, elevation from the x-y plane upwards, both
/// in radians. An image of it holds ranges, distances along the beams. Wherever a `camera` is asked for with its
/// `world_from_camera`, this sensor and its pose in the world will do. Sensors compare by value and can be pickled.
///
/// The pyramid's layers (Eq. 11) are sized by the pixels per radian of columns or, on average, of rows, whichever are
/// fewer: so no texel is wider or higher than the voxels that it serves. After a full turn the last column's neighbour is the first; there are then only such layers as halve the
/// columns without a rest: best are powers of two.
///
/// Args:
///     width: Columns, 1 to 16384.
///     elevations: (H,) the elevation of each row; all rising or all falling, by at least 2 pi / 16384. With `height`
///         instead those of the first row and the last, between which the others lie evenly.
///     height: Rows, 1 to 16384, if they lie evenly.
///     first_azimuth: Azimuth of the first column's centre.
///     azimuth_span: Angle from the first column to one past the last: 2 pi is a full turn; less, by at least
///         2 pi / 16384 a column, a sector. Positive is anticlockwise as seen from above; most LiDARs turn clockwise.
///     row_offsets: (H,) how much further each row looks than its columns' azimuths, for sensors of a full turn. Rows are
///         moved by whole columns before anything else is done with an image; what remains, half a column at most, is
///         known to the rules "ideal" and "rays" alone.
///
/// Raises:
///     ValueError: If a number is out of its range, or not finite; the message names it.
#[pyclass(frozen, eq, module = "pyramap", from_py_object)]
#[derive(Clone, PartialEq)]
pub struct SphericalSensor(pub pyramap::SphericalSensor);

#[pymethods]
impl SphericalSensor {
    #[new]
    #[pyo3(signature = (width, elevations, height = None, *, first_azimuth = 0.0, azimuth_span = -TAU,
                        row_offsets = None),
           text_signature = "(width, elevations, height=None, *, first_azimuth=0.0, azimuth_span=-6.283185307179586, \
                             row_offsets=None)")]
    fn new(
        width: i64,
        elevations: &Bound<'_, PyAny>,
        height: Option<i64>,
        first_azimuth: f64,
        azimuth_span: f64,
        row_offsets: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let elevations = elevations_of(&arrays::numbers(elevations, "elevations")?, height)?;
        let sensor = pyramap::SphericalSensor::new(count("width", width, "1 to 16384 pixels")?, &elevations)
            .and_then(|sensor| sensor.with_azimuths(first_azimuth, azimuth_span))
            .map_err(to_py)?;
        let Some(offsets) = row_offsets else { return Ok(Self(sensor)) };
        sensor.with_row_offsets(&arrays::numbers(offsets, "row_offsets")?).map(Self).map_err(to_py)
    }

    /// Columns of the image.
    #[getter]
    fn width(&self) -> usize {
        self.0.width()
    }

    /// Rows of the image.
    #[getter]
    fn height(&self) -> usize {
        self.0.height()
    }

    /// (H,) float64, elevation of each row, radians.
    #[getter]
    fn elevations<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.elevations())
    }

    /// Azimuth of the first column's centre, radians.
    #[getter]
    fn first_azimuth(&self) -> f64 {
        self.0.first_azimuth()
    }

    /// Angle from the first column to one past the last, radians.
    #[getter]
    fn azimuth_span(&self) -> f64 {
        self.0.azimuth_span()
    }

    /// (H,) float64, how much further each row looks than its columns' azimuths, radians; None if none does.
    #[getter]
    fn row_offsets<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        (!self.0.row_offsets().is_empty()).then(|| PyArray1::from_slice(py, self.0.row_offsets()))
    }

    fn __hash__(&self) -> u64 {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        let angles = self.0.elevations().iter().chain(self.0.row_offsets());
        (self.width(), self.first_azimuth().to_bits(), self.azimuth_span().to_bits()).hash(&mut hasher);
        angles.for_each(|angle| angle.to_bits().hash(&mut hasher));
        hasher.finish()
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(NewArguments<'py>, Bound<'py, pyo3::types::PyDict>)> {
        let options = pyo3::types::PyDict::new(py);
        options.set_item("first_azimuth", self.first_azimuth())?;
        options.set_item("azimuth_span", self.azimuth_span())?;
        options.set_item("row_offsets", self.row_offsets(py))?;
        Ok(((self.width(), self.elevations(py)), options))
    }

    fn __repr__(&self) -> String {
        let (sensor, elevations) = (&self.0, self.0.elevations());
        let shifted = if sensor.row_offsets().is_empty() { "" } else { ", with row offsets" };
        format!(
            "<SphericalSensor {} x {} (height x width), elevations {} to {}, azimuths {} + {}{shifted}>",
            sensor.height(),
            sensor.width(),
            elevations[0],
            elevations[elevations.len() - 1],
            sensor.first_azimuth(),
            sensor.azimuth_span(),
        )
    }
}

/// Width and elevations: the arguments that are given by their places.
type NewArguments<'py> = (usize, Bound<'py, PyArray1<f64>>);

/// One elevation a row.
fn elevations_of(numbers: &[f64], height: Option<i64>) -> PyResult<Vec<f64>> {
    let Some(height) = height else { return Ok(numbers.to_vec()) };
    let height = count("height", height, "1 to 16384 pixels")?;
    match *numbers {
        _ if height > pyramap::PinholeCamera::MAX_SIDE => {
            Err(PyValueError::new_err(format!("height is {height}, expected 1 to 16384 pixels")))
        }
        [first, last] => Ok(pyramap::SphericalSensor::even_elevations(height, first, last)),
        _ => Err(PyValueError::new_err(format!(
            "elevations are {} numbers with a height, expected those of the first row and the last",
            numbers.len()
        ))),
    }
}
