//! Frontiers of random maps against a naive oracle, and of simple shapes against what is known of them.

use pyramap::Error;
use pyramap::block::{
    BLOCK_EDGE, BLOCK_VOXELS, Block, BlockData, BlockKey, Blocks, NarrowBlockData, VoxelIndex, locate,
};
use pyramap::frontier::{Frontier, FrontierOptions, find};
use pyramap::log_odds::UNIT;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;

const VOXEL_SIZE: f64 = 0.05;
const EDGE: i32 = BLOCK_EDGE as i32;

enum Stored {
    Uniform(i32),
    Narrow(Box<NarrowBlockData>),
    Dense(Box<BlockData>),
}

/// A map whose blocks are stored in every form that there is.
struct Map {
    blocks: HashMap<BlockKey, Stored>,
    prior: f64,
}

impl Map {
    /// Stores whole blocks of what is given at voxels; what is not given is unknown. Every second block that could be
    /// kept as one number, or in half the room, is.
    fn new(evidence: &BTreeMap<VoxelIndex, i32>, prior: f64) -> Self {
        let mut dense: HashMap<BlockKey, Box<BlockData>> = HashMap::new();
        for (&voxel, &value) in evidence {
            let (key, offset) = locate(voxel);
            dense.entry(key).or_insert_with(|| Box::new([0; BLOCK_VOXELS]))[offset] = value;
        }
        let stored = |(key, values): (BlockKey, Box<BlockData>)| {
            let compact = key.iter().sum::<i32>() % 2 == 0;
            let stored = match values[0] {
                first if compact && values.iter().all(|&value| value == first) => Stored::Uniform(first),
                _ if compact => Stored::Narrow(Box::new(values.map(|value| value as i16))),
                _ => Stored::Dense(values),
            };
            (key, stored)
        };
        Self { blocks: dense.into_iter().map(stored).collect(), prior }
    }
}

impl Blocks for Map {
    fn keys(&self) -> Vec<BlockKey> {
        self.blocks.keys().copied().collect()
    }
    fn block(&self, key: BlockKey) -> Option<Block<'_>> {
        self.blocks.get(&key).map(|stored| match stored {
            Stored::Uniform(value) => Block::Uniform(*value),
            Stored::Narrow(values) => Block::Narrow(values),
            Stored::Dense(values) => Block::Dense(values),
        })
    }
    fn voxel_size(&self) -> f64 {
        VOXEL_SIZE
    }
    fn prior_log_odds(&self) -> f64 {
        self.prior
    }
}

/// A box of voxels, all with the same evidence.
fn cuboid(x: Range<i32>, y: Range<i32>, z: Range<i32>, value: i32) -> BTreeMap<VoxelIndex, i32> {
    let voxels = x.flat_map(|x| {
        y.clone().flat_map({
            let z = z.clone();
            move |y| z.clone().map(move |z| [x, y, z])
        })
    });
    voxels.map(|voxel| (voxel, value)).collect()
}

fn frontiers(evidence: &BTreeMap<VoxelIndex, i32>) -> Vec<Frontier> {
    find(&Map::new(evidence, 0.0), &FrontierOptions::default()).unwrap()
}

/// A free box, or one that is full of random states with many that are unknown, over blocks of either sign.
fn random_map(seed: u32) -> BTreeMap<VoxelIndex, i32> {
    let mut noise = seed.wrapping_mul(0x9E37_79B9) | 1;
    let mut random = move |below: u32| {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (noise >> 12) % below
    };
    let mut map = cuboid(-16..16, -16..8, -8..16, -500);
    for _ in 0..40 {
        let [x, y, z] = [random(30) as i32 - 16, random(22) as i32 - 16, random(22) as i32 - 8];
        let [a, b, c] = [1 + random(9) as i32, 1 + random(9) as i32, 1 + random(9) as i32];
        let value = [0, 0, -1, 700, 300, -3][random(6) as usize];
        map.extend(cuboid(x..(x + a).min(16), y..(y + b).min(8), z..(z + c).min(16), value));
    }
    // Single voxels that nobody has seen, so that frontiers are ragged and small ones abound.
    for (_, value) in map.iter_mut() {
        if random(50) == 0 {
            *value = 0;
        }
    }
    map
}

fn add(voxel: VoxelIndex, step: [i32; 3]) -> VoxelIndex {
    std::array::from_fn(|axis| voxel[axis] + step[axis])
}

const FACES: [[i32; 3]; 6] = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];

