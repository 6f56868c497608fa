//! Brains with all their tissue classes: the outer surface against that of the unlabelled mesh.
//!
//! # Practice
//! The built-in head at the sizes of the presets and of `auto`'s largest mesh, the second head
//! where the shared data are, and heads of the population, with small elements at an opening to the
//! upper right. Distances are from points of the surface to the faces of the mask's voxels; by
//! voxel centres an exact sphere is 0.35 mm (95 %) off. What counts as the opening has edges under
//! 3 mm.

use super::{Part, Scope, faults};
use anyhow::{Context, Result};
use std::time::Instant;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Vec3, quantile};
use trepan_mesh::lattice::{Config, Domain, LabelledMesh};
use trepan_mesh::{Quality, Surface};
use trepan_patient::Fineness;
use trepan_trials_scenes::population::{BaseHead, Head, HeadRecipe, base_heads};
use trepan_volume::{DistanceField, Grid, Interpolation, VoxelVolume, resample};

/// Sizes of `draft`, `usual`, `fine` and the largest that `auto` chooses, and of a fine truth.
const SIZES: [(&str, usize); 5] =
    [("draft", 3_000), ("usual", 8_000), ("fine", 12_000), ("auto's largest", 20_000), ("50,000", 50_000)];
/// Heads of the population in a quick run and in a full one.
const HEADS: (u64, u64) = (1, 20);
/// Direction of the opening from the brain's middle.
const UPWARDS: Vec3 = Vec3::new(0.71, 0.18, 0.68);
/// Longest edge of a triangle at the opening, mm.
const OPENING_MM: f32 = 3.0;

/// Makes the classes of a head from the real ones; none if that head is not there.
type Labels = Box<dyn FnOnce(&[BaseHead]) -> Option<VoxelVolume<u16>>>;

/// A part for each head.
pub(super) fn parts(scope: Scope) -> Vec<Part> {
    let part = |name: String, labels: Labels| {
        Part::new(format!("classes: {name}"), move |scope, findings: &mut Findings| {
            let heads = base_heads().expect("the built-in head is there");
            if let Some(labels) = labels(&heads) {
                judge(&name, &labels, scope, findings).expect("the head has a brain that can be meshed");
            }
        })
    };
    let real = |at: usize| move |heads: &[BaseHead]| heads.get(at).map(|head| classes(&head.brain, &head.labels));
    let drawn = |number: u64| {
        move |heads: &[BaseHead]| {
            let recipe = HeadRecipe::drawn(scope.random(number).u64(1..u64::MAX), heads.len());
            let head = Head::make(&recipe, &heads[recipe.base]);
            Some(classes(&head.brain, &head.labels))
        }
    };
    let mut parts = vec![part("built-in head".into(), Box::new(real(0)))];
    if !scope.quick {
        parts.push(part("second head".into(), Box::new(real(1))));
    }
    parts.extend((1..=scope.pick(HEADS.0, HEADS.1)).map(|n| part(format!("head {n:03}"), Box::new(drawn(n)))));
    parts
}

/// Classes of a brain on cubes: 1, or white matter, grey matter, ventricles, basal ganglia.
fn classes(brain: &VoxelVolume<u8>, labels: &VoxelVolume<u16>) -> VoxelVolume<u16> {
    let mut classes = brain.map(u16::from);
    for (class, label) in classes.data.iter_mut().zip(&labels.data) {
        *class *= match label {
            2 | 41 => 2,
            3 | 42 => 3,
            4 | 5 | 14 | 15 | 43 | 44 => 4,
            11..=13 | 26 | 50..=52 | 58 => 7,
            _ => 1,
        };
    }
    let mm = classes.spacing_mm().min_element().clamp(0.8, 1.5) as f32;
    resample(&classes, &Grid::isotropic_over(&classes, mm), Interpolation::Majority, 0)
}

