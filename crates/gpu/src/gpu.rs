//! The graphics device: adapter, limits, faults.

use crate::GpuError;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Longest wait for the device before it counts as lost.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Time that a reader stays awake for a card before it sleeps.
const AWAKE: Duration = Duration::from_micros(500);

/// Which kind of adapter to prefer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Prefer {
    /// A graphics card if there is one, else a software driver.
    #[default]
    Hardware,
    /// A software driver if there is one, else a graphics card: identical pictures on every
    /// machine.
    Software,
}

/// An open graphics device. Clones share it.
#[derive(Clone, Debug)]
pub struct Gpu {
    inner: Arc<Inner>,
}

/// Faults of the device since it was opened.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults {
    /// Number of errors that no call returned: misuse of the device.
    pub count: u32,
    /// The first of them.
    pub first: Option<String>,
    /// Why the device was lost, if it was.
    pub lost: Option<String>,
}

#[derive(Debug)]
struct Inner {
    instance: wgpu::Instance,
    adapter: wgpu::Adapter,
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    faults: Arc<FaultLog>,
}

#[derive(Debug, Default)]
struct FaultLog {
    count: AtomicU32,
    first: Mutex<Option<String>>,
    lost: Mutex<Option<String>>,
}

impl Gpu {
    /// Opens the best adapter: by kind first (see [`Prefer`]), then Vulkan, Metal and DX12 before
    /// GL.
    pub fn open(prefer: Prefer) -> Result<Self, GpuError> {
        match Self::open_on(prefer, wgpu::Backends::PRIMARY) {
            Err(GpuError::NoAdapter) => Self::open_on(prefer, wgpu::Backends::GL),
            opened => opened,
        }
    }

    /// Opens the best adapter of the given backends.
    fn open_on(prefer: Prefer, backends: wgpu::Backends) -> Result<Self, GpuError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = backends;
        let instance = wgpu::Instance::new(descriptor);
        let adapters = pollster::block_on(instance.enumerate_adapters(backends));
        let adapter = adapters.into_iter().min_by_key(|a| rank(prefer, &a.get_info())).ok_or(GpuError::NoAdapter)?;
        let info = adapter.get_info();
        let wanted = wgpu::Features::TIMESTAMP_QUERY;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("trepan"),
            required_features: adapter.features() & wanted,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|e| GpuError::Open { adapter: info.name.clone(), reason: e.to_string() })?;
        let faults = Arc::new(FaultLog::default());
        let log = faults.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| log.note(&error.to_string())));
        let log = faults.clone();
        device.set_device_lost_callback(move |reason, words| {
            *log.lost.lock().unwrap_or_else(PoisonError::into_inner) = Some(format!("{reason:?}: {words}"));
        });
        Ok(Self { inner: Arc::new(Inner { instance, adapter, device, queue, info, faults }) })
    }

    /// Display name of the adapter and its graphics API.
    pub fn name(&self) -> String {
        format!("{} ({})", self.inner.info.name, self.inner.info.backend)
    }

    /// Name and version of the driver.
    pub fn driver(&self) -> String {
        format!("{} {}", self.inner.info.driver, self.inner.info.driver_info)
    }

    /// Whether the adapter is a software driver.
    pub fn is_software(&self) -> bool {
        self.inner.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Whether a window can show this device's textures without a copy. A GL device is bound to the
    /// display it was opened on, and this one to none.
    pub fn can_be_shared(&self) -> bool {
        self.inner.info.backend != wgpu::Backend::Gl
    }

    /// Whether pass times can be measured.
    pub fn has_timestamps(&self) -> bool {
        self.inner.device.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }

    /// The device's limits.
    pub fn limits(&self) -> wgpu::Limits {
        self.inner.device.limits()
    }

    /// Faults so far that no call returned.
    pub fn faults(&self) -> Faults {
        let log = &self.inner.faults;
        let copy = |m: &Mutex<Option<String>>| m.lock().unwrap_or_else(PoisonError::into_inner).clone();
        Faults { count: log.count.load(Ordering::Relaxed), first: copy(&log.first), lost: copy(&log.lost) }
    }

    /// Waits until all submitted work is done.
    pub fn wait(&self) -> Result<(), GpuError> {
        let wait = wgpu::PollType::Wait { submission_index: None, timeout: Some(PATIENCE) };
        self.inner.device.poll(wait).map_err(|e| GpuError::Lost(e.to_string()))?;
        self.faults().lost.map_or(Ok(()), |why| Err(GpuError::Lost(why)))
    }

    /// The wgpu instance, for sharing with a window.
    pub fn instance(&self) -> &wgpu::Instance {
        &self.inner.instance
    }

    /// The wgpu adapter, for sharing with a window.
    pub fn adapter(&self) -> &wgpu::Adapter {
        &self.inner.adapter
    }

    /// The wgpu device.
    pub fn device(&self) -> &wgpu::Device {
        &self.inner.device
    }

    /// The wgpu queue.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.inner.queue
    }

    /// Runs `make` and converts validation errors.
    pub(crate) fn checked<T>(
        &self,
        make: impl FnOnce() -> T,
        error: impl FnOnce(String) -> GpuError,
    ) -> Result<T, GpuError> {
        let scope = self.inner.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = make();
        match pollster::block_on(scope.pop()) {
            None => Ok(made),
            Some(e) => Err(error(e.to_string())),
        }
    }

    /// Rejects sizes over a limit.
    pub(crate) fn within(&self, label: &str, wanted: u64, limit: u64, unit: &'static str) -> Result<(), GpuError> {
        let too_large = || GpuError::TooLarge { label: label.into(), wanted, limit, unit, adapter: self.name() };
        (wanted <= limit).then_some(()).ok_or_else(too_large)
    }

    /// Maps the first `bytes` of a readback buffer and passes them to `take`.
    pub(crate) fn read_back<T>(
        &self,
        staging: &wgpu::Buffer,
        bytes: u64,
        take: impl FnOnce(&[u8]) -> T,
    ) -> Result<T, GpuError> {
        let slice = staging.slice(..bytes);
        let (sender, receiver) = std::sync::mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |mapped| {
            // The receiver is dropped only if this call has timed out.
            sender.send(mapped).ok();
        });
        // The system wakes a sleeper later than a short piece of work is done.
        let begun = Instant::now();
        let mut answer = receiver.try_recv();
        while answer.is_err() && !self.is_software() && begun.elapsed() < AWAKE {
            self.inner.device.poll(wgpu::PollType::Poll).ok();
            answer = receiver.try_recv();
        }
        if answer.is_err() {
            self.wait()?;
            answer = receiver.try_recv();
        }
        let lost = |e: String| GpuError::Lost(e);
        answer.map_err(|e| lost(e.to_string()))?.map_err(|e| lost(e.to_string()))?;
        let view = slice.get_mapped_range().map_err(|e| lost(e.to_string()))?;
        let taken = take(&view);
        drop(view);
        staging.unmap();
        Ok(taken)
    }
}

