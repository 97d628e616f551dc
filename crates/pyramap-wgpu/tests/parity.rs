//! Whole maps, GPU against CPU, on simulated frames as a depth camera would take them.

mod common;

use pyramap::block::{BLOCK_VOXELS, BlockKey, Blocks};
use pyramap::{
    BeyondMaxRange, Depth, DepthImage, GridConfig, OccupancyGrid, PinholeCamera, Pose, Sensor, SensorModel,
    SphericalSensor, SurfaceOffset, UpdateRule,
};
use pyramap_scenes::{kinect_noise, office_loop};
use pyramap_wgpu::frame::Room;
use pyramap_wgpu::{Gpu, GpuBackend, Sizes};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Pages of a few blocks, so that everything crosses their borders, and room for next to nothing, so that it grows.
const SMALL: Sizes = Sizes { page_blocks: 50, room: Room { free: 3, mixed: 5, page_blocks: 64 } };
const RULES: [UpdateRule; 3] = [UpdateRule::Pyramid, UpdateRule::Area, UpdateRule::MinLayer];
/// Fixed-point steps by which one frame's log-odds may differ: less than 1e-3 log-odds. Drivers may divide and take
/// roots with errors of a few units in the last place, where the CPU rounds correctly.
const TOLERANCE: i32 = 4;

/// A camera with a quarter of the usual one's pixels along each side: a frame is quick, and all layers are there.
fn camera() -> PinholeCamera {
    PinholeCamera::new(161, 121, 146.0, 147.0, 80.3, 59.8).unwrap()
}

/// A frame of a walk through an office.
struct Shot {
    depth: Vec<f32>,
    pose: Pose,
}

impl Shot {
    fn take(number: usize) -> Self {
        let (office, camera) = (office_loop(), camera());
        let pose = office.poses()[number % office.poses().len()];
        let mut depth = kinect_noise(&office.render(&camera, &pose), &camera, number as u64).unwrap();
        // Pixels without return, as time-of-flight cameras have them.
        (0..12).for_each(|row| depth[row * camera.width + 20..][..30].fill(f32::INFINITY));
        Self { depth, pose }
    }

    fn image(&self) -> DepthImage<'_> {
        let camera = camera();
        DepthImage::new(Depth::F32(&self.depth), camera.width, camera.height).unwrap()
    }
}

fn walk(frames: usize) -> Vec<Shot> {
    (0..frames).map(|n| Shot::take(7 * n)).collect()
}

fn config(voxel_size: f64, update: UpdateRule) -> GridConfig {
    let mut config = GridConfig::new(voxel_size).unwrap();
    config.update = update;
    config
}

fn on_gpu(gpu: &Arc<Gpu>, config: &GridConfig, sizes: Sizes) -> OccupancyGrid {
    let backend = GpuBackend::on(gpu.clone(), config, sizes).unwrap();
    OccupancyGrid::with_backend(config.clone(), Box::new(backend)).unwrap()
}

fn on_cpu(config: &GridConfig) -> OccupancyGrid {
    OccupancyGrid::new(config.clone()).unwrap()
}

fn integrate(grid: &mut OccupancyGrid, shots: &[Shot]) {
    for shot in shots {
        grid.integrate(&shot.image(), &camera(), &shot.pose).unwrap();
    }
}

/// The evidence of all blocks.
type Contents = BTreeMap<BlockKey, Vec<i32>>;

fn contents(grid: &OccupancyGrid) -> Contents {
    grid.fetch().unwrap();
    let values = |key| (0..BLOCK_VOXELS).map(|i| grid.block(key).unwrap().value(i)).collect();
    grid.keys().into_iter().map(|key| (key, values(key))).collect()
}

