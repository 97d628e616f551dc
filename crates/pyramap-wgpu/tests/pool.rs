//! Slots, pages, and blocks on their way to the device and back.

mod common;

use common::Random;
use pyramap::Error;
use pyramap::block::{BLOCK_VOXELS, BlockData};
use pyramap_wgpu::pool::{BLOCK_BYTES, Pool};
use std::collections::BTreeMap;

const PAGE_BLOCKS: usize = 3;

fn block(seed: u64) -> BlockData {
    let mut random = Random(seed);
    std::array::from_fn(|_| random.number() as i32)
}

#[test]
fn pages_are_made_when_slots_run_out() {
    let Some(gpu) = common::gpu() else { return };
    let page = PAGE_BLOCKS * BLOCK_BYTES as usize;
    let mut pool = Pool::new(PAGE_BLOCKS).unwrap();
    assert_eq!((pool.bytes(), pool.growth(1), pool.growth(3), pool.growth(4)), (0, page, page, 2 * page));
    pool.reserve(&gpu, 4).unwrap();
    assert_eq!((pool.bytes(), pool.growth(6), pool.growth(7)), (2 * page, 0, page));
    assert_eq!((0..4).map(|_| pool.allocate()).collect::<Vec<_>>(), [0, 1, 2, 3]);
    assert_eq!((pool.growth(2), pool.growth(3)), (0, page));

    pool.release(1);
    pool.release(2);
    assert_eq!((pool.growth(4), pool.growth(5)), (0, page));
    let mut again = [pool.allocate(), pool.allocate()];
    again.sort();
    assert_eq!((again, pool.allocate()), ([1, 2], 4));
    assert_eq!(pool.bytes(), 2 * page);
}

#[test]
fn growth_keeps_what_is_there() {
    let Some(gpu) = common::gpu() else { return };
    let mut pool = Pool::new(PAGE_BLOCKS).unwrap();
    let mut random = Random(5);
    let mut written: BTreeMap<u32, BlockData> = BTreeMap::new();
    for round in 0..6 {
        let new = 1 + random.below(5);
        pool.reserve(&gpu, new).unwrap();
        let mut slots: Vec<_> = (0..new).map(|_| pool.allocate()).collect();
        // Some that were there before are written again, in runs and alone.
        slots.extend(written.keys().copied().filter(|_| random.once_in(3)));
        slots.sort();
        slots.dedup();
        written.extend(slots.iter().map(|&slot| (slot, block(u64::from(slot) + 100 * round))));
        pool.scatter(&gpu, &slots, |slot| &written[&slot]).unwrap();

        let mut read = BTreeMap::new();
        let all: Vec<_> = written.keys().copied().collect();
        pool.gather(&gpu, &all, |slot, block| assert!(read.insert(slot, block).is_none())).unwrap();
        assert!(read == written, "round {round}");
        if let Some(&slot) = written.keys().find(|_| random.once_in(4)) {
            pool.release(slot);
            written.remove(&slot);
        }
    }
    assert!(pool.pages().len() > 3);
}

#[test]
fn only_the_blocks_that_are_asked_for_are_read() {
    let Some(gpu) = common::gpu() else { return };
    let mut pool = Pool::new(PAGE_BLOCKS).unwrap();
    pool.reserve(&gpu, 10).unwrap();
    let slots: Vec<_> = (0..10).map(|_| pool.allocate()).collect();
    let blocks: Vec<_> = (0..10).map(|n| [n; BLOCK_VOXELS]).collect();
    pool.scatter(&gpu, &slots, |slot| &blocks[slot as usize]).unwrap();
    let mut read = Vec::new();
    pool.gather(&gpu, &[1, 4, 5, 6, 9], |slot, block| read.push((slot, block[0], block[BLOCK_VOXELS - 1]))).unwrap();
    assert_eq!(read, [1, 4, 5, 6, 9].map(|n| (n, n as i32, n as i32)));
}

#[test]
fn pages_that_no_device_binds_are_refused() {
    for page_blocks in [0, 32_769] {
        match Pool::new(page_blocks) {
            Err(Error::Parameter { name: "page_blocks", got, expected }) => {
                assert_eq!((got, expected.as_str()), (page_blocks.to_string(), "between 1 and 32768"));
            }
            _ => panic!("{page_blocks} blocks in a page were taken"),
        }
    }
}
