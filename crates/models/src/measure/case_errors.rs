//! Measures the errors of the choices in this case: the burr on the skull, the probe on the brain
//! below, the drawn view.
//!
//! # Theory
//! A power law predicts a choice's error in similar cases; here the error is measured.
//!
//! - Bone: each choice (of the recommended method, unless another is given) slides along three
//!   paths from the opening and cuts once, against fine voxels of the same CT. The worst error
//!   counts.
//! - Tissue: TLED on each mesh is pushed into the brain and slid along it, against a mesh that is
//!   sixteen times finer around the probe.
//! - Picture: each choice is drawn from the first camera and from three others around it,
//!   against every ray.
//!
//! A choice that another beats by a tenth in error at no more cost, or by a tenth in cost at no
//! more error, by the power laws, is not measured. The hand and the camera will move elsewhere, so
//! measured errors get a safety factor. A measured error replaces the power law of its choice;
//! choices that were not measured are left out.
//!
//! # Practice
//! Takes 18 s on two cores with the reading of the case, bone, tissue and picture side by side. The
//! errors do not depend on the tolerances, so they are cached with the case. Parts that cannot be
//! measured use the power laws.

use super::Parts;
use super::bone::{Skull, Slide, Stretch};
use super::picture::View;
use super::tissue::{self, Brains, LEAST_MM, Push, Shape};
use crate::ModelError;
use crate::ingredients::Element;
use serde::{Deserialize, Serialize};
use std::f32::consts::TAU;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_budget::{
    Bone, Kind, Machine, Picture, PowerLaw, Row, Rows, Scene, Tissue, TissueForce, bone_cores, bone_error_n,
    holds_walls, picture_cores, tissue_cores,
};
use trepan_geometry::Vec3;
use trepan_patient::Fineness;
use trepan_rigid::Method;

/// Version of the measurement; raised when the errors change for the same case and choices.
const FORM: u32 = 20;
/// Slides along the bone, evenly around the opening.
const SLIDES: usize = 3;
/// Length of a slide, mm.
const SLIDE_MM: f32 = 5.0;
/// Number of cameras around the first, and their offset as a share of the distance.
const CAMERAS: (usize, f32) = (3, 0.2);
/// Safety factors for other paths and views: bone, displacement and force of tissue, picture. A
/// large one is cheap only for bone.
const MARGIN: [f64; 4] = [1.5, 1.15, 1.15, 1.08];

/// Geometry on which the errors are measured.
#[derive(Clone, Debug)]
pub struct Sight {
    /// The skull as scanned and as drawn, if any.
    pub skull: Option<(Skull, Arc<BoneVolume>)>,
    /// Entry of the opening on the skull's outer surface.
    pub entry: Vec3,
    /// Outward unit vector at the entry.
    pub outward: Vec3,
    /// Direction from the entry to the camera.
    pub eye: Vec3,
    /// The brain and the exposed point of its surface, if any.
    pub brain: Option<(Shape, Vec3)>,
}

/// A part whose errors are measured and cached by itself.
#[derive(Clone, Copy, Debug)]
pub(super) enum Part {
    Bone,
    Tissue,
    Picture,
}

/// Measured errors of choices, by their names in the table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CaseErrors {
    /// Errors on bone, mm of depth.
    bone: Vec<(Vec<String>, f64)>,
    /// Errors in tissue, mm.
    tissue: Vec<(Vec<String>, f64)>,
    /// Errors of the force on tissue and that force, N.
    tissue_force: Vec<(Vec<String>, [f64; 2])>,
    /// Errors in the picture, percent of white.
    picture: Vec<(Vec<String>, f64)>,
}

