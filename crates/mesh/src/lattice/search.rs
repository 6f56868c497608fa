//! Finds the lattice spacing for the requested element count and the isolevels that preserve each
//! label's volume.
//!
//! # Theory
//! The count is proportional to a⁻³, and to about a^-2.5 if cubes grow inwards. Raising the outer
//! level by x₀ moves the outer surface by x₀, so that x₀ is the missing volume of all labels over
//! that surface's area. Raising the level of label l by x_l moves its boundary with k by (x_l −
//! x_k) / 2, so that the remaining deficit gives Σ_k A_lk (x_l − x_k) / 2 = missing_l − A_l0 x₀,
//! with A the areas between labels. A few Gauss-Seidel sweeps solve it.

use super::octree::{Cube, Lattice};
use super::regions::{Partition, Regions};
use super::{Config, LabelledMesh, manifold, stencil};
use crate::{FACES, MeshError, NONE, TetMesh, Topology};
use glam::DVec3;
use rayon::prelude::*;

/// Most iterations of the search for spacing and levels.
const TRIALS: usize = 12;
/// Largest lattice, in cubes per requested tetrahedron (a brain takes a fifth of one); some 250
/// bytes a cube.
const MAX_CUBES: usize = 10;
/// Tolerance that the search aims for; the documented one is 10 %.
const COUNT_TOLERANCE: f64 = 0.02;
const VOLUME_TOLERANCE: f64 = 0.002;
const ALL_TOLERANCE: f64 = 0.01;
/// Distance from a boundary up to which cubes have its size, in their edges beyond their own
/// corners. Over 0.14, all tetrahedra cut by a boundary are of one size.
const MARGIN: f64 = 0.15;
/// Gauss-Seidel sweeps over the levels.
const SWEEPS: usize = 40;

/// The spacing at which 12 tetrahedra a cube, plus a fifth at the surface, fill a volume.
pub(super) fn uniform_spacing(mm3: f64, tets: usize) -> f64 {
    (12.0 * 1.2 * mm3 / tets as f64).cbrt()
}

/// Approximate spacing of the finest cubes.
pub(super) fn first_spacing(regions: &Regions, config: &Config) -> f64 {
    let mut spacing = uniform_spacing(regions.mm3.iter().sum(), config.target_tets);
    if levels(config) == 0 {
        return spacing;
    }
    for _ in 0..5 {
        let Some(lattice) = lattice(regions, config, spacing, 0) else { break };
        let inside: Vec<bool> = lattice.positions().par_iter().map(|&p| regions.label_at(p) != 0).collect();
        let within = |tet: &&[u32; 4]| tet.iter().any(|&n| inside[n as usize]);
        let count = lattice.tets.par_iter().filter(within).count();
        spacing *= (1.1 * count as f64 / config.target_tets as f64).powf(0.4).clamp(0.3, 3.0);
    }
    spacing
}

/// A mesh and the lattice that it is cut from.
pub(super) struct Found {
    /// Labels are indices of regions.
    pub(super) labelled: LabelledMesh,
    /// Spacing of the finest cubes, mm.
    pub(super) spacing: f64,
    trial: usize,
}

/// Searches the mesh nearest to the request; leaves the boundary levels in `regions`.
pub(super) fn search(regions: &mut Regions, config: &Config, spacing: f64) -> Result<Found, MeshError> {
    let found = nearest(regions, config, (spacing, 0), false);
    let nearest = found.labelled.mesh.tets.len();
    if meets(nearest, config.target_tets) {
        return Ok(found);
    }
    Err(MeshError::Target { wanted: config.target_tets, nearest })
}

/// Divides a mesh by labels: same lattice, same outer surface. Searches the levels between labels.
pub(super) fn divide(regions: &mut Regions, config: &Config, whole: &Found) -> Found {
    nearest(regions, config, (whole.spacing, whole.trial), true)
}

/// Whether a count is within the documented tolerance.
pub(super) fn meets(tets: usize, wanted: usize) -> bool {
    tets.abs_diff(wanted) * 10 <= wanted
}