/// By the definition, voxel by voxel: sets of voxels, unsorted by size.
fn naive(evidence: &BTreeMap<VoxelIndex, i32>, prior: f64) -> BTreeSet<Vec<VoxelIndex>> {
    let at = |voxel: VoxelIndex| evidence.get(&voxel).copied().unwrap_or(0);
    let free = |value: i32| value != 0 && f64::from(value) * UNIT + prior <= 0.0;
    let of_frontier = |voxel: &VoxelIndex| free(at(*voxel)) && FACES.iter().any(|&step| at(add(*voxel, step)) == 0);
    let mut left: BTreeSet<VoxelIndex> = evidence.keys().copied().filter(of_frontier).collect();
    let mut clusters = BTreeSet::new();
    while let Some(first) = left.pop_first() {
        let (mut cluster, mut open) = (vec![first], vec![first]);
        while let Some(voxel) = open.pop() {
            for n in 0..27 {
                let near = add(voxel, [n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1]);
                if left.remove(&near) {
                    cluster.push(near);
                    open.push(near);
                }
            }
        }
        cluster.sort_unstable();
        clusters.insert(cluster);
    }
    clusters
}

fn voxels(frontiers: &[Frontier]) -> BTreeSet<Vec<VoxelIndex>> {
    frontiers.iter().map(|frontier| frontier.voxels.clone()).collect()
}

#[test]
fn the_same_clusters_as_voxel_by_voxel() {
    for (seed, prior) in [(1, 0.0), (2, 0.0), (3, 0.1), (4, -0.1), (5, -300.0 * UNIT)] {
        let evidence = random_map(seed);
        let found = find(&Map::new(&evidence, prior), &FrontierOptions::default()).unwrap();
        let expected = naive(&evidence, prior);
        assert!(expected.len() > 3, "a map that shows something");
        assert_eq!(voxels(&found), expected);
        let keys: Vec<_> = found.iter().map(|f| (std::cmp::Reverse(f.voxels.len()), f.voxels[0])).collect();
        assert!(keys.is_sorted(), "the largest first");
    }
}

#[test]
fn numbers_follow_from_the_voxels() {
    let evidence = random_map(6);
    let unknown = |voxel: VoxelIndex| evidence.get(&voxel).copied().unwrap_or(0) == 0;
    for frontier in frontiers(&evidence) {
        let (mut sum, mut normal, mut area) = ([0.0; 3], [0.0; 3], 0.0);
        for &voxel in &frontier.voxels {
            let mut along = [0.0f64; 3];
            for step in FACES.into_iter().filter(|&step| unknown(add(voxel, step))) {
                for axis in 0..3 {
                    normal[axis] += f64::from(step[axis]);
                    along[axis] += f64::from(step[axis].abs());
                }
            }
            area += along.iter().map(|n| n * n).sum::<f64>().sqrt() * VOXEL_SIZE.powi(2);
            (0..3).for_each(|axis| sum[axis] += (f64::from(voxel[axis]) + 0.5) * VOXEL_SIZE);
        }
        let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt().max(1.0);
        for axis in 0..3 {
            // Sums of some thousand numbers, each rounded to 1e-16 of itself.
            assert!((frontier.centre[axis] - sum[axis] / frontier.voxels.len() as f64).abs() < 1e-10);
            assert!((frontier.normal[axis] - normal[axis] / length).abs() < 1e-12);
        }
        assert!((frontier.area - area).abs() < 1e-10);
    }
}

#[test]
fn the_end_of_a_corridor() {
    // Walled in on all sides but the far end, across several blocks, some of them free throughout.
    let mut corridor = cuboid(-9..41, -1..17, -1..17, 800);
    corridor.extend(cuboid(-8..41, 0..16, 0..16, -400));
    let found = frontiers(&corridor);
    assert_eq!(found.len(), 1);
    let [end] = &found[..] else { unreachable!() };
    assert_eq!(end.voxels.len(), 16 * 16);
    assert!(end.voxels.iter().all(|voxel| voxel[0] == 40));
    assert_eq!(end.normal, [1.0, 0.0, 0.0]);
    // Products of a few numbers around 1.
    assert!((end.area - (16.0 * VOXEL_SIZE).powi(2)).abs() < 1e-12);
    let expected = [40.5, 8.0, 8.0].map(|c| c * VOXEL_SIZE);
    assert!(end.centre.iter().zip(expected).all(|(got, expected)| (got - expected).abs() < 1e-12));
}