/// In what a map differs from another.
#[derive(Debug, Default, PartialEq)]
struct Differences {
    /// Blocks that are in the other map only.
    missing: Vec<BlockKey>,
    /// Blocks that are in this map only.
    extra: Vec<BlockKey>,
    /// Voxels that differ by more than may be.
    beyond: usize,
    /// The largest difference, and where it is.
    worst: (u32, Option<(BlockKey, usize)>),
    /// Voxels of which either map knows something.
    known: usize,
}

fn compare(map: &Contents, other: &Contents, tolerance: i32) -> Differences {
    let without = |these: &Contents, those: &Contents| -> Vec<BlockKey> {
        these.keys().copied().filter(|key| !those.contains_key(key)).collect()
    };
    let mut differences =
        Differences { missing: without(other, map), extra: without(map, other), ..Differences::default() };
    for (&key, values) in map {
        let Some(others) = other.get(&key) else { continue };
        for (offset, (&value, &of_other)) in values.iter().zip(others).enumerate() {
            let difference = value.abs_diff(of_other);
            differences.known += usize::from(value != 0 || of_other != 0);
            differences.beyond += usize::from(difference > tolerance.unsigned_abs());
            if difference > differences.worst.0 {
                differences.worst = (difference, Some((key, offset)));
            }
        }
    }
    differences
}

/// That maps of so many frames agree: no block missing or extra, and 99.99 % of voxels within the tolerance. Where a
/// ray grazes an edge, or a voxel the border of a layer, the last bit of a division decides which texel is read.
#[track_caller]
fn assert_equal(map: &OccupancyGrid, cpu: &OccupancyGrid, frames: usize) {
    let differences = compare(&contents(map), &contents(cpu), TOLERANCE * frames as i32);
    let Differences { missing, extra, beyond, known, .. } = &differences;
    assert!(missing.is_empty() && extra.is_empty() && beyond * 10_000 <= *known && *known > 1000, "{differences:?}");
}

#[test]
fn the_comparison_sees_every_difference() {
    let mut cpu = on_cpu(&config(0.1, UpdateRule::Pyramid));
    integrate(&mut cpu, &walk(1));
    let truth = contents(&cpu);
    let same = compare(&truth, &truth, 0);
    assert_eq!((same.worst, same.beyond, same.missing.len(), same.extra.len()), ((0, None), 0, 0, 0));
    assert!(same.known > 1000);

    let &key = truth.keys().nth(5).unwrap();
    let mut altered = truth.clone();
    altered.get_mut(&key).unwrap()[123] += TOLERANCE + 1;
    let seen = compare(&altered, &truth, TOLERANCE);
    assert_eq!((seen.beyond, seen.worst), (1, (TOLERANCE as u32 + 1, Some((key, 123)))));
    assert_eq!(compare(&altered, &truth, TOLERANCE + 1).beyond, 0);

    let mut lacking = truth.clone();
    lacking.remove(&key);
    assert_eq!(compare(&lacking, &truth, TOLERANCE).missing, [key]);
    assert_eq!(compare(&truth, &lacking, TOLERANCE).extra, [key]);
}

#[test]
fn every_rule_on_one_frame_and_on_several() {
    let Some(gpu) = common::gpu() else { return };
    let shots = walk(6);
    for update in RULES {
        for (voxel_size, sizes) in [(0.04, Sizes::default()), (0.09, SMALL), (0.16, SMALL)] {
            let config = config(voxel_size, update);
            let (mut map, mut cpu) = (on_gpu(&gpu, &config, sizes), on_cpu(&config));
            integrate(&mut map, &shots[..1]);
            integrate(&mut cpu, &shots[..1]);
            assert_equal(&map, &cpu, 1);
            integrate(&mut map, &shots[1..]);
            integrate(&mut cpu, &shots[1..]);
            assert_equal(&map, &cpu, shots.len());
        }
    }
}

