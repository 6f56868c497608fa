//! A session from its flags to its files: open (everything that a user can get wrong), run, write.

use crate::case::Inputs;
use crate::case::choice;
use crate::case::plan::Plan;
use crate::case::scene::{RestBrain, Scene};
use crate::case::tissue::TissueClass;
use crate::error::SessionError;
use crate::hand::{self, Feel, Hand, SecondHold};
use crate::operation::Operation;
use crate::options::Options;
use crate::program::Program;
use crate::report::against::Against;
use crate::report::output;
use crate::report::page::Shot;
use crate::report::regions::{Region, regions};
use crate::report::summary::{About, CutOff, Machine, Summary};
use crate::run::clock::Clock;
use crate::run::film::Filming;
use crate::run::journal::Kept;
use crate::run::lesson::{Company, Taught, Teacher};
use crate::run::lockstep;
use crate::run::stop::Stop;
use crate::run::threads::{self, Devices, Pace};
use crate::run::watch::{Asked, Share};
use crate::run::{Eyes, Outcome, Stages, Tissue};
use crate::show::driver;
use crate::show::picture::{self, Album};
use crate::show::{player, window};
use crate::stages::alarms::Limits;
use crate::stages::collision_step::CollisionStage;
use crate::stages::haptic_tick::{HapticConfig, HapticStage, ToolSample};
use crate::stages::second_hand::SecondHand;
use crate::stages::settling::Settling;
use crate::stages::skull_wall::SkullWall;
use crate::stages::solver_step::SolverStage;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use trepan_contact::{Vibration, Viscoelastic};
use trepan_geometry::{ToolState, Vec3, units};
use trepan_haptics::script::Script;
use trepan_haptics::{DeviceName, HapticDevice, mouse};
use trepan_link::wire::SessionHeader;
use trepan_link::{Recorder, Recording};
use trepan_render::{Painter, SceneData};
use trepan_soft::{Body, Loads, SoftSolver};
use trepan_volume::{BoneVolume, Piece};

/// A session that is ready to run.
pub struct Session {
    program: Program,
    options: Options,
    device: DeviceName,
    second: Option<DeviceName>,
    recording: Option<Recording>,
    case: String,
    hash: String,
    scene: Scene,
    /// The bone that a replay carves while the window goes back and forth with the scene's.
    filmed: Option<Arc<BoneVolume>>,
    operation: Operation,
    plan: Plan,
    rigid: trepan_rigid::Method,
    /// What `--solver fastest` turned out to be.
    fastest: OnceLock<&'static str>,
    out: PathBuf,
    windowed: bool,
}

/// How a session ended.
#[derive(Debug)]
pub struct Ended {
    /// Its summary.
    pub summary: Summary,
    /// Where its files are.
    pub out: PathBuf,
    /// The signal that ended it, if one did.
    pub signal: Option<i32>,
}

impl Session {
    /// Checks and loads everything; writes nothing but the cache.
    ///
    /// `built_in` is the case that is taken when no image is given.
    pub fn open(program: Program, options: Options, built_in: Inputs) -> Result<Self, SessionError> {
        options.check().map_err(SessionError::Usage)?;
        let windowed = !options.headless && window::has_display();
        if !windowed && !options.headless {
            tracing::info!("no display here: running the scripted operation headless");
        }
        places(&options)?;
        let device = hand::device_name(program, &options, windowed)?;
        let second = hand::second_name(&device, &options)?;
        let rigid = rigid_method(&options)?;
        solver_named(&options)?;
        let recording = match &device {
            DeviceName::Replay(path) => Some(Recording::open(path)?),
            _ => None,
        };
        let case = choice::open_case(program, &options, built_in)?;

        let (name, hash) = (case.name.clone(), case.hash.clone());
        let scene = Scene::new(program, case)?;
        scene.remarks.iter().for_each(|remark| tracing::warn!("{remark}"));
        let copy = |bone: &Arc<BoneVolume>| BoneVolume::new(&bone.snapshot(), bone.isovalue()).map(Arc::new);
        let filmed = scene.bone.as_ref().filter(|_| windowed && recording.is_some()).map(copy).transpose();
        let filmed = filmed.map_err(|fault| SessionError::Internal(fault.to_string()))?;
        let operation = Operation::of(&options, &device, recording.as_ref());
        let plan = planned(&scene, &operation)?;
        let out = options.out.clone().unwrap_or_else(|| PathBuf::from("trepan-out").join(program.name()));
        let (case, fastest) = (name, OnceLock::new());
        Ok(Self {
            program,
            options,
            device,
            second,
            recording,
            case,
            hash,
            scene,
            filmed,
            operation,
            plan,
            rigid,
            fastest,
            out,
            windowed,
        })
    }

