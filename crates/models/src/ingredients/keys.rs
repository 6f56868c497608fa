//! The table of keys that `--set` takes, and what derives from it: parsing, lists, the user guide.

use super::{Element, Ingredients, Law, Relaxation, SolverDevice, Support};
use crate::methods;
use clap::ValueEnum;
use trepan_budget::Quality;
use trepan_measurements::brain_membranes;
use trepan_patient::TissueClass;
use trepan_rigid::{Extent, god_object_sphere};

/// One ingredient of the models.
pub struct Key {
    /// Name in `--set`, and in a recording's header.
    pub name: &'static str,
    /// Known values, in words.
    pub values: fn() -> String,
    /// What it does.
    pub about: &'static str,
    /// Value of a session without `--set`; `None` where `--quality` chooses.
    pub usual: Option<&'static str>,
    /// Why no quality takes another value than the default, though one changes more or realism asks
    /// for it.
    pub left_out: Option<&'static str>,
    /// Model that it belongs to.
    pub part: Part,
    /// Values to compare with the default, the most telling first; empty where none means anything
    /// alone.
    pub compared: fn() -> Vec<String>,
    /// Value that physical realism asks for, where that is not the default.
    pub realistic: Option<&'static str>,
    /// What a value changes.
    pub effect: fn(&str) -> Effect,
    get: fn(&Ingredients) -> Option<String>,
    set: fn(&mut Ingredients, &str) -> Option<()>,
}

/// What another value of a key may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Forces and motions: another model.
    Model,
    /// Cost, and forces and motions by rounding.
    Rounding,
    /// Cost alone: forces and motions are the same bit for bit.
    Cost,
}

/// A model of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Contact with bone.
    Bone,
    /// Tissue, whatever its solver.
    Tissue,
    /// Tissue with the solver `tled` alone.
    Tled,
}

