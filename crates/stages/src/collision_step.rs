//! One collision step: from the newest tool and brain it computes a surface patch for the hand and
//! loads for the solver.
//!
//! # Practice
//! With a tool for bone the result only causes warnings: the patch goes to the haptic thread, the
//! solver gets no contact of it (thesis 6.4). A tool for the brain collides with tip and shaft, and
//! so does that of the second hand or of an arm. From its first use on, the skull supports the
//! brain against the probe and its own weight; under surface pressure it does so at once. The
//! stage has no clock; the same tools and positions give the same results.

use crate::aspirator::Aspirator;
use crate::bleeding::{Bleeder, Bleeding};
use crate::dura::{DuraState, Membrane};
use crate::haptic_tick::{SecondTool, ToolSample};
use crate::program::{Phase, Program};
use crate::scissors::{MOST_SPLITS, Scissors};
use crate::second_hand::SecondHand;
use crate::settling::Settling;
use crate::skull_wall::SkullWall;
use std::sync::Arc;
use trepan_bleeding::Perfusion;
use trepan_bone::BoneVolume;
use trepan_contact::{MAX_SPRINGS, NodalContacts, SurfacePatch};
use trepan_deformable::{Config, ConfigError, MeshCollision, NodeContact, TissueCollision, TissueStep};
use trepan_dura::Dura;
use trepan_geometry::{Buttons, Tool, ToolKind, Vec3};
use trepan_link::wire::CollisionRecord;
use trepan_mesh::{Split, TetMesh};
use trepan_soft::Loads;

impl CollisionStage {
    /// Runs a step; its results are in [`patches`](Self::patches) and [`loads`](Self::loads).
    pub fn step(&mut self, sample: &ToolSample, soft: &SoftFrame) -> CollisionRecord {
        self.follow_cuts(soft);
        let first = SecondTool { tool: sample.tool, slot: sample.slot, state: sample.state };
        self.touch(0, Some(first), soft);
        self.touch(1, sample.second, soft);
        self.smooth_steps = self.smooth_steps.saturating_sub(1);
        let is_open = self.meet_dura(sample, soft);
        self.cut(sample, soft);
        self.aspirate(sample, soft);
        let is_touched = sample.phase() == Phase::Brain || self.steps[1].points_in_contact > 0;
        let phase = if is_open && is_touched { Phase::Brain } else { Phase::Craniotomy };
        self.settling.load(phase, sample.state.time_ms, &mut self.loads);
        self.press(sample, soft);
        self.seq += 1;
        CollisionRecord {
            seq: self.seq,
            tick: sample.tick,
            solver_step: soft.step,
            depth_mm: self.steps[0].manifold.depth_mm,
            points: self.steps[0].points_in_contact,
            compute_us: 0.0,
        }
    }

    /// Collides a hand's tool with the brain.
    fn touch(&mut self, hand: usize, tool: Option<SecondTool>, soft: &SoftFrame) {
        let step = &mut self.steps[hand];
        match tool.and_then(|tool| Some((self.tools.get_mut(tool.slot)?, tool.state))) {
            Some((tissue, state)) => tissue.step(&soft.positions, &soft.velocities, &state, step),
            None => (step.patch, step.points_in_contact) = (SurfacePatch::default(), 0),
        }
        let couple_mm = if self.with_torque { step.patch.couple_mm } else { Vec3::ZERO };
        let patch = &mut self.patches[hand];
        *patch = SurfacePatch { tissue_ms: soft.time_ms, couple_mm, ..step.patch };
        let slot = tool.map(|tool| tool.slot);
        let (was_slot, was) = self.felt[hand];
        if self.smooth_steps > 0 && slot == was_slot {
            slow_down(was, patch);
        }
        self.felt[hand] = (slot, patch.force_n * patch.normal);
    }

    /// Lets the tool meet the dura; returns whether that is open.
    fn meet_dura(&mut self, sample: &ToolSample, soft: &SoftFrame) -> bool {
        self.dura.as_mut().is_none_or(|dura| {
            dura.step(sample, &soft.positions, &mut self.patches, &mut self.wound.dura);
            dura.is_open()
        })
    }