    /// Runs it and writes its files.
    pub fn run(self) -> Result<Ended, SessionError> {
        let stop = Stop::on_signals().map_err(|fault| SessionError::Internal(format!("signals: {fault}")))?;
        let (before, whole) = (self.pieces(), self.bone().map(|bone| bone.snapshot()));
        let Hand { device, pointer, watch } = Hand::open(&self.device, self.program, &self.options, &self.plan)?;
        let second = self.second.as_ref().map(|name| SecondHold::open(name, &self.options, &self.plan)).transpose()?;
        let recorded = || Feel::recorded(self.recording.as_ref(), hand::FIRST);
        let scale = if watch.is_some() { self.options.device_scale } else { 1.0 };
        let feel = device.as_ref().map_or_else(recorded, |device| Feel::of(&device.capabilities(), scale));
        let second_feel = self.second_feel(second.as_ref());
        let start = self.start();
        let stages = self.stages(start.state, &feel, second_feel.as_ref())?;
        let (second_device, second_watch) = second.map_or((None, None), |held| (Some(held.device), held.watch));
        output::folder(&self.out)?;
        let record = self.options.record.clone().unwrap_or_else(|| self.out.join("session.mcap"));
        let (share, asked) = self.options.share.as_deref().map(Share::open).transpose()?.unzip();
        let (mut company, [device, second_device]) = self.company(asked, [device, second_device])?;
        let kept = (Recorder::create(&record, &self.header(&feel, second_feel.as_ref()))?, share);
        let mut graphics = self.graphics();
        let adapter = graphics.as_ref().ok().map(|g| g.adapter.clone());
        let mut album = Album::default();
        let devices = device.map(|first| Devices { first, second: second_device });
        let outcome = self.loops(stages, devices, kept, start, &stop, |eyes| {
            album = self.picture(eyes, &mut graphics, pointer, std::mem::take(&mut company), &stop);
        });
        let mut remarks = self.scene.remarks.clone();
        remarks.extend(graphics.err());
        remarks.append(&mut album.faults);
        remarks.extend(watch.as_ref().and_then(hand::faults));
        remarks.extend(second_watch.as_ref().and_then(hand::faults).map(|text| format!("second hand: {text}")));
        let recording = Recording::open(&record)?;
        let about = About {
            cut_off: CutOff::of(&before, &self.pieces(), self.bone().map_or(0.0, |bone| bone.voxel_mm3())),
            plan: self.bone().zip(whole).and_then(|(bone, whole)| Against::of(&self.plan, &whole, bone)),
            regions: self.regions(&recording),
            ..self.about(&album, adapter, remarks)
        };
        let summary = Summary::new(about, &outcome);
        output::write(&self.out, &recording, &summary, &outcome, &self.shots(album.shots))?;
        if let Some(bone) = self.bone() {
            output::drilled(&self.out, bone, self.options.stl)?;
        }
        Ok(Ended { summary, out: self.out, signal: stop.signal() })
    }

    /// Lets a teacher have a say in both hands' buttons, where this session is shared; with a window on another's session, this one teaches.
    fn company(&self, asked: Option<Asked>, mut hands: [Held; 2]) -> Result<(Company, [Held; 2]), SessionError> {
        let mut company = Company::default();
        if let Some([first, second, window]) = asked {
            let taught = |hand: Held, asked| hand.map(|device| Box::new(Taught::new(device, asked)) as _);
            let [one, other] = hands;
            hands = [taught(one, first), taught(other, second)];
            company.asked = Some(window);
        }
        if let Some(name) = self.options.watch.as_deref().filter(|_| self.windowed) {
            let teacher = Teacher::join(name);
            company.teacher = Some(teacher.map_err(|fault| SessionError::Usage(format!("--watch {name}: {fault}")))?);
        }
        Ok((company, hands))
    }

    fn loops(
        &self,
        stages: Stages,
        devices: Option<Devices>,
        kept: Kept,
        start: ToolSample,
        stop: &Stop,
        picture: impl FnOnce(Eyes),
    ) -> Outcome {
        match (&self.recording, devices) {
            (Some(recording), _) => {
                let length_ms = recording.ticks.last().map_or(0.0, |tick| tick.time_ms);
                let film = self.windowed.then(|| Filming::new(self.bone().cloned(), length_ms));
                lockstep::run(stages, recording, kept, start, film, stop, picture)
            }
            (None, Some(devices)) => threads::run(stages, devices, kept, start, self.pace(), stop, picture),
            (None, None) => Outcome::default(),
        }
    }

