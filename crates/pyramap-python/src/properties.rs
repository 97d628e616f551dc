//! What a map says of itself: what it holds, and what it was made with.

use crate::grid::{BEYOND, OccupancyGrid, UPDATES, word};
use crate::sensor::SensorModel;
use numpy::PyArray2;
use pyo3::prelude::*;

#[pymethods]
impl OccupancyGrid {
    /// Lowest and highest corner of the box around all blocks, (2, 3) float64, metres; None for an empty map.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let bounds = self.property(py, |grid| grid.bounds())?;
        Ok(bounds.map(|corners| PyArray2::from_vec2(py, &corners.map(Vec::from)).expect("two rows of three")))
    }

    /// Number of blocks of 8 x 8 x 8 voxels that hold something.
    #[getter]
    fn num_blocks(&self, py: Python<'_>) -> PyResult<usize> {
        self.property(py, |grid| grid.num_blocks())
    }

    /// Number of voxels that are not unknown.
    #[getter]
    fn num_observed(&self, py: Python<'_>) -> PyResult<usize> {
        self.ask(py, |grid| grid.num_observed())
    }

    /// Number of frames fused less those removed, with those of merged maps.
    #[getter]
    fn num_frames(&self, py: Python<'_>) -> PyResult<i64> {
        self.property(py, |grid| grid.num_frames())
    }

    /// How many additions to voxels were too large to be stored whole, beyond log-odds of 524288.
    #[getter]
    fn saturated(&self, py: Python<'_>) -> PyResult<u64> {
        self.property(py, |grid| grid.saturated())
    }

    /// Bytes that the map takes: its blocks, their directory, and colours. A block of one value throughout costs only its entry.
    #[getter]
    fn nbytes(&self, py: Python<'_>) -> PyResult<usize> {
        self.property(py, |grid| grid.nbytes())
    }

    /// What the map runs on: "cpu" or "gpu".
    #[getter]
    fn backend(&self, py: Python<'_>) -> String {
        self.parameter(py, |grid| grid.backend().to_owned())
    }

    /// The name of the GPU that the map runs on; None on the CPU.
    #[getter]
    fn adapter(&self, py: Python<'_>) -> Option<String> {
        self.parameter(py, |grid| grid.adapter().map(str::to_owned))
    }

    /// Edge of a voxel, metres.
    #[getter]
    fn voxel_size(&self, py: Python<'_>) -> f64 {
        self.parameter(py, |grid| grid.config().voxel_size)
    }

    /// What a reading says.
    #[getter]
    fn sensor_model(&self, py: Python<'_>) -> SensorModel {
        SensorModel(self.parameter(py, |grid| grid.config().sensor_model))
    }

    /// Distance from the camera up to which voxels are updated, metres.
    #[getter]
    fn max_range(&self, py: Python<'_>) -> f64 {
        self.parameter(py, |grid| grid.config().max_range)
    }

    /// The update rule: "pyramid", "area", "min_layer", "ideal" or "rays".
    #[getter]
    fn update(&self, py: Python<'_>) -> &'static str {
        self.parameter(py, |grid| word(grid.config().update, &UPDATES))
    }

    /// Bounds of the log-odds, or None.
    #[getter]
    fn clamp(&self, py: Python<'_>) -> Option<(f64, f64)> {
        self.parameter(py, |grid| grid.config().clamp)
    }

    /// The most that `nbytes` may come to, or None.
    #[getter]
    fn max_bytes(&self, py: Python<'_>) -> Option<usize> {
        self.parameter(py, |grid| grid.config().max_bytes)
    }

    /// Probability of being occupied before anything is seen.
    #[getter]
    fn prior(&self, py: Python<'_>) -> f64 {
        self.parameter(py, |grid| grid.config().prior)
    }

    /// What a reading farther than `max_range` says: "free" or "ignore".
    #[getter]
    fn beyond_max_range(&self, py: Python<'_>) -> &'static str {
        self.parameter(py, |grid| word(grid.config().beyond_max_range, &BEYOND))
    }
}
