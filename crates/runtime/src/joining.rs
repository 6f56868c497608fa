//! The state of a shared session, for a watcher that joins it late.
//!
//! # Theory
//! A watcher runs its own scene, so it has to begin with the trainee's wound:
//!
//! ```text
//!  haptic loop ───view────┐
//!  skull, by its versions ┤ thread of the state ──"state"──> watcher, before its loops begin
//!  collision loop <─ask, words─┘
//! ```
//! A state is whole: nodes that tools cut, voxels of a lifted flap, whether the bone is open, the
//! tool that an arm holds, what is left of each tetrahedron, sources, blood, burns, and when the
//! dura was opened.
//!
//! # Practice
//! The thread looks once a second and sends what changed, never while the flap moves; the collision
//! loop fills a list that has room, when asked. A session that is not shared has no such thread.
//! Who joins waits up to 1.5 s for a state that is newer than the first tick it saw; without one
//! nothing has changed. What happens from that state to its own first tick, some 0.1 s, is not
//! seen. Its brain begins at rest and sags again, so that forces and blood may differ a little. A
//! stroke from before cannot be undone there. Its recording holds the state that it began with, and
//! a replay begins with it too.

use crate::clock::Clock;
use crate::film::all_changes;
use crate::stop::Stop;
use crate::{Stages, View};
use glam::IVec3;
use std::sync::Arc;
use std::time::Duration;
use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Quat, Vec3};
use trepan_link::SceneChange;
use trepan_link::cell::{Reader, Writer, cell};
use trepan_link::queue::{Receiver, Sender, bounded};
use trepan_link::topics::{Publisher, Session, TopicError};
use trepan_link::wire::{StateRecord, TickRecord};
use trepan_stages::CollisionStage;
use trepan_stages::flap::FlapPlace;
use trepan_stages::second_hand::SecondHand;

/// Time between two states, ms; numerical.
const EVERY_MS: f64 = 1000.0;
/// Longest wait of who joins for a state, ms; numerical.
const WAIT_MS: f64 = 1500.0;
/// Time between two looks.
const LOOK: Duration = Duration::from_millis(10);

/// A state, or a part of one.
type Words = Vec<u64>;

/// Sends the state of a session; for a thread of its own.
pub(crate) struct StateSender {
    states: Publisher<StateRecord>,
    view: Reader<View>,
    bone: Option<Arc<BoneVolume>>,
    /// The way of a list of words to the collision loop and back, and the list while it is here.
    tissue: Option<(Sender<Words>, Receiver<Words>)>,
    words: Option<Words>,
    /// Checksum of the state that was sent last.
    sent: Option<u32>,
}

/// End of the collision loop: gets a list of words, and gives it back with the wound.
pub(crate) struct StateAsked(Receiver<Words>, Sender<Words>, Option<Words>);

impl StateAsked {
    /// Answers if asked, as soon as the stage can. Does not allocate.
    pub fn answer(&mut self, stage: &CollisionStage) {
        let Self(asked, given, held) = self;
        let Some(mut words) = held.take().or_else(|| asked.receive()) else { return };
        words.clear();
        match stage.save(&mut words) {
            true => _ = given.send(words),
            false => *held = Some(words),
        }
    }
}

impl StateSender {
    /// Makes the sender with the ends of the haptic and of the collision loop.
    pub fn new(states: Publisher<StateRecord>, stages: &Stages, view: View) -> (Self, Writer<View>, StateAsked) {
        let ((writer, view), bone) = (cell(view), stages.haptic.bone().cloned());
        let ((ask, asked), (given, answers)) = (bounded(1), bounded(1));
        let words = stages.tissue.as_ref().map(|tissue| tissue.collision.room_to_save());
        let tissue = words.is_some().then_some((ask, answers));
        (Self { states, view, bone, tissue, words, sent: None }, writer, StateAsked(asked, given, None))
    }

