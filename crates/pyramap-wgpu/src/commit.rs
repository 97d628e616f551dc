//! Stage 5, commit, on the device: increments are added to the pool; sums stay there, and only what must be known of
//! them comes back.

use crate::gpu::Gpu;
use crate::pool::Pool;
use crate::timestamps::Timestamps;
use bytemuck::{Zeroable, bytes_of, cast_slice, pod_read_unaligned};
use pyramap::backend::{Addition, Committed, Source};
use pyramap::error::Result;
use pyramap::log_odds::Limits;
use pyramap_shaders::layout::{self, FROM_BASE, Run, SAME_FOR_ALL};
use pyramap_shaders::{OUTCOME_COUNTS, POOL_PAGES, of_rank};
use std::ops::Range;
use wgpu::{BindingResource, Buffer, BufferBinding, BufferUsages, ComputePipeline, SubmissionIndex};

/// Workgroups of a dispatch, along one dimension, on any device.
const MOST_GROUPS: usize = 65_535;
/// Every device allows uniforms to begin at multiples of this.
const UNIFORM_STRIDE: u64 = 256;
const WORD: u64 = size_of::<u32>() as u64;

/// Buffers and kernel of the stage; one commit at a time.
pub struct Commit {
    pipeline: ComputePipeline,
    clock: Option<Timestamps>,
    room: Room,
    /// Stand for pages that are not there: each for another, since no buffer may be written through two bindings. A
    /// kernel always has its first page, whose spare stands for increments.
    spares: [Buffer; POOL_PAGES],
    /// The additions' places in the caller's list, in the order in which the device has them.
    order: Vec<u32>,
    begun: Option<SubmissionIndex>,
}

/// Buffers for so many additions, in so many runs.
struct Room {
    num_additions: usize,
    num_runs: usize,
    additions: Buffer,
    runs: Buffer,
    outcome: Buffer,
    staging: Buffer,
}

/// The increments of a frame's mixed blocks: pages, and blocks in each.
#[derive(Clone, Copy)]
pub struct Increments<'a> {
    /// The pages.
    pub pages: &'a [Buffer],
    /// Blocks in each.
    pub page_blocks: usize,
}

