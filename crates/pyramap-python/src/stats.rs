//! `FrameStats`.

use pyo3::prelude::*;
use pyo3::types::PyDict;

/// What a frame did to the map, returned by `OccupancyGrid.integrate` and `OccupancyGrid.remove`.
#[pyclass(frozen, module = "pyramap")]
pub struct FrameStats(pub pyramap::FrameStats);

#[pymethods]
impl FrameStats {
    /// Blocks found free throughout without asking a voxel.
    #[getter]
    fn blocks_free(&self) -> usize {
        self.0.blocks_free
    }

    /// Blocks whose voxels were asked.
    #[getter]
    fn blocks_mixed(&self) -> usize {
        self.0.blocks_mixed
    }

    /// Voxels whose evidence changed.
    #[getter]
    fn voxels_updated(&self) -> usize {
        self.0.voxels_updated
    }

    /// Voxels whose evidence was too large to be stored whole.
    #[getter]
    fn saturated(&self) -> u64 {
        self.0.saturated
    }

    /// Seconds by stage, in order: ranges, pyramid, cull, update, commit.
    #[getter]
    fn seconds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let seconds = PyDict::new(py);
        self.0.seconds.named().into_iter().try_for_each(|(stage, value)| seconds.set_item(stage, value))?;
        Ok(seconds)
    }

    fn __repr__(&self) -> String {
        let stats = &self.0;
        let (free, mixed, voxels) = (stats.blocks_free, stats.blocks_mixed, stats.voxels_updated);
        format!("FrameStats(blocks_free={free}, blocks_mixed={mixed}, voxels_updated={voxels})")
    }
}
