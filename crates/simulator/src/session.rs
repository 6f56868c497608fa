//! Runs a session from its flags to its files: open with all checks, run, write.

use crate::choice;
use crate::config::SessionConfig;
use crate::device_limits::DeviceLimits;
use crate::error::SessionError;
use crate::hand::{self, OpenDevice};
use crate::models::{ModelRequest, Models};
use crate::operation::Operation;
use crate::options::{Options, Patient};
use crate::recordings;
use crate::session_setup::SessionSetup;
use crate::show::driver;
use crate::show::graphics::{Graphics, NoPicture};
use crate::show::picture::{self, Album};
use crate::show::{player, window};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::channel;
use trepan_bone::BoneVolume;
use trepan_geometry::ToolState;
use trepan_gpu::{Gpu, GpuError};
use trepan_haptics::script::Script;
use trepan_haptics::{Capabilities, DeviceName, HapticDevice, mouse, spacemouse};
use trepan_link::wire::SessionHeader;
use trepan_link::{Recorder, Recording, SceneWriter};
use trepan_patient::identity::Identity;
use trepan_patient::progress::Progress;
use trepan_patient::{self as patient, Inputs, MadeTumour, PatientError, Plan, PlanComparison, Scene};
use trepan_render::Camera;
use trepan_report::debrief::Debrief;
use trepan_report::drilled::{self, Drilled};
use trepan_report::kept::SessionFolder;
use trepan_report::page::Shot;
use trepan_report::printable::printable;
use trepan_report::summary::{CutOff, Machine, Opening, SecondSummary, SolverSummary, Summary, fps};
use trepan_report::training::{Guide, Lesson};
use trepan_report::{film, output, slicer, tool_use};
use trepan_runtime::film::{self as filmed, Filming};
use trepan_runtime::lesson::{Teacher, TeacherButtons};
use trepan_runtime::lockstep;
use trepan_runtime::stop::Stop;
use trepan_runtime::threads::{self, Devices, Pace};
use trepan_runtime::watch::{self, PeerSession, Share, TeacherRequests};
use trepan_runtime::{Outcome, RenderInputs, Run, SolverOutcome, Stages, View};
use trepan_stages::haptic_tick::ToolSample;
use trepan_stages::program::Program;
use trepan_volume::VoxelVolume;
use trepan_window::Stage;

/// A session that is ready to run.
pub struct Session {
    program: Program,
    options: Options,
    device: DeviceName,
    second: Option<DeviceName>,
    recording: Option<Arc<Recording>>,
    /// Of a watched session: its header.
    watched: Option<Recording>,
    /// Configuration of the recording or of the watched session; default without one.
    recorded: SessionConfig,
    case: Identity,
    setup: SessionSetup,
    /// Input files of the case; empty for a case folder.
    inputs: Inputs,
    out: PathBuf,
    lesson: Option<Lesson>,
    /// Where it runs.
    place: Place,
}

/// Where a session runs: in a window, or without one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Place {
    /// The window; `None` for a headless run.
    pub window: Option<Stage>,
    /// Graphics device, if it was looked for already.
    pub drawing: Option<Result<Gpu, GpuError>>,
    /// Progress of loading.
    pub progress: Progress,
}

/// Result of a session.
#[derive(Debug)]
pub struct SessionResult {
    /// Its summary.
    pub summary: Summary,
    /// Folder of its files.
    pub out: PathBuf,
    /// The signal that ended it, if one did.
    pub signal: Option<i32>,
    /// Hash of the case that it ran on.
    pub case: Option<String>,
    /// What the replayed recording lacks, with the remedy.
    pub lack: Option<String>,
}

impl Session {
    /// Checks and loads everything; writes nothing but the cache.
    ///
    /// `built_in` is the case that is used if no image is given.
    pub fn open(program: Program, options: Options, built_in: Inputs) -> Result<Self, SessionError> {
        Self::open_in(program, options, built_in, Place::default())
    }

