//! Chooses the models of a session, with reasons: from the flags, else the recording, else the
//! preset or the plan for this machine.
//!
//! # Theory
//! Bone, tissue and picture are chosen independently. Given values of a part are kept; the others
//! are
//!
//! ```text
//! a replay         those in the recording's header
//! --quality NAME   those of the preset
//! auto             those of the plan, among the rows with the given values (trepan_budget)
//! ```
//!
//! # Practice
//! The choice is made once, at start. The machine is measured only for parts that a plan chooses,
//! in under two seconds. The case is measured once, in about 20 s. A replay, a preset or a session
//! with all values given measures nothing, so it is the same on every machine.

mod describe;
mod overrides;

use crate::config::SessionConfig;
use crate::error::SessionError;
use crate::operation::Operation;
use crate::options::{Options, Patient, Tolerances};
use overrides::{Overrides, written};
use trepan_budget::{Bone, Choice, Machine, Plan, Quality, Row, Rows, Scene, Setup, TissueForce};
use trepan_geometry::{ToolKind, units};
use trepan_models::ModelError;
use trepan_models::ingredients::{Element, Ingredients};
use trepan_models::measure::{self, CaseErrors, Parts, PlannedParts};
use trepan_patient::Recipe;
use trepan_patient::TissueClass;
use trepan_patient::import::Facts;
use trepan_report::uncertainty;
use trepan_soft::Material;
use trepan_stages::haptic_config::BONE_STIFFNESS;
use trepan_stages::program::Program;

/// The models of a session, with the reasons for them.
#[derive(Clone, Debug)]
pub struct Models {
    /// Models that run.
    pub setup: Setup,
    /// What they are made of.
    ingredients: Ingredients,
    /// Source of the choice: the name of a quality, or `replay`.
    pub by: &'static str,
    /// Reasons for the choice.
    pub why: Parts<String>,
    /// Given values, in words.
    pub given: Parts<Vec<String>>,
    /// Tolerances that no choice meets in real time on this machine.
    pub unmet: Vec<String>,
    /// The plan, if anything was planned.
    pub plan: Option<Plan>,
    /// Whether the errors were measured in this case.
    pub measured: Parts<bool>,
}

/// Request for a session's models, before its case is opened.
pub(crate) struct ModelRequest {
    program: Program,
    /// `None` for a replay.
    quality: Option<Quality>,
    given: Overrides,
    tolerances: Tolerances,
    young_mpa: f32,
    rate_hz: f32,
    /// Pixels of the picture; `None` without pictures.
    picture: Option<[u32; 2]>,
    /// Pictures per second of a film; `None` for a window.
    film_hz: Option<f64>,
}

impl ModelRequest {
    /// Request from the options and the replayed recording, if any; refuses unknown names.
    pub fn of(
        program: Program,
        options: &Options,
        operation: &Operation,
        recorded: Option<&SessionConfig>,
    ) -> Result<Self, SessionError> {
        let preset = options.quality.filter(|&quality| quality != Quality::Auto);
        let recorded = recorded.filter(|_| preset.is_none());
        let quality = if recorded.is_some() { None } else { Some(preset.unwrap_or_default()) };
        let given = match recorded {
            Some(config) => Overrides::recorded(config),
            None => Overrides::of(Ingredients::of(quality.unwrap_or_default())),
        };
        let pictures = !options.headless || options.frames_per_second > 0.0;
        Ok(Self {
            program,
            quality,
            given: given.with_flags(&options.patient, &options.given()?)?,
            tolerances: options.tolerances,
            young_mpa: units::mpa_from_kpa(operation.young_modulus_kpa),
            rate_hz: operation.rate_hz,
            picture: pictures.then_some(options.picture),
            film_hz: options.headless.then_some(if pictures { options.frames_per_second } else { LIVE_HZ }),
        })
    }

    /// Request for a plan without a session.
    pub fn to_plan(
        program: Program,
        patient: &Patient,
        tolerances: Tolerances,
        rate_hz: f32,
        picture: [u32; 2],
    ) -> Result<Self, SessionError> {
        Ok(Self {
            program,
            quality: Some(Quality::Auto),
            given: Overrides::of(Ingredients::of(Quality::Auto)).with_flags(patient, &[])?,
            tolerances,
            young_mpa: Material::BRAIN.young_mpa() as f32,
            rate_hz,
            picture: Some(picture),
            film_hz: None,
        })
    }

