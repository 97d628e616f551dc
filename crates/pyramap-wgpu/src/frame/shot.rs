//! One frame on the device: its pixels, what is found in it, and the way there and back.

use super::recent::RECENT;
use super::stages::{ARGUMENTS_BYTES, Buffers, Lens, Stages, TIMED, Variant};
use crate::gpu::Gpu;
use crate::pool::BLOCK_BYTES;
use crate::timestamps::Timestamps;
use pyramap::block::BlockKey;
use pyramap::error::Result;
use pyramap_shaders::RESULT_COUNTS;
use pyramap_shaders::layout::{Frame, Page};
use wgpu::{Buffer, BufferUsages, SubmissionIndex};

/// How much of a frame there is room for. A frame that needs more is done again, with more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Free blocks.
    pub free: usize,
    /// Mixed blocks.
    pub mixed: usize,
    /// Mixed blocks whose increments lie in one buffer.
    pub page_blocks: usize,
}

impl Room {
    /// At first; enough for a room at 4 cm.
    pub const USUAL: Self = Self { free: 4096, mixed: 1024, page_blocks: (64 << 20) / BLOCK_BYTES as usize };

    /// Room for so many blocks as well.
    fn with(self, free: usize, mixed: usize) -> Self {
        let grown = |room: usize, needed: usize| if needed > room { needed.next_power_of_two() } else { room };
        Self { free: grown(self.free, free), mixed: grown(self.mixed, mixed), ..self }
    }

    fn holds(self, free: usize, mixed: usize) -> bool {
        free <= self.free && mixed <= self.mixed
    }

    /// Words of the results. An even number, since timestamps follow them, which are twice as long.
    fn words(self) -> usize {
        (RESULT_COUNTS + self.free + 3 * self.mixed).next_multiple_of(2)
    }
}

/// What the host reads of a frame.
pub struct Found<'a> {
    /// Free blocks, by their place in the box around the frustum.
    pub free: &'a [u32],
    /// Mixed blocks, likewise.
    pub mixed: &'a [u32],
    /// For each mixed block, how many voxels change, and an increment.
    pub changes: &'a [[u32; 2]],
    /// Of the device's clock.
    pub timestamps: &'a [u8],
}

/// A frame's own buffers, and those of the stages while it is under way.
pub struct Shot {
    /// All that the kernels work on.
    pub buffers: Buffers,
    /// What the kernels know of the frame.
    pub frame: Frame,
    /// The block from which blocks are counted.
    pub low: BlockKey,
    /// Host seconds that it took to send the frame.
    pub upload: f64,
    /// The stages of the last frames' sensors, those of the frame first.
    pub stages: Vec<Stages>,
    room: Room,
    staging: Buffer,
    variant: Option<Variant>,
    submission: Option<SubmissionIndex>,
}

