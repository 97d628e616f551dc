//! Colour: images that belong to depth images, and the questions about what the map keeps of them.

use crate::arrays::{self, Rows};
use crate::camera::PinholeCamera;
use crate::errors::to_py;
use crate::grid::OccupancyGrid;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyramap::block::Blocks;
use pyramap::{ColourImage, Pose, Sensor};

/// What Python says of a frame's colour.
#[derive(Default)]
pub struct ColourArguments<'a, 'py> {
    pub colour: Option<&'a Bound<'py, PyAny>>,
    pub colour_camera: Option<PinholeCamera>,
    pub depth_from_colour: Option<&'a Bound<'py, PyAny>>,
}

/// A colour image held for the length of a call.
pub struct ColourArray<'py> {
    pixels: PyReadonlyArrayDyn<'py, u8>,
    width: usize,
    height: usize,
    camera: pyramap::PinholeCamera,
    depth_from_colour: Pose,
}

impl<'py> ColourArguments<'_, 'py> {
    /// Whether all is there, and of the right type; nothing if the frame has no colour.
    pub fn check(self, sensor: &Sensor) -> PyResult<Option<ColourArray<'py>>> {
        let Some(colour) = self.colour else {
            return match (self.colour_camera, self.depth_from_colour) {
                (None, None) => Ok(None),
                (Some(_), _) => Err(PyValueError::new_err("colour_camera is given without colour, expected both")),
                (None, Some(_)) => {
                    Err(PyValueError::new_err("depth_from_colour is given without colour, expected both"))
                }
            };
        };
        let camera = match (self.colour_camera, sensor) {
            (Some(camera), _) => camera.0,
            (None, Sensor::Pinhole(camera)) => *camera,
            (None, _) => {
                let message = "colour_camera is missing, expected a PinholeCamera, since camera is none";
                return Err(PyValueError::new_err(message));
            }
        };
        let depth_from_colour = self.depth_from_colour.map_or(Ok(Pose::identity()), |pose| {
            let named = |error: PyErr| format!("depth_from_colour as a {}", error.value(pose.py()));
            arrays::pose(pose).map_err(|error| PyValueError::new_err(named(error)))
        })?;
        let expected = "expected a (H, W, 3) numpy array of uint8: red, green, blue";
        let array = colour
            .cast::<PyUntypedArray>()
            .map_err(|_| PyValueError::new_err(format!("colour is a {}, {expected}", arrays::type_name(colour))))?;
        let &[height, width, 3] = array.shape() else {
            return Err(PyValueError::new_err(format!("colour has shape {:?}, {expected}", array.shape())));
        };
        let pixels = arrays::typed::<u8>(array)?
            .ok_or_else(|| PyValueError::new_err(format!("colour has dtype {}, {expected}", array.dtype())))?;
        Ok(Some(ColourArray { pixels, width, height, camera, depth_from_colour }))
    }
}

impl ColourArray<'_> {
    /// The image, to be used while the array is held.
    pub fn image(&self) -> PyResult<ColourImage<'_>> {
        let pixels = self.pixels.as_slice()?.as_chunks().0;
        ColourImage::new(pixels, self.width, self.height, &self.camera, &self.depth_from_colour).map_err(to_py)
    }
}

#[pymethods]
impl OccupancyGrid {
    /// Mean colours of the voxels at points.
    ///
    /// The voxels around a surface have its colour, those just in front of it and just behind too, whether they are
    /// occupied or not; anywhere else there is none.
    ///
    /// Args:
    ///     points: (N, 3) world coordinates, metres. A point belongs to the voxel that contains it.
    ///
    /// Returns:
    ///     (N, 4) uint8: red, green, blue, and 255; four zeros where no colour was seen.
    ///
    /// Raises:
    ///     ValueError: If the map was made without `colour`, the shape is another, or a coordinate is not finite.
    fn colour<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<u8>>> {
        let (py, points) = (points.py(), Rows::new(points, "points")?);
        let at = points.get()?;
        let colours = self.ask(py, |grid| grid.colour(at))?;
        let count = colours.len();
        PyArray1::from_vec(py, colours.into_flattened()).reshape([count, 4])
    }

    /// Whether the map keeps colours.
    #[getter]
    fn has_colour(&self, py: Python<'_>) -> bool {
        self.parameter(py, |grid| grid.colours().is_some())
    }
}
