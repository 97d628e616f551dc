//! The CPU backend: every stage on rayon's threads, and the pool.

use crate::backend::{Addition, Backend, Base, Committed, Source};
use crate::block::{BLOCK_VOXELS, Block, BlockData, BlockKey};
use crate::camera::PinholeCamera;
use crate::config::GridConfig;
use crate::cull::{CullBuffers, Culled, Scope, cull};
use crate::depth::DepthImage;
use crate::error::Result;
use crate::log_odds::Limits;
use crate::pool::Pool;
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
use std::mem::take;

/// Buffers of the stages, kept from frame to frame, and the pool.
pub struct CpuBackend {
    table: SensorTable,
    ranges: Ranges,
    camera: Option<PinholeCamera>,
    pyramid: Pyramid,
    surfaces: Vec<SurfaceLayer>,
    view: Option<View>,
    cull_buffers: CullBuffers,
    increments: Vec<BlockData>,
    changes: Vec<Change>,
    pool: Pool,
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
            cull_buffers: CullBuffers::default(),
            increments: Vec::new(),
            changes: Vec::new(),
            pool: Pool::default(),
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
            let (layer, finest) = (&self.pyramid.layers[i], config.update.finest_bounds());
            self.surfaces[i].compute(layer, &config.sensor_model, &self.table, finest);
        }
        self.view = Some(view);
    }

    fn cull(&mut self, config: &GridConfig, culled: &mut Culled) {
        let mut buffers = take(&mut self.cull_buffers);
        let (view, layers) = self.frame();
        with_rule!(config.update, view, layers.len(), |rule| {
            cull(&Scope { view, layers, rule, enabled: config.cull }, &mut buffers, culled)
        });
        self.cull_buffers = buffers;
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

    fn commit(&mut self, additions: &[Addition], sign: i32, limits: Limits) -> Committed {
        self.pool.add(additions, &self.increments, sign, limits)
    }

    fn pool_bytes(&self) -> usize {
        self.pool.bytes()
    }

    fn table_growth(&self, new: usize) -> usize {
        self.pool.table_growth(new)
    }

    fn most_growth(&self, to_slots: usize, to_new: usize) -> usize {
        self.pool.most_growth(to_slots, to_new)
    }

    fn growth(&self, base: Base, source: Source, sign: i32, limits: Limits) -> usize {
        let (mut values, slot) = match base {
            Base::Slot(slot) => (self.pool.read(slot).to_data(), Some(slot)),
            Base::Value(value) => ([value; BLOCK_VOXELS], None),
        };
        for (i, value) in values.iter_mut().enumerate() {
            let increment = match source {
                Source::Uniform(increment) => increment,
                Source::Mixed(n) => self.increments[n][i],
            };
            *value = limits.add(*value, increment * sign).0;
        }
        self.pool.growth_to(slot, &values)
    }

    fn growth_to(&self, slot: Option<u32>, values: &BlockData) -> usize {
        self.pool.growth_to(slot, values)
    }

    fn allocate(&mut self, value: i32) -> u32 {
        self.pool.allocate(value)
    }

    fn release(&mut self, slot: u32) {
        self.pool.release(slot);
    }

    fn read(&self, slot: u32) -> Block<'_> {
        self.pool.read(slot)
    }

    fn write(&mut self, slot: u32, values: &BlockData) {
        self.pool.write(slot, values);
    }
}
