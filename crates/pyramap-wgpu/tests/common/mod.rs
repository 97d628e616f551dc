//! A device for tests: a GPU if there is one, else a software adapter.
#![allow(dead_code, reason = "each test uses a part of it")]

use pyramap_wgpu::{Gpu, adapters};
use std::sync::Arc;

/// The device; `None`, with the reason printed, where there is none. With `PYRAMAP_REQUIRE_GPU` in the environment that
/// is a failure.
pub fn gpu() -> Option<Arc<Gpu>> {
    let error = match Gpu::open(None).or_else(|error| Gpu::open(Some(&software().ok_or(error)?))) {
        Ok(gpu) => return Some(gpu),
        Err(error) => error,
    };
    assert!(std::env::var_os("PYRAMAP_REQUIRE_GPU").is_none(), "PYRAMAP_REQUIRE_GPU is set, but {error}");
    eprintln!("skipped: {error}");
    None
}

/// The name of a software adapter.
pub fn software() -> Option<String> {
    let mut adapters = adapters().unwrap_or_default().into_iter();
    adapters.find(|adapter| adapter.kind == pyramap_wgpu::adapters::Kind::Software).map(|adapter| adapter.name)
}

/// A device as an application would open it for itself: the same card that [`gpu`] takes.
pub fn own_device() -> Option<(wgpu::Device, wgpu::Queue)> {
    let name = gpu()?.name().to_owned();
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    let instance = wgpu::Instance::new(descriptor);
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let adapter = adapters.into_iter().find(|adapter| adapter.get_info().name == name).expect("it was there before");
    Some(pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default())).expect("a device"))
}

/// Numbers that are the same in every run.
pub struct Random(pub u64);

impl Random {
    /// Any number.
    pub fn number(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 32) as u32
    }

    /// A number below another.
    pub fn below(&mut self, end: usize) -> usize {
        self.number() as usize % end
    }

    /// True once in so many times.
    pub fn once_in(&mut self, times: usize) -> bool {
        self.below(times) == 0
    }

    /// The numbers below another, in any order.
    pub fn order(&mut self, end: usize) -> Vec<usize> {
        let mut order: Vec<_> = (0..end).collect();
        (1..end).rev().for_each(|n| order.swap(n, self.below(n + 1)));
        order
    }
}
