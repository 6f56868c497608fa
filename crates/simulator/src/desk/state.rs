//! What the window shows, and what its controls do.

use crate::Inputs;
use crate::batch;
use crate::choice::case_to_check;
use crate::compare::compare;
use crate::desk::action::Action;
use crate::desk::browse::{self, Folder, Goal};
use crate::desk::check::Check;
use crate::desk::draft::{self, DraftView};
use crate::desk::form::Form;
use crate::desk::job::{Done, Job, Work};
use crate::desk::pages;
use crate::desk::pictures::Pictures;
use crate::desk::results::{self, Sessions};
use crate::error::SessionError;
use crate::options::Options;
use crate::session::{Place, Session};
use crate::settings::{Recent, Source, sessions};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use trepan_gpu::{Gpu, GpuError};
use trepan_haptics::Listed;
use trepan_patient::Cache;
use trepan_patient::progress::Progress;
use trepan_patient::{Case, PatientError};
use trepan_report::kept::SessionFolder;
use trepan_report::training::Lesson;
use trepan_runtime::stop::Stop;
use trepan_stages::program::Program;
use trepan_window::{Content, Host, Page, Stage, speak};

/// What the window shows.
enum View {
    /// The start page.
    Start,
    /// A folder in which something is looked for.
    Browse(Goal, Folder, String),
    /// The sessions that were kept.
    Sessions(Box<Sessions>),
    /// A page that does not change.
    Page(Box<Page<Action>>),
    /// A case in pictures, and why the last click did nothing.
    Check(Box<Check>, Option<&'static str>),
    /// A session that is loading, running or writing; its case's name.
    Session(Job, String),
    /// Nothing more.
    Closed,
}

/// Picture of a session before it begins, in its folder.
const PICTURE: &str = "frames/frame-before.png";

/// The program behind the window.
pub(crate) struct App {
    program: Program,
    base: Options,
    built_in: Inputs,
    pub(super) form: Form,
    view: View,
    stage: Stage,
    device: Result<Gpu, GpuError>,
    /// Whether the program was started for one session.
    direct: bool,
    pub(super) last: Option<Result<Done, SessionError>>,
    /// Folder of the session whose replay is shown, from its result.
    viewed: Option<PathBuf>,
    /// Dropped files and folders that still need a purpose.
    waiting: Vec<PathBuf>,
    devices: Receiver<Vec<Listed>>,
    /// Pages on what failed beside the window.
    failed: (Sender<Page<Action>>, Receiver<Page<Action>>),
    stop: Stop,
    pictures: Pictures,
}

impl App {
    /// Shows the start page.
    pub fn new(
        program: Program,
        base: Options,
        built_in: Inputs,
        (stage, device): (Stage, Result<Gpu, GpuError>),
        stop: Stop,
    ) -> Self {
        let (sender, devices) = channel();
        // Looking for hardware may wait for its drivers. Nobody listens once the window is closed.
        std::thread::spawn(move || _ = sender.send(trepan_haptics::list()));
        let mut form = Form::read(built_in.name);
        form.settings.language = base.language.clone().unwrap_or(form.settings.language);
        speak(form.languages.get(&form.settings.language));
        let (view, direct, last) = (View::Start, false, None);
        Self {
            program,
            base,
            built_in,
            form,
            view,
            stage,
            device,
            direct,
            last,
            viewed: None,
            waiting: Vec::new(),
            devices,
            failed: channel(),
            stop,
            pictures: Pictures::default(),
        }
    }

    /// Begins the session, or the batch of replays, that the flags name.
    pub fn begin_directly(mut self) -> Self {
        self.direct = true;
        let (program, options, built_in) = (self.program, self.base.clone(), self.built_in.clone());
        let work: Work = match batch::recordings(&options) {
            Err(fault) => {
                self.fail(fault);
                return self;
            }
            Ok(Some(files)) => Box::new(move |place| {
                let failures = batch::run(program, &options, &built_in, &files, &place);
                Ok(Done::Batch([failures, files.len()]))
            }),
            Ok(None) => session(program, options, built_in),
        };
        let name = self.built_in.name.unwrap_or("the session").to_string();
        self.start(work, name, false, Progress::default());
        self
    }

    /// Ends what runs, and returns what the last session came to. Called when the window is closed.
    pub fn end(self) -> (Option<Job>, Form, Option<Result<Done, SessionError>>) {
        let job = match self.view {
            View::Session(job, _) => Some(job),
            _ => None,
        };
        job.iter().filter(|job| !job.is_running()).for_each(Job::cancel);
        (job, self.form, self.last)
    }

