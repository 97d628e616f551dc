//! A map that has its blocks, and buffers that have their size, make room for nothing more: fusing allocates no memory.

use pyramap::{Depth, DepthImage, GridConfig, OccupancyGrid, PinholeCamera, Pose, UpdateRule};
use rayon::ThreadPoolBuilder;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

/// The system's allocator, which counts what each thread asks of it. To enlarge is to allocate: `realloc` is the
/// trait's own, which calls `alloc`.
struct Counting;

// SAFETY: all is left to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// How often this thread allocates memory while it does something.
fn allocations(mut work: impl FnMut()) -> usize {
    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
}

const WIDTH: usize = 160;
const HEIGHT: usize = 120;
const FRAMES: usize = 4;

/// A slanted wall with holes, a pillar before it, and a corner without return.
fn depth(frame: usize) -> Vec<f32> {
    let pixel = |u: usize, v: usize| match () {
        () if (u / 5 + v / 3 + frame).is_multiple_of(23) => 0.0,
        () if u < 20 && v < 40 => f32::INFINITY,
        () if u > 60 && u < 90 && v > 30 => 1.4,
        () => 2.2 + 0.008 * u as f32 - 0.006 * v as f32,
    };
    (0..WIDTH * HEIGHT).map(|i| pixel(i % WIDTH, i / WIDTH)).collect()
}

/// A turn about the vertical, and a step aside.
fn pose(frame: usize) -> Pose {
    let (sin, cos) = (0.2 * frame as f64).sin_cos();
    let rows = [[cos, 0.0, sin, 0.1 * frame as f64], [0.0, 1.0, 0.0, 0.0], [-sin, 0.0, cos, 0.0], [0.0, 0.0, 0.0, 1.0]];
    Pose::from_rows(&rows).unwrap()
}

#[test]
fn a_steady_map_allocates_nothing() {
    // All on this thread, whose allocations are counted. rayon's own, between threads, are not the map's.
    ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global().unwrap();
    let camera = PinholeCamera::new(WIDTH, HEIGHT, 145.0, 145.0, 80.0, 60.0).unwrap();
    let depths: Vec<_> = (0..FRAMES).map(depth).collect();
    let frames: Vec<_> = depths
        .iter()
        .enumerate()
        .map(|(n, depth)| (DepthImage::new(Depth::F32(depth), WIDTH, HEIGHT).unwrap(), pose(n)))
        .collect();

    for update in [UpdateRule::Pyramid, UpdateRule::Area, UpdateRule::MinLayer, UpdateRule::Ideal] {
        let mut config = GridConfig::new(0.08).unwrap();
        config.update = update;
        let mut grid = OccupancyGrid::new(config).unwrap();
        let first = allocations(|| {
            for (image, pose) in &frames {
                grid.integrate(image, &camera, pose).unwrap();
            }
        });
        assert!(first > grid.num_blocks() / 8, "{update:?}: a map of {} blocks in {first}", grid.num_blocks());
        // What is fused is taken off again: were evidence to grow from pass to pass, blocks would in time need more
        // than 16 bits a voxel, and with that other memory.
        let mut again = || {
            for (image, pose) in &frames {
                grid.integrate(image, &camera, pose).unwrap();
                grid.remove(image, &camera, pose).unwrap();
            }
        };
        again();
        assert_eq!(allocations(again), 0, "{update:?}");
    }

    // Where evidence is clamped, frames take blocks that are full out of the pool, and put others in.
    let mut config = GridConfig::new(0.08).unwrap();
    config.clamp = Some((-1.0, 1.5));
    let mut grid = OccupancyGrid::new(config).unwrap();
    let mut again = || {
        for (image, pose) in &frames {
            grid.integrate(image, &camera, pose).unwrap();
        }
    };
    (0..6).for_each(|_| again());
    assert_eq!(allocations(&mut again), 0, "clamped");
}

#[test]
fn every_allocation_is_counted() {
    let mut numbers = Vec::new();
    assert_eq!(allocations(|| numbers.push(Box::new(1))), 2);
    assert_eq!(allocations(|| numbers.reserve_exact(100)), 1);
    assert_eq!(allocations(|| numbers.clear()), 0);
}
