//! The occupancy grid: the map, and the stages of a frame in their order.

use crate::backend::{Backend, Committed, Seen};
use crate::block::{BLOCK_EDGE, BLOCK_VOXELS, Block, BlockData, BlockKey, Blocks};
use crate::colour::{ColourStage, Colours, Paint, Sums};
use crate::commit::{Changes, Commit, CommitBuffers, set_uniform};
use crate::config::GridConfig;
use crate::cpu::CpuBackend;
use crate::depth::DepthImage;
use crate::directory::{self, Directory, Entry};
use crate::error::{Error, Result};
use crate::history::History;
use crate::log_odds;
use crate::pose::Pose;
use crate::ranges;
use crate::rays::Kept;
use crate::sensor::SensorTable;
use crate::sensors::Sensor;
use crate::stats::{FrameStats, Stopwatch, Submitted};
use crate::update::free_increment;

pub mod change;
mod merge;
mod points;

/// A sparse map of log-odds: free, occupied and unknown space.
///
/// ```
/// use pyramap::{Depth, DepthImage, GridConfig, OccupancyGrid, PinholeCamera, Pose, State};
///
/// let camera = PinholeCamera::new(64, 48, 58.5, 58.5, 31.5, 23.5)?;
/// let wall = vec![2.0; 64 * 48]; // metres
/// let mut grid = OccupancyGrid::new(GridConfig::new(0.05)?)?;
/// grid.integrate(&DepthImage::new(Depth::F32(&wall), 64, 48)?, &camera, &Pose::identity())?;
///
/// let points = [[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 3.0]];
/// assert_eq!(grid.state(&points)?, [State::Free, State::Occupied, State::Unknown]);
/// # Ok::<(), pyramap::Error>(())
/// ```
pub struct OccupancyGrid {
    config: GridConfig,
    directory: Directory,
    backend: Box<dyn Backend>,
    colours: Colours,
    free_increment: i32,
    num_frames: i64,
    saturated: u64,
    history: History,
    /// What rays found out about the blocks as they are; whoever changes one gives it up.
    pub(crate) rays: Kept,
    /// The frame that the device works on.
    begun: Option<Frame>,
    /// The frame that is being added.
    committing: Option<Frame>,
    buffers: Buffers,
}

/// A frame on its way into the map.
struct Frame {
    /// `1` to add, `-1` to take back.
    sign: i32,
    /// What is known of it so far.
    stats: FrameStats,
    /// What it adds to colours, by block.
    paint: Vec<(BlockKey, Box<Paint>)>,
    /// Who waits for it.
    submitted: Option<Submitted>,
}

impl Frame {
    fn new(sign: i32) -> Self {
        Self { sign, stats: FrameStats::default(), paint: Vec::new(), submitted: None }
    }
}

/// Why a map takes no colour, and gives none.
pub(crate) const WITHOUT_COLOUR: &str = "the map was made without colour, expected one made with colour switched on";

/// What a frame's stages hand on to each other, kept from frame to frame.
#[derive(Default)]
struct Buffers {
    seen: Seen,
    changes: Changes,
    commit: CommitBuffers,
    committed: Committed,
    colour: ColourStage,
}

impl OccupancyGrid {
    /// An empty map on the CPU.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the parameter that is out of range.
    pub fn new(config: GridConfig) -> Result<Self> {
        let backend = Box::new(CpuBackend::new(&config));
        Self::with_backend(config, backend)
    }

    /// An empty map on a device.
    ///
    /// # Errors
    /// As [`OccupancyGrid::new`].
    pub fn with_backend(config: GridConfig, backend: Box<dyn Backend>) -> Result<Self> {
        config.validate()?;
        let free_increment = free_increment(&SensorTable::new(&config.sensor_model));
        Ok(Self {
            config,
            directory: Directory::default(),
            backend,
            colours: Colours::default(),
            free_increment,
            num_frames: 0,
            saturated: 0,
            history: History::default(),
            rays: Kept::default(),
            begun: None,
            committing: None,
            buffers: Buffers::default(),
        })
    }

