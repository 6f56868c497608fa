//! The two floors of a card: bytes that it moves and multiplications with additions that it does
//! in a second, measured.
//!
//! # Practice
//! Plain kernels of 256 threads a workgroup: a copy between two buffers many times the card's
//! caches, and chains of fused multiplications and additions in registers.

use trepan_gpu::{Buffer, Gpu, GpuError, Kernel, Slot, Timer};

const WORKGROUPS: u32 = 16_384;
const LANES: u32 = 256;
/// Bytes of each of the two buffers, at most.
const BYTES: u64 = 1 << 29;
/// Chains of a thread, four numbers each, and rounds of each chain.
const FMA: f64 = 4.0 * 4.0 * 1024.0;
const TIMES: usize = 9;

const WGSL: &str = "
@group(0) @binding(0) var<storage, read> given: array<vec4f>;
@group(0) @binding(1) var<storage, read_write> made: array<vec4f>;
@compute @workgroup_size(256) fn copy(@builtin(global_invocation_id) id: vec3u) {
    for (var i = id.x; i < arrayLength(&made); i += 16384u * 256u) { made[i] = given[i]; }
}
@compute @workgroup_size(256) fn fma_chains(@builtin(global_invocation_id) id: vec3u) {
    let by = given[id.x & 255u] + vec4f(1.0);
    var a = vec4f(f32(id.x));
    var b = a + by;
    var c = b + by;
    var d = c + by;
    for (var i = 0u; i < 1024u; i++) {
        a = fma(a, by, b);
        b = fma(b, by, c);
        c = fma(c, by, d);
        d = fma(d, by, a);
    }
    made[id.x] = a + b + c + d;
}";

/// What a card can do at best.
#[derive(Clone, Copy, Debug)]
pub struct Floors {
    /// Bytes read and written, GB/s.
    pub gb_per_s: f64,
    /// Multiplications and additions, two a fused one, Gflop/s.
    pub gflop_per_s: f64,
}

/// Measures both; `None` where the device has no clock.
pub fn of(gpu: &Gpu) -> Result<Option<Floors>, GpuError> {
    let Some(mut timer) = Timer::new(gpu, TIMES)? else { return Ok(None) };
    let software = if gpu.is_software() { 1 << 24 } else { BYTES };
    let len = (software.min(gpu.limits().max_storage_buffer_binding_size) / 16) as usize;
    let from = Buffer::<[f32; 4]>::zeroed(gpu, "from", len)?;
    let into = Buffer::<[f32; 4]>::zeroed(gpu, "into", len)?;
    let mut best_us = |entry: &'static str, workgroups: u32| -> Result<f64, GpuError> {
        let kernel = Kernel::new(gpu, "floors", WGSL, entry, &[Slot::Storage, Slot::StorageMut])?;
        let bindings = kernel.bind(gpu, &[(&from).into(), (&into).into()])?;
        let mut recorder = gpu.record("floors").timed(Some(&mut timer));
        (0..TIMES).for_each(|_| recorder.dispatch(entry, &kernel, &bindings, [workgroups, 1, 1]));
        recorder.submit();
        Ok(timer.read(gpu)?.iter().map(|pass| pass.us).fold(f64::INFINITY, f64::min))
    };
    let threads = WORKGROUPS.min(len as u32 / LANES);
    let (copy_us, fma_us) = (best_us("copy", WORKGROUPS)?, best_us("fma_chains", threads)?);
    let flops = 2.0 * FMA * f64::from(threads * LANES);
    Ok(Some(Floors { gb_per_s: 1e-3 * 32.0 * len as f64 / copy_us, gflop_per_s: 1e-3 * flops / fma_us }))
}
