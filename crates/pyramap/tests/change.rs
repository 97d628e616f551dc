//! Decay, clearing, cropping and reintegration, held against a list of voxels that knows nothing of blocks.

use pyramap::block::{BLOCK_EDGE, BLOCK_VOXELS, Blocks, VoxelIndex};
use pyramap::{
    Depth, DepthImage, Error, FrameStats, GridConfig, History, OccupancyGrid, PinholeCamera, Pose, Region, decay_factor,
};
use std::collections::BTreeMap;
use std::f64::consts::LN_2;

const WIDTH: usize = 80;
const HEIGHT: usize = 60;
const VOXEL_SIZE: f64 = 0.1;

fn config() -> GridConfig {
    config_of(VOXEL_SIZE)
}

fn config_of(voxel_size: f64) -> GridConfig {
    let mut config = GridConfig::new(voxel_size).unwrap();
    config.max_range = 4.0;
    config
}

/// A slanted wall with a post before it and a hole, seen from a place that moves with the number of the frame.
fn frame(number: usize) -> (Vec<f32>, Pose) {
    let reading = |i: usize| match (i % WIDTH, i / WIDTH) {
        (10..20, 10..25) => 0.0,
        (40..50, _) => 1.3,
        (u, v) => 2.6 + 0.01 * u as f32 - 0.005 * v as f32,
    };
    let n = number as f64;
    let (sin, cos) = (0.4 * n).sin_cos();
    let rows =
        [[cos, 0.0, sin, 0.2 * n - 0.5], [0.0, 1.0, 0.0, -0.1 * n], [-sin, 0.0, cos, 0.07], [0.0, 0.0, 0.0, 1.0]];
    ((0..WIDTH * HEIGHT).map(reading).collect(), Pose::from_rows(&rows).unwrap())
}

fn with_frame<T>(number: usize, fuse: impl FnOnce(&DepthImage, &PinholeCamera, &Pose) -> T) -> T {
    let camera = PinholeCamera::new(WIDTH, HEIGHT, 70.0, 71.0, 40.2, 29.1).unwrap();
    let (depth, pose) = frame(number);
    fuse(&DepthImage::new(Depth::F32(&depth), WIDTH, HEIGHT).unwrap(), &camera, &pose)
}

fn integrate(grid: &mut OccupancyGrid, number: usize) -> pyramap::Result<FrameStats> {
    with_frame(number, |image, camera, pose| grid.integrate(image, camera, pose))
}

fn remove(grid: &mut OccupancyGrid, number: usize) -> pyramap::Result<FrameStats> {
    with_frame(number, |image, camera, pose| grid.remove(image, camera, pose))
}

/// Moves a frame from the pose of another to its own.
fn reintegrate(grid: &mut OccupancyGrid, number: usize, from: usize) -> pyramap::Result<FrameStats> {
    let (_, old_pose) = frame(from);
    with_frame(number, |image, camera, new_pose| grid.reintegrate(image, camera, &old_pose, new_pose))
}

fn map_of(frames: impl IntoIterator<Item = usize>, config: GridConfig) -> OccupancyGrid {
    let mut grid = OccupancyGrid::new(config).unwrap();
    for number in frames {
        integrate(&mut grid, number).unwrap();
    }
    grid
}

/// Every known voxel and its evidence.
fn voxels(grid: &OccupancyGrid) -> BTreeMap<VoxelIndex, i32> {
    let mut known = BTreeMap::new();
    for key in grid.keys() {
        let block = grid.block(key).unwrap();
        for i in 0..BLOCK_VOXELS {
            let inside = [i / 64, i / 8 % 8, i % 8];
            let index = std::array::from_fn(|axis| key[axis] * BLOCK_EDGE as i32 + inside[axis] as i32);
            known.insert(index, block.value(i));
        }
    }
    known.retain(|_, evidence| *evidence != 0);
    known
}

fn centre_in(index: VoxelIndex, [low, high]: [[f64; 3]; 2]) -> bool {
    (0..3).all(|axis| {
        let centre = (f64::from(index[axis]) + 0.5) * VOXEL_SIZE;
        low[axis] <= centre && centre < high[axis]
    })
}