    /// Fuses the image that a sensor took at a pose (`world_from_camera`): whole, or not at all.
    ///
    /// # Errors
    /// If image and sensor differ in size, no pixel says anything, the pose is out of bounds, the map is full, or the
    /// device fails.
    pub fn integrate(&mut self, image: &DepthImage, sensor: impl Into<Sensor>, pose: &Pose) -> Result<FrameStats> {
        self.synchronize()?;
        self.fuse(image, &sensor.into(), pose, 1)
    }

    /// Takes a frame back, exactly: the map is then as if it had never been fused.
    ///
    /// # Errors
    /// As [`OccupancyGrid::integrate`]; and [`Error::Unsupported`] if the map is clamped or saturated, or was
    /// decayed, cleared or cropped, since evidence was lost then.
    pub fn remove(&mut self, image: &DepthImage, sensor: impl Into<Sensor>, pose: &Pose) -> Result<FrameStats> {
        self.synchronize()?;
        self.check_exact("remove")?;
        self.fuse(image, &sensor.into(), pose, -1)
    }

    /// Refuses what is only right as long as the map holds all evidence of its frames.
    fn check_exact(&self, operation: &'static str) -> Result<()> {
        let loss = match self.config.clamp {
            Some((low, high)) => Some(format!("the map is clamped to ({low}, {high}), which forgets evidence")),
            None if self.saturated > 0 => {
                Some(format!("{} additions to voxels were too large to be stored whole", self.saturated))
            }
            None => self.history.loss(),
        };
        loss.map_or(Ok(()), |reason| Err(Error::Unsupported { operation, reason }))
    }

    /// As [`OccupancyGrid::integrate`], but a device need not be done with the frame when this returns: it works on while
    /// the next frame is read and sent. What is read from the map holds all frames submitted only after
    /// [`OccupancyGrid::synchronize`]. On the CPU the frame is fused at once.
    ///
    /// # Errors
    /// As [`OccupancyGrid::integrate`]. If it is an earlier frame that could not be fused, this one is not fused either,
    /// and may be submitted again.
    pub fn submit(&mut self, image: &DepthImage, sensor: impl Into<Sensor>, pose: &Pose) -> Result<Submitted> {
        let mut frame = self.begin(image, &sensor.into(), pose, 1)?;
        let submitted = Submitted::default();
        frame.submitted = Some(submitted.clone());
        if !self.backend.pipelined() {
            self.finish(frame)?;
        } else if let Some(before) = self.begun.replace(frame) {
            self.commit(before).inspect_err(|_| {
                self.backend.forget();
                self.begun = None;
            })?;
        }
        Ok(submitted)
    }

    /// Waits for all frames that were submitted. Only then are they in what is read from the map.
    ///
    /// # Errors
    /// If the map is full or the device failed: the frame submitted last is not fused then.
    pub fn synchronize(&mut self) -> Result<()> {
        if let Some(frame) = self.begun.take() {
            self.commit(frame)?;
        }
        self.settle().map(|_| ())
    }

    /// Whether all frames that were submitted are in the map.
    pub fn is_synchronized(&self) -> bool {
        self.begun.is_none() && self.committing.is_none()
    }

    /// The first half of a frame: the stages that change nothing.
    fn begin(&mut self, image: &DepthImage, sensor: &Sensor, pose: &Pose, sign: i32) -> Result<Frame> {
        self.check_place(sensor, pose)?;
        ranges::check(image, sensor, self.config.max_range, self.config.beyond_max_range)?;
        if image.colour.is_some() && !self.config.colour {
            return Err(Error::Unsupported { operation: "to fuse colour", reason: WITHOUT_COLOUR.into() });
        }
        self.backend.see(&self.config, image, sensor, pose)?;
        let mut frame = Frame::new(sign);
        if let Some(colour) = &image.colour {
            let mut watch = Stopwatch::start();
            let paint = self.buffers.colour.see(&self.config, image, colour, sensor, pose);
            frame.paint = paint.expect("the image was checked");
            frame.stats.seconds.colour = watch.lap();
        }
        Ok(frame)
    }

    fn fuse(&mut self, image: &DepthImage, sensor: &Sensor, pose: &Pose, sign: i32) -> Result<FrameStats> {
        let frame = self.begin(image, sensor, pose, sign)?;
        self.finish(frame)
    }

    fn finish(&mut self, frame: Frame) -> Result<FrameStats> {
        self.commit(frame)?;
        Ok(self.settle()?.expect("a frame has just been committed"))
    }