    /// The bone, if it is operated on.
    fn bone(&self) -> Option<&Arc<BoneVolume>> {
        self.filmed.as_ref().or(self.scene.bone.as_ref()).filter(|_| self.program.has_bone())
    }

    /// The bone's pieces as they hang together now.
    fn pieces(&self) -> Vec<Piece> {
        self.bone().map_or_else(Vec::new, |bone| Piece::all(bone))
    }

    /// Where the brain was pressed.
    fn regions(&self, recording: &Recording) -> Vec<Region> {
        let brain = self.scene.brain.as_ref().filter(|_| self.program.has_tissue());
        brain.map_or_else(Vec::new, |brain| regions(brain, self.program.tray(), &recording.ticks))
    }

    /// What the second hand's guard must know: of its device, or of the recorded one; `None` without a second hand.
    fn second_feel(&self, held: Option<&SecondHold>) -> Option<Feel> {
        let scale = |held: &SecondHold| if held.watch.is_some() { self.options.device_scale } else { 1.0 };
        let recorded = self.recording.as_ref().filter(|recording| !recording.second.is_empty());
        held.map(|held| Feel::of(&held.device.capabilities(), scale(held)))
            .or_else(|| recorded.map(|recording| Feel::recorded(Some(recording), hand::SECOND)))
    }

    /// Where the tool waits.
    fn start(&self) -> ToolSample {
        let script = Script::named(self.program.script(), &self.scene.site, 1e4).map(|script| script.at(0.0));
        let first = self.recording.as_ref().and_then(|r| r.ticks.first()).map(|t| ToolState::at(t.device));
        let state = first.or(script.ok()).unwrap_or_else(|| ToolState::at(trepan_geometry::Pose::IDENTITY));
        ToolSample { tick: 0, state, tool: self.program.tray()[0], slot: 0, drilling: false }
    }

    fn stages(&self, start: ToolState, feel: &Feel, second: Option<&Feel>) -> Result<Stages, SessionError> {
        let config = |feel: &Feel| HapticConfig {
            program: self.program,
            rigid: self.rigid,
            dt_ms: self.tick_ms(),
            bone_force: Vibration::drill(feel.coupled(Viscoelastic { stiffness: 2.0, damping: 0.5 }, self.tick_ms())),
            tissue_force: feel.coupled(Viscoelastic { stiffness: 0.3, damping: 0.3 }, self.tick_ms()),
            guard: feel.guard(),
            limits: Limits::default(),
            opening_needed: self.options.watch.is_none(),
        };
        let bone = self.bone().cloned();
        let field = self.scene.brain.as_ref().map(|brain| Arc::clone(&brain.field));
        let tissue = match &self.scene.brain {
            Some(brain) if self.program.has_tissue() => Some(self.tissue(brain)?),
            _ => None,
        };
        let second = second.map(|feel| SecondHand::new(config(feel), bone.clone(), field.clone()));
        let search = bone.as_ref().and_then(|bone| self.plan.search(bone));
        let forbidden = self.scene.brain.as_ref().and_then(|brain| brain.distance_to(&self.operation.forbidden));
        let mut haptic = HapticStage::new(config(feel), bone, field, start);
        haptic = search.into_iter().fold(haptic, HapticStage::with_flap);
        haptic = forbidden.map(Arc::new).into_iter().fold(haptic, HapticStage::forbidding);
        Ok(Stages { haptic, second, tissue })
    }