    /// Sends states until the session is over; returns why they ended early.
    pub fn live(mut self, clock: Clock, stop: &Stop) -> Option<String> {
        let mut due_ms = 0.0;
        while !stop.asked() {
            _ = self.states.greet();
            if let Some(state) = (clock.now_ms() >= due_ms).then(|| self.state()).flatten() {
                due_ms = clock.now_ms() + EVERY_MS;
                let is_new = self.sent.replace(state.checksum) != Some(state.checksum);
                if let Some(Err(fault)) = is_new.then(|| self.states.send(&state)) {
                    return Some(format!("who joins late will not see the newest wound: {fault}"));
                }
            }
            std::thread::sleep(LOOK);
        }
        None
    }

    /// The state once the collision loop has answered, unless the flap moves.
    fn state(&mut self) -> Option<StateRecord> {
        if let Some((ask, answers)) = &mut self.tissue {
            self.words.take().into_iter().for_each(|words| _ = ask.send(words));
            self.words = Some(answers.receive()?);
        }
        let view = *self.view.latest().0;
        let carved = self.bone.as_ref().map(all_changes).unwrap_or_default();
        let is_lifted = !carved.0.is_empty();
        let mut words = vec![kind_of(self.bone.as_deref()), view.bone_open.into(), view.removed_mm3.to_bits()];
        words.extend(arm_of(&view));
        for part in [carved.0, carved.1] {
            words.push(part.len() as u64);
            words.extend(part.into_iter().map(|SceneChange { at: [x, y, z], after, .. }| {
                [after.cast_unsigned(), z, y, x].iter().fold(0, |word, part| word << 16 | u64::from(*part))
            }));
        }
        words.extend(self.words.iter().flatten());
        let stands = self.view.latest().0.flap == view.flap && is_lifted == (view.flap == FlapPlace::Away);
        let (tick, time_ms, checksum) = (view.sample.tick, view.time_ms, StateRecord::sum(&words));
        stands.then_some(StateRecord { tick, time_ms, words, checksum })
    }
}

/// What an arm holds: its slot and 1, or 0, and its pose.
fn arm_of(view: &View) -> Words {
    let held = view.sample.second.filter(|held| held.tool != SecondHand::tool());
    held.map_or(vec![0], |held| {
        [held.slot as u64 + 1].into_iter().chain(words_of(held.state.world_from_tool)).collect()
    })
}

/// A pose as words.
fn words_of(Pose { translation: at, rotation: turn, .. }: Pose) -> [u64; 7] {
    [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w].map(|part| u64::from(part.to_bits()))
}

/// The pose of some words.
fn pose_of(words: [u64; 7]) -> Pose {
    let [x, y, z, a, b, c, d] = words.map(|word| f32::from_bits(word as u32));
    Pose::from_parts(Vec3::new(x, y, z), Quat::from_xyzw(a, b, c, d))
}

/// Checksum of a bone's grid and bounds, to tell another case.
fn kind_of(bone: Option<&BoneVolume>) -> u64 {
    let kind = bone.map(|bone| (bone.dims(), bone.cut_nodes(), bone.isovalue(), bone.bounds()));
    StateRecord::sum(&format!("{kind:?}").bytes().map(u64::from).collect::<Vec<_>>()).into()
}

/// Takes over the newest state of the session of a name before the loops begin. Returns it for the
/// recording, if something had been done; else why it was refused, with the remedy.
pub(crate) fn join(name: &str, stages: &mut Stages, stop: &Stop) -> Result<Option<StateRecord>, String> {
    let why = match newest(name, stop) {
        _ if stop.asked() => return Ok(None),
        Err(fault) => fault.to_string(),
        Ok(None) => "no state arrives; run the same version on both sides, and no replay".into(),
        Ok(Some((state, tick))) => match restore(&state, &tick, stages) {
            Ok(is_other) => return Ok(is_other.then(|| begun(&state, &tick))),
            Err(why) => why.into(),
        },
    };
    Err(format!("--watch {name}: what was done before is not seen: {why}"))
}