/// Every key. One that is a shorthand for another stands after it.
pub const KEYS: &[Key] = &[
    Key {
        name: "rigid",
        values: || list(methods::bone_contacts().iter().map(|method| method.name())),
        about: "method of contact with bone; as `--rigid`",
        compared: || {
            let usual = [god_object_sphere::METHOD.name, god_object_sphere::WITH_SHAFT.name];
            let rivals = methods::bone_contacts().into_iter().filter(|method| !usual.contains(&method.name()));
            rivals.filter(|method| !method.descriptor().is_oracle).map(|method| method.name().into()).collect()
        },
        get: |i| i.rigid.map(String::from),
        set: |i, text| {
            i.rigid = Some(methods::bone_contact(text)?.name());
            i.rigid_points = Some(0);
            Some(())
        },
        ..Key::of(Part::Bone)
    },
    Key {
        name: "rigid-points",
        values: || "0 to 65536".into(),
        about: "points of that method on the burr; 0 for its own number",
        get: |i| i.rigid_points.map(|points| points.to_string()),
        set: |i, text| count(text, 0, 65_536).map(|points| i.rigid_points = Some(points)),
        ..Key::of(Part::Bone)
    },
    Key {
        name: "shaft",
        values: switches,
        about: "contact of the shaft, with torque: the variant of `rigid` that has it",
        left_out: Some("changes nothing there"),
        compared: on,
        realistic: Some("on"),
        get: |i| i.rigid.map(|name| switch_name(has_shaft(name)).into()),
        set: shaft,
        ..Key::of(Part::Bone)
    },
    Key {
        name: "shading",
        values: switches,
        about: "force shading on bone, over one voxel",
        left_out: Some("a filter of the force, not a model of anything"),
        usual: Some("off"),
        compared: on,
        realistic: Some("on"),
        get: |i| Some(switch_name(i.shading).into()),
        set: |i, text| switch(text).map(|on| i.shading = on),
        ..Key::of(Part::Bone)
    },
    Key {
        name: "bone-friction",
        values: || "off, or a coefficient up to 2".into(),
        about: "dry friction on bone of a tool that does not cut",
        usual: Some("off"),
        compared: || vec![FRICTION_ON_BONE.into()],
        realistic: Some(FRICTION_ON_BONE),
        get: |i| Some(off_or(i.bone_friction)),
        set: |i, text| up_to(text, 2.0).map(|coefficient| i.bone_friction = coefficient),
        ..Key::of(Part::Bone)
    },
    Key {
        name: "vibration",
        values: switches,
        about: "vibration of the drill on the hand",
        usual: Some("on"),
        compared: || vec!["off".into()],
        get: |i| Some(switch_name(i.vibration).into()),
        set: |i, text| switch(text).map(|on| i.vibration = on),
        ..Key::of(Part::Bone)
    },
    Key {
        name: "solver",
        values: || {
            let rivals = methods::solvers();
            list([TLED, FASTEST].into_iter().chain(rivals.iter().map(|method| method.name())))
        },
        about: "solver of the tissue; as `--solver`. `fastest` is `tled` with `device=fastest`",
        compared: || methods::solvers().iter().map(|method| method.name().into()).collect(),
        get: |i| i.solver.map(String::from),
        set: |i, text| {
            let rival = methods::solver(text).map(|method| method.name());
            i.solver = Some(rival.or([TLED, FASTEST].contains(&text).then_some(TLED))?);
            i.device = if text == FASTEST { SolverDevice::Fastest } else { i.device };
            Some(())
        },
        ..Key::of(Part::Tissue)
    },
    Key {
        name: "still-mm",
        values: || "0 to 1 mm".into(),
        about: "region of interest: tissue that moves less in 50 ms sleeps; 0 steps all of it",
        usual: Some("0"),
        compared: || vec!["0.01".into()],
        get: |i| Some(i.still_mm.to_string()),
        set: |i, text| number(text, 1.0).map(|mm| i.still_mm = mm as f32),
        ..Key::of(Part::Tled)
    },
    Key {
        name: "dynamic-mass-scaling",
        values: || "1 to 64".into(),
        about: "largest factor on the mass of an element that has stiffened, which keeps the step long; 1: none",
        usual: Some("16"),
        compared: || vec!["1".into()],
        get: |i| Some(i.dynamic_mass_scaling.to_string()),
        set: |i, text| number(text, 64.0).filter(|most| *most >= 1.0).map(|most| i.dynamic_mass_scaling = most as f32),
        ..Key::of(Part::Tled)
    },
    Key {
        name: "selective-mass-scaling",
        values: switches,
        about: "accelerations are averaged over the elements, which makes a short step √3 times as long",
        usual: Some("on"),
        compared: || vec!["off".into()],
        get: |i| Some(switch_name(i.selective_mass_scaling).into()),
        set: |i, text| switch(text).map(|on| i.selective_mass_scaling = on),
        ..Key::of(Part::Tled)
    },
    Key {
        name: "element",
        values: names::<Element>,
        about: "tetrahedra; locking-free: averaged nodal pressure (Joldes et al. 2009)",
        usual: Some("plain"),
        compared: others::<Element>,
        realistic: Some("locking-free"),
        get: |i| Some(name(&i.element)),
        set: |i, text| value(text).map(|element| i.element = element),
        ..Key::of(Part::Tled)
    },
    Key {
        name: "law",
        values: || {
            format!("{}; law.CLASS for one of {}", names::<Law>(), list(TissueClass::ALL.map(TissueClass::name)))
        },
        about: "constitutive law at the same moduli; stiffening: fitted to human brain by region; without CLASS of \
                all tissue, not of the ventricles' fluid",
        usual: Some("neo-hookean"),
        compared: || others::<Law>().into_iter().rev().collect(),
        realistic: Some(FITTED),
        get: |i| Some(laws(&i.laws)),
        set: |i, text| text.split('+').try_for_each(|part| set_law(&mut i.laws, part)),
        ..Key::of(Part::Tled)
    },
    Key {
        name: "pia-arachnoid",
        values: || "off, on, or a shear stiffness up to 1 N/mm".into(),
        about: "membrane in tension on the brain's surface; on: human, published, at small strain",
        usual: Some("off"),
        compared: on,
        realistic: Some("on"),
        get: |i| Some(off_or(i.pia_arachnoid_n_per_mm)),
        set: |i, text| {
            let published = (text == "on").then(|| brain_membranes::PIA_SHEAR_STIFFNESS.f32());
            published.or_else(|| up_to(text, 1.0)).map(|n_per_mm| i.pia_arachnoid_n_per_mm = n_per_mm)
        },
        ..Key::of(Part::Tled)
    },
    Key {
        name: "relaxation",
        values: names::<Relaxation>,
        about: "stress relaxation; prony: two terms of swine (Miller and Chinzei 2002); solid-and-fluid: three, \
                fitted over 4 minutes",
        usual: Some("off"),
        compared: || others::<Relaxation>().into_iter().rev().collect(),
        realistic: Some("solid-and-fluid"),
        get: |i| Some(name(&i.relaxation)),
        set: |i, text| value(text).map(|relaxation| i.relaxation = relaxation),
        ..Key::of(Part::Tled)
    },
    Key {
        name: "device",
        values: names::<SolverDevice>,
        about: "where the solver runs; gpu: on a graphics card, else on the processor with a remark; \
                fastest: on the faster of both",
        usual: Some("cpu"),
        compared: others::<SolverDevice>,
        effect: |_| Effect::Rounding,
        get: |i| Some(name(&i.device)),
        set: |i, text| value(text).map(|device| i.device = device),
        ..Key::of(Part::Tled)
    },
    Key {
        name: "threads",
        values: || "1 to 64".into(),
        about: "threads of the solver on the processor; the forces are the same for any number",
        usual: None,
        compared: || vec!["2".into()],
        effect: |_| Effect::Cost,
        get: |i| i.threads.map(|threads| threads.to_string()),
        set: |i, text| count(text, 1, 64).map(|threads| i.threads = Some(threads)),
        ..Key::of(Part::Tled)
    },
    Key {
        name: "surface-pressure",
        values: || "off, or up to 60 mmHg".into(),
        about: "fluid pressure on the brain's surface and in the ventricles; the brain starts at rest under it",
        left_out: Some("a state of the patient, to be given: 10 mmHg change 14 times the tolerance there"),
        usual: Some("off"),
        compared: || vec!["10".into()],
        get: |i| Some(off_or(i.surface_pressure_mmhg)),
        set: |i, text| up_to(text, 60.0).map(|mmhg| i.surface_pressure_mmhg = mmhg),
        ..Key::of(Part::Tled)
    },
    Key {
        name: "search",
        values: || list(searches().map(|method| method.name())),
        about: "search for the tool's points in the tissue; a grid's cells by trepan-voxel-size",
        usual: Some("walk"),
        compared: || {
            let usual = trepan_deformable::Method::RECOMMENDED;
            searches().filter(|method| *method != usual).map(|method| method.name().into()).collect()
        },
        effect: effect_of_search,
        get: |i| Some(i.search.name().into()),
        set: |i, text| searches().find(|method| method.name() == text).map(|method| i.search = method),
        ..Key::of(Part::Tissue)
    },
    Key {
        name: "friction",
        values: || "off, or a coefficient up to 2".into(),
        about: "dry friction of the first hand's tool on tissue, felt and dragging the tissue",
        usual: Some("off"),
        compared: || vec![FRICTION_ON_TISSUE.into()],
        realistic: Some(FRICTION_ON_TISSUE),
        get: |i| Some(off_or(i.friction)),
        set: |i, text| up_to(text, 2.0).map(|coefficient| i.friction = coefficient),
        ..Key::of(Part::Tissue)
    },
    Key {
        name: "folds",
        values: switches,
        about: "contact of the brain's surface with itself, once the dura is open",
        left_out: Some("changes nothing there"),
        usual: Some("off"),
        compared: on,
        realistic: Some("on"),
        get: |i| Some(switch_name(i.folds).into()),
        set: |i, text| switch(text).map(|on| i.folds = on),
        ..Key::of(Part::Tissue)
    },
    Key {
        name: "support",
        values: names::<Support>,
        about: "what holds the brain in the skull; anchored: stem, arachnoid, falx, bridging veins, fluid that drains",
        usual: Some("base"),
        compared: others::<Support>,
        realistic: Some("anchored"),
        get: |i| Some(name(&i.support)),
        set: |i, text| value(text).map(|support| i.support = support),
        ..Key::of(Part::Tled)
    },
];