    /// Opens a session that runs in a window, if the place has one.
    pub(crate) fn open_in(
        program: Program,
        options: Options,
        built_in: Inputs,
        mut place: Place,
    ) -> Result<Self, SessionError> {
        options.check()?;
        let (lesson, options) = lesson_of(program, options)?;
        let windowed = place.window.is_some();
        check_outputs(&options)?;
        let device = hand::device_name(program, &options, windowed)?;
        let second = hand::second_name(&device, &options)?;
        let recording = match device.recording() {
            Some(path) => Some(Arc::new(recordings::open(program, path, &choice::identity(&options, &built_in)?)?)),
            None => None,
        };
        let watched = match &options.watch {
            Some(name) => Some(watched(name, &choice::identity(&options, &built_in)?, &place.progress)?),
            None => None,
        };
        let settled = recording.as_deref().or(watched.as_ref());
        let recorded = settled.map(|settled| SessionConfig::of(&settled.header)).transpose()?;
        let operation = Operation::of(&options, &device, recorded.as_ref().map(|config| &config.operation));
        let mut options = options;
        let made = operation.made_tumour().filter(|_| program.has_tissue());
        options.patient.tumour = options.patient.tumour.or(made);
        let request = ModelRequest::of(program, &options, &operation, recorded.as_ref())?;
        let inputs = match options.case {
            Some(_) => Inputs::default(),
            None => choice::inputs(&options.patient, built_in.clone()),
        };
        let Place { drawing, progress, .. } = &mut place;
        let card = || drawing.get_or_insert_with(driver::open).as_ref().is_ok_and(|gpu| !gpu.is_software());
        let (case, models) = choice::open_case(program, &options, built_in, request, (progress, card))?;
        progress.next("preparing the operation")?;
        let identity = Identity { name: case.name.clone(), case: Some(case.hash.clone()), images: case.images.clone() };
        let setup = SessionSetup::new(program, (case, models), operation, windowed && recording.is_some())?;
        let out = options
            .out
            .clone()
            .unwrap_or_else(|| output::dated(program, options.sessions.as_deref(), options.name.as_deref()));
        Ok(Self {
            program,
            options,
            device,
            second,
            recording,
            watched,
            recorded: recorded.unwrap_or_default(),
            case: identity,
            setup,
            inputs,
            out,
            lesson,
            place,
        })
    }

    /// Whether the session only shows a recording in the window: then it writes nothing.
    pub(crate) fn is_viewed(&self) -> bool {
        self.windowed() && self.recording.is_some() && self.options.out.is_none() && self.options.record.is_none()
    }

    /// Shows a recording in the window: its film, or without one a replay that is made meanwhile.
    pub(crate) fn view(mut self) -> Result<(), SessionError> {
        let (Some(recording), Some(path)) = (self.recording.clone(), self.device.recording()) else { return Ok(()) };
        let scene = trepan_link::read_scene(&output::scene_of(path), &recording.header).ok().flatten();
        let Some(scene) = scene.filter(|scene| !scene.is_empty()) else {
            tracing::info!("no film of this session lies beside its recording: skull and brain are computed again");
            let scratch = tempfile::tempdir().map_err(SessionError::output(&std::env::temp_dir()))?;
            self.out = scratch.path().join("replay");
            return self.run().map(|_| ());
        };
        let stop = Stop::on_signals().map_err(|fault| SessionError::Internal(format!("signals: {fault}")))?;
        let limits = &self.recorded.device;
        let mut first = View::at(self.start(), limits.guard().max_force_n);
        first.force_scale = limits.force_scale();
        self.place.progress.next("preparing the picture")?;
        let drawing = self.place.drawing.take();
        let mut graphics = self.graphics(drawing);
        let painter = graphics.as_mut().map_err(|why| SessionError::Internal(why.to_string()))?.painter.take();
        let Some((painter, stage)) = painter.zip(self.place.window.as_ref()) else { return Ok(()) };
        let (sender, coming) = channel();
        scene.into_iter().for_each(move |record| _ = sender.send(filmed::Shot::of(record, first)));
        let until_s = self.options.duration.unwrap_or(f64::INFINITY);
        player::show(first, coming, painter, &self.opened(stage), &recording, until_s, &stop);
        Ok(())
    }