    /// Adds the values that a case folder was built with, which override all others.
    pub fn on(mut self, recipe: &Recipe) -> Self {
        let (given, spacing_mm) = (&mut self.given, written(recipe.spacing_mm));
        given.spacing_mm = Some(spacing_mm);
        (given.tets, given.halvings) = (Some(recipe.tets), Some(recipe.halvings));
        given.words.bone.push(format!("the case folder has voxels of {spacing_mm} mm"));
        given.words.tissue.push(format!("the case folder has {} tetrahedra", recipe.tets));
        self
    }

    /// Chooses the models for a case with these images. `card` returns whether a graphics card
    /// draws; it is called only if that matters. `case_errors` measures the errors of rows in this
    /// case; it is called only for a plan.
    pub fn settle(
        &self,
        facts: &Facts,
        card: impl FnOnce() -> bool,
        case_errors: impl FnOnce(&Scene, &Rows, Element) -> Result<CaseErrors, ModelError>,
    ) -> Result<Models, SessionError> {
        let (given, usual) = (&self.given, usual());
        let preset = self.quality.map_or(Some(usual), Quality::preset);
        let auto = preset.is_none();
        let Ingredients { rigid, solver, .. } = given.ingredients;
        let wanted = PlannedParts {
            bone: auto && self.program.has_bone() && (given.spacing_mm.is_none() || rigid.is_none()),
            tissue: auto && self.program.has_tissue() && (given.tets.is_none() || solver.is_none()),
            picture: auto && self.picture.is_some(),
        };
        let plan = wanted.any().then(|| self.plan(facts, wanted, wanted.picture && card(), case_errors)).transpose()?;
        let (plan, measured) = plan.unzip();
        let measured = measured.unwrap_or_default();
        let base = preset.unwrap_or_else(|| plan.as_ref().map_or(usual, |plan| of_parts(plan, wanted, usual)));
        let setup = Setup {
            bone: given.bone(base.bone),
            tissue: given.tissue(base.tissue),
            picture: given.picture.unwrap_or(base.picture),
        };
        let (why, unmet) = self.why(plan.as_ref(), wanted, measured);
        Ok(Models {
            setup,
            ingredients: given.ingredients.clone(),
            by: self.quality.map_or("replay", Quality::name),
            why,
            given: given.words.clone(),
            unmet,
            plan,
            measured,
        })
    }

    /// Measures machine and case, and plans the `wanted` parts among the rows that match the given
    /// values. Also returns which errors were measured in the case.
    fn plan(
        &self,
        facts: &Facts,
        wanted: PlannedParts,
        device_draws: bool,
        case_errors: impl FnOnce(&Scene, &Rows, Element) -> Result<CaseErrors, ModelError>,
    ) -> Result<(Plan, Parts<bool>), SessionError> {
        let internal = |fault: trepan_budget::PlanError| SessionError::Internal(format!("--quality auto: {fault}"));
        let solver_threads = self.given.ingredients.threads.map(|threads| threads as u32);
        let machine = measure::machine(wanted, device_draws, &self.given.ingredients);
        let (machine, mut rows) = (Machine { solver_threads, ..machine }, Rows::stored().map_err(internal)?);
        let near = |a: f64, all: &mut dyn Iterator<Item = f64>| {
            let off = |b: &f64| (a / b).ln().abs();
            all.min_by(|x, y| off(x).total_cmp(&off(y)))
        };
        let Overrides { spacing_mm, tets, halvings, ref ingredients, .. } = self.given;
        let &Ingredients { rigid, solver, .. } = ingredients;
        rows.bone.retain(|row| rigid.is_none_or(|method| row.what.method == method));
        let spacing_mm = spacing_mm.and_then(|mm| near(mm, &mut rows.bone.iter().map(|row| row.what.spacing_mm)));
        rows.bone.retain(|row| spacing_mm.is_none_or(|mm| row.what.spacing_mm == mm));
        rows.tissue.retain(|row| solver.is_none_or(|name| row.what.solver == name));
        let tets = tets.and_then(|n| near(n as f64, &mut rows.tissue.iter().map(|row| row.what.tets as f64)));
        rows.tissue.retain(|row| tets.is_none_or(|n| row.what.tets as f64 == n));
        let finest = rows.tissue.iter().map(|row| row.what.halvings).max();
        rows.tissue.retain(|row| halvings.is_none_or(|n| Some(row.what.halvings) == finest.map(|most| n.min(most))));
        let scene = self.scene(facts);
        let holds_walls = |row: &Row<Bone>| trepan_budget::holds_walls(&row.what, scene.tool_radius_mm);
        let scene = Scene {
            has_bone: wanted.bone && rows.bone.iter().any(holds_walls),
            has_tissue: wanted.tissue && !rows.tissue.is_empty(),
            ..scene
        };
        let mut asked = rows.clone();
        if !wanted.picture || device_draws {
            asked.picture.clear();
        }
        let case_errors = case_errors(&scene, &asked, self.given.ingredients.element)?;
        let plan = trepan_budget::plan_with(&machine, &scene, &case_errors.instead(rows, &scene)).map_err(internal)?;
        Ok((plan, case_errors.has()))
    }

