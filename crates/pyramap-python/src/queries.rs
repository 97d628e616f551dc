//! Questions to a map: at points, along rays, about shapes, and for voxels by their state.

use crate::arrays::{self, Rows};
use crate::grid::{OccupancyGrid, parse};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyramap::block::VoxelIndex;
use pyramap::{Interpolation, State, Unknown};

/// The words for unknown space, where it is in the way of rays and where it is not, and of shapes.
const TO_RAYS: [(&str, Unknown); 2] = [("stop", Unknown::Occupied), ("pass", Unknown::Free)];
pub const TO_SHAPES: [(&str, Unknown); 2] = [("occupied", Unknown::Occupied), ("free", Unknown::Free)];
pub const INTERPOLATIONS: [(&str, Interpolation); 2] =
    [("nearest", Interpolation::Nearest), ("trilinear", Interpolation::Trilinear)];

#[pymethods]
impl OccupancyGrid {
    /// Log-odds at points.
    ///
    /// Trilinear: a point in an unknown voxel is unknown. Elsewhere the log-odds of the eight voxels whose centres
    /// surround the point are interpolated; unknown ones among them are left out, and the weights of the others scaled to
    /// a sum of one, so that nothing is drawn towards 0 where knowledge ends.
    ///
    /// Args:
    ///     points: (N, 3) world coordinates, metres. A point belongs to the voxel that contains it.
    ///     interpolation: "nearest": that of this voxel. "trilinear": between the centres of voxels.
    ///
    /// Returns:
    ///     (N,) float32 natural log-odds, evidence plus prior; 0 where unknown.
    ///
    /// Raises:
    ///     ValueError: If the shape is another, a coordinate is not finite, or there is no such interpolation.
    #[pyo3(signature = (points, interpolation = "nearest"))]
    fn log_odds<'py>(&self, points: &Bound<'py, PyAny>, interpolation: &str) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let (py, interpolation) = (points.py(), parse("interpolation", interpolation, &INTERPOLATIONS)?);
        let points = Rows::new(points, "points")?;
        let at = points.get()?;
        Ok(PyArray1::from_vec(py, self.ask(py, |grid| grid.log_odds(at, interpolation))?))
    }

    /// Probabilities of being occupied at points (Eq. 5).
    ///
    /// Args:
    ///     points: (N, 3) world coordinates, metres.
    ///     interpolation: As for `log_odds`, which are what is interpolated.
    ///
    /// Returns:
    ///     (N,) float32; the prior where unknown.
    ///
    /// Raises:
    ///     ValueError: As for `log_odds`.
    #[pyo3(signature = (points, interpolation = "nearest"))]
    fn probability<'py>(&self, points: &Bound<'py, PyAny>, interpolation: &str) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let (py, interpolation) = (points.py(), parse("interpolation", interpolation, &INTERPOLATIONS)?);
        let points = Rows::new(points, "points")?;
        let at = points.get()?;
        Ok(PyArray1::from_vec(py, self.ask(py, |grid| grid.probability(at, interpolation))?))
    }

    /// What the map knows at points.
    ///
    /// Args:
    ///     points: (N, 3) world coordinates, metres.
    ///
    /// Returns:
    ///     (N,) int8: -1 unknown, 0 free (seen, and log-odds of at most 0), 1 occupied.
    ///
    /// Raises:
    ///     ValueError: As for `log_odds`.
    fn state<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<i8>>> {
        let (py, points) = (points.py(), Rows::new(points, "points")?);
        let at = points.get()?;
        Ok(states(py, self.ask(py, |grid| grid.state(at))?))
    }

    /// Casts rays until an occupied voxel stops them, or an unknown one where unknown is to stop them.
    ///
    /// A ray starts in the voxel that contains its origin, and enters every voxel of which it cuts a piece, however
    /// short; voxels that it only touches at an edge or a corner do not stop it. All beyond the map's blocks is unknown.
    ///
    /// Once so many rays were cast that it pays, how much room there is around each voxel is kept until the map changes:
    /// a byte a voxel, of all blocks and, with "pass", of their neighbours, for either word. `nbytes` does not count these.
    ///
    /// Args:
    ///     origins: (N, 3) world coordinates, metres; or (3,), the same for all rays.
    ///     directions: (N, 3) vectors of any length but zero.
    ///     max_range: Metres, positive, may be infinite; a voxel that is entered farther away does not count.
    ///     unknown: "stop": unknown voxels stop rays. "pass": they let rays pass.
    ///
    /// Returns:
    ///     For each ray what stopped it.
    ///
    /// Raises:
    ///     ValueError: If shapes are others; a row is not finite, a direction zero, or an origin 2^31 voxels or more from the
    ///         world's (the message names the row); `max_range` is not positive; or `unknown` is another word.
    #[pyo3(signature = (origins, directions, max_range, unknown = "stop"))]
    fn cast_rays(
        &self,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        max_range: f64,
        unknown: &str,
    ) -> PyResult<RayHits> {
        let (py, unknown) = (origins.py(), parse("unknown", unknown, &TO_RAYS)?);
        let directions = Rows::new(directions, "directions")?;
        let directions = directions.get()?;
        let origins = Rows::new(&one_for_all(origins, directions.len())?, "origins")?;
        let origins = origins.get()?;
        RayHits::new(py, self.ask(py, |grid| grid.cast_rays(origins, directions, max_range, unknown))?)
    }

    /// Whether shapes meet an occupied voxel, or an unknown one where unknown is to count as occupied.
    ///
    /// A shape meets a voxel if any point of it, its surface included, belongs to the voxel: a box that stands on the
    /// upper faces of a floor's voxels does not meet them.
    ///
    /// Args:
    ///     spheres: (N, 4) rows of x, y, z of the centre and the radius, metres.
    ///     boxes: (N, 6) rows of x, y, z of the lowest corner and of the highest, metres. Either these or spheres.
    ///     unknown: "occupied": to meet unknown space is to collide. "free": it is not.
    ///
    /// Returns:
    ///     (N,) bool.
    ///
    /// Raises:
    ///     ValueError: If both kinds of shapes are given or none, shapes of arrays are others, a row is not finite, has a
    ///         negative radius or its corners swapped (the message names the row), or `unknown` is another word.
    #[pyo3(signature = (*, spheres = None, boxes = None, unknown = "occupied"))]
    fn collides<'py>(
        &self,
        py: Python<'py>,
        spheres: Option<&Bound<'py, PyAny>>,
        boxes: Option<&Bound<'py, PyAny>>,
        unknown: &str,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let unknown = parse("unknown", unknown, &TO_SHAPES)?;
        let answer = match (spheres, boxes) {
            (Some(spheres), None) => {
                let rows = Rows::new(spheres, "spheres")?;
                let rows = rows.get()?;
                self.ask(py, |grid| grid.collides_spheres(rows, unknown))?
            }
            (None, Some(boxes)) => {
                let rows = Rows::new(boxes, "boxes")?;
                let rows = rows.get()?;
                self.ask(py, |grid| grid.collides_boxes(rows, unknown))?
            }
            (given, _) => {
                let got = if given.is_some() { "both given" } else { "both missing" };
                return Err(PyValueError::new_err(format!("spheres and boxes are {got}, expected one of them")));
            }
        };
        Ok(PyArray1::from_vec(py, answer))
    }

    /// The log-odds of all voxels whose centres lie in a region, as a dense array.
    ///
    /// Args:
    ///     region: (2, 3) lowest and highest corner, metres; a centre on the lowest belongs to it, on the highest not.
    ///         `grid.bounds` is the whole map.
    ///
    /// Returns:
    ///     (X, Y, Z) float32 log-odds, evidence plus prior, 0 where unknown; and (3,) int32, the index of the first voxel:
    ///     `values[i, j, k]` is that of voxel `first + (i, j, k)`.
    ///
    /// Raises:
    ///     ValueError: If the shape is another, the corners are swapped or not numbers, or the region has more than 2^31
    ///         voxels or more than there is memory for; the message says how many.
    #[expect(clippy::type_complexity, reason = "a tuple of two arrays")]
    fn dense<'py>(
        &self,
        region: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArray3<f32>>, Bound<'py, PyArray1<i32>>)> {
        let (py, region) = (region.py(), arrays::region(region)?);
        let dense = self.ask(py, |grid| grid.dense(&region))?;
        Ok((PyArray1::from_vec(py, dense.values).reshape(dense.shape)?, PyArray1::from_slice(py, &dense.first)))
    }

    /// Indices of all occupied voxels.
    ///
    /// Returns:
    ///     (N, 3) int32, sorted by block, and within a block by x, y, z.
    fn occupied_voxels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        indices(py, self.ask(py, pyramap::OccupancyGrid::occupied_voxels)?)
    }

    /// Indices of all free voxels.
    ///
    /// Returns:
    ///     (N, 3) int32, sorted by block, and within a block by x, y, z.
    fn free_voxels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        indices(py, self.ask(py, pyramap::OccupancyGrid::free_voxels)?)
    }

    /// Indices of all unknown voxels that share a face with a free one: where the map can grow.
    ///
    /// Returns:
    ///     (N, 3) int32, sorted by block, and within a block by x, y, z.
    fn unknown_voxels_next_to_free<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        indices(py, self.ask(py, pyramap::OccupancyGrid::unknown_voxels_next_to_free)?)
    }

    /// Centres of voxels.
    ///
    /// Args:
    ///     indices: (N, 3) integers, of voxels that the map knows or not.
    ///
    /// Returns:
    ///     (N, 3) float64 world coordinates, metres: `(indices + 0.5) * voxel_size`.
    ///
    /// Raises:
    ///     ValueError: If shape or type are others, or a number exceeds 32 bits.
    fn voxel_centres<'py>(&self, indices: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (py, indices) = (indices.py(), arrays::integers(indices, "indices")?);
        let voxel_size = self.ask(py, |grid| Ok(grid.config().voxel_size))?;
        let centres = indices.iter().flatten().map(|&i| (f64::from(i) + 0.5) * voxel_size);
        PyArray1::from_iter(py, centres).reshape([indices.len(), 3])
    }
}