    /// Runs the session and writes its files; on failure no partly written file remains.
    pub fn run(mut self) -> Result<SessionResult, SessionError> {
        let stop = Stop::on_signals().map_err(|fault| SessionError::Internal(format!("signals: {fault}")))?;
        let before = self.setup.pieces();
        let (options, plan, rate_hz) = (&self.options, &self.setup.plan, self.setup.operation.rate_hz);
        let hand = OpenDevice::open(&self.device, self.program, options, plan, rate_hz, &stop)?;
        let second = match &self.second {
            Some(name) => Some(OpenDevice::second(name, options, plan, rate_hz)?),
            None => self.recording.as_ref().filter(|r| !r.second.is_empty()).map(|_| OpenDevice::default()),
        };
        let limits = self.limits(&hand, Some(&self.recorded.device));
        let second_limits = second.as_ref().map(|second| self.limits(second, self.recorded.second_device.as_ref()));
        let (header, date) = (self.header(&limits, second_limits.as_ref()), output::now());
        // Before the last preparations: a watcher loads beside them.
        let (share, asked) = self.options.share.as_deref().map(|name| Share::open(name, &header)).transpose()?.unzip();
        let start = self.start();
        let limits_of_both = (&limits, second_limits.as_ref());
        self.place.progress.next("preparing contact and tissue")?;
        let stages = self.setup.stages(start.state, self.tick_ms(), limits_of_both)?;
        let OpenDevice { device, pointer, watch, watching } = hand;
        let OpenDevice { device: second_device, watch: second_watch, .. } = second.unwrap_or_default();
        let record = self.options.record.clone().unwrap_or_else(|| self.out.join(output::RECORDING));
        let files = output::Files::make(&self.out, &record)?;
        let (mut company, [device, second_device]) = self.company(asked, [device, second_device])?;
        company.watching.clone_from(&watching);
        let recorder = Recorder::create(&record, &header)?;
        let scene = match self.recording {
            None => Some((self.film(None), SceneWriter::create(&output::scene_of(&record), &header)?)),
            Some(_) => None,
        };
        self.place.progress.next("preparing the picture")?;
        let drawing = self.place.drawing.take();
        let mut graphics = self.graphics(drawing);
        let adapter = graphics.as_ref().ok().map(|g| g.adapter.clone());
        let (mut album, devices) = (Album::default(), device.map(|first| Devices { first, second: second_device }));
        let run = Run { stages, start, recorder, share, watching: watching.clone(), scene, stop: &stop };
        let outcome = self.loops(run, devices, |inputs| {
            album = self.picture(inputs, &mut graphics, pointer, std::mem::take(&mut company), &stop);
        });
        let ended = watching.and_then(|watching| watching.ended());
        ended.iter().for_each(|text| tracing::info!("{text}"));
        let recording = Recording::open(&record)?;
        let solver = outcome.solver.clone().unwrap_or_default();
        self.map(&mut album, &recording, &solver);
        let mut remarks = self.setup.scene.remarks.clone();
        remarks.extend(self.setup.models.unmet.iter().cloned());
        let (lack, unlike) = self.replay_remarks();
        remarks.extend(lack.iter().cloned().chain(unlike).chain(ended));
        remarks.extend(self.setup.solver_remarks());
        remarks.extend(graphics.err().map(|why| why.to_string()));
        remarks.append(&mut album.faults);
        remarks.extend(watch.as_ref().and_then(hand::faults));
        let drilled = self.setup.bone().map(|bone| self.drilled(bone, &mut remarks));
        remarks.extend(second_watch.as_ref().and_then(hand::faults).map(|text| format!("second hand: {text}")));
        let around = self.setup.bone().filter(|_| self.options.drilled_fine);
        let around = around.and_then(|bone| drilled::on_nodes_around(bone));
        let summary = Summary {
            date,
            length_s: recording.ticks.last().map_or(0.0, |tick| 1e-3 * tick.time_ms),
            removed_label: drilled.as_ref().map(Drilled::label),
            cut_off: CutOff::of(&before, &self.setup.pieces(), self.setup.bone().map_or(0.0, |bone| bone.voxel_mm3())),
            plan: self.setup.bone().and_then(|bone| PlanComparison::of(&self.setup.plan, bone)),
            regions: self.setup.regions(&recording),
            tool_use: tool_use::tool_use(self.program.tray(), &recording),
            resection: self.setup.resection(&solver.fills),
            remarks,
            machine: Machine::here(adapter),
            ..self.about(&album)
        };
        let summary = summary.with(&outcome);
        self.write(&recording, &summary, &outcome, album.shots, (drilled, around))?;
        files.keep();
        Ok(SessionResult { summary, out: self.out, case: self.case.case, signal: stop.signal(), lack })
    }