    /// The second half: what the frame begun first does to blocks is added to the map, all of it or nothing.
    fn commit(&mut self, mut frame: Frame) -> Result<()> {
        self.settle()?;
        let Buffers { seen, changes, commit: buffers, .. } = &mut self.buffers;
        self.backend.seen(&self.config, seen)?;
        let painting = frame.stats.seconds.colour;
        frame.stats = FrameStats::count(seen);

        let mut watch = Stopwatch::start();
        self.rays = Kept::default();
        let painted = self.colours.painted(&frame.paint, frame.sign);
        changes.sort(seen, self.free_increment);
        let (limits, directory) = (self.config.limits(), &mut self.directory);
        let colour_bytes = self.colours.bytes_with(&painted);
        let commit = Commit { changes, sign: frame.sign, limits, directory, buffers, colour_bytes };
        frame.stats.saturated = painted.lost + commit.apply(self.backend.as_mut(), self.config.max_bytes)?;
        self.colours.store(painted);
        frame.paint = Vec::new();
        (frame.stats.seconds.colour, frame.stats.seconds.commit) = (painting, watch.lap());
        self.committing = Some(frame);
        Ok(())
    }

    /// Takes in what came of the last commit, if there is one.
    fn settle(&mut self) -> Result<Option<FrameStats>> {
        let Some(Frame { sign, mut stats, submitted, .. }) = self.committing.take() else { return Ok(None) };
        let Buffers { commit: buffers, committed, .. } = &mut self.buffers;
        self.backend.committed(committed)?;
        let mut watch = Stopwatch::start();
        buffers.collapse(&committed.uniform, &mut self.directory, self.backend.as_mut());
        stats.saturated += committed.lost;
        stats.seconds.commit += committed.seconds + watch.lap();
        self.saturated = self.saturated.saturating_add(stats.saturated);
        self.num_frames = self.num_frames.saturating_add(i64::from(sign));
        submitted.inspect(|submitted| submitted.settle(stats));
        Ok(Some(stats))
    }

    fn check_place(&self, sensor: &Sensor, pose: &Pose) -> Result<()> {
        let (voxel_size, max_range) = (self.config.voxel_size, self.config.max_range);
        let reach = sensor.reach(max_range);
        if reach > GridConfig::MAX_VOXELS_IN_RANGE * voxel_size {
            return Err(Error::Parameter {
                name: "camera",
                got: format!("one that sees places {reach} m off"),
                expected: format!("no more than {} voxels, here of {voxel_size} m", GridConfig::MAX_VOXELS_IN_RANGE),
            });
        }
        self.check_position(pose, reach - max_range)
    }

    /// Checks that a sensor which sees places farther off than the range by `more` sees none that has no coordinates.
    fn check_position(&self, pose: &Pose, more: f64) -> Result<()> {
        let limit = self.config.coordinate_limit() - more;
        match pose.translation.iter().find(|c| c.abs() > limit) {
            Some(&got) => Err(Error::OutOfBounds { what: "camera", got, limit, voxel_size: self.config.voxel_size }),
            None => Ok(()),
        }
    }

    /// The slot of a dense block.
    fn slot(&self, key: BlockKey) -> Option<u32> {
        match self.directory.get(&key) {
            Some(&Entry::Dense(slot)) => Some(slot),
            _ => None,
        }
    }

    /// Stores a block in the form that fits it.
    ///
    /// # Errors
    /// If the device has no room for another block, unless that was reserved.
    pub(crate) fn set_block(&mut self, key: BlockKey, values: &BlockData) -> Result<()> {
        if self.slot(key).is_none() && Block::Dense(values).uniform_value().is_none() {
            self.backend.reserve(1)?;
        }
        self.store(key, values);
        Ok(())
    }

    /// Stores a block in the form that fits it; a slot for it was reserved.
    fn store(&mut self, key: BlockKey, values: &BlockData) {
        self.rays = Kept::default();
        match (Block::Dense(values).uniform_value(), self.slot(key)) {
            (Some(value), slot) => {
                slot.into_iter().for_each(|slot| self.backend.release(slot));
                set_uniform(&mut self.directory, key, value);
            }
            (None, Some(slot)) => self.backend.write(slot, values),
            (None, None) => {
                let slot = self.backend.allocate();
                self.backend.write(slot, values);
                self.directory.insert(key, Entry::Dense(slot));
            }
        }
    }

