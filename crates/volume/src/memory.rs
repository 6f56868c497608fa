//! Rejects sizes from a file or a flag that do not fit into memory, before allocating.
//!
//! # Practice
//! Free memory is the least of the limits of the system, the control group (containers, cluster
//! jobs) and the process (`ulimit -v`). It is known on Linux; elsewhere only [`MOST_VOXELS`]
//! applies.

use std::fs;

/// Most voxels of one image or grid: 1024 x 1024 x 572, over twice the finest CT of a whole head.
pub const MOST_VOXELS: u64 = 600_000_000;

/// A size that does not fit into memory.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{count} {what} need {:.1} GB of memory, and {limit}", gb(*bytes))]
pub struct TooLarge {
    /// Number of items.
    pub count: u64,
    /// Name of the items.
    pub what: &'static str,
    /// Bytes needed.
    pub bytes: u64,
    /// The limit exceeded.
    pub limit: Limit,
}

/// Why a size is too large.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Limit {
    /// Over the fixed limit.
    #[error("the limit is {0}")]
    Count(u64),
    /// Over the free memory, bytes.
    #[error("only {:.1} GB are free here", gb(*.0))]
    Free(u64),
}

fn gb(bytes: u64) -> f64 {
    bytes as f64 * 1e-9
}

/// Rejects more voxels than [`MOST_VOXELS`], or than fit into free memory at `bytes_each`.
pub fn room_for_voxels(count: u64, bytes_each: u64) -> Result<(), TooLarge> {
    let bytes = count.saturating_mul(bytes_each);
    match count <= MOST_VOXELS {
        true => room_for("voxels", count, bytes_each),
        false => Err(TooLarge { count, what: "voxels", bytes, limit: Limit::Count(MOST_VOXELS) }),
    }
}

/// Rejects what does not fit into free memory at `bytes_each`.
pub fn room_for(what: &'static str, count: u64, bytes_each: u64) -> Result<(), TooLarge> {
    let bytes = count.saturating_mul(bytes_each);
    // Small sizes fit without querying the system.
    match (bytes >> 20 > 0).then(free_bytes).flatten() {
        Some(free) if bytes > free => Err(TooLarge { count, what, bytes, limit: Limit::Free(free) }),
        _ => Ok(()),
    }
}

/// Free bytes for this process; `None` where the system does not report them.
pub(crate) fn free_bytes() -> Option<u64> {
    let system = kilobytes("/proc/meminfo", "MemAvailable:");
    let own = address_space().zip(kilobytes("/proc/self/status", "VmSize:"));
    let own = own.map(|(limit, used)| limit.saturating_sub(used));
    [system, own, group()].into_iter().flatten().min()
}

/// The value of a key in bytes, from a file in kilobytes.
fn kilobytes(file: &str, key: &str) -> Option<u64> {
    let text = fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    Some(1024 * line.split_whitespace().next()?.parse::<u64>().ok()?)
}

/// The process's address-space limit; `None` without one.
fn address_space() -> Option<u64> {
    let text = fs::read_to_string("/proc/self/limits").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Free bytes in the control group; its file cache counts as free.
fn group() -> Option<u64> {
    let number = |file: &str| fs::read_to_string(file).ok()?.trim().parse::<u64>().ok();
    let limit = number("/sys/fs/cgroup/memory.max")?;
    let stat = fs::read_to_string("/sys/fs/cgroup/memory.stat").unwrap_or_default();
    let files = stat.lines().find_map(|line| line.strip_prefix("file "));
    let files = files.and_then(|n| n.parse().ok()).unwrap_or(0);
    Some(limit.saturating_sub(number("/sys/fs/cgroup/memory.current")?.saturating_sub(files)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_beyond_memory_are_rejected() {
        assert_eq!(room_for_voxels(1000, 8), Ok(()));
        let fault = room_for_voxels(1 << 40, 8).unwrap_err().to_string();
        assert!(fault.contains("1099511627776 voxels need 8796.1 GB"), "{fault}");
        assert!(fault.contains("the limit is 600000000"), "{fault}");
        if let Some(free) = free_bytes() {
            let fault = room_for("tetrahedra", free, 2).unwrap_err().to_string();
            assert!(fault.contains("tetrahedra") && fault.contains("GB are free here"), "{fault}");
            assert!(room_for("tetrahedra", 1 << 21, 1).is_ok());
        }
    }
}