/// What stopped each of a number of rays, made by `OccupancyGrid.cast_rays`: one entry, or row, for each.
#[pyclass(frozen, module = "pyramap")]
pub struct RayHits {
    distance: Py<PyArray1<f64>>,
    state: Py<PyArray1<i8>>,
    voxel: Py<PyArray2<i32>>,
}

impl RayHits {
    fn new(py: Python<'_>, hits: pyramap::RayHits) -> PyResult<Self> {
        Ok(Self {
            distance: PyArray1::from_vec(py, hits.distance).unbind(),
            state: states(py, hits.state).unbind(),
            voxel: indices(py, hits.voxel)?.unbind(),
        })
    }
}

#[pymethods]
impl RayHits {
    /// From the origin to where the ray enters the voxel that stopped it, (N,) float64, metres: 0 if that voxel contains
    /// the origin, `inf` if nothing stopped the ray.
    #[getter]
    fn distance(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.distance.clone_ref(py)
    }

    /// What the map knows of that voxel, (N,) int8: 1 occupied, -1 unknown; 0, which stops no ray, if nothing did.
    #[getter]
    fn state(&self, py: Python<'_>) -> Py<PyArray1<i8>> {
        self.state.clone_ref(py)
    }

    /// Indices of these voxels, (N, 3) int32; where nothing stopped the ray the smallest int32, which is no voxel's.
    #[getter]
    fn voxel(&self, py: Python<'_>) -> Py<PyArray2<i32>> {
        self.voxel.clone_ref(py)
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.state.bind(py).as_any().len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let distance = self.distance.bind(py).try_readonly()?;
        let stopped = distance.as_slice()?.iter().filter(|distance| distance.is_finite()).count();
        Ok(format!("RayHits({} rays, {stopped} stopped)", self.__len__(py)?))
    }
}

fn states(py: Python<'_>, states: Vec<State>) -> Bound<'_, PyArray1<i8>> {
    PyArray1::from_vec(py, states.into_iter().map(|state| state as i8).collect())
}

fn indices(py: Python<'_>, voxels: Vec<VoxelIndex>) -> PyResult<Bound<'_, PyArray2<i32>>> {
    let count = voxels.len();
    PyArray1::from_vec(py, voxels.into_flattened()).reshape([count, 3])
}

/// One point, (3,), as that of so many rows; anything else as it is.
fn one_for_all<'py>(points: &Bound<'py, PyAny>, count: usize) -> PyResult<Bound<'py, PyAny>> {
    let numpy = points.py().import("numpy")?;
    match numpy.call_method1("shape", (points,)).and_then(|shape| shape.extract::<Vec<usize>>()) {
        Ok(shape) if shape == [3] => numpy.call_method1("broadcast_to", (points, (count, 3))),
        // What has no shape is refused, with its name, by whoever takes rows.
        _ => Ok(points.clone()),
    }
}