    /// Takes over the splits that the solver has made.
    fn follow_cuts(&mut self, soft: &SoftFrame) {
        let new = soft.splits.get(self.followed..).unwrap_or_default();
        if new.is_empty() {
            return;
        }
        self.tools.iter_mut().for_each(|tool| tool.split(new));
        self.followed = soft.splits.len();
        self.smooth_steps = SMOOTH_STEPS;
        self.loads.contact_splits = self.followed as u32;
        if let Some(bleeder) = &mut self.bleeder {
            bleeder.split(&soft.splits, &soft.positions, &mut self.wound.bleeding);
        }
    }

    /// Cuts what scissors close on.
    fn cut(&mut self, sample: &ToolSample, soft: &SoftFrame) {
        let Some((scissors, aspirator)) = self.scissors.as_mut().zip(self.aspirator.as_mut()) else { return };
        let is_covered = self.dura.as_ref().is_some_and(Membrane::covers);
        let may = |tool: &SecondTool| tool.tool.kind == ToolKind::Scissors && !is_covered;
        let held = sample.tools().map(|tool| tool.filter(may));
        let Loads { fills, splits, .. } = &mut self.loads;
        let first = scissors.step(held, &soft.positions, fills, splits);
        if first < scissors.cuts.len() {
            aspirator.cut(&scissors.cuts[first..], fills);
            self.wound.cut_mm2 = scissors.cut_mm2;
        }
    }

    /// Takes tissue away that an aspirator touches; contact feels that from the next step on.
    fn aspirate(&mut self, sample: &ToolSample, soft: &SoftFrame) {
        let Some(aspirator) = &mut self.aspirator else { return };
        let is_covered = self.dura.as_ref().is_some_and(Membrane::covers);
        let may = |tool: &SecondTool| tool.state.buttons.has(Buttons::PEDAL) && !is_covered;
        let used = sample.tools().map(|tool| tool.filter(may));
        let now_ms = sample.state.time_ms;
        let tubes = used.iter().flatten().filter(|used| used.tool.kind == ToolKind::Aspirator);
        let tubes = tubes.filter_map(|used| Some((used.tool.tip_radius_mm, self.tools.get(used.slot)?)));
        aspirator.step(now_ms, tubes, &mut self.loads.fills);
        for tool in &mut self.tools {
            aspirator.thinned.iter().for_each(|&tet| tool.thin(tet, self.loads.fills[tet as usize]));
        }
        if let Some(bleeder) = &mut self.bleeder {
            let gone = aspirator.thinned.iter().copied().filter(|&tet| self.loads.fills[tet as usize] == 0);
            bleeder.step(now_ms, used, &soft.positions, gone, &mut self.wound.bleeding);
        }
    }

    fn press(&mut self, sample: &ToolSample, soft: &SoftFrame) {
        let phase = sample.phase();
        self.loads.contacts.clear();
        for (tool, step) in sample.tools().into_iter().zip(&self.steps) {
            if tool.is_some_and(|tool| Phase::of(&tool.tool) == Phase::Brain) {
                step.springs(&mut self.loads.contacts);
                self.loads.contacts.overflow += step.overflow;
            }
        }
        if let Some(wall) = self.wall.as_mut().filter(|_| self.under_pressure || self.settling.is_open()) {
            wall.press(&soft.positions, phase == Phase::Brain, &mut self.loads.contacts);
        }
        if let Some(folds) = self.folds.as_mut().filter(|_| self.settling.is_open()) {
            folds.press(&soft.positions, &mut self.loads.contacts);
        }
    }
}

/// Steps after a cut in which a hand's force changes slowly, and its change in each, N and as a
/// share of the force. A lip that opens lets go of the tool within a millisecond. Numerical.
const SMOOTH_STEPS: u32 = 100;
const SLOW: (f32, f32) = (0.03, 0.1);

/// Lets the tissue's force of a patch differ little from that before, N.
fn slow_down(was: Vec3, now: &mut SurfacePatch) {
    let is = now.force_n * now.normal;
    let force = was + (is - was).clamp_length_max(SLOW.0.max(SLOW.1 * was.length()));
    if force != is && force.is_finite() {
        (now.force_n, now.normal) = (force.length(), force.normalize_or_zero());
    }
}

