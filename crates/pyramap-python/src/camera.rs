//! `PinholeCamera`.

use crate::arrays;
use crate::errors::to_py;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyramap::Distortion;

/// Distortion coefficients, in OpenCV's order.
type Coefficients = (f64, f64, f64, f64, f64);

/// The arguments of the constructor, in their order.
type Arguments = (usize, usize, f64, f64, f64, f64, Option<Coefficients>);

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

/// A pinhole camera, with a lens that may distort.
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
///     distortion: Radial-tangential coefficients as OpenCV has them: (k1, k2, p1, p2) or (k1, k2, p1, p2, k3). Where the
///         image folds back on itself the lens brings nothing to a pixel: it has no reading, and is not fused. `view_gain`
///         and `noise` of scenes take no notice of the lens.
///
/// Raises:
///     ValueError: If a number is out of its range, or not finite; or the lens has no image around its axis.
#[pyclass(frozen, eq, module = "pyramap", from_py_object)]
#[derive(Clone, Copy, PartialEq)]
pub struct PinholeCamera(pub pyramap::PinholeCamera);

#[pymethods]
impl PinholeCamera {
    #[new]
    #[pyo3(signature = (width, height, fx, fy, cx, cy, distortion = None))]
    fn new(
        width: i64,
        height: i64,
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        distortion: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let camera = pyramap::PinholeCamera::new(side("width", width)?, side("height", height)?, fx, fy, cx, cy);
        let camera = camera.map_err(to_py)?;
        let Some(distortion) = distortion else { return Ok(Self(camera)) };
        let coefficients = match arrays::numbers(distortion, "distortion")?[..] {
            [k1, k2, p1, p2] => [k1, k2, p1, p2, 0.0],
            [k1, k2, p1, p2, k3] => [k1, k2, p1, p2, k3],
            ref others => {
                let message = format!("distortion is {} numbers, expected k1, k2, p1, p2 and perhaps k3", others.len());
                return Err(PyValueError::new_err(message));
            }
        };
        camera.with_distortion(Distortion::from_coefficients(coefficients)).map(Self).map_err(to_py)
    }

    /// Radial-tangential coefficients k1, k2, p1, p2, k3; None if there is no distortion.
    #[getter]
    fn distortion(&self) -> Option<Coefficients> {
        self.0.lens().map(|lens| lens.distortion().coefficients().into())
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
        let coefficients = c.lens().map(|lens| lens.distortion().coefficients());
        let numbers: Vec<f64> =
            [c.fx, c.fy, c.cx, c.cy].into_iter().chain(coefficients.into_iter().flatten()).collect();
        hash(c.width, c.height, &numbers)
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> (Py<PyAny>, Arguments) {
        let c = slf.get().0;
        let arguments = (c.width, c.height, c.fx, c.fy, c.cx, c.cy, slf.get().distortion());
        (slf.get_type().into_any().unbind(), arguments)
    }

    fn __repr__(&self) -> String {
        let c = &self.0;
        let (width, height) = (c.width, c.height);
        let lens = self.distortion().map_or(String::new(), |coefficients| format!(", distortion={coefficients:?}"));
        format!(
            "PinholeCamera(width={width}, height={height}, fx={}, fy={}, cx={}, cy={}{lens})",
            c.fx, c.fy, c.cx, c.cy
        )
    }
}