/// Boxes that cut blocks, lie on their faces and on centres of voxels, are thinner than a voxel, endless, or elsewhere.
const REGIONS: [[[f64; 3]; 2]; 7] = [
    [[-0.33, -0.52, 0.41], [0.97, 0.31, 2.77]],
    [[-0.8, -0.8, 0.0], [0.8, 0.8, 1.6]],
    [[0.05, -0.15, 0.25], [0.75, 0.65, 2.85]],
    [[-5.0, 0.051, -5.0], [5.0, 0.149, 5.0]],
    [[f64::NEG_INFINITY, f64::NEG_INFINITY, 1.0], [f64::INFINITY; 3]],
    [[-50.0; 3], [50.0; 3]],
    [[100.0; 3], [200.0; 3]],
];

fn region(corners: [[f64; 3]; 2]) -> Region {
    Region::new(corners[0], corners[1]).unwrap()
}

#[test]
fn clear_and_crop_share_the_map_between_them() {
    let whole = voxels(&map_of(0..3, config()));
    for corners in REGIONS {
        let (inside, outside): (BTreeMap<_, _>, _) = whole.iter().partition(|(index, _)| centre_in(**index, corners));
        let mut cleared = map_of(0..3, config());
        cleared.clear(&region(corners)).unwrap();
        assert_eq!(voxels(&cleared), outside, "{corners:?}");
        let mut cropped = map_of(0..3, config());
        cropped.crop(&region(corners)).unwrap();
        assert_eq!(voxels(&cropped), inside, "{corners:?}");
        for (grid, lost) in [(&cleared, inside.len()), (&cropped, outside.len())] {
            assert_eq!(grid.history(), History { erasures: u64::from(lost > 0), ..History::default() });
            assert_eq!(grid.num_observed().unwrap(), whole.len() - lost);
            assert_eq!(grid.num_frames(), 3);
        }
    }
}

#[test]
fn what_is_forgotten_costs_nothing_and_can_be_seen_again() {
    let everything = region([[-50.0; 3], [50.0; 3]]);
    let fresh = map_of(0..1, config_of(0.04));
    let mut grid = map_of(0..1, config_of(0.04));
    let full = grid.nbytes();
    grid.clear(&everything).unwrap();
    assert_eq!((grid.num_blocks(), grid.bounds()), (0, None));
    let tables = grid.nbytes();
    assert!(tables < full - 100_000, "{tables} of {full} bytes are left");
    // Blocks are given back and taken again, or they would pile up; the directory may have grown to its next size.
    for _ in 0..20 {
        integrate(&mut grid, 0).unwrap();
        assert_eq!(voxels(&grid), voxels(&fresh));
        assert!(grid.nbytes() < full + full / 10);
        grid.clear(&everything).unwrap();
    }
}

#[test]
fn a_window_that_moves_along_stays_small() {
    let mut grid = OccupancyGrid::new(config()).unwrap();
    for number in 0..12 {
        integrate(&mut grid, number).unwrap();
        let centre = frame(number).1.translation;
        let corners = [-1.0, 1.0].map(|side| std::array::from_fn(|axis| centre[axis] + side));
        grid.crop(&region(corners)).unwrap();
        assert!(voxels(&grid).into_keys().all(|index| centre_in(index, corners)));
        assert!(grid.num_observed().unwrap() <= 20 * 20 * 20);
    }
    assert_eq!(grid.history().erasures, 12);
}

#[test]
fn decay_rounds_towards_the_unknown() {
    let whole = voxels(&map_of(0..3, config()));
    for corners in REGIONS.map(Some).into_iter().chain([None]) {
        for factor in [0.5, 0.999, 1.0 - f64::EPSILON / 2.0, 1e-3, f64::MIN_POSITIVE] {
            let mut grid = map_of(0..3, config());
            grid.decay(factor, corners.map(region).as_ref()).unwrap();
            let mut expected = whole.clone();
            let mut touched = false;
            for (index, evidence) in &mut expected {
                if corners.is_none_or(|corners| centre_in(*index, corners)) {
                    let less = f64::from(*evidence) * factor;
                    *evidence = if less > 0.0 { less.floor() as i32 } else { less.ceil() as i32 };
                    touched = true;
                }
            }
            assert!(whole.iter().all(|(index, before)| expected[index].abs() <= before.abs()));
            expected.retain(|_, evidence| *evidence != 0);
            assert_eq!(voxels(&grid), expected, "{factor} in {corners:?}");
            let done = History { decays: 1, decay_product: factor, erasures: 0 };
            assert_eq!(grid.history(), if touched { done } else { History::default() });
        }
    }
}

