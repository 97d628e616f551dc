//! A process that is forked after the device was opened: the child gets errors and may read what its parent had read;
//! it neither hangs nor dies.
#![cfg(unix)]

mod common;

use pyramap::backend::{Addition, Backend, Committed, Source};
use pyramap::block::BLOCK_VOXELS;
use pyramap::error::DeviceFault;
use pyramap::log_odds::Limits;
use pyramap::{Error, GridConfig};
use pyramap_wgpu::{Gpu, GpuBackend};
use std::time::{Duration, Instant};

/// Longer than the child takes by orders of magnitude; shorter than anybody waits.
const PATIENCE: Duration = Duration::from_secs(20);

fn is_forked<T>(result: Result<T, Error>) -> bool {
    matches!(result, Err(Error::Device { fault: DeviceFault::Forked, reason }) if reason.contains("spawn"))
}

#[test]
fn a_child_gets_errors_and_lives() {
    let Some(gpu) = common::gpu() else { return };
    let config = GridConfig::new(0.05).unwrap();
    let mut backend = GpuBackend::on(gpu.clone(), &config, Default::default()).unwrap();
    backend.reserve(2).unwrap();
    let slots = [backend.allocate(), backend.allocate()];
    let limits = Limits { low: i32::MIN, high: i32::MAX };
    let add = |backend: &mut GpuBackend, slot, base| {
        let additions = [Addition { slot, base, source: Source::Uniform(7) }];
        backend.commit(&additions, 1, limits).and_then(|()| backend.committed(&mut Committed::default()))
    };
    add(&mut backend, slots[0], Some(0)).unwrap();
    add(&mut backend, slots[1], Some(1)).unwrap();
    backend.fetch().unwrap();

    // SAFETY: the child only calls what this test is about, allocates, and leaves by `_exit`. Other threads of this
    // process are the driver's.
    let child = unsafe { libc::fork() };
    if child == 0 {
        let mut wrong = 0;
        let mut expect = |bit: u32, holds: bool| wrong |= i32::from(!holds) << bit;
        // What the parent had read is there, as long as nothing changes.
        expect(0, backend.fetch().is_ok() && backend.read(slots[1]).to_data() == [8; BLOCK_VOXELS]);
        expect(1, is_forked(gpu.check()));
        expect(2, is_forked(add(&mut backend, slots[0], None)));
        expect(3, is_forked(backend.reserve(1)));
        expect(4, is_forked(Gpu::open(None)));
        expect(5, is_forked(pyramap_wgpu::adapters()));
        drop(backend);
        drop(gpu);
        // SAFETY: ends the child without the parent's clean-up.
        unsafe { libc::_exit(wrong) }
    }
    let (start, mut status) = (Instant::now(), 0);
    // SAFETY: the child is this process's own, and waited for once.
    while unsafe { libc::waitpid(child, &mut status, libc::WNOHANG) } == 0 {
        if start.elapsed() > PATIENCE {
            // SAFETY: it is still there, since it was not waited for.
            unsafe { libc::kill(child, libc::SIGKILL) };
            panic!("the child hangs");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    assert!(libc::WIFEXITED(status), "the child died of signal {}", libc::WTERMSIG(status));
    assert_eq!(libc::WEXITSTATUS(status), 0, "bits of what went wrong");

    // The parent goes on.
    add(&mut backend, slots[0], None).unwrap();
    assert_eq!(backend.read(slots[0]).to_data(), [14; BLOCK_VOXELS]);
}
