//! One frame's sensor as the stages need it: where blocks and voxels lie in the sensor's frame, and in its image.
//!
//! Block positions are taken into the camera's frame in `f64`, so that a map far from the world's origin is as exact as
//! one around it; what is added within a block is small, and `f32`.

use crate::block::{BLOCK_EDGE, BlockKey};
use crate::pose::Pose;
use crate::sensors::Projection;
use nalgebra::Vector3;

/// Values of eight voxels, or of eight corners.
pub type Lanes = [f32; 8];

/// Eight points in the camera's frame, metres.
#[derive(Clone, Copy, Debug)]
pub struct Points {
    /// To the right.
    pub x: Lanes,
    /// Down.
    pub y: Lanes,
    /// Forward.
    pub z: Lanes,
}

/// Sensor, pose, voxel size and range of one frame.
#[derive(Clone, Debug)]
pub struct View<P> {
    /// How the sensor sees.
    pub projection: P,
    /// The sensor's pose in the world.
    pub pose: Pose,
    /// Edge of a voxel, metres.
    pub voxel_size: f64,
    /// Farthest range that is mapped, metres.
    pub max_range: f32,
    /// The distance at which a voxel is one pixel wide (Eq. 11).
    pub t_0: f64,
}

impl<P: Projection> View<P> {
    /// Gathers what the stages need to know of a frame.
    pub fn new(projection: P, pose: &Pose, voxel_size: f64, max_range: f64) -> Self {
        let t_0 = projection.focal_length() * voxel_size;
        Self { projection, pose: *pose, voxel_size, max_range: max_range as f32, t_0 }
    }

    /// The centre of a cube of `edge` blocks whose first block is `key`, relative to the camera, along the world's axes.
    pub fn offset_of(&self, key: BlockKey, edge: i32) -> Vector3<f64> {
        let blocks = Vector3::from(key).map(|k| f64::from(k) + 0.5 * f64::from(edge));
        blocks * (BLOCK_EDGE as f64 * self.voxel_size) - self.pose.translation
    }

    /// A vector along the world's axes in the camera's frame.
    pub fn to_camera(&self, vector: &Vector3<f64>) -> [f32; 3] {
        let camera = self.pose.rotation.transpose() * vector;
        [camera.x as f32, camera.y as f32, camera.z as f32]
    }

    /// Eight vectors, given in voxels along the world's axes, in the camera's frame.
    pub fn voxel_offsets(&self, offset: impl Fn(usize) -> [f64; 3]) -> Points {
        let lanes =
            std::array::from_fn::<_, 8, _>(|lane| self.to_camera(&(Vector3::from(offset(lane)) * self.voxel_size)));
        Points { x: lanes.map(|p| p[0]), y: lanes.map(|p| p[1]), z: lanes.map(|p| p[2]) }
    }
}

impl Points {
    /// These points moved by one vector.
    #[inline(always)]
    pub fn moved(&self, by: [f32; 3]) -> Self {
        let add = |lanes: &Lanes, d: f32| -> Lanes { std::array::from_fn(|i| lanes[i] + d) };
        Self { x: add(&self.x, by[0]), y: add(&self.y, by[1]), z: add(&self.z, by[2]) }
    }

    /// The point in one lane.
    #[inline(always)]
    pub fn lane(&self, i: usize) -> [f32; 3] {
        [self.x[i], self.y[i], self.z[i]]
    }
}