fn judge(name: &str, labels: &VoxelVolume<u16>, scope: Scope, findings: &mut Findings) -> Result<()> {
    let is_real = name.ends_with("head");
    let mask = trepan_volume::largest_component(&labels.map(|label| u8::from(label != 0)));
    let field = DistanceField::of_mask(&mask);
    let (bounds, up) = (mask.world_box(), UPWARDS.normalize());
    let along = (0..800).map(|n| bounds.centre() + (200.0 - 0.25 * n as f32) * up);
    let place = along.into_iter().find(|p| bounds.contains(*p) && field.sample(*p) <= 0.0).context("no brain")?;
    let coarsest = Config { target_tets: SIZES[0].1, ..Config::default() };
    let (labelled, plain) = (Domain::of(labels, &coarsest)?, Domain::of(&mask.map(u16::from), &coarsest)?);
    for (size, tets) in SIZES.into_iter().take(scope.pick(2, SIZES.len())) {
        let config = Config::with_opening(tets, Fineness::stepped(tets, 4).fine(place, up));
        let start = Instant::now();
        let with = labelled.labelled(&config)?;
        let seconds = start.elapsed().as_secs_f64();
        let without = plain.labelled(&config)?;
        let [is, was] = [&with, &without].map(|mesh| Outside::of(mesh, &field));
        let scene = format!("{name} with its classes, {size}");
        let quality = Quality::of(&with.mesh);
        let count_percent = 100.0 * (with.mesh.tets.len() as f64 / tets as f64 - 1.0).abs();
        let at_most = |what: &str, value, limit| Gate::at_most(format!("{scene}: {what}"), value, limit);
        let off = volume_percent(&with, labels);
        findings.gates.extend([
            at_most("surface, p95 over the unlabelled one's", is.p95_mm / was.p95_mm, 1.05),
            at_most("surface at the opening, p95 over the unlabelled one's", is.near_p95_mm / was.near_p95_mm, 1.05),
            at_most("area beside the unlabelled one's, percent", 100.0 * (is.area / was.area - 1.0).abs(), 2.0),
            at_most("elements beside the target, percent", count_percent, 10.0),
            at_most("volume error of the classes, percent of the brain", off, 1.0),
            at_most("faults (degenerate, open, in parts, sum of labels)", faults(&with, &Surface::of(&with.mesh)), 0.0),
            at_most("fine at an opening: largest dihedral angle, degrees", quality.max_dihedral_deg, 174.72),
            Gate::at_least(
                format!("{scene}: fine at an opening: smallest dihedral angle, degrees"),
                quality.min_dihedral_deg,
                1.66,
            ),
        ]);
        // The scanners of the population have voxels of up to some mm, the real heads of 1 mm.
        if is_real {
            findings.gates.extend([
                at_most("surface at the opening, p95 mm", is.near_p95_mm, 0.4),
                at_most("surface at the opening, most mm", is.near_most_mm, 0.7),
            ]);
        }
        findings.rows.push(
            Row::new(scene, "with classes")
                .with("target_tets", tets)
                .metric("tets_count", with.mesh.tets.len() as f64)
                .metric("mesh_s", seconds)
                .metric("surface_p95_mm", is.p95_mm)
                .metric("unlabelled_p95_mm", was.p95_mm)
                .metric("opening_p95_mm", is.near_p95_mm)
                .metric("opening_most_mm", is.near_most_mm)
                .metric("area_cm2", 0.01 * is.area)
                .metric("min_dihedral_deg", quality.min_dihedral_deg)
                .metric("max_dihedral_deg", quality.max_dihedral_deg)
                .metric("volume_error_percent", off),
        );
    }
    Ok(())
}

/// Volume that classes have too much or too little, summed, percent of the brain.
fn volume_percent(meshed: &LabelledMesh, labels: &VoxelVolume<u16>) -> f64 {
    let mut missing = [0.0; 8];
    labels.data.iter().for_each(|label| missing[usize::from(*label)] += labels.voxel_mm3());
    let all: f64 = missing[1..].iter().sum();
    let mut of_tet = meshed.shares.iter().map(|share| (share.tet as usize, share.label, share.share)).peekable();
    for tet in 0..meshed.mesh.tets.len() {
        let mm3 = meshed.mesh.volume_mm3(tet);
        if of_tet.peek().is_none_or(|share| share.0 != tet) {
            missing[usize::from(meshed.label_of_tet[tet])] -= mm3;
        }
        while let Some((_, label, share)) = of_tet.next_if(|share| share.0 == tet) {
            missing[usize::from(label)] -= mm3 * f64::from(share);
        }
    }
    100.0 * missing[1..].iter().map(|mm3: &f64| mm3.abs()).sum::<f64>() / all
}

/// How far the outer surface is from the mask.
struct Outside {
    area: f64,
    p95_mm: f64,
    near_p95_mm: f64,
    near_most_mm: f64,
}

impl Outside {
    fn of(meshed: &LabelledMesh, field: &DistanceField) -> Self {
        let mut random = fastrand::Rng::with_seed(1);
        let surface = Surface::of(&meshed.mesh);
        let area = surface.area_mm2(&meshed.mesh.positions);
        let (mut all, mut near) = (Vec::new(), Vec::new());
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(|n| meshed.mesh.positions[n as usize]);
            let twice = (b - a).cross(c - a).length();
            let is_near = (2.0 * twice / 3f32.sqrt()).sqrt() < OPENING_MM;
            // Points by area, more of them at the opening, which is a hundredth of the surface.
            for point in 0..(twice * if is_near { 5.0 } else { 0.5 }).ceil() as usize {
                let (s, t) = (random.f32().sqrt(), random.f32());
                let away = field.sample(a * (1.0 - s) + b * (s * (1.0 - t)) + c * (s * t)).abs().into();
                if is_near {
                    near.push(away);
                }
                if !is_near || point % 10 == 0 {
                    all.push(away);
                }
            }
        }
        let near_most_mm = near.iter().copied().fold(0.0, f64::max);
        Self { area, p95_mm: quantile(&mut all, 0.95), near_p95_mm: quantile(&mut near, 0.95), near_most_mm }
    }
}
