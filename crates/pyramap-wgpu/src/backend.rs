//! The GPU backend: the stages of a frame, the pool, and the host's copies of what is in it.

use crate::commit::{Commit, Increments};
use crate::frame::{Frames, Room};
use crate::gpu::Gpu;
use crate::mirror::Mirror;
use crate::pool::{PAGE_BLOCKS, Pool};
use pyramap::backend::{Addition, Backend, Base, Committed, Seen, Source};
use pyramap::block::{Block, BlockData};
use pyramap::error::{DeviceFault, Error, Result};
use pyramap::log_odds::Limits;
use pyramap::{DepthImage, GridConfig, PinholeCamera, Pose, Reading, Sensor};
use std::mem::ManuallyDrop;
use std::sync::Arc;

/// A map's place on a device.
pub struct GpuBackend(ManuallyDrop<OnDevice>);

/// What a map has on a device. In a forked process nothing of it may be touched, nor given back.
struct OnDevice {
    gpu: Arc<Gpu>,
    frames: Frames,
    commit: Commit,
    pool: Pool,
    mirror: Mirror,
    /// Additions that the frame last seen can lead to, at most.
    num_additions: usize,
    /// Why the map cannot be used any more, if so.
    broken: Option<String>,
}

/// How large a map's buffers are at first, and by how much they grow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Blocks in a page of the map.
    pub page_blocks: usize,
    /// What there is room for in a frame.
    pub room: Room,
}

impl Default for Sizes {
    fn default() -> Self {
        Self { page_blocks: PAGE_BLOCKS, room: Room::USUAL }
    }
}

impl GpuBackend {
    /// A place on an adapter, chosen as by [`Gpu::open`].
    ///
    /// # Errors
    /// [`Error::Device`]; [`Error::Unsupported`] for the rule `ideal`.
    pub fn new(config: &GridConfig, adapter: Option<&str>) -> Result<Self> {
        Self::on(Gpu::open(adapter)?, config, Sizes::default())
    }

    /// A place on a device that belongs to an application, under a name for its users. For several maps on it see
    /// [`GpuBackend::on`].
    ///
    /// The application's callbacks stay as they are, and it may go on with the device as it likes.
    ///
    /// # Errors
    /// [`Error::Device`], also if the device was opened with limits below WebGPU's defaults; [`Error::Unsupported`] for
    /// the rule `ideal`.
    pub fn with_device(device: wgpu::Device, queue: wgpu::Queue, name: &str, config: &GridConfig) -> Result<Self> {
        Self::on(Arc::new(Gpu::owned_elsewhere(device, queue, name.to_owned())?), config, Sizes::default())
    }

    /// A place on an open device.
    ///
    /// # Errors
    /// [`Error::Device`]; [`Error::Unsupported`] for the rule `ideal`; [`Error::Parameter`] if a page would be larger
    /// than devices allow.
    pub fn on(gpu: Arc<Gpu>, config: &GridConfig, sizes: Sizes) -> Result<Self> {
        let pool = Pool::new(sizes.page_blocks)?;
        let (frames, commit) = (Frames::with_room(&gpu, config, sizes.room)?, Commit::new(&gpu)?);
        let (mirror, num_additions, broken) = (Mirror::default(), 0, None);
        Ok(Self(ManuallyDrop::new(OnDevice { gpu, frames, commit, pool, mirror, num_additions, broken })))
    }

    /// Blocks that were brought to the host since the map was made.
    pub fn blocks_fetched(&self) -> u64 {
        self.0.mirror.num_fetched()
    }
}

impl OnDevice {
    /// That the map can be worked with.
    fn check(&self) -> Result<()> {
        match &self.broken {
            Some(reason) => Err(Error::Device { fault: DeviceFault::Lost, reason: reason.clone() }),
            None => self.gpu.check(),
        }
    }

    fn begin_commit(&mut self, additions: &[Addition], sign: i32, limits: Limits) -> Result<()> {
        let Self { gpu, frames, commit, pool, mirror, .. } = self;
        mirror.send(gpu, pool)?;
        let increments = Increments { pages: frames.increments(), page_blocks: frames.blocks_per_page() };
        commit.reserve(gpu, pool, additions.len(), increments.pages.len())?;
        commit.begin(gpu, pool, increments, additions, sign, limits)
    }
}