#[test]
fn a_diagonal_sheet_is_in_one_piece() {
    // Free where x + y < 20, with walls around: the frontier is a flight of stairs at 45 degrees.
    let mut wedge = cuboid(-1..21, -1..21, -1..9, 800);
    wedge.retain(|&[x, y, _], _| x < 0 || y < 0 || x + y < 20);
    wedge.extend(cuboid(0..20, 0..20, 0..8, -400).into_iter().filter(|([x, y, _], _)| x + y < 20));
    // Walls seen on both sides of the free part in z; what lies on the stairs' far side is unknown.
    let found = frontiers(&wedge);
    assert_eq!(found.len(), 1);
    let diagonal = std::f64::consts::FRAC_1_SQRT_2;
    assert_eq!(found[0].voxels.len(), 20 * 8);
    assert!((found[0].normal[0] - diagonal).abs() < 1e-12 && (found[0].normal[1] - diagonal).abs() < 1e-12);
    // 20 steps, each a diagonal of a voxel wide.
    let area = 20.0 * 8.0 * 2f64.sqrt() * VOXEL_SIZE.powi(2);
    assert!((found[0].area - area).abs() < 1e-12);
}

#[test]
fn nothing_to_find() {
    assert!(frontiers(&BTreeMap::new()).is_empty());
    // Occupied, and unknown although it is stored: no free voxel.
    assert!(frontiers(&cuboid(0..8, 0..8, 0..8, 300)).is_empty());
    assert!(frontiers(&cuboid(0..8, 0..8, 0..8, 0)).is_empty());
    // A lone free voxel sees unknown all around: a frontier without a direction.
    let lone = frontiers(&cuboid(3..4, 3..4, 3..4, -1));
    assert_eq!(lone.len(), 1);
    assert_eq!(lone[0].normal, [0.0; 3]);
}

#[test]
fn small_clusters_are_left_out() {
    let evidence = random_map(7);
    let all = frontiers(&evidence);
    let min_size = all[all.len() / 2].voxels.len();
    let options = FrontierOptions { min_size, ..FrontierOptions::default() };
    let large = find(&Map::new(&evidence, 0.0), &options).unwrap();
    let expected: Vec<_> = all.iter().filter(|frontier| frontier.voxels.len() >= min_size).cloned().collect();
    assert!(expected.len() < all.len());
    assert_eq!(large, expected);
}

#[test]
fn large_clusters_are_divided() {
    let evidence = random_map(8);
    let map = Map::new(&evidence, 0.0);
    let whole = frontiers(&evidence);
    for voxels_long in [8, 11, 16, 1000] {
        let max_extent = Some(f64::from(voxels_long) * VOXEL_SIZE);
        let parts = find(&map, &FrontierOptions { min_size: 20, max_extent }).unwrap();
        for part in &parts {
            for axis in 0..3 {
                let along = part.voxels.iter().map(|voxel| voxel[axis]);
                assert!(along.clone().max().unwrap() - along.min().unwrap() < voxels_long);
            }
        }
        // Clusters below the least size are gone, and parts of larger ones are all there, each voxel once.
        let mut found: Vec<_> = parts.iter().flat_map(|part| part.voxels.clone()).collect();
        let mut expected: Vec<_> =
            whole.iter().filter(|f| f.voxels.len() >= 20).flat_map(|f| f.voxels.clone()).collect();
        found.sort_unstable();
        expected.sort_unstable();
        assert_eq!(found, expected);
        if voxels_long == 1000 {
            assert_eq!(parts.len(), whole.iter().filter(|f| f.voxels.len() >= 20).count());
        }
    }
}

#[test]
fn extents_below_a_block_are_refused() {
    let map = Map::new(&random_map(9), 0.0);
    for extent in [0.0, -1.0, f64::NAN, 7.9 * VOXEL_SIZE] {
        let options = FrontierOptions { min_size: 1, max_extent: Some(extent) };
        let Err(Error::Parameter { name, got, expected }) = find(&map, &options) else { panic!("{extent} was taken") };
        assert_eq!(
            (name, got, &expected[..]),
            ("max_extent", extent.to_string(), "at least the edge of a block, 0.4 m")
        );
    }
    let options = FrontierOptions { min_size: 1, max_extent: Some(f64::from(EDGE) * VOXEL_SIZE) };
    assert!(find(&map, &options).is_ok());
    assert!(find(&map, &FrontierOptions { max_extent: Some(f64::INFINITY), ..options }).is_ok());
}
