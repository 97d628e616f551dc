//! Frames of every sensor, up to commit.

use super::*;
use pyramap::{Distortion, OrthographicCamera, SphericalSensor};
use std::f64::consts::TAU;

fn spinning(width: usize, height: usize) -> SphericalSensor {
    SphericalSensor::new(width, &SphericalSensor::even_elevations(height, 0.5, -0.6)).unwrap()
}

fn distorted(coefficients: [f64; 5]) -> PinholeCamera {
    let camera = PinholeCamera::new(120, 90, 62.0, 60.0, 58.0, 46.0).unwrap();
    camera.with_distortion(Distortion::from_coefficients(coefficients)).unwrap()
}

/// Sensors of every kind: full turns, sectors, odd widths, uneven and rising beams, shifted rows.
fn all_sensors() -> Vec<(&'static str, Sensor)> {
    let uneven: Vec<f64> = (0..24).map(|i| 0.3 - 0.02 * f64::from(i) - 0.0006 * f64::from(i * i)).collect();
    let rising: Vec<f64> = uneven.iter().rev().copied().collect();
    let offsets: Vec<f64> = (0..32).map(|row| [0.055, 0.018, -0.018, -0.055][row % 4]).collect();
    vec![
        ("a full turn", (&spinning(256, 32)).into()),
        ("a full turn the other way", (&spinning(320, 40).with_azimuths(0.7, TAU).unwrap()).into()),
        ("an odd number of columns", (&spinning(225, 24).with_azimuths(2.0, TAU).unwrap()).into()),
        ("uneven beams", (&SphericalSensor::new(192, &uneven).unwrap()).into()),
        ("a sector", (&SphericalSensor::new(101, &rising).unwrap().with_azimuths(3.0, -2.1).unwrap()).into()),
        ("nearly all around", (&spinning(200, 20).with_azimuths(-1.0, 6.0).unwrap()).into()),
        ("shifted rows", (&spinning(256, 32).with_row_offsets(&offsets).unwrap()).into()),
        ("one row", (&SphericalSensor::new(360, &[0.0]).unwrap()).into()),
        ("a time-of-flight camera", (&camera(97, 60)).into()),
        ("a barrel", (&distorted([-0.28, 0.07, 0.001, -0.002, 0.0])).into()),
        ("a lens whose image folds back", (&distorted([-0.4, 0.0, 0.0, 0.0, 0.0])).into()),
        ("parallel rays", (&OrthographicCamera::new(70, 60, 25.0, 31.0, 22.0, 40.5).unwrap()).into()),
    ]
}

fn ranges<'a>(values: Depth<'a>, sensor: &Sensor) -> DepthImage<'a> {
    DepthImage::of_ranges(values, sensor.width(), sensor.height()).unwrap()
}

#[test]
fn frames_are_those_of_the_cpu() {
    let Some(gpu) = gpu() else { return };
    for (seed, (name, sensor)) in all_sensors().iter().enumerate() {
        let values = depths(sensor.width(), sensor.height(), seed as u64);
        let raw: Vec<u16> = values.iter().map(|&range| (range.min(60.0) * 1000.0) as u16).collect();
        for (rule, voxel_size) in RULES.into_iter().flat_map(|rule| [(rule, 0.04), (rule, 0.12), (rule, 0.4)]) {
            let mut config = config(voxel_size, rule);
            config.max_range = 3.3;
            let mut frames = Frames::new(&gpu, &config).unwrap();
            for (n, values) in [Depth::F32(&values), Depth::U16 { values: &raw, scale: 1000.0 }].into_iter().enumerate()
            {
                let (image, pose) = (ranges(values, sensor), pose(n as u32));
                let cpu = on_cpu(&config, &image, sensor, &pose);
                let device = on_gpu(&gpu, &mut frames, &config, &image, sensor, &pose);
                check(&gpu, &format!("{name}: {rule:?}, {voxel_size} m"), &cpu.effects, &device.effects);
                assert!(cpu.effects.len() > 1, "{name}: {} blocks show nothing", cpu.effects.len());
            }
        }
    }
}

