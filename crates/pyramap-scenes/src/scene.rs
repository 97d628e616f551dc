//! A scene: solids, the camera that looks at them, and the path of the camera.

use crate::cast::cast;
use crate::render::render;
use crate::solid::Solid;
use nalgebra::Vector3;
use pyramap::{PinholeCamera, Pose, Sensor};
use rayon::prelude::*;

/// A union of solids in metres, with a camera and its poses. All that is not inside a solid is free space.
#[derive(Clone, Debug)]
pub struct Scene {
    pub(crate) name: &'static str,
    pub(crate) solids: Vec<Solid>,
    pub(crate) camera: PinholeCamera,
    pub(crate) poses: Vec<Pose>,
}

impl Scene {
    /// A scene of your own.
    pub fn new(name: &'static str, solids: Vec<Solid>, camera: PinholeCamera, poses: Vec<Pose>) -> Self {
        Self { name, solids, camera, poses }
    }

    /// What the scene is called.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The camera that `poses` are made for.
    pub fn camera(&self) -> &PinholeCamera {
        &self.camera
    }

    /// `world_from_camera` of each view, in order.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// The bodies that the scene is made of.
    pub fn solids(&self) -> &[Solid] {
        &self.solids
    }

    /// The exact depth image: z-depth in metres at each pixel centre, row by row, `0` where no surface is hit.
    ///
    /// The camera should be in free space: a solid that contains it is not drawn.
    pub fn render(&self, camera: &PinholeCamera, world_from_camera: &Pose) -> Vec<f32> {
        if camera.lens().is_none() {
            return render(&self.solids, camera, world_from_camera);
        }
        let mut depth = self.render_ranges(camera, world_from_camera);
        let pixels = (0..camera.height).flat_map(|v| (0..camera.width).map(move |u| (u, v)));
        for (depth, (u, v)) in depth.iter_mut().zip(pixels) {
            // No range is measured where there is no ray, and 0 stays 0.
            let range_per_depth = camera.range_per_depth(u as f64, v as f64).max(1.0);
            *depth = (f64::from(*depth) / range_per_depth) as f32;
        }
        depth
    }

    /// Exact ranges of any sensor: distance in metres along the ray of each pixel, row by row, `0` where no surface is hit.
    ///
    /// The sensor should be in free space, as for [`Scene::render`].
    pub fn render_ranges(&self, sensor: impl Into<Sensor>, world_from_sensor: &Pose) -> Vec<f32> {
        cast(&self.solids, &sensor.into(), world_from_sensor)
    }

    /// Signed distance from each point to the surface, metres: positive in free space, negative inside solids.
    ///
    /// In free space it is exact. Inside, the sign is exact and the magnitude is the depth within one solid, the
    /// largest of those that contain the point: that is a lower bound of the distance to free space, and equal to it
    /// where no other solid covers the surface point that is nearest. A scene without solids is `+inf` everywhere, and
    /// a point that is not finite gives NaN.
    pub fn signed_distance(&self, points: &[Vector3<f64>]) -> Vec<f64> {
        let distance = |point: &Vector3<f64>| {
            if !point.iter().all(|c| c.is_finite()) {
                return f64::NAN;
            }
            self.solids.iter().map(|solid| solid.signed_distance(point)).fold(f64::INFINITY, f64::min)
        };
        points.par_iter().with_min_len(256).map(distance).collect()
    }
}
