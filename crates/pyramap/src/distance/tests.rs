//! Against a naive transform, and against a field made anew after every change.

use super::DistanceField;
use crate::block::{BLOCK_VOXELS, Block, BlockData, BlockKey, Blocks, VoxelIndex, locate};
use crate::error::Error;
use crate::query::Interpolation;
use crate::region::Region;
use crate::state::Unknown;
use std::collections::HashMap;

const VOXEL_SIZE: f64 = 0.1;

/// A map whose voxels are set one by one.
#[derive(Default)]
struct Voxels {
    blocks: HashMap<BlockKey, BlockData>,
}

impl Voxels {
    fn set(&mut self, voxel: VoxelIndex, evidence: i32) {
        let (key, offset) = locate(voxel);
        self.blocks.entry(key).or_insert([0; BLOCK_VOXELS])[offset] = evidence;
    }

    fn get(&self, voxel: VoxelIndex) -> i32 {
        let (key, offset) = locate(voxel);
        self.blocks.get(&key).map_or(0, |block| block[offset])
    }
}

impl Blocks for Voxels {
    fn keys(&self) -> Vec<BlockKey> {
        self.blocks.keys().copied().collect()
    }

    fn block(&self, key: BlockKey) -> Option<Block<'_>> {
        let block = Block::Dense(self.blocks.get(&key)?);
        Some(block.uniform_value().map_or(block, Block::Uniform))
    }

    fn voxel_size(&self) -> f64 {
        VOXEL_SIZE
    }

    fn prior_log_odds(&self) -> f64 {
        0.0
    }
}

/// Numbers that look random: a linear congruential generator.
struct Random(u64);

impl Random {
    fn below(&mut self, end: i32) -> i32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % end as u64) as i32
    }

    fn within(&mut self, low: i32, high: i32) -> VoxelIndex {
        [0; 3].map(|_| low + self.below(high - low))
    }
}

/// The distance of a voxel, by looking at every voxel around it.
fn naive(map: &Voxels, voxel: VoxelIndex, max_distance: f64, unknown: Unknown) -> f32 {
    let occupied = |voxel| match map.get(voxel) {
        0 => unknown == Unknown::Occupied,
        evidence => evidence > 0,
    };
    let radius = (max_distance / VOXEL_SIZE).ceil() as i32;
    let mine = occupied(voxel);
    let mut nearest = max_distance;
    for x in -radius..=radius {
        for y in -radius..=radius {
            for z in -radius..=radius {
                if occupied([voxel[0] + x, voxel[1] + y, voxel[2] + z]) != mine {
                    nearest = nearest.min(VOXEL_SIZE * f64::from(x * x + y * y + z * z).sqrt());
                }
            }
        }
    }
    (if mine { -nearest } else { nearest }) as f32
}

/// Boxes of occupied and free voxels, with single ones strewn among them.
fn scatter(map: &mut Voxels, random: &mut Random, boxes: usize) {
    for _ in 0..boxes {
        let (corner, size, evidence) =
            (random.within(-20, 20), random.within(1, 14), [-5, -5, 7][random.below(3) as usize]);
        for x in 0..size[0] {
            for y in 0..size[1] {
                for z in 0..size[2] {
                    map.set([corner[0] + x, corner[1] + y, corner[2] + z], evidence);
                }
            }
        }
    }
    for _ in 0..30 {
        let evidence = [-3, 0, 3][random.below(3) as usize];
        map.set(random.within(-24, 24), evidence);
    }
}

#[test]
fn distances_are_those_of_a_naive_search() {
    let mut random = Random(1);
    for (max_distance, unknown) in [(0.25, Unknown::Free), (0.55, Unknown::Occupied), (0.95, Unknown::Free)] {
        let mut map = Voxels::default();
        scatter(&mut map, &mut random, 6);
        let field = DistanceField::new(&map, max_distance, unknown).unwrap();
        let mut cut_off = 0;
        for _ in 0..3000 {
            let voxel = random.within(-40, 40);
            let expected = naive(&map, voxel, max_distance, unknown);
            cut_off += usize::from(expected.abs() == max_distance as f32);
            let centre = voxel.map(|i| (f64::from(i) + 0.5) * VOXEL_SIZE);
            let got = field.distance(&[centre, centre], Interpolation::Nearest).unwrap();
            // Both are the same square root, rounded to f32.
            assert_eq!(got, [expected; 2], "voxel {voxel:?}, up to {max_distance}, unknown {unknown:?}");
        }
        assert!((100..2990).contains(&cut_off), "{cut_off} of 3000 prove little");
    }
}

#[test]
fn an_update_gives_what_a_new_field_would() {
    let everywhere = Region::new([-5.0; 3], [5.0; 3]).unwrap();
    let mut random = Random(2);
    for (max_distance, unknown) in [(0.1, Unknown::Free), (0.5, Unknown::Occupied), (1.25, Unknown::Free)] {
        let mut map = Voxels::default();
        let mut field = DistanceField::new(&map, max_distance, unknown).unwrap();
        for round in 0..16 {
            match round {
                // All at once, and nothing at all, between many small changes.
                5 => map.blocks.clear(),
                9 => {}
                10 => map.blocks.retain(|key, _| key[0] < 0),
                _ => scatter(&mut map, &mut random, round % 3),
            }
            field.update(&map).unwrap();
            let anew = DistanceField::new(&map, max_distance, unknown).unwrap();
            assert_eq!(field.num_blocks(), anew.num_blocks(), "blocks in round {round}");
            assert!(
                field.dense(&everywhere).unwrap() == anew.dense(&everywhere).unwrap(),
                "distances in round {round}"
            );
            assert_eq!(field.update(&map).unwrap(), 0, "nothing has changed since");
        }
    }
}