/// The wound as pictures and report show it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wound {
    /// How it bleeds.
    pub bleeding: Bleeding,
    /// The dura over it.
    pub dura: DuraState,
    /// Area that scissors have cut, mm².
    pub cut_mm2: f64,
}

impl Wound {
    /// Takes another's state; does not allocate if there is room.
    pub fn copy_from(&mut self, other: &Self) {
        self.bleeding.copy_from(&other.bleeding);
        self.dura.copy_from(&other.dura);
        self.cut_mm2 = other.cut_mm2;
    }
}

/// State of the brain as last published by the solver.
#[derive(Clone, Debug, Default)]
pub struct SoftFrame {
    /// Solver steps done.
    pub step: u64,
    /// Simulated time, ms.
    pub time_ms: f64,
    /// Node positions, mm.
    pub positions: Vec<Vec3>,
    /// Node velocities, mm/ms.
    pub velocities: Vec<Vec3>,
    /// What is left of each tetrahedron, of 65535; empty where nothing was resected.
    pub fills: Vec<u16>,
    /// Splits of nodes so far; the copies come after the mesh's nodes.
    pub splits: Vec<Split>,
}

/// Contact of the brain's surface with itself: springs between a border node and the triangle that
/// it has to leave through.
struct Folds {
    collision: MeshCollision,
    contacts: Vec<NodeContact>,
}

/// Spring of such a contact, N/mm, and its damping, N ms/mm: those of a tool.
const FOLD: (f32, f32) = (0.3, 0.3);

impl Folds {
    fn of(mesh: &TetMesh) -> Result<Self, ConfigError> {
        Ok(Self { collision: MeshCollision::itself(mesh)?, contacts: Vec::with_capacity(MAX_SPRINGS) })
    }

    fn press(&mut self, positions: &[Vec3], to: &mut NodalContacts) {
        // Copies of split nodes come after those that it knows.
        let known = &positions[..self.collision.nodes().min(positions.len())];
        to.overflow += self.collision.step(known, known, &mut self.contacts);
        self.contacts.iter().for_each(|contact| to.push(contact.spring(FOLD.0, FOLD.1)));
    }
}

/// State of the collision loop.
pub struct CollisionStage {
    tools: Vec<TissueCollision>,
    wall: Option<SkullWall>,
    folds: Option<Folds>,
    /// Whether a contact of the shaft turns the tool.
    with_torque: bool,
    /// Whether the brain is pressed, and so needs the wall, before the dura is open.
    under_pressure: bool,
    settling: Settling,
    aspirator: Option<Aspirator>,
    scissors: Option<Scissors>,
    /// Splits that contact follows.
    followed: usize,
    /// Steps in which the hands' forces still change slowly, after a cut.
    smooth_steps: u32,
    bleeder: Option<Bleeder>,
    dura: Option<Membrane>,
    wound: Wound,
    /// Of the first hand's tool, and of the second's or an arm's.
    patches: [SurfacePatch; 2],
    /// Slot of each hand's tool in the last step, and the tissue's force on it without the dura, N.
    felt: [(Option<usize>, Vec3); 2],
    steps: [TissueStep; 2],
    loads: Loads,
    seq: u64,
}

impl CollisionStage {
    /// Makes a collision pipeline for each tool of the program, and takes the skull around the
    /// brain if there is one.
    pub fn new(
        program: Program,
        mesh: &TetMesh,
        config: &Config,
        wall: Option<SkullWall>,
    ) -> Result<Self, ConfigError> {
        Self::with_tools(program.tray(), mesh, config, wall)
    }

