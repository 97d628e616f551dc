//! Frames of points instead of images.

use super::{Frame, OccupancyGrid};
use crate::error::{Error, Result};
use crate::pose::Pose;
use crate::stats::FrameStats;
use crate::update::UpdateRule;

impl OccupancyGrid {
    /// Fuses points, metres, in the frame of a sensor at a pose (`world_from_sensor`): whole, or not at all. Only a map of
    /// the rule [`UpdateRule::Rays`] takes points; the others read images. Points that are not finite say nothing.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if the map has another rule; if no point says anything, the pose is out of bounds, or the
    /// map is full.
    pub fn integrate_points(&mut self, points: &[[f64; 3]], pose: &Pose) -> Result<FrameStats> {
        if self.config.update != UpdateRule::Rays {
            let reason = format!("the map has the update rule {:?}, and only Rays takes points", self.config.update);
            return Err(Error::Unsupported { operation: "integrate_points", reason });
        }
        self.synchronize()?;
        self.check_position(pose, 0.0)?;
        self.backend.see_points(&self.config, points, pose)?;
        self.finish(Frame::new(1))
    }
}
