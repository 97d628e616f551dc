//! The first stages on their own: `ranges` and `pyramid`.

use crate::arrays::ImageArray;
use crate::camera::PinholeCamera;
use crate::errors::to_py;
use crate::sensors::AnySensor;
use crate::threads::run;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyramap::pyramid::{Pyramid, Selection, num_layers};
use pyramap::ranges::Ranges;
use pyramap::{BeyondMaxRange, Error, Sensor};

type Image<'py> = Bound<'py, PyArray2<f32>>;

/// Distances from the camera centre out of z-depths (Eq. 6), as the mapper sees them.
///
/// Args:
///     depth: (H, W) float32 or float64 metres, or uint16 with `depth_scale`. What each reading means:
///         see `OccupancyGrid.integrate`.
///     camera: Any sensor, of the same size.
///     depth_scale: For uint16: steps a metre, 1000.0 for millimetres.
///
/// Returns:
///     (H, W) float32 metres; 0 where there is no reading, `inf` where there was no return.
///
/// Raises:
///     ValueError: If `depth` has another shape or type, differs in size from `camera`, or holds no reading at all.
#[pyfunction]
#[pyo3(signature = (depth, camera, depth_scale = None))]
pub fn ranges<'py>(
    py: Python<'py>,
    depth: &Bound<'py, PyAny>,
    camera: AnySensor,
    depth_scale: Option<f64>,
) -> PyResult<Image<'py>> {
    let ranges = compute_ranges(py, depth, &camera.0, depth_scale)?;
    PyArray1::from_vec(py, ranges.values).reshape([ranges.height, ranges.width])
}

/// The layers of the range pyramid (Eq. 10 and 11), as the rule "pyramid" reads them.
///
/// Layer `i` belongs to the distance `t_i = sqrt(fx fy) voxel_size / 2^i`. Its texel (row b, column a) holds, of the
/// ranges in rows `2^i b` to `2^i (b + 1) - 1` and columns `2^i a` to `2^i (a + 1) - 1`, the one nearest to `t_i`, and of
/// two equally near the smaller. Windows are cut off at the right and lower border.
///
/// Args:
///     depth: As for `ranges`.
///     camera: Of the same size.
///     voxel_size: Edge of a voxel, metres, positive.
///     depth_scale: As for `ranges`.
///
/// Returns:
///     One (ceil(H / 2^i), ceil(W / 2^i)) float32 array for each i with `2^i <= min(H, W)`, metres; 0 where no pixel of
///     the window has a reading, `inf` where all that have one had no return.
///
/// Raises:
///     ValueError: As for `ranges`, or if `voxel_size` is not positive and finite.
#[pyfunction]
#[pyo3(signature = (depth, camera, voxel_size, depth_scale = None))]
pub fn pyramid<'py>(
    py: Python<'py>,
    depth: &Bound<'py, PyAny>,
    camera: PinholeCamera,
    voxel_size: f64,
    depth_scale: Option<f64>,
) -> PyResult<Vec<Image<'py>>> {
    if !(voxel_size > 0.0 && voxel_size.is_finite()) {
        let (got, expected) = (format!("{voxel_size}"), "a positive number of metres".into());
        return Err(to_py(Error::Parameter { name: "voxel_size", got, expected }));
    }
    let ranges = compute_ranges(py, depth, &(&camera.0).into(), depth_scale)?;
    let t_0 = camera.0.focal_length() * voxel_size;
    let layers = run(py, || {
        let mut pyramid = Pyramid::default();
        pyramid.compute(&ranges, t_0, Selection::Nearest, 0..num_layers(ranges.width, ranges.height));
        Ok(pyramid.layers)
    })?;
    let image =
        |layer: pyramap::pyramid::Layer| PyArray1::from_vec(py, layer.values).reshape([layer.height, layer.width]);
    layers.into_iter().map(image).collect()
}

/// Every reading is kept: there is no range to limit here.
fn compute_ranges(
    py: Python<'_>,
    depth: &Bound<'_, PyAny>,
    sensor: &Sensor,
    depth_scale: Option<f64>,
) -> PyResult<Ranges> {
    let depth = ImageArray::depth(depth, depth_scale)?;
    let image = depth.image()?;
    run(py, || {
        let mut ranges = Ranges::default();
        ranges.compute(&image, sensor, f64::INFINITY, BeyondMaxRange::Free)?;
        Ok(ranges)
    })
}
