//! The CPU backend: every stage on rayon's threads, and a pool of boxed blocks.

use crate::backend::{Addition, Backend, Limits, Source};
use crate::block::{BLOCK_VOXELS, BlockData, BlockKey};
use crate::camera::PinholeCamera;
use crate::cull::{Culled, Scope, cull};
use crate::depth::DepthImage;
use crate::error::Result;
use crate::grid::GridConfig;
use crate::pose::Pose;
use crate::pyramid::Pyramid;
use crate::ranges::Ranges;
use crate::sensor::SensorTable;
use crate::surfaces::SurfaceLayer;
use crate::update::area::Area;
use crate::update::ideal::Ideal;
use crate::update::min_layer::MinLayer;
use crate::update::pyramid::Pyramid as PyramidRule;
use crate::update::{Change, UpdateRule, update};
use crate::view::View;
use rayon::prelude::*;
use std::mem::take;

/// Buffers of the stages, kept from frame to frame, and the pool.
pub struct CpuBackend {
    table: SensorTable,
    ranges: Ranges,
    camera: Option<PinholeCamera>,
    pyramid: Pyramid,
    surfaces: Vec<SurfaceLayer>,
    view: Option<View>,
    increments: Vec<BlockData>,
    changes: Vec<Change>,
    pool: Vec<Option<Box<BlockData>>>,
    unused: Vec<u32>,
}

impl CpuBackend {
    /// A backend with an empty pool.
    pub fn new(config: &GridConfig) -> Self {
        Self {
            table: SensorTable::new(&config.sensor_model),
            ranges: Ranges::default(),
            camera: None,
            pyramid: Pyramid::default(),
            surfaces: Vec::new(),
            view: None,
            increments: Vec::new(),
            changes: Vec::new(),
            pool: Vec::new(),
            unused: Vec::new(),
        }
    }

    fn frame(&self) -> (&View, &[SurfaceLayer]) {
        (self.view.as_ref().expect("the pyramid stage comes first"), &self.surfaces)
    }
}

/// Does something with the rule of a map: the one place that turns the enum into a type, so that each rule's kernel is
/// compiled for itself.
macro_rules! with_rule {
    ($update:expr, $view:expr, $count:expr, |$rule:ident| $body:expr) => {{
        let (t_0, count) = ($view.t_0 as f32, $count);
        match $update {
            UpdateRule::Pyramid => (|$rule: &PyramidRule| $body)(&PyramidRule { t_0, count }),
            UpdateRule::MinLayer => (|$rule: &MinLayer| $body)(&MinLayer { t_0, count }),
            UpdateRule::Area => (|$rule: &Area| $body)(&Area::new($view)),
            UpdateRule::Ideal => (|$rule: &Ideal| $body)(&Ideal::new($view)),
        }
    }};
}

impl Backend for CpuBackend {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn ranges(&mut self, config: &GridConfig, image: &DepthImage, camera: &PinholeCamera) -> Result<()> {
        self.ranges.compute(image, camera, config.max_range, config.beyond_max_range)?;
        self.camera = Some(*camera);
        Ok(())
    }

    fn pyramid(&mut self, config: &GridConfig, pose: &Pose) {
        let camera = self.camera.as_ref().expect("the ranges stage comes first");
        let view = View::new(camera, pose, config.voxel_size, config.max_range);
        let count = crate::pyramid::num_layers(camera.width, camera.height);
        let wanted = config.update.layers(&view, count);
        self.pyramid.compute(&self.ranges, view.t_0, config.update.selection(), wanted.clone());
        self.surfaces.resize_with(count, SurfaceLayer::default);
        for i in wanted {
            self.surfaces[i].compute(&self.pyramid.layers[i], &config.sensor_model, &self.table);
        }
        self.view = Some(view);
    }

    fn cull(&mut self, config: &GridConfig) -> Culled {
        let (view, layers) = self.frame();
        with_rule!(config.update, view, layers.len(), |rule| cull(&Scope { view, layers, rule, enabled: config.cull }))
    }

    fn update(&mut self, config: &GridConfig, mixed: &[BlockKey]) -> &[Change] {
        let (mut increments, mut changes) = (take(&mut self.increments), take(&mut self.changes));
        let (view, layers) = self.frame();
        with_rule!(config.update, view, layers.len(), |rule| {
            let scope = Scope { view, layers, rule, enabled: config.cull };
            update(&scope, &self.table, mixed, &mut increments, &mut changes)
        });
        (self.increments, self.changes) = (increments, changes);
        &self.changes
    }

    fn commit(&mut self, additions: &[Addition], sign: i32, limits: Limits) -> u64 {
        // Each slot's box is taken out of the pool, so that threads own the blocks they add to.
        let mut taken: Vec<(Box<BlockData>, Source)> = additions
            .iter()
            .map(|addition| (self.pool[addition.slot as usize].take().expect(IN_USE), addition.source))
            .collect();
        let increments = &self.increments;
        let lost = taken
            .par_iter_mut()
            .with_min_len(16)
            .map(|(values, source)| match *source {
                Source::Uniform(increment) => add(values, |_| increment * sign, limits),
                Source::Mixed(n) => {
                    let increments = &increments[n];
                    add(values, |i| increments[i] * sign, limits)
                }
            })
            .sum();
        for (addition, (values, _)) in additions.iter().zip(taken) {
            self.pool[addition.slot as usize] = Some(values);
        }
        lost
    }

    fn slots(&self) -> usize {
        self.pool.len() - self.unused.len()
    }

    fn allocate(&mut self, value: i32) -> u32 {
        let values = Some(Box::new([value; BLOCK_VOXELS]));
        if let Some(slot) = self.unused.pop() {
            self.pool[slot as usize] = values;
            slot
        } else {
            self.pool.push(values);
            (self.pool.len() - 1) as u32
        }
    }

    fn release(&mut self, slot: u32) {
        self.pool[slot as usize] = None;
        self.unused.push(slot);
    }

    fn read(&self, slot: u32) -> &BlockData {
        self.pool[slot as usize].as_ref().expect(IN_USE)
    }

    fn write(&mut self, slot: u32, values: &BlockData) {
        **self.pool[slot as usize].as_mut().expect(IN_USE) = *values;
    }
}

/// The directory names only slots that it was given and has not given back.
const IN_USE: &str = "a slot that is in use";

/// Adds increments to a block; how many voxels they were too much for.
#[inline(always)]
fn add(values: &mut BlockData, increment: impl Fn(usize) -> i32, limits: Limits) -> u64 {
    let mut lost = 0u32;
    for (i, value) in values.iter_mut().enumerate() {
        let (sum, overflow) = limits.add(*value, increment(i));
        *value = sum;
        lost += u32::from(overflow);
    }
    u64::from(lost)
}
