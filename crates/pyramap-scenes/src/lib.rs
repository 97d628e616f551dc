//! Simulated scenes with exact truth: depth images, camera paths and signed distances, to test and show pyramap.
//!
//! ```
//! use pyramap_scenes::{nalgebra::Vector3, spheres};
//!
//! let scene = spheres();
//! let camera = scene.camera();
//! let depth = scene.render(camera, &scene.poses()[0]);
//!
//! // The point that the middle of the image shows lies on a surface.
//! let (u, v) = (camera.width / 2, camera.height / 2);
//! let z = f64::from(depth[v * camera.width + u]);
//! let point = Vector3::new((u as f64 - camera.cx) / camera.fx * z, (v as f64 - camera.cy) / camera.fy * z, z);
//! let pose = &scene.poses()[0];
//! let distance = scene.signed_distance(&[pose.rotation * point + pose.translation]);
//! assert!(distance[0].abs() < 1e-6);
//! ```

mod cast;
mod kinect;
mod office;
mod render;
mod rotation_scenes;
mod scene;
mod solid;

pub use kinect::{KINECT_RANGE, kinect_noise};
pub use nalgebra;
pub use office::office_loop;
pub use rotation_scenes::{box_scene, spheres};
pub use scene::Scene;
pub use solid::Solid;