    /// Requirements of the session, with the most demanding of the program's tools.
    fn scene(&self, facts: &Facts) -> Scene {
        let usual = Scene::default();
        let thinnest = |kind: ToolKind| {
            let of_kind = self.program.tray().iter().filter(|tool| tool.kind == kind);
            of_kind.map(|tool| f64::from(tool.tip_radius_mm)).reduce(f64::min)
        };
        let probe_radius_mm = thinnest(ToolKind::Probe).unwrap_or(usual.probe_radius_mm);
        Scene {
            force_error_n: self.tolerances.force_error_n.unwrap_or(usual.force_error_n),
            displacement_mm: self.tolerances.displacement_mm.unwrap_or(usual.displacement_mm),
            tissue_force_n: self.tolerances.tissue_force_n.unwrap_or(usual.tissue_force_n),
            picture_error_percent: self.tolerances.picture_error_percent.unwrap_or(usual.picture_error_percent),
            stiffness: BONE_STIFFNESS.into(),
            press_mm: PRESS_N / f64::from(BONE_STIFFNESS),
            tool_radius_mm: thinnest(ToolKind::Burr).unwrap_or(usual.tool_radius_mm),
            tissue_motion_mm: usual.tissue_motion_mm.min(3.0 * probe_radius_mm),
            probe_radius_mm,
            finest_mm: facts.ct_voxel_mm.unwrap_or(usual.finest_mm),
            brain_mm3: facts.brain_mm3.unwrap_or(usual.brain_mm3),
            material: TissueClass::Brain
                .material(self.young_mpa * self.given.ingredients.relaxation.hand_speed_factor()),
            device_rate_hz: self.rate_hz.into(),
            picture_pixels: self.picture.map_or(usual.picture_pixels, view_pixels),
            view_mm: VIEW_MM,
            pictures_per_s: self.film_hz.unwrap_or(LIVE_HZ),
            has_window: self.film_hz.is_none(),
            ..usual
        }
    }

    /// Reasons for each part, and the unmet tolerances.
    fn why(&self, plan: Option<&Plan>, wanted: PlannedParts, measured: Parts<bool>) -> (Parts<String>, Vec<String>) {
        let rest = match self.quality {
            None => "as recorded".into(),
            Some(Quality::Auto) => "as usual".into(),
            Some(preset) => format!("preset {}", preset.name()),
        };
        let mut unmet = Vec::new();
        let scene = plan.map_or_else(|| self.scene(&Facts::default()), |plan| plan.scene);
        let (bone, tissue) = (plan.and_then(|p| p.bone.as_ref()), plan.and_then(|p| p.tissue.as_ref()));
        let picture = plan.map(|p| &p.picture).filter(|_| wanted.picture);
        let mut part = |name: &str, words: &[String], reason: Option<(String, Option<String>)>| {
            if let Some((_, Some(short))) = &reason {
                unmet.push(format!("{name}: {short}"));
            }
            let reason = reason.map_or_else(|| rest.clone(), |(reason, _)| reason);
            words.iter().cloned().chain([reason]).collect::<Vec<_>>().join("; ")
        };
        let words = &self.given.words;
        let bone = bone.map(|choice| reason(choice, &scene, (scene.force_error_n, "N"), measured.bone));
        let tissue = tissue.map(|choice| reason(choice, &scene, (scene.displacement_mm, "mm"), measured.tissue));
        let picture =
            picture.map(|choice| reason(choice, &scene, (scene.picture_error_percent, "%"), measured.picture));
        let why = Parts {
            bone: part("bone", &words.bone, bone),
            tissue: part("tissue", &words.tissue, tissue),
            picture: part("picture", &words.picture, picture),
        };
        (why, unmet)
    }
}