    fn with_tools(
        tools: &[Tool],
        mesh: &TetMesh,
        config: &Config,
        wall: Option<SkullWall>,
    ) -> Result<Self, ConfigError> {
        let of_tool = |tool: &Tool| {
            let config = Config { shaft: Phase::of(tool) == Phase::Brain, ..config.clone() };
            TissueCollision::new(mesh, tool, &config)
        };
        Ok(Self {
            tools: tools.iter().map(of_tool).collect::<Result<_, _>>()?,
            wall,
            folds: None,
            with_torque: false,
            under_pressure: false,
            patches: Default::default(),
            felt: Default::default(),
            settling: Settling::default(),
            aspirator: None,
            scissors: None,
            followed: 0,
            smooth_steps: 0,
            bleeder: None,
            dura: None,
            wound: Wound::default(),
            loads: Loads { contacts: NodalContacts::with_room(), ..Loads::default() },
            steps: Default::default(),
            seq: 0,
        })
    }

    /// Adds the tool of a second hand that has a device. Comes before
    /// [`aspirating`](Self::aspirating).
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_second_hand(mut self, mesh: &TetMesh, config: &Config) -> Result<Self, ConfigError> {
        let config = Config { shaft: true, ..config.clone() };
        self.tools.push(TissueCollision::new(mesh, &SecondHand::tool(), &config)?);
        Ok(self)
    }

    /// Adds the contact of the brain with itself once the dura is open.
    ///
    /// # Errors
    /// When the mesh is empty, names a node that is not there, or has one that is nowhere.
    pub fn folding(self, mesh: &TetMesh) -> Result<Self, ConfigError> {
        Ok(Self { folds: Some(Folds::of(mesh)?), ..self })
    }

    /// Makes a contact of the shaft turn the tool, or only push it.
    pub fn turning(self, with_torque: bool) -> Self {
        Self { with_torque, ..self }
    }

    /// Lets the skull support the brain from the start, or only once the dura is open.
    pub fn under_pressure(self, under_pressure: bool) -> Self {
        Self { under_pressure, ..self }
    }

    /// Adds the loads on the brain once the dura is open.
    pub fn settling(self, settling: Settling) -> Self {
        Self { settling, ..self }
    }

    /// Lets an aspirator take tissue away while its pedal is down, by the rate of each tetrahedron,
    /// mm/ms; those of rate 0 stay.
    ///
    /// # Errors
    /// For a search of other crates, which may keep a border of its own.
    pub fn aspirating(self, mesh: &TetMesh, rates: &[f32]) -> Result<Self, ConfigError> {
        let may_go = |tet: u32| rates.get(tet as usize).is_some_and(|rate| *rate > 0.0);
        let tools = self.tools.into_iter().map(|tool| tool.resectable(mesh, may_go)).collect::<Result<_, _>>()?;
        let loads = Loads { fills: vec![u16::MAX; mesh.tets.len()], ..self.loads };
        Ok(Self { tools, loads, aspirator: Some(Aspirator::of(mesh, rates)), ..self })
    }

    /// Lets scissors cut what an aspirator may take. Comes after [`aspirating`](Self::aspirating);
    /// the solver must have [`split`](trepan_soft::SoftSolver::split).
    pub fn cutting(mut self, mesh: &TetMesh, rates: &[f32]) -> Self {
        self.loads.splits.reserve(MOST_SPLITS);
        Self { scissors: Some(Scissors::of(mesh, rates)), ..self }
    }

    /// Lets what is aspirated bleed, by the perfusion of each tetrahedron; `up` is the unit vector
    /// against gravity. Without an aspirator nothing bleeds.
    pub fn bleeding(self, mesh: &TetMesh, perfusion: &[Perfusion], up: Vec3) -> Self {
        let bleeding = Bleeding { stains: vec![0; mesh.positions.len()], ..Bleeding::default() };
        let wound = Wound { bleeding, ..self.wound };
        Self { bleeder: Some(Bleeder::of(mesh, perfusion, up)), wound, ..self }
    }

    /// Covers the brain by a dura that is to be incised; bone holds it.
    pub fn covered(self, dura: Dura, bone: Arc<BoneVolume>) -> Self {
        let (mut dura, mut wound) = (Membrane::of(dura, bone), self.wound);
        dura.tell(&mut wound.dura);
        Self { dura: Some(dura), wound, ..self }
    }

    /// How the wound bleeds, and how the dura lies.
    pub fn wound(&self) -> &Wound {
        &self.wound
    }

    /// Volume that was aspirated so far, mm³.
    pub fn aspirated_mm3(&self) -> f64 {
        self.aspirator.as_ref().map_or(0.0, |aspirator| aspirator.taken_mm3)
    }