    fn start(&mut self, work: Work, name: String, again: bool, progress: Progress) {
        let place = Place { window: Some(self.stage.clone()), drawing: Some(self.device.clone()), progress };
        self.view = View::Session(Job::start(work, place, again), name);
    }

    /// Begins a session with what is filled in.
    fn begin(&mut self, options: Result<Options, SessionError>) {
        let options = match options {
            Ok(options) => options,
            Err(fault) => return self.fail(fault),
        };
        let Recent { name, hash, .. } = self.form.case.clone();
        let cache = Cache::of(options.patient.cache.clone()).ok();
        let cached = cache.filter(|_| !hash.is_empty()).and_then(|cache| cache.find(&hash));
        let (again, progress) = (cached.is_some(), Progress::default());
        if self.program.has_bone() {
            let (stage, device, name) = (self.stage.clone(), self.device.clone(), name.clone());
            let (loading, read) = (progress.clone(), progress.awaits_skull());
            std::thread::spawn(move || {
                let looked = cached.map_or_else(|| Ok(DraftView::read(&read)), |folder| DraftView::cached(&folder));
                let shown = looked.and_then(|looked| match looked {
                    Some(looked) => draft::show(looked, name, device, (&stage, &loading)),
                    None => Ok(false),
                });
                shown.err().into_iter().for_each(|fault| tracing::debug!("no draft of the scene: {fault}"));
            });
        }
        self.start(session(self.program, options, self.built_in.clone()), name, again, progress);
    }

    /// Takes what an ended job came to.
    fn take(&mut self, done: Result<Done, SessionError>) {
        if let Ok(Done::Case(case)) = done {
            return self.look_at(*case);
        }
        self.view = match &done {
            Err(SessionError::Patient(PatientError::Cancelled)) => View::Start,
            Err(fault) => View::Page(Box::new(pages::fault(fault, &self.form.case.source))),
            Ok(_) if self.direct => View::Closed,
            Ok(Done::Viewed) => match self.viewed.take() {
                Some(folder) => View::Page(Box::new(results::page(&folder, &self.kept(), &lessons()))),
                None => View::Start,
            },
            Ok(Done::Batch(_) | Done::Case(_)) => View::Start,
            Ok(Done::Session(ended)) => {
                self.form.case.hash = ended.case.clone().unwrap_or_default();
                self.form.case.picture = Some(ended.out.join(PICTURE));
                self.form.settings.remember(self.form.case.clone());
                View::Page(Box::new(results::page(&ended.out, &self.kept(), &lessons())))
            }
        };
        self.keep();
        self.direct = false;
        self.last = Some(done);
    }

    /// Shows a case in pictures.
    fn look_at(&mut self, case: Case) {
        let Recent { name, opening, flap_line, .. } = self.form.case.clone();
        match Check::of(case, name, (opening, &flap_line), self.device.clone()).map(|check| check.of_images(&self.form))
        {
            Ok(check) => self.view = View::Check(Box::new(check), None),
            Err(fault) => self.fail(fault),
        }
    }

    /// Loads the chosen case to look at it.
    fn check(&mut self) {
        let options = match self.form.options(&self.base, self.program) {
            // A place that was chosen before may not fit: the case is looked at without it.
            Ok(options) => options,
            Err(fault) => return self.fail(fault),
        };
        let Recent { name, hash, .. } = self.form.case.clone();
        let (program, built_in, progress) = (self.program, self.built_in.clone(), Progress::default());
        let loading = progress.clone();
        let work: Work = Box::new(move |_| {
            let case = case_to_check(program, &options, built_in, &hash, &loading)?;
            Ok(Done::Case(Box::new(case)))
        });
        self.start(work, name, true, progress);
    }

    fn fail(&mut self, fault: SessionError) {
        self.view = View::Page(Box::new(pages::fault(&fault, &self.form.case.source)));
        self.last = Some(Err(fault));
    }

    /// Keeps the settings.
    fn keep(&self) {
        self.form.settings.write().err().into_iter().for_each(|fault| tracing::warn!("settings: {fault}"));
    }

    fn kept(&self) -> Vec<SessionFolder> {
        SessionFolder::list(&[sessions(), PathBuf::from("trepan-out")])
    }