impl FaultLog {
    fn note(&self, words: &str) {
        self.count.fetch_add(1, Ordering::Relaxed);
        self.first.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| words.into());
    }
}

/// The device for a test, a software driver if there is one. `None` where there is no adapter and
/// the test is to be skipped.
///
/// # Panics
/// Without an adapter where the environment variable `CI` or `TREPAN_REQUIRE_GPU` is set.
#[doc(hidden)]
pub fn adapter_for_tests() -> Option<Gpu> {
    let error = match Gpu::open(Prefer::Software) {
        Ok(gpu) => return Some(gpu),
        Err(error) => error,
    };
    assert_eq!(error, GpuError::NoAdapter);
    let is_required = ["CI", "TREPAN_REQUIRE_GPU"].iter().any(|name| std::env::var_os(name).is_some());
    assert!(!is_required, "this test needs a Vulkan driver (Debian: mesa-vulkan-drivers): {error}");
    eprintln!("skipped: no GPU adapter");
    None
}

/// Rank of an adapter; lower is better.
fn rank(prefer: Prefer, info: &wgpu::AdapterInfo) -> (u8, u8) {
    let kind = match info.device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    };
    let kind = if prefer == Prefer::Software { 4 - kind } else { kind };
    (kind, u8::from(info.backend == wgpu::Backend::Gl))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_an_adapter_the_error_names_the_remedy() {
        let error = Gpu::open_on(Prefer::Hardware, wgpu::Backends::empty()).unwrap_err();
        assert_eq!(error, GpuError::NoAdapter);
        assert!(error.to_string().contains("mesa-vulkan-drivers"), "{error}");
    }

    #[test]
    fn a_mistake_is_counted_and_does_not_panic() {
        let Some(gpu) = adapter_for_tests() else { return };
        assert_eq!(gpu.faults(), Faults::default());
        let _broken = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("impossible"),
            size: 4,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::MAP_WRITE,
            mapped_at_creation: false,
        });
        let faults = gpu.faults();
        assert_eq!(faults.count, 1);
        assert!(faults.first.unwrap().contains("impossible"));
    }
}
