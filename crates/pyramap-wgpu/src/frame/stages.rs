//! The kernels of a frame in their order, each bound to its buffers: put together once, and again only when the sensor
//! or a buffer is another.

use super::params::Layers;
use crate::gpu::Gpu;
use crate::timestamps::Timestamps;
use pyramap::error::{Error, Result};
use pyramap::update::UpdateRule;
use pyramap_shaders::layout::{Frame, HALVED};
use pyramap_shaders::{
    self as shaders, ARGUMENTS_GROUP, CULL_GROUP, Format, Kernel, LAYER_GROUP, SensorKind, Sigma, Slot, TILE_LAYERS,
};
use wgpu::{BindGroup, Buffer, CommandEncoder, ComputePassDescriptor, ComputePipeline};

/// Bytes of the arguments of an indirect dispatch.
pub const ARGUMENTS_BYTES: usize = 3 * size_of::<u32>();
/// Stages that are timed: those of the CPU, but that `ranges` has the pyramid's first kernel in it.
pub const TIMED: u32 = 4;

/// How many workgroups a kernel has.
enum Workgroups {
    /// Known when it is bound.
    Fixed([u32; 3]),
    /// So many as cover the box of blocks.
    Blocks,
    /// As the device finds out, for a page of increments.
    Page(u64),
}

struct Dispatch {
    /// Its place among the timed stages.
    stage: u32,
    pipeline: ComputePipeline,
    bound: BindGroup,
    workgroups: Workgroups,
}

/// The kernels of a frame.
pub struct Stages {
    variant: Variant,
    buffers: Buffers,
    dispatches: Vec<Dispatch>,
}

/// What the kernels depend on beside their buffers.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// The rule of the map.
    pub rule: UpdateRule,
    /// How the frame's sensor projects.
    pub sensor: SensorKind,
    /// Sigma of the frame's sensor model.
    pub sigma: Sigma,
    /// How depth is stored.
    pub format: Format,
    /// The layers of the frame.
    pub layers: Layers,
}

/// The buffers that the kernels of a frame work on.
#[derive(Clone, PartialEq)]
pub struct Buffers {
    /// [`Slot::Frame`].
    pub frame: Buffer,
    /// [`Slot::Depth`].
    pub depth: Buffer,
    /// What depends on the sensor only.
    pub lens: Lens,
    /// [`Slot::Scratch`].
    pub scratch: Buffer,
    /// [`Slot::Surfaces`].
    pub surfaces: Buffer,
    /// [`Slot::Bounds`].
    pub bounds: Buffer,
    /// What depends on the sensor model only, [`Slot::Table`].
    pub table: Buffer,
    /// [`Slot::Results`].
    pub results: Buffer,
    /// [`Slot::Arguments`].
    pub arguments: Buffer,
    /// [`Slot::Page`] for each page.
    pub pages: Vec<Buffer>,
    /// [`Slot::Increments`] for each page.
    pub increments: Vec<Buffer>,
}

/// What a sensor gives to all its frames.
#[derive(Clone, PartialEq)]
pub struct Lens {
    /// [`Slot::RangePerDepth`].
    pub range_per_depth: Buffer,
    /// [`Slot::Rows`], if its kernels ask for them.
    pub rows: Option<Buffer>,
}

impl Buffers {
    /// Whether these are still the buffers of frames of some sensor.
    fn in_use(&self, now: &Self) -> bool {
        *self == Self { lens: self.lens.clone(), table: self.table.clone(), ..now.clone() }
    }

    fn bound_to(&self, slot: Slot, page: usize) -> &Buffer {
        match slot {
            Slot::Frame => &self.frame,
            Slot::Depth => &self.depth,
            Slot::RangePerDepth => &self.lens.range_per_depth,
            Slot::Scratch => &self.scratch,
            Slot::Surfaces => &self.surfaces,
            Slot::Bounds => &self.bounds,
            Slot::Table => &self.table,
            Slot::Rows => self.lens.rows.as_ref().expect("the lens of a spherical sensor has rows"),
            Slot::Results => &self.results,
            Slot::Arguments => &self.arguments,
            Slot::Page => &self.pages[page],
            Slot::Increments => &self.increments[page],
            Slot::Run | Slot::Additions | Slot::Outcome | Slot::Pool(_) => unreachable!("a buffer of the commit"),
        }
    }
}