    fn browse(&mut self, goal: Goal, path: &Path) {
        let folder = Folder::list(path, goal);
        let written = path.display().to_string();
        self.view = View::Browse(goal, folder, written);
    }

    /// Takes what was dropped, until one needs the user to say what it is.
    fn take_waiting(&mut self) {
        while let Some(path) = self.waiting.pop() {
            match browse::purpose(&path) {
                Some(goal) => self.take_path(goal, path),
                None => return self.view = View::Page(Box::new(pages::sort(&path))),
            }
            if matches!(self.view, View::Session(..)) {
                self.waiting.clear();
            }
        }
    }

    fn take_path(&mut self, goal: Goal, path: PathBuf) {
        self.form.settings.folder = path.parent().map(PathBuf::from);
        self.view = View::Start;
        match goal {
            Goal::Recording => {
                self.viewed = None;
                self.begin(self.form.replay(&self.base, self.program, &path));
            }
            Goal::Case => {
                let source = Source::Folder(path);
                self.form.choose(Recent { name: "case folder".into(), source, ..Recent::default() });
            }
            Goal::Ct | Goal::Mri | Goal::Labels | Goal::Tumour => self.form.set_image(goal, Some(path)),
        }
    }

    /// Replays a session on its case, which is a recent one or the built-in one.
    fn replay(&mut self, recording: &Path) {
        let name = SessionFolder::of(recording.parent().unwrap_or(recording)).map(|kept| kept.case);
        let is =
            |case: &&Recent| name.as_ref().is_some_and(|name| case.hash.get(..8).is_some_and(|h| name.ends_with(h)));
        let built_in = || Recent { name: self.built_in.name.unwrap_or_default().into(), ..Recent::default() };
        self.form.choose(self.form.settings.recent.iter().find(is).cloned().unwrap_or_else(built_in));
        self.begin(self.form.replay(&self.base, self.program, recording));
    }
}

/// Lessons of all programs, by which sessions are named.
fn lessons() -> Vec<Lesson> {
    Lesson::all(Lesson::folder().as_deref())
}

/// The work of one session.
fn session(program: Program, options: Options, built_in: Inputs) -> Work {
    Box::new(move |place| {
        let session = Session::open_in(program, options, built_in, place)?;
        if session.is_viewed() {
            return session.view().map(|()| Done::Viewed);
        }
        Ok(Done::Session(Box::new(session.run()?)))
    })
}

impl Host for App {
    type Action = Action;

    fn shown(&mut self, guest: bool) -> Content<Action> {
        self.form.devices.extend(self.devices.try_iter().flatten());
        if let Some(page) = self.failed.1.try_iter().last() {
            self.view = View::Page(Box::new(page));
        }
        if self.stop.asked() && !matches!(self.view, View::Session(..)) {
            return Content::Nothing;
        }
        if let View::Session(job, _) = &self.view
            && job.is_done()
            && let View::Session(job, _) = std::mem::replace(&mut self.view, View::Start)
        {
            let done = job.end(&mut self.form.settings);
            self.take(done);
        }
        match &self.view {
            View::Start => {
                Content::Page(Box::new(pages::start(self.program, &self.form, self.pictures.of(&self.form.case))))
            }
            View::Browse(goal, folder, written) => Content::Page(Box::new(pages::browse(*goal, folder, written))),
            View::Sessions(sessions) => Content::Page(Box::new(sessions.page())),
            View::Page(page) => Content::Page(page.clone()),
            View::Check(check, fault) => Content::Page(Box::new(check.page(*fault, &self.form))),
            View::Session(job, name) => match (job.is_running(), guest) {
                (true, true) => Content::Session(None),
                (true, false) => Content::Page(Box::new(pages::writing())),
                (false, true) => {
                    Content::Session(Some(Box::new(pages::loading(name, job.loaded(&self.form.settings)))))
                }
                (false, false) => Content::Page(Box::new(pages::loading(name, job.loaded(&self.form.settings)))),
            },
            View::Closed => Content::Nothing,
        }
    }

