//! A pass over the elements, generic over the register width, and its result.

use super::lane::Lane;

/// Work over all blocks, generic over the register width. Implementations are always inlined.
pub trait Pass {
    /// Does the work with registers of type L.
    fn run<L: Lane>(&mut self) -> PassReport;
}

/// Result of a pass over the elements.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PassReport {
    /// Elements with J ≤ 0.
    pub inverted: u32,
    /// Largest growth of a single element's ω² since rest, 1/ms²; 0 where none has grown.
    pub growth: f32,
}
