//! What the device adds is what integers say, across all borders of pages.

mod common;

use common::Random;
use pyramap::backend::{Addition, Committed, Source};
use pyramap::block::{BLOCK_VOXELS, BlockData};
use pyramap::log_odds::Limits;
use pyramap_wgpu::Gpu;
use pyramap_wgpu::commit::{Commit, Increments};
use pyramap_wgpu::pool::Pool;
use std::collections::BTreeMap;
use wgpu::{Buffer, BufferUsages};

/// Three blocks in a page of the pool and five in one of increments, so that both have many, and their borders differ.
const PAGE_BLOCKS: usize = 3;
const INCREMENT_PAGE_BLOCKS: usize = 5;
/// Above twice the pages that a kernel sees at a time.
const SLOTS: usize = 40;
const EVERYTHING: Limits = Limits { low: i32::MIN, high: i32::MAX };

/// One voxel, by arithmetic that cannot overflow; and whether 32 bits are too few.
fn naive(value: i32, increment: i32, sign: i32, limits: Limits) -> (i32, bool) {
    let sum = i64::from(value) + i64::from(increment) * i64::from(sign);
    let kept = sum.clamp(i64::from(i32::MIN), i64::from(i32::MAX));
    (kept.clamp(i64::from(limits.low), i64::from(limits.high)) as i32, kept != sum)
}

fn pages(gpu: &Gpu, increments: &[BlockData]) -> Vec<Buffer> {
    let page = |blocks: &[BlockData]| {
        let bytes: &[u8] = bytemuck::cast_slice(blocks);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let page = gpu.buffer("increments", bytes.len() as u64, usage).unwrap();
        gpu.write(&page, 0, bytes).unwrap();
        page
    };
    increments.chunks(INCREMENT_PAGE_BLOCKS).map(page).collect()
}

fn full_pool(gpu: &Gpu, contents: &BTreeMap<u32, BlockData>) -> Pool {
    let mut pool = Pool::new(PAGE_BLOCKS).unwrap();
    pool.reserve(gpu, contents.len()).unwrap();
    contents.keys().for_each(|&slot| assert_eq!(pool.allocate(), slot));
    pool.scatter(gpu, &contents.keys().copied().collect::<Vec<_>>(), |slot| &contents[&slot]).unwrap();
    pool
}

fn contents(gpu: &Gpu, pool: &Pool, slots: usize) -> BTreeMap<u32, BlockData> {
    let mut contents = BTreeMap::new();
    let all: Vec<_> = (0..slots as u32).collect();
    pool.gather(gpu, &all, |slot, block| assert!(contents.insert(slot, block).is_none())).unwrap();
    contents
}

/// Voxels of all sizes, now and then near the ends of `i32`.
fn voxel(random: &mut Random) -> i32 {
    match random.below(8) {
        0 => i32::MAX - random.below(5000) as i32,
        1 => i32::MIN + random.below(5000) as i32,
        _ => random.below(40_001) as i32 - 20_000,
    }
}

/// A block of one value every third time.
fn block(random: &mut Random) -> BlockData {
    let first = voxel(random);
    if random.once_in(3) { [first; BLOCK_VOXELS] } else { std::array::from_fn(|_| voxel(random)) }
}

