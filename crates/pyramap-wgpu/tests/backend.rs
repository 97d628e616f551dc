//! A map's place on a device: what is read, when it crosses, and what becomes of it when the device goes away.

mod common;

use pyramap::backend::{Addition, Backend, Committed, Source};
use pyramap::block::{BLOCK_VOXELS, BlockData};
use pyramap::error::DeviceFault;
use pyramap::log_odds::Limits;
use pyramap::{Depth, DepthImage, Error, GridConfig, OccupancyGrid, PinholeCamera, Pose, UpdateRule};
use pyramap_wgpu::frame::Room;
use pyramap_wgpu::{Gpu, GpuBackend, Sizes};
use std::sync::Arc;

const LIMITS: Limits = Limits { low: i32::MIN, high: i32::MAX };
const SMALL: Sizes = Sizes { page_blocks: 3, room: Room { free: 4, mixed: 4, page_blocks: 5 } };

fn config() -> GridConfig {
    GridConfig::new(0.05).unwrap()
}

fn on(gpu: &Arc<Gpu>) -> GpuBackend {
    GpuBackend::on(gpu.clone(), &config(), SMALL).unwrap()
}

fn slots(backend: &mut GpuBackend, count: usize) -> Vec<u32> {
    backend.reserve(count).unwrap();
    (0..count).map(|_| backend.allocate()).collect()
}

fn add(backend: &mut GpuBackend, slots: &[u32], base: Option<i32>, increment: i32) -> Committed {
    let addition = |&slot: &u32| Addition { slot, base, source: Source::Uniform(increment) };
    backend.commit(&slots.iter().map(addition).collect::<Vec<_>>(), 1, LIMITS).unwrap();
    let mut committed = Committed::default();
    backend.committed(&mut committed).unwrap();
    committed
}

fn ramp(first: i32) -> BlockData {
    std::array::from_fn(|i| first + i as i32)
}

fn fault<T>(result: Result<T, Error>) -> (DeviceFault, String) {
    match result {
        Err(Error::Device { fault, reason }) => (fault, reason),
        Err(other) => panic!("another error: {other}"),
        Ok(_) => panic!("no error"),
    }
}

#[test]
fn only_what_changed_is_fetched() {
    let Some(gpu) = common::gpu() else { return };
    let mut backend = on(&gpu);
    let slots = slots(&mut backend, 11);
    add(&mut backend, &slots, Some(5), 1);
    backend.fetch().unwrap();
    assert_eq!(backend.blocks_fetched(), 11);
    slots.iter().for_each(|&slot| assert_eq!(backend.read(slot).to_data(), [6; BLOCK_VOXELS]));
    backend.fetch().unwrap();
    assert_eq!(backend.blocks_fetched(), 11);

    add(&mut backend, &[slots[9], slots[2]], None, 10);
    // What was given back is not read, and what is written comes from here.
    backend.release(slots[4]);
    backend.write(slots[7], &ramp(3));
    backend.fetch().unwrap();
    assert_eq!(backend.blocks_fetched(), 13);
    assert_eq!(backend.read(slots[2]).to_data(), [16; BLOCK_VOXELS]);
    assert_eq!(backend.read(slots[9]).to_data(), [16; BLOCK_VOXELS]);
    assert_eq!(backend.read(slots[3]).to_data(), [6; BLOCK_VOXELS]);
    assert_eq!(backend.read(slots[7]).to_data(), ramp(3));
}

#[test]
fn reading_fetches_if_nobody_did() {
    let Some(gpu) = common::gpu() else { return };
    let mut backend = on(&gpu);
    let slots = slots(&mut backend, 2);
    add(&mut backend, &slots, Some(-3), 1);
    assert_eq!(backend.read(slots[1]).to_data(), [-2; BLOCK_VOXELS]);
    assert_eq!(backend.blocks_fetched(), 2);
}

#[test]
fn additions_see_what_was_written() {
    let Some(gpu) = common::gpu() else { return };
    let mut backend = on(&gpu);
    let slots = slots(&mut backend, 8);
    (0..3).for_each(|round| slots.iter().for_each(|&slot| backend.write(slot, &ramp(100 * round + slot as i32))));
    assert_eq!(add(&mut backend, &slots[1..], None, 7).uniform, []);
    for &slot in &slots {
        let added = if slot == slots[0] { 0 } else { 7 };
        assert_eq!(backend.read(slot).to_data(), ramp(200 + slot as i32 + added), "slot {slot}");
    }
    assert_eq!(backend.blocks_fetched(), 7);
}

