//! Change: `decay`, `clear`, `crop`, `reintegrate`, and what is recorded of them.

use crate::arrays;
use crate::camera::PinholeCamera;
use crate::colour::ColourArguments;
use crate::errors::to_py;
use crate::frame::FrameArguments;
use crate::grid::OccupancyGrid;
use crate::sensor::SensorModel;
use crate::sensors::AnySensor;
use crate::stats::FrameStats;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyramap::Pose;

/// The factor that Python asked for, in one of the two ways there are.
fn factor(factor: Option<f64>, half_life: Option<f64>, elapsed: Option<f64>) -> PyResult<f64> {
    match (factor, half_life, elapsed) {
        (Some(factor), None, None) => Ok(factor),
        (None, Some(half_life), Some(elapsed)) => pyramap::decay_factor(half_life, elapsed).map_err(to_py),
        _ => {
            let text = |value: Option<f64>| value.map_or("None".to_owned(), |value| value.to_string());
            Err(PyValueError::new_err(format!(
                "factor is {}, half_life {} and elapsed {}, expected either factor alone, or half_life and elapsed",
                text(factor),
                text(half_life),
                text(elapsed)
            )))
        }
    }
}

/// A pose among several, so that the error says which.
fn pose(value: Option<&Bound<'_, PyAny>>, name: &str) -> PyResult<Pose> {
    let missing = || PyValueError::new_err(format!("{name} is missing, expected a (4, 4) rigid transform"));
    let value = value.ok_or_else(missing)?;
    arrays::pose(value).map_err(|error| PyValueError::new_err(format!("{name}: {}", error.value(value.py()))))
}

#[pymethods]
impl OccupancyGrid {
    /// Weakens what the map knows: all evidence, or that of a region, is multiplied by a factor and rounded towards zero.
    ///
    /// What was seen long ago then counts less than what is seen now, and a voxel whose evidence comes to nothing is
    /// unknown again. Colours stay as they are. This never happens on its own. It is recorded (`num_decays`, `decay_product`, and in the file), and
    /// frames cannot be removed afterwards. A call that finds nothing to weaken is not recorded.
    ///
    /// Rounding takes at least one step of 2^-12 from the log-odds of each voxel at each call: decay once a second or a
    /// minute rather than once a frame, or the map forgets faster than the half-life says.
    ///
    /// Args:
    ///     factor: Between 0 and 1, both excluded.
    ///     region: Lowest and highest corner of a box, (2, 3) metres, as `bounds` gives it; infinite sides are allowed.
    ///         Voxels whose centres lie in it, the upper faces excluded, are weakened. Default: the whole map.
    ///     half_life: Instead of `factor`: the time after which half the evidence is left, seconds.
    ///     elapsed: With `half_life`: the time since the last decay, seconds. The factor is 0.5^(elapsed / half_life).
    ///
    /// Raises:
    ///     ValueError: If there is not either a factor or both times, one is out of its range, or the region has another
    ///         shape or no inside.
    ///     MapFullError: If the map would take more than `max_bytes`: a block that was one number and is partly in the
    ///         region takes a number a voxel.
    #[pyo3(signature = (factor = None, region = None, *, half_life = None, elapsed = None))]
    fn decay(
        &self,
        py: Python<'_>,
        factor: Option<f64>,
        region: Option<&Bound<'_, PyAny>>,
        half_life: Option<f64>,
        elapsed: Option<f64>,
    ) -> PyResult<()> {
        let factor = self::factor(factor, half_life, elapsed)?;
        let region = region.map(arrays::region).transpose()?;
        self.change(py, |grid| grid.decay(factor, region.as_ref()))
    }

    /// Forgets a region: its voxels are unknown again, and without colour.
    ///
    /// It is recorded (`num_erasures`, and in the file), and frames cannot be removed afterwards: in the region that would
    /// leave the opposite of what they said, and the map does not know which of them came after it was cleared. A call
    /// that finds nothing to forget is not recorded.
    ///
    /// Args:
    ///     region: Lowest and highest corner of a box, (2, 3) metres, as `bounds` gives it; infinite sides are allowed.
    ///         Voxels whose centres lie in it, the upper faces excluded, are forgotten.
    ///
    /// Raises:
    ///     ValueError: If the region has another shape or no inside.
    ///     MapFullError: As for `decay`.
    fn clear(&self, region: &Bound<'_, PyAny>) -> PyResult<()> {
        let corners = arrays::region(region)?;
        self.change(region.py(), |grid| grid.clear(&corners))
    }