impl CaseErrors {
    /// Measures the choices for a scene's tools and view, TLED with that element, with so many
    /// threads.
    pub fn of(sight: &Sight, scene: &Scene, rows: &Rows, element: Element, threads: usize) -> Self {
        let bone = || on_bone(sight, scene, rows);
        let tissue = || in_tissue(sight, scene, rows, element);
        let (bone, tissue, picture) = if threads > 1 {
            std::thread::scope(|scope| {
                let (bone, tissue) = (scope.spawn(bone), scope.spawn(tissue));
                let picture = in_picture(sight, scene, rows, threads);
                (bone.join().unwrap_or_default(), tissue.join().unwrap_or_default(), picture)
            })
        } else {
            (bone(), tissue(), in_picture(sight, scene, rows, 1))
        };
        let errors = tissue.iter().map(|(name, found)| (name.clone(), found.error_mm));
        let forces = tissue.iter().map(|(name, found)| {
            let TissueForce { error_n, force_n } = found.force;
            (name.clone(), [error_n, force_n].map(millionths))
        });
        Self {
            bone: to_millionths(bone),
            tissue: to_millionths(errors.collect()),
            tissue_force: forces.collect(),
            picture: to_millionths(picture),
        }
    }

    /// Lists all inputs of the measurement of each part except the case, for cache keys; `None`
    /// for a part that is not measured. `on_skull`: whether the opening is one of a skull.
    pub fn about(on_skull: bool, scene: &Scene, rows: &Rows, element: Element) -> Parts<Option<String>> {
        let Scene { tool_radius_mm, press_mm, tissue_motion_mm, probe_radius_mm, view_mm, .. } = *scene;
        let text = |lengths: &[f64], names: Vec<Vec<String>>| {
            (!names.is_empty()).then(|| format!("own {FORM} {on_skull} {lengths:?} {names:?}"))
        };
        let bone = text(&[tool_radius_mm, press_mm], names(&rows.bone));
        let tissue = text(&[press_mm, tissue_motion_mm, probe_radius_mm], names(&rows.tissue));
        Parts {
            bone: bone.filter(|_| scene.has_bone),
            tissue: tissue.filter(|_| scene.has_tissue).map(|text| format!("{text} {element:?} {:?}", scene.material)),
            picture: text(&[view_mm], names(&rows.picture)).map(|text| format!("{text} {:?}", scene.picture_pixels)),
        }
    }

    /// The errors of one part alone.
    pub(super) fn only(&self, part: Part) -> Self {
        let Self { bone, tissue, tissue_force, picture } = self.clone();
        match part {
            Part::Bone => Self { bone, ..Self::default() },
            Part::Tissue => Self { tissue, tissue_force, ..Self::default() },
            Part::Picture => Self { picture, ..Self::default() },
        }
    }

    /// Adds the errors of other parts.
    pub(super) fn add(&mut self, other: Self) {
        self.bone.extend(other.bone);
        self.tissue.extend(other.tissue);
        self.tissue_force.extend(other.tissue_force);
        self.picture.extend(other.picture);
    }

    /// Replaces the power laws of a scene's errors by the measured errors, for measured parts.
    /// Tissue that is pushed deeper than it was measured keeps the slope of its law.
    pub fn instead(&self, mut rows: Rows, scene: &Scene) -> Rows {
        let pushed = measured_in_tissue(scene).tissue_features();
        replace(&self.bone, MARGIN[0], &mut rows.bone, |_, error| PowerLaw::constant(error));
        replace(&self.tissue, MARGIN[1], &mut rows.tissue, |law, error| law.through(&pushed, error));
        for row in &mut rows.tissue {
            let name = row.what.write();
            let force = self.tissue_force.iter().find(|(of, _)| *of == name);
            row.force =
                force.map(|(_, [error_n, force_n])| TissueForce { error_n: MARGIN[2] * error_n, force_n: *force_n });
        }
        replace(&self.picture, MARGIN[3], &mut rows.picture, |_, error| PowerLaw::constant(error));
        rows
    }

    /// Whether bone, tissue and picture were measured.
    pub fn has(&self) -> Parts<bool> {
        let Self { bone, tissue, picture, .. } = self;
        Parts { bone: !bone.is_empty(), tissue: !tissue.is_empty(), picture: !picture.is_empty() }
    }
}