#[test]
fn sums_are_those_of_integers() {
    let Some(gpu) = common::gpu() else { return };
    let mut commit = Commit::new(&gpu).unwrap();
    let clamped = Limits { low: -8000, high: 12_000 };
    for (seed, sign, limits) in [(1, 1, EVERYTHING), (2, -1, EVERYTHING), (3, 1, clamped), (4, -1, clamped)] {
        let mut random = Random(seed);
        let mut map: BTreeMap<u32, BlockData> = (0..SLOTS as u32).map(|slot| (slot, block(&mut random))).collect();
        let pool = full_pool(&gpu, &map);
        // Increments of a frame fit 31 bits with either sign.
        let increments: Vec<BlockData> =
            (0..SLOTS).map(|_| block(&mut random).map(|value| value.max(-i32::MAX))).collect();
        let increment_pages = pages(&gpu, &increments);

        let mut blocks = random.order(SLOTS).into_iter();
        let slots = random.order(SLOTS).into_iter().take(SLOTS - 7);
        let additions: Vec<_> = slots
            .map(|slot| Addition {
                slot: slot as u32,
                base: random.once_in(3).then(|| voxel(&mut random)),
                source: match random.below(3) {
                    0 => Source::Uniform(voxel(&mut random).max(-i32::MAX)),
                    _ => Source::Mixed(blocks.next().unwrap()),
                },
            })
            .collect();

        let mut expected = Committed::default();
        for (n, addition) in additions.iter().enumerate() {
            let values = map.get_mut(&addition.slot).unwrap();
            for (i, value) in values.iter_mut().enumerate() {
                let increment = match addition.source {
                    Source::Uniform(increment) => increment,
                    Source::Mixed(n) => increments[n][i],
                };
                let (sum, lost) = naive(addition.base.unwrap_or(*value), increment, sign, limits);
                *value = sum;
                expected.lost += u64::from(lost);
            }
            if values.iter().all(|value| *value == values[0]) {
                expected.uniform.push((n, values[0]));
            }
        }
        assert!(expected.lost > 1000 && expected.uniform.len() > 2 && expected.uniform.len() < additions.len() - 5);

        let source = Increments { pages: &increment_pages, page_blocks: INCREMENT_PAGE_BLOCKS };
        commit.reserve(&gpu, &pool, additions.len(), increment_pages.len()).unwrap();
        commit.begin(&gpu, &pool, source, &additions, sign, limits).unwrap();
        let mut committed = Committed::default();
        commit.end(&gpu, &mut committed).unwrap();
        assert_eq!((committed.lost, &committed.uniform), (expected.lost, &expected.uniform), "seed {seed}");
        assert!(committed.seconds >= 0.0);
        assert!(contents(&gpu, &pool, SLOTS) == map, "voxels differ for seed {seed}");
    }
}

#[test]
fn more_additions_than_a_dispatch_has_workgroups() {
    const MANY: usize = 66_000;
    let Some(gpu) = common::gpu() else { return };
    // All slots lie in the pages of one dispatch.
    let mut pool = Pool::new(32_768).unwrap();
    pool.reserve(&gpu, MANY).unwrap();
    let additions: Vec<_> = (0..MANY)
        .map(|n| {
            let slot = pool.allocate();
            Addition { slot, base: Some(n as i32), source: Source::Uniform(1) }
        })
        .collect();
    let mut commit = Commit::new(&gpu).unwrap();
    commit.reserve(&gpu, &pool, MANY, 0).unwrap();
    let none = Increments { pages: &[], page_blocks: INCREMENT_PAGE_BLOCKS };
    commit.begin(&gpu, &pool, none, &additions, 1, EVERYTHING).unwrap();
    let mut committed = Committed::default();
    commit.end(&gpu, &mut committed).unwrap();
    let expected: Vec<_> = (0..MANY).map(|n| (n, n as i32 + 1)).collect();
    assert_eq!((committed.lost, committed.uniform == expected), (0, true));
    let probes = [0, 65_534, 65_535, MANY as u32 - 1];
    pool.gather(&gpu, &probes, |slot, block| assert_eq!(block, [slot as i32 + 1; BLOCK_VOXELS])).unwrap();
}

#[test]
fn nothing_to_add_is_no_work() {
    let Some(gpu) = common::gpu() else { return };
    let (mut commit, pool) = (Commit::new(&gpu).unwrap(), Pool::new(1).unwrap());
    commit.begin(&gpu, &pool, Increments { pages: &[], page_blocks: 1 }, &[], 1, EVERYTHING).unwrap();
    let mut committed = Committed { lost: 3, uniform: vec![(1, 2)], seconds: 1.0 };
    commit.end(&gpu, &mut committed).unwrap();
    assert_eq!((committed.lost, committed.uniform.len(), committed.seconds), (0, 0, 0.0));
}
