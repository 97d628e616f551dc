//! On frames as cameras take them, real where there are any, the cull changes no bit of a map.

use pyramap::block::{BlockData, BlockKey, Blocks};
use pyramap::{OccupancyGrid, UpdateRule};
use pyramap_benches::{Frames, VOXEL_SIZES, config};
use std::collections::BTreeMap;

/// All evidence of a map, block by block. Blocks unknown throughout are left out: to hold them or not is the same.
fn evidence(grid: &OccupancyGrid) -> BTreeMap<BlockKey, BlockData> {
    let blocks = grid.keys().into_iter().map(|key| (key, grid.block(key).expect("a key of the map").to_data()));
    blocks.filter(|(_, values)| values.iter().any(|&value| value != 0)).collect()
}

/// With and without the cull.
fn both_maps(frames: &Frames, voxel_size: f64, update: UpdateRule) -> [BTreeMap<BlockKey, BlockData>; 2] {
    [true, false].map(|cull| {
        let mut config = config(voxel_size, update);
        config.cull = cull;
        evidence(&frames.map(config))
    })
}

fn check(frames: &Frames, voxel_sizes: &[f64], update: UpdateRule) {
    for &voxel_size in voxel_sizes {
        let [culled, plain] = both_maps(frames, voxel_size, update);
        assert!(plain.len() > 10, "a map of {} blocks shows nothing", plain.len());
        // `assert_eq` would print two whole maps.
        let differing = plain.iter().filter(|(key, values)| culled.get(*key) != Some(*values)).count();
        let what = format!("{update:?} at {voxel_size} m, frames of {}", frames.source);
        assert!(
            culled == plain,
            "{what}: {differing} of {} blocks differ, {} with the cull",
            plain.len(),
            culled.len()
        );
    }
}

const FRAMES: usize = 6;

#[test]
fn pyramid() {
    check(&Frames::spread(FRAMES), &VOXEL_SIZES, UpdateRule::Pyramid);
}

#[test]
fn area() {
    check(&Frames::spread(FRAMES), &VOXEL_SIZES, UpdateRule::Area);
}

#[test]
fn min_layer() {
    check(&Frames::spread(FRAMES), &VOXEL_SIZES, UpdateRule::MinLayer);
}

#[test]
fn ideal() {
    // The coarsest alone: it asks every pixel ray that cuts a voxel.
    check(&Frames::spread(FRAMES), &VOXEL_SIZES[..1], UpdateRule::Ideal);
}

#[test]
fn one_altered_voxel_is_noticed() {
    let [culled, mut plain] = both_maps(&Frames::spread(1), VOXEL_SIZES[0], UpdateRule::Pyramid);
    assert!(culled == plain);
    plain.values_mut().last().expect("a map that is not empty")[77] += 1;
    assert!(culled != plain);
}