    /// Writes the files: summary, scores, report, markups, skull.
    fn write(
        &self,
        recording: &Recording,
        summary: &Summary,
        outcome: &Outcome,
        shots: Vec<Shot>,
        (drilled, around): (Option<Drilled>, Option<VoxelVolume<i16>>),
    ) -> Result<(), SessionError> {
        let debrief = self.debrief(summary)?;
        output::write(&self.out, recording, summary, outcome, (&debrief, &self.shots(shots)))?;
        slicer::write(&self.out, &self.setup.plan, &recording.ticks)?;
        if let Some((bone, drilled)) = self.setup.bone().zip(drilled) {
            output::skull(&self.out, &drilled, around.as_ref(), bone, self.options.stl)?;
        }
        // From the start page nobody prints it; with flags the program does, at its end.
        if self.options.sessions.is_some() {
            tracing::info!("report: {}", printable(&self.out.join("report.html").display().to_string()));
        }
        let film = self.out.join("window").join(film::LIST);
        if film.is_file() {
            let (program, folder) = (self.program.name(), printable(&self.out.display().to_string()));
            tracing::info!("film: `{program} recording film {folder} film.png` makes one file of it");
        }
        Ok(())
    }

    /// The debriefing, compared with earlier sessions beside this one.
    fn debrief(&self, summary: &Summary) -> Result<Debrief, SessionError> {
        let summary =
            serde_json::to_value(summary).map_err(|fault| SessionError::Internal(format!("summary: {fault}")))?;
        let roots: Vec<PathBuf> = self.out.ancestors().nth(2).map(PathBuf::from).into_iter().collect();
        let this = SessionFolder::with(&self.out, summary);
        Ok(Debrief::of(&this.summary, self.lesson.as_ref(), &this.before(&SessionFolder::list(&roots))))
    }

    fn windowed(&self) -> bool {
        self.place.window.is_some()
    }

    /// Describes what the replayed recording lacks, and whether its case was built differently.
    fn replay_remarks(&self) -> (Option<String>, Option<String>) {
        if let Some(watched) = &self.watched {
            let unlike = recordings::unlike(watched, &self.case);
            return (None, unlike.map(|text| format!("the watched session: {text}")));
        }
        let (Some(recording), Some(path)) = (&self.recording, self.device.recording()) else { return (None, None) };
        (recordings::not_whole(self.program, path, recording), recordings::unlike(recording, &self.case))
    }

    /// Current skull in the scanner's voxels; in those of the case, with a remark, if the CT is not
    /// available.
    fn drilled(&self, bone: &BoneVolume, remarks: &mut Vec<String>) -> Drilled {
        let why = match patient::scanned(&self.inputs, self.options.patient.ct_series) {
            Some(Ok(ct)) => return drilled::drilled(ct, bone),
            Some(Err(fault)) => format!("the CT cannot be read again: {fault}"),
            None => "a case folder does not hold the scanner's images".into(),
        };
        let edge = bone.spacing_mm();
        remarks.push(format!("drilled.nii.gz has voxels of {edge} mm instead of the scanner's: {why}"));
        drilled::drilled(bone.scanned_volume(), bone)
    }

    /// The patient's current scene.
    pub fn scene(&self) -> &Scene {
        &self.setup.scene
    }

    /// The planned removal of bone.
    pub fn plan(&self) -> &Plan {
        &self.setup.plan
    }

    /// The models that run, with the reasons.
    pub fn models(&self) -> &Models {
        &self.setup.models
    }

    /// The camera of the session's pictures.
    pub fn camera(&self) -> Camera {
        picture::camera(&self.setup.scene.site)
    }

    /// What the solver lacks of what was asked, once the stages are made: where it runs instead.
    pub fn solver_remarks(&self) -> Vec<String> {
        self.setup.solver_remarks()
    }