/// A state as a recording has it: with the tick that its session begins at in front.
fn begun(state: &StateRecord, tick: &TickRecord) -> StateRecord {
    let words: Words =
        [tick.time_ms.to_bits()].iter().chain(&words_of(tick.proxy)).chain(&state.words).copied().collect();
    StateRecord { checksum: StateRecord::sum(&words), words, ..*state }
}

/// Takes over what the session of a recording began with; else why not, and no change.
pub(crate) fn begin(state: &StateRecord, stages: &mut Stages) -> Result<(), &'static str> {
    let Some((front, words)) = state.words.split_first_chunk::<8>() else {
        return Err("its state is damaged; record it again");
    };
    let proxy = pose_of([1, 2, 3, 4, 5, 6, 7].map(|part| front[part]));
    let tick = TickRecord { time_ms: f64::from_bits(front[0]), proxy, ..TickRecord::default() };
    let checksum = if state.checksum == StateRecord::sum(&state.words) { StateRecord::sum(words) } else { 0 };
    restore(&StateRecord { words: words.into(), checksum, ..*state }, &tick, stages).map(drop)
}

/// Waits for a state that is newer than the first tick, with the newest tick.
fn newest(name: &str, stop: &Stop) -> Result<Option<(StateRecord, TickRecord)>, TopicError> {
    let session = Session::join(name)?;
    let (mut states, mut ticks) = (session.subscriber::<StateRecord>()?, session.subscriber::<TickRecord>()?);
    let (clock, mut first, mut tick, mut state) = (Clock::start(), u64::MAX, None, None);
    while clock.now_ms() < WAIT_MS && !stop.asked() && state.as_ref().is_none_or(|s: &StateRecord| s.tick <= first) {
        std::thread::sleep(LOOK);
        tick = ticks.newest()?.or(tick);
        state = states.newest()?.or(state);
        first = first.min(tick.as_ref().map_or(u64::MAX, |tick: &TickRecord| tick.tick));
    }
    Ok(state.zip(tick))
}

