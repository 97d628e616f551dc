//! The first stages on their own: `ranges` and `pyramid`.

use crate::arrays::DepthArray;
use crate::camera::PinholeCamera;
use crate::errors::to_py;
use crate::threads::run;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyramap::pyramid::{Pyramid, Selection, num_layers};
use pyramap::ranges::Ranges;
use pyramap::{BeyondMaxRange, Error};

type Image<'py> = Bound<'py, PyArray2<f32>>;

#[pyfunction]
#[pyo3(signature = (depth, camera, depth_scale = None))]
pub fn ranges<'py>(
    py: Python<'py>,
    depth: &Bound<'py, PyAny>,
    camera: PinholeCamera,
    depth_scale: Option<f64>,
) -> PyResult<Image<'py>> {
    let ranges = compute_ranges(py, depth, camera, depth_scale)?;
    PyArray1::from_vec(py, ranges.values).reshape([ranges.height, ranges.width])
}

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
    let ranges = compute_ranges(py, depth, camera, depth_scale)?;
    let t_0 = camera.0.focal_length() * voxel_size;
    let layers = run(py, || {
        let mut pyramid = Pyramid::default();
        pyramid.compute(&ranges, t_0, Selection::Nearest, 0..num_layers(ranges.width, ranges.height));
        Ok(pyramid.layers)
    })?;
    let image = |layer: pyramap::pyramid::Layer| {
        PyArray1::from_vec(py, layer.values).reshape([layer.height, layer.width])
    };
    layers.into_iter().map(image).collect()
}

/// Every reading is kept: there is no range to limit here.
fn compute_ranges(
    py: Python<'_>,
    depth: &Bound<'_, PyAny>,
    camera: PinholeCamera,
    depth_scale: Option<f64>,
) -> PyResult<Ranges> {
    let depth = DepthArray::new(depth, depth_scale)?;
    let image = depth.image()?;
    run(py, || {
        let mut ranges = Ranges::default();
        ranges.compute(&image, &camera.0, f64::INFINITY, BeyondMaxRange::Free)?;
        Ok(ranges)
    })
}
