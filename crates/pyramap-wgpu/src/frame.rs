//! The stages of a frame up to commit, on the device. Frames take turns in two sets of buffers: one is worked on while
//! what was found in the other is added to the map. What lies between the stages of a frame is there once, and used in
//! the queue's order.

mod params;
mod recent;
mod sensors;
mod shot;
mod stages;

use crate::gpu::Gpu;
use crate::timestamps::Timestamps;
use params::{Layers, Model};
use recent::Recent;
use sensors::Described;
pub use shot::Room;
use shot::{Found, Shot};
use stages::{Lens, TIMED, Variant};

use pyramap::backend::Seen;
use pyramap::block::{BLOCK_VOXELS, BlockKey};
use pyramap::config::GridConfig;
use pyramap::error::Result;
use pyramap::ranges::range_per_reading;
use pyramap::sensors::{DistortedPinhole, Orthographic, Pinhole, Spherical};
use pyramap::stats::{StageSeconds, Stopwatch};
use pyramap::update::Change;
use pyramap::view::View;
use pyramap::{Depth, DepthImage, Pose, Reading, Sensor, SensorModel};
use pyramap_shaders::{Format, SensorKind, Sigma, UNIFORM};
use std::borrow::Cow;
use std::collections::VecDeque;
use wgpu::{Buffer, BufferUsages};

/// Frames under way.
pub struct Frames {
    page_blocks: usize,
    models: Recent<SensorModel, (Model, Buffer)>,
    lenses: Recent<(Sensor, Reading), Lens>,
    shots: [Shot; 2],
    /// The shots that were begun and not asked for, the earlier one first.
    begun: VecDeque<usize>,
    /// The shot that was last begun, and the one that was last asked for.
    last: usize,
    asked: usize,
    clock: Option<Timestamps>,
}

impl Frames {
    /// For a map's frames.
    ///
    /// # Errors
    /// [`pyramap::Error::Unsupported`] for the rules `ideal` and `rays`; as [`Gpu::buffer`].
    pub fn new(gpu: &Gpu, config: &GridConfig) -> Result<Self> {
        Self::with_room(gpu, config, Room::USUAL)
    }

    /// The same, with a given room at first.
    ///
    /// # Errors
    /// As [`Frames::new`].
    pub fn with_room(gpu: &Gpu, config: &GridConfig, room: Room) -> Result<Self> {
        if pyramap_shaders::update(config.update, Sigma::Constant, SensorKind::Pinhole).is_none() {
            return Err(stages::not_here(config.update));
        }
        Ok(Self {
            page_blocks: room.page_blocks,
            models: Recent::default(),
            lenses: Recent::default(),
            shots: [Shot::new(gpu, room)?, Shot::new(gpu, room)?],
            begun: VecDeque::new(),
            last: 0,
            asked: 0,
            clock: Timestamps::new(gpu, TIMED)?,
        })
    }

    /// Begins with a frame; at most two are begun at a time.
    ///
    /// # Errors
    /// As [`Gpu::attempt`].
    pub fn see(
        &mut self,
        gpu: &Gpu,
        config: &GridConfig,
        image: &DepthImage,
        sensor: &Sensor,
        pose: &Pose,
    ) -> Result<()> {
        let mut watch = Stopwatch::start();
        let (r, max_range) = (config.voxel_size, config.max_range);
        let this = match sensor {
            Sensor::Pinhole(camera) => match camera.lens() {
                None => self.begin(gpu, config, image, sensor, &View::new(Pinhole::new(camera), pose, r, max_range))?,
                Some(lens) => {
                    let projection = DistortedPinhole::new(camera, lens);
                    self.begin(gpu, config, image, sensor, &View::new(projection, pose, r, max_range))?
                }
            },
            Sensor::Spherical(spherical) => {
                self.begin(gpu, config, image, sensor, &View::new(Spherical::new(spherical), pose, r, max_range))?
            }
            Sensor::Orthographic(camera) => {
                self.begin(gpu, config, image, sensor, &View::new(Orthographic::new(camera), pose, r, max_range))?
            }
        };
        self.shots[this].upload = watch.lap();
        self.begun.push_back(this);
        self.last = this;
        Ok(())
    }