impl Commit {
    /// The kernel, and buffers for a small frame.
    ///
    /// # Errors
    /// As [`Gpu::pipeline`] and [`Gpu::buffer`].
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let kernel = pyramap_shaders::commit();
        let spare = || gpu.buffer("no page", WORD, BufferUsages::STORAGE);
        Ok(Self {
            pipeline: gpu.pipeline("commit", &kernel.source, kernel.entry)?,
            clock: Timestamps::new(gpu, 1)?,
            room: Room::new(gpu, 1024, 1)?,
            spares: [spare()?, spare()?, spare()?, spare()?],
            order: Vec::new(),
            begun: None,
        })
    }

    /// Makes sure that so many additions to the blocks of a pool will have room, with so many pages of increments.
    ///
    /// # Errors
    /// As [`Gpu::buffer`]; nothing has changed then.
    pub fn reserve(&mut self, gpu: &Gpu, pool: &Pool, num_additions: usize, increment_pages: usize) -> Result<()> {
        let pairs = pool.pages().len().div_ceil(POOL_PAGES) * increment_pages.max(1);
        let num_runs = (pairs + num_additions / MOST_GROUPS).min(num_additions);
        if num_additions > self.room.num_additions || num_runs > self.room.num_runs {
            let (additions, runs) = (num_additions.max(self.room.num_additions), num_runs.max(self.room.num_runs));
            self.room = Room::new(gpu, additions.next_power_of_two(), runs.next_power_of_two())?;
        }
        Ok(())
    }

    /// Begins with additions, for which there is room.
    ///
    /// # Errors
    /// As [`Gpu::submit`].
    pub fn begin(
        &mut self,
        gpu: &Gpu,
        pool: &Pool,
        increments: Increments,
        additions: &[Addition],
        sign: i32,
        limits: Limits,
    ) -> Result<()> {
        self.begun = None;
        if additions.is_empty() {
            return Ok(());
        }
        let page = |addition: &Addition| addition.slot as usize / pool.page_blocks() / POOL_PAGES;
        let increment_page = |addition: &Addition| match addition.source {
            Source::Uniform(_) => 0,
            Source::Mixed(n) => n / increments.page_blocks,
        };
        let target = |n: u32| {
            let addition = &additions[n as usize];
            (page(addition), increment_page(addition))
        };
        self.order.clear();
        self.order.extend(0..additions.len() as u32);
        self.order.sort_by_key(|&n| target(n));

        let sorted = self.order.iter().map(|&n| on_device(&additions[n as usize], pool, increments.page_blocks));
        gpu.write(&self.room.additions, 0, cast_slice(&sorted.collect::<Vec<layout::Addition>>()))?;
        let mut encoder = gpu.encoder("commit")?;
        encoder.clear_buffer(&self.room.outcome, 0, Some(Room::outcome_bytes(additions.len())));
        let mut dispatches = Vec::new();
        for (n, run) in self.runs(target).into_iter().enumerate() {
            let Limits { low, high } = limits;
            let first = run.start as u32;
            let uniform = Run { first, page_blocks: pool.page_blocks() as u32, low, high, sign };
            gpu.write(&self.room.runs, n as u64 * UNIFORM_STRIDE, bytes_of(&uniform))?;
            let (page, increment_page) = target(self.order[run.start]);
            let increments = increments.pages.get(increment_page).unwrap_or(&self.spares[0]);
            dispatches.push((self.bind(gpu, n, pool, page, increments)?, run.len() as u32));
        }
        {
            let timestamp_writes = self.clock.as_ref().map(|clock| clock.of_pass(0));
            let descriptor = wgpu::ComputePassDescriptor { label: Some("commit"), timestamp_writes };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            pass.set_pipeline(&self.pipeline);
            for (bindings, groups) in &dispatches {
                pass.set_bind_group(0, bindings, &[]);
                pass.dispatch_workgroups(*groups, 1, 1);
            }
        }
        let Room { outcome, staging, .. } = &self.room;
        if let Some(clock) = &self.clock {
            clock.copy_to(&mut encoder, staging, 0);
        }
        let bytes = Room::outcome_bytes(additions.len());
        encoder.copy_buffer_to_buffer(outcome, 0, staging, Timestamps::bytes(1), bytes);
        self.begun = Some(gpu.submit(encoder)?);
        Ok(())
    }

    /// What came of it; waits until it is done.
    ///
    /// # Errors
    /// As [`Gpu::read`].
    pub fn end(&mut self, gpu: &Gpu, committed: &mut Committed) -> Result<()> {
        (committed.lost, committed.seconds) = (0, 0.0);
        committed.uniform.clear();
        let Some(submission) = self.begun.take() else { return Ok(()) };
        let bytes = Timestamps::bytes(1) + Room::outcome_bytes(self.order.len());
        gpu.read(&self.room.staging, bytes, &submission, |bytes| {
            let (times, words) = bytes.split_at(Timestamps::bytes(1) as usize);
            if let Some(clock) = &self.clock {
                committed.seconds = clock.seconds(times).sum();
            }
            let (counts, extremes) = words.split_at(OUTCOME_COUNTS * WORD as usize);
            committed.lost = u64::from(pod_read_unaligned::<u32>(counts));
            let extremes = extremes.chunks_exact(2 * WORD as usize).map(pod_read_unaligned::<[u32; 2]>);
            let uniform = self.order.iter().zip(extremes).filter(|(_, [highest, lowest])| *highest == !lowest);
            committed.uniform.extend(uniform.map(|(&n, [highest, _])| (n as usize, of_rank(highest))));
        })?;
        committed.uniform.sort_unstable();
        Ok(())
    }

    /// Additions that follow each other in the device's list, and have the same target.
    fn runs<T: PartialEq>(&self, target: impl Fn(u32) -> T) -> Vec<Range<usize>> {
        let mut start = 0;
        let runs = self.order.chunk_by(|&a, &b| target(a) == target(b)).flat_map(|run| run.chunks(MOST_GROUPS));
        runs.map(|run| {
            let first = start;
            start += run.len();
            first..start
        })
        .collect()
    }

    fn bind(&self, gpu: &Gpu, run: usize, pool: &Pool, pages: usize, increments: &Buffer) -> Result<wgpu::BindGroup> {
        let Room { additions, runs, outcome, .. } = &self.room;
        let size = wgpu::BufferSize::new(size_of::<Run>() as u64);
        let uniform = BufferBinding { buffer: runs, offset: run as u64 * UNIFORM_STRIDE, size };
        let mut resources = vec![BindingResource::Buffer(uniform)];
        resources.extend([additions, increments, outcome].map(|buffer| buffer.as_entire_binding()));
        for (n, spare) in self.spares.iter().enumerate() {
            resources.push(pool.pages().get(pages * POOL_PAGES + n).unwrap_or(spare).as_entire_binding());
        }
        gpu.bind(&self.pipeline, &resources)
    }
}

/// An addition as the kernel knows it.
fn on_device(addition: &Addition, pool: &Pool, increment_page_blocks: usize) -> layout::Addition {
    let block = (addition.slot as usize % (pool.page_blocks() * POOL_PAGES)) as u32;
    let mut on_device = layout::Addition { block, ..Zeroable::zeroed() };
    if let Some(base) = addition.base {
        on_device.kind |= FROM_BASE;
        on_device.base = base;
    }
    match addition.source {
        Source::Uniform(increment) => {
            on_device.kind |= SAME_FOR_ALL;
            on_device.source = increment;
        }
        Source::Mixed(n) => on_device.source = (n % increment_page_blocks) as i32,
    }
    on_device
}

impl Room {
    fn new(gpu: &Gpu, num_additions: usize, num_runs: usize) -> Result<Self> {
        let buffer = |label, bytes, usage| gpu.buffer(label, bytes, usage);
        let additions = (num_additions * size_of::<layout::Addition>()) as u64;
        let outcome = Self::outcome_bytes(num_additions);
        let (storage, uniform) = (BufferUsages::STORAGE | BufferUsages::COPY_DST, BufferUsages::UNIFORM);
        Ok(Self {
            num_additions,
            num_runs,
            additions: buffer("additions", additions, storage)?,
            runs: buffer("runs of additions", num_runs as u64 * UNIFORM_STRIDE, uniform | BufferUsages::COPY_DST)?,
            outcome: buffer("the outcome of a commit", outcome, storage | BufferUsages::COPY_SRC)?,
            staging: buffer(
                "reading the outcome of a commit",
                Timestamps::bytes(1) + outcome,
                BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            )?,
        })
    }

    /// Bytes that the outcome of so many additions takes at most.
    const fn outcome_bytes(num_additions: usize) -> u64 {
        (OUTCOME_COUNTS + 2 * num_additions) as u64 * WORD
    }
}
