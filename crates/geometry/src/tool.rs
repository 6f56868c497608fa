//! Surgical tools as the simulators see them: a spherical tip on a straight shaft.

/// What a tool does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToolKind {
    /// A round cutting burr: removes bone while the pedal is down.
    Burr,
    /// A blunt ball probe: touches, never cuts.
    Probe,
}

/// A tool's shape. In its own frame the tip is a ball around the origin and the shaft runs from there along +z.
///
/// ```text
///        +z
///        ║   shaft: shaft_radius_mm, shaft_length_mm
///        ║
///       ( · ) tip: tip_radius_mm, centre at the origin
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tool {
    /// What it does.
    pub kind: ToolKind,
    /// Radius of the ball at the tip, mm.
    pub tip_radius_mm: f32,
    /// Radius of the shaft, mm.
    pub shaft_radius_mm: f32,
    /// Length of the shaft from the centre of the tip, mm.
    pub shaft_length_mm: f32,
}

impl Tool {
    /// A round burr of the given radius on a 2.4 mm shank, a common size of neurosurgical drills.
    pub fn burr(tip_radius_mm: f32) -> Self {
        Self { kind: ToolKind::Burr, tip_radius_mm, shaft_radius_mm: 1.2, shaft_length_mm: 70.0 }
    }

    /// A blunt ball probe of the given radius.
    pub fn probe(tip_radius_mm: f32) -> Self {
        Self { kind: ToolKind::Probe, tip_radius_mm, shaft_radius_mm: 0.6 * tip_radius_mm, shaft_length_mm: 90.0 }
    }
}
