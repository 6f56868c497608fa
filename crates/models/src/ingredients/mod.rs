//! Ingredients of the models: element, law, relaxation, friction and the like, each chosen for a
//! session by `--set KEY=VALUE`.
//!
//! # Practice
//! An ingredient is a field of [`Ingredients`] and an entry of the table in `keys.rs`. Parsing,
//! help, a recording's header, `summary.json`, the report and the user guide's table derive from
//! that entry. [`Ingredients::default`] has everything off: what recordings without an entry ran
//! with.

mod keys;
mod law;
mod variants;

pub use keys::Effect;
pub use keys::{KEYS, KeyValue, Part, setting, table};
pub use law::Law;
pub use variants::{Variant, of_quality, realistic, variants};

use clap::ValueEnum;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;
use trepan_measurements::fits;
use trepan_patient::TissueClass;
use trepan_stages::BoneModels;

/// What the models of a session are made of; `None` where `--quality` chooses.
#[derive(Clone, Debug, PartialEq)]
pub struct Ingredients {
    /// Method of contact with bone.
    pub rigid: Option<&'static str>,
    /// Points of that method on the burr; 0 for its own number.
    pub rigid_points: Option<usize>,
    /// Force shading on bone, over one voxel.
    pub shading: bool,
    /// Friction coefficient of a tool that does not cut on bone, without unit.
    pub bone_friction: f32,
    /// Vibration of the drill on the hand.
    pub vibration: bool,
    /// Solver of the tissue.
    pub solver: Option<&'static str>,
    /// Motion in 50 ms below which tissue sleeps, mm; 0 = nothing sleeps.
    pub still_mm: f32,
    /// Largest factor on the mass of a stiffened element, without unit; 1 = none.
    pub dynamic_mass_scaling: f32,
    /// Averages accelerations over the elements, for longer steps.
    pub selective_mass_scaling: bool,
    /// Tetrahedral element.
    pub element: Element,
    /// Constitutive law of each tissue class, in the order of [`TissueClass::ALL`].
    pub laws: [Law; TissueClass::ALL.len()],
    /// Shear stiffness of the pia-arachnoid on the brain's surface, N/mm; 0 = none.
    pub pia_arachnoid_n_per_mm: f32,
    /// Stress relaxation.
    pub relaxation: Relaxation,
    /// Where the solver runs.
    pub device: SolverDevice,
    /// Threads of the solver on the processor.
    pub threads: Option<usize>,
    /// Fluid pressure on the brain's surface and in the ventricles, mmHg.
    pub surface_pressure_mmhg: f32,
    /// Search for the tool's points inside the tissue.
    pub search: trepan_deformable::Method,
    /// Friction coefficient of tool and tissue, without unit.
    pub friction: f32,
    /// Contact of the brain's surface with itself.
    pub folds: bool,
    /// What holds the brain in the skull.
    pub support: Support,
}

/// Usual [`Ingredients::dynamic_mass_scaling`].
pub const DYNAMIC_MASS_SCALING: f32 = 16.0;

/// Tetrahedral elements of the solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Element {
    /// Linear tetrahedra.
    Plain,
    /// Linear tetrahedra with averaged nodal pressure.
    LockingFree,
}

/// Stress relaxation of the tissue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Relaxation {
    /// None: elastic.
    Off,
    /// Prony series of two terms, of swine.
    Prony,
    /// Prony series of three terms: solid, pore fluid in tens of seconds and in minutes.
    SolidAndFluid,
}

/// What holds the brain in the skull, and what it does once the dura is open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Support {
    /// Fixed nodes at its base; a body force on the whole brain.
    Base,
    /// Stem, arachnoid, falx, bridging veins; fluid that drains, pressure in the opening.
    Anchored,
}

/// Where the solver of the tissue runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SolverDevice {
    /// On the processor.
    Cpu,
    /// On the graphics card; on the processor where there is none.
    Gpu,
    /// On whichever of the two is faster for this body on this machine.
    Fastest,
}

impl Default for Ingredients {
    fn default() -> Self {
        Self {
            rigid: None,
            rigid_points: None,
            shading: false,
            bone_friction: 0.0,
            vibration: true,
            solver: None,
            still_mm: 0.0,
            dynamic_mass_scaling: DYNAMIC_MASS_SCALING,
            selective_mass_scaling: true,
            element: Element::Plain,
            laws: [Law::NeoHookean; TissueClass::ALL.len()],
            pia_arachnoid_n_per_mm: 0.0,
            relaxation: Relaxation::Off,
            device: SolverDevice::Cpu,
            threads: None,
            surface_pressure_mmhg: 0.0,
            search: trepan_deformable::Method::RECOMMENDED,
            friction: 0.0,
            folds: false,
            support: Support::Base,
        }
    }
}

impl Relaxation {
    /// Moduli at hand speed over those of a slow test, of which `--young-modulus-kpa` is one.
    pub fn hand_speed_factor(self) -> f32 {
        if self == Self::SolidAndFluid { fits::HAND_SPEED_FACTOR.f32() } else { 1.0 }
    }
}

impl Ingredients {
    /// Whether every element must be stepped: tissue that relaxes never rests, and the graphics
    /// card has no sleeping elements.
    pub fn steps_all(&self) -> bool {
        self.relaxation != Relaxation::Off || self.device != SolverDevice::Cpu
    }

    /// Those of the force of bone.
    pub fn bone_models(&self) -> BoneModels {
        BoneModels { friction: self.bone_friction, shading: self.shading, vibration: self.vibration }
    }
}

/// Each key with its value, as `--set` takes them.
impl Serialize for Ingredients {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_map(KEYS.iter().map(|key| (key.name, key.value(self))))
    }
}

/// The ingredients of a session that ran: a value that is no longer known is replaced by the
/// default, with a warning. Which device was the fastest is not known: the processor always runs.
impl<'de> Deserialize<'de> for Ingredients {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let texts = BTreeMap::<String, String>::deserialize(from)?;
        let mut made = Self::default();
        for (key, text) in KEYS.iter().filter_map(|key| Some((key, texts.get(key.name)?))) {
            if let Err(fault) =
                key.set(&mut made, text).or_else(|fault| if key.is_unset(text) { Ok(()) } else { Err(fault) })
            {
                tracing::warn!("the recording's {}: {fault}; its forces may differ", key.name);
            }
        }
        if made.device == SolverDevice::Fastest {
            made.device = SolverDevice::Cpu;
        }
        Ok(made)
    }
}