    /// Stores a block that the map does not hold yet.
    pub(crate) fn put_block(&mut self, key: BlockKey, block: Block) -> Result<()> {
        self.rays = Kept::default();
        match block {
            Block::Uniform(value) => set_uniform(&mut self.directory, key, value),
            block => self.set_block(key, &block.to_data())?,
        }
        Ok(())
    }

    /// Rebuilds a map from what a file holds.
    pub(crate) fn restore<'a>(
        &mut self,
        blocks: impl Iterator<Item = (BlockKey, Block<'a>)>,
        colours: impl Iterator<Item = (BlockKey, Box<Sums>)>,
        num_frames: i64,
        saturated: u64,
        history: History,
    ) -> Result<()> {
        for (key, block) in blocks {
            self.put_block(key, block)?;
        }
        self.colours.restore(colours);
        (self.num_frames, self.saturated, self.history) = (num_frames, saturated, history);
        Ok(())
    }

    /// The parameters of the map.
    pub fn config(&self) -> &GridConfig {
        &self.config
    }

    /// What the map runs on: `"cpu"` or `"gpu"`.
    pub fn backend(&self) -> &str {
        self.backend.name()
    }

    /// The name of the device that the map runs on, unless that is the CPU.
    pub fn adapter(&self) -> Option<&str> {
        self.backend.adapter()
    }

    /// Blocks that hold something.
    pub fn num_blocks(&self) -> usize {
        self.directory.len()
    }

    /// Voxels that are not unknown.
    ///
    /// # Errors
    /// If the device fails, or has taken the map along.
    pub fn num_observed(&self) -> Result<usize> {
        self.fetch()?;
        let observed = |block: Block| match block {
            Block::Uniform(_) => BLOCK_VOXELS,
            block => block.to_data().iter().filter(|&&value| value != 0).count(),
        };
        Ok(self.directory.keys().filter_map(|&key| self.block(key)).map(observed).sum())
    }

    /// Frames fused less frames removed.
    pub fn num_frames(&self) -> i64 {
        self.num_frames
    }

    /// How often a voxel's evidence was too large to be stored whole.
    pub fn saturated(&self) -> u64 {
        self.saturated
    }

    /// What was decayed and erased.
    pub fn history(&self) -> History {
        self.history
    }

    /// Bytes that the map takes: dense blocks, directory and colours.
    pub fn nbytes(&self) -> usize {
        directory::bytes(&self.directory, self.directory.len()) + self.backend.pool_bytes() + self.colours.bytes()
    }

    /// Lowest and highest corner, metres, of the box around all blocks; `None` for an empty map.
    pub fn bounds(&self) -> Option<[[f64; 3]; 2]> {
        let mut keys = self.directory.keys();
        let first = *keys.next()?;
        let (low, high) = keys.fold((first, first), |(low, high), key| {
            (std::array::from_fn(|a| low[a].min(key[a])), std::array::from_fn(|a| high[a].max(key[a])))
        });
        let edge = BLOCK_EDGE as f64 * self.config.voxel_size;
        Some([low.map(|k| f64::from(k) * edge), high.map(|k| (f64::from(k) + 1.0) * edge)])
    }
}

impl Blocks for OccupancyGrid {
    fn keys(&self) -> Vec<BlockKey> {
        self.directory.keys().copied().collect()
    }

    fn count(&self) -> usize {
        self.directory.len()
    }

    fn block(&self, key: BlockKey) -> Option<Block<'_>> {
        self.directory.get(&key).map(|entry| match *entry {
            Entry::Uniform(value) => Block::Uniform(value),
            Entry::Dense(slot) => self.backend.read(slot),
        })
    }

    fn fetch(&self) -> Result<()> {
        self.backend.fetch()
    }

    fn colours(&self) -> Option<&Colours> {
        self.config.colour.then_some(&self.colours)
    }

    fn voxel_size(&self) -> f64 {
        self.config.voxel_size
    }

    fn prior_log_odds(&self) -> f64 {
        log_odds::from_probability(self.config.prior)
    }
}
