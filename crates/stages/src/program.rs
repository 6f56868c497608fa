//! The three programs, their phases and their tools.

use trepan_geometry::{Tool, ToolKind};

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

/// Phase of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Phase {
    /// Drilling bone; nearness of the brain only raises warnings.
    #[default]
    Craniotomy,
    /// Probing the brain, which deforms.
    Brain,
}

impl Program {
    /// The program's name, as in its binary.
    pub fn name(self) -> &'static str {
        ["craniotomy", "brain", "integrated"][self as usize]
    }

    /// What the program is for, in a sentence.
    pub fn purpose(self) -> &'static str {
        match self {
            Self::Craniotomy => "Drill and open a skull from a CT, with force feedback; a simulator for training",
            Self::Brain => "Press a brain of an MRI that deforms, with force feedback; a simulator for training",
            Self::Integrated => {
                "Open a skull and press the brain below it, with force feedback; a simulator for training"
            }
        }
    }

    /// Command lines to begin with, without the program's name.
    pub fn examples(self) -> [&'static str; 5] {
        match self {
            Self::Craniotomy => [
                "--lesson first-operation --person Ada",
                "--ct head_ct.nii.gz --mri head_t1.nii.gz --flap 30",
                "--ct ct_folder/ --ct-series 2 --device touch",
                "--headless --device script:flap --quality draft --out demo",
                "recording export demo/session.mcap --csv ticks.csv",
            ],
            Self::Brain => [
                "--quality usual",
                "--mri head_t1.nii.gz --tissue tumour=tumour.nrrd",
                "--ct head_ct.nii.gz --mri head_t1.nii.gz --register",
                "--headless --duration 20 --quality draft --out demo",
                "--device replay:demo/session.mcap",
            ],
            Self::Integrated => [
                "--lesson first-operation --person Ada",
                "--ct head_ct.nii.gz --mri head_t1.nii.gz --opening 45,30,110",
                "--case head --device touch",
                "--headless --duration 20 --quality draft --out demo",
                "sessions list --person Ada",
            ],
        }
    }

    /// Tools of the program, in the order of the phases.
    pub fn tray(self) -> &'static [Tool] {
        match self {
            Self::Craniotomy => &TRAY[..BONE_TOOLS],
            Self::Brain => &BRAIN_TRAY,
            Self::Integrated => &TRAY,
        }
    }

    /// Name of the program's default script.
    pub fn script(self) -> &'static str {
        ["craniotomy", "probe", "craniotomy-and-probe"][self as usize]
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
        ["craniotomy", "brain"][self as usize]
    }

    /// The phase that a tool belongs to.
    pub fn of(tool: &Tool) -> Self {
        if tool.kind.cuts() { Self::Craniotomy } else { Self::Brain }
    }
}

/// How many of the tray's tools cut bone; they come first.
const BONE_TOOLS: usize = 4;
/// Tools without a skull, and so without a dura.
const BRAIN_TRAY: [Tool; 5] = [Tool::probe(2.0), Tool::spatula(), Tool::aspirator(), Tool::bipolar(), Tool::scissors()];
/// Every tool.
const TRAY: [Tool; 10] = [
    Tool::burr(3.0),
    Tool::burr(2.0),
    Tool::perforator(),
    Tool::craniotome(),
    Tool::probe(2.0),
    Tool::spatula(),
    Tool::aspirator(),
    Tool::bipolar(),
    Tool::scalpel(),
    Tool::scissors(),
];

/// Name of a tool in the tray: its kind and width.
pub fn called(tool: &Tool) -> String {
    match tool.kind {
        ToolKind::Burr | ToolKind::Perforator => format!("{} {:.0} mm", tool.kind.name(), 2.0 * tool.tip_radius_mm),
        kind => kind.name().into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tray_has_the_tools_of_its_phases_and_begins_with_the_first() {
        for program in [Program::Craniotomy, Program::Brain, Program::Integrated] {
            let of_phases = |tool: &Tool| match Phase::of(tool) {
                Phase::Craniotomy => program.has_bone(),
                Phase::Brain => program.has_tissue(),
            };
            assert!(program.tray().iter().all(of_phases) && program.tray().len() < 15);
            assert_eq!(Phase::of(&program.tray()[0]) == Phase::Craniotomy, program.has_bone());
        }
        assert_eq!(called(&TRAY[1]), "burr 4 mm");
    }
}
