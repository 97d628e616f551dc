//! The camera's path: once around a rectangle with rounded corners, the camera in the hand of someone who looks around.

use nalgebra::{Matrix3, Vector2, Vector3};
use pyramap::Pose;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

const FRAMES: usize = 684;
/// Metres once around.
const LENGTH: f64 = 60.0;
/// Middle lines of the corridors: the path lies between them and the corners.
const SOUTH_TO_NORTH: f64 = 10.0;
const CORNER_RADIUS: f64 = 1.0;
/// What is left of the length: a rounded corner saves `(2 - pi / 2) r`.
const WEST_TO_EAST: f64 = (LENGTH + 4.0 * (2.0 - FRAC_PI_2) * CORNER_RADIUS) / 2.0 - SOUTH_TO_NORTH;

/// The eye looks to where the path is this many metres ahead.
const LOOK_AHEAD: f64 = 2.0;

/// The first and the last pose are the same.
pub(super) fn poses() -> Vec<Pose> {
    (0..FRAMES).map(|frame| pose(LENGTH * frame as f64 / (FRAMES - 1) as f64)).collect()
}

/// The pose after `s` metres. Every wave has a whole number of periods a round.
fn pose(s: f64) -> Pose {
    let wave = |periods: f64, phase: f64| (TAU * periods * s / LENGTH + phase).sin();
    let here = on_path(s);
    let ahead = (on_path(s + LOOK_AHEAD) - here).normalize();
    let left = Vector2::new(-ahead.y, ahead.x);

    // One step is 0.7 m: the body swings to the side once in two steps and goes up and down with each.
    let position = here + left * (0.02 * wave(43.0, 0.0) + 0.04 * wave(5.0, 1.0));
    let height = 1.45 + 0.008 * wave(86.0, 0.5) + 0.03 * wave(4.0, 2.0);

    let pan = 0.62 * wave(9.0, 0.0) + 0.15 * wave(29.0, 1.3);
    let tilt = -0.2 + 0.17 * wave(7.0, 2.2) + 0.02 * wave(43.0, 0.4);
    let roll = 0.02 * wave(23.0, 0.9);
    let heading = ahead.y.atan2(ahead.x) + pan;
    let forward = Vector3::new(heading.cos() * tilt.cos(), heading.sin() * tilt.cos(), tilt.sin());
    let level = Vector3::new(heading.sin(), -heading.cos(), 0.0);
    let right = level * roll.cos() + forward.cross(&level) * roll.sin();
    let down = forward.cross(&right);
    Pose {
        rotation: Matrix3::from_columns(&[right, down, forward]),
        translation: Vector3::new(position.x, position.y, height),
    }
}

/// The point after `s` metres on the rounded rectangle, anticlockwise from the end of its south-west corner.
fn on_path(s: f64) -> Vector2<f64> {
    let quarter = FRAC_PI_2 * CORNER_RADIUS;
    let mut s = s.rem_euclid(LENGTH);
    let mut corner = Vector2::new(CORNER_RADIUS, 0.0);
    let mut heading = 0.0_f64;
    for side in [WEST_TO_EAST, SOUTH_TO_NORTH, WEST_TO_EAST, SOUTH_TO_NORTH] {
        let straight = side - 2.0 * CORNER_RADIUS;
        let along = Vector2::new(heading.cos(), heading.sin());
        let left = Vector2::new(-along.y, along.x);
        if s <= straight {
            return corner + along * s;
        }
        s -= straight;
        corner += along * straight;
        if s <= quarter {
            let turn = s / CORNER_RADIUS;
            return corner + (along * turn.sin() + left * (1.0 - turn.cos())) * CORNER_RADIUS;
        }
        s -= quarter;
        corner += (along + left) * CORNER_RADIUS;
        heading += PI / 2.0;
    }
    corner
}
