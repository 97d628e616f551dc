//! Depth images against a naive ray caster, and against the signed distance.

mod common;

use common::{Random, back_project, cast, ray};
use nalgebra::Vector3;
use pyramap::{PinholeCamera, Pose};
use pyramap_scenes::{Scene, Solid, box_scene, nalgebra, office_loop, spheres};

/// Rendering and oracle differ by double rounding, which the silhouette of a sphere takes the root of (1e-8), and by
/// the rounding of the result to f32 (6e-8).
const RELATIVE: f64 = 2e-7;

fn assert_same(rendered: f32, expected: Option<f64>, context: &str) {
    let expected = expected.unwrap_or(0.0);
    let error = (f64::from(rendered) - expected).abs();
    assert!(error <= RELATIVE * expected, "{context}: rendered {rendered}, expected {expected}");
}

fn random_solid(random: &mut Random) -> Solid {
    let place = random.vector(-1.5, 1.5);
    match random.index(3) {
        0 => {
            let (sin, cos) = random.uniform(0.0, 6.0).sin_cos();
            Solid::Cuboid { centre: place, half: random.vector(0.05, 0.9), turn: [cos, sin] }
        }
        1 => Solid::sphere(place.into(), random.uniform(0.05, 0.9)),
        _ => Solid::Cylinder { base: place, radius: random.uniform(0.05, 0.9), height: random.uniform(0.1, 2.0) },
    }
}

#[test]
fn random_solids_agree_with_ray_casting_at_every_pixel() {
    let mut random = Random(1);
    let camera = PinholeCamera::new(61, 47, 40.0, 33.0, 25.2, 30.9).unwrap();
    let (mut hits, mut misses) = (0, 0);
    for _ in 0..300 {
        let solids: Vec<_> = (0..1 + random.index(20)).map(|_| random_solid(&mut random)).collect();
        let scene = Scene::new("random", solids, camera, vec![]);
        // Also from close by, where solids reach behind the camera.
        let eye = std::iter::repeat_with(|| random.vector(-2.0, 2.0));
        let eye = eye.take(1000).find(|eye| scene.signed_distance(&[*eye])[0] > 0.01).unwrap();
        let pose = random.pose(eye);
        let (depth, ranges) = (scene.render(&camera, &pose), scene.render_ranges(&camera, &pose));
        for v in 0..camera.height {
            for u in 0..camera.width {
                let expected = cast(scene.solids(), &camera, &pose, u, v);
                if expected.is_some() {
                    hits += 1
                } else {
                    misses += 1
                }
                let context = format!("({u}, {v}) of {:?}, {pose:?}", scene.solids());
                assert_same(depth[v * camera.width + u], expected, &context);
                // The oracle's rays are as long as they are deep.
                let range = expected.map(|depth| depth * ray(&camera, u, v).norm());
                assert_same(ranges[v * camera.width + u], range, &context);
            }
        }
    }
    assert!(hits > 50_000 && misses > 50_000, "{hits} hits, {misses} misses do not test much");
}

#[test]
fn scenes_agree_with_ray_casting_at_random_pixels() {
    let mut random = Random(2);
    for scene in [box_scene(), spheres(), office_loop()] {
        let camera = scene.camera();
        for _ in 0..60 {
            let frame = random.index(scene.poses().len());
            let pose = &scene.poses()[frame];
            let depth = scene.render(camera, pose);
            for _ in 0..100 {
                let (u, v) = (random.index(camera.width), random.index(camera.height));
                let expected = cast(scene.solids(), camera, pose, u, v);
                let context = format!("({u}, {v}) of frame {frame} of {}", scene.name());
                assert_same(depth[v * camera.width + u], expected, &context);
            }
        }
    }
}

#[test]
fn every_pixel_shows_a_point_on_a_surface() {
    let mut random = Random(3);
    for scene in [box_scene(), spheres(), office_loop()] {
        let camera = scene.camera();
        for pose in scene.poses().iter().step_by(7) {
            let depth = scene.render(camera, pose);
            assert!(depth.iter().all(|&z| z > 0.0), "the shell of {} has a hole", scene.name());
            let points: Vec<_> = (0..200)
                .map(|_| back_project(&depth, camera, pose, random.index(camera.width), random.index(camera.height)))
                .collect();
            for (point, distance) in points.iter().zip(scene.signed_distance(&points)) {
                // f32 depths of up to 23 m are rounded by up to 1e-6 m, on rays up to 1.3 times as long.
                assert!(distance.abs() < 2e-6, "{distance} at {point:?} in {}", scene.name());
            }
        }
    }
}

#[test]
fn the_seam_of_two_boxes_has_no_gap() {
    let mut random = Random(6);
    let camera = PinholeCamera::new(101, 3, 53.0, 53.0, 50.0, 1.0).unwrap();
    for _ in 0..3000 {
        let (seam, distance) = (random.uniform(-1.0, 1.0), random.uniform(0.3, 3.0));
        let left = Solid::cuboid([-9.0, -9.0, distance], [seam, 9.0, 10.0]);
        let right = Solid::cuboid([seam, -9.0, distance], [9.0, 9.0, 10.0]);
        let scene = Scene::new("seam", vec![left, right], camera, vec![]);
        // The ray of some column meets the seam but for rounding.
        let column = random.index(camera.width);
        let eye = Vector3::new(seam - ray(&camera, column, 1).x * distance, 0.0, 0.0);
        let depth = scene.render(&camera, &Pose { translation: eye, ..Pose::identity() });
        assert!(depth.iter().all(|&z| (f64::from(z) - distance).abs() < 1e-6), "column {column}, seam at {seam}");
    }
}

#[test]
fn a_solid_around_the_camera_is_not_drawn() {
    let camera = PinholeCamera::new(8, 6, 8.0, 8.0, 4.0, 3.0).unwrap();
    for solid in [
        Solid::cuboid([-1.0; 3], [1.0; 3]),
        Solid::sphere([0.0; 3], 1.0),
        Solid::Cylinder { base: Vector3::new(0.0, 0.0, -1.0), radius: 1.0, height: 2.0 },
    ] {
        let scene = Scene::new("inside", vec![solid], camera, vec![]);
        assert!(scene.render(&camera, &Pose::identity()).iter().all(|&z| z == 0.0));
    }
}