    /// Creates the stages for a hand without a device, for callers that do not use
    /// [`run`](Self::run). The tool is at `start`.
    pub fn stages(&self, start: ToolState) -> Result<Stages, SessionError> {
        let limits = DeviceLimits::of(&Capabilities::passive("a script"), 1.0, self.options.force_scale);
        self.setup.stages(start, self.tick_ms(), (&limits, None))
    }

    /// Connects a teacher. In a shared session the teacher's requests act on both hands' buttons; a
    /// window that watches another session sends such requests.
    fn company(
        &self,
        asked: Option<TeacherRequests>,
        mut hands: [OptionalDevice; 2],
    ) -> Result<(PeerSession, [OptionalDevice; 2]), SessionError> {
        let mut company = PeerSession::default();
        if let Some([first, second, window]) = asked {
            let wrap = |hand: OptionalDevice, by| hand.map(|device| Box::new(TeacherButtons::new(device, by)) as _);
            let [one, other] = hands;
            hands = [wrap(one, first), wrap(other, second)];
            company.asked = Some(window);
        }
        if let Some(name) = self.options.watch.as_deref().filter(|_| self.windowed()) {
            let teacher = Teacher::join(name);
            company.teacher = Some(teacher.map_err(|fault| SessionError::Usage(format!("--watch {name}: {fault}")))?);
        }
        Ok((company, hands))
    }

    fn loops(&self, run: Run<'_>, devices: Option<Devices>, picture: impl FnOnce(RenderInputs)) -> Outcome {
        match (&self.recording, devices) {
            (Some(recording), _) => {
                let end_ms = self.options.duration.map_or(f64::INFINITY, |s| 1e3 * s);
                let length_ms = lockstep::up_to(recording, end_ms).last().map_or(0.0, |tick| tick.time_ms);
                let film = self.windowed().then(|| self.film(Some(length_ms)));
                lockstep::run(run, (recording, end_ms), film, picture)
            }
            (None, Some(devices)) => threads::run(run, devices, self.pace(), picture),
            (None, None) => Outcome::default(),
        }
    }

    /// The film of the session's brain and of its skull, which nobody has drilled yet.
    fn film(&self, length_ms: Option<f64>) -> Filming {
        let rest = self.setup.scene.brain.as_ref().map(|brain| brain.mesh.positions.clone()).unwrap_or_default();
        Filming::new(self.setup.bone().cloned(), rest, length_ms)
    }

    /// Limits of a hand's device; the recorded ones, if none is open. A watcher's bone gives way as
    /// the trainee's does.
    fn limits(&self, hand: &OpenDevice, recorded: Option<&DeviceLimits>) -> DeviceLimits {
        let scale = if hand.watch.is_some() { self.options.device_scale } else { 1.0 };
        let of = |device: &dyn HapticDevice| DeviceLimits::of(&device.capabilities(), scale, self.options.force_scale);
        let device = hand.device.as_deref().filter(|_| self.watched.is_none());
        device.map_or_else(|| recorded.cloned().unwrap_or_default(), of)
    }

    /// Tool before the first reading of its device. A replay starts here too, because the first
    /// tick moves from here to the hand.
    fn start(&self) -> ToolSample {
        let script = Script::named(self.program.script(), &self.setup.scene.site, 1e4);
        let state = script.map_or_else(|_| ToolState::at(trepan_geometry::Pose::IDENTITY), |script| script.at(0.0));
        ToolSample { tick: 0, state, tool: self.program.tray()[0], slot: 0, drilling: false, second: None, idle: false }
    }

    fn graphics(&self, drawing: Option<Result<Gpu, GpuError>>) -> Result<Graphics, NoPicture> {
        if !self.windowed() && self.options.frames_per_second == 0.0 {
            return Err(NoPicture::NotRequested);
        }
        let gpu = drawing.unwrap_or_else(driver::open);
        Ok(Graphics::open(&self.setup, self.options.picture, gpu)?)
    }

