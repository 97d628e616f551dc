//! Signed distances against the nearest of many points scattered over the surface.

mod common;

use common::Random;
use nalgebra::Vector3;
use pyramap::PinholeCamera;
use pyramap_scenes::{Scene, Solid, nalgebra};

/// Points on the surface, none of it farther than `spacing` from the nearest.
fn surface_points(solid: &Solid, spacing: f64) -> Vec<Vector3<f64>> {
    // A point of the unit cube's surface, its cells no longer than 1 / n.
    let cube = |n: usize| {
        let steps = move || (0..=n).map(move |i| i as f64 / n as f64 * 2.0 - 1.0);
        let faces = move |a: f64, b: f64| [-1.0, 1.0].map(|c| [[a, b, c], [c, a, b], [b, c, a]]).concat();
        steps().flat_map(move |a| steps().flat_map(move |b| faces(a, b))).map(Vector3::from)
    };
    match *solid {
        Solid::Cuboid { centre, half, turn: [cos, sin] } => cube((2.0 * half.max() / spacing).ceil() as usize)
            .map(|p| p.component_mul(&half))
            .map(|p| centre + Vector3::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z))
            .collect(),
        Solid::Sphere { centre, radius } => {
            cube((2.0 * radius / spacing).ceil() as usize).map(|p| centre + p.normalize() * radius).collect()
        }
        Solid::Cylinder { base, radius, height } => {
            let n = (radius.max(height) * 7.0 / spacing).ceil() as usize;
            let fraction = |i: usize| i as f64 / n as f64;
            let mut points = Vec::new();
            for i in 0..=n {
                let (sin, cos) = (std::f64::consts::TAU * fraction(i)).sin_cos();
                for j in 0..=n {
                    points.push(base + Vector3::new(cos * radius, sin * radius, height * fraction(j)));
                    for z in [0.0, height] {
                        points.push(base + Vector3::new(cos * radius * fraction(j), sin * radius * fraction(j), z));
                    }
                }
            }
            points
        }
    }
}

/// Inside, by definition.
fn contains(solid: &Solid, point: &Vector3<f64>) -> bool {
    match *solid {
        Solid::Cuboid { centre, half, turn: [cos, sin] } => {
            let p = point - centre;
            let (x, y) = (p.dot(&Vector3::new(cos, sin, 0.0)), p.dot(&Vector3::new(-sin, cos, 0.0)));
            x.abs() < half.x && y.abs() < half.y && p.z.abs() < half.z
        }
        Solid::Sphere { centre, radius } => nalgebra::distance(&centre.into(), &(*point).into()) < radius,
        Solid::Cylinder { base, radius, height } => {
            let p = point - base;
            p.x.hypot(p.y) < radius && p.z > 0.0 && p.z < height
        }
    }
}

#[test]
fn each_solid_is_exact_inside_and_outside() {
    let mut random = Random(4);
    let spacing = 0.02;
    let solids = [
        Solid::cuboid([-0.3, -0.5, -0.2], [0.4, 0.1, 0.5]),
        Solid::Cuboid { centre: Vector3::new(0.1, 0.2, -0.1), half: Vector3::new(0.5, 0.2, 0.3), turn: [0.6, 0.8] },
        Solid::sphere([0.1, -0.2, 0.1], 0.6),
        Solid::Cylinder { base: Vector3::new(0.1, 0.0, -0.4), radius: 0.4, height: 0.9 },
    ];
    for solid in &solids {
        let surface = surface_points(solid, spacing);
        for _ in 0..200 {
            let point = random.vector(-1.0, 1.0);
            let nearest = surface.iter().map(|s| (s - point).norm()).fold(f64::INFINITY, f64::min);
            let distance = solid.signed_distance(&point);
            assert_eq!(distance < 0.0, contains(solid, &point), "sign at {point:?} of {solid:?}");
            // The nearest sample is no nearer than the surface, and no more than a spacing farther.
            let excess = nearest - distance.abs();
            assert!((-1e-12..spacing).contains(&excess), "{distance} at {point:?} of {solid:?}, nearest {nearest}");
        }
    }
}

#[test]
fn the_distance_to_a_union_is_exact_in_free_space_and_a_lower_bound_inside() {
    let mut random = Random(5);
    let spacing = 0.02;
    let solids = vec![
        Solid::cuboid([-0.6, -0.5, -0.5], [0.1, 0.1, 0.5]),
        Solid::sphere([0.2, 0.1, 0.1], 0.4),
        Solid::Cylinder { base: Vector3::new(-0.4, 0.3, -0.4), radius: 0.3, height: 0.9 },
    ];
    let visible = |s: &Vector3<f64>| !solids.iter().any(|solid| solid.signed_distance(s) < -1e-9);
    let surface: Vec<_> = solids.iter().flat_map(|solid| surface_points(solid, spacing)).filter(visible).collect();
    let points: Vec<_> = (0..500).map(|_| random.vector(-0.8, 0.8)).collect();
    let camera = PinholeCamera::new(1, 1, 1.0, 1.0, 0.0, 0.0).unwrap();
    let scene = Scene::new("union", solids.clone(), camera, vec![]);
    let mut inside = 0;
    for (point, distance) in points.iter().zip(scene.signed_distance(&points)) {
        let nearest = surface.iter().map(|s| (s - point).norm()).fold(f64::INFINITY, f64::min);
        assert_eq!(distance < 0.0, solids.iter().any(|solid| contains(solid, point)));
        assert!(distance.abs() <= nearest + 1e-9);
        if distance >= 0.0 {
            assert!(nearest - distance < spacing, "{distance} at {point:?}, nearest {nearest}");
        } else {
            inside += 1;
        }
    }
    assert!((50..450).contains(&inside), "{inside} points inside do not test both sides");
}

#[test]
fn without_solids_or_without_a_place_there_is_no_distance() {
    let camera = PinholeCamera::new(1, 1, 1.0, 1.0, 0.0, 0.0).unwrap();
    let empty = Scene::new("empty", vec![], camera, vec![]);
    assert_eq!(empty.signed_distance(&[Vector3::zeros()]), [f64::INFINITY]);
    let ball = Scene::new("ball", vec![Solid::sphere([0.0; 3], 1.0)], camera, vec![]);
    let nowhere = [Vector3::new(f64::NAN, 0.0, 0.0), Vector3::new(0.0, f64::INFINITY, 0.0)];
    assert!(ball.signed_distance(&nowhere).iter().all(|d| d.is_nan()));
}