#[test]
fn decay_comes_to_an_end() {
    let mut grid = map_of(0..2, config());
    let mut decays = 0;
    while grid.num_blocks() > 0 {
        grid.decay(0.25, None).unwrap();
        decays += 1;
    }
    // Evidence of two frames lies within 2^14 steps: at most eight quarterings leave nothing.
    assert!((2..=8).contains(&decays), "{decays}");
    assert_eq!(grid.history(), History { decays, decay_product: 0.25_f64.powi(decays as i32), erasures: 0 });
    grid.decay(0.25, None).unwrap();
    assert_eq!(grid.history().decays, decays, "an empty map cannot be decayed");
}

#[test]
fn half_lives_are_factors() {
    assert_eq!(decay_factor(10.0, 10.0).unwrap(), 0.5);
    assert_eq!(decay_factor(10.0, 30.0).unwrap(), 0.125);
    // Two roundings of numbers below one.
    assert!((decay_factor(60.0, 1.0).unwrap() - (-LN_2 / 60.0).exp()).abs() < 2.0 * f64::EPSILON);
    for (half_life, elapsed, name) in [
        (0.0, 1.0, "half_life"),
        (f64::NAN, 1.0, "half_life"),
        (f64::INFINITY, 1.0, "half_life"),
        (1.0, -1.0, "elapsed"),
        (1.0, f64::INFINITY, "elapsed"),
        (1.0, 2000.0, "elapsed"),
        (1e30, 1.0, "elapsed"),
    ] {
        let error = decay_factor(half_life, elapsed).unwrap_err();
        assert!(matches!(error, Error::Parameter { name: got, .. } if got == name), "{error}");
    }
}

#[test]
fn factors_that_are_none_are_refused() {
    let mut grid = map_of(0..1, config());
    let before = voxels(&grid);
    for factor in [0.0, 1.0, -0.5, 1.5, f64::NAN, f64::INFINITY] {
        let error = grid.decay(factor, None).unwrap_err();
        assert!(matches!(error, Error::Parameter { name: "factor", .. }), "{error}");
    }
    assert_eq!((voxels(&grid), grid.history()), (before, History::default()));
}

#[test]
fn what_was_lost_cannot_be_taken_off() {
    type Erasure = fn(&mut OccupancyGrid) -> pyramap::Result<()>;
    let changes: [(&str, Erasure); 3] = [
        ("decayed 1 times", |grid| grid.decay(0.9, None)),
        ("cleared or cropped 1 times", |grid| grid.clear(&region(REGIONS[0]))),
        ("cleared or cropped 1 times", |grid| grid.crop(&region(REGIONS[0]))),
    ];
    for (reason, change) in changes {
        let mut grid = map_of(0..2, config());
        change(&mut grid).unwrap();
        let before = voxels(&grid);
        for refused in [remove(&mut grid, 0), reintegrate(&mut grid, 0, 1)] {
            let error = refused.unwrap_err();
            assert!(matches!(&error, Error::Unsupported { .. }) && error.to_string().contains(reason), "{error}");
        }
        assert_eq!((voxels(&grid), grid.num_frames()), (before, 2));
        // A map that such a one was merged into lacks the same.
        let mut other = map_of(2..3, config());
        other.merge(&grid).unwrap();
        assert_eq!(other.history(), grid.history());
        assert!(matches!(remove(&mut other, 2), Err(Error::Unsupported { .. })));
    }
    // What changed nothing took nothing away.
    let mut grid = map_of(0..2, config());
    grid.clear(&region(REGIONS[6])).unwrap();
    grid.crop(&region(REGIONS[5])).unwrap();
    grid.decay(0.5, Some(&region(REGIONS[6]))).unwrap();
    remove(&mut grid, 1).unwrap();
    assert_eq!(voxels(&grid), voxels(&map_of(0..1, config())));
}

#[test]
fn merged_histories_add_up() {
    let mut one = map_of(0..1, config());
    one.decay(0.5, None).unwrap();
    one.clear(&region(REGIONS[0])).unwrap();
    let mut other = map_of(1..2, config());
    other.decay(0.25, None).unwrap();
    other.decay(0.5, None).unwrap();
    one.merge(&other).unwrap();
    assert_eq!(one.history(), History { decays: 3, decay_product: 0.0625, erasures: 1 });
}