#[test]
fn the_cull_changes_no_bit() {
    let Some(gpu) = gpu() else { return };
    for (seed, (name, sensor)) in all_sensors().iter().enumerate() {
        let values = depths(sensor.width(), sensor.height(), seed as u64);
        let image = ranges(Depth::F32(&values), sensor);
        for rule in RULES {
            let mut config = config(0.1, rule);
            config.max_range = 3.3;
            let effects = [true, false].map(|cull| {
                config.cull = cull;
                let mut frames = Frames::new(&gpu, &config).unwrap();
                on_gpu(&gpu, &mut frames, &config, &image, sensor, &pose(2)).effects
            });
            assert!(effects[0] == effects[1], "{name}: {rule:?}");
        }
    }
}

/// As for cameras, the device's cull is looser than the CPU's, but not by much.
#[test]
fn free_and_hidden_blocks_are_told_apart() {
    let Some(gpu) = gpu() else { return };
    let sensor = Sensor::from(&spinning(1024, 64));
    let walls = vec![2.5f32; 1024 * 64];
    for rule in RULES {
        let mut config = config(0.03, rule);
        config.max_range = 4.0;
        let image = ranges(Depth::F32(&walls), &sensor);
        let cpu = on_cpu(&config, &image, &sensor, &pose(1)).culled;
        let mut frames = Frames::new(&gpu, &config).unwrap();
        let device = on_gpu(&gpu, &mut frames, &config, &image, &sensor, &pose(1)).culled;
        assert!(device.free.len() * 10 >= cpu.free.len() * 9, "{rule:?}: {} {}", device.free.len(), cpu.free.len());
        let (mixed, fewest) = (device.mixed.len(), cpu.mixed.len());
        assert!(mixed * 10 <= fewest * 12, "{rule:?}: {mixed} {fewest}");
    }
}

/// Frames of several sensors in turns, some with a sensor model of their own, two under way, in buffers that are too small
/// at first.
#[test]
fn sensors_take_turns() {
    let Some(gpu) = gpu() else { return };
    let config = config(0.1, UpdateRule::Pyramid);
    let mut frames = Frames::with_room(&gpu, &config, Room { free: 1, mixed: 2, page_blocks: 30 }).unwrap();
    let parallel = OrthographicCamera::new(50, 40, 20.0, 20.0, 25.0, 20.0).unwrap();
    let sensors: [Sensor; 3] = [(&camera(60, 40)).into(), (&spinning(128, 16)).into(), (&parallel).into()];
    let growing = SensorModel::new([0.02, 0.002, 0.01], None, SurfaceOffset::Centred).unwrap();
    let models = [SensorModel::constant(0.08).unwrap(), growing];
    let mut expected = VecDeque::new();
    for n in 0..16 {
        let sensor = &sensors[n % 3];
        let values = depths(sensor.width(), sensor.height(), n as u64);
        let image = ranges(Depth::F32(&values), sensor);
        let image = models.get(n % 4).map_or(image, |&model| image.with_sensor_model(model));
        expected.push_back(on_cpu(&config, &image, sensor, &pose(n as u32)).effects);
        frames.see(&gpu, &config, &image, sensor, &pose(n as u32)).unwrap();
        if expected.len() == 2 {
            let (cpu, device) = (expected.pop_front().unwrap(), seen(&gpu, &mut frames).effects);
            if (n - 1) % 4 == 1 {
                // Its sigma is a few roundings off: a step at most.
                let found = difference(&cpu, &device);
                assert!(found.voxels * 1000 <= found.of && found.blocks == 0, "frame {}: {found:?}", n - 1);
            } else {
                check(&gpu, &format!("frame {}", n - 1), &cpu, &device);
            }
        }
    }
}

/// Kernels that are bound stay so while sensors take turns.
#[test]
fn nothing_is_bound_anew_for_a_sensor_seen_before() {
    let Some(gpu) = gpu() else { return };
    let config = config(0.1, UpdateRule::Pyramid);
    let mut frames = Frames::new(&gpu, &config).unwrap();
    let sensors: [Sensor; 2] = [(&camera(80, 60)).into(), (&spinning(128, 16)).into()];
    let mut bound = Vec::new();
    // Each sensor comes twice, so that both shots have it.
    for n in 0..8 {
        let sensor = &sensors[n / 2 % 2];
        let values = depths(sensor.width(), sensor.height(), 1);
        on_gpu(&gpu, &mut frames, &config, &ranges(Depth::F32(&values), sensor), sensor, &pose(0));
        bound.push(frames.shots.each_ref().map(|shot| shot.stages.len()));
    }
    assert_eq!(bound[3..], [[2, 2]; 5]);
}