/// Friction coefficients that are compared with none: a wet tool on brain and a metal one on bone,
/// both assumed.
const FRICTION_ON_TISSUE: &str = "0.1";
const FRICTION_ON_BONE: &str = "0.3";
/// The law that is fitted to human brain.
const FITTED: &str = "stiffening";
/// Total Lagrangian explicit dynamics.
pub(crate) const TLED: &str = "tled";
/// TLED where it is faster on this machine.
const FASTEST: &str = "fastest";

impl Key {
    /// The fields that most keys share.
    const fn of(part: Part) -> Self {
        Self {
            name: "",
            values: String::new,
            about: "",
            usual: None,
            left_out: None,
            part,
            compared: Vec::new,
            realistic: None,
            effect: |_| Effect::Model,
            get: |_| None,
            set: |_, _| None,
        }
    }

    /// The key of this name.
    fn named(name: &str) -> Option<&'static Self> {
        KEYS.iter().find(|key| key.name == name)
    }

    /// Its value; `by --quality` where that chooses.
    pub fn value(&self, of: &Ingredients) -> String {
        (self.get)(of).unwrap_or_else(|| BY_QUALITY.into())
    }

    /// Changes the ingredient; refuses an unknown value.
    pub fn set(&self, to: &mut Ingredients, text: &str) -> Result<(), String> {
        (self.set)(to, text).ok_or_else(|| format!("{text} is not known; known are {}", (self.values)()))
    }

    /// Whether a text says that nothing was chosen by hand.
    pub fn is_unset(&self, text: &str) -> bool {
        self.usual.is_none() && text == BY_QUALITY
    }

    /// Value in the file of a quality's settings, where it has one.
    pub(super) fn in_quality(&self, quality: Quality) -> Option<&'static str> {
        let is_own = |path: &str| path.strip_prefix("ingredients.") == Some(self.name);
        quality.settings().find(|(path, _)| is_own(path)).map(|(_, value)| value)
    }

    /// Default value, in words.
    fn default_text(&self) -> String {
        let of = |quality: Quality| Some(format!("; {}: {}", quality.name(), self.in_quality(quality)?));
        self.usual.unwrap_or(BY_QUALITY).to_string() + &Quality::ALL.into_iter().filter_map(of).collect::<String>()
    }
}

