//! Copies of several buffers to the host, with one wait for all of them.

use crate::{Buffer, Gpu, GpuError, Recorder};

/// A place on the host for copies of some buffers, kept from one reading to the next.
#[derive(Debug)]
pub struct Readback {
    staging: wgpu::Buffer,
    parts: Vec<Part>,
}

#[derive(Debug)]
struct Part {
    from: wgpu::Buffer,
    at: u64,
    bytes: u64,
}

impl Readback {
    /// Makes room for the buffers given, by their wgpu buffers, in their order.
    pub fn new(gpu: &Gpu, label: &str, from: &[&wgpu::Buffer]) -> Result<Self, GpuError> {
        let mut end = 0;
        let part = |from: &&wgpu::Buffer| {
            let at = end;
            end += from.size();
            Part { from: (*from).clone(), at, bytes: from.size() }
        };
        let parts = from.iter().map(part).collect();
        gpu.within(label, end, gpu.limits().max_buffer_size, "bytes")?;
        let staging = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: end,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        Ok(Self { staging, parts })
    }

    /// Waits for the device and hands the copies to `take`, in their order.
    ///
    /// # Errors
    /// When the device is lost. A recording with [`Recorder::copy`] must have been submitted.
    pub fn read<T>(&self, gpu: &Gpu, take: impl FnOnce(&[&[u8]]) -> T) -> Result<T, GpuError> {
        gpu.read_back(&self.staging, self.staging.size(), |data| {
            let of = |part: &Part| &data[part.at as usize..(part.at + part.bytes) as usize];
            take(&self.parts.iter().map(of).collect::<Vec<_>>())
        })
    }
}

impl Recorder<'_> {
    /// Copies the buffers of a [`Readback`] to the host once the passes so far are done.
    pub fn copy(&mut self, to: &Readback) {
        for Part { from, at, bytes } in &to.parts {
            self.encoder.copy_buffer_to_buffer(from, 0, &to.staging, *at, *bytes);
        }
    }

    /// Sets all of a buffer to zero once the passes so far are done.
    pub fn clear<T>(&mut self, buffer: &Buffer<T>) {
        self.encoder.clear_buffer(buffer.raw(), 0, None);
    }
}
