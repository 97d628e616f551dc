//! What the three scenes promise: sizes, objects, paths.

mod common;

use common::{back_project, ray};
use nalgebra::{Matrix3, Rotation3, Vector3};
use pyramap::Pose;
use pyramap_scenes::{Scene, Solid, box_scene, kinect_noise, nalgebra, office_loop, spheres};

/// Walks from `start` along `direction` through free space to a surface.
fn free_length(scene: &Scene, start: Vector3<f64>, direction: Vector3<f64>) -> f64 {
    let mut length = 0.0;
    for _ in 0..1000 {
        let step = scene.signed_distance(&[start + direction * length])[0];
        length += step;
        if step < 1e-12 {
            return length;
        }
    }
    panic!("no surface in that direction");
}

fn interior(scene: &Scene) -> Vector3<f64> {
    // No object crosses the lines through this point along the axes.
    let start = Vector3::new(0.0, -0.6, 0.0);
    Vector3::from_fn(|axis, _| {
        let direction = Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)));
        free_length(scene, start, direction) + free_length(scene, start, -direction)
    })
}

/// Objects that stand in the room, after the six walls.
fn objects(scene: &Scene) -> &[Solid] {
    &scene.solids()[6..]
}

/// Pixels of a view on each object.
fn pixels_on_objects(scene: &Scene, pose: &Pose) -> Vec<usize> {
    let camera = scene.camera();
    let depth = scene.render(camera, pose);
    let mut pixels = vec![0; objects(scene).len()];
    for v in (0..camera.height).step_by(4) {
        for u in (0..camera.width).step_by(4) {
            let point = back_project(&depth, camera, pose, u, v);
            if let Some(hit) = objects(scene).iter().position(|solid| solid.signed_distance(&point).abs() < 1e-6) {
                pixels[hit] += 16;
            }
        }
    }
    pixels
}

#[test]
fn the_papers_rooms_have_its_sizes_and_objects() {
    assert!((interior(&box_scene()) - Vector3::new(10.8, 8.3, 11.2)).amax() < 1e-9);
    assert!((interior(&spheres()) - Vector3::new(2.2, 2.1, 2.0)).amax() < 1e-9);

    let scene = box_scene();
    assert_eq!(objects(&scene).len(), 6);
    let mut fronts = Vec::new();
    for solid in objects(&scene) {
        let Solid::Cuboid { centre, half, .. } = solid else { panic!("{solid:?} is no cube") };
        assert!((half - Vector3::repeat(0.5)).amax() < 1e-12);
        fronts.push(centre.z);
    }
    fronts.sort_by(f64::total_cmp);
    assert!(fronts.windows(2).all(|pair| pair[1] - pair[0] > 0.3), "cubes at {fronts:?} m");

    let scene = spheres();
    let kinds = |scene: &Scene| objects(scene).iter().filter(|solid| matches!(solid, Solid::Sphere { .. })).count();
    assert_eq!((kinds(&scene), objects(&scene).len()), (4, 5));
}

#[test]
fn the_central_camera_sees_every_object_and_touches_none() {
    for (scene, in_first_view, clearance) in [(box_scene(), 4, 1.0), (spheres(), 3, 0.35)] {
        assert!(scene.signed_distance(&[scene.poses()[0].translation])[0] > clearance);
        let first = pixels_on_objects(&scene, &scene.poses()[0]);
        assert!(first.iter().filter(|&&n| n > 2000).count() >= in_first_view, "{} shows {first:?}", scene.name());
        let mut most = vec![0; first.len()];
        for pose in scene.poses().iter().step_by(3) {
            for (most, pixels) in most.iter_mut().zip(pixels_on_objects(&scene, pose)) {
                *most = pixels.max(*most);
            }
        }
        assert!(most.iter().all(|&n| n > 5000), "{} shows at most {most:?}", scene.name());
    }
}