#[test]
fn a_frame_can_be_moved() {
    let mut grid = OccupancyGrid::new(config()).unwrap();
    let at = |grid: &mut OccupancyGrid, depth_of: usize, pose_of: usize| {
        let (_, pose) = frame(pose_of);
        with_frame(depth_of, |image, camera, _| grid.integrate(image, camera, &pose)).unwrap();
    };
    (0..5).for_each(|number| at(&mut grid, number, number + 7));
    for number in 0..5 {
        let moved = reintegrate(&mut grid, number, number + 7).unwrap();
        assert!(moved.voxels_updated > 1000);
    }
    assert_eq!(voxels(&grid), voxels(&map_of(0..5, config())));
    assert_eq!((grid.num_frames(), grid.history()), (5, History::default()));
}

#[test]
fn a_move_that_fails_leaves_the_frame_where_it_was() {
    let mut config = config();
    config.max_bytes = Some(map_of(0..1, config.clone()).nbytes());
    let mut grid = map_of(0..1, config);
    let before = voxels(&grid);
    let (_, mut far) = frame(1);
    far.translation.x = 1e12;
    let error = with_frame(0, |image, camera, pose| grid.reintegrate(image, camera, pose, &far)).unwrap_err();
    assert!(matches!(error, Error::OutOfBounds { .. }), "{error}");
    assert_eq!((voxels(&grid), grid.num_frames()), (before, 1));

    // Taken off, one of two equal frames leaves no room: the other holds all blocks. So it does not fit elsewhere.
    integrate(&mut grid, 0).unwrap();
    let before = voxels(&grid);
    let (_, elsewhere) = frame(3);
    let error = with_frame(0, |image, camera, pose| grid.reintegrate(image, camera, pose, &elsewhere)).unwrap_err();
    assert!(matches!(error, Error::MapFull { .. }), "{error}");
    assert_eq!((voxels(&grid), grid.num_frames()), (before, 2));
}

#[test]
fn a_full_map_can_be_cropped_but_not_cut() {
    // Free space is blocks of one number; a face through them needs a number for each voxel on both its sides.
    let mut config = config_of(0.02);
    let free = map_of([0], config.clone());
    config.max_bytes = Some(free.nbytes());
    let cut = region([[-0.62, -0.11, 0.9], [-0.38, 0.11, 1.02]]);
    let cut_free_space: [fn(&mut OccupancyGrid, &Region) -> pyramap::Result<()>; 2] =
        [OccupancyGrid::clear, |grid, region| grid.decay(0.5, Some(region))];
    for change in cut_free_space {
        let mut grid = map_of([0], config.clone());
        let error = change(&mut grid, &cut).unwrap_err();
        assert!(matches!(error, Error::MapFull { .. }), "{error}");
        assert_eq!((voxels(&grid), grid.history()), (voxels(&free), History::default()));
        assert_eq!(grid.nbytes(), free.nbytes());
        // What is dropped outside makes room for what is cut.
        grid.crop(&cut).unwrap();
        assert!(grid.num_observed().unwrap() > 500);
        assert!(grid.nbytes() < free.nbytes());
    }
}

#[test]
fn space_that_reached_its_clamp_is_one_number_a_block() {
    let mut clamped = config_of(0.04);
    clamped.clamp = Some((-2.0, 3.5));
    let mut grid = map_of([0, 1, 2, 3], clamped.clone());
    let mixed = grid.nbytes();
    for number in (0..48).map(|n| n % 4) {
        integrate(&mut grid, number).unwrap();
    }
    assert!(grid.nbytes() < mixed, "{} bytes, {mixed} after the first frames", grid.nbytes());
    let at_the_end = |key: &&_| matches!(grid.block(**key), Some(pyramap::block::Block::Uniform(-8192)));
    let collapsed = grid.keys().iter().filter(at_the_end).count();
    assert!(collapsed > 100, "{collapsed} of {} blocks", grid.num_blocks());
    // Decay frees voxels from their clamp, and they stay within.
    grid.decay(0.5, None).unwrap();
    assert!(voxels(&grid).into_values().all(|evidence| (-4096..=7168).contains(&evidence)));
}
