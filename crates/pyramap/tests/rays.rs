//! Rays through blocks of every form, against a program that steps from face to face and looks at each voxel between.

use proptest::prelude::*;
use pyramap::block::{BLOCK_EDGE, BLOCK_VOXELS, Block, BlockData, BlockKey, Blocks, NarrowBlockData, locate};
use pyramap::rays::{NO_VOXEL, cast_rays};
use pyramap::{State, Unknown};
use std::collections::HashMap;

/// Blocks held as tests make them, in voxels of one metre.
#[derive(Debug)]
struct Map(HashMap<BlockKey, Content>);

#[derive(Clone, Debug)]
enum Content {
    Uniform(i32),
    Narrow(Box<NarrowBlockData>),
    Dense(Box<BlockData>),
}

impl Blocks for Map {
    fn keys(&self) -> Vec<BlockKey> {
        self.0.keys().copied().collect()
    }

    fn block(&self, key: BlockKey) -> Option<Block<'_>> {
        self.0.get(&key).map(|content| match content {
            Content::Uniform(evidence) => Block::Uniform(*evidence),
            Content::Narrow(values) => Block::Narrow(values),
            Content::Dense(values) => Block::Dense(values),
        })
    }

    fn voxel_size(&self) -> f64 {
        1.0
    }

    fn prior_log_odds(&self) -> f64 {
        0.0
    }
}

impl Map {
    fn state(&self, voxel: [i32; 3]) -> State {
        let (key, offset) = locate(voxel);
        match self.block(key).map_or(0, |block| block.value(offset)) {
            0 => State::Unknown,
            evidence if evidence > 0 => State::Occupied,
            _ => State::Free,
        }
    }
}

/// Blocks around the origin, most of them free for the most part.
fn maps() -> impl Strategy<Value = Map> {
    let evidence = || prop_oneof![40 => Just(-7), 1 => Just(0), 1 => Just(90_000)];
    let voxels = move || proptest::collection::vec(evidence(), BLOCK_VOXELS);
    let content = prop_oneof![
        4 => evidence().prop_map(Content::Uniform),
        3 => voxels().prop_map(|values| Content::Dense(Box::new(std::array::from_fn(|n| values[n])))),
        3 => voxels().prop_map(|values| Content::Narrow(Box::new(std::array::from_fn(|n| values[n].min(9) as i16)))),
    ];
    let key = [-2..2, -2..2, -2..2_i32];
    proptest::collection::hash_map(key, content, 0..40).prop_map(Map)
}

/// The first voxel that stops a ray, and where it is entered; rays through edges of voxels are not for this.
fn naive(map: &Map, origin: [f64; 3], direction: [f64; 3], unknown: Unknown) -> Option<([i32; 3], f64)> {
    let length = direction.iter().map(|c| c * c).sum::<f64>().sqrt();
    let unit = direction.map(|c| c / length);
    let mut crossings = vec![0.0];
    for a in 0..3 {
        let planes = (-60..60).map(|plane| (f64::from(plane) - origin[a]) / unit[a]);
        crossings.extend(planes.filter(|t| t.is_finite() && *t > 0.0));
    }
    crossings.sort_by(f64::total_cmp);
    crossings.windows(2).find_map(|ends| {
        let middle = 0.5 * (ends[0] + ends[1]);
        let voxel = std::array::from_fn(|a| (origin[a] + middle * unit[a]).floor() as i32);
        let stops = match map.state(voxel) {
            State::Occupied => true,
            State::Unknown => unknown == Unknown::Occupied,
            State::Free => false,
        };
        stops.then_some((voxel, ends[0]))
    })
}

/// Small odd fractions, so that no ray runs through an edge.
fn odd(range: std::ops::Range<i32>) -> impl Strategy<Value = f64> {
    range.prop_map(|n| f64::from(n) * 0.173_205_080_756_9 + 0.001_618_033_988)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_first_voxel_in_the_way(
        map in maps(),
        rays in proptest::collection::vec(([odd(-120..120), odd(-120..120), odd(-120..120)], [odd(-9..9), odd(-9..9), odd(-9..9)]), 8 * 40),
        unknown in prop_oneof![Just(Unknown::Occupied), Just(Unknown::Free)],
    ) {
        let (origins, directions): (Vec<_>, Vec<_>) = rays.into_iter().unzip();
        // So many are looked up in another way than one.
        let many = cast_rays(&map, &origins, &directions, 50.0, unknown).unwrap();
        for (row, (origin, direction)) in origins.into_iter().zip(directions).enumerate() {
            let one = cast_rays(&map, &[origin], &[direction], 50.0, unknown).unwrap();
            let (distance, state, voxel) = (many.distance[row], many.state[row], many.voxel[row]);
            prop_assert_eq!((one.distance[0], one.state[0], one.voxel[0]), (distance, state, voxel));
            match naive(&map, origin, direction, unknown) {
                Some((stopped, entered)) if entered <= 50.0 => {
                    prop_assert_eq!(voxel, stopped);
                    prop_assert_eq!(state, map.state(stopped));
                    // Sums and quotients of numbers below 100 are rounded by 1e-14.
                    prop_assert!((distance - entered).abs() < 1e-12, "{} and {}", distance, entered);
                }
                _ => prop_assert_eq!((distance, state, voxel), (f64::INFINITY, State::Free, NO_VOXEL)),
            }
        }
    }
}

/// Far from everything coordinates are coarse, and there is much to pass by: neither costs time nor goes wrong.
#[test]
fn rays_from_very_far_away() {
    let edge = BLOCK_EDGE as f64;
    let map = Map(HashMap::from([([0, 0, 0], Content::Uniform(5))]));
    let far = f64::from(i32::MAX);
    for (origin, direction) in [
        ([far, 3.5, 3.5], [-1.0, 0.0, 0.0]),
        ([3.5, -far, 3.5], [0.0, 2.0, 0.0]),
        ([far, far, far], [-1.0, -1.0, -1.0]),
    ] {
        let hits = cast_rays(&map, &[origin], &[direction], f64::INFINITY, Unknown::Free).unwrap();
        assert_eq!(hits.state, [State::Occupied]);
        let entered: [f64; 3] = std::array::from_fn(|a| {
            let length = direction.iter().map(|c| c * c).sum::<f64>().sqrt();
            origin[a] + hits.distance[0] * direction[a] / length
        });
        assert!(entered.iter().all(|c| (-1e-5..edge + 1e-5).contains(c)), "{entered:?}");
        let miss = cast_rays(&map, &[origin], &[direction.map(|c| -c)], f64::INFINITY, Unknown::Free).unwrap();
        assert_eq!(miss.distance, [f64::INFINITY]);
        let stopped = cast_rays(&map, &[origin], &[direction], f64::INFINITY, Unknown::Occupied).unwrap();
        assert_eq!((stopped.distance[0], stopped.state[0]), (0.0, State::Unknown));
    }
}