/// Searches the mesh nearest to the request from a spacing and the number of a trial on, which both
/// stay if the surface is given.
fn nearest(regions: &mut Regions, config: &Config, (mut spacing, first): (f64, usize), is_given: bool) -> Found {
    let wanted = config.target_tets;
    let power = if levels(config) == 0 { 1.0 / 3.0 } else { 0.4 };
    // A mesh that meets the count is better than any that does not.
    let mut best = ((true, f64::INFINITY), regions.levels.clone());
    let mut found = Found { labelled: LabelledMesh::default(), spacing, trial: first };
    let mut stride = Stride::of(regions.names.len());
    for trial in 0..TRIALS {
        regions.refine(config.fine, spacing);
        let trial = if is_given { first } else { trial };
        let Some(lattice) = lattice(regions, config, spacing, trial) else { break };
        let labelled = manifold::repaired(stencil::stuff(&lattice, regions));
        if labelled.mesh.tets.is_empty() {
            spacing *= if is_given { 1.0 } else { 0.7 };
            continue;
        }
        let share = labelled.mesh.tets.len() as f64 / wanted as f64;
        let balance = Balance::of(&labelled, regions);
        let count_fault = if is_given { 0.0 } else { (share - 1.0).abs() / COUNT_TOLERANCE };
        let fault = count_fault.max(balance.fault(regions, spacing));
        let rank = (!is_given && !meets(labelled.mesh.tets.len(), wanted), fault);
        if rank < best.0 {
            best = (rank, regions.levels.clone());
            found = Found { labelled, spacing, trial };
        }
        if fault < 1.0 {
            break;
        }
        stride.go(&mut regions.levels, &balance, spacing, is_given);
        if !is_given && (share - 1.0).abs() > 0.5 * COUNT_TOLERANCE {
            spacing *= share.powf(power).clamp(0.5, 2.0);
        }
    }
    regions.levels = best.1;
    regions.refine(config.fine, found.spacing);
    found
}

/// Step length of each level: reduced after each overshoot, which thin labels cause.
struct Stride {
    gains: Vec<f64>,
    missing: Vec<f64>,
}

impl Stride {
    fn of(count: usize) -> Self {
        Self { gains: vec![1.0; count], missing: vec![0.0; count] }
    }

    fn go(&mut self, levels: &mut [f64], balance: &Balance, spacing: f64, is_given: bool) {
        let steps = balance.steps(spacing, is_given);
        for (label, level) in levels.iter_mut().enumerate() {
            let missing = balance.missing[label];
            let overshot = missing * self.missing[label] < 0.0;
            self.gains[label] = if overshot { 0.4 * self.gains[label] } else { (1.3 * self.gains[label]).min(1.0) };
            self.missing[label] = missing;
            *level += self.gains[label] * steps[label];
        }
    }
}

/// How often the edge of a cube may double.
fn levels(config: &Config) -> u32 {
    config.coarsening + config.fine.map_or(0, |fine| fine.halvings)
}

fn lattice(regions: &Regions, config: &Config, spacing: f64, trial: usize) -> Option<Lattice> {
    let most = MAX_CUBES * config.target_tets.max(10_000);
    let judge = |centre: DVec3, level: u32| judge(regions, config, spacing, centre, level);
    Lattice::over(regions.bounds, spacing, shift(trial), levels(config), most, judge)
}

/// Offset of the lattice from the labels, in spacings; varied when the count does not converge
/// (small symmetric masks).
fn shift(trial: usize) -> DVec3 {
    let turn = (trial / 4) as f64;
    DVec3::new(0.13 + 0.21 * turn, 0.29 + 0.17 * turn, 0.41 + 0.11 * turn)
}

