//! What is filled in on the start page, and the options that follow from it.

use crate::desk::browse::Goal;
use crate::desk::language::Languages;
use crate::error::SessionError;
use crate::options::{Options, Patient};
use crate::settings::{Images, Recent, Settings, Source, sessions};
use std::path::{Path, PathBuf};
use trepan_budget::Quality;
use trepan_haptics::{Listed, script};
use trepan_patient::{TissueClass, TissueSource};
use trepan_stages::program::{Program, called};
use trepan_window::Choosable;

/// The start page as it is filled in.
#[derive(Clone, Debug, Default)]
pub(crate) struct Form {
    /// What is remembered.
    pub settings: Settings,
    /// The chosen case.
    pub case: Recent,
    /// Name of the session; empty for none.
    pub session: String,
    /// Languages of the window.
    pub languages: Languages,
    /// Devices of this machine.
    pub devices: Vec<Listed>,
    /// DICOM series of the chosen CT and MRI, in words; empty for files of other kinds.
    pub series: [Vec<String>; 2],
}

/// A demonstration by script: its name, what it shows.
const DEMONSTRATIONS: [(&str, &str); 4] = [
    ("", "the whole operation, by itself"),
    ("flap", "a bone flap is cut, by itself"),
    ("resect", "tissue is aspirated, by itself"),
    ("bleed", "a bleeding is stopped, by itself"),
];

impl Form {
    /// Reads the settings; the newest recent case is chosen, else the built-in one.
    pub fn read(built_in: Option<&str>) -> Self {
        let settings = Settings::read();
        let usual = Recent { name: built_in.unwrap_or("built-in case").into(), ..Recent::default() };
        let case = settings.recent.first().cloned().unwrap_or(usual);
        let mut form = Self { settings, languages: Languages::list(), ..Self::default() };
        form.choose(case);
        form
    }

    /// Names of the devices, as `--device` takes them, with what the page shows.
    pub fn devices(&self, program: Program) -> Vec<(String, Choosable)> {
        let choosable = |name: &str, hint: &str, open| Choosable { name: name.into(), hint: hint.into(), open };
        let mouse = ("mouse".to_string(), choosable("mouse", "the mouse moves the tool; walls are not felt", true));
        let demonstrations = DEMONSTRATIONS.iter().filter(|(name, _)| match *name {
            "flap" => program.has_bone(),
            "resect" | "bleed" => program.has_tissue(),
            _ => true,
        });
        let shown = demonstrations.map(|(name, hint)| {
            let script = if name.is_empty() { program.script() } else { name };
            (format!("script:{script}"), choosable(&format!("demonstration: {script}"), hint, true))
        });
        let is_real =
            |device: &&Listed| !["mouse", "script", "simulated", "replay"].iter().any(|k| device.name.starts_with(k));
        let real = self.devices.iter().filter(is_real).map(|device| {
            (device.name.clone(), choosable(&device.name, &device.state, device.state.starts_with("ready")))
        });
        debug_assert!(script::NAMES.contains(&program.script()));
        [mouse].into_iter().chain(real).chain(shown).collect()
    }

    /// Index of the chosen device.
    pub fn device(&self, program: Program) -> usize {
        self.devices(program).iter().position(|(name, _)| *name == self.settings.device).unwrap_or(0)
    }

    /// The tools that the operation can begin with.
    pub fn tools(program: Program) -> Vec<Choosable> {
        // A tool for the brain needs an open skull.
        let first = |tool: &trepan_geometry::Tool| program.has_bone() == tool.kind.cuts();
        let tools = program.tray().iter().filter(|tool| first(tool));
        tools.map(|tool| Choosable { name: called(tool), open: true, ..Choosable::default() }).collect()
    }

    /// Qualities, with what they mean.
    pub fn qualities() -> Vec<Choosable> {
        let hints = [
            "measures this machine and takes the best models that it can run",
            "for slow machines",
            "for most machines",
            "for fast machines",
        ];
        let of =
            |(quality, hint): (Quality, &str)| Choosable { name: quality.name().into(), hint: hint.into(), open: true };
        Quality::ALL.into_iter().zip(hints).map(of).collect()
    }