impl Stages {
    /// Compiles the kernels, or finds them compiled, and binds them.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for the rules `ideal` and `rays`; as [`Gpu::attempt`].
    pub fn new(gpu: &Gpu, variant: Variant, buffers: Buffers) -> Result<Self> {
        let Variant { rule, sensor, sigma, format, ref layers } = variant;
        let (first, count) = layers.made;
        // An invocation for each pixel of the image halved `i` times, for so many layers.
        let over = |i: usize, many: usize| {
            let (size, [x, y]) = (&layers.halved[i.min(HALVED - 1)], LAYER_GROUP);
            Workgroups::Fixed([size.width.div_ceil(x), size.height.div_ceil(y), many as u32])
        };
        let mut dispatches = Vec::new();
        let mut add = |stage, kernel: &Kernel, page, workgroups| -> Result<()> {
            let pipeline = gpu.pipeline(kernel.entry, &kernel.source, kernel.entry)?;
            let bound: Vec<_> =
                kernel.slots.iter().map(|&slot| buffers.bound_to(slot, page).as_entire_binding()).collect();
            let bound = gpu.bind(&pipeline, &bound)?;
            dispatches.push(Dispatch { stage, pipeline, bound, workgroups });
            Ok(())
        };

        add(0, &shaders::tiles(format, sigma, first, count), 0, over(TILE_LAYERS, 1))?;
        for pass in layers.passes() {
            let finest = first.max(pass * TILE_LAYERS + 1);
            let widest = finest.min((pass + 1) * TILE_LAYERS);
            add(1, &shaders::windows(sigma, pass), 0, over(widest, count - finest))?;
        }
        for finer in (0..layers.coarsest_bounds(first)).step_by(TILE_LAYERS) {
            let bounded = (first..count).take_while(|&i| layers.coarsest_bounds(i) > finer).count();
            add(1, &shaders::bounds(sigma, finer), 0, over(first + finer + TILE_LAYERS, bounded))?;
        }
        add(2, &shaders::cull(rule, sensor).ok_or_else(|| not_here(rule))?, 0, Workgroups::Blocks)?;
        let pages = buffers.pages.len();
        add(2, &shaders::arguments(), 0, Workgroups::Fixed([pages.div_ceil(ARGUMENTS_GROUP) as u32, 1, 1]))?;
        let update = shaders::update(rule, sigma, sensor).ok_or_else(|| not_here(rule))?;
        for page in 0..pages {
            add(3, &update, page, Workgroups::Page((page * ARGUMENTS_BYTES) as u64))?;
        }
        Ok(Self { variant, buffers, dispatches })
    }

    /// Whether they were put together for this.
    pub fn fit(&self, variant: &Variant, buffers: &Buffers) -> bool {
        self.variant == *variant && self.buffers == *buffers
    }

    /// Whether they may fit a later frame, now that these are the buffers.
    pub fn in_use(&self, buffers: &Buffers) -> bool {
        self.buffers.in_use(buffers)
    }

    /// Records them.
    pub fn record(&self, encoder: &mut CommandEncoder, frame: &Frame, timestamps: Option<&Timestamps>) {
        for stage in 0..TIMED {
            let timestamp_writes = timestamps.map(|timestamps| timestamps.of_pass(stage));
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
            for dispatch in self.dispatches.iter().filter(|dispatch| dispatch.stage == stage) {
                pass.set_pipeline(&dispatch.pipeline);
                pass.set_bind_group(0, &dispatch.bound, &[]);
                match dispatch.workgroups {
                    Workgroups::Fixed([x, y, z]) => pass.dispatch_workgroups(x, y, z),
                    Workgroups::Blocks => {
                        let [x, y, z, _] = frame.blocks.map(|n| n.div_ceil(CULL_GROUP));
                        pass.dispatch_workgroups(x, y, z);
                    }
                    Workgroups::Page(offset) => pass.dispatch_workgroups_indirect(&self.buffers.arguments, offset),
                }
            }
        }
    }
}

/// That a map's rule has no kernels.
pub fn not_here(rule: UpdateRule) -> Error {
    let reason = "it has no kernel for graphics cards; use backend=\"cpu\"".into();
    let operation = match rule {
        UpdateRule::Rays => "update=\"rays\" on a GPU",
        _ => "update=\"ideal\" on a GPU",
    };
    Error::Unsupported { operation, reason }
}