#[test]
fn sensor_models_and_readings_of_all_kinds() {
    let Some(gpu) = common::gpu() else { return };
    let shots = walk(2);
    let growing = SensorModel::new([0.03, 0.0, 0.008], Some(0.02), SurfaceOffset::Centred).unwrap();
    for update in RULES {
        let mut config = config(0.06, update);
        config.sensor_model = growing;
        config.max_range = 3.5;
        config.beyond_max_range = BeyondMaxRange::Ignore;
        let (mut map, mut cpu) = (on_gpu(&gpu, &config, SMALL), on_cpu(&config));
        integrate(&mut map, &shots);
        integrate(&mut cpu, &shots);
        assert_equal(&map, &cpu, shots.len());
    }
}

#[test]
fn frames_on_a_map_that_held_data() {
    let Some(gpu) = common::gpu() else { return };
    let shots = walk(4);
    let config = config(0.07, UpdateRule::Pyramid);
    let mut before = on_cpu(&config);
    integrate(&mut before, &shots[..2]);
    let (mut map, mut cpu) = (on_gpu(&gpu, &config, SMALL), on_cpu(&config));
    for grid in [&mut map, &mut cpu] {
        integrate(grid, &shots[1..3]);
        grid.merge(&before).unwrap();
        integrate(grid, &shots[3..]);
    }
    assert_equal(&map, &cpu, 4);
    // And the other way: what is on the device goes into a map on the CPU.
    let mut merged = on_cpu(&config);
    merged.merge(&map).unwrap();
    assert_eq!(compare(&contents(&merged), &contents(&map), 0).worst, (0, None));
    assert_eq!(merged.num_frames(), cpu.num_frames());
}

#[test]
fn what_is_taken_off_leaves_no_trace() {
    let Some(gpu) = common::gpu() else { return };
    let shots = walk(3);
    for update in RULES {
        let config = config(0.08, update);
        let mut map = on_gpu(&gpu, &config, SMALL);
        integrate(&mut map, &shots);
        let mut without = on_gpu(&gpu, &config, SMALL);
        integrate(&mut without, &[Shot::take(0), Shot::take(14)]);
        let remove = |map: &mut OccupancyGrid, shot: &Shot| {
            map.remove(&shot.image(), &camera(), &shot.pose).unwrap();
        };
        remove(&mut map, &shots[1]);
        let differences = compare(&contents(&map), &contents(&without), 0);
        assert_eq!((differences.worst, differences.missing.len(), differences.extra.len()), ((0, None), 0, 0));
        remove(&mut map, &shots[2]);
        remove(&mut map, &shots[0]);
        assert_eq!((map.num_blocks(), map.num_frames(), map.saturated()), (0, 0, 0));
    }
}

#[test]
fn frames_under_way_commute_with_those_waited_for() {
    let Some(gpu) = common::gpu() else { return };
    let shots = walk(5);
    let config = config(0.08, UpdateRule::Pyramid);
    let (mut map, mut submitted) = (on_gpu(&gpu, &config, SMALL), on_gpu(&gpu, &config, SMALL));
    let one_by_one: Vec<_> =
        shots.iter().rev().map(|shot| map.integrate(&shot.image(), &camera(), &shot.pose).unwrap()).collect();
    let receipts: Vec<_> =
        shots.iter().map(|shot| submitted.submit(&shot.image(), &camera(), &shot.pose).unwrap()).collect();
    submitted.synchronize().unwrap();
    for (receipt, stats) in receipts.iter().zip(one_by_one.iter().rev()) {
        let receipt = receipt.stats().expect("the map is synchronized");
        assert_eq!((receipt.blocks_mixed, receipt.voxels_updated), (stats.blocks_mixed, stats.voxels_updated));
    }
    let differences = compare(&contents(&submitted), &contents(&map), 0);
    assert_eq!((differences.worst, differences.missing.len(), differences.extra.len()), ((0, None), 0, 0));
}

