//! Computes the prefix sums of a million numbers on the device and checks them on the processor.

use trepan_gpu::{Buffer, Gpu, Kernel, Prefer, Slot, Timer};

/// One step of Hillis and Steele 1986: `next[i] = sums[i] + sums[i - reach]`.
const STEP: &str = "
@group(0) @binding(0) var<uniform> reach: u32;
@group(0) @binding(1) var<storage, read> sums: array<u32>;
@group(0) @binding(2) var<storage, read_write> next: array<u32>;
@compute @workgroup_size(256) fn step(@builtin(global_invocation_id) id: vec3u) {
    let i = id.x;
    if i >= arrayLength(&sums) { return; }
    if i >= reach { next[i] = sums[i] + sums[i - reach]; } else { next[i] = sums[i]; }
}";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let gpu = Gpu::open(Prefer::Hardware)?;
    println!("device: {}{}", gpu.name(), if gpu.is_software() { ", software" } else { "" });
    let count = 1u32 << 20;
    let values: Vec<u32> = (0..count).map(|i| i % 7).collect();
    let kernel = Kernel::new(&gpu, "step", STEP, "step", &[Slot::Uniform, Slot::Storage, Slot::StorageMut])?;
    let sums = [Buffer::from_slice(&gpu, "even", &values)?, Buffer::zeroed(&gpu, "odd", count as usize)?];
    let mut timer = Timer::new(&gpu, 32)?;
    let mut recorder = gpu.record("prefix sum").timed(timer.as_mut());
    let steps = count.trailing_zeros();
    for step in 0..steps {
        let (from, to) = ((step % 2) as usize, ((step + 1) % 2) as usize);
        let reach = Buffer::from_slice(&gpu, "reach", &[1u32 << step])?;
        let bindings = kernel.bind(&gpu, &[(&reach).into(), (&sums[from]).into(), (&sums[to]).into()])?;
        recorder.dispatch("step", &kernel, &bindings, [count / 256, 1, 1]);
    }
    recorder.submit();
    let totals = sums[(steps % 2) as usize].read(&gpu)?;
    let mut total = 0;
    let right = values.iter().zip(&totals).all(|(value, &sum)| {
        total += value;
        total == sum
    });
    println!("{count} values, last total {}, all right: {right}", totals[totals.len() - 1]);
    if let Some(timer) = timer {
        println!("on the device: {:.0} µs", timer.read(&gpu)?.iter().map(|t| t.us).sum::<f64>());
    }
    Ok(())
}
