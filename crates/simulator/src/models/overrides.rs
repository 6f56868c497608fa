//! Given parameters of the models: by flags, a recording's header or a case folder.

use crate::config::{SessionConfig, Sizes};
use crate::error::SessionError;
use crate::options::Patient;
use trepan_budget::{Bone, Picture, Tissue};
use trepan_models::ingredients::{Ingredients, KEYS, KeyValue, Part};
use trepan_models::measure::Parts;
use trepan_models::methods;

/// Given parameters of each part, and `words` that describe them.
#[derive(Clone, Debug)]
pub(super) struct Overrides {
    pub spacing_mm: Option<f64>,
    pub tets: Option<usize>,
    pub halvings: Option<u32>,
    pub picture: Option<Picture>,
    pub ingredients: Ingredients,
    pub words: Parts<Vec<String>>,
}

impl Overrides {
    /// Nothing is given but the ingredients.
    pub fn of(ingredients: Ingredients) -> Self {
        Self { spacing_mm: None, tets: None, halvings: None, picture: None, ingredients, words: Parts::default() }
    }

    /// What a recorded session ran.
    pub fn recorded(config: &SessionConfig) -> Self {
        let Sizes { spacing_mm, tets, halvings, picture_detail, picture_sparse: sparse } = config.sizes;
        let picture = picture_detail.map(|detail| Picture { sparse, detail });
        Self { spacing_mm, tets, halvings, picture, ..Self::of(config.ingredients.clone()) }
    }

    /// Adds the flags, which override all others.
    pub fn with_flags(mut self, patient: &Patient, given: &[KeyValue]) -> Result<Self, SessionError> {
        let Patient { spacing_mm, tets, opening_refinement, .. } = *patient;
        self.spacing_mm = spacing_mm.map(written).or(self.spacing_mm);
        self.tets = tets.or(self.tets);
        self.halvings = opening_refinement.or(self.halvings);
        let is_given = |flag: String| format!("{flag} is given");
        self.words.bone.extend(spacing_mm.map(|mm| is_given(format!("--spacing-mm {mm}"))));
        self.words.tissue.extend(tets.map(|n| is_given(format!("--tets {n}"))));
        self.words.tissue.extend(opening_refinement.map(|n| is_given(format!("--opening-refinement {n}"))));
        for KeyValue { key, text, flag } in given {
            let set = key.set(&mut self.ingredients, text);
            set.map_err(|fault| SessionError::Usage(format!("{flag}: {fault}")))?;
            let words = if key.part == Part::Bone { &mut self.words.bone } else { &mut self.words.tissue };
            words.push(is_given(flag.clone()));
        }
        self.check(given)?;
        self.leave_out_what_a_rival_lacks();
        Ok(self)
    }

    /// Sets ingredients of `tled` that a quality chose, not a user, to their default for another
    /// solver.
    fn leave_out_what_a_rival_lacks(&mut self) {
        let Some(_) = self.ingredients.solver.and_then(methods::solver) else { return };
        let of_tled = KEYS.iter().filter(|key| key.part == Part::Tled);
        for (key, usual) in of_tled.filter_map(|key| Some((key, key.usual?))) {
            let set = key.set(&mut self.ingredients, usual);
            debug_assert_eq!(set, Ok(()), "{}", key.name);
        }
    }

    /// Refuses an ingredient of `tled` for another solver.
    fn check(&self, given: &[KeyValue]) -> Result<(), SessionError> {
        let Some(rival) = self.ingredients.solver.and_then(methods::solver) else { return Ok(()) };
        let plain = Ingredients::default();
        let differs = |given: &&KeyValue| {
            given.key.part == Part::Tled && given.key.value(&self.ingredients) != given.key.value(&plain)
        };
        match given.iter().find(differs).filter(|given| given.key.name != "still-mm") {
            None => Ok(()),
            Some(given) => {
                let fault = format!("{}: {} has no {}; give --solver tled", given.flag, rival.name(), given.key.name);
                Err(SessionError::Usage(fault))
            }
        }
    }

    /// Replaces the given values of bone.
    pub fn bone(&self, bone: Bone) -> Bone {
        let Ingredients { rigid, rigid_points, .. } = self.ingredients;
        let points = rigid_points.unwrap_or(if rigid.is_some() { 0 } else { bone.points });
        let (method, spacing_mm) = (rigid.unwrap_or(bone.method), self.spacing_mm.unwrap_or(bone.spacing_mm));
        Bone { method, spacing_mm, points }
    }

    /// Replaces the given values of tissue.
    pub fn tissue(&self, tissue: Tissue) -> Tissue {
        Tissue {
            solver: self.ingredients.solver.unwrap_or(tissue.solver),
            tets: self.tets.unwrap_or(tissue.tets),
            halvings: self.halvings.unwrap_or(tissue.halvings),
        }
    }
}

/// Converts a flag's number to the decimal as written: 0.7, not 0.699999988.
pub(super) fn written(number: f32) -> f64 {
    number.to_string().parse().unwrap_or(f64::from(number))
}