#[test]
fn more_may_be_written_than_waits_to_be_sent() {
    const MANY: usize = 5000;
    let Some(gpu) = common::gpu() else { return };
    let mut backend = GpuBackend::on(gpu, &config(), Sizes::default()).unwrap();
    let slots = slots(&mut backend, MANY);
    slots.iter().for_each(|&slot| backend.write(slot, &ramp(slot as i32)));
    add(&mut backend, &[slots[0], slots[4097], slots[MANY - 1]], None, 1);
    for n in [0, 1, 4095, 4096, 4097, MANY - 2, MANY - 1] {
        let added = i32::from([0, 4097, MANY - 1].contains(&n));
        assert_eq!(backend.read(slots[n]).to_data(), ramp(n as i32 + added), "block {n}");
    }
    assert_eq!(backend.blocks_fetched(), 3);
}

#[test]
fn many_threads_may_read() {
    let Some(gpu) = common::gpu() else { return };
    let mut backend = on(&gpu);
    let slots = slots(&mut backend, 20);
    add(&mut backend, &slots, Some(1), 1);
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| slots.iter().for_each(|&slot| assert_eq!(backend.read(slot).value(slot as usize), 2)));
        }
    });
    assert_eq!(backend.blocks_fetched(), 20);
}

#[test]
fn blocks_of_one_value_are_reported_and_pages_counted() {
    let Some(gpu) = common::gpu() else { return };
    let mut backend = on(&gpu);
    assert_eq!((backend.pool_bytes(), backend.table_growth(4)), (0, 6 * 2048));
    let slots = slots(&mut backend, 4);
    assert_eq!((backend.pool_bytes(), backend.table_growth(2), backend.table_growth(3)), (6 * 2048, 0, 3 * 2048));
    (0..4).for_each(|n| backend.write(slots[n], &ramp(0)));
    let base = |n: usize| if n.is_multiple_of(2) { Some(n as i32) } else { None };
    let additions: Vec<_> =
        (0..4).map(|n| Addition { slot: slots[n], base: base(n), source: Source::Uniform(5) }).collect();
    backend.commit(&additions, -1, LIMITS).unwrap();
    let mut committed = Committed::default();
    backend.committed(&mut committed).unwrap();
    assert_eq!((committed.lost, committed.uniform), (0, vec![(0, -5), (2, -3)]));
}

#[test]
fn a_small_budget_is_used_and_kept() {
    let Some(gpu) = common::gpu() else { return };
    let budget = 512 << 10;
    let mut config = config();
    config.max_bytes = Some(budget);
    let backend = GpuBackend::on(gpu, &config, Sizes::of(&config)).unwrap();
    let mut grid = OccupancyGrid::with_backend(config, Box::new(backend)).unwrap();
    let full = (0..100).map(|n| integrate(&mut grid, 0.4 + 0.1 * n as f32)).find_map(Result::err);
    assert!(matches!(full, Some(Error::MapFull { .. })), "{full:?}");
    assert!((budget / 2..=budget).contains(&grid.nbytes()), "{} bytes", grid.nbytes());
}

