//! The pool of dense blocks on a device: pages of 32-bit voxels. It grows by pages, so that nothing is ever copied and
//! no device's limit on buffers is met; slots that are given back are handed out again.

use crate::gpu::Gpu;
use pyramap::block::BlockData;
use pyramap::error::{Error, Result};
use wgpu::{Buffer, BufferUsages};

/// Bytes of a block.
pub const BLOCK_BYTES: u64 = size_of::<BlockData>() as u64;
/// Blocks in a page unless a map is made with another number: 8 MiB.
pub const PAGE_BLOCKS: usize = (8 << 20) / BLOCK_BYTES as usize;
/// Blocks in a page at most: 64 MiB, half of what any device binds.
const MOST_PAGE_BLOCKS: usize = (64 << 20) / BLOCK_BYTES as usize;
/// Blocks that cross to the host or back at a time: bounds the memory that takes to 8 MiB.
const BLOCKS_AT_ONCE: usize = (8 << 20) / BLOCK_BYTES as usize;

/// The blocks, by slot.
pub struct Pool {
    page_blocks: usize,
    pages: Vec<Buffer>,
    /// Slots below this were handed out once.
    num_slots: usize,
    unused: Vec<u32>,
}

impl Pool {
    /// An empty pool that grows by so many blocks.
    ///
    /// # Errors
    /// [`Error::Parameter`].
    pub fn new(page_blocks: usize) -> Result<Self> {
        if !(1..=MOST_PAGE_BLOCKS).contains(&page_blocks) {
            let (got, expected) = (format!("{page_blocks}"), format!("between 1 and {MOST_PAGE_BLOCKS}"));
            return Err(Error::Parameter { name: "page_blocks", got, expected });
        }
        Ok(Self { page_blocks, pages: Vec::new(), num_slots: 0, unused: Vec::new() })
    }

    /// Blocks in each page.
    pub fn page_blocks(&self) -> usize {
        self.page_blocks
    }

    /// The pages.
    pub fn pages(&self) -> &[Buffer] {
        &self.pages
    }

    /// Bytes of all pages.
    pub fn bytes(&self) -> usize {
        self.pages.len() * self.page_bytes() as usize
    }

    /// Bytes by which the pool would grow if so many slots were allocated.
    pub fn growth(&self, new: usize) -> usize {
        self.missing_pages(new) * self.page_bytes() as usize
    }

    fn page_bytes(&self) -> u64 {
        self.page_blocks as u64 * BLOCK_BYTES
    }

    fn missing_pages(&self, new: usize) -> usize {
        let slots = self.num_slots + new.saturating_sub(self.unused.len());
        slots.div_ceil(self.page_blocks).saturating_sub(self.pages.len())
    }

    /// Makes the pages for so many more slots.
    ///
    /// # Errors
    /// As [`Gpu::buffer`]; pages made before that stay, for the next time.
    pub fn reserve(&mut self, gpu: &Gpu, new: usize) -> Result<()> {
        for _ in 0..self.missing_pages(new) {
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
            self.pages.push(gpu.buffer("a page of the map", self.page_bytes(), usage)?);
        }
        Ok(())
    }

    /// A slot.
    ///
    /// # Panics
    /// If none was reserved.
    pub fn allocate(&mut self) -> u32 {
        self.unused.pop().unwrap_or_else(|| {
            assert!(self.num_slots < self.pages.len() * self.page_blocks, "slots are reserved before");
            self.num_slots += 1;
            (self.num_slots - 1) as u32
        })
    }

    /// Gives a slot back.
    pub fn release(&mut self, slot: u32) {
        self.unused.push(slot);
    }

    /// Brings blocks to the host: calls `take` with each of `slots`, which ascend, and its voxels.
    ///
    /// # Errors
    /// As [`Gpu::read`].
    pub fn gather(&self, gpu: &Gpu, slots: &[u32], mut take: impl FnMut(u32, BlockData)) -> Result<()> {
        if slots.is_empty() {
            return Ok(());
        }
        let bytes = slots.len().min(BLOCKS_AT_ONCE) as u64 * BLOCK_BYTES;
        let staging = gpu.buffer("reading the map", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
        for slots in slots.chunks(BLOCKS_AT_ONCE) {
            let mut encoder = gpu.encoder("read the map")?;
            let mut copied = 0;
            for (run, page, at) in self.runs(slots) {
                let bytes = run.len() as u64 * BLOCK_BYTES;
                encoder.copy_buffer_to_buffer(page, at, &staging, copied, bytes);
                copied += bytes;
            }
            let submission = gpu.submit(encoder)?;
            gpu.read(&staging, copied, &submission, |bytes| {
                let blocks = bytes.chunks_exact(BLOCK_BYTES as usize).map(bytemuck::pod_read_unaligned);
                slots.iter().zip(blocks).for_each(|(&slot, block)| take(slot, block));
            })?;
        }
        Ok(())
    }

    /// Sends blocks to the device: those in `slots`, which ascend, as `give` says. Done in the order of submissions.
    ///
    /// # Errors
    /// As [`Gpu::submit`].
    pub fn scatter<'a>(&self, gpu: &Gpu, slots: &[u32], give: impl Fn(u32) -> &'a BlockData) -> Result<()> {
        for slots in slots.chunks(BLOCKS_AT_ONCE) {
            for (run, page, at) in self.runs(slots) {
                let blocks: Vec<BlockData> = run.iter().map(|&slot| *give(slot)).collect();
                gpu.write(page, at, bytemuck::cast_slice(&blocks))?;
            }
            // Frees the memory that the writes wait in.
            gpu.submit(gpu.encoder("write the map")?)?;
        }
        Ok(())
    }

    /// Slots that follow each other in one page, the page, and the first one's byte in it.
    fn runs<'a>(&'a self, slots: &'a [u32]) -> impl Iterator<Item = (&'a [u32], &'a Buffer, u64)> {
        let page = |slot: u32| slot as usize / self.page_blocks;
        slots.chunk_by(move |&a, &b| b == a + 1 && page(a) == page(b)).map(move |run| {
            let at = (run[0] as usize % self.page_blocks) as u64 * BLOCK_BYTES;
            (run, &self.pages[page(run[0])], at)
        })
    }
}