    /// Begins with a frame in the next shot, and returns which that is.
    fn begin<P: Described>(
        &mut self,
        gpu: &Gpu,
        config: &GridConfig,
        image: &DepthImage,
        sensor: &Sensor,
        view: &View<P>,
    ) -> Result<usize> {
        debug_assert!(self.begun.len() < self.shots.len(), "two frames are under way");
        let this = (self.last + 1) % self.shots.len();
        let layers = params::layers(config, view);
        let model = image.sensor_model().unwrap_or(config.sensor_model);
        let sigma = if model.is_constant() { Sigma::Constant } else { Sigma::Growing };
        self.make_layers(gpu, this, &layers, sigma)?;
        let lens = self.lenses.get((sensor.clone(), image.reading()), |_| lens(gpu, sensor, image.reading(), view))?;
        let (model, table) = self.models.get(model, |model| {
            let model = Model::new(model);
            let table = sensors::table(gpu, "sensor table", model.table.entries())?;
            Ok((model, table))
        })?;
        let shot = &mut self.shots[this];
        (shot.buffers.lens, shot.buffers.table) = (lens.clone(), table.clone());
        let (format, pixels) = pixels(image, sensor);
        fit(gpu, &mut shot.buffers.depth, "depth", pixels.len())?;
        gpu.write(&shot.buffers.depth, 0, &pixels)?;
        (shot.frame, shot.low) = params::frame(config, model, view, &layers, &image.depth());
        let variant = Variant { rule: config.update, sensor: view.projection.kind(), sigma, format, layers };
        shot.begin(gpu, variant, self.clock.as_ref())?;
        Ok(this)
    }

    /// What the frame begun first does to blocks; waits for it.
    ///
    /// # Errors
    /// As [`Gpu::read`]; the frame is given up then.
    pub fn seen(&mut self, gpu: &Gpu, seen: &mut Seen) -> Result<()> {
        let this = self.begun.pop_front().expect("a frame was begun");
        let mut watch = Stopwatch::start();
        let (shot, clock) = (&mut self.shots[this], self.clock.as_ref());
        let (low, [_, rows, depth, _]) = (shot.low, shot.frame.blocks);
        let key = |block: u32| -> BlockKey {
            let at = [block / depth / rows, block / depth % rows, block % depth];
            std::array::from_fn(|axis| low[axis] + at[axis] as i32)
        };
        let mut kernels = None;
        shot.finish(gpu, clock, |Found { free, mixed, changes, timestamps }| {
            seen.culled.free.clear();
            seen.culled.free.extend(free.iter().map(|&block| key(block)));
            seen.culled.mixed.clear();
            seen.culled.mixed.extend(mixed.iter().map(|&block| key(block)));
            seen.changes.clear();
            seen.changes.extend(changes.iter().map(change));
            kernels = clock.map(|clock| clock.seconds(timestamps).collect::<Vec<_>>());
        })?;
        seen.seconds = seconds(shot.upload, kernels.as_deref(), watch.lap());
        self.asked = this;
        Ok(())
    }

    /// Gives up the frames that were begun and not asked for.
    pub fn forget(&mut self) {
        self.begun.clear();
    }

    /// The increments of the mixed blocks of the frame last asked for, page by page.
    pub fn increments(&self) -> &[Buffer] {
        &self.shots[self.asked].buffers.increments
    }

    /// Blocks in each page of increments; the last may have fewer.
    pub fn blocks_per_page(&self) -> usize {
        self.page_blocks
    }

    /// Makes what lies between the stages large enough. Both shots share it.
    fn make_layers(&mut self, gpu: &Gpu, this: usize, layers: &Layers, sigma: Sigma) -> Result<()> {
        let texel = match sigma {
            Sigma::Constant => size_of::<f32>(),
            Sigma::Growing => size_of::<[f32; 2]>(),
        };
        let other = self.shots[self.last].buffers.clone();
        let buffers = &mut self.shots[this].buffers;
        (buffers.scratch, buffers.surfaces, buffers.bounds) = (other.scratch, other.surfaces, other.bounds);
        fit(gpu, &mut buffers.scratch, "parts of windows", size_of::<f32>() * layers.num_parts.max(1))?;
        fit(gpu, &mut buffers.surfaces, "surfaces", texel * layers.num_texels)?;
        fit(gpu, &mut buffers.bounds, "bounds", size_of::<[f32; 2]>() * layers.num_cells)
    }
}