/// Rounds to 1e-6, so that a file reproduces the numbers exactly.
fn to_millionths(mut found: Vec<(Vec<String>, f64)>) -> Vec<(Vec<String>, f64)> {
    found.iter_mut().for_each(|(_, error)| *error = millionths(*error));
    found
}

fn millionths(x: f64) -> f64 {
    (x * 1e6).round() / 1e6
}

fn names<T: Kind>(rows: &[Row<T>]) -> Vec<Vec<String>> {
    rows.iter().map(|row| row.what.write()).collect()
}

/// Keeps only the measured rows, with the measured errors times a safety factor; a row with a power
/// law could win by chance.
fn replace<T: Kind>(
    found: &[(Vec<String>, f64)],
    margin: f64,
    rows: &mut Vec<Row<T>>,
    law: impl Fn(&PowerLaw, f64) -> PowerLaw,
) {
    if found.is_empty() {
        return;
    }
    let measured = |row: &Row<T>| {
        let name = row.what.write();
        let (_, error) = found.iter().find(|(of, _)| *of == name)?;
        Some(Row { error: law(&row.error, margin * error), ..*row })
    };
    let measured: Vec<_> = rows.iter().filter_map(measured).collect();
    if !measured.is_empty() {
        *rows = measured;
    }
}

/// By how much another choice must be better in error or cost for one not to be measured.
const BEATEN: f64 = 0.9;

/// Of rows with their error and cost by the laws: those that may be worth taking.
fn front<T: Kind>(rows: Vec<(&Row<T>, [f64; 2])>) -> Vec<T> {
    let beats = |[a, b]: [f64; 2], [c, d]: [f64; 2]| a <= c && b <= d && (a < BEATEN * c || b < BEATEN * d);
    let is_beaten = |of: [f64; 2]| rows.iter().any(|(_, other)| beats(*other, of));
    rows.iter().filter(|(_, of)| !is_beaten(*of)).map(|(row, _)| row.what).collect()
}

fn on_bone(sight: &Sight, scene: &Scene, rows: &Rows) -> Vec<(Vec<String>, f64)> {
    let mut holding: Vec<_> = rows.bone.iter().filter(|row| holds_walls(&row.what, scene.tool_radius_mm)).collect();
    // Errors of other methods, such as `thesis`, differ between paths: unless a method is given,
    // only the recommended one is measured.
    let recommended = |row: &&Row<Bone>| row.what.method == Method::RECOMMENDED.name();
    if holding.iter().any(recommended) {
        holding.retain(recommended);
    }
    let of = |row: &Row<Bone>| [bone_error_n(scene, row), bone_cores(&Machine::default(), scene, row)];
    let choices = front(holding.into_iter().map(|row| (row, of(row))).collect());
    let Some((skull, _)) = sight.skull.as_ref().filter(|_| scene.has_bone && !choices.is_empty()) else {
        return Vec::new();
    };
    let slide = |n: usize| Slide {
        scene: *scene,
        place: sight.entry,
        outward: sight.outward,
        turn_rad: TAU * n as f32 / SLIDES as f32,
        length_mm: SLIDE_MM,
    };
    let mut worst = vec![f64::NAN; choices.len()];
    let stretches = (0..SLIDES).filter_map(|n| Stretch::of(skull, &slide(n))).enumerate();
    for stretch in stretches.map(|(n, stretch)| if n == 0 { stretch.cutting() } else { stretch }) {
        let found = stretch.measure(&choices);
        worst.iter_mut().zip(found).for_each(|(worst, found)| *worst = worst.max(found.error_n / scene.stiffness));
    }
    let all = choices.iter().zip(worst).filter(|(_, error)| error.is_finite());
    all.map(|(choice, error)| (choice.write(), error)).collect()
}

/// The scene in which errors in tissue are measured: no deeper than the tool's equator. Deeper, the
/// tissue beside a rigid path is sheared without bound, and no mesh converges.
fn measured_in_tissue(scene: &Scene) -> Scene {
    Scene { tissue_motion_mm: scene.tissue_motion_mm.min(scene.probe_radius_mm), ..*scene }
}

