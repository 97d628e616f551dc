//! Instructions of each stage, counted by valgrind: nearly the same numbers however busy the machine is.
//!
//! `make bench-instructions` prints them beside those of the run before. One frame of the simulated office, which is
//! the same everywhere, goes through the stages once, so that all buffers have their size and the map has its blocks;
//! then one stage is done once more, and counted. Everything runs on one thread: the one that valgrind looks at. Valgrind
//! has no AVX-512: what is counted are the instructions of a processor with AVX2.

#![allow(missing_docs, reason = "the macros make public items")]

use gungraun::Callgrind;
use gungraun::prelude::*;
use pyramap::backend::{Backend, Seen};
use pyramap::commit::{Changes, Commit, CommitBuffers};
use pyramap::cpu::CpuBackend;
use pyramap::directory::Directory;
use pyramap::log_odds::Limits;
use pyramap::mesh::{Mesh, MeshOptions, extract};
use pyramap::sensor::SensorTable;
use pyramap::sensors::Pinhole;
use pyramap::update::free_increment;
use pyramap::view::View;
use pyramap::{GridConfig, OccupancyGrid, Sensor, UpdateRule};
use pyramap_benches::{Frames, config};
use rayon::ThreadPoolBuilder;
use std::hint::black_box;

/// Metres.
const VOXEL_SIZE: f64 = 0.04;

/// What the stages of a frame work on.
struct Stages {
    frames: Frames,
    config: GridConfig,
    view: View<Pinhole>,
    free_increment: i32,
    backend: CpuBackend,
    seen: Seen,
    changes: Changes,
    buffers: CommitBuffers,
    directory: Directory,
}

impl Stages {
    fn ranges(&mut self) {
        let image = self.frames.image(&self.frames.frames[0]);
        self.backend.ranges(&self.config, &image, &Sensor::from(&self.frames.camera)).expect("a valid frame");
    }

    fn pyramid(&mut self) {
        self.backend.pyramid(&self.config, &self.view);
    }

    fn cull(&mut self) {
        self.backend.cull(&self.config, &self.view);
    }

    fn update(&mut self) {
        self.backend.update(&self.config, &self.view);
    }

    fn sort(&mut self) {
        self.backend.seen(&self.config, &mut self.seen).expect("a CPU does not fail");
        self.changes.sort(&self.seen, self.free_increment);
    }

    fn commit(&mut self) {
        let Self { changes, directory, buffers, backend, .. } = self;
        let limits = Limits { low: i32::MIN, high: i32::MAX };
        Commit { changes, sign: 1, limits, directory, buffers, colour_bytes: 0 }
            .apply(backend, None)
            .expect("no budget");
    }
}

fn on_this_thread() {
    ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global().expect("the first pool");
}

/// The stages, after a frame has gone through them.
fn after_a_frame(update: UpdateRule) -> Stages {
    on_this_thread();
    let config = config(VOXEL_SIZE, update);
    let frames = Frames::simulated(1);
    let camera = Pinhole::new(&frames.camera);
    let mut stages = Stages {
        view: View::new(camera, &frames.frames[0].pose, config.voxel_size, config.max_range),
        frames,
        free_increment: free_increment(&SensorTable::new(&config.sensor_model)),
        backend: CpuBackend::new(&config),
        config,
        seen: Seen::default(),
        changes: Changes::default(),
        buffers: CommitBuffers::default(),
        directory: Directory::default(),
    };
    stages.ranges();
    stages.pyramid();
    stages.cull();
    stages.update();
    stages.sort();
    stages.commit();
    stages
}

/// The same, with the blocks of the frame told apart once more.
fn after_cull(update: UpdateRule) -> Stages {
    let mut stages = after_a_frame(update);
    stages.cull();
    stages
}

fn map() -> OccupancyGrid {
    on_this_thread();
    Frames::simulated(4).map(config(VOXEL_SIZE, UpdateRule::Pyramid))
}

// What is handed back is dropped after the count.

#[library_benchmark(setup = after_a_frame)]
#[bench::any(UpdateRule::Pyramid)]
fn ranges(mut stages: Stages) -> Stages {
    stages.ranges();
    stages
}

#[library_benchmark(setup = after_a_frame)]
#[bench::pyramid(UpdateRule::Pyramid)]
#[bench::area(UpdateRule::Area)]
fn pyramid(mut stages: Stages) -> Stages {
    stages.pyramid();
    stages
}

#[library_benchmark(setup = after_a_frame)]
#[bench::pyramid(UpdateRule::Pyramid)]
#[bench::area(UpdateRule::Area)]
fn cull(mut stages: Stages) -> Stages {
    stages.cull();
    stages
}

#[library_benchmark(setup = after_cull)]
#[bench::pyramid(UpdateRule::Pyramid)]
#[bench::area(UpdateRule::Area)]
fn update(mut stages: Stages) -> Stages {
    stages.update();
    stages
}

#[library_benchmark(setup = after_a_frame)]
#[bench::pyramid(UpdateRule::Pyramid)]
fn commit(mut stages: Stages) -> Stages {
    stages.commit();
    stages
}

#[library_benchmark(setup = map)]
#[bench::four_frames()]
fn mesh(grid: OccupancyGrid) -> (OccupancyGrid, Mesh) {
    let mesh = extract(&grid, &MeshOptions::default()).expect("a map with a surface");
    (grid, black_box(mesh))
}

library_benchmark_group!(name = stages, benchmarks = [ranges, pyramid, cull, update, commit, mesh]);

// Caches are not simulated: what they would show is not what this machine's do, at twice the time.
main!(
    config = LibraryBenchmarkConfig::default().tool(Callgrind::with_args(["--cache-sim=no"])),
    library_benchmark_groups = stages
);
