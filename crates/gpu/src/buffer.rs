//! Typed buffers on the device.

use crate::{Gpu, GpuError};
use core::marker::PhantomData;

/// `len` values of `T` on the device, for storage or uniform slots; written and read as a whole or
/// from an offset.
#[derive(Clone, Debug)]
pub struct Buffer<T> {
    raw: wgpu::Buffer,
    len: usize,
    of: PhantomData<T>,
}

impl<T: bytemuck::Pod> Buffer<T> {
    /// Creates a buffer of zeroes. At least one value is allocated, since the device has no empty
    /// buffers.
    pub fn zeroed(gpu: &Gpu, label: &str, len: usize) -> Result<Self, GpuError> {
        let bytes = ((len.max(1) * size_of::<T>()) as u64).next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT);
        gpu.within(label, bytes, gpu.limits().max_storage_buffer_binding_size, "bytes")?;
        let raw = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes,
            usage: wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::UNIFORM
                | wgpu::BufferUsages::COPY_DST
                | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Ok(Self { raw, len, of: PhantomData })
    }

    /// Creates a buffer with a copy of `values`.
    pub fn from_slice(gpu: &Gpu, label: &str, values: &[T]) -> Result<Self, GpuError> {
        let buffer = Self::zeroed(gpu, label, values.len())?;
        buffer.write(gpu, 0, values);
        Ok(buffer)
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Overwrites values from `first` on, before the next submission; values that do not fit are
    /// ignored.
    pub fn write(&self, gpu: &Gpu, first: usize, values: &[T]) {
        let fits = self.len.saturating_sub(first).min(values.len());
        let bytes: &[u8] = bytemuck::cast_slice(&values[..fits]);
        let whole = bytes.len() - bytes.len() % wgpu::COPY_BUFFER_ALIGNMENT as usize;
        let at = (first * size_of::<T>()) as u64;
        if whole > 0 {
            gpu.queue().write_buffer(&self.raw, at, &bytes[..whole]);
        }
        if whole < bytes.len() {
            let mut last = [0u8; wgpu::COPY_BUFFER_ALIGNMENT as usize];
            last[..bytes.len() - whole].copy_from_slice(&bytes[whole..]);
            gpu.queue().write_buffer(&self.raw, at + whole as u64, &last);
        }
    }

    /// Waits for the device and copies all values to the host.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<T>, GpuError> {
        let staging = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size: self.raw.size(),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&self.raw, 0, &staging, 0, self.raw.size());
        gpu.queue().submit([encoder.finish()]);
        let bytes = self.len * size_of::<T>();
        gpu.read_back(&staging, self.raw.size(), |data| bytemuck::pod_collect_to_vec(&data[..bytes]))
    }
}

impl<T> Buffer<T> {
    /// The wgpu buffer.
    pub fn raw(&self) -> &wgpu::Buffer {
        &self.raw
    }
}