#[test]
fn a_region_is_its_voxels() {
    let mut map = Voxels::default();
    scatter(&mut map, &mut Random(3), 5);
    let field = DistanceField::new(&map, 0.7, Unknown::Free).unwrap();
    let (low, high) = ([-13, 2, -9], [5, 11, 14]);
    let corner = |voxel: VoxelIndex| voxel.map(|i| f64::from(i) * VOXEL_SIZE);
    let dense = field.dense(&Region::new(corner(low), corner(high)).unwrap()).unwrap();
    assert_eq!((dense.first, dense.shape), (low, [18, 9, 23]));
    let mut values = dense.values.into_iter();
    for x in low[0]..high[0] {
        for y in low[1]..high[1] {
            for z in low[2]..high[2] {
                let centre = [x, y, z].map(|i| (f64::from(i) + 0.5) * VOXEL_SIZE);
                assert_eq!(values.next(), Some(field.distance(&[centre], Interpolation::Nearest).unwrap()[0]));
            }
        }
    }
    assert_eq!(values.next(), None);
    // No voxel has its centre in there.
    assert!(field.dense(&Region::new([0.0; 3], [0.04; 3]).unwrap()).unwrap().values.is_empty());
}

#[test]
fn gradients_are_the_slope_of_the_interpolated_distance() {
    let mut map = Voxels::default();
    let mut random = Random(4);
    scatter(&mut map, &mut random, 5);
    let field = DistanceField::new(&map, 0.9, Unknown::Free).unwrap();
    let (step, mut steep) = (1e-4, 0);
    for _ in 0..2000 {
        // Within a cell between voxel centres, where the field is a polynomial.
        let cell = random.within(-30, 30);
        let point: [f64; 3] =
            std::array::from_fn(|a| VOXEL_SIZE * (f64::from(cell[a]) + 0.5 + f64::from(random.below(80) + 10) / 100.0));
        let gradient = field.gradient(&[point]).unwrap()[0];
        for a in 0..3 {
            let moved = |by: f64| std::array::from_fn(|b| point[b] + if a == b { by } else { 0.0 });
            let ends = field.distance(&[moved(step), moved(-step)], Interpolation::Trilinear).unwrap();
            let slope = (f64::from(ends[0]) - f64::from(ends[1])) / (2.0 * step);
            // Along one axis the field is linear; each end is rounded by up to 6e-8 * 0.5, over 2e-4.
            assert!((slope - f64::from(gradient[a])).abs() < 1e-3, "at {point:?}: {slope} and {gradient:?}");
            steep += usize::from(slope.abs() > 0.5);
        }
    }
    assert!(steep > 500, "{steep} slopes of 6000 prove little");
}

#[test]
fn a_surface_is_where_the_interpolated_distance_is_zero() {
    let mut map = Voxels::default();
    for x in -20..20 {
        for y in -20..20 {
            (0..4).for_each(|z| map.set([x, y, z], 1));
        }
    }
    let field = DistanceField::new(&map, 1.0, Unknown::Free).unwrap();
    let points = [[0.0, 0.0, 0.4], [0.0, 0.0, 0.46], [0.0, 0.0, 0.36], [0.0, 0.0, 1.0], [0.0, 0.0, 9.0]];
    let distances = field.distance(&points, Interpolation::Trilinear).unwrap();
    for (got, expected) in distances.iter().zip([0.0, 0.11, -0.08, 0.65, 1.0]) {
        assert!((got - expected).abs() < 1e-6, "{distances:?}");
    }
    let up = field.gradient(&points).unwrap();
    for (got, expected) in up.iter().zip([2.0, 1.0, 2.0, 1.0, 0.0]) {
        assert!(got[0] == 0.0 && got[1] == 0.0 && (got[2] - expected).abs() < 1e-5, "{up:?}");
    }
}

#[test]
fn tiles_stay_near_to_surfaces() {
    let mut map = Voxels::default();
    for x in 0..400 {
        for y in 0..160 {
            (0..160).for_each(|z| map.set([x, y, z], -1));
        }
    }
    map.set([200, 80, 80], 1);
    for unknown in [Unknown::Free, Unknown::Occupied] {
        let field = DistanceField::new(&map, 0.8, unknown).unwrap();
        let around_the_voxel = 27;
        // Free space is 50 x 20 x 20 blocks; its border is near to a layer of blocks outside it, and two inside.
        let around_free_space = 52 * 22 * 22 - 46 * 16 * 16;
        let expected = around_the_voxel + if unknown == Unknown::Free { 0 } else { around_free_space };
        assert_eq!(field.num_blocks(), expected, "unknown {unknown:?}");
    }
}

#[test]
fn bad_input_is_named() {
    let map = Voxels::default();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 0.05, 1e9] {
        match DistanceField::new(&map, bad, Unknown::Free) {
            Err(Error::Parameter { name: "max_distance", got, .. }) => assert_eq!(got, format!("{bad}")),
            _ => panic!("{bad} was taken"),
        }
    }
    let field = DistanceField::new(&map, 1.0, Unknown::Free).unwrap();
    let points = [[0.0; 3], [0.0, f64::NAN, 0.0]];
    assert!(matches!(field.distance(&points, Interpolation::Nearest), Err(Error::Parameter { name: "points", .. })));
    assert!(matches!(field.gradient(&points), Err(Error::Parameter { name: "points", .. })));
    let endless = Region::new([0.0; 3], [1.0, f64::INFINITY, 1.0]).unwrap();
    assert!(matches!(field.dense(&endless), Err(Error::Parameter { name: "region", .. })));
    assert_eq!(field.distance(&[[1e300, -1e300, 0.0]], Interpolation::Trilinear).unwrap(), [1.0]);
}
