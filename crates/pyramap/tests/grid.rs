//! The map as a whole: the cull changes nothing, frames commute, and what is added can be taken off.

use pyramap::block::{BLOCK_VOXELS, BlockKey, Blocks};
use pyramap::{
    BeyondMaxRange, Depth, DepthImage, Error, GridConfig, OccupancyGrid, PinholeCamera, Pose, SensorModel,
    SurfaceOffset, UpdateRule,
};
use std::collections::BTreeMap;

const WIDTH: usize = 96;
const HEIGHT: usize = 72;

fn camera() -> PinholeCamera {
    PinholeCamera::new(WIDTH, HEIGHT, 80.0, 84.0, 46.2, 37.1).unwrap()
}

/// Walls at several depths with slanted parts, an edge, holes of all sizes, places without return and far readings.
fn depth(frame: usize) -> Vec<f32> {
    let mut noise = 0x9E37_79B9_u32.wrapping_mul(frame as u32 + 1);
    (0..WIDTH * HEIGHT)
        .map(|i| {
            let (u, v) = (i % WIDTH, i / WIDTH);
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let jitter = (noise >> 16) as f32 / 65_536.0;
            match () {
                () if (u / 7 + v / 5 + frame).is_multiple_of(23) => 0.0,
                () if jitter < 0.02 => f32::NAN,
                () if u < 12 && v < 30 => f32::INFINITY,
                () if u > 80 && v > 50 => 9.0,
                () if u > 30 && u < 55 && v > 20 => 1.1 + 0.01 * jitter,
                () => 2.2 + 0.012 * u as f32 - 0.006 * v as f32 + 0.02 * jitter,
            }
        })
        .collect()
}

fn pose(frame: usize) -> Pose {
    let angle = 0.37 * frame as f64;
    let (sin, cos) = angle.sin_cos();
    let tilt = 0.2 * (frame as f64).cos();
    let (s, c) = tilt.sin_cos();
    // A turn about y, then a tilt about x.
    Pose::from_rows(&[
        [cos, sin * s, sin * c, 0.3 * frame as f64 - 1.0],
        [0.0, c, -s, -0.1 * frame as f64],
        [-sin, cos * s, cos * c, 0.05],
        [0.0, 0.0, 0.0, 1.0],
    ])
    .unwrap()
}

fn integrate(grid: &mut OccupancyGrid, frame: usize) {
    let depth = depth(frame);
    grid.integrate(&DepthImage::new(Depth::F32(&depth), WIDTH, HEIGHT).unwrap(), &camera(), &pose(frame)).unwrap();
}

fn remove(grid: &mut OccupancyGrid, frame: usize) -> pyramap::Result<pyramap::FrameStats> {
    let depth = depth(frame);
    grid.remove(&DepthImage::new(Depth::F32(&depth), WIDTH, HEIGHT).unwrap(), &camera(), &pose(frame))
}

/// All evidence of a map, block by block, unknown blocks left out.
fn contents(grid: &OccupancyGrid) -> BTreeMap<BlockKey, Vec<i32>> {
    let values = |key| (0..BLOCK_VOXELS).map(|i| grid.block(key).unwrap().value(i)).collect::<Vec<_>>();
    grid.keys().into_iter().map(|key| (key, values(key))).filter(|(_, v)| v.iter().any(|&e| e != 0)).collect()
}

fn config(voxel_size: f64, update: UpdateRule) -> GridConfig {
    let mut config = GridConfig::new(voxel_size).unwrap();
    config.update = update;
    config.max_range = 4.0;
    config
}

#[test]
fn the_cull_changes_no_bit() {
    let rules = [UpdateRule::Pyramid, UpdateRule::Area, UpdateRule::MinLayer, UpdateRule::Ideal];
    for update in rules {
        for voxel_size in [0.03, 0.1, 0.4] {
            if update == UpdateRule::Ideal && voxel_size < 0.1 {
                continue; // minutes without the cull
            }
            let mut culled = config(voxel_size, update);
            culled.beyond_max_range = if voxel_size > 0.3 { BeyondMaxRange::Ignore } else { BeyondMaxRange::Free };
            culled.sensor_model = SensorModel::new([0.02, 0.0, 0.004], None, SurfaceOffset::Centred).unwrap();
            if update == UpdateRule::MinLayer {
                culled.sensor_model = SensorModel::constant(0.03).unwrap();
            }
            let mut plain = culled.clone();
            plain.cull = false;
            let mut maps = [OccupancyGrid::new(culled).unwrap(), OccupancyGrid::new(plain).unwrap()];
            for frame in 0..4 {
                maps.iter_mut().for_each(|grid| integrate(grid, frame));
            }
            let [culled, plain] = maps.map(|grid| contents(&grid));
            assert!(culled.len() > 8, "a map of {} blocks shows nothing", culled.len());
            assert_eq!(culled, plain, "{update:?} at {voxel_size} m");
        }
    }
}

#[test]
fn the_cull_does_something() {
    let mut grid = OccupancyGrid::new(config(0.03, UpdateRule::Pyramid)).unwrap();
    let wall = vec![3.0; WIDTH * HEIGHT];
    let image = DepthImage::new(Depth::F32(&wall), WIDTH, HEIGHT).unwrap();
    let stats = grid.integrate(&image, &camera(), &Pose::identity()).unwrap();
    assert!(stats.blocks_free > 200, "{stats:?}");
    assert!(grid.nbytes() < grid.num_blocks() * BLOCK_VOXELS * 4, "free blocks are held as one number");
}