#[test]
fn clamped_maps() {
    let Some(gpu) = common::gpu() else { return };
    let mut config = config(0.08, UpdateRule::Area);
    (config.clamp, config.prior) = (Some((-1.5, 2.0)), 0.4);
    let shots = walk(4);
    let (mut map, mut cpu) = (on_gpu(&gpu, &config, SMALL), on_cpu(&config));
    integrate(&mut map, &shots);
    integrate(&mut cpu, &shots);
    assert_equal(&map, &cpu, shots.len());
    let highest = contents(&map).into_values().flatten().max().unwrap();
    assert_eq!(highest, contents(&cpu).into_values().flatten().max().unwrap());
}

#[test]
fn the_cull_changes_no_bit() {
    let Some(gpu) = common::gpu() else { return };
    let shots = walk(2);
    for update in RULES {
        let mut config = config(0.09, update);
        let mut map = on_gpu(&gpu, &config, SMALL);
        config.cull = false;
        let mut plain = on_gpu(&gpu, &config, SMALL);
        integrate(&mut map, &shots);
        integrate(&mut plain, &shots);
        let differences = compare(&contents(&map), &contents(&plain), 0);
        assert_eq!((differences.worst, differences.missing.len(), differences.extra.len()), ((0, None), 0, 0));
    }
}

#[test]
fn depth_in_whole_millimetres() {
    let Some(gpu) = common::gpu() else { return };
    let config = config(0.08, UpdateRule::Pyramid);
    let (mut map, mut cpu) = (on_gpu(&gpu, &config, SMALL), on_cpu(&config));
    let shot = Shot::take(3);
    let values: Vec<u16> = shot.depth.iter().map(|&depth| (depth.min(60.0) * 1000.0) as u16).collect();
    let camera = camera();
    let image = DepthImage::new(Depth::U16 { values: &values, scale: 1000.0 }, camera.width, camera.height).unwrap();
    map.integrate(&image, &camera, &shot.pose).unwrap();
    cpu.integrate(&image, &camera, &shot.pose).unwrap();
    assert_equal(&map, &cpu, 1);
}

/// A camera, one that measures ranges, and a spinning LiDAR with shifted rows, in one map; each can be taken off again.
#[test]
fn several_sensors_in_one_map() {
    let Some(gpu) = common::gpu() else { return };
    let beams = SphericalSensor::even_elevations(32, 0.4, -0.6);
    let offsets: Vec<f64> = (0..32).map(|row| [0.03, -0.03][row % 2]).collect();
    let lidar = SphericalSensor::new(512, &beams).unwrap().with_row_offsets(&offsets).unwrap();
    let shots = walk(2);
    // A room all around, with a gap.
    let around: Vec<f32> = (0..512 * 32).map(|i| if i % 512 < 40 { 0.0 } else { 2.5 + 0.3 * (i % 7) as f32 }).collect();
    let ranges = DepthImage::of_ranges(Depth::F32(&around), 512, 32).unwrap();
    let time_of_flight = DepthImage::of_ranges(Depth::F32(&shots[1].depth), camera().width, camera().height).unwrap();
    let (lidar, camera) = (Sensor::from(&lidar), Sensor::from(&camera()));
    let frames = [(shots[0].image(), &camera), (ranges, &lidar), (time_of_flight, &camera), (ranges, &lidar)];
    for update in RULES {
        let config = config(0.1, update);
        let (mut map, mut cpu) = (on_gpu(&gpu, &config, SMALL), on_cpu(&config));
        for (n, (image, sensor)) in frames.iter().enumerate() {
            map.submit(image, *sensor, &shots[n / 2].pose).unwrap();
            cpu.integrate(image, *sensor, &shots[n / 2].pose).unwrap();
        }
        map.synchronize().unwrap();
        assert_equal(&map, &cpu, frames.len());
        for (n, (image, sensor)) in frames.iter().enumerate() {
            map.remove(image, *sensor, &shots[n / 2].pose).unwrap();
        }
        assert_eq!((map.num_blocks(), map.num_frames()), (0, 0), "{update:?}");
    }
}