    fn picture(
        &self,
        mut inputs: RenderInputs,
        graphics: &mut Result<Graphics, NoPicture>,
        pointer: Option<mouse::MouseHandle>,
        company: PeerSession,
        stop: &Stop,
    ) -> Album {
        let Some(painter) = graphics.as_mut().ok().and_then(|g| g.painter.take()) else {
            picture::wait(inputs, stop);
            return Album::default();
        };
        let Some(stage) = &self.place.window else {
            let folder = self.out.join("frames");
            return picture::draw(inputs, painter, &self.setup, self.options.frames_per_second, &folder, stop);
        };
        let opened = self.opened(stage);
        match (inputs.film.take(), &self.recording) {
            (Some(film), Some(recording)) => {
                let until_s = self.options.duration.unwrap_or(f64::INFINITY);
                player::show(*inputs.view.latest().0, film, painter, &opened, recording, until_s, stop)
            }
            _ => window::show(inputs, painter, &opened, pointer, company, stop),
        }
    }

    /// What the window needs of the session.
    fn opened<'a>(&'a self, stage: &'a Stage) -> window::SessionView<'a> {
        let is_knob = |device: &DeviceName| device.kind().name == spacemouse::DEVICE.name;
        window::SessionView {
            progress: &self.place.progress,
            stage,
            table: &self.setup,
            case: &self.case.name,
            out: &self.out,
            rate_hz: self.setup.operation.rate_hz,
            slot: self.options.first_slot,
            guide: self.lesson.clone().map(Guide::new),
            knob: ![Some(&self.device), self.second.as_ref()].into_iter().flatten().any(is_knob),
        }
    }

    /// Inserts sharp pictures of the opening and of faults, and the final colour maps, before the
    /// session's pictures.
    fn map(&self, album: &mut Album, recording: &Recording, end: &SolverOutcome) {
        let Some(painter) = &mut album.painter else { return };
        let folder = self.out.join("frames");
        // In a window the pictures of the session are as coarse as its frame rate wants.
        let sharp = painter.set_quality(false, 1.0).map_err(SessionError::from).map(|()| {
            let close = self.setup.close_pictures(painter, recording, end, &folder);
            close.into_iter().chain(self.setup.maps(painter, recording, &folder)).collect::<Vec<_>>()
        });
        let of_session = std::mem::take(&mut album.shots);
        match sharp {
            Ok(sharp) => sharp.into_iter().for_each(|shot| album.add(shot)),
            Err(fault) => album.add(Err(fault)),
        }
        album.shots.extend(of_session);
    }

    /// Pictures of the report: those of the session, then the overlay of CT and MRI.
    fn shots(&self, session: Vec<Shot>) -> Vec<Shot> {
        let caption = "overlay of CT and MRI: the bone's contour over the MRI (with --register: above as read, below as registered)";
        let fit = self.setup.scene.fit_png.clone().map(|png| Shot { caption: caption.into(), png });
        session.into_iter().chain(fit).collect()
    }

    fn pace(&self) -> Pace {
        let scripted = self.options.watch.is_none() && self.device.operation().is_some();
        let end_ms = self.options.duration.filter(|_| !scripted).map_or(f64::INFINITY, |s| 1e3 * s);
        Pace { tick_ms: self.tick_ms(), collision_ms: 1.0, end_ms }
    }

    fn tick_ms(&self) -> f32 {
        1e3 / self.setup.operation.rate_hz
    }

    fn header(&self, limits: &DeviceLimits, second: Option<&DeviceLimits>) -> SessionHeader {
        let config = SessionConfig {
            solver_run: self.setup.solver_name().into(),
            operation: self.setup.operation.clone(),
            device: limits.clone(),
            second_device: second.cloned(),
            ..self.setup.models.config(self.setup.ingredients())
        };
        SessionHeader {
            app: self.program.name().into(),
            version: env!("CARGO_PKG_VERSION").into(),
            case: self.case.name.clone(),
            seed: self.options.seed,
            hashes: self.case.hashes(),
            config: config.entries(),
        }
    }