    /// Index of the chosen quality.
    pub fn quality(&self) -> usize {
        Quality::ALL.iter().position(|quality| quality.name() == self.settings.quality).unwrap_or(0)
    }

    /// Chooses a case, and lists the DICOM series of its images.
    pub fn choose(&mut self, case: Recent) {
        let list = |path: Option<&PathBuf>| -> Vec<String> {
            let found = path.and_then(|path| trepan_volume::dicom::series(path).ok()).unwrap_or_default();
            found.iter().map(ToString::to_string).collect()
        };
        self.series = match &case.source {
            Source::Images(Images { ct, mri, .. }) => [list(ct.as_ref()), list(mri.as_ref())],
            _ => Default::default(),
        };
        self.case = case;
    }

    /// Adds an image to the chosen case, or takes it away. Another CT is another patient: all that
    /// belonged to the case before is left behind.
    pub fn set_image(&mut self, goal: Goal, path: Option<PathBuf>) {
        let mut case = self.case.clone();
        let has_ct = matches!(&case.source, Source::Images(Images { ct: Some(_), .. }));
        if !matches!(case.source, Source::Images(_)) || goal == Goal::Ct && has_ct {
            let others = self.settings.recent.iter().filter(|recent| recent.name.starts_with("my case")).count();
            let name = if others == 0 { "my case".into() } else { format!("my case {}", others + 1) };
            case = Recent { name, source: Source::Images(Images::default()), ..Recent::default() };
        }
        let Source::Images(images) = &mut case.source else { return };
        let (place, series) = match goal {
            Goal::Ct => (&mut images.ct, Some(0)),
            Goal::Mri => (&mut images.mri, Some(1)),
            Goal::Labels => (&mut images.labels, None),
            Goal::Tumour => (&mut images.tumour, None),
            Goal::Case | Goal::Recording => return,
        };
        *place = path;
        series.into_iter().for_each(|at| images.series[at] = None);
        images.register &= images.mri.is_some();
        (case.hash, case.picture) = (String::new(), None);
        self.choose(case);
    }

    /// Changes how the images of the chosen case are imported; the case is built anew.
    pub fn set(&mut self, change: impl FnOnce(&mut Images)) {
        if let Source::Images(images) = &mut self.case.source {
            change(images);
            self.case.hash.clear();
        }
    }

