//! What unit tests need of a device.

use crate::gpu::Gpu;
use std::sync::Arc;
use wgpu::{Buffer, BufferUsages};

/// A device: the best GPU, or what `PYRAMAP_ADAPTER` names, or else a software one. Without any the test has nothing to
/// do, and says so; or fails, if `PYRAMAP_REQUIRE_GPU` is set.
pub fn gpu() -> Option<Arc<Gpu>> {
    let software =
        || crate::adapters()?.first().map_or_else(|| Gpu::open(None), |adapter| Gpu::open(Some(&adapter.name)));
    match Gpu::open(None).or_else(|_| software()) {
        Ok(gpu) => Some(gpu),
        Err(error) if std::env::var_os("PYRAMAP_REQUIRE_GPU").is_some() => panic!("{error}"),
        Err(error) => {
            println!("skipped: {error}");
            None
        }
    }
}

/// What lies in the first bytes of a buffer (`COPY_SRC`).
pub fn download<T: bytemuck::Pod>(gpu: &Gpu, buffer: &Buffer, count: usize) -> Vec<T> {
    let bytes = (count * size_of::<T>()) as u64;
    let staging = gpu.buffer("a test's", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST).unwrap();
    let mut encoder = gpu.encoder("a test").unwrap();
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
    let submission = gpu.submit(encoder).unwrap();
    gpu.read(&staging, bytes, &submission, |bytes| bytemuck::pod_collect_to_vec(bytes)).unwrap()
}
