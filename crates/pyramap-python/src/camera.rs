//! `PinholeCamera`.

use crate::errors::to_py;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The arguments of the constructor, in their order.
pub type Intrinsics = (usize, usize, f64, f64, f64, f64);

/// A side of an image.
pub fn side(name: &str, side: i64) -> PyResult<usize> {
    usize::try_from(side).map_err(|_| PyValueError::new_err(format!("camera {name} is {side}, expected at least 1")))
}

/// The hash of a camera's numbers.
pub fn hash(width: usize, height: usize, numbers: &[f64]) -> u64 {
    use std::hash::{DefaultHasher, Hash, Hasher};
    let mut hasher = DefaultHasher::new();
    (width, height).hash(&mut hasher);
    numbers.iter().for_each(|number| number.to_bits().hash(&mut hasher));
    hasher.finish()
}

/// A pinhole camera without distortion.
///
/// Its axes are x right, y down, z forward. Integer pixel coordinates are pixel centres: the image spans columns -0.5 to
/// `width - 0.5`. Cameras compare by value, and can be hashed and pickled.
///
/// Args:
///     width: Columns of the image, 1 to 16384.
///     height: Rows of the image, 1 to 16384.
///     fx: Focal length along a row, pixels, positive.
///     fy: Focal length along a column, pixels, positive.
///     cx: Column of the principal point, pixels.
///     cy: Row of the principal point, pixels.
///
/// Raises:
///     ValueError: If a number is out of its range, or not finite.
#[pyclass(frozen, eq, module = "pyramap", from_py_object)]
#[derive(Clone, Copy, PartialEq)]
pub struct PinholeCamera(pub pyramap::PinholeCamera);

#[pymethods]
impl PinholeCamera {
    #[new]
    #[pyo3(signature = (width, height, fx, fy, cx, cy))]
    fn new(width: i64, height: i64, fx: f64, fy: f64, cx: f64, cy: f64) -> PyResult<Self> {
        let camera = pyramap::PinholeCamera::new(side("width", width)?, side("height", height)?, fx, fy, cx, cy);
        camera.map(Self).map_err(to_py)
    }

    /// Columns of the image.
    #[getter]
    fn width(&self) -> usize {
        self.0.width
    }

    /// Rows of the image.
    #[getter]
    fn height(&self) -> usize {
        self.0.height
    }

    /// Focal length along a row, pixels.
    #[getter]
    fn fx(&self) -> f64 {
        self.0.fx
    }

    /// Focal length along a column, pixels.
    #[getter]
    fn fy(&self) -> f64 {
        self.0.fy
    }

    /// Column of the principal point, pixels.
    #[getter]
    fn cx(&self) -> f64 {
        self.0.cx
    }

    /// Row of the principal point, pixels.
    #[getter]
    fn cy(&self) -> f64 {
        self.0.cy
    }

    fn __hash__(&self) -> u64 {
        let c = &self.0;
        hash(c.width, c.height, &[c.fx, c.fy, c.cx, c.cy])
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> (Py<PyAny>, Intrinsics) {
        let c = slf.get().0;
        (slf.get_type().into_any().unbind(), (c.width, c.height, c.fx, c.fy, c.cx, c.cy))
    }

    fn __repr__(&self) -> String {
        let c = &self.0;
        let (width, height) = (c.width, c.height);
        format!("PinholeCamera(width={width}, height={height}, fx={}, fy={}, cx={}, cy={})", c.fx, c.fy, c.cx, c.cy)
    }
}