    /// Appends the wound's state for [`restore`](Self::restore); false, and nothing, while blood
    /// flows, up to ten steps. Does not allocate with [`room_to_save`](Self::room_to_save).
    pub fn save(&self, to: &mut Vec<u64>) -> bool {
        if self.bleeder.as_ref().is_some_and(|bleeder| !bleeder.wound.rests()) {
            return false;
        }
        to.push(self.settling.opened_ms.unwrap_or(f64::NAN).to_bits());
        to.extend([self.aspirated_mm3().to_bits(), self.loads.fills.len() as u64]);
        to.extend(self.loads.fills.iter().map(|fill| u64::from(*fill)));
        self.dura.iter().for_each(|membrane| membrane.dura.save(to));
        self.scissors.iter().for_each(|scissors| scissors.save(&self.loads.splits, to));
        if let Some(Bleeder { wound, .. }) = &self.bleeder {
            let now = &self.wound.bleeding;
            to.push(self.followed as u64);
            to.extend([now.rate_ml_per_min, now.worst_ml_per_min].map(|rate| u64::from(rate.to_bits())));
            wound.save(to);
        }
        true
    }

    /// An empty list with room for all that [`save`](Self::save) may append.
    pub fn room_to_save(&self) -> Vec<u64> {
        let dura = self.dura.as_ref().map_or(0, |membrane| membrane.dura.most_words());
        let cuts = self.scissors.as_ref().map_or(0, |_| Scissors::most_words() + MOST_SPLITS);
        Vec::with_capacity(16 + 41 * self.loads.fills.len() + self.wound.bleeding.stains.len() + dura + cuts)
    }

    /// Takes over, before the first step, what a stage of the same brain saved; times are
    /// `later_ms` later here. `None`, and no change, if it does not fit.
    pub fn restore(&mut self, words: &mut impl Iterator<Item = u64>, later_ms: f64) -> Option<()> {
        let [opened_ms, taken_mm3] = [f64::from_bits(words.next()?), f64::from_bits(words.next()?)];
        let tets = words.next().filter(|tets| *tets == self.loads.fills.len() as u64)? as usize;
        let fills: Vec<u16> = words.take(tets).map(|fill| fill as u16).collect();
        (fills.len() == tets).then_some(())?;
        let mut dura = self.dura.as_ref().map(|membrane| membrane.dura.clone());
        dura.as_mut().map_or(Some(()), |dura| dura.restore(words, later_ms))?;
        let mut scissors = self.scissors.clone();
        let splits = scissors.as_mut().map_or(Some(Vec::new()), |scissors| scissors.restore(words))?;
        if let Some(bleeder) = &mut self.bleeder {
            let followed = splits.get(..words.next()? as usize)?;
            let rates = [f32::from_bits(words.next()? as u32), f32::from_bits(words.next()? as u32)];
            let gone = (0u32..).zip(&fills).filter(|(_, fill)| **fill == 0).map(|(tet, _)| tet);
            bleeder.wound.restore(words, (gone, followed), later_ms)?;
            bleeder.follows(followed.len(), &mut self.wound.bleeding);
            self.wound.bleeding.worst_ml_per_min = rates[1];
            bleeder.tell(rates[0], &mut self.wound.bleeding);
        }
        if let Some((membrane, dura)) = self.dura.as_mut().zip(dura) {
            membrane.dura = dura;
            membrane.tell(&mut self.wound.dura);
        }
        (self.scissors, self.loads.splits) = (scissors, splits);
        self.wound.cut_mm2 = self.scissors.as_ref().map_or(0.0, |scissors| scissors.cut_mm2);
        if let Some(aspirator) = &mut self.aspirator {
            self.scissors.iter().for_each(|scissors| aspirator.cut(&scissors.cuts, &fills));
            aspirator.restore(&fills, taken_mm3);
            for tool in &mut self.tools {
                aspirator.thinned.iter().for_each(|&tet| tool.thin(tet, fills[tet as usize]));
            }
            self.loads.fills = fills;
        }
        self.settling.opened_ms = Some(opened_ms + later_ms).filter(|ms| ms.is_finite());
        Some(())
    }

