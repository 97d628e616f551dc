//! `OccupancyGrid.distance_field` and the `DistanceField` that it gives.

use crate::arrays::{self, Rows};
use crate::grid::{OccupancyGrid, parse, word};
use crate::queries::{INTERPOLATIONS, TO_SHAPES};
use crate::threads::with_pool;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use rayon::ThreadPool;
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

#[pymethods]
impl OccupancyGrid {
    /// The signed distance of every voxel to the nearest occupied one, which follows the map as it changes.
    ///
    /// Args:
    ///     max_distance: Metres, 1 to 254 voxels: whatever is farther away, or nowhere, is this far. Time and memory grow with
    ///         the volume that is within this distance of anything.
    ///     unknown: What unknown voxels count as. "free": only what is known to be occupied is in the way. "occupied": what
    ///         nobody has seen is, too.
    ///
    /// Returns:
    ///     The field of the map as it is now, and as it will be.
    ///
    /// Raises:
    ///     ValueError: If `max_distance` is out of its range, or `unknown` is another word.
    #[pyo3(signature = (max_distance, unknown = "free"))]
    fn distance_field(slf: &Bound<'_, Self>, max_distance: f64, unknown: &str) -> PyResult<DistanceField> {
        let (py, unknown, grid) = (slf.py(), parse("unknown", unknown, &TO_SHAPES)?, slf.get());
        let followed = with_pool(py, |pool| {
            let (map, num_writes) = (&*grid.read()?, grid.num_writes());
            let field = pool.install(|| pyramap::DistanceField::new(map, max_distance, unknown))?;
            Ok(Followed { field, num_writes })
        })?;
        Ok(DistanceField { grid: slf.clone().unbind(), followed: RwLock::new(followed) })
    }
}

/// How far every voxel is from the nearest obstacle, made by `OccupancyGrid.distance_field`.
///
/// What is measured is the exact Euclidean distance between the centres of voxels. A voxel that is not occupied has the
/// distance to the nearest occupied one; an occupied voxel has the distance to the nearest that is not, as a negative
/// number. So the voxels on either side of a surface have `+voxel_size` and `-voxel_size`, and trilinear interpolation
/// finds 0 on the face between them. A robot that is a sphere is clear of all voxels if the distance at its centre exceeds its
/// radius by the diagonal of a voxel.
///
/// The field follows its map: every question is answered for the map as it is when it is asked. If the map has changed
/// since the last one, that question first computes what the changes reach, or waits for another thread that does;
/// `update` does so beforehand, at a time of your choice. Questions may be asked from any number of threads. The field
/// keeps its map alive, and is not saved with it.
#[pyclass(frozen, module = "pyramap")]
pub struct DistanceField {
    grid: Py<OccupancyGrid>,
    // Whoever holds this lock may wait for that of the map, and nobody the other way round.
    followed: RwLock<Followed>,
}

/// A field, and which state of the map it is of.
struct Followed {
    field: pyramap::DistanceField,
    num_writes: u64,
}

impl DistanceField {
    fn read(&self) -> RwLockReadGuard<'_, Followed> {
        self.followed.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Brings the field up to the map; gives how many voxels changed.
    fn follow(&self, pool: &ThreadPool) -> pyramap::Result<usize> {
        let grid = self.grid.get();
        if self.read().num_writes == grid.num_writes() {
            return Ok(0);
        }
        let followed = &mut *self.followed.write().unwrap_or_else(PoisonError::into_inner);
        // While the map is held nobody changes it.
        let (map, num_writes) = (&*grid.read()?, grid.num_writes());
        let changed = pool.install(|| followed.field.update(map))?;
        followed.num_writes = num_writes;
        Ok(changed)
    }

    /// Asks the field, brought up to the map, without the GIL.
    fn ask<T: Send>(
        &self,
        py: Python<'_>,
        question: impl FnOnce(&pyramap::DistanceField) -> pyramap::Result<T> + Send,
    ) -> PyResult<T> {
        with_pool(py, |pool| {
            self.follow(pool)?;
            let followed = &*self.read();
            pool.install(|| question(&followed.field))
        })
    }