impl Shot {
    /// With room for some blocks. The other buffers come with the frame.
    ///
    /// # Errors
    /// As [`Gpu::buffer`].
    pub fn new(gpu: &Gpu, room: Room) -> Result<Self> {
        let nothing = gpu.buffer("nothing yet", 0, BufferUsages::STORAGE)?;
        let frame = gpu.buffer("a frame", size_of::<Frame>() as u64, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?;
        let again = || nothing.clone();
        let mut shot = Self {
            buffers: Buffers {
                frame,
                depth: again(),
                lens: Lens { range_per_depth: again(), rows: None },
                scratch: again(),
                surfaces: again(),
                bounds: again(),
                table: again(),
                results: again(),
                arguments: again(),
                pages: Vec::new(),
                increments: Vec::new(),
            },
            frame: Frame::default(),
            low: [0; 3],
            upload: 0.0,
            room,
            staging: again(),
            stages: Vec::new(),
            variant: None,
            submission: None,
        };
        shot.make_room(gpu, room)?;
        Ok(shot)
    }

    fn make_room(&mut self, gpu: &Gpu, room: Room) -> Result<()> {
        let results = 4 * room.words() as u64;
        let results_usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let read_usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        let arguments_usage = BufferUsages::STORAGE | BufferUsages::INDIRECT;
        let increments_usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let page_usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let page = |first: usize| {
            let page = gpu.buffer("a page's place", size_of::<Page>() as u64, page_usage)?;
            gpu.write(&page, 0, bytemuck::bytes_of(&Page { first: first as u32 }))?;
            Ok(page)
        };
        let increments = |first: usize| {
            let blocks = room.page_blocks.min(room.mixed - first);
            gpu.buffer("increments", blocks as u64 * BLOCK_BYTES, increments_usage)
        };
        let firsts = || (0..room.mixed).step_by(room.page_blocks);
        // All of them, or none.
        let pages = firsts().map(page).collect::<Result<_>>()?;
        let increments = firsts().map(increments).collect::<Result<_>>()?;
        let arguments = (firsts().len() * ARGUMENTS_BYTES) as u64;
        let arguments = gpu.buffer("numbers of workgroups", arguments, arguments_usage)?;
        let staging = gpu.buffer("results, on the host", results + Timestamps::bytes(TIMED), read_usage)?;
        let results = gpu.buffer("results", results, results_usage)?;
        (self.buffers.pages, self.buffers.increments) = (pages, increments);
        (self.buffers.arguments, self.buffers.results) = (arguments, results);
        (self.staging, self.room) = (staging, room);
        Ok(())
    }

    /// Begins with the stages. Everything in the buffers must be the frame's.
    ///
    /// # Errors
    /// As [`Stages::new`], [`Gpu::submit`].
    pub fn begin(&mut self, gpu: &Gpu, variant: Variant, clock: Option<&Timestamps>) -> Result<()> {
        if let Some(known) = self.stages.iter().position(|stages| stages.fit(&variant, &self.buffers)) {
            self.stages[..=known].rotate_right(1);
        } else {
            self.stages.retain(|stages| stages.in_use(&self.buffers));
            self.stages.truncate(RECENT - 1);
            self.stages.insert(0, Stages::new(gpu, variant.clone(), self.buffers.clone())?);
        }
        self.variant = Some(variant);
        let Self { buffers, room, frame, .. } = self;
        (frame.free_room, frame.mixed_room) = (room.free as u32, room.mixed as u32);
        frame.page_blocks = room.page_blocks as u32;
        gpu.write(&buffers.frame, 0, bytemuck::bytes_of(frame))?;
        let mut encoder = gpu.encoder("a frame")?;
        encoder.clear_buffer(&buffers.results, 0, Some(4 * RESULT_COUNTS as u64));
        self.stages[0].record(&mut encoder, frame, clock);
        let bytes = 4 * room.words() as u64;
        encoder.copy_buffer_to_buffer(&buffers.results, 0, &self.staging, 0, bytes);
        if let Some(clock) = clock {
            clock.copy_to(&mut encoder, &self.staging, bytes);
        }
        self.submission = Some(gpu.submit(encoder)?);
        Ok(())
    }

    /// Waits for what was found, and hands it on. If there was no room for it all, there is now, and the frame is done
    /// again: once, since that finds just as much.
    ///
    /// # Errors
    /// As [`Gpu::read`], [`Shot::begin`].
    pub fn finish(&mut self, gpu: &Gpu, clock: Option<&Timestamps>, mut take: impl FnMut(Found)) -> Result<()> {
        loop {
            let results = 4 * self.room.words();
            let bytes = results as u64 + if clock.is_some() { Timestamps::bytes(TIMED) } else { 0 };
            let submission = self.submission.as_ref().expect("the frame was begun");
            let room = self.room;
            let (free, mixed) = gpu.read(&self.staging, bytes, submission, |bytes| {
                let words: &[u32] = bytemuck::cast_slice(&bytes[..results]);
                let (free, mixed) = (words[0] as usize, words[1] as usize);
                if room.holds(free, mixed) {
                    let (free_blocks, words) = words[RESULT_COUNTS..].split_at(room.free);
                    let (mixed_blocks, words) = words.split_at(room.mixed);
                    take(Found {
                        free: &free_blocks[..free],
                        mixed: &mixed_blocks[..mixed],
                        changes: bytemuck::cast_slice(&words[..2 * mixed]),
                        timestamps: &bytes[results..],
                    });
                }
                (free, mixed)
            })?;
            if room.holds(free, mixed) {
                return Ok(());
            }
            self.make_room(gpu, room.with(free, mixed))?;
            let variant = self.variant.clone().expect("the frame was begun");
            self.begin(gpu, variant, clock)?;
        }
    }
}
