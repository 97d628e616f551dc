//! `SensorModel`.

use crate::errors::to_py;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyramap::SurfaceOffset;

/// The inverse sensor model (Eq. 7): what one range reading says about the places along its ray.
///
/// With `a = k / (sigma sqrt(2 pi))` and `g = exp(-((z - z_j) / sigma)^2 / 2)`, the probability that distance `z` is
/// occupied after a reading `z_j` is `0.3 + (a + 0.2) g` up to the reading and `0.5 + a g` beyond it. Its log-odd is zero
/// already `sigma sqrt(2 ln((a + 0.2) / 0.2))` in front of the reading, 1.48 sigma for `k = sigma`; with
/// `surface_offset="centred"` it is zero at the reading. Models compare by value, and can be pickled.
///
/// Args:
///     sigma: Metres. A triple `(s0, s1, s2)` lets it grow with the range: `s0 + s1 z_j + s2 z_j^2`.
///     k: Importance of a reading at range zero, metres; `k / sigma` is the same at every range, and between 0 and
///         `sqrt(2 pi) / 2 = 1.2533`, so that probabilities stay between 0 and 1. Default: `sigma` at range zero.
///     surface_offset: How far behind the reading the model places the surface, metres; 0 is the paper's model.
///         "centred" moves it back by the distance above, so that a mesh at level 0 lies on the measured surface.
///
/// Raises:
///     ValueError: If `sigma` is not positive at every range, `k` leaves its range, or the offset is not finite.
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
    #[pyo3(signature = (sigma, k = None, surface_offset = Offset::Metres(0.0)),
           text_signature = "(sigma, k=None, surface_offset=0.0)")]
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

    /// Sigma, metres: a float, or the triple of its growth with range.
    #[getter]
    fn sigma(&self) -> Sigma {
        match (self.0.sigma(), self.0.is_constant()) {
            ([sigma, ..], true) => Sigma::Constant(sigma),
            ([s0, s1, s2], false) => Sigma::Growing(s0, s1, s2),
        }
    }

    /// Importance of a reading at range zero, metres.
    #[getter]
    fn k(&self) -> f64 {
        self.0.k()
    }

    /// How far behind a reading the surface is placed, metres, or "centred".
    #[getter]
    fn surface_offset(&self) -> Offset {
        match self.0.surface_offset() {
            SurfaceOffset::Metres(metres) => Offset::Metres(metres),
            SurfaceOffset::Centred => Offset::Named("centred".into()),
        }
    }

    /// The log-odd that a reading gives to a place on its ray (Eq. 7 and 4).
    ///
    /// Args:
    ///     distance: Of the place from the camera, metres.
    ///     reading: The measured range, metres; `inf`, no return, says free.
    ///
    /// Returns:
    ///     Natural log-odds: positive is occupied, negative free, near 0 well behind the reading.
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