#[test]
fn frames_commute_and_can_be_taken_off() {
    let build = |frames: &[usize]| {
        let mut grid = OccupancyGrid::new(config(0.08, UpdateRule::Pyramid)).unwrap();
        frames.iter().for_each(|&frame| integrate(&mut grid, frame));
        grid
    };
    let forward = build(&[0, 1, 2, 3, 4]);
    assert_eq!(contents(&forward), contents(&build(&[3, 1, 4, 0, 2])));

    let mut without = build(&[0, 1, 2, 3, 4]);
    remove(&mut without, 2).unwrap();
    assert_eq!(contents(&without), contents(&build(&[0, 1, 3, 4])));

    let mut half = build(&[0, 1]);
    half.merge(&build(&[2, 3, 4])).unwrap();
    assert_eq!(contents(&forward), contents(&half));

    let mut empty = build(&[1]);
    remove(&mut empty, 1).unwrap();
    assert_eq!((empty.num_blocks(), empty.num_frames()), (0, 0));
}

#[test]
fn one_altered_voxel_is_noticed() {
    // The comparison that the tests above stand on can fail.
    let mut grid = OccupancyGrid::new(config(0.08, UpdateRule::Pyramid)).unwrap();
    integrate(&mut grid, 0);
    let original = contents(&grid);
    let mut altered = original.clone();
    altered.values_mut().next().unwrap()[77] += 1;
    assert_ne!(original, altered);
}

#[test]
fn a_full_map_is_unchanged() {
    let mut config = config(0.05, UpdateRule::Pyramid);
    let mut free = OccupancyGrid::new(config.clone()).unwrap();
    integrate(&mut free, 0);
    config.max_bytes = Some(free.nbytes());
    let mut grid = OccupancyGrid::new(config).unwrap();
    integrate(&mut grid, 0);
    let before = contents(&grid);
    let depth = depth(5);
    let error =
        grid.integrate(&DepthImage::new(Depth::F32(&depth), WIDTH, HEIGHT).unwrap(), &camera(), &pose(5)).unwrap_err();
    assert!(matches!(error, Error::MapFull { .. }), "{error}");
    assert_eq!((before, 1), (contents(&grid), grid.num_frames()));
    // A frame that needs no more room is still taken.
    integrate(&mut grid, 0);
    assert_eq!(grid.num_frames(), 2);
}

#[test]
fn a_map_never_takes_more_than_it_may() {
    let mut config = config(0.06, UpdateRule::Pyramid);
    for max_bytes in (1..60).map(|n| n * 23_000) {
        config.max_bytes = Some(max_bytes);
        let mut grid = OccupancyGrid::new(config.clone()).unwrap();
        for frame in 0..12 {
            let depth = depth(frame);
            let image = DepthImage::new(Depth::F32(&depth), WIDTH, HEIGHT).unwrap();
            let fused = grid.integrate(&image, &camera(), &pose(frame));
            assert!(matches!(fused, Ok(_) | Err(Error::MapFull { .. })));
            if fused.is_ok() && frame % 3 == 1 {
                remove(&mut grid, frame).unwrap();
            }
            assert!(grid.nbytes() <= max_bytes, "{} bytes, {max_bytes} allowed", grid.nbytes());
        }
    }
}

#[test]
fn clamped_maps_stay_within_and_cannot_remove() {
    let mut config = config(0.08, UpdateRule::Pyramid);
    config.clamp = Some((-2.0, 3.5));
    let mut grid = OccupancyGrid::new(config).unwrap();
    (0..6).for_each(|_| integrate(&mut grid, 1));
    let values: Vec<i32> = contents(&grid).into_values().flatten().collect();
    assert_eq!(values.iter().min(), Some(&-8192));
    assert_eq!(values.iter().max(), Some(&14336));
    assert!(matches!(remove(&mut grid, 1), Err(Error::Unsupported { .. })));
    assert_eq!(grid.num_frames(), 6);
}

#[test]
fn far_from_the_origin_the_map_is_the_same() {
    // A whole number of blocks away, the same voxels get the same evidence: positions are taken relative to the camera.
    let mut near = OccupancyGrid::new(config(0.0625, UpdateRule::Pyramid)).unwrap();
    let mut far = OccupancyGrid::new(config(0.0625, UpdateRule::Pyramid)).unwrap();
    let depth = depth(0);
    let image = DepthImage::new(Depth::F32(&depth), WIDTH, HEIGHT).unwrap();
    let mut moved = pose(0);
    near.integrate(&image, &camera(), &moved).unwrap();
    moved.translation.x += 0.5 * 200_000.0;
    far.integrate(&image, &camera(), &moved).unwrap();
    let shifted: BTreeMap<_, _> = contents(&near).into_iter().map(|([x, y, z], v)| ([x + 200_000, y, z], v)).collect();
    let far = contents(&far);
    assert_eq!(shifted.keys().collect::<Vec<_>>(), far.keys().collect::<Vec<_>>());
    let worst = shifted.values().flatten().zip(far.values().flatten()).map(|(a, b)| (a - b).abs()).max();
    // The camera's own position rounds in the eleventh digit: a step of the fixed point at most.
    assert!(worst <= Some(1), "{worst:?}");
}
