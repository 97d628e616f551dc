//! How long passes take, by the device's own clock, where it has one.

use crate::gpu::Gpu;
use pyramap::error::Result;
use wgpu::{Buffer, BufferUsages, CommandEncoder, ComputePassTimestampWrites};

/// Bytes of one timestamp.
const TIMESTAMP: u64 = size_of::<u64>() as u64;

/// The times at which each of some passes began and ended.
pub struct Timestamps {
    set: wgpu::QuerySet,
    resolved: Buffer,
    passes: u32,
    nanoseconds: f64,
}

impl Timestamps {
    /// Room for so many passes; `None` where the device has no clock.
    ///
    /// # Errors
    /// As [`Gpu::attempt`].
    pub fn new(gpu: &Gpu, passes: u32) -> Result<Option<Self>> {
        if !gpu.device().features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        let (ty, count) = (wgpu::QueryType::Timestamp, 2 * passes);
        let descriptor = wgpu::QuerySetDescriptor { label: Some("timestamps"), ty, count };
        let set = gpu.attempt("a clock", || gpu.device().create_query_set(&descriptor))?;
        let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
        let resolved = gpu.buffer("timestamps", Self::bytes(passes), usage)?;
        Ok(Some(Self { set, resolved, passes, nanoseconds: f64::from(gpu.queue().get_timestamp_period()) }))
    }

    /// Bytes that the times of so many passes take in a staging buffer.
    pub const fn bytes(passes: u32) -> u64 {
        2 * passes as u64 * TIMESTAMP
    }

    /// Takes the time of the `n`-th pass.
    pub fn of_pass(&self, n: u32) -> ComputePassTimestampWrites<'_> {
        ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(2 * n),
            end_of_pass_write_index: Some(2 * n + 1),
        }
    }

    /// Copies the times of all passes to a staging buffer; each must have been taken in this submission.
    pub fn copy_to(&self, encoder: &mut CommandEncoder, staging: &Buffer, offset: u64) {
        encoder.resolve_query_set(&self.set, 0..2 * self.passes, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, staging, offset, Self::bytes(self.passes));
    }

    /// Seconds of each pass, from what was copied.
    pub fn seconds<'a>(&self, bytes: &'a [u8]) -> impl Iterator<Item = f64> + use<'a> {
        let nanoseconds = self.nanoseconds;
        bytes.chunks_exact(2 * TIMESTAMP as usize).map(move |pair| {
            let [begin, end] = [0, 1].map(|i| {
                let at = i * TIMESTAMP as usize;
                u64::from_ne_bytes(pair[at..at + TIMESTAMP as usize].try_into().expect("eight bytes"))
            });
            end.saturating_sub(begin) as f64 * nanoseconds * 1e-9
        })
    }
}