/// Value of what `--quality` chooses.
const BY_QUALITY: &str = "by --quality";

impl Ingredients {
    /// Ingredients of a quality.
    pub fn of(quality: Quality) -> Self {
        let mut made = Self::default();
        for (key, text) in KEYS.iter().filter_map(|key| Some((key, key.in_quality(quality).or(key.usual)?))) {
            let set = key.set(&mut made, text);
            debug_assert_eq!(set, Ok(()), "{}", key.name);
        }
        made
    }
}

/// A key with the value that a user gave it.
#[derive(Clone)]
pub struct KeyValue {
    /// The key.
    pub key: &'static Key,
    /// Its value.
    pub text: String,
    /// The flag, as it was given.
    pub flag: String,
}

impl core::fmt::Debug for KeyValue {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(&self.flag)
    }
}

impl KeyValue {
    /// A value by a flag of the key's own name; refuses an unknown value.
    pub fn by_flag(name: &str, text: &str) -> Result<Self, String> {
        let key = Key::named(name).ok_or_else(|| format!("no key {name}"))?;
        key.set(&mut Ingredients::default(), text).map_err(|fault| format!("--{name} {fault}"))?;
        Ok(Self { key, text: text.into(), flag: format!("--{name} {text}") })
    }
}

/// Parses `KEY=VALUE`, or `KEY.PART=VALUE` for a part of it; `None` for `list`.
pub fn setting(text: &str) -> Result<Option<KeyValue>, String> {
    if text == "list" {
        return Ok(None);
    }
    let known = || format!("known are {}, and list", list(KEYS.iter().map(|key| key.name)));
    let (name, value) = text.split_once('=').ok_or_else(|| format!("expected KEY=VALUE; {}", known()))?;
    let (name, value) = match name.split_once('.') {
        Some((name, part)) => (name, format!("{part}:{value}")),
        None => (name, value.to_string()),
    };
    let key = Key::named(name).ok_or_else(|| format!("{name} is not known; {}", known()))?;
    let mut scratch = Ingredients { rigid: Some(god_object_sphere::METHOD.name), ..Ingredients::default() };
    key.set(&mut scratch, &value)?;
    Ok(Some(KeyValue { key, text: value, flag: format!("--set {text}") }))
}

/// The keys for a terminal: name, default, what it does, values.
pub fn table() -> String {
    let line =
        |key: &Key| format!("{:17} {} [{}]\n{:18}{}\n", key.name, key.about, key.default_text(), "", (key.values)());
    KEYS.iter().map(line).collect()
}

/// Sets the shaft's contact: takes the variant of the method that has it, or that has it not.
fn shaft(i: &mut Ingredients, text: &str) -> Option<()> {
    let (ball, with_shaft) = (god_object_sphere::METHOD.name, god_object_sphere::WITH_SHAFT.name);
    match (switch(text)?, i.rigid) {
        (true, Some(name)) if has_shaft(name) => {}
        (true, None) => i.rigid = Some(with_shaft),
        (true, Some(name)) if name == ball => i.rigid = Some(with_shaft),
        (false, Some(name)) if name == with_shaft => i.rigid = Some(ball),
        (false, rigid) if !rigid.is_some_and(has_shaft) => {}
        _ => return None,
    }
    Some(())
}