    /// Forgets all but a region: with a box around the camera, after each frame, the map is a window that moves along.
    ///
    /// It is recorded, and frames cannot be removed afterwards, as for `clear`. The blocks outside are given back.
    ///
    /// Args:
    ///     region: Lowest and highest corner of a box, (2, 3) metres, as `bounds` gives it; infinite sides are allowed.
    ///         Voxels whose centres lie in it, the upper faces excluded, are kept.
    ///
    /// Raises:
    ///     ValueError: If the region has another shape or no inside.
    ///     MapFullError: As for `decay`; what is given up outside counts.
    fn crop(&self, region: &Bound<'_, PyAny>) -> PyResult<()> {
        let corners = arrays::region(region)?;
        self.change(region.py(), |grid| grid.crop(&corners))
    }

    /// Moves a frame to another pose, exactly: the map is then as if it had been fused there from the start.
    ///
    /// This is `remove` at the old pose and `integrate` at the new one, and where either fails the map is as before.
    ///
    /// Args:
    ///     depth: The depth image that `integrate` had.
    ///     camera: As before.
    ///     old_pose: The `world_from_camera` that `integrate` had.
    ///     new_pose: The one that it should have had.
    ///     depth_scale: As before.
    ///     ranges: As before.
    ///     sensor_model: As before.
    ///     colour: As before.
    ///     colour_camera: As before.
    ///     depth_from_colour: As before.
    ///
    /// Returns:
    ///     What the frame did at its new pose, and the time that took.
    ///
    /// Raises:
    ///     ValueError: As for `remove` and `integrate`; the message says which pose is meant.
    ///     MapFullError: If the map would take more than `max_bytes`.
    #[pyo3(signature = (depth = None, camera = None, old_pose = None, new_pose = None, depth_scale = None, *,
                        ranges = None, sensor_model = None, colour = None, colour_camera = None,
                        depth_from_colour = None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    fn reintegrate(
        &self,
        py: Python<'_>,
        depth: Option<&Bound<'_, PyAny>>,
        camera: Option<AnySensor>,
        old_pose: Option<&Bound<'_, PyAny>>,
        new_pose: Option<&Bound<'_, PyAny>>,
        depth_scale: Option<f64>,
        ranges: Option<&Bound<'_, PyAny>>,
        sensor_model: Option<SensorModel>,
        colour: Option<&Bound<'_, PyAny>>,
        colour_camera: Option<PinholeCamera>,
        depth_from_colour: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<FrameStats> {
        let colour = ColourArguments { colour, colour_camera, depth_from_colour };
        let frame = FrameArguments { depth, camera, depth_scale, ranges, sensor_model, colour }.check()?;
        let image = frame.image()?;
        let (old_pose, new_pose) = (pose(old_pose, "old_pose")?, pose(new_pose, "new_pose")?);
        let stats = self.change(py, |grid| grid.reintegrate(&image, &frame.sensor, &old_pose, &new_pose))?;
        Ok(FrameStats::known(stats))
    }

    /// How often the map was decayed, with the decays of maps merged into it.
    #[getter]
    fn num_decays(&self, py: Python<'_>) -> PyResult<u64> {
        self.ask(py, |grid| Ok(grid.history().decays))
    }

    /// The product of the factors of all decays, of regions too; 1.0 if there were none.
    #[getter]
    fn decay_product(&self, py: Python<'_>) -> PyResult<f64> {
        self.ask(py, |grid| Ok(grid.history().decay_product))
    }

    /// How often something was forgotten by `clear` or `crop`, with the times in maps merged into this one.
    #[getter]
    fn num_erasures(&self, py: Python<'_>) -> PyResult<u64> {
        self.ask(py, |grid| Ok(grid.history().erasures))
    }
}