/// Takes a state over, and returns whether something had been done; else why not, and no change.
fn restore(state: &StateRecord, tick: &TickRecord, stages: &mut Stages) -> Result<bool, &'static str> {
    if state.checksum != StateRecord::sum(&state.words) {
        return Err("its state is damaged; start watching again");
    }
    let (mut words, bone) = (state.words.iter().copied(), stages.haptic.bone().cloned());
    let mut take = || {
        words.next().filter(|kind| *kind == kind_of(bone.as_deref()))?;
        let (is_open, removed_mm3) = (words.next()? != 0, f64::from_bits(words.next()?));
        let arm = match words.next()?.checked_sub(1) {
            None => None,
            Some(slot) => {
                let mut pose = [0; 7];
                pose.iter_mut().try_for_each(|part| words.next().map(|word| *part = word))?;
                Some((slot as usize, pose_of(pose)))
            }
        };
        let place = |word: u64| {
            let [x, y, z, value] = [0, 16, 32, 48].map(|bits| (word >> bits) as u16);
            (IVec3::new(x.into(), y.into(), z.into()), value.cast_signed())
        };
        let mut places = || (0..words.next()?).map(|_| words.next().map(place)).collect::<Option<Vec<_>>>();
        let (voxels, nodes) = (places()?, places()?);
        if let Some(tissue) = &mut stages.tissue {
            tissue.collision.restore(&mut words, -tick.time_ms)?;
        }
        if let Some(bone) = &bone {
            let mut writer = bone.cut_writer();
            nodes.iter().for_each(|(node, value)| _ = writer.set(*node, *value));
        }
        stages.haptic.restore(tick.proxy, is_open, removed_mm3, &voxels);
        arm.iter().for_each(|(slot, pose)| stages.haptic.restore_arm(*slot, *pose));
        Some(is_open || !nodes.is_empty() || arm.is_some())
    };
    take().ok_or("its state is of another case or version; give both sides the same images and program")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Tissue;
    use trepan_bone::{CUT_SURFACE, FlapSearch};
    use trepan_contact::SurfacePatch;
    use trepan_geometry::{Buttons, Pose, Tool, ToolKind, ToolState, Vec3};
    use trepan_haptics::{Reading, Status};
    use trepan_mesh::Split;
    use trepan_soft::{Body, Material, boxes};
    use trepan_stages::haptic_config::HapticConfig;
    use trepan_stages::haptic_tick::{HapticStage, SecondTool, TickInput, ToolSample};
    use trepan_stages::program::Program;
    use trepan_stages::settling::Settling;
    use trepan_stages::{SoftFrame, SolverStage};
    use trepan_volume::{AIR_HU, VoxelVolume};

    /// Above bone and brain.
    const FAR: Pose = Pose { translation: Vec3::new(30.0, 30.0, 50.0), ..Pose::IDENTITY };

    /// A plate of bone with a flap, over a block of brain that bleeds.
    fn stages() -> Stages {
        let mut ct = VoxelVolume::isotropic([60, 60, 8], Vec3::ZERO, 1.0, AIR_HU);
        ct.data[60 * 60 * 2..60 * 60 * 6].fill(900);
        let bone = Arc::new(BoneVolume::new(&ct, 400).unwrap());
        let middle = Vec3::new(30.0, 30.0, 4.0);
        let search = FlapSearch::new(&bone, middle, 25.0, middle + 6.0 * Vec3::Z, middle - 6.0 * Vec3::Z);
        let config = HapticConfig { opening_needed: true, ..HapticConfig::usual(Program::Integrated) };
        let haptic = HapticStage::new(config, Some(bone), None, ToolState::at(FAR)).with_flap(search, true);
        let mesh = boxes::split_box([6, 6, 6], Vec3::splat(12.0));
        let tets = mesh.tets.len();
        let brain = trepan_bleeding::Perfusion { capillaries: 1.0, vessel: 1.0 };
        let collision = CollisionStage::new(Program::Integrated, &mesh, &Default::default(), None).unwrap();
        let collision =
            collision.settling(Settling::new(0.1, Vec3::NEG_Y, Vec3::Z)).aspirating(&mesh, &vec![0.5; tets]);
        let collision = collision.unwrap().cutting(&mesh, &vec![0.5; tets]);
        let collision = collision.bleeding(&mesh, &vec![brain; tets], Vec3::Z);
        let body = Body::uniform(mesh, vec![0, 1, 2], Material::BRAIN);
        let solver = trepan_tled::Tled::new(&body, &Default::default()).unwrap();
        let solver = SolverStage::new(Box::new(solver)).resectable(tets);
        Stages { haptic, second: None, tissue: Some(Tissue { collision, solver }) }
    }

    /// Presses the flap's button, and waits until it is where it goes.
    fn press_flap(stages: &mut Stages) -> FlapPlace {
        ticked(stages, 300, Buttons::FLAP);
        stages.haptic.flap_place()
    }

    /// Runs ticks far from everything, with buttons in the middle; what an arm holds at the end.
    fn ticked(stages: &mut Stages, ticks: u64, buttons: Buttons) -> Option<(Tool, Pose)> {
        let mut held = None;
        for tick in 1..ticks {
            let buttons = if tick == ticks / 3 { buttons } else { Buttons(0) };
            let reading = Reading { tool: ToolState { buttons, ..ToolState::at(FAR) }, status: Status::Fresh };
            let patch = &SurfacePatch::default();
            let input = TickInput { tick, reading, patch, patch_seq: 0, second: None, second_n: 0.0 };
            held = stages.haptic.tick(&input, &mut |_| {}).sample.second;
        }
        held.map(|held| (held.tool, held.state.world_from_tool))
    }

    /// A step of an aspirator that sinks into the block, from a time of the session on.
    fn step(stages: &mut Stages, ms: u64, start_ms: f64) -> &mut CollisionStage {
        let tray = Program::Integrated.tray();
        let slot = tray.iter().position(|tool| tool.kind == ToolKind::Aspirator).unwrap();
        let tip = Vec3::new(6.1, 6.2, 12.0 + tray[slot].tip_radius_mm - 0.005 * ms.min(600) as f32);
        let mut state = ToolState::at(Pose::from_translation(tip));
        (state.time_ms, state.buttons) = (start_ms + ms as f64, if ms < 700 { Buttons::PEDAL } else { Buttons(0) });
        let sample = ToolSample { tick: ms, state, tool: tray[slot], slot, drilling: false, second: None, idle: false };
        let (tissue, mut frame) = (stages.tissue.as_mut().unwrap(), SoftFrame::default());
        tissue.solver.publish(&mut frame);
        tissue.collision.step(&sample, &frame);
        &mut tissue.collision
    }

    /// A watcher of a session joins it at its tick 1000, while an arm holds the tool of a slot. It
    /// returns what it has to say.
    fn joined(
        name: &str,
        trainee: &Stages,
        watcher: &mut Stages,
        arm: Option<usize>,
    ) -> Result<Option<StateRecord>, String> {
        let (name, over) = (format!("{name}-{}", std::process::id()), Stop::default());
        let session = Session::join(&name).unwrap();
        let (tool, mut ticks) = (Program::Integrated.tray()[0], session.publisher().unwrap());
        let state = ToolState::at(FAR);
        let second = arm.map(|slot| SecondTool { tool: Program::Integrated.tray()[slot], slot, state });
        let sample = ToolSample { tick: 1001, state, tool, slot: 0, drilling: false, second, idle: false };
        let (flap, bone_open) = (trainee.haptic.flap_place(), trainee.haptic.is_open());
        let view = View { flap, bone_open, ..View::at(sample, 1.0) };
        let (sender, _, mut asked) = StateSender::new(session.publisher().unwrap(), trainee, view);
        let collision = &trainee.tissue.as_ref().unwrap().collision;
        std::thread::scope(|scope| {
            scope.spawn(|| sender.live(Clock::start(), &over));
            let joining = scope.spawn(|| join(&name, watcher, &Stop::default()));
            while !joining.is_finished() {
                asked.answer(collision);
                ticks.send(&TickRecord { tick: 1000, time_ms: 1e3, proxy: FAR, ..TickRecord::default() }).unwrap();
                std::thread::sleep(LOOK);
            }
            over.ask();
            joining.join().unwrap()
        })
    }

    fn bone(stages: &Stages) -> Vec<i16> {
        stages.haptic.bone().unwrap().snapshot().data
    }

    fn wound(stages: &Stages) -> (&[u16], f64, &trepan_stages::Bleeding, &[Split], f64) {
        let collision = &stages.tissue.as_ref().unwrap().collision;
        let (loads, wound) = (collision.loads(), collision.wound());
        (&loads.fills, collision.aspirated_mm3(), &wound.bleeding, &loads.splits, wound.cut_mm2)
    }

    /// Closes scissors in the block, and lets the solver follow.
    fn cut(stages: &mut Stages, ms: f64) {
        let tray = Program::Integrated.tray();
        let slot = tray.iter().position(|tool| tool.kind == ToolKind::Scissors).unwrap();
        let tissue = stages.tissue.as_mut().unwrap();
        let mut frame = SoftFrame::default();
        let mut state = ToolState::at(Pose::from_translation(Vec3::new(3.1, 9.2, 8.0)));
        (state.time_ms, state.buttons) = (ms, Buttons::PEDAL);
        let sample = ToolSample { tick: 1, state, tool: tray[slot], slot, drilling: false, second: None, idle: false };
        tissue.solver.publish(&mut frame);
        let seq = tissue.collision.step(&sample, &frame).seq;
        tissue.solver.wait_for_splits(tissue.collision.loads(), tissue.collision.loads().splits.len());
        tissue.solver.step(tissue.collision.loads(), seq);
    }

    #[test]
    fn who_joins_late_has_the_bone_the_flap_the_hole_and_the_blood_of_the_trainee() {
        let (mut trainee, mut watcher, mut ms) = (stages(), stages(), 1000);
        let skull = trainee.haptic.bone().cloned().unwrap();
        let nodes = (0..120 * 120 * 16).map(|n| IVec3::new(n % 120, n / 120 % 120, n / 14_400));
        let ring = nodes.filter(|at| (at.x - 60).abs().max((at.y - 60).abs()) == 24);
        ring.for_each(|node| assert!(skull.cut_writer().set(node, CUT_SURFACE + 100)));
        trainee.haptic.restore(FAR, true, 5.0, &[]);
        assert_eq!(press_flap(&mut trainee), FlapPlace::Away);
        (1..=ms).for_each(|ms| _ = step(&mut trainee, ms, 0.0));
        cut(&mut trainee, ms as f64);
        while !step(&mut trainee, ms, 0.0).save(&mut Vec::new()) {
            ms += 1;
        }
        assert!(wound(&trainee).0.contains(&0) && wound(&trainee).2.bled_ml > 0.0, "{:?}", wound(&trainee).1);
        let state = joined("wound", &trainee, &mut watcher, Some(5)).unwrap().unwrap();
        // A replay begins with the same, from its recording.
        let mut replay = stages();
        begin(&state, &mut replay).unwrap();
        assert!(bone(&replay) == bone(&watcher) && wound(&replay) == wound(&watcher) && replay.haptic.is_open());
        let damaged = StateRecord { checksum: state.checksum + 1, ..state };
        assert!(begin(&damaged, &mut replay).unwrap_err().contains("damaged"));
        assert!(bone(&watcher) == bone(&trainee) && watcher.haptic.is_open());
        assert_eq!(wound(&watcher), wound(&trainee));
        assert!(!wound(&watcher).3.is_empty() && wound(&watcher).4 > 0.0);
        assert!(wound(&watcher).2.stains.iter().any(|stain| *stain > 0));
        let arms = [&mut watcher, &mut replay, &mut trainee].map(|stages| ticked(stages, 9, Buttons(0)));
        assert_eq!(arms, [Some((Tool::spatula(), FAR)), Some((Tool::spatula(), FAR)), None]);
        assert_eq!(press_flap(&mut watcher), FlapPlace::Away, "it would close around the arm's tool");
        assert_eq!(ticked(&mut watcher, 9, Buttons::ARM), None);
        let [theirs, ours] = [(&mut trainee, 0.0), (&mut watcher, -1000.0)].map(|(stages, start_ms)| {
            let places = [press_flap(stages), press_flap(stages)];
            (places, bone(stages), step(stages, ms + 1, start_ms).loads().gravity)
        });
        assert!(theirs == ours && ours.0 == [FlapPlace::Free, FlapPlace::Away] && ours.2 != Vec3::ZERO);
    }

    #[test]
    fn where_nothing_has_happened_nothing_changes_and_what_does_not_fit_is_refused() {
        let (trainee, mut watcher, tick) = (stages(), stages(), TickRecord::default());
        assert_eq!(joined("same", &trainee, &mut watcher, None), Ok(None));
        let kind = kind_of(watcher.haptic.bone().map(|bone| &**bone));
        for (words, checksum, why) in [
            (vec![kind, 1], Some(0), "damaged; start watching again"),
            (vec![kind + 1; 9], None, "another case or version; give both sides the same"),
            (vec![kind, 1, 0, 1, 5, 0, 0, 0, 1], None, "another case or version"),
        ] {
            let checksum = checksum.unwrap_or_else(|| StateRecord::sum(&words));
            let state = StateRecord { words, checksum, ..StateRecord::default() };
            assert!(restore(&state, &tick, &mut watcher).unwrap_err().contains(why));
        }
        assert!(bone(&watcher) == bone(&trainee) && wound(&watcher) == wound(&trainee));
        let unseen = join("nobody-there", &mut watcher, &Stop::default()).unwrap_err();
        assert!(unseen.contains("no state arrives; run the same version"), "{unseen}");
    }
}