/// Whether a method of contact with bone feels the shaft.
pub(crate) fn has_shaft(rigid: &str) -> bool {
    methods::bone_contact(rigid).is_some_and(|method| method.descriptor().extent == Extent::BallAndShaft)
}

/// Searches that a session can step.
fn searches() -> impl Iterator<Item = trepan_deformable::Method> {
    methods::searches().into_iter().filter(|method| !method.descriptor().is_oracle)
}

/// A search that finds every point, with the same response, finds the same depth; others do not.
fn effect_of_search(name: &str) -> Effect {
    let usual = trepan_deformable::Method::RECOMMENDED.descriptor().response;
    let is_same = |method: trepan_deformable::Method| {
        let of = method.descriptor();
        of.is_complete && of.response == usual
    };
    if methods::searches().into_iter().find(|method| method.name() == name).is_some_and(is_same) {
        Effect::Rounding
    } else {
        Effect::Model
    }
}

/// Sets the law of all classes but the ventricles, which stand for fluid; with `CLASS:LAW` of one.
fn set_law(laws: &mut [Law; TissueClass::ALL.len()], text: &str) -> Option<()> {
    match text.split_once(':') {
        Some((class, law)) => laws[TissueClass::named(class)? as usize] = value(law)?,
        None => {
            let law = value(text)?;
            let tissue = TissueClass::ALL.into_iter().filter(|class| *class != TissueClass::Ventricle);
            tissue.for_each(|class| laws[class as usize] = law);
        }
    }
    Some(())
}

/// The law of the brain, and of each class that has another.
fn laws(laws: &[Law; TissueClass::ALL.len()]) -> String {
    let others = TissueClass::ALL.into_iter().filter(|class| laws[*class as usize] != laws[0]);
    name(&laws[0])
        + &others.map(|class| format!("+{}:{}", class.name(), name(&laws[class as usize]))).collect::<String>()
}

fn list<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    names.into_iter().collect::<Vec<_>>().join(", ")
}

fn names<T: ValueEnum>() -> String {
    T::value_variants().iter().map(name).collect::<Vec<_>>().join(", ")
}

/// Every value but the first, which is the default.
fn others<T: ValueEnum>() -> Vec<String> {
    T::value_variants().iter().skip(1).map(name).collect()
}

fn name<T: ValueEnum>(of: &T) -> String {
    of.to_possible_value().map_or_else(String::new, |value| value.get_name().into())
}

fn value<T: ValueEnum>(text: &str) -> Option<T> {
    T::from_str(text, false).ok()
}

fn switches() -> String {
    "off, on".into()
}

fn on() -> Vec<String> {
    vec!["on".into()]
}

fn switch(text: &str) -> Option<bool> {
    ["off", "on"].iter().position(|name| *name == text).map(|at| at == 1)
}

fn switch_name(on: bool) -> &'static str {
    if on { "on" } else { "off" }
}

fn count(text: &str, low: usize, high: usize) -> Option<usize> {
    text.parse().ok().filter(|count| (low..=high).contains(count))
}

fn number(text: &str, high: f64) -> Option<f64> {
    text.parse().ok().filter(|number| (0.0..=high).contains(number))
}

/// A number from 0 up; `off` is 0.
fn up_to(text: &str, high: f32) -> Option<f32> {
    if text == "off" { Some(0.0) } else { text.parse().ok().filter(|number| (0.0..=high).contains(number)) }
}