fn in_tissue(sight: &Sight, scene: &Scene, rows: &Rows, element: Element) -> Vec<(Vec<String>, tissue::Measurement)> {
    let ours = rows.tissue.iter().filter(|row| row.what.solver == "tled");
    let features = scene.tissue_features();
    let of = |row: &Row<Tissue>| [row.error.at_most(&features), tissue_cores(&Machine::default(), scene, row)];
    let choices = front(ours.map(|row| (row, of(row))).collect());
    let Some((shape, place)) = sight.brain.as_ref().filter(|_| scene.has_tissue && !choices.is_empty()) else {
        return Vec::new();
    };
    let scene = measured_in_tissue(scene);
    let slide = Slide { scene, place: *place, outward: sight.outward, turn_rad: 0.0, length_mm: SLIDE_MM };
    let found = || {
        let brains = Brains::of(shape, &choices, element)?;
        let (push, found) = Push::measured(&slide, &brains, Fineness::QUICK)?;
        // Where the brain is fixed, the error of every mesh would be zero.
        Ok(if push.moved_mm() < LEAST_MM { Vec::new() } else { found })
    };
    let found = found().unwrap_or_else(|fault: ModelError| {
        tracing::warn!("{fault}");
        Vec::new()
    });
    choices.iter().map(Tissue::write).zip(found).collect()
}

