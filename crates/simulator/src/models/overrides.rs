//! Given parameters of the models: by flags, a recording's header or a case folder.

use crate::error::SessionError;
use crate::measure::Parts;
use crate::options::Patient;
use std::collections::BTreeMap;
use trepan_budget::{Bone, Picture, Tissue};

/// Given parameters of each part, and `words` that describe them.
#[derive(Clone, Debug, Default)]
pub(super) struct Overrides {
    pub spacing_mm: Option<f64>,
    pub rigid: Option<&'static str>,
    pub points: Option<usize>,
    pub tets: Option<usize>,
    pub halvings: Option<u32>,
    pub solver: Option<&'static str>,
    pub still_mm: Option<f64>,
    pub picture: Option<Picture>,
    pub words: Parts<Vec<String>>,
}

impl Overrides {
    /// Reads the flags; refuses unknown names.
    pub fn flags(patient: &Patient, rigid: Option<&str>, solver: Option<&str>) -> Result<Self, SessionError> {
        let tled = |name| if name == FASTEST { FASTEST } else { TLED };
        let named = |name| Ok::<_, SessionError>(solver_named(name)?.map_or(tled(name), |method| method.name()));
        let words = |flags: &[(&str, Option<String>)]| -> Vec<String> {
            flags.iter().filter_map(|(flag, value)| Some(format!("{flag} {} is given", value.as_ref()?))).collect()
        };
        Ok(Self {
            spacing_mm: patient.spacing_mm.map(written),
            rigid: rigid.map(|name| rigid_named(name).map(|method| method.name())).transpose()?,
            points: rigid.map(|_| 0),
            tets: patient.tets,
            halvings: patient.opening_refinement,
            solver: solver.map(named).transpose()?,
            still_mm: solver.map(|_| 0.0),
            picture: None,
            words: Parts {
                bone: words(&[
                    ("--spacing-mm", patient.spacing_mm.map(|mm| mm.to_string())),
                    ("--rigid", rigid.map(String::from)),
                ]),
                tissue: words(&[
                    ("--tets", patient.tets.map(|n| n.to_string())),
                    ("--opening-refinement", patient.opening_refinement.map(|n| n.to_string())),
                    ("--solver", solver.map(String::from)),
                ]),
                picture: Vec::new(),
            },
        })
    }

    /// Reads a recording's header ([`Models::entries`]). Entries missing in older recordings had
    /// the default value, except that meshes of a given size were uniform.
    pub fn recorded(config: &BTreeMap<String, String>) -> Self {
        let number = |key: &str| config.get(key)?.parse::<f64>().ok().filter(|value| value.is_finite());
        let count = |key: &str| config.get(key)?.parse::<usize>().ok();
        let flag = |key: &str| config.get(key).is_some_and(|value| value == "true");
        // The fastest solver may be another one now; TLED on the CPU is always available.
        let solver = |name: &String| trepan_soft::Method::named(name).map_or(TLED, |method| method.name());
        let detail = number("picture_detail");
        Self {
            spacing_mm: number("spacing_mm"),
            rigid: config.get("rigid").and_then(|name| Some(trepan_rigid::Method::named(name)?.name())),
            points: count("rigid_points"),
            tets: count("tets"),
            halvings: count("halvings").filter(|n| *n <= 3).or(count("tets").map(|_| 0)).map(|n| n as u32),
            solver: config.get("solver").map(solver),
            still_mm: number("still_mm"),
            picture: detail.map(|detail| Picture { sparse: flag("picture_sparse"), detail }),
            words: Parts::default(),
        }
    }

    /// Takes missing values from `other`.
    pub fn or(self, other: Self) -> Self {
        Self {
            spacing_mm: self.spacing_mm.or(other.spacing_mm),
            points: self.points.or(other.points),
            rigid: self.rigid.or(other.rigid),
            tets: self.tets.or(other.tets),
            halvings: self.halvings.or(other.halvings),
            still_mm: self.still_mm.or(other.still_mm),
            solver: self.solver.or(other.solver),
            picture: self.picture.or(other.picture),
            words: self.words,
        }
    }

    /// Replaces the given values of bone.
    pub fn bone(&self, bone: Bone) -> Bone {
        let points = self.points.unwrap_or(if self.rigid.is_some() { 0 } else { bone.points });
        let (method, spacing_mm) = (self.rigid.unwrap_or(bone.method), self.spacing_mm.unwrap_or(bone.spacing_mm));
        Bone { method, spacing_mm, points }
    }

    /// Replaces the given values of tissue.
    pub fn tissue(&self, tissue: Tissue) -> Tissue {
        Tissue {
            solver: self.solver.unwrap_or(tissue.solver),
            tets: self.tets.unwrap_or(tissue.tets),
            halvings: self.halvings.unwrap_or(tissue.halvings),
            still_mm: self.still_mm.unwrap_or(tissue.still_mm),
        }
    }
}

/// Total Lagrangian explicit dynamics.
pub(crate) const TLED: &str = "tled";

/// TLED on the CPU or the GPU, whichever is faster on this machine. A replay may then not reproduce
/// the recorded forces bit for bit.
pub(crate) const FASTEST: &str = "fastest";

/// Haptic method on bone with this name.
fn rigid_named(name: &str) -> Result<trepan_rigid::Method, SessionError> {
    trepan_rigid::Method::named(name).ok_or_else(|| {
        let known: Vec<_> = trepan_rigid::Method::all().iter().map(|method| method.name()).collect();
        SessionError::Usage(format!("--rigid {name} is not known; known are {}", known.join(", ")))
    })
}

/// Haptic method of a choice for bone, with its number of points.
pub(crate) fn rigid_of(bone: &Bone) -> Result<trepan_rigid::Method, SessionError> {
    rigid_named(bone.method).map(|method| method.with_points(bone.points))
}

/// Solver of `trepan_soft` with this name; `None` for TLED.
pub(crate) fn solver_named(name: &str) -> Result<Option<trepan_soft::Method>, SessionError> {
    if name == TLED || name == FASTEST {
        return Ok(None);
    }
    trepan_soft::Method::named(name).map(Some).ok_or_else(|| {
        let known: Vec<_> = trepan_soft::Method::all().iter().map(|method| method.name()).collect();
        SessionError::Usage(format!("--solver {name} is not known; known are {TLED}, {FASTEST}, {}", known.join(", ")))
    })
}

/// Converts a flag's number to the decimal as written: 0.7, not 0.699999988.
pub(super) fn written(number: f32) -> f64 {
    number.to_string().parse().unwrap_or(f64::from(number))
}
