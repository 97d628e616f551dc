//! The CPU backend: every stage on rayon's threads, and the pool.

use crate::backend::{Addition, Backend, Base, Committed, Seen, Source};
use crate::block::{BLOCK_VOXELS, Block, BlockData};
use crate::config::GridConfig;
use crate::cull::{CullBuffers, Scope, cull};
use crate::depth::DepthImage;
use crate::error::Result;
use crate::log_odds::Limits;
use crate::pool::Pool;
use crate::pose::Pose;
use crate::pyramid::Pyramid;
use crate::ranges::Ranges;
use crate::sensor::{SensorModel, SensorTable};
use crate::sensors::{DistortedPinhole, Orthographic, Pinhole, Projection, Sensor, Spherical};
use crate::simd::Instructions;
use crate::stats::{StageSeconds, Stopwatch};
use crate::surfaces::{self, SurfaceLayer};
use crate::update::area::Area;
use crate::update::ideal::Ideal;
use crate::update::min_layer::MinLayer;
use crate::update::pyramid::Pyramid as PyramidRule;
use crate::update::rays::Scan;
use crate::update::{UpdateRule, update};
use crate::view::View;
use std::mem::swap;

/// So many sensor models are kept.
const MODELS: usize = 8;

/// Buffers of the stages, kept from frame to frame, and the pool. The stages may be called one by one, to measure them.
pub struct CpuBackend {
    /// What the stages run with: the results are the same, whatever it is.
    pub instructions: Instructions,
    /// The sensor models of the last frames, the one in use first.
    models: Vec<(SensorModel, SensorTable)>,
    ranges: Ranges,
    pyramid: Pyramid,
    surfaces: Vec<SurfaceLayer>,
    cull_buffers: CullBuffers,
    increments: Vec<BlockData>,
    seen: Seen,
    pool: Pool,
    committed: Committed,
}

impl CpuBackend {
    /// A backend with an empty pool.
    pub fn new(config: &GridConfig) -> Self {
        Self {
            instructions: Instructions::widest(),
            models: vec![(config.sensor_model, SensorTable::new(&config.sensor_model))],
            ranges: Ranges::default(),
            pyramid: Pyramid::default(),
            surfaces: Vec::new(),
            cull_buffers: CullBuffers::default(),
            increments: Vec::new(),
            seen: Seen::default(),
            pool: Pool::default(),
            committed: Committed::default(),
        }
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
            UpdateRule::Area => (|$rule: &Area<P>| $body)(&Area::new($view)),
            UpdateRule::Ideal => (|$rule: &Ideal| $body)(&Ideal::new($view)),
            UpdateRule::Rays => unreachable!("a rule that asks no voxels"),
        }
    }};
}

impl CpuBackend {
    /// The stages between ranges and commit (Alg. 1), but for rays.
    fn stages<P: Projection>(&mut self, config: &GridConfig, view: &View<P>, watch: &mut Stopwatch) {
        self.pyramid(config, view);
        self.seen.seconds.pyramid = watch.lap();

        self.cull(config, view);
        self.seen.seconds.cull = watch.lap();

        self.update(config, view);
        self.seen.seconds.update = watch.lap();
    }

    /// Puts a sensor model first, and tabulates it unless one of the last frames had it.
    fn use_model(&mut self, model: SensorModel) {
        if let Some(known) = self.models.iter().position(|(known, _)| *known == model) {
            self.models[..=known].rotate_right(1);
        } else {
            self.models.truncate(MODELS - 1);
            self.models.insert(0, (model, SensorTable::new(&model)));
        }
    }

    /// Distances out of the image (Eq. 6).
    ///
    /// # Errors
    /// As [`Ranges::compute`].
    pub fn ranges(&mut self, config: &GridConfig, image: &DepthImage, sensor: &Sensor) -> Result<()> {
        self.ranges.compute(image, sensor, config.max_range, config.beyond_max_range)
    }

    /// The layers (Eq. 10), as the sensor model sees them.
    pub fn pyramid<P: Projection>(&mut self, config: &GridConfig, view: &View<P>) {
        let count = view.projection.num_layers();
        let wanted = config.update.layers(view, count);
        self.pyramid.compute(&self.ranges, view.t_0, config.update.selection::<P>(), wanted.clone());
        let (model, table) = &self.models[0];
        let (sampling, wraps) = (config.update.sampling(), view.projection.wraps());
        surfaces::compute(&mut self.surfaces, &self.pyramid.layers, wanted, (model, table), sampling, wraps);
    }

