//! The dura over the opening: tools press it, a scalpel incises it, sutures hold it back.
//!
//! # Practice
//! It follows the collision step, with the tool that this saw, so that a replay has the same. Bone
//! is read only while a tool for the brain is used, when nothing is carved, and a few nodes in a
//! step. A scalpel cuts while its pedal is down. Once another tool is taken, the leaves are held
//! back. While it is closed, no tool takes tissue away.

use crate::haptic_tick::ToolSample;
use crate::program::Phase;
use serde::Serialize;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_contact::SurfacePatch;
use trepan_dura::{Dura, Tip};
use trepan_geometry::{Buttons, ToolKind, Vec3};

/// Nodes for which bone is looked up in a step, numerical.
const LOOKED_UP: usize = 32;
/// Places above a node at which bone is looked up, mm, numerical.
const ABOVE_MM: [f32; 6] = [1.5, 3.0, 4.5, 6.0, 7.5, 9.0];

/// What was done to the dura, and how it lies.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DuraState {
    /// Length of all incisions, mm.
    pub incised_mm: f32,
    /// Area that was cut out, mm².
    pub cut_out_mm2: f32,
    /// Places where it tore or a tool went through.
    pub torn: u32,
    /// When the fluid below could leave, s; `null` while it is closed.
    pub opened_s: Option<f64>,
    /// World place of each node at rest, mm; there is room for those that cuts add.
    #[serde(skip)]
    pub rest: Vec<Vec3>,
    /// World place of each node, mm.
    #[serde(skip)]
    pub places: Vec<Vec3>,
    /// Triangles over the nodes, `[0; 3]` where one was taken away; empty without a dura.
    #[serde(skip)]
    pub triangles: Vec<[u32; 3]>,
}

impl DuraState {
    /// Takes another's state; does not allocate if there is room.
    pub fn copy_from(&mut self, other: &Self) {
        let &Self { incised_mm, cut_out_mm2, torn, opened_s, .. } = other;
        let (mut rest, mut places) = (std::mem::take(&mut self.rest), std::mem::take(&mut self.places));
        let mut triangles = std::mem::take(&mut self.triangles);
        rest.clone_from(&other.rest);
        places.clone_from(&other.places);
        triangles.clone_from(&other.triangles);
        *self = Self { incised_mm, cut_out_mm2, torn, opened_s, rest, places, triangles };
    }
}

/// The dura, the bone above it, and its account.
pub(crate) struct Membrane {
    pub dura: Dura,
    bone: Arc<BoneVolume>,
    /// The node whose bone is looked up next.
    next: usize,
    /// Whether the scalpel was in the hand.
    incised: bool,
    shown: u32,
}

impl Membrane {
    pub fn of(dura: Dura, bone: Arc<BoneVolume>) -> Self {
        Self { dura, bone, next: 0, incised: false, shown: 0 }
    }

    /// Whether fluid can leave.
    pub fn is_open(&self) -> bool {
        self.dura.is_open()
    }

    /// Whether it lies between the tool and the tissue.
    pub fn covers(&self) -> bool {
        !self.is_open() || self.dura.is_pressed()
    }

    /// Goes on to the tool's time, adds the force on the tool to the patch, and keeps account.
    pub fn step(&mut self, sample: &ToolSample, brain: &[Vec3], patch: &mut SurfacePatch, now: &mut DuraState) {
        self.dura.rest_on(brain);
        let is_tool = sample.phase() == Phase::Brain;
        if is_tool {
            self.look_up();
        }
        let is_scalpel = sample.tool.kind == ToolKind::Scalpel;
        if std::mem::replace(&mut self.incised, is_scalpel) && !is_scalpel {
            self.dura.hold_back();
        }
        let cuts = is_scalpel && sample.state.buttons.has(Buttons::PEDAL);
        let tip = Tip { at: sample.state.tip(), radius_mm: sample.tool.tip_radius_mm, cuts };
        let force = self.dura.step(sample.state.time_ms, Some(tip).filter(|_| is_tool));
        if force != Vec3::ZERO {
            let sum = patch.force_n * patch.normal + force;
            let share = patch.force_n / (patch.force_n + force.length()).max(1e-9);
            (patch.normal, patch.force_n) = (sum.normalize_or_zero(), sum.length());
            patch.couple_mm *= share;
            patch.normal_velocity *= share;
        }
        self.tell(now);
    }

    /// Looks up for a few nodes whether bone holds them.
    fn look_up(&mut self) {
        let nodes = self.dura.nodes();
        let end = (self.next + LOOKED_UP).min(nodes);
        let bone = &self.bone;
        let is_held =
            |place: Vec3, outward: Vec3| ABOVE_MM.iter().any(|mm| bone.is_bone(bone.voxel_of(place + *mm * outward)));
        self.dura.pin(self.next..end, is_held);
        self.next = if end == nodes { 0 } else { end };
    }

    /// Tells what was done and how it lies.
    pub fn tell(&mut self, now: &mut DuraState) {
        let account = self.dura.account();
        (now.incised_mm, now.cut_out_mm2, now.torn) = (account.incised_mm, account.cut_out_mm2, account.torn);
        now.opened_s = account.opened_ms.map(|ms| 1e-3 * ms);
        let room = self.dura.room();
        now.places.resize(room, Vec3::ZERO);
        now.places.iter_mut().zip(self.dura.places()).for_each(|(shown, place)| *shown = place);
        if std::mem::replace(&mut self.shown, self.dura.changes()) != self.dura.changes() {
            now.rest.resize(room, Vec3::ZERO);
            now.rest.iter_mut().zip(self.dura.at_rest()).for_each(|(shown, rest)| *shown = rest);
            now.triangles.clear();
            now.triangles.extend(self.dura.triangles());
        }
    }
}
