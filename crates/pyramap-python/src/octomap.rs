//! OctoMap: its files, and its update rule's points.

use crate::arrays;
use crate::devices::Choice;
use crate::grid::OccupancyGrid;
use crate::stats::FrameStats;
use crate::threads::run;
use pyo3::prelude::*;
use pyramap::log_odds;
use std::path::PathBuf;

/// OctoMap's clamping limits, log-odds: those of probabilities 0.1192 and 0.971.
pub fn octomap_clamp() -> (f64, f64) {
    pyramap::octomap::CLAMP.map(log_odds::from_probability).into()
}

/// Reads a map from a ".bt" or ".ot" file of OctoMap.
///
/// Voxels are those of the file; pruned leaves are expanded, and what has no node is unknown. Log-odds of an ".ot" are
/// rounded to multiples of 2^-12. A ".bt" says no more than free or occupied: its voxels get OctoMap's clamping limits.
/// A leaf of log-odds 0, which OctoMap calls occupied and which would be unknown here, becomes 2^-12. Colours of a
/// "ColorOcTree" are left out.
///
/// All other parameters are the constructor's defaults, with `max_range` brought into what it may be for voxels of that
/// size. To go on with others, `merge` the map into one that has them.
///
/// Args:
///     path: A str or a path. What the file holds is read from its first line, not from its name.
///     backend: As for `OccupancyGrid`.
///     clamp: As for `OccupancyGrid`; what lies beyond is brought to the bounds. OctoMap's own are `OCTOMAP_CLAMP`. By
///         default the map has none: what the file holds stays as it is, and new frames add to it without bounds.
///     adapter: As for `OccupancyGrid`.
///
/// Raises:
///     OSError: If the file cannot be read (FileNotFoundError, PermissionError), is no octree of OctoMap, is cut off or
///         damaged so that it shows, or comes to more than 2^24 blocks of 8 x 8 x 8 voxels; the message names the file.
///     ValueError: If there is no such backend, or `clamp` is out of its range.
///     DeviceError: If a GPU is asked for and there is none that can be used.
#[pyfunction]
#[pyo3(signature = (path, backend = "auto", clamp = None, adapter = None))]
pub fn load_octomap(
    py: Python<'_>,
    path: PathBuf,
    backend: &str,
    clamp: Option<(f64, f64)>,
    adapter: Option<String>,
) -> PyResult<OccupancyGrid> {
    let device = Choice::parse(py, backend, adapter)?;
    let empty = |mut config: pyramap::GridConfig| {
        config.clamp = clamp;
        device.empty(config)
    };
    run(py, || pyramap::OccupancyGrid::load_octomap_on(path, empty)).map(OccupancyGrid::new_shared)
}

#[pymethods]
impl OccupancyGrid {
    /// Writes the map for OctoMap and what builds on it: RViz, MoveIt, octovis.
    ///
    /// ".ot" keeps all log-odds, the prior's included, beyond OctoMap's clamping limits too. ".bt" keeps whether voxels
    /// are free or occupied, in two bits a node. Eight equal leaves are written as one. Of the map's parameters only the
    /// voxel size is kept.
    ///
    /// The path holds the whole new file or what was there before.
    ///
    /// Args:
    ///     path: A str or a path that ends in ".bt" or ".ot".
    ///
    /// Raises:
    ///     ValueError: If the path ends in something else, or the map goes farther than OctoMap's keys: 32768 voxels from
    ///         the origin along each axis.
    ///     OSError: If the file cannot be written; the message names it.
    fn save_octomap(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        self.ask(py, |grid| grid.save_octomap(path))
    }

    /// Fuses a point cloud into a map of the update rule "rays": whole, or not at all.
    ///
    /// A ray goes from the sensor to each point: what it passes is free, the voxel in which it ends occupied. Points
    /// beyond `max_range` mean what `beyond_max_range` says; points that are not finite say nothing.
    ///
    /// Args:
    ///     points: (N, 3) metres, in the sensor's frame.
    ///     world_from_sensor: (4, 4) rigid transform, metres, as `world_from_camera` of `integrate`.
    ///
    /// Returns:
    ///     What the frame did, and the time it took.
    ///
    /// Raises:
    ///     ValueError: If the map has another update rule, the shape is another, no point says anything, the pose is not
    ///         finite or not rigid, or the sensor lies more than 32768 voxels less `max_range` from the origin.
    ///     MapFullError: If the map would take more than `max_bytes`.
    fn integrate_points(
        &self,
        points: &Bound<'_, PyAny>,
        world_from_sensor: &Bound<'_, PyAny>,
    ) -> PyResult<FrameStats> {
        let py = points.py();
        let (points, pose) = (arrays::points(points)?, arrays::pose(world_from_sensor)?);
        self.change(py, |grid| grid.integrate_points(&points, &pose)).map(FrameStats::known)
    }
}