    /// The blocks that the frame changes.
    pub fn cull<P: Projection>(&mut self, config: &GridConfig, view: &View<P>) {
        let (layers, culled, instructions) = (&self.surfaces[..], &mut self.seen.culled, self.instructions);
        with_rule!(config.update, view, layers.len(), |rule| {
            cull(&Scope { view, layers, rule, enabled: config.cull, instructions }, &mut self.cull_buffers, culled)
        });
    }

    /// What the frame does to each mixed block (Alg. 1).
    pub fn update<P: Projection>(&mut self, config: &GridConfig, view: &View<P>) {
        let (layers, Seen { culled, changes, .. }) = (&self.surfaces[..], &mut self.seen);
        let instructions = self.instructions;
        with_rule!(config.update, view, layers.len(), |rule| {
            let scope = Scope { view, layers, rule, enabled: config.cull, instructions };
            update(&scope, &self.models[0].1, &culled.mixed, &mut self.increments, changes)
        });
    }

    /// What the rays of a scan do to the blocks that they pass.
    fn update_along(&mut self, config: &GridConfig, scan: &Scan) {
        let Seen { culled, changes, .. } = &mut self.seen;
        culled.free.clear();
        scan.update(config.voxel_size, &mut culled.mixed, &mut self.increments, changes);
    }
}

impl Backend for CpuBackend {
    fn name(&self) -> &str {
        "cpu"
    }

    fn adapter(&self) -> Option<&str> {
        None
    }

    fn pipelined(&self) -> bool {
        false
    }

    fn see(&mut self, config: &GridConfig, image: &DepthImage, sensor: &Sensor, pose: &Pose) -> Result<()> {
        let mut watch = Stopwatch::start();
        self.seen.seconds = StageSeconds::default();

        self.ranges(config, image, sensor)?;
        self.seen.seconds.ranges = watch.lap();

        if config.update == UpdateRule::Rays {
            self.update_along(config, &Scan::of_image(&self.ranges, sensor, pose, config.max_range));
            self.seen.seconds.update = watch.lap();
            return Ok(());
        }
        self.use_model(image.sensor_model.unwrap_or(config.sensor_model));
        let (r, max_range) = (config.voxel_size, config.max_range);
        match sensor {
            Sensor::Pinhole(camera) => match camera.lens() {
                None => self.stages(config, &View::new(Pinhole::new(camera), pose, r, max_range), &mut watch),
                Some(lens) => {
                    let projection = DistortedPinhole::new(camera, lens);
                    self.stages(config, &View::new(projection, pose, r, max_range), &mut watch);
                }
            },
            Sensor::Spherical(sensor) => {
                self.stages(config, &View::new(Spherical::new(sensor), pose, r, max_range), &mut watch);
            }
            Sensor::Orthographic(camera) => {
                self.stages(config, &View::new(Orthographic::new(camera), pose, r, max_range), &mut watch);
            }
        }
        Ok(())
    }

    fn see_points(&mut self, config: &GridConfig, points: &[[f64; 3]], pose: &Pose) -> Result<()> {
        let mut watch = Stopwatch::start();
        self.seen.seconds = StageSeconds::default();
        self.update_along(config, &Scan::of_points(points, pose, config)?);
        self.seen.seconds.update = watch.lap();
        Ok(())
    }

    fn seen(&mut self, _: &GridConfig, seen: &mut Seen) -> Result<()> {
        swap(&mut self.seen, seen);
        Ok(())
    }

    fn forget(&mut self) {}

    fn commit(&mut self, additions: &[Addition], sign: i32, limits: Limits) -> Result<()> {
        self.pool.add(additions, &self.increments, sign, limits, &mut self.committed);
        Ok(())
    }

    fn committed(&mut self, committed: &mut Committed) -> Result<()> {
        swap(&mut self.committed, committed);
        Ok(())
    }

    fn pool_bytes(&self) -> usize {
        self.pool.bytes()
    }

    fn trim(&mut self) {
        self.pool.trim();
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

    fn reserve(&mut self, _: usize) -> Result<()> {
        Ok(())
    }

    fn allocate(&mut self) -> u32 {
        self.pool.allocate()
    }

    fn release(&mut self, slot: u32) {
        self.pool.release(slot);
    }

    fn fetch(&self) -> Result<()> {
        Ok(())
    }

    fn read(&self, slot: u32) -> Block<'_> {
        self.pool.read(slot)
    }

    fn write(&mut self, slot: u32, values: &BlockData) {
        self.pool.write(slot, values);
    }
}