fn in_picture(sight: &Sight, scene: &Scene, rows: &Rows, threads: usize) -> Vec<(Vec<String>, f64)> {
    let features = scene.picture_features();
    let of = |row: &Row<Picture>| [row.error.at_most(&features), picture_cores(&Machine::default(), scene, row)];
    let choices = front(rows.picture.iter().map(|row| (row, of(row))).collect());
    let Some((_, bone)) = sight.skull.as_ref().filter(|_| !choices.is_empty()) else { return Vec::new() };
    let (a, b) = sight.eye.any_orthonormal_pair();
    let around = (0..CAMERAS.0).map(|n| TAU * n as f32 / CAMERAS.0 as f32).map(|turn| turn.cos() * a + turn.sin() * b);
    let view =
        |aside| View { bone: Arc::clone(bone), scene: *scene, target: sight.entry, eye: sight.eye + CAMERAS.1 * aside };
    let views: Vec<View> = around.chain([Vec3::ZERO]).map(view).collect();
    let found = View::measure_all(&views, &choices, threads).unwrap_or_default();
    choices.iter().zip(found).map(|(choice, error)| (choice.write(), error)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_volume::VoxelVolume;

    /// A ball of bone with a radius of 30 mm, seen and touched from above.
    fn ball() -> Sight {
        let edge = 70;
        let mut ct = VoxelVolume::isotropic([edge; 3], Vec3::splat(-34.5), 1.0, 0i16);
        for at in 0..ct.data.len() {
            let from = ct.centre_of([at % edge, at / edge % edge, at / (edge * edge)]).length();
            ct.data[at] = (400.0 + 600.0 * (30.0 - from)).clamp(-1000.0, 1500.0) as i16;
        }
        let bone = Arc::new(BoneVolume::new(&ct, 400).unwrap());
        Sight {
            skull: Some((Skull { ct, isovalue: 400 }, bone)),
            entry: 30.0 * Vec3::Z,
            outward: Vec3::Z,
            eye: Vec3::Z,
            brain: None,
        }
    }

    #[test]
    fn bone_has_small_errors_and_more_pixels_have_smaller_ones() {
        let scene = Scene { picture_pixels: [160, 120], view_mm: 80.0, ..Scene::default() };
        let mut rows = Rows::stored().unwrap();
        // Voxels of 2 mm are neither more accurate nor cheaper than others here.
        let sizes = [0.5, 1.0, 2.0];
        rows.bone.retain(|row| row.what.method == "god-object-sphere" && sizes.contains(&row.what.spacing_mm));
        rows.picture.retain(|row| !row.what.sparse && [0.25, 0.5, 1.0].contains(&row.what.detail));
        let own = CaseErrors::of(&ball(), &scene, &rows, Element::Plain, 1);
        assert_eq!(own.has(), Parts { bone: true, tissue: false, picture: true });
        let found = own.instead(rows.clone(), &scene);
        let errors: Vec<f64> = found.bone.iter().map(|row| row.error.at_most(&scene.bone_features())).collect();
        // Cutting in steps of 5 um is a hundredth of a newton in any voxels.
        assert!(errors.len() == 2 && errors.iter().all(|n| *n < 0.03), "{errors:?}");
        let errors: Vec<f64> = found.picture.iter().map(|row| row.error.at_most(&scene.picture_features())).collect();
        assert!(errors[0] > 1.2 * errors[1] && errors[2] == 0.0, "{errors:?}");
        assert_eq!(found.tissue, rows.tissue);
        let kept: CaseErrors = serde_json::from_str(&serde_json::to_string(&own).unwrap()).unwrap();
        assert_eq!(kept, own);
    }

    #[test]
    fn bone_cut_for_measuring_is_restored_and_finer_voxels_have_smaller_errors() {
        let (sight, scene) = (ball(), Scene::default());
        let skull = &sight.skull.as_ref().unwrap().0;
        let slide = Slide { scene, place: sight.entry, outward: sight.outward, turn_rad: 0.0, length_mm: SLIDE_MM };
        let stretch = Stretch::of(skull, &slide).unwrap();
        let choices: Vec<_> = Rows::stored().unwrap().bone.iter().map(|row| row.what).collect();
        let choices: Vec<_> = choices
            .into_iter()
            .filter(|c| c.method == "god-object-sphere" && [0.5, 2.0].contains(&c.spacing_mm))
            .collect();
        let errors = |stretch: &Stretch| stretch.measure(&choices).iter().map(|f| f.error_n).collect::<Vec<_>>();
        let before = errors(&stretch);
        let stretch = stretch.cutting();
        let cut = errors(&stretch);
        assert!(cut[0] < cut[1] && cut[1] < 0.03, "{cut:?}");
        assert!(cut.iter().zip(&before).all(|(cut, before)| cut >= before), "{cut:?} {before:?}");
        assert_eq!(errors(&stretch), cut, "the cut was not restored");
    }

    #[test]
    fn a_measured_error_replaces_the_law_which_keeps_its_slope_for_deeper_pushes() {
        let deep = Scene::default();
        let scene = Scene { tissue_motion_mm: deep.probe_radius_mm, ..deep };
        let mut rows = Rows::stored().unwrap();
        let names = |row: &Row<Tissue>| row.what.write();
        let tissue = rows.tissue.iter().take(2).map(|row| (names(row), 2.0)).collect();
        let own = CaseErrors { tissue, ..CaseErrors::default() };
        let found = own.instead(rows.clone(), &scene).tissue;
        rows.tissue.truncate(2);
        assert_eq!(found.iter().map(names).collect::<Vec<_>>(), rows.tissue.iter().map(names).collect::<Vec<_>>());
        for row in &found {
            let error = row.error.at_most(&scene.tissue_features());
            assert!((error - 2.0 * MARGIN[1]).abs() < 1e-9, "{error}");
        }
        let law = found[0].error;
        let over = law.at_most(&deep.tissue_features()) / law.at_most(&scene.tissue_features());
        let times = deep.tissue_motion_mm / deep.probe_radius_mm;
        assert!(times > 2.0 && (over - times.powf(law.weights[1])).abs() < 1e-9 && over > 1.2, "{over}");
    }

    #[test]
    fn without_bone_the_laws_are_kept() {
        let rows = Rows::stored().unwrap();
        let far = Sight { entry: 300.0 * Vec3::Z, ..ball() };
        let scene = Scene { picture_pixels: [64, 48], ..Scene::default() };
        let own = CaseErrors::of(&far, &scene, &rows, Element::Plain, 1);
        assert_eq!(own.instead(rows.clone(), &scene).bone, rows.bone);
        assert_eq!(CaseErrors::default().instead(rows.clone(), &scene), rows);
    }
}
