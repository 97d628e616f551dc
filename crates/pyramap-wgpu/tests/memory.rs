//! A device that runs out of memory: the map stays as it was, and goes on with what it has.
//!
//! In a process of its own, which gives itself little memory; a software adapter takes its memory from there.
#![cfg(target_os = "linux")]

mod common;

use pyramap::backend::{Addition, Backend, Committed, Source};
use pyramap::block::BLOCK_VOXELS;
use pyramap::error::DeviceFault;
use pyramap::log_odds::Limits;
use pyramap::{Error, GridConfig};
use pyramap_wgpu::frame::Room;
use pyramap_wgpu::{Gpu, GpuBackend, Sizes};

/// Bytes that the process may still take: less than three of the pages below, and room for all else.
const LEFT: u64 = 160 << 20;

/// Lets the process have so many more bytes of address space.
fn limit_memory(more: u64) {
    let pages: u64 = std::fs::read_to_string("/proc/self/statm").unwrap().split(' ').next().unwrap().parse().unwrap();
    let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: both calls are given a struct of the type that they want.
    unsafe {
        let page_size = u64::try_from(libc::sysconf(libc::_SC_PAGESIZE)).unwrap();
        assert_eq!(libc::getrlimit(libc::RLIMIT_AS, &mut limit), 0);
        limit.rlim_cur = pages * page_size + more;
        assert_eq!(libc::setrlimit(libc::RLIMIT_AS, &limit), 0);
    }
}

#[test]
fn a_map_that_outgrows_the_device_stays_as_it_was() {
    let Some(software) = common::gpu().and_then(|_| common::software()) else {
        return eprintln!("skipped: there is no software adapter, and a card's memory cannot be limited");
    };
    let gpu = Gpu::open(Some(&software)).unwrap();
    let sizes = Sizes { page_blocks: 32_768, room: Room { free: 4, mixed: 4, page_blocks: 4 } };
    let mut backend = GpuBackend::on(gpu, &GridConfig::new(0.05).unwrap(), sizes).unwrap();
    backend.reserve(1).unwrap();
    let slot = backend.allocate();
    let add = |backend: &mut GpuBackend, base| {
        let limits = Limits { low: i32::MIN, high: i32::MAX };
        backend.commit(&[Addition { slot, base, source: Source::Uniform(21) }], 1, limits).unwrap();
        backend.committed(&mut Committed::default()).unwrap();
    };
    add(&mut backend, Some(0));

    limit_memory(LEFT);
    let before = backend.pool_bytes();
    match backend.reserve(10 * sizes.page_blocks) {
        Err(Error::Device { fault: DeviceFault::OutOfMemory, reason }) => {
            assert!(reason.contains("a page of the map") && reason.contains(&software), "{reason}");
        }
        other => panic!("expected that memory runs out, got {other:?}"),
    }
    // Pages that could be made are kept for next time.
    assert!((before..before + 4 * (64 << 20)).contains(&backend.pool_bytes()));
    add(&mut backend, None);
    backend.fetch().unwrap();
    assert_eq!(backend.read(slot).to_data(), [42; BLOCK_VOXELS]);
}