fn off_or(number: f32) -> String {
    if number == 0.0 { "off".into() } else { number.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(settings: &[&str]) -> Ingredients {
        let mut made = Ingredients::of(Quality::Usual);
        for text in settings {
            let given = setting(text).unwrap().unwrap();
            given.key.set(&mut made, &given.text).unwrap();
        }
        made
    }

    #[test]
    fn every_key_reads_what_it_writes_and_names_its_values() {
        let made = with(&[
            "rigid=god-object-sphere",
            "shaft=on",
            "shading=on",
            "bone-friction=0.3",
            "vibration=off",
            "solver=tled",
            "still-mm=0.01",
            "dynamic-mass-scaling=4",
            "element=locking-free",
            "law=ogden",
            "law.grey=mooney-rivlin",
            "relaxation=prony",
            "device=gpu",
            "threads=2",
            "surface-pressure=10",
            "search=hashed-grid",
            "friction=0.2",
            "folds=on",
            "support=anchored",
        ]);
        let mut again = Ingredients::default();
        for key in KEYS {
            let text = key.value(&made);
            assert_eq!(key.set(&mut again, &text), Ok(()), "{} {text}", key.name);
            let fault = key.set(&mut again, "magic").unwrap_err();
            assert!(fault.starts_with("magic is not known; known are ") && fault.len() > 34, "{fault}");
            assert!(!key.about.is_empty() && KEYS.iter().filter(|other| other.name == key.name).count() == 1);
        }
        assert_eq!(again, made);
        let value = |name: &str| Key::named(name).unwrap().value(&made);
        assert_eq!(value("law"), "ogden+grey:mooney-rivlin+ventricle:neo-hookean");
        assert_eq!((value("rigid"), value("shaft")), ("god-object-sphere-shaft".into(), "on".into()));
        let json = serde_json::to_value(&made).unwrap();
        assert_eq!((&json["element"], json.as_object().unwrap().len()), (&"locking-free".into(), KEYS.len()));
    }

    #[test]
    fn cheap_qualities_run_what_old_recordings_ran_and_others_what_matters() {
        let mut fitted = [Law::Stiffening; TissueClass::ALL.len()];
        fitted[TissueClass::Ventricle as usize] = Law::NeoHookean;
        let matters = Ingredients {
            element: Element::LockingFree,
            laws: fitted,
            pia_arachnoid_n_per_mm: 0.12,
            relaxation: Relaxation::SolidAndFluid,
            friction: 0.1,
            bone_friction: 0.3,
            support: Support::Anchored,
            ..Ingredients::default()
        };
        let all = Quality::ALL.map(Ingredients::of);
        let auto = Ingredients { device: SolverDevice::Fastest, ..matters.clone() };
        assert_eq!(all, [auto, Ingredients::default(), Ingredients::default(), matters]);
        let element = Key::named("element").unwrap();
        assert_eq!(
            (element.in_quality(Quality::Fine), element.in_quality(Quality::Draft)),
            (Some("locking-free"), None)
        );
        assert_eq!(element.default_text(), "plain; auto: locking-free; fine: locking-free");
    }

    #[test]
    fn every_setting_of_a_preset_is_a_size_or_an_ingredient() {
        for (path, value) in Quality::ALL.into_iter().flat_map(Quality::settings) {
            match path.strip_prefix("ingredients.") {
                Some(key) => assert!(setting(&format!("{key}={value}")).unwrap().is_some()),
                None => assert!(path.starts_with("sizes."), "{path}"),
            }
        }
    }

    #[test]
    fn unknown_keys_and_values_are_refused_with_those_known() {
        let fault = |text| setting(text).unwrap_err();
        assert!(fault("elements=plain").starts_with("elements is not known; known are rigid, rigid-points, shaft"));
        assert!(fault("element").starts_with("expected KEY=VALUE; known are rigid"));
        assert_eq!(fault("element=hex"), "hex is not known; known are plain, locking-free");
        assert!(fault("law.bone=ogden").contains("for one of brain, white, grey"));
        assert!(fault("threads=0").contains("1 to 64") && fault("friction=-1").contains("up to 2"));
        assert!(fault("friction=nan").contains("up to 2") && fault("search=brute-force").contains("walk"));
        assert!(setting("list").unwrap().is_none());
        assert_eq!(with(&["solver=fastest"]).device, SolverDevice::Fastest);
        let method = |settings: &[&str]| with(settings).rigid;
        assert_eq!(method(&["shaft=on", "shaft=off"]), Some("god-object-sphere"));
        assert_eq!(method(&["shaft=off"]), None);
        let mut thesis = with(&["rigid=thesis"]);
        assert!(Key::named("shaft").unwrap().set(&mut thesis, "on").is_err(), "the thesis's method has no shaft");
    }

    /// The keys as a table for the user guide.
    fn markdown() -> String {
        let line =
            |key: &Key| format!("| `{}` | {} | {} | {} |\n", key.name, (key.values)(), key.about, key.default_text());
        "| key | values | what it does | default |\n|---|---|---|---|\n".to_string()
            + &KEYS.iter().map(line).collect::<String>()
    }

    #[test]
    fn the_user_guide_has_the_table_of_keys() {
        let guide = include_str!("../../../../apps/README.md");
        assert!(guide.contains(&markdown()), "paste into apps/README.md:\n{}", markdown());
        assert!(table().contains("element") && table().contains("[plain; auto: locking-free"), "{}", table());
    }
}
