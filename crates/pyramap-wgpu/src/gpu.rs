//! A device that is open, as the stages and the pool use it: every fault becomes an [`Error::Device`], nothing panics,
//! and nothing waits without end.

use pyramap::error::{DeviceFault, Error, Result};
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, mpsc};
use std::time::Duration;
use wgpu::{
    Buffer, BufferUsages, CommandEncoder, ComputePipeline, ErrorFilter, MapMode, PollError, PollType, SubmissionIndex,
};

/// A device that does not answer for so long hangs. A frame takes milliseconds on a card, and a second or two where a
/// busy processor plays one.
const PATIENCE: Duration = Duration::from_secs(60);

/// A device and its queue.
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    name: String,
    /// The process that opened the device: no other may touch it.
    process: u32,
    lost: Arc<OnceLock<String>>,
    /// By source and entry point: maps on one device share them.
    pipelines: Mutex<HashMap<(String, String), ComputePipeline>>,
}

impl Gpu {
    /// A device that belongs to an application. Its callbacks for lost devices and uncaught errors stay as they are.
    ///
    /// # Errors
    /// [`DeviceFault::NotFound`] if it was opened with limits that are too low for us.
    pub fn owned_elsewhere(device: wgpu::Device, queue: wgpu::Queue, name: String) -> Result<Self> {
        crate::adapters::check_limits(&name, &device.limits())?;
        let (process, lost) = (std::process::id(), Arc::default());
        Ok(Self { device, queue, name, process, lost, pipelines: Mutex::default() })
    }

    /// A device that is ours alone.
    pub(crate) fn ours(device: wgpu::Device, queue: wgpu::Queue, name: String) -> Result<Self> {
        let gpu = Self::owned_elsewhere(device, queue, name)?;
        // Whatever fails outside of our calls. wgpu's own answer is a panic.
        let lost = gpu.lost.clone();
        let stray = move |error: wgpu::Error| drop(lost.set(error.to_string()));
        gpu.device.on_uncaptured_error(Arc::new(stray));
        let lost = gpu.lost.clone();
        gpu.device.set_device_lost_callback(move |reason, message| {
            let _ = lost.set(format!("{reason:?} {message}").trim_end().to_lowercase());
        });
        Ok(gpu)
    }

    /// What users call it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The device.
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// Its queue.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// Whether this process was forked from the one that opened the device. Then no call to it may be made, not even to
    /// give something back: the driver's threads did not come along.
    pub fn forked(&self) -> bool {
        self.process != std::process::id()
    }

    /// Whether the device went away.
    pub fn lost(&self) -> bool {
        self.lost.get().is_some()
    }

    /// That the device can be worked with.
    ///
    /// # Errors
    /// [`DeviceFault::Forked`], [`DeviceFault::Lost`].
    pub fn check(&self) -> Result<()> {
        if self.forked() {
            return Err(forked(&self.name));
        }
        match self.lost.get() {
            Some(why) => {
                let reason = format!(
                    "{} was lost ({why}), and with it all of the map that was not read from it before",
                    self.name
                );
                Err(Error::Device { fault: DeviceFault::Lost, reason })
            }
            None => Ok(()),
        }
    }

    /// Takes note that the device went away.
    fn lose(&self, why: String) -> Error {
        let _ = self.lost.set(why);
        self.check().expect_err("the device was lost")
    }

    /// Does something that the driver may refuse. Whatever creates, writes, records or submits is called in here.
    ///
    /// # Errors
    /// As [`Gpu::check`]; [`DeviceFault::OutOfMemory`], [`DeviceFault::Internal`].
    pub fn attempt<T>(&self, what: &str, work: impl FnOnce() -> T) -> Result<T> {
        self.check()?;
        let filters = [ErrorFilter::Internal, ErrorFilter::Validation, ErrorFilter::OutOfMemory];
        let mut scopes = filters.map(|filter| Some(self.device.push_error_scope(filter)));
        let done = work();
        let mut error = None;
        for scope in scopes.iter_mut().rev().filter_map(Option::take) {
            error = pollster::block_on(scope.pop()).or(error);
        }
        self.check()?;
        let Some(error) = error else { return Ok(done) };
        Err(match error {
            wgpu::Error::OutOfMemory { .. } => out_of_memory(&self.name, what),
            error => {
                Error::Device { fault: DeviceFault::Internal, reason: format!("{} refused {what}: {error}", self.name) }
            }
        })
    }

    /// A buffer.
    ///
    /// # Errors
    /// As [`Gpu::attempt`]; [`DeviceFault::OutOfMemory`] also where the device has no buffers of that size.
    pub fn buffer(&self, label: &str, size: u64, usage: BufferUsages) -> Result<Buffer> {
        let what = format!("{size} bytes for {label}");
        let limits = self.device.limits();
        let bound = usage.contains(BufferUsages::STORAGE);
        let most = if bound { limits.max_storage_buffer_binding_size } else { u64::MAX }.min(limits.max_buffer_size);
        if size > most {
            return Err(out_of_memory(&self.name, &format!("{what}: it has {most} for one buffer")));
        }
        let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.attempt(&what, || self.device.create_buffer(&descriptor))
    }

