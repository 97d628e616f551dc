//! `FrameStats`.

use crate::errors::to_py;
use crate::grid::SharedGrid;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pyramap::stats::Submitted;
use std::sync::{Arc, PoisonError};

/// What a frame did to the map, returned by `OccupancyGrid.integrate` and `OccupancyGrid.remove`.
///
/// On a GPU `integrate` returns before the frame is fused; asking for a number here waits until it is, and raises what
/// went wrong if it cannot be.
#[pyclass(frozen, module = "pyramap")]
pub struct FrameStats(Source);

enum Source {
    Known(pyramap::FrameStats),
    UnderWay(Submitted, SharedGrid),
}

impl FrameStats {
    pub fn known(stats: pyramap::FrameStats) -> Self {
        Self(Source::Known(stats))
    }

    /// Of a frame that the map may still be at work on.
    pub fn of_submitted(submitted: Submitted, grid: &SharedGrid) -> Self {
        Self(match submitted.stats() {
            Some(stats) => Source::Known(stats),
            None => Source::UnderWay(submitted, Arc::clone(grid)),
        })
    }

    fn get(&self, py: Python<'_>) -> PyResult<pyramap::FrameStats> {
        let (submitted, grid) = match &self.0 {
            Source::Known(stats) => return Ok(*stats),
            Source::UnderWay(submitted, grid) => (submitted, grid),
        };
        if submitted.stats().is_none() {
            py.detach(|| grid.write().unwrap_or_else(PoisonError::into_inner).synchronize()).map_err(to_py)?;
        }
        let failed = || PyRuntimeError::new_err("the frame was not fused; the error was raised when that was noticed");
        submitted.stats().ok_or_else(failed)
    }
}

#[pymethods]
impl FrameStats {
    /// Blocks found free throughout without asking a voxel.
    #[getter]
    fn blocks_free(&self, py: Python<'_>) -> PyResult<usize> {
        Ok(self.get(py)?.blocks_free)
    }

    /// Blocks whose voxels were asked.
    #[getter]
    fn blocks_mixed(&self, py: Python<'_>) -> PyResult<usize> {
        Ok(self.get(py)?.blocks_mixed)
    }

    /// Voxels whose evidence changed.
    #[getter]
    fn voxels_updated(&self, py: Python<'_>) -> PyResult<usize> {
        Ok(self.get(py)?.voxels_updated)
    }

    /// Voxels whose evidence was too large to be stored whole.
    #[getter]
    fn saturated(&self, py: Python<'_>) -> PyResult<u64> {
        Ok(self.get(py)?.saturated)
    }

    /// Seconds by stage, in order: upload, ranges, pyramid, cull, update, readback, colour, commit. On the CPU nothing is
    /// uploaded or read back; a GPU that cannot time its kernels books them all to `update`. Frames that follow each other
    /// on a GPU overlap, and a stage may then hold some of another's time: `synchronize` between them to tell them apart.
    #[getter]
    fn seconds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let seconds = PyDict::new(py);
        self.get(py)?.seconds.named().into_iter().try_for_each(|(stage, value)| seconds.set_item(stage, value))?;
        Ok(seconds)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let stats = self.get(py)?;
        let (free, mixed, voxels) = (stats.blocks_free, stats.blocks_mixed, stats.voxels_updated);
        Ok(format!("FrameStats(blocks_free={free}, blocks_mixed={mixed}, voxels_updated={voxels})"))
    }
}
