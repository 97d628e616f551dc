//! `SensorModel`.

use crate::errors::to_py;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyramap::SurfaceOffset;

/// The inverse sensor model of Eq. 7.
#[pyclass(frozen, eq, module = "pyramap", from_py_object)]
#[derive(Clone, Copy, PartialEq)]
pub struct SensorModel(pub pyramap::SensorModel);

/// One sigma, or the three coefficients of its growth with range.
#[derive(FromPyObject, IntoPyObject)]
enum Sigma {
    Constant(f64),
    Growing(f64, f64, f64),
}

/// Metres, or the word "centred".
#[derive(FromPyObject, IntoPyObject)]
enum Offset {
    Metres(f64),
    Named(String),
}

#[pymethods]
impl SensorModel {
    #[new]
    #[pyo3(signature = (sigma, k = None, surface_offset = Offset::Metres(0.0)))]
    fn new(sigma: Sigma, k: Option<f64>, surface_offset: Offset) -> PyResult<Self> {
        let sigma = match sigma {
            Sigma::Constant(sigma) => [sigma, 0.0, 0.0],
            Sigma::Growing(s0, s1, s2) => [s0, s1, s2],
        };
        let surface_offset = match surface_offset {
            Offset::Metres(metres) => SurfaceOffset::Metres(metres),
            Offset::Named(name) if name == "centred" => SurfaceOffset::Centred,
            Offset::Named(name) => {
                return Err(PyValueError::new_err(format!(
                    "surface_offset is {name:?}, expected metres or \"centred\""
                )));
            }
        };
        pyramap::SensorModel::new(sigma, k, surface_offset).map(Self).map_err(to_py)
    }

    #[getter]
    fn sigma(&self) -> Sigma {
        match (self.0.sigma(), self.0.is_constant()) {
            ([sigma, ..], true) => Sigma::Constant(sigma),
            ([s0, s1, s2], false) => Sigma::Growing(s0, s1, s2),
        }
    }

    #[getter]
    fn k(&self) -> f64 {
        self.0.k()
    }

    #[getter]
    fn surface_offset(&self) -> Offset {
        match self.0.surface_offset() {
            SurfaceOffset::Metres(metres) => Offset::Metres(metres),
            SurfaceOffset::Centred => Offset::Named("centred".into()),
        }
    }

    fn log_odds(&self, distance: f64, reading: f64) -> f64 {
        self.0.log_odds(distance, reading)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyAny>, (Sigma, f64, Offset)) {
        let model = slf.get();
        (slf.get_type().into_any(), (model.sigma(), model.k(), model.surface_offset()))
    }

    fn __repr__(&self) -> String {
        let sigma = match self.sigma() {
            Sigma::Constant(sigma) => format!("{sigma}"),
            Sigma::Growing(s0, s1, s2) => format!("({s0}, {s1}, {s2})"),
        };
        let offset = match self.surface_offset() {
            Offset::Metres(metres) => format!("{metres}"),
            Offset::Named(name) => format!("{name:?}"),
        };
        format!("SensorModel(sigma={sigma}, k={}, surface_offset={offset})", self.k())
    }
}