    /// The part of the summary that is known without the outcome.
    fn about(&self, album: &Album) -> Summary {
        let brain = self.setup.scene.brain.as_ref();
        Summary {
            app: self.program.name().into(),
            version: env!("CARGO_PKG_VERSION").into(),
            hashes: self.case.hashes(),
            opening: Opening::of(&self.setup.plan),
            case: self.case.name.clone(),
            person: self.options.person.clone(),
            name: self.options.name.clone(),
            lesson: self.lesson.as_ref().map(|lesson| lesson.name.clone()),
            device: match (self.device.recording(), &self.options.watch) {
                (_, Some(_)) => "watch".into(),
                (Some(_), _) => "replay".into(),
                (None, _) => self.device.to_string(),
            },
            second: Some(SecondSummary {
                device: self.second.as_ref().map_or("replay".to_string(), DeviceName::to_string),
                ..SecondSummary::default()
            }),
            models: self.setup.models.summary(&self.setup.ingredients()),
            solver: Some(SolverSummary {
                name: self.setup.solver_name().into(),
                tets: brain.map_or(0, |brain| brain.mesh.tets.len()),
                nodes: brain.map_or(0, |brain| brain.mesh.positions.len()),
                fixed_nodes: self.setup.fixed_nodes(),
                ..SolverSummary::default()
            }),
            asked_hz: self.setup.operation.rate_hz.into(),
            frames: album.frames,
            fps: fps(album.frames, album.seconds),
            moving: album.moving.summary(),
            ..Summary::default()
        }
    }
}

/// Waits for the header of the session that is watched; a recording of nothing else.
fn watched(name: &str, case: &Identity, progress: &Progress) -> Result<Recording, SessionError> {
    let header = watch::header(name, || progress.is_over());
    let header = if progress.is_over() { Err(SessionError::Patient(PatientError::Cancelled)) } else { Ok(header?) }?;
    recordings::of_watched(name, header, case)
}

/// Finds the lesson that the options name, and takes its flap and tool.
fn lesson_of(program: Program, options: Options) -> Result<(Option<Lesson>, Options), SessionError> {
    let Some(name) = &options.lesson else { return Ok((None, options)) };
    let all = Lesson::of(program, Lesson::folder().as_deref());
    let names = || all.iter().map(|lesson| lesson.name.as_str()).collect::<Vec<_>>().join(", ");
    let unknown =
        || SessionError::Usage(format!("{} has no lesson {name}: --lesson takes {}", program.name(), names()));
    let lesson = all.iter().find(|lesson| lesson.name == *name).cloned().ok_or_else(unknown)?;
    let flap = options.flap.or(Some(lesson.flap_mm));
    let made = lesson.tumour_mm.map(|radius_mm| MadeTumour { centre: None, radius_mm });
    let patient = Patient { tumour: options.patient.tumour.or(made), ..options.patient.clone() };
    Ok((Some(lesson.clone()), Options { flap, patient, first_slot: lesson.slot, ..options }))
}

/// Device of a hand, if any.
type OptionalDevice = Option<Box<dyn HapticDevice>>;

