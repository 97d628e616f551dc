//! The GPU backend of pyramap: the stages of a frame as WGSL compute shaders, over a pool of blocks in the card's
//! memory. Vulkan, Metal and DX12 through wgpu; no other toolkit.
//!
//! ```no_run
//! use pyramap::{GridConfig, OccupancyGrid};
//! use pyramap_wgpu::GpuBackend;
//!
//! let config = GridConfig::new(0.02)?;
//! let backend = GpuBackend::new(&config, None)?; // the best GPU there is
//! let mut grid = OccupancyGrid::with_backend(config, Box::new(backend))?;
//! # Ok::<(), pyramap::Error>(())
//! ```
//!
//! [`gpu`] is an open device and turns its faults into errors; [`mod@adapters`] finds one. A frame's stages before
//! commit are in [`frame`]; [`commit`] adds to the [`pool`]; [`mirror`] keeps the host's copies of it; [`backend`] is
//! all of them together, as [`pyramap::backend::Backend`].

pub mod adapters;
pub mod backend;
pub mod commit;
pub mod frame;
pub mod gpu;
pub mod mirror;
pub mod pool;
#[cfg(test)]
mod testing;
pub mod timestamps;

pub use adapters::{Adapter, adapters};
pub use backend::{GpuBackend, Sizes};
pub use gpu::Gpu;
