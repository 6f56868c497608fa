//! Memory that this process holds, counted at its allocator.
//!
//! # Practice
//! Pages that the system gave to the process say little in a run of many parts: the allocator keeps
//! them, and the next part takes them without a new one. Memory of drivers and mapped files is not
//! counted.

use cap::Cap;
use std::alloc::System;

#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

/// Memory that is allocated now, MB.
pub fn held_mb() -> f64 {
    MEMORY.allocated() as f64 * 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Other tests allocate beside it, less than this one.
    #[test]
    fn what_is_allocated_counts_until_it_is_freed() {
        let before = held_mb();
        let kept = vec![0u8; 2_000_000_000];
        let during = held_mb() - before;
        assert!((1_500.0..2_500.0).contains(&during), "{during} with {}", kept.len());
        drop(kept);
        assert!((held_mb() - before).abs() < 500.0);
    }
}
