//! `OccupancyGrid`.

use crate::arrays;
use crate::camera::PinholeCamera;
use crate::colour::ColourArguments;
use crate::devices::Choice;
use crate::errors::to_py;
use crate::frame::FrameArguments;
use crate::mesh::Mesh;
use crate::sensor::SensorModel;
use crate::sensors::AnySensor;
use crate::stats::FrameStats;
use crate::threads::{run, with_pool};
use numpy::{PyArray1, PyArray2, PyArray4, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyramap::block::BLOCK_EDGE;
use pyramap::mesh::MeshOptions;
use pyramap::{BeyondMaxRange, GridConfig, Pose, Sensor, UpdateRule};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// A sparse map of log-odds out of depth images: what is free, what is occupied, and what nobody has seen.
///
/// Voxel (i, j, k) spans `[i r, (i + 1) r)` along the world's x, y, z for a voxel size `r`; its centre is `(i + 0.5) r`.
/// Log-odds are kept as whole multiples of 2^-12. Without `clamp` a frame only adds to them: the same frames give the
/// same map in any order and on any number of threads, frames can be removed, and maps merged.
///
/// A call that fails leaves the map as it was. Maps are safe to share among threads: any number may ask at a time; one
/// that changes the map waits for them and they for it, so that every answer is about whole frames.
///
/// Args:
///     voxel_size: Edge of a voxel, metres.
///     sensor_model: What a reading says (Eq. 7). Default: `SensorModel(sigma=voxel_size)`.
///     max_range: Distance from the camera up to which voxels are updated, metres: 1 to 4096 voxels.
///     update: How a voxel's log-odd is found in the image. "pyramid": the paper's rule, two layers of a range pyramid,
///         interpolated (Eq. 10 to 17). "area": the mean of the log-odds at points spread in the voxel, read at full
///         resolution. "min_layer": one layer of least ranges, interpolated (after Andert 2009). "ideal": all rays that
///         cut the voxel, weighted by their length in it (Eq. 8 and 9): exact and slow. "rays": as OctoMap, one ray a
///         reading, which frees what it passes (probability 0.4) and occupies where it ends (0.7), each voxel once a
///         frame; `sensor_model` is not asked, OctoMap's clamp is `OCTOMAP_CLAMP`, and `integrate_points` takes point
///         clouds.
///     backend: "cpu"; "gpu", through Vulkan, Metal or DirectX 12; or "auto": a real GPU if there is one, else the CPU.
///         A GPU has the rules "pyramid", "area" and "min_layer". It agrees with the CPU within 1e-3 log-odds a frame.
///     clamp: `(low, high)` log-odds within which voxels are kept, so that the map follows changes quickly; one below and
///         one above the prior's. Frames cannot be removed then, and their order matters. Default: no bounds.
///     max_bytes: The most that `nbytes` may come to. Default: no limit.
///     prior: Probability of being occupied before anything is seen (Eq. 4), between 0 and 1.
///     beyond_max_range: What a reading farther than `max_range` says. "free": all is free up to `max_range`. "ignore":
///         nothing, as if there were no reading.
///     adapter: Part of the name of the GPU to use, in whatever case; see `devices`. The environment's PYRAMAP_ADAPTER
///         says the same. Default: the best there is. A software adapter is used only if it is named.
///     colour: Keep a mean colour of the voxels near surfaces, of frames that have a colour image: 4 KB a block of
///         8 x 8 x 8 voxels near a surface, 8 KB where many frames see it; `nbytes` counts them. Done on the CPU, beside a
///         GPU if the map is on one.
///
/// Raises:
///     ValueError: If a parameter is out of its range; the message names it.
///     DeviceNotFoundError: If a GPU is asked for and there is none that can be used; the message says what was found.
///     DeviceForkedError: If this process was forked from one that had opened a GPU.
#[pyclass(frozen, module = "pyramap")]
pub struct OccupancyGrid(SharedGrid, AtomicU64);

/// A map that its Python object and those that answer for it later share.
pub type SharedGrid = Arc<RwLock<pyramap::OccupancyGrid>>;

/// The words for an update rule, and for readings beyond the range.
pub const UPDATES: [(&str, UpdateRule); 5] = [
    ("pyramid", UpdateRule::Pyramid),
    ("area", UpdateRule::Area),
    ("min_layer", UpdateRule::MinLayer),
    ("ideal", UpdateRule::Ideal),
    ("rays", UpdateRule::Rays),
];
pub const BEYOND: [(&str, BeyondMaxRange); 2] = [("free", BeyondMaxRange::Free), ("ignore", BeyondMaxRange::Ignore)];

pub fn parse<T: Copy>(name: &str, got: &str, words: &[(&str, T)]) -> PyResult<T> {
    words.iter().find(|(word, _)| *word == got).map(|&(_, value)| value).ok_or_else(|| {
        let expected: Vec<String> = words.iter().map(|(word, _)| format!("{word:?}")).collect();
        PyValueError::new_err(format!("{name} is {got:?}, expected {}", expected.join(" or ")))
    })
}

pub fn word<T: PartialEq>(value: T, words: &[(&'static str, T)]) -> &'static str {
    words.iter().find(|(_, other)| *other == value).expect("every value has its word").0
}

pub fn count(name: &str, got: i64, expected: &str) -> PyResult<usize> {
    usize::try_from(got).map_err(|_| PyValueError::new_err(format!("{name} is {got}, expected {expected}")))
}

impl OccupancyGrid {
    pub fn new_shared(grid: pyramap::OccupancyGrid) -> Self {
        Self(Arc::new(RwLock::new(grid)), AtomicU64::new(0))
    }

    /// The map with all its frames.
    pub fn read(&self) -> pyramap::Result<RwLockReadGuard<'_, pyramap::OccupancyGrid>> {
        // A panic cannot leave the map half changed: all that may fail comes before the commit.
        let grid = self.0.read().unwrap_or_else(PoisonError::into_inner);
        if grid.is_synchronized() {
            return Ok(grid);
        }
        drop(grid);
        self.write().synchronize()?;
        Ok(self.0.read().unwrap_or_else(PoisonError::into_inner))
    }

    fn write(&self) -> RwLockWriteGuard<'_, pyramap::OccupancyGrid> {
        let grid = self.0.write().unwrap_or_else(PoisonError::into_inner);
        self.1.fetch_add(1, Ordering::Release);
        grid
    }

    /// How often someone has taken hold of the map to change it: as long as this stays the same, so does the map.
    pub fn num_writes(&self) -> u64 {
        self.1.load(Ordering::Acquire)
    }

    /// Asks the map without the GIL.
    pub fn ask<T: Send>(
        &self,
        py: Python<'_>,
        question: impl FnOnce(&pyramap::OccupancyGrid) -> pyramap::Result<T> + Send,
    ) -> PyResult<T> {
        with_pool(py, |pool| {
            let grid = &*self.read()?;
            pool.install(|| question(grid))
        })
    }

    /// Changes the map without the GIL.
    pub fn change<T: Send>(
        &self,
        py: Python<'_>,
        change: impl FnOnce(&mut pyramap::OccupancyGrid) -> pyramap::Result<T> + Send,
    ) -> PyResult<T> {
        with_pool(py, |pool| {
            let grid = &mut *self.write();
            pool.install(|| change(grid))
        })
    }

    /// A property that frames change, read without holding the GIL while another thread integrates.
    pub fn property<T: Send>(
        &self,
        py: Python<'_>,
        get: impl FnOnce(&pyramap::OccupancyGrid) -> T + Send,
    ) -> PyResult<T> {
        py.detach(|| self.read().map(|grid| get(&grid))).map_err(to_py)
    }

    /// A parameter of the map, which no frame changes.
    pub fn parameter<T: Send>(&self, py: Python<'_>, get: impl FnOnce(&pyramap::OccupancyGrid) -> T + Send) -> T {
        py.detach(|| get(&self.0.read().unwrap_or_else(PoisonError::into_inner)))
    }

    /// Changes the map with a frame.
    fn frame<T: Send>(
        &self,
        py: Python<'_>,
        frame: FrameArguments<'_, '_>,
        world_from_camera: Option<&Bound<'_, PyAny>>,
        fuse: impl FnOnce(&mut pyramap::OccupancyGrid, &pyramap::DepthImage, &Sensor, &Pose) -> pyramap::Result<T> + Send,
    ) -> PyResult<T> {
        let frame = frame.check()?;
        let image = frame.image()?;
        let missing = || PyValueError::new_err("world_from_camera is missing, expected a (4, 4) rigid transform");
        let pose = arrays::pose(world_from_camera.ok_or_else(missing)?)?;
        self.change(py, |grid| fuse(grid, &image, &frame.sensor, &pose))
    }
}

#[pymethods]
impl OccupancyGrid {
    #[new]
    #[pyo3(signature = (voxel_size, sensor_model = None, max_range = 5.0, update = "pyramid", backend = "auto",
                        clamp = None, max_bytes = None, prior = 0.5, beyond_max_range = "free", adapter = None,
                        colour = false))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    fn new(
        py: Python<'_>,
        voxel_size: f64,
        sensor_model: Option<SensorModel>,
        max_range: f64,
        update: &str,
        backend: &str,
        clamp: Option<(f64, f64)>,
        max_bytes: Option<i64>,
        prior: f64,
        beyond_max_range: &str,
        adapter: Option<String>,
        colour: bool,
    ) -> PyResult<Self> {
        let device = Choice::parse(py, backend, adapter)?;
        let mut config = GridConfig::new(voxel_size).map_err(to_py)?;
        config.sensor_model = sensor_model.map_or(config.sensor_model, |model| model.0);
        config.max_range = max_range;
        config.update = parse("update", update, &UPDATES)?;
        config.clamp = clamp;
        let limit = |bytes| count("max_bytes", bytes, "0 or more, or None for no limit");
        config.max_bytes = max_bytes.map(limit).transpose()?;
        config.prior = prior;
        config.beyond_max_range = parse("beyond_max_range", beyond_max_range, &BEYOND)?;
        config.colour = colour;
        py.detach(|| device.empty(config)).map(Self::new_shared).map_err(to_py)
    }

    /// Reads a map that `save` wrote, with all its parameters.
    ///
    /// Args:
    ///     path: A str or a path.
    ///     backend: As for the constructor; it is not part of the file.
    ///     adapter: As for the constructor.
    ///
    /// Raises:
    ///     OSError: If the file cannot be read (FileNotFoundError, PermissionError), is no map, is cut off or altered in
    ///         any place, or comes from a newer version; the message names the file.
    ///     ValueError: If there is no such backend.
    ///     DeviceNotFoundError: If a GPU is asked for and there is none that can be used.
    #[staticmethod]
    #[pyo3(signature = (path, backend = "auto", adapter = None))]
    fn load(py: Python<'_>, path: PathBuf, backend: &str, adapter: Option<String>) -> PyResult<Self> {
        let device = Choice::parse(py, backend, adapter)?;
        run(py, || pyramap::OccupancyGrid::load_on(path, |config| device.empty(config))).map(Self::new_shared)
    }

    /// Writes the map to a file: equal maps give equal bytes.
    ///
    /// The path holds the whole new map or what was there before: it is written beside it first, synced, and renamed.
    ///
    /// Args:
    ///     path: A str or a path; ".pmap" is the usual ending.
    ///
    /// Raises:
    ///     OSError: If the file cannot be written; the message names it.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        self.ask(py, |grid| grid.save(path))
    }

    /// Fuses an image of depths or ranges into the map: whole, or not at all.
    ///
    /// On a GPU this returns while the GPU works on the frame, so that the next can be read meanwhile. Whatever reads the
    /// map waits for it. If an earlier frame cannot be fused, MapFullError or DeviceError come up in the next call; a
    /// frame given to that call is not fused either and may be given again.
    ///
    /// A reading of 0, NaN or a negative number is no reading and says nothing; `inf` is no return: all is free up to
    /// `max_range`. A reading whose distance from the camera exceeds `max_range` means what `beyond_max_range` says.
    /// In uint16 every value but 0 is a distance, 65535 too: set what a sensor writes for "no reading" to 0 first.
    ///
    /// Args:
    ///     depth: (H, W) z-depth, float32 or float64 metres, or uint16 with `depth_scale`. Any strides; read-only will do.
    ///         A spherical sensor has no depth apart from ranges, and takes either.
    ///     camera: The sensor, for an image of the same size. Each frame may have its own.
    ///     world_from_camera: (4, 4) rigid transform, metres: the sensor's pose. The entries of R^T R may differ from the
    ///         identity by 2e-3; the nearest rotation is used.
    ///     depth_scale: For uint16 and only then: steps a metre, 1000.0 for millimetres.
    ///     ranges: Instead of `depth`: (H, W) distances along the pixels' rays, as LiDARs and time-of-flight cameras give
    ///         them.
    ///     sensor_model: What readings of this frame say, if not what the map's `sensor_model` says. To remove the frame it
    ///         must be given again. The rule "rays" asks no model.
    ///     colour: (H, W, 3) uint8, red, green, blue, for a map made with `colour=True`. The voxels near each surface that the
    ///         depth shows get its colour, averaged over their size in this image, and the map keeps the mean of all frames.
    ///         What another surface hides from the colour camera gets none.
    ///     colour_camera: The camera of `colour`, which must have its size. Default: `camera`.
    ///     depth_from_colour: (4, 4) rigid transform, metres: the pose of the colour camera in the axes of `camera`. Default:
    ///         the identity, as for images that are registered to the depth.
    ///
    /// Returns:
    ///     What the frame did, and the time it took.
    ///
    /// Raises:
    ///     TypeError: If `camera` is missing or no sensor.
    ///     ValueError: If not one of `depth` and `ranges` is given; the image has another shape or type, differs in size
    ///         from the camera or holds no reading at all; the pose is missing, not finite or not rigid; the camera lies beyond
    ///         the coordinates of the map; or there is colour, and the map was made without.
    ///     MapFullError: If the map would take more than `max_bytes`.
    ///     DeviceError: If the device fails.
    #[pyo3(signature = (depth = None, camera = None, world_from_camera = None, depth_scale = None, *, ranges = None,
                        sensor_model = None, colour = None, colour_camera = None, depth_from_colour = None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    fn integrate(
        &self,
        py: Python<'_>,
        depth: Option<&Bound<'_, PyAny>>,
        camera: Option<AnySensor>,
        world_from_camera: Option<&Bound<'_, PyAny>>,
        depth_scale: Option<f64>,
        ranges: Option<&Bound<'_, PyAny>>,
        sensor_model: Option<SensorModel>,
        colour: Option<&Bound<'_, PyAny>>,
        colour_camera: Option<PinholeCamera>,
        depth_from_colour: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<FrameStats> {
        let colour = ColourArguments { colour, colour_camera, depth_from_colour };
        let frame = FrameArguments { depth, camera, depth_scale, ranges, sensor_model, colour };
        let submitted =
            self.frame(py, frame, world_from_camera, |grid, image, sensor, pose| grid.submit(image, sensor, pose))?;
        Ok(FrameStats::of_submitted(submitted, &self.0))
    }

    /// Takes a frame back, exactly: the map is then as if it had never been fused.
    ///
    /// Args:
    ///     depth: The arguments that `integrate` had, in this map or in one merged into it.
    ///     camera: As before.
    ///     world_from_camera: As before.
    ///     depth_scale: As before.
    ///     ranges: As before.
    ///     sensor_model: As before.
    ///     colour: As before.
    ///     colour_camera: As before.
    ///     depth_from_colour: As before.
    ///
    /// Returns:
    ///     What the removal did, and the time it took.
    ///
    /// Raises:
    ///     TypeError: As for `integrate`.
    ///     ValueError: As for `integrate`; and if the map has a `clamp`, is `saturated`, or was decayed, cleared or cropped:
    ///         evidence is lost then.
    ///     MapFullError: As for `integrate`: what was never fused can be removed, and takes room.
    #[pyo3(signature = (depth = None, camera = None, world_from_camera = None, depth_scale = None, *, ranges = None,
                        sensor_model = None, colour = None, colour_camera = None, depth_from_colour = None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    fn remove(
        &self,
        py: Python<'_>,
        depth: Option<&Bound<'_, PyAny>>,
        camera: Option<AnySensor>,
        world_from_camera: Option<&Bound<'_, PyAny>>,
        depth_scale: Option<f64>,
        ranges: Option<&Bound<'_, PyAny>>,
        sensor_model: Option<SensorModel>,
        colour: Option<&Bound<'_, PyAny>>,
        colour_camera: Option<PinholeCamera>,
        depth_from_colour: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<FrameStats> {
        let colour = ColourArguments { colour, colour_camera, depth_from_colour };
        let frame = FrameArguments { depth, camera, depth_scale, ranges, sensor_model, colour };
        let stats =
            self.frame(py, frame, world_from_camera, |grid, image, sensor, pose| grid.remove(image, sensor, pose))?;
        Ok(FrameStats::known(stats))
    }

    /// Adds another map's evidence, and its colours: the result is the map of all frames of both.
    ///
    /// Args:
    ///     other: A map with the same voxel size, prior and clamp; one that keeps colours only if this one does. It stays
    ///         as it is.
    ///
    /// Raises:
    ///     ValueError: If one of those differs, or `other` is this map itself.
    ///     MapFullError: If the map would take more than `max_bytes`.
    fn merge(slf: &Bound<'_, Self>, other: &Bound<'_, Self>) -> PyResult<()> {
        if slf.is(other) {
            return Err(PyValueError::new_err("other is the map itself, expected another map"));
        }
        let (map, other) = (slf.get(), other.get());
        with_pool(slf.py(), |pool| {
            // In the order of their addresses, so that two maps merged into each other at the same time do not each
            // wait for the other.
            let (mut map, other) = if std::ptr::from_ref(map) < std::ptr::from_ref(other) {
                let map = map.write();
                (map, other.read()?)
            } else {
                let other = other.read()?;
                (map.write(), other)
            };
            let (map, other) = (&mut *map, &*other);
            pool.install(|| map.merge(other))
        })
    }

    /// Coordinates of all blocks of 8 x 8 x 8 voxels that hold something, sorted by x, then y, then z.
    ///
    /// Returns:
    ///     (B, 3) int32. Block (a, b, c) begins at voxel (8 a, 8 b, 8 c).
    fn block_coords<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        let keys = self.ask(py, |grid| Ok(grid.block_coords()))?;
        let count = keys.len();
        PyArray1::from_vec(py, keys.into_flattened()).reshape([count, 3])
    }

    /// Log-odds of whole blocks.
    ///
    /// Args:
    ///     coords: (B, 3) integers, coordinates of blocks; blocks that the map does not hold are unknown.
    ///
    /// Returns:
    ///     (B, 8, 8, 8) float32, axes x, y, z: as `log_odds` at the centres of the voxels, 0 where unknown.
    ///
    /// Raises:
    ///     ValueError: If shape or type are others, or a number exceeds 32 bits.
    fn block_log_odds<'py>(&self, coords: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray4<f32>>> {
        let keys = arrays::integers(coords, "coords")?;
        let values = self.ask(coords.py(), |grid| grid.block_log_odds(&keys))?;
        PyArray1::from_vec(coords.py(), values).reshape([keys.len(), BLOCK_EDGE, BLOCK_EDGE, BLOCK_EDGE])
    }

    /// The surface between occupied and free space, by marching cubes over the voxels' centres.
    ///
    /// Faces are drawn only among known voxels, so the surface ends where knowledge does. Where all is known it is
    /// closed. The same map gives the same mesh on any number of threads.
    ///
    /// Args:
    ///     level: Log-odds of the surface; 0 is a probability of one half.
    ///     min_evidence: Voxels whose log-odds without the prior are nearer to 0 than this count as unknown.
    ///     min_faces: Pieces of the surface with fewer faces are left out; faces that share an edge are of one piece.
    ///
    /// Returns:
    ///     The mesh, without vertices if there is no such surface; with colours if the map keeps any.
    ///
    /// Raises:
    ///     ValueError: If `level` is beyond what a map can hold, `min_evidence` is negative or not a number, or
    ///         `min_faces` is negative.
    #[pyo3(signature = (level = 0.0, min_evidence = 0.0, min_faces = 0))]
    fn mesh(&self, py: Python<'_>, level: f64, min_evidence: f64, min_faces: i64) -> PyResult<Mesh> {
        let min_faces = count("min_faces", min_faces, "0 or more")?;
        let options = MeshOptions { level, min_evidence, min_faces };
        let mesh = self.ask(py, |grid| pyramap::mesh::extract(grid, &options))?;
        Mesh::new(py, mesh)
    }

    /// Waits until all frames are in the map. Whatever reads the map does so itself.
    ///
    /// Raises:
    ///     MapFullError: If a frame that `integrate` had taken would make the map larger than `max_bytes`; the map is as
    ///         it was before that frame.
    ///     DeviceError: If the device fails.
    fn synchronize(&self, py: Python<'_>) -> PyResult<()> {
        self.property(py, |_| ())
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.property(py, |grid| {
            let (voxel_size, update) = (grid.config().voxel_size, word(grid.config().update, &UPDATES));
            let (frames, blocks) = (grid.num_frames(), grid.num_blocks());
            format!("OccupancyGrid(voxel_size={voxel_size}, update={update:?}, {frames} frames, {blocks} blocks)")
        })
    }
}