    /// Returns the surface patch of the first hand's tool.
    pub fn patch(&self) -> &SurfacePatch {
        &self.patches[0]
    }

    /// Returns the surface patches for the haptic thread: of the first hand's tool, and of the
    /// second hand's or an arm's.
    pub fn patches(&self) -> &[SurfacePatch; 2] {
        &self.patches
    }

    /// Returns the loads for the solver, without contacts of a tool for bone.
    pub fn loads(&self) -> &Loads {
        &self.loads
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::haptic_tick::ToolSample;
    use crate::solver_step::SolverStage;
    use std::f64::consts::PI;
    use trepan_geometry::{Buttons, Pose, ToolState};
    use trepan_soft::{Body, Material, boxes};
    use trepan_tled::{Config as Solver, Tled};

    /// An aspirator goes 6 mm into a block of brain in 0.6 s and rests there. Returns the volume
    /// that it took, what the law says, its largest force and the solver's nodes.
    fn aspirated(rates: impl Fn(Vec3) -> f32, pedal: Buttons) -> (f64, f64, f32, Vec<Vec3>) {
        let mesh = boxes::split_box([12, 12, 9], Vec3::new(24.0, 24.0, 18.0));
        let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
        let rates: Vec<f32> =
            (0..mesh.tets.len()).map(|t| rates(mesh.corners(t).into_iter().sum::<Vec3>() / 4.0)).collect();
        let tool = Tool::aspirator();
        let stage = CollisionStage::with_tools(&[tool], &mesh, &Config::default(), None).unwrap();
        let mut stage = stage.aspirating(&mesh, &rates).unwrap();
        let other = CollisionStage::with_tools(&[tool], &mesh, &Config::default(), None).unwrap();
        let mut other = other.aspirating(&mesh, &rates).unwrap();
        let config = Solver { averaged_pressure: true, ..Solver::default() };
        let mut solver =
            SolverStage::new(Box::new(Tled::new(&Body::uniform(mesh, fixed, Material::BRAIN), &config).unwrap()));
        let (mut frame, mut by_law, mut most_n) = (SoftFrame::default(), 0.0, 0.0f32);
        let (mut before, mut jump) = (Vec3::ZERO, 0.0f32);
        for tick in 1..=900u64 {
            let z = 18.0 + tool.tip_radius_mm - 0.01 * tick.min(600) as f32;
            let mut state = ToolState::at(Pose::from_translation(Vec3::new(12.3, 12.2, z)));
            (state.time_ms, state.buttons) = (tick as f64, pedal);
            solver.publish(&mut frame);
            let record = stage
                .step(&ToolSample { tick, state, tool, slot: 0, drilling: false, second: None, idle: false }, &frame);
            let point_mm2 = 4.0 * PI * f64::from(tool.tip_radius_mm).powi(2) / stage.tools[0].points() as f64;
            by_law += if tick > 1 { f64::from(record.points) * point_mm2 * f64::from(RATE) } else { 0.0 };
            most_n = most_n.max(stage.patch().force_n);
            let force = stage.patch().force_n * stage.patch().normal;
            jump = jump.max(force.distance(std::mem::replace(&mut before, force)));
            while solver.time_ms() < tick as f64 {
                solver.step(stage.loads(), record.seq);
            }
        }
        assert!(jump < 0.005, "the force jumps by {jump} N");
        let faults = solver.solver_faults();
        assert_eq!((faults.limited, faults.non_finite, faults.skipped_ms), (0, 0, 0.0), "{faults:?}");
        let (mut words, room) = (stage.room_to_save(), stage.room_to_save().capacity());
        assert!(
            stage.save(&mut words) && words.capacity() == room && other.restore(&mut [].into_iter(), 0.0).is_none()
        );
        other.restore(&mut words.into_iter(), 0.0).unwrap();
        assert!(other.loads().fills == stage.loads().fills && other.aspirated_mm3() == stage.aspirated_mm3());
        let fills = &stage.loads().fills;
        let left: f64 =
            fills.iter().map(|f| f64::from(*f) / 65_535.0).sum::<f64>() * 24.0 * 24.0 * 18.0 / fills.len() as f64;
        assert!((stage.aspirated_mm3() + left - 24.0 * 24.0 * 18.0).abs() < 0.1, "volume is accounted for");
        (stage.aspirated_mm3(), by_law, most_n, solver.positions().to_vec())
    }

    /// Rate of the tests, mm/ms.
    const RATE: f32 = 0.05;

    #[test]
    fn an_aspirator_takes_what_the_law_says_and_sinks_in_with_less_force() {
        let (taken, by_law, force_n, nodes) = aspirated(|_| RATE, Buttons::PEDAL);
        let (none, _, pressed_n, _) = aspirated(|_| RATE, Buttons(0));
        // The hole is at least the tip's way, and elements with a tenth left go as a whole.
        assert!(taken > 20.0 && (taken / by_law - 1.0).abs() < 0.15, "{taken} {by_law} mm³");
        assert!(none == 0.0 && force_n < 0.7 * pressed_n, "{force_n} {pressed_n} N");
        assert!(aspirated(|_| RATE, Buttons::PEDAL).3 == nodes, "the same bits again");
    }

    #[test]
    fn what_has_no_rate_stays() {
        let (taken, _, force_n, _) = aspirated(|_| 0.0, Buttons::PEDAL);
        let (_, _, pressed_n, _) = aspirated(|_| 0.0, Buttons(0));
        assert!(taken == 0.0 && force_n == pressed_n);
        let (half, _, _, _) = aspirated(|p| if p.z > 16.0 { RATE } else { f32::NAN }, Buttons::PEDAL);
        assert!(half > 5.0 && half < 24.0 * 24.0 * 2.0);
    }

    /// A clamp of brain: two arms, 4 mm apart, on a back; the tool is far away.
    #[test]
    fn arms_that_close_on_each_other_are_pushed_apart_where_folds_are_on() {
        let mut mesh = boxes::split_box([6, 4, 6], Vec3::new(12.0, 8.0, 12.0));
        let middle = |tet: &[u32; 4]| tet.iter().map(|n| mesh.positions[*n as usize]).sum::<Vec3>() / 4.0;
        let is_gap = |at: Vec3| (4.0..8.0).contains(&at.x) && at.z > 4.0;
        mesh.tets = mesh.tets.iter().copied().filter(|tet| !is_gap(middle(tet))).collect();
        let tool = Program::Brain.tray()[0];
        let far = ToolState::at(Pose::from_translation(Vec3::splat(100.0)));
        let sample = ToolSample { tick: 1, state: far, tool, slot: 0, drilling: false, second: None, idle: false };
        // Over 4 mm the arms lean inwards, by 5 mm at the end.
        let closed = |p: &Vec3| *p + Vec3::X * if p.z > 4.0 { (6.0 - p.x).signum() * (p.z - 4.0) * 0.35 } else { 0.0 };
        let frame = |positions: Vec<Vec3>| SoftFrame {
            velocities: vec![Vec3::ZERO; positions.len()],
            step: 1,
            time_ms: 1.0,
            positions,
            ..SoftFrame::default()
        };
        let open = |folds: bool| {
            let stage = CollisionStage::new(Program::Brain, &mesh, &Config::default(), None).unwrap();
            if folds { stage.folding(&mesh).unwrap() } else { stage }
        };
        for (folds, shape, touches) in [
            (false, frame(mesh.positions.iter().map(closed).collect()), false),
            (true, frame(mesh.positions.clone()), false),
            (true, frame(mesh.positions.iter().map(closed).collect()), true),
        ] {
            let mut stage = open(folds);
            stage.step(&sample, &shape);
            let springs = &stage.loads().contacts;
            assert_eq!((!springs.is_empty(), springs.overflow), (touches, 0), "folds {folds}");
            let apart = |spring: &trepan_contact::NodalContact| {
                let (node, _) = spring.nodes().next().unwrap();
                -spring.normal.x * (mesh.positions[node as usize].x - 6.0)
            };
            assert!(springs.iter().all(|spring| apart(spring) > 0.0), "each node is pushed back to its own side");
        }
    }
}
