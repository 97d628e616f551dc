//! The graphics cards of this machine, and which of them is taken.

use crate::gpu::{Gpu, forked};
use pyramap::error::{DeviceFault, Error, Result};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use wgpu::{Backend, Backends, DeviceType, Features, Limits};

/// Names a part of the adapter to use where the program does not; the environment's word for `adapter=`.
pub const ADAPTER_VARIABLE: &str = "PYRAMAP_ADAPTER";

/// What stands behind an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A card with memory of its own.
    Discrete,
    /// A GPU that shares the processor's memory.
    Integrated,
    /// A GPU lent to a virtual machine.
    Virtual,
    /// Something else.
    Other,
    /// The processor, playing a GPU.
    Software,
}

impl Kind {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Discrete => "discrete",
            Self::Integrated => "integrated",
            Self::Virtual => "virtual",
            Self::Other => "other",
            Self::Software => "software",
        }
    }
}

/// A card, as one of the system's interfaces shows it: some are there twice.
#[derive(Clone, Debug, PartialEq)]
pub struct Adapter {
    /// The card's name.
    pub name: String,
    /// What stands behind it.
    pub kind: Kind,
    /// The interface: `"vulkan"`, `"metal"` or `"dx12"`.
    pub api: &'static str,
    /// The driver and its version.
    pub driver: String,
    /// Bytes of the largest buffer.
    pub max_buffer_bytes: u64,
    /// Bytes of the largest part of a buffer that a shader sees.
    pub max_binding_bytes: u64,
    /// Why it cannot be used, if so.
    pub problem: Option<String>,
}

/// All adapters, in the system's order.
///
/// # Errors
/// [`DeviceFault::Forked`] in a process forked from one that looked for adapters.
pub fn adapters() -> Result<Vec<Adapter>> {
    with_system(|system| Ok(system.adapters.iter().map(describe).collect()))
}

impl Gpu {
    /// Opens an adapter: the first whose name contains `adapter`, in whatever case, or what `PYRAMAP_ADAPTER` says, or
    /// the best GPU, which is never a software one. A process has one device of each adapter; it is kept until the
    /// process ends, or the device is lost.
    ///
    /// # Errors
    /// [`Error::Device`]: [`DeviceFault::NotFound`] with what was found; [`DeviceFault::Forked`].
    pub fn open(adapter: Option<&str>) -> Result<Arc<Self>> {
        let variable = std::env::var(ADAPTER_VARIABLE).ok().filter(|name| !name.is_empty());
        with_system(|system| system.open(adapter.or(variable.as_deref())))
    }
}

/// What a process knows of its cards.
struct System {
    adapters: Vec<wgpu::Adapter>,
    /// Open devices, by the place of their adapter.
    open: Vec<(usize, Arc<Gpu>)>,
}

/// Does something with the cards, which are looked for the first time. Drivers do not survive a fork: a child may not
/// even look, and not wait for a lock that some thread held when it was forked.
fn with_system<T>(work: impl FnOnce(&mut System) -> Result<T>) -> Result<T> {
    static PROCESS: OnceLock<u32> = OnceLock::new();
    static SYSTEM: Mutex<Option<System>> = Mutex::new(None);
    if *PROCESS.get_or_init(std::process::id) != std::process::id() {
        return Err(forked("graphics drivers"));
    }
    let mut system = SYSTEM.lock().unwrap_or_else(PoisonError::into_inner);
    work(system.get_or_insert_with(System::new))
}

impl System {
    fn new() -> Self {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = Backends::VULKAN | Backends::METAL | Backends::DX12;
        // What the driver's own validation finds, wgpu's finds as well. Indirect dispatches are ours and within limits.
        descriptor.flags = wgpu::InstanceFlags::empty().with_env();
        let instance = wgpu::Instance::new(descriptor);
        let adapters = pollster::block_on(instance.enumerate_adapters(Backends::all()));
        Self { adapters, open: Vec::new() }
    }

