//! `OccupancyGrid` and `FrameStats`.

use crate::arrays::{self, DepthArray};
use crate::camera::PinholeCamera;
use crate::errors::to_py;
use crate::mesh::Mesh;
use crate::sensor::SensorModel;
use crate::threads::run;
use numpy::{PyArray1, PyArray2, PyArray4, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pyramap::block::BLOCK_EDGE;
use pyramap::mesh::MeshOptions;
use pyramap::{BeyondMaxRange, GridConfig, Pose, UpdateRule};
use std::path::PathBuf;
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

/// A sparse map of log-odds: free, occupied and unknown space.
///
/// Any number of threads may ask while none integrates; who integrates waits for them, and they for it.
#[pyclass(frozen, module = "pyramap")]
pub struct OccupancyGrid(RwLock<pyramap::OccupancyGrid>);

/// The words for an update rule, and for readings beyond the range.
const UPDATES: [(&str, UpdateRule); 4] = [
    ("pyramid", UpdateRule::Pyramid),
    ("area", UpdateRule::Area),
    ("min_layer", UpdateRule::MinLayer),
    ("ideal", UpdateRule::Ideal),
];
const BEYOND: [(&str, BeyondMaxRange); 2] = [("free", BeyondMaxRange::Free), ("ignore", BeyondMaxRange::Ignore)];
const BACKENDS: [(&str, ()); 2] = [("auto", ()), ("cpu", ())];

fn parse<T: Copy>(name: &str, got: &str, words: &[(&str, T)]) -> PyResult<T> {
    words.iter().find(|(word, _)| *word == got).map(|&(_, value)| value).ok_or_else(|| {
        let expected: Vec<String> = words.iter().map(|(word, _)| format!("{word:?}")).collect();
        PyValueError::new_err(format!("{name} is {got:?}, expected {}", expected.join(" or ")))
    })
}

fn word<T: PartialEq>(value: T, words: &[(&'static str, T)]) -> &'static str {
    words.iter().find(|(_, other)| *other == value).expect("every value has its word").0
}

fn check_backend(backend: &str) -> PyResult<()> {
    if backend == "gpu" {
        return Err(PyValueError::new_err(
            "backend is \"gpu\", but this build has no GPU backend; expected \"auto\" or \"cpu\"",
        ));
    }
    parse("backend", backend, &BACKENDS)
}

impl OccupancyGrid {
    fn read(&self) -> RwLockReadGuard<'_, pyramap::OccupancyGrid> {
        // A panic cannot leave the map half changed: all that may fail comes before the commit.
        self.0.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks the map without the GIL.
    fn ask<T: Send>(
        &self,
        py: Python<'_>,
        question: impl FnOnce(&pyramap::OccupancyGrid) -> pyramap::Result<T> + Send,
    ) -> PyResult<T> {
        run(py, || question(&self.read()))
    }

    /// Changes the map without the GIL.
    fn change<T: Send>(
        &self,
        py: Python<'_>,
        change: impl FnOnce(&mut pyramap::OccupancyGrid) -> pyramap::Result<T> + Send,
    ) -> PyResult<T> {
        run(py, || change(&mut self.0.write().unwrap_or_else(PoisonError::into_inner)))
    }

    /// A property, read without holding the GIL while another thread integrates.
    fn property<T: Send>(&self, py: Python<'_>, get: impl FnOnce(&pyramap::OccupancyGrid) -> T + Send) -> T {
        py.detach(|| get(&self.read()))
    }

    fn frame<'py>(
        &self,
        depth: &Bound<'py, PyAny>,
        camera: PinholeCamera,
        world_from_camera: &Bound<'py, PyAny>,
        depth_scale: Option<f64>,
        fuse: impl FnOnce(
            &mut pyramap::OccupancyGrid,
            &pyramap::DepthImage,
            &pyramap::PinholeCamera,
            &Pose,
        ) -> pyramap::Result<pyramap::FrameStats>
        + Send,
    ) -> PyResult<FrameStats> {
        let depth_array = DepthArray::new(depth, depth_scale)?;
        let image = depth_array.image()?;
        let pose = arrays::pose(world_from_camera)?;
        self.change(depth.py(), |grid| fuse(grid, &image, &camera.0, &pose)).map(FrameStats)
    }
}

#[pymethods]
impl OccupancyGrid {
    #[new]
    #[pyo3(signature = (voxel_size, sensor_model = None, max_range = 5.0, update = "pyramid", backend = "auto",
                        clamp = None, max_bytes = None, prior = 0.5, beyond_max_range = "free"))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    fn new(
        voxel_size: f64,
        sensor_model: Option<SensorModel>,
        max_range: f64,
        update: &str,
        backend: &str,
        clamp: Option<(f64, f64)>,
        max_bytes: Option<usize>,
        prior: f64,
        beyond_max_range: &str,
    ) -> PyResult<Self> {
        check_backend(backend)?;
        let mut config = GridConfig::new(voxel_size).map_err(to_py)?;
        config.sensor_model = sensor_model.map_or(config.sensor_model, |model| model.0);
        config.max_range = max_range;
        config.update = parse("update", update, &UPDATES)?;
        config.clamp = clamp;
        config.max_bytes = max_bytes;
        config.prior = prior;
        config.beyond_max_range = parse("beyond_max_range", beyond_max_range, &BEYOND)?;
        pyramap::OccupancyGrid::new(config).map(|grid| Self(RwLock::new(grid))).map_err(to_py)
    }

    #[staticmethod]
    #[pyo3(signature = (path, backend = "auto"))]
    fn load(py: Python<'_>, path: PathBuf, backend: &str) -> PyResult<Self> {
        check_backend(backend)?;
        run(py, || pyramap::OccupancyGrid::load(path)).map(|grid| Self(RwLock::new(grid)))
    }

    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        self.ask(py, |grid| grid.save(path))
    }

    #[pyo3(signature = (depth, camera, world_from_camera, depth_scale = None))]
    fn integrate(
        &self,
        depth: &Bound<'_, PyAny>,
        camera: PinholeCamera,
        world_from_camera: &Bound<'_, PyAny>,
        depth_scale: Option<f64>,
    ) -> PyResult<FrameStats> {
        self.frame(depth, camera, world_from_camera, depth_scale, pyramap::OccupancyGrid::integrate)
    }

    #[pyo3(signature = (depth, camera, world_from_camera, depth_scale = None))]
    fn remove(
        &self,
        depth: &Bound<'_, PyAny>,
        camera: PinholeCamera,
        world_from_camera: &Bound<'_, PyAny>,
        depth_scale: Option<f64>,
    ) -> PyResult<FrameStats> {
        self.frame(depth, camera, world_from_camera, depth_scale, pyramap::OccupancyGrid::remove)
    }

    fn merge(slf: &Bound<'_, Self>, other: &Bound<'_, Self>) -> PyResult<()> {
        if slf.is(other) {
            return Err(PyValueError::new_err("other is the map itself, expected another map"));
        }
        let other = other.get();
        slf.get().change(slf.py(), |grid| grid.merge(&other.read()))
    }

    fn log_odds<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let at = arrays::points(points)?;
        Ok(PyArray1::from_vec(points.py(), self.ask(points.py(), |grid| grid.log_odds(&at))?))
    }

    fn probability<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let at = arrays::points(points)?;
        Ok(PyArray1::from_vec(points.py(), self.ask(points.py(), |grid| grid.probability(&at))?))
    }

    fn state<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<i8>>> {
        let at = arrays::points(points)?;
        let states = self.ask(points.py(), |grid| grid.state(&at))?;
        Ok(PyArray1::from_iter(points.py(), states.into_iter().map(|state| state as i8)))
    }

    fn block_coords<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        let keys = self.ask(py, |grid| Ok(grid.block_coords()))?;
        let count = keys.len();
        PyArray1::from_vec(py, keys.into_flattened()).reshape([count, 3])
    }

    fn block_log_odds<'py>(&self, coords: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray4<f32>>> {
        let keys = arrays::block_keys(coords)?;
        let values = self.ask(coords.py(), |grid| Ok(grid.block_log_odds(&keys)))?;
        PyArray1::from_vec(coords.py(), values).reshape([keys.len(), BLOCK_EDGE, BLOCK_EDGE, BLOCK_EDGE])
    }

    #[pyo3(signature = (level = 0.0, min_evidence = 0.0))]
    fn mesh(&self, py: Python<'_>, level: f64, min_evidence: f64) -> PyResult<Mesh> {
        let options = MeshOptions { level, min_evidence };
        let mesh = self.ask(py, |grid| pyramap::mesh::extract(grid, &options))?;
        Mesh::new(py, mesh)
    }

    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let bounds = self.property(py, |grid| grid.bounds());
        bounds.map(|corners| PyArray2::from_vec2(py, &corners.map(Vec::from)).expect("two rows of three"))
    }

    #[getter]
    fn num_blocks(&self, py: Python<'_>) -> usize {
        self.property(py, |grid| grid.num_blocks())
    }

    #[getter]
    fn num_observed(&self, py: Python<'_>) -> usize {
        self.property(py, |grid| grid.num_observed())
    }

    #[getter]
    fn num_frames(&self, py: Python<'_>) -> i64 {
        self.property(py, |grid| grid.num_frames())
    }

    #[getter]
    fn saturated(&self, py: Python<'_>) -> u64 {
        self.property(py, |grid| grid.saturated())
    }

    #[getter]
    fn nbytes(&self, py: Python<'_>) -> usize {
        self.property(py, |grid| grid.nbytes())
    }

    #[getter]
    fn backend(&self, py: Python<'_>) -> String {
        self.property(py, |grid| grid.backend().to_owned())
    }

    #[getter]
    fn voxel_size(&self, py: Python<'_>) -> f64 {
        self.property(py, |grid| grid.config().voxel_size)
    }

    #[getter]
    fn sensor_model(&self, py: Python<'_>) -> SensorModel {
        SensorModel(self.property(py, |grid| grid.config().sensor_model))
    }

    #[getter]
    fn max_range(&self, py: Python<'_>) -> f64 {
        self.property(py, |grid| grid.config().max_range)
    }

    #[getter]
    fn update(&self, py: Python<'_>) -> &'static str {
        self.property(py, |grid| word(grid.config().update, &UPDATES))
    }

    #[getter]
    fn clamp(&self, py: Python<'_>) -> Option<(f64, f64)> {
        self.property(py, |grid| grid.config().clamp)
    }

    #[getter]
    fn max_bytes(&self, py: Python<'_>) -> Option<usize> {
        self.property(py, |grid| grid.config().max_bytes)
    }

    #[getter]
    fn prior(&self, py: Python<'_>) -> f64 {
        self.property(py, |grid| grid.config().prior)
    }

    #[getter]
    fn beyond_max_range(&self, py: Python<'_>) -> &'static str {
        self.property(py, |grid| word(grid.config().beyond_max_range, &BEYOND))
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        self.property(py, |grid| {
            let (voxel_size, update) = (grid.config().voxel_size, word(grid.config().update, &UPDATES));
            let (frames, blocks) = (grid.num_frames(), grid.num_blocks());
            format!("OccupancyGrid(voxel_size={voxel_size}, update={update:?}, {frames} frames, {blocks} blocks)")
        })
    }
}

/// What a frame did to the map.
#[pyclass(frozen, module = "pyramap")]
pub struct FrameStats(pyramap::FrameStats);

#[pymethods]
impl FrameStats {
    #[getter]
    fn blocks_free(&self) -> usize {
        self.0.blocks_free
    }

    #[getter]
    fn blocks_mixed(&self) -> usize {
        self.0.blocks_mixed
    }

    #[getter]
    fn voxels_updated(&self) -> usize {
        self.0.voxels_updated
    }

    #[getter]
    fn saturated(&self) -> u64 {
        self.0.saturated
    }

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
