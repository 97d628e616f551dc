//! `devices`, and the choice of what a map runs on.

use crate::errors::to_py;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyramap::{GridConfig, OccupancyGrid};
use pyramap_wgpu::{Adapter, GpuBackend, adapters};

/// A graphics adapter of this machine, as `devices` lists it.
#[pyclass(frozen, module = "pyramap")]
pub struct Device(Adapter);

#[pymethods]
impl Device {
    /// The adapter's name; any part of it may be given as `adapter=`.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// What stands behind it: "discrete", "integrated", "virtual", "other", or "software" (the processor plays a GPU).
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.kind.name()
    }

    /// The system's interface to it: "vulkan", "metal" or "dx12".
    #[getter]
    fn api(&self) -> &'static str {
        self.0.api
    }

    /// The driver and its version.
    #[getter]
    fn driver(&self) -> &str {
        &self.0.driver
    }

    /// Bytes of the largest buffer.
    #[getter]
    fn max_buffer_bytes(&self) -> u64 {
        self.0.max_buffer_bytes
    }

    /// Bytes of the largest part of a buffer that a shader sees.
    #[getter]
    fn max_binding_bytes(&self) -> u64 {
        self.0.max_binding_bytes
    }

    /// Why maps cannot run on it; None if they can.
    #[getter]
    fn problem(&self) -> Option<&str> {
        self.0.problem.as_deref()
    }

    fn __repr__(&self) -> String {
        format!("Device(name={:?}, kind={:?}, api={:?})", self.0.name, self.0.kind.name(), self.0.api)
    }
}

/// The graphics adapters of this machine, in the system's order; none where no driver is installed.
///
/// Raises:
///     DeviceForkedError: In a process forked from one that had asked before: drivers do not survive that.
#[pyfunction]
pub fn devices(py: Python<'_>) -> PyResult<Vec<Device>> {
    leave_window_system_alone(py)?;
    let adapters = py.detach(adapters).map_err(to_py)?;
    Ok(adapters.into_iter().map(Device).collect())
}

/// A layer of Mesa's asks the window system which device it would rather have, and complains on stderr where there is
/// none, as on robots and in containers. It is switched off there, by its own switch.
fn leave_window_system_alone(py: Python<'_>) -> PyResult<()> {
    let environ = py.import("os")?.getattr("environ")?;
    if cfg!(target_os = "linux") && !environ.contains("XDG_RUNTIME_DIR")? {
        environ.call_method1("setdefault", ("NODEVICE_SELECT", "1"))?;
    }
    Ok(())
}

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
    pub fn parse(py: Python<'_>, backend: &str, adapter: Option<String>) -> PyResult<Self> {
        let wanted = crate::grid::parse("backend", backend, &BACKENDS)?;
        if let (Wanted::Cpu, Some(adapter)) = (wanted, &adapter) {
            let message = format!("adapter is {adapter:?}, expected none for backend \"cpu\"");
            return Err(PyValueError::new_err(message));
        }
        if wanted != Wanted::Cpu {
            leave_window_system_alone(py)?;
        }
        Ok(Self { wanted, adapter })
    }

    /// An empty map where it was asked for. "auto" takes a real GPU if there is one that can do what the map needs.
    pub fn empty(&self, config: GridConfig) -> pyramap::Result<OccupancyGrid> {
        config.validate()?;
        let gpu = |config: &GridConfig| GpuBackend::new(config, self.adapter.as_deref());
        match self.wanted {
            Wanted::Cpu => OccupancyGrid::new(config),
            Wanted::Gpu => OccupancyGrid::with_backend(config.clone(), Box::new(gpu(&config)?)),
            Wanted::Auto => match gpu(&config) {
                Ok(backend) => OccupancyGrid::with_backend(config, Box::new(backend)),
                // An adapter that is named is meant, even to "auto".
                Err(error) if self.adapter.is_some() => Err(error),
                Err(_) => OccupancyGrid::new(config),
            },
        }
    }
}