    fn tissue(&self, brain: &RestBrain) -> Result<Tissue, SessionError> {
        let internal = |fault: &dyn std::fmt::Display| SessionError::Internal(format!("the brain: {fault}"));
        let young_mpa = units::mpa_from_kpa(self.options.young_modulus_kpa);
        let body = Body {
            mesh: brain.mesh.clone(),
            fixed: brain.fixed.clone(),
            materials: TissueClass::ALL.map(|class| class.material(young_mpa)).to_vec(),
            material_of_tet: brain.class_of_tet.iter().map(|code| code - 1).collect(),
        };
        let solver: Box<dyn SoftSolver> = match solver_named(&self.options)? {
            None => {
                let config = trepan_tled::Config::default();
                if self.options.solver.as_deref() == Some(FASTEST) {
                    let (clock, loads) = (Clock::start(), Loads::default());
                    let all = trepan_tled::choice::candidates(&body, &config);
                    let chosen = trepan_tled::choice::fastest(&all, &loads, 100.0, &|| clock.now_ms());
                    let chosen = chosen.map_err(|f| internal(&f))?;
                    tracing::info!("solver {}: {}", chosen.name, chosen.why);
                    let _first = self.fastest.set(chosen.name);
                    chosen.solver
                } else {
                    Box::new(trepan_tled::Tled::new(&body, &config).map_err(|f| internal(&f))?)
                }
            }
            Some(method) => method.build(&body).map_err(|f| internal(&f))?,
        };
        let bone = self.bone().cloned();
        let wall = bone.map(|bone| SkullWall::new(bone, &brain.mesh, &brain.fixed)).transpose();
        let wall = wall.map_err(|f| internal(&f))?;
        let collision = CollisionStage::new(self.program, &brain.mesh, &Default::default(), wall);
        let settling = Settling::new(self.operation.fluid_lost, Vec3::NEG_Y, -self.plan.site.inward);
        let collision = collision.map_err(|f| internal(&f))?.settling(settling);
        Ok(Tissue { collision, solver: SolverStage::new(solver) })
    }

    /// The pictures of the report: how the images fit, then the session's.
    fn shots(&self, session: Vec<Shot>) -> Vec<Shot> {
        let caption =
            "how CT and MRI fit: the bone's contour over the MRI (with --register above as read, below as moved)";
        let fit = self.scene.fit_png.clone().map(|png| Shot { caption: caption.into(), png });
        session.into_iter().chain(fit).collect()
    }

    fn graphics(&self) -> Result<Graphics, String> {
        if !self.windowed && self.options.frames_per_second == 0.0 {
            return Err("no picture was asked for".into());
        }
        let data = SceneData {
            bone: self.scene.bone.clone(),
            brain: self.scene.brain.as_ref().map(|brain| &brain.mesh),
            mri: self.scene.brain.as_ref().map(|brain| &brain.mri),
            tint: self.scene.brain.as_ref().and_then(|brain| brain.tint.as_deref()),
        };
        let [width, height] = self.options.picture;
        let painter = Painter::on(driver::open(), &data, [width, height]).map_err(|fault| fault.to_string())?;
        painter.notice().inspect(|notice| tracing::warn!("{notice}"));
        Ok(Graphics { adapter: painter.name(), painter: Some(painter) })
    }

    fn picture(
        &self,
        mut eyes: Eyes,
        graphics: &mut Result<Graphics, String>,
        pointer: Option<mouse::MouseHandle>,
        company: Company,
        stop: &Stop,
    ) -> Album {
        let Some(painter) = graphics.as_mut().ok().and_then(|g| g.painter.take()) else {
            picture::wait(eyes, stop);
            return Album::default();
        };
        if self.windowed {
            let opened = window::Opened {
                scene: &self.scene,
                case: &self.case,
                program: self.program,
                out: &self.out,
                rate_hz: self.options.rate_hz,
            };
            return match (eyes.film.take(), &self.recording) {
                (Some(film), Some(recording)) => {
                    let until_s = self.options.duration.unwrap_or(f64::INFINITY);
                    player::show(*eyes.view.latest().0, film, painter, &opened, recording, until_s, stop)
                }
                _ => window::show(eyes, painter, &opened, pointer, company, stop),
            };
        }
        let (bone_shown, folder) = (self.program.has_bone(), self.out.join("frames"));
        picture::draw(eyes, painter, &self.scene, bone_shown, self.options.frames_per_second, &folder, stop)
    }

    fn pace(&self) -> Pace {
        let scripted =
            self.options.watch.is_none() && matches!(self.device, DeviceName::Script(_) | DeviceName::Simulated(_));
        let end_ms = self.options.duration.filter(|_| !scripted).map_or(f64::INFINITY, |s| 1e3 * s);
        Pace { tick_ms: self.tick_ms(), collision_ms: 1.0, end_ms }
    }

    fn tick_ms(&self) -> f32 {
        1e3 / self.options.rate_hz
    }

    /// What steps the tissue: of `fastest` what that turned out to be.
    fn solver_name(&self) -> String {
        let named = || self.options.solver.clone().unwrap_or_else(|| TLED.into());
        self.fastest.get().map_or_else(named, |name| name.to_string())
    }

