//! The occupancy grid: the map, and the stages of a frame in their order.

use crate::backend::Backend;
use crate::block::{BLOCK_EDGE, BLOCK_VOXELS, Block, BlockData, BlockKey, Blocks};
use crate::camera::PinholeCamera;
use crate::commit::{Changes, Commit, CommitBuffers, budget, set_uniform};
use crate::config::GridConfig;
use crate::cpu::CpuBackend;
use crate::cull::Culled;
use crate::depth::DepthImage;
use crate::directory::{self, Directory, Entry};
use crate::error::{Error, Result};
use crate::log_odds;
use crate::pose::Pose;
use crate::sensor::SensorTable;
use crate::stats::{FrameStats, Stopwatch};
use crate::update::free_increment;

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
    free_increment: i32,
    num_frames: i64,
    saturated: u64,
    buffers: Buffers,
}

/// What a frame's stages hand on to each other, kept from frame to frame.
#[derive(Default)]
struct Buffers {
    culled: Culled,
    changes: Changes,
    commit: CommitBuffers,
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
            free_increment,
            num_frames: 0,
            saturated: 0,
            buffers: Buffers::default(),
        })
    }

    /// Fuses a depth image taken at a pose (`world_from_camera`): whole, or not at all.
    ///
    /// # Errors
    /// If image and camera differ in size, no pixel says anything, the pose is out of bounds, or the map is full.
    pub fn integrate(&mut self, image: &DepthImage, camera: &PinholeCamera, pose: &Pose) -> Result<FrameStats> {
        self.fuse(image, camera, pose, 1)
    }

    /// Takes a frame back, exactly: the map is then as if it had never been fused.
    ///
    /// # Errors
    /// As [`OccupancyGrid::integrate`]; and [`Error::Unsupported`] if the map is clamped or saturated, since evidence
    /// was lost then.
    pub fn remove(&mut self, image: &DepthImage, camera: &PinholeCamera, pose: &Pose) -> Result<FrameStats> {
        let refuse = |reason| Err(Error::Unsupported { operation: "remove", reason });
        if let Some((low, high)) = self.config.clamp {
            return refuse(format!("the map is clamped to ({low}, {high}), which forgets evidence"));
        }
        if self.saturated > 0 {
            return refuse(format!("{} additions to voxels were too large to be stored whole", self.saturated));
        }
        self.fuse(image, camera, pose, -1)
    }

    /// The stages of a frame (Alg. 1). All that can fail comes before anything is added.
    fn fuse(&mut self, image: &DepthImage, camera: &PinholeCamera, pose: &Pose, sign: i32) -> Result<FrameStats> {
        self.check_position(pose)?;
        let mut watch = Stopwatch::start();
        let (config, backend) = (&self.config, self.backend.as_mut());

        backend.ranges(config, image, camera)?;
        watch.lap(|seconds| &mut seconds.ranges);

        backend.pyramid(config, pose);
        watch.lap(|seconds| &mut seconds.pyramid);

        let Buffers { culled, changes: sorted, commit: buffers } = &mut self.buffers;
        backend.cull(config, culled);
        watch.lap(|seconds| &mut seconds.cull);

        let changes = backend.update(config, &culled.mixed);
        let mut stats = FrameStats::count(culled, changes);
        sorted.sort(culled, changes, self.free_increment);
        watch.lap(|seconds| &mut seconds.update);

        let (limits, directory) = (config.limits(), &mut self.directory);
        let commit = Commit { changes: sorted, sign, limits, directory, buffers };
        stats.saturated = commit.apply(backend, config.max_bytes)?;
        watch.lap(|seconds| &mut seconds.commit);

        stats.seconds = watch.seconds();
        self.saturated = self.saturated.saturating_add(stats.saturated);
        self.num_frames = self.num_frames.saturating_add(i64::from(sign));
        Ok(stats)
    }

    fn check_position(&self, pose: &Pose) -> Result<()> {
        let limit = self.config.coordinate_limit();
        match pose.translation.iter().find(|c| c.abs() > limit) {
            Some(&got) => Err(Error::OutOfBounds { what: "camera", got, limit, voxel_size: self.config.voxel_size }),
            None => Ok(()),
        }
    }

    /// Adds another map's evidence to this one: the result is that of all frames of both.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if voxel size, prior or clamp differ; [`Error::MapFull`].
    pub fn merge(&mut self, other: &OccupancyGrid) -> Result<()> {
        let refuse = |what: &str, mine: String, theirs: String| {
            let reason = format!("{what} differs: {mine} here, {theirs} in the other map");
            Err(Error::Unsupported { operation: "merge", reason })
        };
        let (mine, theirs) = (&self.config, &other.config);
        if mine.voxel_size != theirs.voxel_size {
            return refuse("voxel_size", format!("{}", mine.voxel_size), format!("{}", theirs.voxel_size));
        }
        if mine.prior != theirs.prior {
            return refuse("prior", format!("{}", mine.prior), format!("{}", theirs.prior));
        }
        if mine.clamp != theirs.clamp {
            return refuse("clamp", format!("{:?}", mine.clamp), format!("{:?}", theirs.clamp));
        }
        if self.config.max_bytes.is_some() {
            let new = other.directory.keys().filter(|key| !self.directory.contains_key(*key)).count();
            let (mut new_slots, mut blocks) = (0, 0);
            for &key in other.directory.keys() {
                let (values, slot) = (self.sums(other, key).0, self.slot(key));
                if Block::Dense(&values).uniform_value().is_none() {
                    new_slots += usize::from(slot.is_none());
                    blocks += self.backend.growth_to(slot, &values);
                }
            }
            let entries = self.directory.len() + new;
            budget(&self.directory, entries, self.backend.as_ref(), new_slots, blocks, self.config.max_bytes)?;
        }
        for &key in other.directory.keys() {
            let (values, lost) = self.sums(other, key);
            self.set_block(key, &values);
            self.saturated = self.saturated.saturating_add(lost);
        }
        self.num_frames = self.num_frames.saturating_add(other.num_frames);
        self.saturated = self.saturated.saturating_add(other.saturated);
        Ok(())
    }

    /// A block of both maps together, and how many voxels `i32` was too small for.
    fn sums(&self, other: &Self, key: BlockKey) -> (BlockData, u64) {
        let limits = self.config.limits();
        let block = |grid: &Self| grid.block(key).unwrap_or(Block::Uniform(0)).to_data();
        let (mut sums, theirs) = (block(self), block(other));
        let mut lost = 0;
        for (sum, theirs) in sums.iter_mut().zip(theirs) {
            let (limited, overflow) = limits.add(*sum, theirs);
            *sum = limited;
            lost += u64::from(overflow);
        }
        (sums, lost)
    }

    /// The slot of a dense block.
    fn slot(&self, key: BlockKey) -> Option<u32> {
        match self.directory.get(&key) {
            Some(&Entry::Dense(slot)) => Some(slot),
            _ => None,
        }
    }

    /// Stores a block in the form that fits it.
    fn set_block(&mut self, key: BlockKey, values: &BlockData) {
        match (Block::Dense(values).uniform_value(), self.slot(key)) {
            (Some(value), slot) => {
                slot.into_iter().for_each(|slot| self.backend.release(slot));
                set_uniform(&mut self.directory, key, value);
            }
            (None, Some(slot)) => self.backend.write(slot, values),
            (None, None) => {
                let slot = self.backend.allocate(0);
                self.backend.write(slot, values);
                self.directory.insert(key, Entry::Dense(slot));
            }
        }
    }

    /// Rebuilds a map from what a file holds.
    pub(crate) fn restore<'a>(
        &mut self,
        blocks: impl Iterator<Item = (BlockKey, Block<'a>)>,
        num_frames: i64,
        saturated: u64,
    ) {
        for (key, block) in blocks {
            match block {
                Block::Uniform(value) => set_uniform(&mut self.directory, key, value),
                block => self.set_block(key, &block.to_data()),
            }
        }
        (self.num_frames, self.saturated) = (num_frames, saturated);
    }

    /// The parameters of the map.
    pub fn config(&self) -> &GridConfig {
        &self.config
    }

    /// What the map runs on: `"cpu"`, or the name of a device.
    pub fn backend(&self) -> &str {
        self.backend.name()
    }

    /// Blocks that hold something.
    pub fn num_blocks(&self) -> usize {
        self.directory.len()
    }

    /// Voxels that are not unknown.
    pub fn num_observed(&self) -> usize {
        let observed = |block: Block| match block {
            Block::Uniform(_) => BLOCK_VOXELS,
            block => block.to_data().iter().filter(|&&value| value != 0).count(),
        };
        self.directory.keys().filter_map(|&key| self.block(key)).map(observed).sum()
    }

    /// Frames fused less frames removed.
    pub fn num_frames(&self) -> i64 {
        self.num_frames
    }

    /// How often a voxel's evidence was too large to be stored whole.
    pub fn saturated(&self) -> u64 {
        self.saturated
    }

    /// Bytes that the map takes: dense blocks and directory.
    pub fn nbytes(&self) -> usize {
        directory::bytes(&self.directory, self.directory.len()) + self.backend.pool_bytes()
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

    fn block(&self, key: BlockKey) -> Option<Block<'_>> {
        self.directory.get(&key).map(|entry| match *entry {
            Entry::Uniform(value) => Block::Uniform(value),
            Entry::Dense(slot) => self.backend.read(slot),
        })
    }

    fn voxel_size(&self) -> f64 {
        self.config.voxel_size
    }

    fn prior_log_odds(&self) -> f64 {
        log_odds::from_probability(self.config.prior)
    }
}
