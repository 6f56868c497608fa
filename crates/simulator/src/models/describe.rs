//! Describes the models: in the log, in a recording's header, in `summary.json`, on a terminal.

use super::Models;
use crate::config::{SessionConfig, Sizes};
use std::fmt::Display;
use trepan_budget::{Plan, Setup};
use trepan_models::ingredients::{Ingredients, KEYS};
use trepan_models::measure::Parts;
use trepan_report::models::{BoneSummary, ModelSummary, PictureSummary, TissueSummary};
use trepan_report::uncertainty;

impl Models {
    /// Logs one short line for each part, and unmet tolerances as warnings. The reasons stand in
    /// `plan`, summary and report.
    pub fn log(&self) {
        let Setup { bone, tissue, picture } = &self.setup;
        tracing::info!("bone: {bone}");
        tracing::info!("tissue: {tissue}");
        tracing::info!("picture: {picture}");
        let differs = self.differing();
        if !differs.is_empty() {
            tracing::info!("ingredients: {}", differs.join(", "));
        }
        if let Some(plan) = &self.plan {
            tracing::info!("planned: {:.2} cores of {}", plan.cores(), plan.machine.threads);
        }
        self.unmet.iter().for_each(|text| tracing::warn!("{text}"));
    }

    /// Describes the measurements, the choices with their reasons, and the neighbouring choices.
    pub fn describe(&self) -> String {
        let Setup { bone, tissue, .. } = &self.setup;
        let Some(plan) = &self.plan else {
            return format!("all values are given, nothing was planned: {}", self.setup);
        };
        let machine = &plan.machine;
        let drawn = if machine.device_draws {
            "a graphics card draws".into()
        } else {
            format!("{:.0} ns a ray", machine.ns_per_ray)
        };
        let mut text = format!(
            "this machine: {:.1} ns a tetrahedron and step, {:.1} us a tick on bone, {drawn}, {} threads\n",
            machine.ns_per_tet_step, machine.us_per_rigid_tick, machine.threads
        );
        text += &format!(
            "this case: CT voxels of {:.2} mm, brain of {:.0} ml; errors by {}\n{plan}",
            plan.scene.finest_mm,
            plan.scene.brain_mm3 * 1e-3,
            self.errors_by()
        );
        for (given, what) in [(&self.given.bone, bone as &dyn Display), (&self.given.tissue, tissue)] {
            if !given.is_empty() {
                text += &format!("{}: {what}\n", given.join(", "));
            }
        }
        text += &self.describe_ingredients();
        text += &uncertainty::limits();
        let unmet = self.unmet.iter().map(|text| format!("{text}\n"));
        text + &unmet.collect::<String>()
    }

    /// The ingredients that differ from the default, and what was left out, with the reasons.
    fn describe_ingredients(&self) -> String {
        let out: Vec<_> = KEYS
            .iter()
            .filter_map(|key| {
                let why =
                    key.left_out.filter(|_| key.value(&self.ingredients) == key.value(&Ingredients::default()))?;
                Some(format!("  {}: {why}\n", key.name))
            })
            .collect();
        let on = self.differing().join(", ");
        let on = if on.is_empty() { "all as usual".into() } else { on };
        format!(
            "ingredients: {on}; left out by the built-in operation (`cargo xtask validate ablation`):\n{}",
            out.concat()
        )
    }

    /// `KEY=VALUE` of the ingredients that differ from the default.
    fn differing(&self) -> Vec<String> {
        let (all, off) = (self.ingredients(), Ingredients::default());
        let differs = KEYS.iter().filter(|key| key.usual.is_some() && key.value(&all) != key.value(&off));
        differs.map(|key| format!("{}={}", key.name, key.value(&all))).collect()
    }

    /// Source of the plan's errors.
    fn errors_by(&self) -> String {
        let Parts { bone, tissue, picture } = self.measured;
        let all = [("bone", bone), ("tissue", tissue), ("picture", picture)];
        let measured: Vec<_> = all.into_iter().filter_map(|(name, measured)| measured.then_some(name)).collect();
        match measured[..] {
            [] => "power laws of similar cases".into(),
            _ => format!("measuring {} in it, else by power laws of similar cases", measured.join(", ")),
        }
    }

    /// What the models add to a session's configuration. `ran`: the ingredients that ran.
    pub(crate) fn config(&self, ran: Ingredients) -> SessionConfig {
        let Setup { bone, tissue, picture } = &self.setup;
        let sizes = Sizes {
            spacing_mm: Some(bone.spacing_mm),
            tets: Some(tissue.tets),
            halvings: Some(tissue.halvings),
            picture_detail: Some(picture.detail),
            picture_sparse: picture.sparse,
        };
        SessionConfig {
            quality: self.by.into(),
            why: self.why.clone(),
            sizes,
            ingredients: ran,
            ..SessionConfig::default()
        }
    }

    /// Entry for `summary.json`. `ran`: the ingredients that ran.
    pub fn summary(&self, ran: &Ingredients) -> ModelSummary {
        let Setup { bone, tissue, picture } = self.setup;
        let why = self.why.clone();
        ModelSummary {
            quality: self.by,
            bone: BoneSummary { method: bone.method, spacing_mm: bone.spacing_mm, points: bone.points, why: why.bone },
            tissue: TissueSummary {
                solver: tissue.solver,
                tets: tissue.tets,
                halvings: tissue.halvings,
                why: why.tissue,
            },
            picture: PictureSummary { sparse: picture.sparse, detail: picture.detail, why: why.picture },
            ingredients: ran.clone(),
            planned_cores: self.plan.as_ref().map(Plan::cores),
        }
    }
}
