//! One frame's camera as the stages need it: where blocks and voxels lie in the camera's frame, and in its image.
//!
//! Block positions are taken into the camera's frame in `f64`, so that a map far from the world's origin is as exact as
//! one around it; what is added within a block is small, and `f32`.

use crate::block::{BLOCK_EDGE, BlockKey};
use crate::camera::PinholeCamera;
use crate::pose::Pose;
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

/// Camera, pose, voxel size and range of one frame.
#[derive(Clone, Debug)]
pub struct View {
    /// The camera's pose in the world.
    pub pose: Pose,
    /// Edge of a voxel, metres.
    pub voxel_size: f64,
    /// Farthest distance that is mapped, metres.
    pub max_range: f32,
    /// Columns and rows of the image.
    pub image: [f32; 2],
    /// Focal lengths.
    pub focal: [f32; 2],
    /// The principal point, counted from the image's border: half a pixel more than from the first pixel's centre.
    pub principal: [f32; 2],
    /// The sides of the frustum, left, right, top, bottom: a point in front of the camera is in the image where its
    /// products with all four are positive. They grow by one for each pixel into the image at one metre.
    pub sides: [[f32; 3]; 4],
    /// The distance at which a voxel is one pixel wide (Eq. 11).
    pub t_0: f64,
}

impl View {
    /// Gathers what the stages need to know of a frame.
    pub fn new(camera: &PinholeCamera, pose: &Pose, voxel_size: f64, max_range: f64) -> Self {
        let image = [camera.width as f32, camera.height as f32];
        let focal = [camera.fx as f32, camera.fy as f32];
        let principal = [(camera.cx + 0.5) as f32, (camera.cy + 0.5) as f32];
        Self {
            pose: *pose,
            voxel_size,
            max_range: max_range as f32,
            image,
            focal,
            principal,
            sides: [
                [focal[0], 0.0, principal[0]],
                [-focal[0], 0.0, image[0] - principal[0]],
                [0.0, focal[1], principal[1]],
                [0.0, -focal[1], image[1] - principal[1]],
            ],
            t_0: camera.focal_length() * voxel_size,
        }
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