impl Models {
    /// What the models are made of; the device as given.
    pub(crate) fn ingredients(&self) -> Ingredients {
        let Setup { bone, tissue, .. } = self.setup;
        Ingredients {
            rigid: Some(bone.method),
            rigid_points: Some(bone.points),
            solver: Some(tissue.solver),
            threads: self.ingredients.threads.or(self.plan.as_ref().map(|plan| plan.solver_threads as usize)),
            ..self.ingredients.clone()
        }
    }
}

/// Height of the 3-D view at the opening, mm.
const VIEW_MM: f64 = 105.0;

/// Frame rate of a window, Hz, numerical.
const LIVE_HZ: f64 = 20.0;

/// Force with which a hand presses a burr, N.
const PRESS_N: f64 = 1.0;

/// Default models: preset `usual`.
pub(crate) fn usual() -> Setup {
    Quality::Usual.preset().expect("only auto has none")
}

/// Setup of a plan; the picture is the default unless it was planned.
fn of_parts(plan: &Plan, wanted: PlannedParts, usual: Setup) -> Setup {
    let planned = plan.setup();
    Setup { picture: if wanted.picture { planned.picture } else { usual.picture }, ..planned }
}

/// Pixels of the 3-D view in a picture.
fn view_pixels(picture: [u32; 2]) -> [u32; 2] {
    let [_, _, width, height] = trepan_render::Layout::of(picture[0], picture[1], true).view;
    [width, height]
}