    /// What does not depend on the map's being the latest.
    fn property<T: Send>(&self, py: Python<'_>, get: impl FnOnce(&pyramap::DistanceField) -> T + Send) -> T {
        py.detach(|| get(&self.read().field))
    }
}

#[pymethods]
impl DistanceField {
    /// Signed distances at points.
    ///
    /// Args:
    ///     points: (N, 3) world coordinates, metres.
    ///     interpolation: "nearest": that of the voxel which contains the point. "trilinear": between the centres of voxels.
    ///
    /// Returns:
    ///     (N,) float32, metres, from `-max_distance` to `max_distance`; negative in occupied space.
    ///
    /// Raises:
    ///     ValueError: If the shape is another, a coordinate is not finite, or there is no such interpolation.
    #[pyo3(signature = (points, interpolation = "nearest"))]
    fn distance<'py>(&self, points: &Bound<'py, PyAny>, interpolation: &str) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let (py, interpolation) = (points.py(), parse("interpolation", interpolation, &INTERPOLATIONS)?);
        let points = Rows::new(points, "points")?;
        let at = points.get()?;
        Ok(PyArray1::from_vec(py, self.ask(py, |field| field.distance(at, interpolation))?))
    }

    /// Gradients of the trilinearly interpolated distance at points: which way leads away from obstacles.
    ///
    /// The length is about 1 where one obstacle is nearest, less between several, and 0 where all around is
    /// `max_distance` away. Across a surface the distance rises by two voxel sizes within one, so there it is up to 2.
    ///
    /// Args:
    ///     points: (N, 3) world coordinates, metres.
    ///
    /// Returns:
    ///     (N, 3) float32: metres a metre along x, y and z.
    ///
    /// Raises:
    ///     ValueError: If the shape is another, or a coordinate is not finite.
    fn gradient<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let (py, points) = (points.py(), Rows::new(points, "points")?);
        let at = points.get()?;
        let gradients = self.ask(py, |field| field.gradient(at))?;
        let count = gradients.len();
        PyArray1::from_vec(py, gradients.into_flattened()).reshape([count, 3])
    }

    /// The signed distances of all voxels whose centres lie in a region, as a dense array.
    ///
    /// Args:
    ///     region: (2, 3) lowest and highest corner, metres; a centre on the lowest belongs to it, on the highest not.
    ///         `grid.bounds` is the whole map.
    ///
    /// Returns:
    ///     (X, Y, Z) float32, metres; and (3,) int32, the index of the first voxel: `values[i, j, k]` is that of voxel
    ///     `first + (i, j, k)`.
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
        let dense = self.ask(py, |field| field.dense(&region))?;
        Ok((PyArray1::from_vec(py, dense.values).reshape(dense.shape)?, PyArray1::from_slice(py, &dense.first)))
    }

    /// Follows what has changed in the map, as the next question would.
    ///
    /// Returns:
    ///     How many voxels have become occupied or ceased to be since the last update, as unknown voxels count.
    fn update(&self, py: Python<'_>) -> PyResult<usize> {
        with_pool(py, |pool| self.follow(pool))
    }

    /// The largest distance, metres.
    #[getter]
    fn max_distance(&self, py: Python<'_>) -> f64 {
        self.property(py, pyramap::DistanceField::max_distance)
    }

    /// Edge of a voxel, metres.
    #[getter]
    fn voxel_size(&self, py: Python<'_>) -> f64 {
        self.property(py, pyramap::DistanceField::voxel_size)
    }

    /// What unknown voxels count as: "free" or "occupied".
    #[getter]
    fn unknown(&self, py: Python<'_>) -> &'static str {
        word(self.property(py, pyramap::DistanceField::unknown), &TO_SHAPES)
    }

    /// Bytes that the field takes, as of its last update.
    #[getter]
    fn nbytes(&self, py: Python<'_>) -> usize {
        self.property(py, pyramap::DistanceField::nbytes)
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let (max_distance, unknown) = (self.max_distance(py), self.unknown(py));
        format!("DistanceField(max_distance={max_distance}, unknown={unknown:?}, voxel_size={})", self.voxel_size(py))
    }
}