    fn open(&mut self, adapter: Option<&str>) -> Result<Arc<Gpu>> {
        if self.open.iter().any(|(_, gpu)| gpu.lost()) {
            // Cards may be others, and in another order, when one of them comes back.
            *self = Self::new();
        }
        let described: Vec<_> = self.adapters.iter().map(describe).collect();
        let chosen = choose(&described, adapter)?;
        if let Some((_, gpu)) = self.open.iter().find(|(place, _)| *place == chosen) {
            return Ok(gpu.clone());
        }
        let gpu = Arc::new(request(&self.adapters[chosen], described[chosen].name.clone())?);
        self.open.push((chosen, gpu.clone()));
        Ok(gpu)
    }
}

fn describe(adapter: &wgpu::Adapter) -> Adapter {
    let (info, limits) = (adapter.get_info(), adapter.limits());
    let problem = match check_limits(&info.name, &limits) {
        Err(Error::Device { reason, .. }) => Some(reason),
        _ => None,
    };
    Adapter {
        kind: match info.device_type {
            DeviceType::DiscreteGpu => Kind::Discrete,
            DeviceType::IntegratedGpu => Kind::Integrated,
            DeviceType::VirtualGpu => Kind::Virtual,
            DeviceType::Cpu => Kind::Software,
            DeviceType::Other => Kind::Other,
        },
        api: match info.backend {
            Backend::Metal => "metal",
            Backend::Dx12 => "dx12",
            _ => "vulkan",
        },
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        max_buffer_bytes: limits.max_buffer_size,
        max_binding_bytes: limits.max_storage_buffer_binding_size,
        name: info.name,
        problem,
    }
}

fn request(adapter: &wgpu::Adapter, name: String) -> Result<Gpu> {
    // Nothing beyond WebGPU's baseline, so that what works on one card works on all.
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("pyramap"),
        required_features: adapter.features() & Features::TIMESTAMP_QUERY,
        required_limits: Limits::default().or_worse_values_from(&adapter.limits()),
        memory_hints: wgpu::MemoryHints::MemoryUsage,
        ..Default::default()
    };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).map_err(|error| Error::Device {
        fault: DeviceFault::NotFound,
        reason: format!("{name} was found, but its driver does not open it: {error}"),
    })?;
    Gpu::ours(device, queue, name)
}

/// That a device has what the shaders are written for: a part of WebGPU's baseline.
pub(crate) fn check_limits(name: &str, got: &Limits) -> Result<()> {
    let lower = used(got).into_iter().zip(used(&Limits::default())).find(|((_, got), (_, needed))| got < needed);
    match lower {
        None => Ok(()),
        Some(((what, got), (_, needed))) => Err(Error::Device {
            fault: DeviceFault::NotFound,
            reason: format!("{name} allows {got} {what}, expected at least {needed}"),
        }),
    }
}

