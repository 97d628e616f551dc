//! What the tests share: random numbers and a naive ray caster.

#![allow(dead_code, reason = "each test crate uses its own part")]

use nalgebra::{Rotation3, Vector3};
use pyramap::{PinholeCamera, Pose};
use pyramap_scenes::{Solid, nalgebra};

/// Knuth's linear congruential generator: good enough to scatter test inputs.
pub struct Random(pub u64);

impl Random {
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64)
    }

    pub fn index(&mut self, len: usize) -> usize {
        self.uniform(0.0, len as f64) as usize
    }

    pub fn vector(&mut self, low: f64, high: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.uniform(low, high))
    }

    pub fn pose(&mut self, translation: Vector3<f64>) -> Pose {
        let rotation = Rotation3::new(self.vector(-3.0, 3.0));
        Pose { rotation: *rotation.matrix(), translation }
    }
}

/// `K^-1 [u v 1]`.
pub fn ray(camera: &PinholeCamera, u: usize, v: usize) -> Vector3<f64> {
    Vector3::new((u as f64 - camera.cx) / camera.fx, (v as f64 - camera.cy) / camera.fy, 1.0)
}

/// The world point that a pixel of a depth image shows.
pub fn back_project(depth: &[f32], camera: &PinholeCamera, pose: &Pose, u: usize, v: usize) -> Vector3<f64> {
    pose.rotation * ray(camera, u, v) * f64::from(depth[v * camera.width + u]) + pose.translation
}

/// z-depth of the nearest hit, by intersecting the ray with each solid; `None` if there is none.
pub fn cast(solids: &[Solid], camera: &PinholeCamera, pose: &Pose, u: usize, v: usize) -> Option<f64> {
    let direction = pose.rotation * ray(camera, u, v);
    solids.iter().filter_map(|solid| entry(solid, &pose.translation, &direction)).min_by(f64::total_cmp)
}

/// The ray parameter at which `eye + t direction` enters a solid: the overlap of the stretches in which the ray is
/// between parallel planes, or within a quadric.
fn entry(solid: &Solid, eye: &Vector3<f64>, direction: &Vector3<f64>) -> Option<f64> {
    let stretches = match *solid {
        Solid::Cuboid { centre, half, turn: [cos, sin] } => {
            let unturn = Rotation3::from_axis_angle(&Vector3::z_axis(), -sin.atan2(cos));
            let (eye, direction) = (unturn * (eye - centre), unturn * direction);
            (0..3).map(|k| slab(eye[k], direction[k], -half[k], half[k])).collect()
        }
        Solid::Sphere { centre, radius } => {
            let eye = eye - centre;
            vec![quadric(direction.dot(direction), eye.dot(direction), eye.dot(&eye) - radius * radius)]
        }
        Solid::Cylinder { base, radius, height } => {
            let eye = eye - base;
            let (flat_eye, flat) = (eye.xy(), direction.xy());
            vec![
                quadric(flat.dot(&flat), flat_eye.dot(&flat), flat_eye.dot(&flat_eye) - radius * radius),
                slab(eye.z, direction.z, 0.0, height),
            ]
        }
    };
    let start = stretches.iter().map(|s| s[0]).fold(f64::NEG_INFINITY, f64::max);
    let end = stretches.iter().map(|s| s[1]).fold(f64::INFINITY, f64::min);
    (start < end && start > 0.0).then_some(start)
}

/// Where `low <= origin + t step <= high`.
fn slab(origin: f64, step: f64, low: f64, high: f64) -> [f64; 2] {
    let (a, b) = ((low - origin) / step, (high - origin) / step);
    [a.min(b), a.max(b)]
}

/// Where `a t^2 + 2 b t + c <= 0`.
fn quadric(a: f64, b: f64, c: f64) -> [f64; 2] {
    let root = (b * b - a * c).sqrt();
    if root.is_nan() { [f64::INFINITY, f64::NEG_INFINITY] } else { [(-b - root) / a, (-b + root) / a] }
}