#[test]
fn the_turning_camera_makes_181_views() {
    for scene in [box_scene(), spheres()] {
        let camera = scene.camera();
        assert_eq!((camera.width, camera.height), (400, 400));
        assert_eq!([camera.fx, camera.fy, camera.cx, camera.cy], [400.0, 400.0, 200.0, 200.0]);
        let poses = scene.poses();
        assert_eq!(poses.len(), 181);
        assert_eq!(poses[0], Pose::identity());
        for (start, axis) in [(0, Vector3::x_axis()), (90, Vector3::y_axis())] {
            for step in 1..=90 {
                let pose = &poses[start + step];
                let expected = Rotation3::from_axis_angle(&axis, (4.0 * step as f64).to_radians());
                assert!((pose.rotation - expected.matrix()).amax() < 1e-12);
                assert_eq!(pose.translation, Vector3::zeros());
            }
        }
    }
}

#[test]
fn the_office_is_walked_once_around_60_metres() {
    let scene = office_loop();
    let poses = scene.poses();
    assert_eq!(poses.len(), 684);
    assert_eq!((scene.camera().width, scene.camera().height), (640, 480));
    assert!((poses[0].translation - poses[683].translation).norm() < 1e-9);
    let length: f64 = poses.windows(2).map(|pair| (pair[1].translation - pair[0].translation).norm()).sum();
    assert!((length / 60.0 - 1.0).abs() < 0.02, "{length} m");
    for pose in poses {
        assert!((1.4..1.5).contains(&pose.translation.z));
        assert!((pose.rotation.transpose() * pose.rotation - Matrix3::identity()).amax() < 1e-12);
        assert!((pose.rotation.determinant() - 1.0).abs() < 1e-12);
        // Upright: the camera's y axis points down.
        assert!(pose.rotation[(2, 1)] < -0.8);
    }
    for pair in poses.windows(2) {
        assert!((pair[1].translation - pair[0].translation).norm() < 0.12);
        let turn = Rotation3::from_matrix_unchecked(pair[0].rotation.transpose() * pair[1].rotation).angle();
        assert!(turn.to_degrees() < 8.0, "{} degrees from one frame to the next", turn.to_degrees());
    }
}

#[test]
fn the_walk_keeps_clear_of_everything() {
    let scene = office_loop();
    // Between two poses too: five points on each step.
    let eyes: Vec<_> = scene
        .poses()
        .windows(2)
        .flat_map(|pair| (0..5).map(|i| pair[0].translation.lerp(&pair[1].translation, f64::from(i) / 5.0)))
        .collect();
    let clearance = scene.signed_distance(&eyes).into_iter().fold(f64::INFINITY, f64::min);
    assert!(clearance > 0.3, "{clearance} m");
}

#[test]
fn a_kinect_reads_most_of_the_office() {
    let scene = office_loop();
    let camera = scene.camera();
    let mut read = 0;
    let frames: Vec<_> = (0..684).step_by(19).collect();
    for &frame in &frames {
        let noisy = kinect_noise(&scene.render(camera, &scene.poses()[frame]), camera, frame as u64).unwrap();
        let valid = noisy.iter().filter(|&&z| z > 0.0).count();
        assert!(valid > noisy.len() / 4, "frame {frame} has {valid} readings");
        read += valid;
    }
    let share = read as f64 / (frames.len() * camera.width * camera.height) as f64;
    assert!((0.6..0.97).contains(&share), "{share} of all pixels have a reading");
}

#[test]
fn corridors_are_two_metres_wide() {
    let scene = office_loop();
    // At points of the four stretches where nothing stands or hangs on the walls, above the baseboards.
    for (point, across) in [([2.0, 0.0, 0.5], [0.0, 1.0, 0.0]), ([0.0, 4.3, 2.5], [1.0, 0.0, 0.0])] {
        let (point, across) = (Vector3::from(point), Vector3::from(across));
        let width = free_length(&scene, point, across) + free_length(&scene, point, -across);
        assert!((width - 2.0).abs() < 1e-9, "{width} m at {point:?}");
    }
}

#[test]
fn the_image_axes_are_right_down_forward() {
    // A small ball to the right, below and ahead of the camera shows at the right and below the middle.
    let scene = box_scene();
    let camera = scene.camera();
    let ball = Scene::new("ball", vec![Solid::sphere([0.5, 0.3, 2.0], 0.05)], *camera, vec![]);
    let depth = ball.render(camera, &Pose::identity());
    let (u, v) = (300, 260);
    assert!((ray(camera, u, v) * 2.0 - Vector3::new(0.5, 0.3, 2.0)).norm() < 1e-12);
    assert!((f64::from(depth[v * camera.width + u]) - 1.95).abs() < 0.01);
}