    /// Why the session cannot begin yet; `None` if it can.
    pub fn lacks(&self, program: Program) -> Option<&'static str> {
        match &self.case.source {
            Source::Images(Images { ct: None, .. }) if program.has_bone() => Some("open the patient's CT first"),
            Source::Images(Images { mri: None, .. }) if program.has_tissue() => {
                Some("open an MRI too: this program needs the brain; craniotomy runs without one")
            }
            _ => None,
        }
    }

    /// The options of a session, on top of those that the program was started with.
    pub fn options(&self, base: &Options, program: Program) -> Result<Options, SessionError> {
        let mut options = base.clone();
        match &self.case.source {
            Source::BuiltIn => {}
            Source::Images(images) => {
                let tumour = images.tumour.clone().map(|path| TissueSource::all_of(TissueClass::Tumour, path));
                let [ct_series, mri_series] = images.series;
                options.patient = Patient {
                    ct: images.ct.clone(),
                    mri: images.mri.clone(),
                    labels: images.labels.clone(),
                    tissues: tumour.into_iter().collect(),
                    register: images.register,
                    ct_series: ct_series.filter(|_| images.ct.is_some()),
                    mri_series: mri_series.filter(|_| images.mri.is_some()),
                    isovalue_hu: images.isovalue_hu,
                    ..options.patient
                };
            }
            Source::Folder(folder) => options.case = Some(folder.clone()),
        }
        // A case folder has its opening already.
        options.patient.opening = self.case.opening.filter(|_| options.case.is_none()).or(base.patient.opening);
        options.device = self.devices(program).get(self.device(program)).map(|(name, _)| name.clone());
        options.quality = Some(Quality::ALL[self.quality()]);
        if self.settings.flap_mm > 0.0 && program.has_bone() {
            options.flap = Some(self.settings.flap_mm);
        }
        if program.has_bone() && !self.case.flap_line.is_empty() {
            options.flap_line.clone_from(&self.case.flap_line);
        }
        options.first_slot = self.settings.tool.min(Self::tools(program).len().saturating_sub(1));
        options.person = Some(self.settings.person.clone()).filter(|person| !person.trim().is_empty());
        options.name = Some(self.session.clone()).filter(|name| !name.trim().is_empty());
        options.sessions = Some(sessions());
        options.check()?;
        Ok(options)
    }

    /// The options that replay a recording.
    pub fn replay(&self, base: &Options, program: Program, recording: &Path) -> Result<Options, SessionError> {
        let options = self.options(base, program)?;
        let device = Some(format!("replay:{}", recording.display()));
        Ok(Options { device, quality: base.quality, flap: base.flap, flap_line: base.flap_line.clone(), ..options })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[test]
    fn one_patient_at_a_time() {
        let mut form = Form::default();
        form.set_image(Goal::Ct, Some("a/ct.nii".into()));
        form.set_image(Goal::Mri, Some("a/t1.nii".into()));
        form.set_image(Goal::Tumour, Some("a/seg.nii".into()));
        (form.case.opening, form.case.hash) = (Some([1.0; 3]), "abc".into());
        form.settings.recent = vec![form.case.clone()];
        form.set_image(Goal::Ct, Some("b/ct.nii".into()));
        let only_ct = Images { ct: Some("b/ct.nii".into()), ..Images::default() };
        let new = Recent { name: "my case 2".into(), source: Source::Images(only_ct), ..Recent::default() };
        assert_eq!(form.case, new, "nothing of the patient before");
        form.set_image(Goal::Mri, Some("b/t1.nii".into()));
        form.set_image(Goal::Mri, None);
        assert_eq!(form.case, new, "an MRI can be taken away");
        form.case = Recent::default();
        form.set_image(Goal::Mri, Some("c/t1.nii".into()));
        form.set_image(Goal::Ct, Some("c/ct.nii".into()));
        assert!(matches!(&form.case.source, Source::Images(Images { mri: Some(_), ct: Some(_), .. })), "MRI first");
    }

    #[test]
    fn the_form_becomes_the_flags_of_a_session() {
        let base = Options::try_parse_from(["x", "--csf-loss", "0.1"]).unwrap();
        let mut form = Form::default();
        let usual = form.options(&base, Program::Integrated).unwrap();
        assert_eq!((usual.device.as_deref(), usual.quality, usual.flap), (Some("mouse"), Some(Quality::Auto), None));
        assert_eq!((usual.csf_loss, usual.person), (Some(0.1), None));
        form.settings.device = "script:flap".into();
        (form.settings.flap_mm, form.settings.person) = (30.0, "Ada".into());
        let images = Images { ct: Some("ct".into()), register: true, isovalue_hu: Some(500), ..Images::default() };
        form.case.source = Source::Images(images);
        assert!(form.lacks(Program::Integrated).is_some() && form.lacks(Program::Craniotomy).is_none());
        let given = form.options(&base, Program::Integrated).unwrap();
        assert_eq!(
            (given.device.as_deref(), given.flap, given.patient.register, given.patient.isovalue_hu),
            (Some("script:flap"), Some(30.0), true, Some(500))
        );
        let (opening, flap_line) = (Some([0.0; 3]), vec![[1.0; 3]; 3]);
        form.case = Recent { source: Source::Folder("c".into()), opening, flap_line, ..Recent::default() };
        let folder = form.options(&base, Program::Integrated).unwrap();
        assert_eq!((folder.case, folder.patient.opening, folder.flap_line.len()), (Some("c".into()), None, 3));
        let replay = form.replay(&base, Program::Integrated, Path::new("a.mcap")).unwrap();
        assert_eq!((replay.device.as_deref(), replay.flap), (Some("replay:a.mcap"), None));
        assert!(replay.flap_line.is_empty(), "a recording brings its own");
    }
}