    fn header(&self, feel: &Feel, second: Option<&Feel>) -> SessionHeader {
        let config = [
            ("rigid", self.rigid.name().to_string()),
            ("solver", self.solver_name()),
            ("rate_hz", self.options.rate_hz.to_string()),
            ("spacing_mm", self.options.patient.spacing_mm.to_string()),
            ("tets", self.options.patient.tets.to_string()),
            ("young_modulus_kpa", self.options.young_modulus_kpa.to_string()),
        ];
        let hands = feel.entries(hand::FIRST).into_iter();
        let hands = hands.chain(second.into_iter().flat_map(|second| second.entries(hand::SECOND)));
        SessionHeader {
            app: self.program.name().into(),
            version: env!("CARGO_PKG_VERSION").into(),
            case: self.case.clone(),
            seed: self.options.seed,
            hashes: [("case".to_string(), self.hash.clone())].into(),
            config: config
                .map(|(key, value)| (key.to_string(), value))
                .into_iter()
                .chain(self.operation.entries())
                .chain(hands)
                .collect(),
        }
    }

    fn about(&self, album: &Album, adapter: Option<String>, remarks: Vec<String>) -> About {
        let brain = self.scene.brain.as_ref();
        About {
            program: self.program,
            case: self.case.clone(),
            device: match (&self.device, &self.options.watch) {
                (_, Some(_)) => "watch".into(),
                (DeviceName::Replay(_), _) => "replay".into(),
                (other, _) => other.to_string(),
            },
            second_device: self.second.as_ref().map_or("replay".to_string(), DeviceName::to_string),
            solver: self.solver_name(),
            brain: brain.map_or([0; 3], |b| [b.mesh.tets.len(), b.mesh.positions.len(), b.fixed.len()]),
            frames: album.frames,
            cut_off: CutOff::default(),
            plan: None,
            regions: Vec::new(),
            remarks,
            machine: Machine::here(adapter),
        }
    }
}

/// A device, if a hand holds one.
type Held = Option<Box<dyn HapticDevice>>;

struct Graphics {
    adapter: String,
    painter: Option<Painter>,
}

const TLED: &str = "tled";
/// TLED where it steps faster on this machine, processor or graphics device. A replay then need not have the recorded forces to the last bit.
const FASTEST: &str = "fastest";

/// What is to be taken away.
fn planned(scene: &Scene, operation: &Operation) -> Result<Plan, SessionError> {
    let hole_mm = Program::Craniotomy.tray()[0].tip_radius_mm;
    let plan = Plan::new(scene.bone.as_deref(), scene.site, hole_mm, 0.5 * operation.flap_mm);
    plan.ok_or_else(|| {
        let fault = format!(
            "--flap {}: the skull does not go all around it: give a smaller one, or another --opening",
            operation.flap_mm
        );
        SessionError::Usage(fault)
    })
}

/// Refuses places that cannot be written to before anything is loaded.
fn places(options: &Options) -> Result<(), SessionError> {
    if let Some(out) = options.out.as_deref().filter(|out| out.exists() && !out.is_dir()) {
        return Err(SessionError::Usage(format!("--out {} is a file: name a folder, new or old", out.display())));
    }
    let folder = options.record.as_deref().and_then(Path::parent).filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        return Err(SessionError::Usage(format!("--record: there is no folder {}; make it first", folder.display())));
    }
    Ok(())
}

fn rigid_method(options: &Options) -> Result<trepan_rigid::Method, SessionError> {
    let Some(name) = &options.rigid else { return Ok(trepan_rigid::Method::RECOMMENDED) };
    trepan_rigid::Method::named(name).ok_or_else(|| {
        let known: Vec<_> = trepan_rigid::Method::all().iter().map(|method| method.name()).collect();
        SessionError::Usage(format!("--rigid {name} is not known; known are {}", known.join(", ")))
    })
}

/// The rival solver of that name; `None` for TLED.
fn solver_named(options: &Options) -> Result<Option<trepan_soft::Method>, SessionError> {
    let name = options.solver.as_deref().unwrap_or(TLED);
    if name == TLED || name == FASTEST {
        return Ok(None);
    }
    trepan_soft::Method::named(name).map(Some).ok_or_else(|| {
        let known: Vec<_> = trepan_soft::Method::all().iter().map(|method| method.name()).collect();
        SessionError::Usage(format!("--solver {name} is not known; known are {TLED}, {FASTEST}, {}", known.join(", ")))
    })
}