/// What a sensor gives to all its frames.
fn lens<P: Described>(gpu: &Gpu, sensor: &Sensor, reading: Reading, view: &View<P>) -> Result<Lens> {
    let per_reading: Vec<f32> = range_per_reading(sensor, reading).collect();
    let range_per_depth = sensors::table(gpu, "a lens", &rows_of_pairs(&per_reading, sensor))?;
    let rows = view.projection.rows().map(|rows| sensors::table(gpu, "rows", rows)).transpose()?;
    Ok(Lens { range_per_depth, rows })
}

/// Makes a buffer anew if it is too small.
fn fit(gpu: &Gpu, buffer: &mut Buffer, label: &str, bytes: usize) -> Result<()> {
    if buffer.size() < bytes as u64 {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        *buffer = gpu.buffer(label, bytes as u64, usage)?;
    }
    Ok(())
}

/// The pixels as shaders read them.
fn pixels<'a>(image: &DepthImage<'a>, sensor: &Sensor) -> (Format, Cow<'a, [u8]>) {
    fn bytes<T: bytemuck::Pod>(values: Cow<[T]>) -> Cow<[u8]> {
        match values {
            Cow::Borrowed(values) => Cow::Borrowed(bytemuck::cast_slice(values)),
            Cow::Owned(values) => Cow::Owned(bytemuck::cast_slice(&values).to_vec()),
        }
    }
    match image.depth() {
        Depth::U16 { values, .. } => (Format::U16, bytes(rows_of_pairs(values, sensor))),
        Depth::F32(values) => (Format::F32, bytes(rows_of_pairs(values, sensor))),
        Depth::F64(values) => {
            let values: Vec<f32> = values.iter().map(|&depth| depth as f32).collect();
            (Format::F32, Cow::Owned(bytemuck::cast_slice(&rows_of_pairs(&values, sensor)).to_vec()))
        }
    }
}

/// Rows aligned, and an even number of pixels to each: the last one without a reading if need be.
fn rows_of_pairs<'a, T: Copy + Default>(values: &'a [T], sensor: &Sensor) -> Cow<'a, [T]> {
    let (width, height) = (sensor.width(), sensor.height());
    if width.is_multiple_of(2) && (0..height).all(|row| sensor.row_shift(row) == 0) {
        return Cow::Borrowed(values);
    }
    let rows = values.chunks(width).enumerate().flat_map(|(row, values)| {
        let shift = sensor.row_shift(row).rem_euclid(width as isize) as usize;
        let (left, right) = values.split_at(width - shift);
        right.iter().chain(left).copied().chain((width % 2 == 1).then(T::default))
    });
    Cow::Owned(rows.collect())
}

fn change(&[voxels, increment]: &[u32; 2]) -> Change {
    match (voxels, increment as i32) {
        (UNIFORM, 0) => Change::None,
        (UNIFORM, increment) => Change::Uniform(increment),
        (voxels, _) => {
            debug_assert!(voxels as usize <= BLOCK_VOXELS);
            Change::Dense { voxels }
        }
    }
}

/// Sorts the time of a frame by stage. Without a clock on the device all that the host waited is `update`'s.
fn seconds(upload: f64, kernels: Option<&[f64]>, waited: f64) -> StageSeconds {
    let of_host = StageSeconds { upload, ..StageSeconds::default() };
    match kernels {
        Some(&[ranges, pyramid, cull, update]) => {
            let readback = (waited - (ranges + pyramid + cull + update)).max(0.0);
            StageSeconds { ranges, pyramid, cull, update, readback, ..of_host }
        }
        _ => StageSeconds { update: waited, ..of_host },
    }
}

#[cfg(test)]
mod tests;
