//! An office: a ring of corridors and a large meeting room, walked once around with a Kinect in the hand.
//!
//! World: x and y on the floor, z up. The walls are in `plan`, what stands in the rooms in `furniture`, the camera's
//! path in `walk`; `builder` places boxes relative to a wall or a piece of furniture.

mod builder;
mod fixtures;
mod furniture;
mod plan;
mod walk;

use crate::scene::Scene;
use pyramap::PinholeCamera;

/// Corridors of 2 m width and a meeting room of 8.5 x 13 m with furniture, doors, windows and pictures, walked in a
/// closed loop of 60 m: 684 poses at 1.45 m height for a Kinect of 640 x 480 pixels.
pub fn office_loop() -> Scene {
    let camera = PinholeCamera::new(640, 480, 585.0, 585.0, 320.0, 240.0).expect("valid intrinsics");
    Scene::new("office_loop", plan::solids(), camera, walk::poses())
}
