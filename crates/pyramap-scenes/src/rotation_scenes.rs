//! The paper's two simulated rooms, seen by a camera that turns in place.
//!
//! The world's axes are those of the camera in its first pose: x right, y down, z forward; its centre is the origin.
//! It is off the middle of the room, and nothing lies at a round number of metres: a voxel grid gets no favours.

use crate::scene::Scene;
use crate::solid::Solid;
use nalgebra::{Matrix3, Rotation3, Vector3};
use pyramap::{PinholeCamera, Pose};

/// The first pose, then a full turn about each of two axes in steps of this many degrees.
const STEP_DEGREES: usize = 4;

const WALL: f64 = 0.2;

/// A room of 10.8 x 8.3 x 11.2 m (x, y, z) with six cubes of 1 m at different depths; 181 views of 400 x 400 pixels.
pub fn box_scene() -> Scene {
    let mut solids = room([-5.573, -4.041, -5.827], [10.8, 8.3, 11.2]);
    let cube = |[x, y, z]: [f64; 3]| Solid::cuboid([x, y, z], [x + 1.0, y + 1.0, z + 1.0]);
    solids.extend([
        cube([-1.37, 0.12, 2.03]),
        cube([0.44, -1.21, 2.71]),
        cube([-1.62, -1.83, 3.57]),
        cube([0.83, 0.57, 4.11]),
        cube([-4.11, -0.36, 0.33]),
        cube([0.69, -0.67, -3.88]),
    ]);
    Scene::new("box", solids, turning_camera(), turning_poses())
}

/// A room of 2.2 x 2.1 x 2 m (x, y, z) with a box and four spheres of different sizes; 181 views of 400 x 400 pixels.
pub fn spheres() -> Scene {
    let mut solids = room([-1.133, -1.017, -0.911], [2.2, 2.1, 2.0]);
    solids.extend([
        Solid::cuboid([-0.373, 0.331, 0.512], [0.081, 1.083, 0.927]),
        Solid::sphere([-0.17, 0.16, 0.71], 0.17),
        Solid::sphere([0.35, -0.11, 0.84], 0.25),
        Solid::sphere([-0.72, 0.11, -0.08], 0.31),
        Solid::sphere([0.14, 0.72, -0.33], 0.22),
    ]);
    Scene::new("spheres", solids, turning_camera(), turning_poses())
}

/// Six solid walls around a free space. Each covers the edges of its neighbours.
fn room([x0, y0, z0]: [f64; 3], [width, height, depth]: [f64; 3]) -> Vec<Solid> {
    let (x1, y1, z1) = (x0 + width, y0 + height, z0 + depth);
    let (a, b) = ([x0 - WALL, y0 - WALL, z0 - WALL], [x1 + WALL, y1 + WALL, z1 + WALL]);
    vec![
        Solid::cuboid(a, [x0, b[1], b[2]]),
        Solid::cuboid([x1, a[1], a[2]], b),
        Solid::cuboid(a, [b[0], y0, b[2]]),
        Solid::cuboid([a[0], y1, a[2]], b),
        Solid::cuboid(a, [b[0], b[1], z0]),
        Solid::cuboid([a[0], a[1], z1], b),
    ]
}

fn turning_camera() -> PinholeCamera {
    PinholeCamera::new(400, 400, 400.0, 400.0, 200.0, 200.0).expect("valid intrinsics")
}

/// The start, a full turn about the camera's x axis, a full turn about its y axis.
fn turning_poses() -> Vec<Pose> {
    let turn = |axis| {
        (STEP_DEGREES..=360).step_by(STEP_DEGREES).map(move |degrees| {
            let rotation = Rotation3::from_axis_angle(&axis, (degrees as f64).to_radians());
            Pose { rotation: *rotation.matrix(), translation: Vector3::zeros() }
        })
    };
    let start = Pose { rotation: Matrix3::identity(), translation: Vector3::zeros() };
    std::iter::once(start).chain(turn(Vector3::x_axis())).chain(turn(Vector3::y_axis())).collect()
}
