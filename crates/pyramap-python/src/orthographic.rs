//! `OrthographicCamera`.

use crate::camera::{hash, side};
use crate::errors::to_py;
use pyo3::prelude::*;

/// The arguments of the constructor, in their order.
type Arguments = (usize, usize, f64, f64, f64, f64);

/// A camera whose rays are parallel, as in height maps and images of telecentric lenses.
///
/// Its axes are x right, y down, z forward; point (x, y, z) is seen at column `fx x + cx` and row `fy y + cy`. An image of it
/// holds distances along z from the plane z = 0, and `max_range` is one along z too. Integer pixel coordinates are pixel
/// centres. Wherever a `camera` is asked for with its `world_from_camera`, this one and its pose will do. Cameras compare by
/// value, and can be hashed and pickled.
///
/// A voxel is as many pixels wide at every distance: one layer of the pyramid, or two neighbouring ones, serve all voxels,
/// and since layers have no distance of their own, they keep the least range of each window.
///
/// Args:
///     width: Columns of the image, 1 to 16384.
///     height: Rows of the image, 1 to 16384.
///     fx: Pixels a metre along a row, positive.
///     fy: Pixels a metre along a column, positive.
///     cx: Column of the pixel at x = 0.
///     cy: Row of the pixel at y = 0.
///
/// Raises:
///     ValueError: If a number is out of its range, or not finite.
#[pyclass(frozen, eq, module = "pyramap", from_py_object)]
#[derive(Clone, Copy, PartialEq)]
pub struct OrthographicCamera(pub pyramap::OrthographicCamera);

#[pymethods]
impl OrthographicCamera {
    #[new]
    #[pyo3(signature = (width, height, fx, fy, cx, cy))]
    fn new(width: i64, height: i64, fx: f64, fy: f64, cx: f64, cy: f64) -> PyResult<Self> {
        let camera = pyramap::OrthographicCamera::new(side("width", width)?, side("height", height)?, fx, fy, cx, cy);
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

    /// Pixels a metre along a row.
    #[getter]
    fn fx(&self) -> f64 {
        self.0.fx
    }

    /// Pixels a metre along a column.
    #[getter]
    fn fy(&self) -> f64 {
        self.0.fy
    }

    /// Column of the pixel at x = 0.
    #[getter]
    fn cx(&self) -> f64 {
        self.0.cx
    }

    /// Row of the pixel at y = 0.
    #[getter]
    fn cy(&self) -> f64 {
        self.0.cy
    }

    fn __hash__(&self) -> u64 {
        let c = &self.0;
        hash(c.width, c.height, &[c.fx, c.fy, c.cx, c.cy])
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> (Py<PyAny>, Arguments) {
        let c = slf.get().0;
        (slf.get_type().into_any().unbind(), (c.width, c.height, c.fx, c.fy, c.cx, c.cy))
    }

    fn __repr__(&self) -> String {
        let c = &self.0;
        let (width, height) = (c.width, c.height);
        format!(
            "OrthographicCamera(width={width}, height={height}, fx={}, fy={}, cx={}, cy={})",
            c.fx, c.fy, c.cx, c.cy
        )
    }
}