/// Whether a cube is fine enough: at a boundary as requested there, elsewhere up to `coarsening`
/// doublings larger.
fn judge(regions: &Regions, config: &Config, spacing: f64, centre: DVec3, level: u32) -> Cube {
    let edge = spacing * f64::from(1u32 << level);
    let to_corner = 0.75f64.sqrt() * edge;
    let (depth, outside) = regions.depth(centre);
    if outside && depth > 2.0 * edge {
        return Cube::Drop;
    }
    let finest = config.fine.map_or(0, |fine| {
        let away = centre.distance(fine.centre.as_dvec3()) - to_corner;
        if away > f64::from(fine.radius_mm) { fine.halvings } else { 0 }
    });
    let at_border = depth < to_corner + MARGIN * spacing * f64::from(1u32 << finest);
    if level > finest + config.coarsening || (level > finest && at_border) { Cube::Split } else { Cube::Keep }
}

/// Missing volume of each label, and areas between labels.
struct Balance {
    /// By label, mm³; the first entry is the sum.
    missing: Vec<f64>,
    /// Areas between labels, mm², row by row.
    areas: Vec<f64>,
}

impl Balance {
    fn of(labelled: &LabelledMesh, regions: &Regions) -> Self {
        let LabelledMesh { mesh, label_of_tet, .. } = labelled;
        let count = regions.names.len();
        let mut missing = regions.mm3.clone();
        let mut areas = vec![0.0; count * count];
        let topology = Topology::of(mesh);
        for (tet, &label) in label_of_tet.iter().enumerate() {
            let own = usize::from(label);
            missing[own] -= mesh.volume_mm3(tet);
            for (face, &next) in topology.neighbours[tet].iter().enumerate() {
                let other = if next == NONE { 0 } else { usize::from(label_of_tet[next as usize]) };
                if other != own {
                    areas[own * count + other] += area(mesh, tet, face);
                }
            }
        }
        missing[0] = missing[1..].iter().sum();
        Self { missing, areas }
    }

    /// The largest volume error of a label thicker than about a cube, or of the sum, relative to
    /// the tolerance.
    fn fault(&self, regions: &Regions, spacing: f64) -> f64 {
        let count = self.missing.len();
        let one = spacing.powi(3) / 12.0;
        let mut worst = 0.0f64;
        for label in 1..count {
            let (missing, mm3) = (self.missing[label].abs(), regions.mm3[label]);
            let area: f64 = self.areas[label * count..(label + 1) * count].iter().sum();
            if mm3 > 0.5 * area * spacing && area > 0.0 {
                worst = worst.max(missing / (VOLUME_TOLERANCE * mm3).max(one));
            }
        }
        let all = regions.mm3.iter().sum::<f64>();
        let each = self.missing[1..].iter().map(|m| m.abs()).sum::<f64>();
        worst.max(each / (ALL_TOLERANCE * all)).max(self.missing[0].abs() / (VOLUME_TOLERANCE * all))
    }

    /// Correction of each level, mm; none of the first if the outer surface is given.
    fn steps(&self, spacing: f64, is_given: bool) -> Vec<f64> {
        let count = self.missing.len();
        let most = 0.3 * spacing;
        let row = |own: usize| &self.areas[own * count..(own + 1) * count];
        let outer: f64 = (1..count).map(|own| row(own)[0]).sum();
        let mut steps = vec![0.0; count];
        steps[0] = if is_given { 0.0 } else { (self.missing[0] / outer).clamp(-most, most) };
        for _ in 0..SWEEPS {
            for own in 1..count {
                let others = row(own).iter().zip(&steps).skip(1);
                let (area, pull) = others.fold((0.0, 0.0), |(a, p), (area, x)| (a + area, p + area * x));
                let lacks = self.missing[own] - row(own)[0] * steps[0];
                let gone = area + row(own)[0] == 0.0;
                let step = if area > 0.0 { (2.0 * lacks + pull) / area } else { 0.0 };
                steps[own] = if gone { 0.1 * spacing } else { step.clamp(-most, most) };
            }
        }
        steps
    }
}

fn area(mesh: &TetMesh, tet: usize, face: usize) -> f64 {
    let [a, b, c] = FACES[face].map(|corner| mesh.corners(tet)[corner].as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}