#[test]
fn the_ideal_rule_is_refused() {
    let Some(gpu) = common::gpu() else { return };
    let mut config = config();
    config.update = UpdateRule::Ideal;
    match GpuBackend::on(gpu, &config, SMALL).err() {
        Some(error @ Error::Unsupported { .. }) => assert!(error.to_string().contains("cpu"), "{error}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn maps_share_a_device_by_adapter() {
    let Some(gpu) = common::gpu() else { return };
    let again = Gpu::open(Some(&gpu.name().to_uppercase())).unwrap();
    assert!(Arc::ptr_eq(&gpu, &again));
    let (fault, reason) = fault(Gpu::open(Some("no such card")));
    assert_eq!(fault, DeviceFault::NotFound);
    assert!(reason.contains("no such card") && reason.contains(gpu.name()), "{reason}");
}

const WIDTH: usize = 64;
const HEIGHT: usize = 48;

fn integrate(grid: &mut OccupancyGrid, metres: f32) -> Result<(), Error> {
    let camera = PinholeCamera::new(WIDTH, HEIGHT, 60.0, 60.0, 31.5, 23.5).unwrap();
    let depth = vec![metres; WIDTH * HEIGHT];
    grid.integrate(&DepthImage::new(Depth::F32(&depth), WIDTH, HEIGHT).unwrap(), &camera, &Pose::identity()).map(|_| ())
}

#[test]
fn maps_of_many_threads_share_a_device() {
    let Some(gpu) = common::gpu() else { return };
    let gpu = &gpu;
    std::thread::scope(|scope| {
        for thread in 0..8 {
            scope.spawn(move || {
                let mut backend = on(gpu);
                let slots = slots(&mut backend, 7);
                add(&mut backend, &slots, Some(thread), 0);
                // Each thread waits for the device, which may be done with another's work.
                for round in 0..100 {
                    add(&mut backend, &slots, None, 1);
                    assert_eq!(backend.read(slots[3]).to_data(), [thread + round + 1; BLOCK_VOXELS]);
                }
            });
        }
    });
}

#[test]
fn a_map_on_a_device_that_an_application_owns() {
    let Some((device, queue)) = common::own_device() else { return };
    let backend = GpuBackend::with_device(device.clone(), queue, "the robot's card", &config()).unwrap();
    let mut grid = OccupancyGrid::with_backend(config(), Box::new(backend)).unwrap();
    assert_eq!((grid.backend(), grid.adapter()), ("gpu", Some("the robot's card")));
    integrate(&mut grid, 1.5).unwrap();
    assert!(grid.num_observed().unwrap() > 10_000);
    drop(grid);
    // The application's device is none the worse for it.
    let usage = wgpu::BufferUsages::STORAGE;
    let descriptor = wgpu::BufferDescriptor { label: None, size: 16, usage, mapped_at_creation: false };
    assert_eq!(device.create_buffer(&descriptor).size(), 16);
    device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
}

#[test]
fn a_device_that_goes_away_is_an_error_and_what_was_read_stays() {
    let Some((device, queue)) = common::own_device() else { return };
    let gpu = Arc::new(Gpu::owned_elsewhere(device.clone(), queue, "a card".into()).unwrap());
    let mut backend = on(&gpu);
    let slots = slots(&mut backend, 6);
    add(&mut backend, &slots, Some(1), 1);
    backend.fetch().unwrap();
    let mut grid = OccupancyGrid::with_backend(config(), Box::new(on(&gpu))).unwrap();
    integrate(&mut grid, 1.5).unwrap();

    device.destroy();
    // All that is on the host: nothing is asked of the device.
    backend.fetch().unwrap();
    let additions = [Addition { slot: slots[2], base: None, source: Source::Uniform(1) }];
    let lost = backend.commit(&additions, 1, LIMITS).and_then(|()| backend.committed(&mut Committed::default()));
    let (kind, reason) = fault(lost);
    assert_eq!(kind, DeviceFault::Lost);
    assert!(reason.contains("a card was lost"), "{reason}");
    // One block was to change, and is gone; the others are here.
    assert_eq!(fault(backend.fetch()).0, DeviceFault::Lost);
    assert_eq!(backend.read(slots[3]).to_data(), [2; BLOCK_VOXELS]);
    assert_eq!(fault(backend.reserve(100)).0, DeviceFault::Lost);

    let before = (grid.num_blocks(), grid.num_frames());
    assert_eq!(fault(integrate(&mut grid, 1.4)).0, DeviceFault::Lost);
    assert_eq!(fault(grid.num_observed()).0, DeviceFault::Lost);
    assert_eq!((grid.num_blocks(), grid.num_frames()), before);
}

#[test]
fn a_device_lost_under_way() {
    let Some((device, queue)) = common::own_device() else { return };
    let gpu = Arc::new(Gpu::owned_elsewhere(device.clone(), queue, "a card".into()).unwrap());
    let mut backend = on(&gpu);
    let slots = slots(&mut backend, 6);
    let addition = |&slot: &u32| Addition { slot, base: Some(0), source: Source::Uniform(1) };
    backend.commit(&slots.iter().map(addition).collect::<Vec<_>>(), 1, LIMITS).unwrap();
    device.destroy();
    // The commit may still have been done; the next thing that is asked of the device is not.
    let outcome = backend.committed(&mut Committed::default()).and_then(|()| backend.fetch());
    assert_eq!(fault(outcome).0, DeviceFault::Lost);
    assert_eq!(fault(gpu.check()).0, DeviceFault::Lost);
}

#[test]
fn what_the_driver_refuses_is_an_error() {
    let Some(gpu) = common::gpu() else { return };
    let (kind, reason) = fault(gpu.pipeline("nonsense", "fn main( {", "main"));
    assert_eq!(kind, DeviceFault::Internal);
    assert!(reason.contains("nonsense"), "{reason}");
    let most = gpu.device().limits().max_buffer_size;
    let (kind, reason) = fault(gpu.buffer("a giant", most + 4, wgpu::BufferUsages::COPY_DST));
    assert_eq!(kind, DeviceFault::OutOfMemory);
    assert!(reason.contains("a giant") && reason.contains(&most.to_string()), "{reason}");
    let buffer = gpu.buffer("small", 16, wgpu::BufferUsages::COPY_DST).unwrap();
    assert_eq!(fault(gpu.write(&buffer, 12, &[0; 8])).0, DeviceFault::Internal);
    // The device goes on.
    gpu.write(&buffer, 8, &[0; 8]).unwrap();
}