/// The limits that the shaders come near to.
fn used(limits: &Limits) -> [(&'static str, u64); 7] {
    [
        ("storage buffers a stage", limits.max_storage_buffers_per_shader_stage.into()),
        ("invocations a workgroup", limits.max_compute_invocations_per_workgroup.into()),
        ("invocations along x", limits.max_compute_workgroup_size_x.into()),
        ("bytes of workgroup memory", limits.max_compute_workgroup_storage_size.into()),
        ("workgroups a dimension", limits.max_compute_workgroups_per_dimension.into()),
        ("bytes a storage binding", limits.max_storage_buffer_binding_size),
        ("bytes a buffer", limits.max_buffer_size),
    ]
}

/// The place of the adapter to take: the best of its kind, the first among equals.
///
/// # Errors
/// [`DeviceFault::NotFound`].
fn choose(adapters: &[Adapter], wanted: Option<&str>) -> Result<usize> {
    let lower = wanted.map(str::to_lowercase);
    let fits = |adapter: &Adapter| match &lower {
        Some(wanted) => adapter.name.to_lowercase().contains(wanted),
        None => adapter.kind != Kind::Software,
    };
    let candidates = || adapters.iter().enumerate().filter(|(_, adapter)| fits(adapter));
    let usable = candidates().filter(|(_, adapter)| adapter.problem.is_none());
    if let Some((n, _)) = usable.min_by_key(|(_, adapter)| adapter.kind) {
        return Ok(n);
    }
    let mut reason = match (wanted, candidates().find_map(|(_, adapter)| adapter.problem.clone())) {
        (_, Some(problem)) => problem,
        (Some(wanted), None) => format!("no graphics adapter has \"{wanted}\" in its name"),
        (None, None) => "no GPU was found".to_owned(),
    };
    let list: Vec<_> = adapters.iter().map(|a| format!("{} ({}, {})", a.name, a.kind.name(), a.api)).collect();
    reason += &match list.as_slice() {
        [] => "; there are no graphics adapters at all".to_owned(),
        list => format!("; adapters: {}", list.join(", ")),
    };
    reason += if cfg!(target_os = "linux") {
        ". Install the card's Vulkan driver: NVIDIA's own driver package, or mesa-vulkan-drivers for AMD and Intel"
    } else if cfg!(target_os = "windows") {
        ". Install the card vendor's driver, for DirectX 12 or Vulkan"
    } else {
        ""
    };
    if wanted.is_none() && adapters.iter().any(|a| a.kind == Kind::Software) {
        reason += ". A software adapter is taken only if it is named (adapter=); backend=\"cpu\" is faster";
    }
    Err(Error::Device { fault: DeviceFault::NotFound, reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adapter(name: &str, kind: Kind) -> Adapter {
        let (name, api, driver) = (name.to_owned(), "vulkan", String::new());
        Adapter { name, kind, api, driver, max_buffer_bytes: 1 << 30, max_binding_bytes: 1 << 30, problem: None }
    }

    fn refused(adapters: &[Adapter], wanted: Option<&str>) -> String {
        match choose(adapters, wanted) {
            Err(Error::Device { fault: DeviceFault::NotFound, reason }) => reason,
            other => panic!("expected that nothing is found, got {other:?}"),
        }
    }

    #[test]
    fn the_best_real_gpu_is_taken() {
        let all = [
            adapter("llvmpipe (LLVM 15)", Kind::Software),
            adapter("Virtio", Kind::Virtual),
            adapter("Intel UHD", Kind::Integrated),
            adapter("NVIDIA RTX", Kind::Discrete),
            adapter("AMD Radeon", Kind::Discrete),
        ];
        assert_eq!(choose(&all, None).unwrap(), 3);
        assert_eq!(choose(&all[..3], None).unwrap(), 2);
        assert_eq!(choose(&all[..2], None).unwrap(), 1);
    }

    #[test]
    fn a_software_adapter_is_taken_only_by_name() {
        let all = [adapter("llvmpipe (LLVM 15)", Kind::Software), adapter("Intel UHD", Kind::Integrated)];
        assert_eq!(choose(&all, Some("LLVMPipe")).unwrap(), 0);
        let reason = refused(&all[..1], None);
        assert!(reason.contains("llvmpipe (LLVM 15) (software, vulkan)") && reason.contains("adapter="), "{reason}");
        let reason = refused(&all, Some("radeon"));
        assert!(reason.contains("\"radeon\"") && reason.contains("Intel UHD"), "{reason}");
        assert!(refused(&[], None).contains("no graphics adapters at all"));
    }

    #[test]
    fn an_adapter_that_falls_short_is_passed_over() {
        let mut all = [adapter("old", Kind::Discrete), adapter("new", Kind::Integrated)];
        all[0].problem = Some("old allows 4 storage buffers a stage, expected at least 8".into());
        assert_eq!(choose(&all, None).unwrap(), 1);
        assert!(refused(&all, Some("old")).contains("4 storage buffers"));
    }

    #[test]
    fn limits_below_the_baseline_are_named() {
        assert!(check_limits("card", &Limits::default()).is_ok());
        let reason = match check_limits("card", &Limits::downlevel_defaults()) {
            Err(Error::Device { reason, .. }) => reason,
            other => panic!("expected an error, got {other:?}"),
        };
        assert_eq!(reason, "card allows 4 storage buffers a stage, expected at least 8");
    }
}