/// Refuses output paths that cannot be written or that contain a session, before anything is
/// loaded.
fn check_outputs(options: &Options) -> Result<(), SessionError> {
    let usage = |fault: String| Err(SessionError::Usage(fault));
    let remedy = "name another, or give --overwrite to replace it";
    let out = options.out.as_deref();
    let there = out.and_then(|out| out.ancestors().find(|folder| folder.exists()));
    if let Some(file) = there.filter(|folder| !folder.is_dir()) {
        return usage(format!("--out: {} is a file: name a folder, new or old", file.display()));
    }
    if let Some(out) = out.filter(|out| !options.overwrite && output::holds_session(out)) {
        return usage(format!("--out {} holds a session already: {remedy}", out.display()));
    }
    let record = options.record.as_deref();
    let folder = record.and_then(Path::parent).filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        return usage(format!("--record: there is no folder {}; make it first", folder.display()));
    }
    if let Some(record) = record.filter(|record| record.exists() && (!options.overwrite || !record.is_file())) {
        return usage(format!("--record {} is there already: {remedy}", record.display()));
    }
    let source = options.device.as_deref().and_then(|name| name.strip_prefix("replay:"));
    let source = source.and_then(|source| Path::new(source).canonicalize().ok());
    let recording = out.map(|out| out.join(output::RECORDING));
    let mut written = [record, recording.as_deref()].into_iter().flatten();
    match written.any(|written| source.is_some() && written.canonicalize().ok() == source) {
        true => usage("--device: the replayed recording would be overwritten; name another --out".into()),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TissueSource;
    use clap::Parser;

    /// Bone voxels of a skull, also where it is cut.
    fn bone_of(skull: &BoneVolume) -> Vec<bool> {
        skull.snapshot().data.iter().map(|hu| *hu >= skull.isovalue()).collect()
    }

    /// A craniotomy of the built-in case by a device, without pictures.
    fn opened(home: &Path, out: &str, device: &str, seconds: f64) -> Session {
        let head = trepan_fixtures::case_head();
        let tissues = TissueSource::regions_of_aseg(head.aseg);
        let (ct, mri, labels) = (Some(head.ct), Some(head.mri), Some(head.labels));
        let built_in = Inputs { name: Some(head.name), ct, mri, labels, tissues, ..Inputs::default() };
        let fixed = ["x", "--headless", "--frames-per-second", "0", "--quality", "draft"];
        let mut options = Options::try_parse_from(fixed).unwrap();
        options.patient.cache = Some(home.join("cases"));
        (options.out, options.duration) = (Some(home.join(out)), Some(seconds));
        options.device = Some(device.into());
        Session::open(Program::Craniotomy, options, built_in).unwrap()
    }

    /// With `TREPAN_FILM_SECONDS` a session of that length, sought at ten times in any order.
    #[test]
    fn the_film_shows_the_skull_of_the_session_and_of_its_replay_at_any_time() {
        let home = tempfile::tempdir().unwrap();
        let longer = std::env::var("TREPAN_FILM_SECONDS").ok().and_then(|text| text.parse::<f64>().ok());
        let session = opened(home.path(), "live", "script:craniotomy", longer.unwrap_or(8.0));
        let skull = session.setup.bone().cloned().unwrap();
        let shown = BoneVolume::new(&skull.snapshot(), skull.isovalue()).unwrap();
        session.run().unwrap();
        let recorded = home.path().join("live").join(output::RECORDING);
        let header = Recording::open(&recorded).unwrap().header;
        let scene = trepan_link::read_scene(&output::scene_of(&recorded), &header).unwrap().unwrap();
        let base = View::at(
            ToolSample {
                tick: 0,
                state: ToolState::at(trepan_geometry::Pose::IDENTITY),
                tool: Program::Craniotomy.tray()[0],
                slot: 0,
                drilling: false,
                second: None,
                idle: false,
            },
            1.0,
        );
        let shots: Vec<_> = scene.into_iter().map(|record| filmed::Shot::of(record, base)).collect();
        let mut written = 0;
        let mut seek = |seconds: f64| {
            let start = std::time::Instant::now();
            let target = shots.partition_point(|shot| shot.view.time_ms <= 1e3 * seconds);
            (written..target).for_each(|at| _ = shots[at].write(&shown, true));
            (target..written).rev().for_each(|at| _ = shots[at].write(&shown, false));
            written = target;
            start.elapsed()
        };
        let mut random = fastrand::Rng::with_seed(3);
        let times = match longer {
            Some(length_s) => (0..10).map(|_| length_s * random.f64()).collect(),
            None => vec![3.7, 2.0, 5.1],
        };
        for seconds in times {
            let took = seek(seconds);
            let replay =
                opened(home.path(), &format!("replay-{seconds}"), &format!("replay:{}", recorded.display()), seconds);
            let again = replay.setup.bone().cloned().unwrap();
            replay.run().unwrap();
            let (film, replayed) = (bone_of(&shown), bone_of(&again));
            // A shot is up to 33 ms old.
            let other = film.iter().zip(&replayed).filter(|(a, b)| a != b).count();
            let gone = bone_of(&skull).len() - film.iter().filter(|bone| **bone).count();
            eprintln!("{seconds:.1} s: sought in {took:?}, {other} voxels differ");
            assert!(other <= 3 && gone > 0, "{other} voxels differ after {seconds} s");
        }
        seek(f64::INFINITY);
        assert!(shown.snapshot().data == skull.snapshot().data, "the same at the end, to the last digit");
    }
}
