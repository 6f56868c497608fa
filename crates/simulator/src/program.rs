//! The three programs, their phases and their tools.

use trepan_geometry::Tool;

/// Which simulator runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Program {
    /// Drilling the skull. Threads: main, haptic.
    Craniotomy,
    /// Probing the exposed brain. Threads: main, haptic, collision, simulation.
    Brain,
    /// Both, one after the other. All four threads.
    Integrated,
}

/// What the trainee is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Phase {
    /// The burr takes bone away; the brain only warns.
    #[default]
    Craniotomy,
    /// The probe meets the brain, which answers.
    Brain,
}

impl Program {
    /// The program's name, as in its binary.
    pub fn name(self) -> &'static str {
        match self {
            Self::Craniotomy => "craniotomy",
            Self::Brain => "brain",
            Self::Integrated => "integrated",
        }
    }

    /// The phases in their order.
    pub fn phases(self) -> &'static [Phase] {
        match self {
            Self::Craniotomy => &[Phase::Craniotomy],
            Self::Brain => &[Phase::Brain],
            Self::Integrated => &[Phase::Craniotomy, Phase::Brain],
        }
    }

    /// The scripted operation that shows the program.
    pub fn script(self) -> &'static str {
        match self {
            Self::Craniotomy => "craniotomy",
            Self::Brain => "probe",
            Self::Integrated => "craniotomy-and-probe",
        }
    }

    /// Whether bone is felt and drilled.
    pub fn has_bone(self) -> bool {
        self != Self::Brain
    }

    /// Whether the brain deforms.
    pub fn has_tissue(self) -> bool {
        self != Self::Craniotomy
    }
}

impl Phase {
    /// The phase's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Craniotomy => "craniotomy",
            Self::Brain => "brain",
        }
    }

    /// The tool that lies in the hand at first.
    pub fn tool(self) -> Tool {
        match self {
            Self::Craniotomy => Tool::burr(3.0),
            Self::Brain => Tool::probe(2.0),
        }
    }
}
