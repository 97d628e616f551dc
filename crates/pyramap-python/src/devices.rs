//! `devices`, and the choice of what a map runs on. (The lead puts the GPU in as soon as pyramap-wgpu has it.)

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyramap::{GridConfig, OccupancyGrid};

/// What users ask for.
#[derive(Clone, Copy, PartialEq)]
enum Wanted {
    Auto,
    Cpu,
    Gpu,
}

const BACKENDS: [(&str, Wanted); 3] = [("auto", Wanted::Auto), ("cpu", Wanted::Cpu), ("gpu", Wanted::Gpu)];

/// Where maps are to run: a checked `backend=` and `adapter=`.
pub struct Choice {
    wanted: Wanted,
    adapter: Option<String>,
}

impl Choice {
    pub fn parse(backend: &str, adapter: Option<String>) -> PyResult<Self> {
        let wanted = crate::grid::parse("backend", backend, &BACKENDS)?;
        if let (Wanted::Cpu, Some(adapter)) = (wanted, &adapter) {
            let message = format!("adapter is {adapter:?}, expected none for backend \"cpu\"");
            return Err(PyValueError::new_err(message));
        }
        Ok(Self { wanted, adapter })
    }

    /// An empty map where it was asked for. "auto" takes a real GPU if there is one that can do what the map needs.
    pub fn empty(&self, config: GridConfig) -> pyramap::Result<OccupancyGrid> {
        config.validate()?;
        OccupancyGrid::new(config)
    }
}

