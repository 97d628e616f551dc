//! The noise model on planes and steps whose readings are known.

mod common;

use common::ray;
use nalgebra::Vector3;
use pyramap::{Error, PinholeCamera};
use pyramap_scenes::{KINECT_RANGE, kinect_noise, nalgebra, office_loop};

/// Pixels times metres: 585 pixels and 0.075 m.
const DISPARITY: f64 = 43.875;

fn camera() -> PinholeCamera {
    PinholeCamera::new(640, 480, 585.0, 585.0, 320.0, 240.0).unwrap()
}

fn image(depth_at: impl Fn(usize, usize) -> f64) -> Vec<f32> {
    let camera = camera();
    (0..camera.height)
        .flat_map(|v| (0..camera.width).map(move |u| (u, v)))
        .map(|(u, v)| depth_at(u, v) as f32)
        .collect()
}

fn readings(depth: &[f32], seed: u64) -> Vec<f32> {
    kinect_noise(depth, &camera(), seed).unwrap()
}

fn share_read(depth: &[f32]) -> f64 {
    readings(depth, 1).iter().filter(|&&z| z > 0.0).count() as f64 / depth.len() as f64
}

/// Mean and standard deviation.
fn moments(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (mean, (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt())
}

#[test]
fn noise_grows_with_depth_as_published() {
    for (z, sigma) in [(1.0, 0.001_884), (2.0, 0.006_064), (4.0, 0.025_824)] {
        let noisy = readings(&image(|_, _| z), 7);
        let (mean, deviation) = moments(&noisy.iter().map(|&z| f64::from(z)).collect::<Vec<_>>());
        // Rounding to steps of z^2 / (8 D) adds the variance of a uniform step. With 307,200 samples the deviation is
        // known to 0.13 %; Sheppard's correction holds to a few % where a step is 1.5 sigma wide (z = 1, 2).
        let step = z * z / (8.0 * DISPARITY);
        let expected = (sigma * sigma + step * step / 12.0).sqrt();
        assert!((deviation / expected - 1.0).abs() < 0.05, "at {z} m: {deviation}, expected {expected}");
        // 1 / z is convex: the mean moves by a few variances over z, and by what rounding leaves of a step.
        assert!((mean - z).abs() < 0.05 * step + 3.0 * expected * expected / z, "mean {mean} at {z} m");
    }
}

#[test]
fn disparity_comes_in_eighths_of_a_pixel() {
    let scene = office_loop();
    let depth = scene.render(&camera(), &scene.poses()[0]);
    let noisy = readings(&depth, 3);
    for &z in noisy.iter().filter(|&&z| z > 0.0) {
        let eighths = 8.0 * DISPARITY / f64::from(z);
        // f32 rounds the depth by 6e-8 of up to 440 steps.
        assert!((eighths - eighths.round()).abs() < 5e-5, "{z} m is {eighths} eighths");
        assert!((KINECT_RANGE[0]..=KINECT_RANGE[1]).contains(&f64::from(z)));
    }
    let distinct: std::collections::BTreeSet<u32> = noisy.iter().map(|z| z.to_bits()).collect();
    assert!(distinct.len() > 50, "{} distinct depths", distinct.len());
}

#[test]
fn nothing_is_read_out_of_range_or_where_nothing_is_seen() {
    for z in [0.0, -1.0, f64::NAN, f64::INFINITY, 0.3, 0.75, 5.5, 11.0] {
        assert_eq!(share_read(&image(|_, _| z)), 0.0, "at {z} m");
    }
    for z in [0.85, 2.0, 4.5] {
        assert_eq!(share_read(&image(|_, _| z)), 1.0, "at {z} m");
    }
}

#[test]
fn grazing_surfaces_are_lost() {
    // A plane 1.5 m ahead on the optical axis, turned about the image's vertical until the axis meets it at an angle.
    let camera = camera();
    let share = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let normal = Vector3::new(sin, 0.0, cos);
        // Only the columns in the middle: the angle changes by 0.1 degrees a column.
        let depth = image(|u, v| if u.abs_diff(320) <= 10 { 1.5 * cos / normal.dot(&ray(&camera, u, v)) } else { 0.0 });
        let noisy = readings(&depth, 1);
        let middle = (0..480).flat_map(|v| (312..=328).map(move |u| v * 640 + u)).map(|pixel| noisy[pixel]);
        middle.filter(|&z| z > 0.0).count() as f64 / (480.0 * 17.0)
    };
    assert_eq!(share(0.0), 1.0);
    assert_eq!(share(60.0), 1.0);
    assert!((0.2..0.8).contains(&share(80.0)), "{}", share(80.0));
    assert_eq!(share(87.0), 0.0);
}

#[test]
fn edges_and_the_projectors_shadow_have_no_readings() {
    // A square at 1 m before a wall at 3 m. The shadow is to its left, D (1 - 1/3) = 29.25 pixels wide.
    let is_near = |u: usize, v: usize| (300..400).contains(&u) && (200..300).contains(&v);
    let noisy = readings(&image(|u, v| if is_near(u, v) { 1.0 } else { 3.0 }), 5);
    let missing: Vec<usize> = (0..640).filter(|u| noisy[250 * 640 + u] == 0.0).collect();
    let expected: Vec<usize> = (271..=300).chain(399..=400).collect();
    assert_eq!(missing, expected);
    let missing: Vec<usize> = (0..480).filter(|v| noisy[v * 640 + 350] == 0.0).collect();
    assert_eq!(missing, [199, 200, 299, 300]);
}

#[test]
fn the_seed_alone_decides() {
    let depth = image(|_, _| 2.0);
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let three_threads = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let first = one_thread.install(|| readings(&depth, 11));
    assert_eq!(first, three_threads.install(|| readings(&depth, 11)));
    let second = readings(&depth, 12);

    // Neither neighbouring seeds nor neighbouring pixels are correlated: within 4.5 of 1 / sqrt(n).
    let centred = |image: &[f32]| image.iter().map(|&z| f64::from(z) - 2.0).collect::<Vec<_>>();
    let (a, b) = (centred(&first), centred(&second));
    let correlation = |a: &[f64], b: &[f64]| {
        let ((mean_a, deviation_a), (mean_b, deviation_b)) = (moments(a), moments(b));
        a.iter().zip(b).map(|(x, y)| (x - mean_a) * (y - mean_b)).sum::<f64>()
            / (a.len() as f64 * deviation_a * deviation_b)
    };
    let bound = 4.5 / (a.len() as f64).sqrt();
    assert!(correlation(&a, &b).abs() < bound);
    assert!(correlation(&a[1..], &b[..b.len() - 1]).abs() < bound);
    assert!(correlation(&a[1..], &a[..a.len() - 1]).abs() < bound);
    assert!(correlation(&a[640..], &a[..a.len() - 640]).abs() < bound);
}

#[test]
fn an_image_of_another_size_is_refused() {
    let error = kinect_noise(&[1.0; 7], &camera(), 0).unwrap_err();
    assert!(matches!(error, Error::Parameter { name: "depth image", .. }));
    assert_eq!(error.to_string(), "depth image is 7 pixels, expected the camera's height x width = 480 x 640 pixels");
}