/// The camera of a frame, if shaders know what the frame is.
fn known<'a>(config: &GridConfig, image: &DepthImage, sensor: &'a Sensor) -> Result<&'a PinholeCamera> {
    let own_model = image.sensor_model().is_some_and(|model| model != config.sensor_model);
    match sensor {
        Sensor::Pinhole(camera) if camera.lens().is_none() && image.reading() == Reading::Depth && !own_model => {
            Ok(camera)
        }
        _ => {
            let reason = "the backend gpu takes depth images of pinhole cameras without distortion only, fused with the map's sensor model: use \
                          the backend cpu";
            Err(Error::Unsupported { operation: "integrate", reason: reason.into() })
        }
    }
}

impl Backend for GpuBackend {
    fn name(&self) -> &str {
        "gpu"
    }

    fn adapter(&self) -> Option<&str> {
        Some(self.0.gpu.name())
    }

    fn pipelined(&self) -> bool {
        true
    }

    fn see(&mut self, config: &GridConfig, image: &DepthImage, sensor: &Sensor, pose: &Pose) -> Result<()> {
        self.0.check()?;
        let camera = known(config, image, sensor)?;
        let OnDevice { gpu, frames, .. } = &mut *self.0;
        frames.see(gpu, config, image, camera, pose)
    }

    fn seen(&mut self, _: &GridConfig, seen: &mut Seen) -> Result<()> {
        self.0.check()?;
        let OnDevice { gpu, frames, num_additions, .. } = &mut *self.0;
        frames.seen(gpu, seen)?;
        *num_additions = seen.culled.free.len() + seen.culled.mixed.len();
        Ok(())
    }

    fn forget(&mut self) {
        self.0.frames.forget();
    }

    fn commit(&mut self, additions: &[Addition], sign: i32, limits: Limits) -> Result<()> {
        self.0.check()?;
        let begun = self.0.begin_commit(additions, sign, limits);
        additions.iter().for_each(|addition| self.0.mirror.outdate(addition.slot));
        if let Err(error @ Error::Device { fault: DeviceFault::OutOfMemory | DeviceFault::Internal, .. }) = &begun {
            // The directory has the frame already, and the blocks have it not. Short of a defect that cannot be: all
            // memory was reserved before.
            self.0.broken = Some(format!("a frame was added to half of the map, which is lost with that: {error}"));
        }
        begun
    }

    fn committed(&mut self, committed: &mut Committed) -> Result<()> {
        self.0.check()?;
        let OnDevice { gpu, commit, .. } = &mut *self.0;
        commit.end(gpu, committed)
    }

    fn pool_bytes(&self) -> usize {
        self.0.pool.bytes()
    }

    fn table_growth(&self, new: usize) -> usize {
        self.0.pool.growth(new)
    }

    // Blocks have their full size from the start, in pages.

    fn most_growth(&self, _: usize, _: usize) -> usize {
        0
    }

    fn growth(&self, _: Base, _: Source, _: i32, _: Limits) -> usize {
        0
    }

    fn growth_to(&self, _: Option<u32>, _: &BlockData) -> usize {
        0
    }

    fn reserve(&mut self, new: usize) -> Result<()> {
        self.0.check()?;
        let OnDevice { gpu, frames, commit, pool, mirror, num_additions, .. } = &mut *self.0;
        mirror.send(gpu, pool)?;
        pool.reserve(gpu, new)?;
        commit.reserve(gpu, pool, *num_additions, frames.increments().len())
    }

    fn allocate(&mut self) -> u32 {
        self.0.pool.allocate()
    }

    fn release(&mut self, slot: u32) {
        self.0.pool.release(slot);
        self.0.mirror.release(slot);
    }

    fn fetch(&self) -> Result<()> {
        let OnDevice { gpu, pool, mirror, broken, .. } = &*self.0;
        if broken.is_some() {
            return self.0.check();
        }
        mirror.fetch(gpu, pool)
    }

    fn read(&self, slot: u32) -> Block<'_> {
        let fetched = self.fetch();
        match self.0.mirror.read(slot) {
            Some(values) => Block::Dense(values),
            None => panic!("a block cannot be read: {}", fetched.expect_err("slots that are in use are fetched")),
        }
    }

    fn write(&mut self, slot: u32, values: &BlockData) {
        let OnDevice { gpu, pool, mirror, .. } = &mut *self.0;
        if mirror.write(slot, values) {
            // If that fails, the blocks wait on, and the next frame says why.
            let _ = mirror.send(gpu, pool);
        }
    }
}

impl Drop for GpuBackend {
    fn drop(&mut self) {
        if !self.0.gpu.forked() {
            // SAFETY: nothing comes after this.
            unsafe { ManuallyDrop::drop(&mut self.0) }
        }
    }
}