    /// An entry point of a shader, compiled once for each device.
    ///
    /// # Errors
    /// As [`Gpu::attempt`].
    pub fn pipeline(&self, label: &str, source: &str, entry: &str) -> Result<ComputePipeline> {
        self.check()?;
        let key = (source.to_owned(), entry.to_owned());
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = pipelines.get(&key) {
            return Ok(pipeline.clone());
        }
        let pipeline = self.attempt(&format!("the shader {label}"), || {
            let source = wgpu::ShaderSource::Wgsl(source.into());
            let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(label), source });
            self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(label),
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        })?;
        pipelines.insert(key, pipeline.clone());
        Ok(pipeline)
    }

    /// What a pipeline works on: resources for `@binding(0)`, `@binding(1)`, ... of group 0.
    ///
    /// # Errors
    /// As [`Gpu::attempt`].
    pub fn bind(&self, pipeline: &ComputePipeline, resources: &[wgpu::BindingResource]) -> Result<wgpu::BindGroup> {
        let numbered = (0..).zip(resources.iter().cloned());
        let entries: Vec<_> = numbered.map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        self.attempt("buffers for a shader", || {
            let layout = pipeline.get_bind_group_layout(0);
            self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &layout,
                entries: &entries,
            })
        })
    }

    /// Writes into a buffer, in the order of submissions. Offset and size are multiples of four.
    ///
    /// # Errors
    /// As [`Gpu::attempt`].
    pub fn write(&self, buffer: &Buffer, offset: u64, bytes: &[u8]) -> Result<()> {
        self.attempt("a write", || self.queue.write_buffer(buffer, offset, bytes))
    }

    /// Something to record commands with.
    ///
    /// # Errors
    /// As [`Gpu::attempt`].
    pub fn encoder(&self, label: &str) -> Result<CommandEncoder> {
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some(label) };
        self.attempt("a list of commands", || self.device.create_command_encoder(&descriptor))
    }

    /// Begins with what was recorded.
    ///
    /// # Errors
    /// As [`Gpu::attempt`]; mistakes in what was recorded come up here.
    pub fn submit(&self, encoder: CommandEncoder) -> Result<SubmissionIndex> {
        self.attempt("its work", || self.queue.submit([encoder.finish()]))
    }

    /// Waits until a submission is done.
    ///
    /// # Errors
    /// [`DeviceFault::Lost`], also if the device hangs; [`DeviceFault::Forked`].
    pub fn wait(&self, submission: &SubmissionIndex) -> Result<()> {
        self.check()?;
        let wait = PollType::Wait { submission_index: Some(submission.clone()), timeout: Some(PATIENCE) };
        // wgpu makes a panic of what the driver says of a device that is gone.
        match catch_unwind(AssertUnwindSafe(|| self.device.poll(wait))) {
            Ok(Ok(_)) => self.check(),
            Ok(Err(PollError::Timeout)) => Err(self.lose(format!("no answer for {} s", PATIENCE.as_secs()))),
            Ok(Err(PollError::WrongSubmissionIndex(..))) => Err(self.lose("it takes no more work".into())),
            Err(_) => Err(self.lose("the driver failed".into())),
        }
    }

    /// What lies in the first bytes of a staging buffer (`MAP_READ`) once a submission is done, which is the last to
    /// use the buffer.
    ///
    /// # Errors
    /// As [`Gpu::attempt`] and [`Gpu::wait`].
    pub fn read<T>(
        &self,
        staging: &Buffer,
        bytes: u64,
        after: &SubmissionIndex,
        take: impl FnOnce(&[u8]) -> T,
    ) -> Result<T> {
        if bytes == 0 {
            self.wait(after)?;
            return Ok(take(&[]));
        }
        let slice = staging.slice(..bytes);
        let (sender, receiver) = mpsc::channel();
        self.attempt("a read", || slice.map_async(MapMode::Read, move |mapped| sender.send(mapped).unwrap_or(())))?;
        self.wait(after)?;
        // Another thread that waits for the same device may have been the one to find it done, and be about to say so.
        if !matches!(receiver.recv_timeout(PATIENCE), Ok(Ok(()))) {
            return Err(self.lose("its memory cannot be read".into()));
        }
        let view = slice.get_mapped_range().map_err(|error| self.lose(error.to_string()))?;
        let taken = take(&view);
        drop(view);
        staging.unmap();
        Ok(taken)
    }
}

/// A child cannot use what its parent opened.
pub(crate) fn forked(name: &str) -> Error {
    let reason = format!(
        "this process was forked from one that had opened {name}, and devices do not survive that: start it anew \
         instead (in Python: multiprocessing.set_start_method(\"spawn\")), or open the device after the fork only"
    );
    Error::Device { fault: DeviceFault::Forked, reason }
}

fn out_of_memory(name: &str, what: &str) -> Error {
    Error::Device { fault: DeviceFault::OutOfMemory, reason: format!("{name} has no room for {what}") }
}
