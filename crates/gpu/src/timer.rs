//! Measures the device time of each pass.
//!
//! # When not to use it
//! For a compute pass among render passes on Mesa's software driver (22.3): it may read about 0.

use crate::{Buffer, Gpu, GpuError};

/// A pass and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassTime {
    /// The pass's name.
    pub name: &'static str,
    /// Time on the device, µs.
    pub us: f64,
}

/// Measures up to a fixed number of passes per recording; further passes are counted, not timed.
#[derive(Debug)]
pub struct Timer {
    pub(crate) queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    ticks: Buffer<u64>,
    pub(crate) names: Vec<&'static str>,
    capacity: usize,
    untimed: u32,
    us_per_tick: f64,
}

impl Timer {
    /// Creates a timer for up to `passes` passes; `None` if the device cannot measure.
    pub fn new(gpu: &Gpu, passes: usize) -> Result<Option<Self>, GpuError> {
        if !gpu.has_timestamps() {
            return Ok(None);
        }
        let capacity = passes.clamp(1, wgpu::QUERY_SET_MAX_QUERIES as usize / 2);
        let count = 2 * capacity as u32;
        let queries = gpu.device().create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("timer"),
            ty: wgpu::QueryType::Timestamp,
            count,
        });
        let resolved = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("timer"),
            size: u64::from(count) * 8,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let ticks = Buffer::zeroed(gpu, "timer", count as usize)?;
        let us_per_tick = f64::from(gpu.queue().get_timestamp_period()) * 1e-3;
        let names = Vec::with_capacity(capacity);
        Ok(Some(Self { queries, resolved, ticks, names, capacity, untimed: 0, us_per_tick }))
    }

    /// Waits for the device and returns the times of the last recording, in order.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<PassTime>, GpuError> {
        let ticks = self.ticks.read(gpu)?;
        let time = |(name, pair): (&&'static str, &[u64])| PassTime {
            name,
            us: pair[1].saturating_sub(pair[0]) as f64 * self.us_per_tick,
        };
        Ok(self.names.iter().zip(ticks.chunks_exact(2)).map(time).collect())
    }

    /// Number of passes over the limit so far.
    pub fn untimed(&self) -> u32 {
        self.untimed
    }

    /// The query indices for the next pass, if there is room.
    pub(crate) fn next(&mut self, name: &'static str) -> Option<[u32; 2]> {
        if self.names.len() == self.capacity {
            self.untimed += 1;
            return None;
        }
        self.names.push(name);
        let first = 2 * (self.names.len() as u32 - 1);
        Some([first, first + 1])
    }

    pub(crate) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        let count = 2 * self.names.len() as u32;
        if count > 0 {
            encoder.resolve_query_set(&self.queries, 0..count, &self.resolved, 0);
            encoder.copy_buffer_to_buffer(&self.resolved, 0, self.ticks.raw(), 0, u64::from(count) * 8);
        }
    }
}