/// Reason for a choice, and in a short line what it misses: the tolerance or real time.
fn reason<T: std::fmt::Display>(
    choice: &Choice<T>,
    scene: &Scene,
    (tolerance, unit): (f64, &str),
    measured: bool,
) -> (String, Option<String>) {
    let Choice { error, force, cost, meets_tolerance, in_time, better, cheaper, .. } = choice;
    let why = match (in_time, meets_tolerance) {
        (true, true) => "the cheapest within the tolerance",
        (true, false) => "tolerance not met, the most accurate that runs in time",
        (false, _) => "too slow here, the cheapest there is",
    };
    let by = if measured { "in this case" } else { "in cases like this" };
    let of_force = |force: &TissueForce| {
        let TissueForce { error_n, force_n } = *force;
        let beside = uncertainty::beside(error_n, force_n);
        format!(", force {error_n:.3} N off of {:.3} allowed ({beside})", force.allowed_n(scene))
    };
    let force = force.as_ref().map(of_force).unwrap_or_default();
    let mut text = format!("{why}: error {by} {error:.3} {unit} of {tolerance} allowed{force}, {cost:.3} cores");
    for (label, neighbour) in [("better", better), ("cheaper", cheaper)] {
        if let Some(n) = neighbour {
            let late = if n.in_time { "" } else { ", too slow here" };
            text += &format!("; next {label} {}: {:.3} {unit}, {:.3} cores{late}", n.what, n.error, n.cost);
        }
    }
    let of_force = |force: &TissueForce| format!(", force {:.3} N of {:.3} N", force.error_n, force.allowed_n(scene));
    let of_force = choice.force.as_ref().map(of_force).unwrap_or_default();
    let missed = !(*in_time && *meets_tolerance);
    (text, missed.then(|| format!("{why} (error {error:.3} {unit} of {tolerance} {unit}{of_force})")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use trepan_budget::{Bone, Tissue};

    fn unmeasured(_: &Scene, _: &Rows, _: Element) -> Result<CaseErrors, ModelError> {
        Ok(CaseErrors::default())
    }

    fn request(line: &str, recorded: Option<&SessionConfig>) -> ModelRequest {
        let options = Options::try_parse_from(format!("x --headless {line}").split_whitespace()).unwrap();
        let operation = Operation::of(&options, &trepan_haptics::DeviceName::MOUSE, None);
        ModelRequest::of(Program::Integrated, &options, &operation, recorded).unwrap()
    }

    const FACTS: Facts = Facts { ct_voxel_mm: Some(1.0), brain_mm3: Some(1.2e6) };

    #[test]
    fn presets_and_flags_are_taken_without_a_measurement() {
        for quality in [Quality::Draft, Quality::Usual, Quality::Fine] {
            let models =
                request(&format!("--quality {}", quality.name()), None).settle(&FACTS, || false, unmeasured).unwrap();
            assert_eq!((Some(models.setup), models.plan.is_none()), (quality.preset(), true));
        }
        let models =
            request("--quality draft --tets 3000 --rigid thesis", None).settle(&FACTS, || false, unmeasured).unwrap();
        let draft = Quality::Draft.preset().unwrap();
        assert_eq!(models.setup.bone, Bone { method: "thesis", points: 0, ..draft.bone });
        assert_eq!(models.setup.tissue, Tissue { tets: 3000, ..draft.tissue });
        assert!(models.why.bone.contains("--rigid thesis is given; preset draft"), "{}", models.why.bone);
        let all = "--spacing-mm 0.7 --rigid thesis --tets 4000 --solver xpbd --frames-per-second 0";
        let models = request(all, None).settle(&FACTS, || false, unmeasured).unwrap();
        assert!(models.plan.is_none() && models.setup.bone.spacing_mm == 0.7 && models.setup.tissue.solver == "xpbd");
    }

    #[test]
    fn auto_plans_missing_values_and_gives_reasons() {
        let models = request("--spacing-mm 0.7 --tets 9000 --frames-per-second 0", None)
            .settle(&FACTS, || false, unmeasured)
            .unwrap();
        assert_eq!((models.setup.bone.spacing_mm, models.setup.tissue.tets), (0.7, 9000));
        let plan = models.plan.as_ref().unwrap();
        assert_eq!(plan.bone.unwrap().what.method, models.setup.bone.method);
        assert!(
            models.why.bone.contains("--spacing-mm 0.7 is given; ") && models.why.bone.contains(" N of 0.1 allowed")
        );
        assert_eq!(models.why.picture, "as usual", "no picture is drawn");
        assert_eq!(models.ingredients().threads, Some(plan.solver_threads as usize), "what is planned runs");
        let given =
            request("--set threads=3 --frames-per-second 0", None).settle(&FACTS, || false, unmeasured).unwrap();
        assert_eq!(
            (given.plan.as_ref().map(|plan| plan.solver_threads), given.ingredients().threads),
            (Some(3), Some(3))
        );
        let models =
            request("--rigid exposed-faces --frames-per-second 0", None).settle(&FACTS, || false, unmeasured).unwrap();
        let usual = Quality::Usual.preset().unwrap();
        let stands = Bone { method: "exposed-faces", points: 0, ..usual.bone };
        assert_eq!(models.setup.bone, stands, "a method without a proxy is not planned, but can be requested");
    }

    #[test]
    fn unmet_tolerances_are_reported_and_the_best_in_time_is_taken() {
        let models = request("--force-error-n 0.0001 --displacement-mm 0.0001", None)
            .settle(&FACTS, || false, unmeasured)
            .unwrap();
        assert!(models.unmet.len() >= 2 && models.unmet[0].contains("tolerance not met"), "{:?}", models.unmet);
        assert!(models.unmet.iter().all(|line| line.len() < 120), "{:?}", models.unmet);
        assert!(models.unmet[0].starts_with("bone: ") && models.unmet[1].starts_with("tissue: "));
    }

    #[test]
    fn a_replay_takes_what_was_recorded_and_measures_nothing() {
        let was = request("--quality fine --spacing-mm 0.85 --rigid thesis", None)
            .settle(&FACTS, || false, unmeasured)
            .unwrap();
        let recorded = was.config(was.ingredients());
        for line in ["", "--quality auto"] {
            let again = request(line, Some(&recorded)).settle(&FACTS, || false, unmeasured).unwrap();
            assert_eq!((again.setup, again.by, again.plan.is_none()), (was.setup, "replay", true));
        }
        let other =
            request("--tets 7000 --spacing-mm 2", Some(&recorded)).settle(&FACTS, || false, unmeasured).unwrap();
        assert_eq!((other.setup.tissue.tets, other.setup.bone.spacing_mm), (7000, 2.0));
        assert_eq!(other.setup.bone.method, "thesis");
        let draft = request("--quality draft", Some(&recorded)).settle(&FACTS, || false, unmeasured).unwrap();
        assert_eq!(Some(draft.setup), Quality::Draft.preset());
    }

    #[test]
    fn ingredients_are_given_recorded_and_overridden() {
        let settle = |line: &str, recorded: Option<&SessionConfig>| {
            request(line, recorded).settle(&FACTS, || false, unmeasured).unwrap()
        };
        let plain = settle("--quality usual", None).ingredients();
        assert_eq!(
            Ingredients { solver: None, rigid: None, rigid_points: None, ..plain.clone() },
            Ingredients::default()
        );
        let line = "--quality usual --set element=locking-free,threads=2,law.grey=ogden,shaft=on --set friction=0.1";
        let was = settle(line, None);
        let json = serde_json::to_value(was.summary(&was.ingredients())).unwrap()["ingredients"].clone();
        assert_eq!(
            (&json["element"], &json["threads"], &json["friction"]),
            (&"locking-free".into(), &"2".into(), &"0.1".into())
        );
        assert_eq!((&json["law"], &json["shaft"]), (&"neo-hookean+grey:ogden".into(), &"on".into()));
        assert_eq!(was.setup.bone.method, "god-object-sphere-shaft");
        assert!(was.why.tissue.contains("--set element=locking-free is given; "), "{}", was.why.tissue);
        let recorded = was.config(was.ingredients());
        assert_eq!(settle("", Some(&recorded)).ingredients(), was.ingredients());
        let other = settle("--set threads=1,shaft=off", Some(&recorded)).ingredients();
        let expected = Ingredients { threads: Some(1), rigid: Some("god-object-sphere"), ..was.ingredients() };
        assert_eq!(other, expected);
        assert_eq!(settle("--quality usual", Some(&recorded)).ingredients(), plain, "a preset overrides a recording");
    }

    #[test]
    fn what_relaxes_or_runs_on_the_card_never_sleeps() {
        let settle = |line: &str| request(line, None).settle(&FACTS, || false, unmeasured).unwrap();
        let config = |line: &str| settle(line).ingredients().config().still_mm;
        for key in ["relaxation=prony", "device=gpu"] {
            let line = format!("--quality usual --set still-mm=0.01 --set {key}");
            assert_eq!(config(&line), 0.0, "{key}");
        }
        assert_eq!(config("--quality usual --set still-mm=0.01"), 0.01);
    }

    #[test]
    fn an_ingredient_that_the_solver_lacks_is_refused_with_the_remedy() {
        let refused = |line: &str| {
            let options = Options::try_parse_from(format!("x --headless {line}").split_whitespace()).unwrap();
            let operation = Operation::of(&options, &trepan_haptics::DeviceName::MOUSE, None);
            ModelRequest::of(Program::Integrated, &options, &operation, None).err().map(|fault| fault.to_string())
        };
        let fault = refused("--solver xpbd --set element=locking-free").unwrap();
        assert_eq!(fault, "--set element=locking-free: xpbd has no element; give --solver tled");
        assert!(refused("--rigid thesis --set shaft=on").unwrap().starts_with("--set shaft=on: on is not known"));
        assert_eq!(refused("--solver xpbd --set element=plain,friction=0.1"), None);
    }

    #[test]
    fn a_case_folder_overrides_other_values() {
        let recipe = Recipe { spacing_mm: 0.8, tets: 6000, halvings: 1, ..Recipe::default() };
        let models = request("--quality fine", None).on(&recipe).settle(&FACTS, || false, unmeasured).unwrap();
        assert_eq!((models.setup.bone.spacing_mm, models.setup.tissue.tets), (0.8, 6000));
        assert_eq!(models.setup.tissue.halvings, 1);
        assert!(models.why.bone.contains("the case folder has voxels of 0.8 mm; preset fine"), "{}", models.why.bone);
    }
}