    fn act(&mut self, action: Action) {
        let (form, settings) = (&mut self.form, |form: &mut Form| form.settings.clone());
        let before = settings(form);
        match action {
            Action::Home => self.view = View::Start,
            Action::BuiltIn => {
                let usual = Recent { name: self.built_in.name.unwrap_or_default().into(), ..Recent::default() };
                let known = form.settings.recent.iter().find(|recent| recent.source == Source::BuiltIn).cloned();
                form.choose(known.unwrap_or(usual));
            }
            Action::Recent(at) => form.choose(form.settings.recent.get(at).cloned().unwrap_or_default()),
            Action::Remove(goal) => form.set_image(goal, None),
            Action::Forget(at) if at < form.settings.recent.len() => _ = form.settings.recent.remove(at),
            Action::Forget(_) => {}
            Action::Name(name) => form.case.name = name,
            Action::Register(at) => form.set(|images| images.register = at == 1),
            Action::CtSeries(at) => form.set(|images| images.series[0] = at.checked_sub(1)),
            Action::MriSeries(at) => form.set(|images| images.series[1] = at.checked_sub(1)),
            Action::Isovalue(hu) => form.set(|images| images.isovalue_hu = (hu > 0.0).then_some(hu as i16)),
            Action::UsualOpening => {
                (form.case.opening, form.case.flap_line) = (None, Vec::new());
                form.case.hash.clear();
            }
            Action::RoundFlap if !matches!(self.view, View::Check(..)) => form.case.flap_line.clear(),
            Action::Session(name) => form.session = name,
            Action::Person(name) => form.settings.person = name,
            Action::Device(at) => {
                form.settings.device =
                    form.devices(self.program).get(at).map(|device| device.0.clone()).unwrap_or_default();
            }
            Action::Tool(at) => form.settings.tool = at,
            Action::Quality(at) => {
                form.settings.quality = Form::qualities().get(at).map(|q| q.name.clone()).unwrap_or_default();
            }
            Action::Language(at) => {
                form.settings.language = form.languages.codes().nth(at).unwrap_or_default().into();
                speak(form.languages.get(&form.settings.language));
            }
            Action::Flap(mm) => form.settings.flap_mm = mm,
            Action::Browse(goal) => {
                let folder = form.settings.folder.clone().filter(|folder| folder.is_dir());
                let folder = folder.or_else(std::env::home_dir).unwrap_or_else(|| "/".into());
                self.browse(goal, &folder);
            }
            other => self.leave(other),
        }
        if before != self.form.settings {
            self.keep();
        }
    }

    fn dropped(&mut self, paths: Vec<PathBuf>) {
        if matches!(self.view, View::Session(..)) {
            return;
        }
        self.waiting = browse::together(paths);
        self.take_waiting();
    }

    fn hovered(&self) -> String {
        match self.view {
            View::Session(..) => "A session runs: end it first, then drop the file on the start page".into(),
            _ => "Let go here: a CT, an MRI, the folder of a DICOM series, a case folder or a recording".into(),
        }
    }
}

impl App {
    /// The lessons of the program.
    fn lessons(&self) -> Vec<Lesson> {
        Lesson::of(self.program, Lesson::folder().as_deref())
    }

    /// Does what changes the pictures of a case.
    fn look(&mut self, action: Action) {
        let View::Check(check, fault) = &mut self.view else { return };
        let done = match action {
            Action::OpenAt(at) => check.open_at(at).map(|found| {
                *fault =
                    (!found).then_some("There is no bone under this click: turn the head, then click on the skull");
            }),
            Action::Drag(drag) => check.drag(drag).map(|refused| *fault = refused.or(fault.filter(|_| !drag.begins))),
            Action::Draw(at) => {
                check.draws = at == 1;
                Ok(())
            }
            Action::RoundFlap => {
                check.line.clear();
                Ok(())
            }
            Action::Blend(share) => {
                check.blend(share);
                Ok(())
            }
            Action::Slide(axis, mm) => {
                check.slide(axis, mm);
                Ok(())
            }
            Action::Cross(plane, at) => {
                check.cross_at(plane, at);
                Ok(())
            }
            Action::Turn(plane, notches) => {
                check.page_through(plane, notches);
                Ok(())
            }
            _ => Ok(()),
        };
        self.form.case.flap_line = check.line.iter().map(|point| point.to_array()).collect();
        if self.form.case.opening != check.opening {
            self.form.case.opening = check.opening;
            // The case is built anew for another opening.
            self.form.case.hash.clear();
        }
        done.err().into_iter().for_each(|fault| self.fail(fault));
    }

