//! Surgical tools in the simulators: a spherical tip on a straight shaft.

/// The kind of a tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToolKind {
    /// A round cutting burr: removes bone while the pedal is down.
    Burr,
    /// A blunt ball probe: touches, never cuts.
    Probe,
    /// A wide drill whose clutch disengages where it breaks through the bone.
    Perforator,
    /// A slender mill that cuts with its side, above a blunt foot that runs under the bone.
    Craniotome,
    /// A blunt rounded blade that retracts the brain with its shaft.
    Spatula,
    /// A suction tube: touches, never cuts.
    Aspirator,
    /// Forceps that coagulate bleeding tissue between their tips while the pedal is down, and
    /// rinse.
    Bipolar,
    /// A short blade that incises the dura while its pedal is down.
    Scalpel,
    /// Microscissors that cut the brain when the pedal goes down.
    Scissors,
}

impl ToolKind {
    /// All kinds.
    pub const ALL: [Self; 9] = [
        Self::Burr,
        Self::Probe,
        Self::Perforator,
        Self::Craniotome,
        Self::Spatula,
        Self::Aspirator,
        Self::Bipolar,
        Self::Scalpel,
        Self::Scissors,
    ];

    /// Whether it removes bone while the pedal is down.
    pub fn cuts(self) -> bool {
        matches!(self, Self::Burr | Self::Perforator | Self::Craniotome)
    }

    /// Its name, lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Burr => "burr",
            Self::Probe => "probe",
            Self::Perforator => "perforator",
            Self::Craniotome => "craniotome",
            Self::Spatula => "spatula",
            Self::Aspirator => "aspirator",
            Self::Bipolar => "bipolar",
            Self::Scalpel => "scalpel",
            Self::Scissors => "scissors",
        }
    }
}

/// A tool's shape. In the tool frame the tip is a ball around the origin and the shaft runs along
/// +z.
///
/// ```text
///        +z
///        ║   shaft: shaft_radius_mm, shaft_length_mm
///        ║
///       ( · ) tip: tip_radius_mm, centre at the origin
/// ```
///
/// A craniotome cuts with its shaft, from the tip up to `cutting_mm`, and its tip is blunt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tool {
    /// Kind of the tool.
    pub kind: ToolKind,
    /// Radius of the ball at the tip, mm.
    pub tip_radius_mm: f32,
    /// Radius of the shaft, mm.
    pub shaft_radius_mm: f32,
    /// Length of the shaft from the centre of the tip, mm.
    pub shaft_length_mm: f32,
    /// Length of the cutting part of the shaft from the centre of the tip, mm; 0 if the tip cuts.
    pub cutting_mm: f32,
}

impl Tool {
    /// A round burr of the given radius on a 2.4 mm shank, a common size of neurosurgical drills.
    pub const fn burr(tip_radius_mm: f32) -> Self {
        Self { kind: ToolKind::Burr, tip_radius_mm, shaft_radius_mm: 1.2, shaft_length_mm: 70.0, cutting_mm: 0.0 }
    }

    /// A cranial perforator, 11 mm wide, here with a round head.
    pub const fn perforator() -> Self {
        Self { kind: ToolKind::Perforator, shaft_radius_mm: 3.0, ..Self::burr(5.5) }
    }

    /// A craniotome of 2.4 mm that cuts along 14 mm above its foot.
    pub const fn craniotome() -> Self {
        Self { kind: ToolKind::Craniotome, cutting_mm: 14.0, ..Self::burr(1.2) }
    }

    /// A blunt ball probe of the given radius.
    pub const fn probe(tip_radius_mm: f32) -> Self {
        Self {
            kind: ToolKind::Probe,
            tip_radius_mm,
            shaft_radius_mm: 0.6 * tip_radius_mm,
            shaft_length_mm: 90.0,
            cutting_mm: 0.0,
        }
    }

    /// A spatula, here a round rod of 6 mm with a round end.
    pub const fn spatula() -> Self {
        Self { kind: ToolKind::Spatula, shaft_radius_mm: 3.0, ..Self::probe(3.0) }
    }

    /// A suction tube of 3 mm.
    pub const fn aspirator() -> Self {
        Self { kind: ToolKind::Aspirator, shaft_radius_mm: 1.5, ..Self::probe(1.5) }
    }

    /// Bipolar forceps, here closed: a rod of 2 mm with a round end.
    pub const fn bipolar() -> Self {
        Self { kind: ToolKind::Bipolar, shaft_radius_mm: 1.0, ..Self::probe(1.0) }
    }

    /// A scalpel with a pointed blade, here a thin rod with a round end of 1 mm.
    pub const fn scalpel() -> Self {
        Self { kind: ToolKind::Scalpel, shaft_radius_mm: 0.5, ..Self::probe(0.5) }
    }

    /// Microscissors, here closed: a rod of 3 mm with a round end; their blades lie in the plane of
    /// the x axis.
    pub const fn scissors() -> Self {
        Self { kind: ToolKind::Scissors, shaft_radius_mm: 1.5, ..Self::probe(1.5) }
    }
}