    /// Does what is done with the sessions that were kept.
    fn list(&mut self, action: Action) {
        match (action, &mut self.view) {
            (Action::Only(words), View::Sessions(sessions)) => sessions.only = words,
            (Action::Compare(folder), View::Sessions(sessions)) => {
                let both = sessions.compares(folder);
                both.into_iter().for_each(|both| self.compare(both));
            }
            _ => {
                let sessions = Sessions::of(&self.kept(), &lessons(), &self.form.settings.recent);
                self.view = View::Sessions(Box::new(sessions));
            }
        }
    }

    /// Does what leads to another page.
    fn leave(&mut self, action: Action) {
        match action {
            Action::Into(path) => {
                if let View::Browse(goal, ..) = self.view {
                    self.browse(goal, &path);
                }
            }
            Action::Path(text) => {
                if let View::Browse(goal, folder, written) = &mut self.view {
                    let path = PathBuf::from(&text);
                    if path.is_dir() {
                        *folder = Folder::list(&path, *goal);
                    }
                    *written = text;
                }
            }
            Action::Take(goal, path) => {
                self.take_path(goal, path);
                self.take_waiting();
            }
            Action::Begin => self.begin(self.form.options(&self.base, self.program)),
            Action::Cancel => {
                if let View::Session(job, _) = &self.view {
                    job.cancel();
                    self.view = View::Start;
                }
            }
            Action::Lessons => {
                let (closed, person) = (self.form.lacks(self.program), &self.form.settings.person);
                self.view = View::Page(Box::new(results::lessons(&self.lessons(), &self.kept(), person, closed)));
            }
            Action::Lesson(at) => {
                let options = self.form.options(&self.base, self.program);
                let lesson = self.lessons().get(at).map(|lesson| lesson.name.clone());
                // The lesson brings its own flap.
                self.begin(options.map(|options| Options {
                    lesson,
                    flap: self.base.flap,
                    flap_line: Vec::new(),
                    ..options
                }));
            }
            Action::Check => self.check(),
            Action::OpenAt(_) | Action::Drag(_) | Action::Draw(_) | Action::RoundFlap => self.look(action),
            Action::Blend(_) | Action::Slide(..) | Action::Cross(..) | Action::Turn(..) => self.look(action),
            Action::Sessions | Action::Only(_) | Action::Compare(_) => self.list(action),
            Action::Result(folder) => {
                self.view = View::Page(Box::new(results::page(&folder, &self.kept(), &lessons())))
            }
            Action::Report(folder) => self.open(&folder.join("report.html")),
            Action::Open(folder) => self.open(&folder),
            Action::Replay(folder) => {
                self.viewed = Some(folder.clone());
                self.replay(&folder.join("session.mcap"));
            }
            Action::Close => self.view = View::Closed,
            _ => {}
        }
    }
}

/// Programs that open files as the desktop does.
const OPENER: &str = if cfg!(target_os = "macos") {
    "open"
} else if cfg!(windows) {
    "explorer"
} else {
    "xdg-open"
};

impl App {
    /// Opens a page or a folder as the desktop does; says so where that fails.
    fn open(&self, path: &Path) {
        let (path, failed) = (path.to_owned(), self.failed.0.clone());
        // The desktop may take its time to find out that it cannot.
        std::thread::spawn(move || open(&path, &failed));
    }

    /// Compares two sessions on a page of its own folder, and opens it.
    fn compare(&self, [first, second]: [PathBuf; 2]) {
        let name = |folder: &Path| folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let out = sessions().join("comparisons").join(format!("{}-with-{}", name(&first), name(&second)));
        let (source, failed) = (self.form.case.source.clone(), self.failed.0.clone());
        // A minute of a recording takes a second.
        std::thread::spawn(move || {
            let [first, second] = [first, second].map(|folder| folder.join("session.mcap"));
            match compare([&first, &second], &out) {
                Ok(page) => open(&page, &failed),
                Err(fault) => _ = failed.send(pages::fault(&fault, &source)),
            }
        });
    }
}

/// Opens a file as the desktop does, and waits for it.
fn open(path: &Path, failed: &Sender<Page<Action>>) {
    let mut command = Command::new(OPENER);
    let quiet = command.arg(path).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let fault = match quiet.status() {
        Ok(status) if status.success() => return,
        Ok(status) => format!("{OPENER} ended with {status}"),
        Err(fault) => format!("{OPENER}: {fault}"),
    };
    tracing::warn!("{fault}; open {} by hand", path.display());
    // Nobody listens once the window is closed.
    _ = failed.send(pages::unopened(path));
}
