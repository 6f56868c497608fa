//! Meshes a mask or a label volume with tetrahedra: a warped and cut body-centred cubic lattice.
//!
//! # Theory
//! Isosurface stuffing (Labelle and Shewchuk 2007) on smoothed signed distances, one for each
//! label: cubes are as fine as [`Config`] requests. Where labels meet, the lattice is warped and
//! cut, so that both sides share the boundary triangles. Two sets of unknowns are solved together:
//! the lattice spacing a, from the requested count, and for each label the isolevel of its
//! distance, so that it keeps the volume of its voxels (dV/dlevel = area). Flat triangles cut off
//! convex parts and smoothing shrinks them; the level compensates both. Finally nodes move to
//! increase the height of the flattest elements.
//!
//! The outer surface is found first, as if there were one label, and stays: only then is the inside
//! divided. Structures thicker than a few cubes get borders of their own; where labels are thinner,
//! tetrahedra are not cut but take them by their shares of the volume.
//!
//! # Practice
//! World mm; any affine. Equal labels give bit-identical results for any number of threads.
//!
//! # Sources
//! F. Labelle, J. R. Shewchuk: Isosurface stuffing, ACM Transactions on Graphics 26(3), 2007. J.
//! Bronson, J. A. Levine, R. Whitaker: Lattice cleaving, International Meshing Roundtable 21, 2012.
//!
//! # When not to use it
//! For sharp edges or surfaces that must interpolate given points (they are rounded at the scale of
//! a), and for bodies thinner than about 2 a (they may break up). Where three labels meet, their
//! common line is accurate to about half of a only.

mod blur;
mod field;
mod manifold;
mod octree;
mod polish;
mod regions;
mod search;
mod stencil;
#[cfg(test)]
mod stencil_bounds;
mod thick;

use crate::materials::{self, Share};
use crate::{MeshError, TetMesh};
use regions::Regions;
use std::sync::OnceLock;
use thick::Thickness;
use trepan_geometry::Vec3;
use trepan_volume::VoxelVolume;

/// Parameters of the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Requested number of tetrahedra, 100 to 20 million; met within 10 %. More is finer.
    pub target_tets: usize,
    /// Width of the Gaussian over the distance field, in lattice spacings, 0 to 2, at least 0.75
    /// voxels. More rounds off detail under the lattice's resolution; less keeps it, with a rough
    /// surface.
    pub smoothing: f64,
    /// How often the edge of the cubes may double from label boundaries to the inside, 0 to 6. More
    /// follows the boundaries better for the same count, with smaller elements there, which shorten
    /// an explicit solver's step.
    pub coarsening: u32,
    /// Region with a finer boundary.
    pub fine: Option<Fine>,
    /// Least thickness of a label with borders of its own, in spacings of the cubes there, 0 or
    /// more. A layer at the outer surface needs half. Thinner ones become shares of tetrahedra, all
    /// of them at infinity. Under 1.5 borders may be ragged and labels lost.
    pub least_thickness: f64,
}

/// A ball with smaller elements: the planned opening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fine {
    /// Its centre, world mm.
    pub centre: Vec3,
    /// Its radius, mm, over 0. Beyond it, elements grow to about twice their size.
    pub radius_mm: f32,
    /// How often the edge of the cubes at a boundary is halved inside, 1 to 4: 2 makes them four
    /// times finer.
    pub halvings: u32,
}

/// A mesh with a label for each tetrahedron.
///
/// Labels with borders of their own meet in triangles shared by the tetrahedra of both sides.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelledMesh {
    /// All tetrahedra.
    pub mesh: TetMesh,
    /// The volume's label of each tetrahedron; never 0. Of several the one with the largest share.
    pub label_of_tet: Vec<u16>,
    /// The labels of tetrahedra in the region where labels have no borders of their own, ascending
    /// by tetrahedron, then label. Empty if there is no such region.
    pub shares: Vec<Share>,
}

impl Default for Config {
    /// A brain for a whole operation: fine enough to deform smoothly, coarse enough for real time
    /// on a CPU.
    fn default() -> Self {
        Self { target_tets: 15_000, smoothing: 0.3, coarsening: 0, fine: None, least_thickness: 2.0 }
    }
}

/// Fills the largest 6-connected part of a mask (nonzero voxels) with tetrahedra.
///
/// The result passes [`TetMesh::check`], is face-connected, and has a closed surface.
pub fn tetrahedra(mask: &VoxelVolume<u8>, config: &Config) -> Result<TetMesh, MeshError> {
    labelled(&mask.map(|v| u16::from(v != 0)), config).map(|labelled| labelled.mesh)
}

/// Fills the largest 6-connected labelled part (nonzero voxels) with tetrahedra of one label each.
///
/// The mesh is as valid as that of [`tetrahedra`], and has its outer surface: with `coarsening` 0
/// the same bits (but where nodes move for the height of an element) as long as labels add less
/// than 10 % of the tetrahedra. Borders between labels follow the voxels like the outer surface.
/// Each label with a border keeps the volume of its voxels within 0.2 % or one tetrahedron; the
/// others keep theirs in `shares`.
pub fn labelled(labels: &VoxelVolume<u16>, config: &Config) -> Result<LabelledMesh, MeshError> {
    Domain::of(labels, config)?.labelled(config)
}

/// A label volume prepared for several meshes: the distance to the outer surface.
///
/// It takes most of the time of a mesh of few tetrahedra.
pub struct Domain {
    labels: VoxelVolume<u16>,
    whole: Regions,
    /// Made when a mesh first needs it.
    thickness: OnceLock<Thickness>,
}

/// Most times that the outer surface is searched anew because labels add too many tetrahedra.
const ROUNDS: usize = 4;

impl Domain {
    /// Computes the distance, with a margin for the smoothing of the coarsest mesh that is wanted.
    ///
    /// # Errors
    /// If the volume has no labels or too many, or a setting is out of range.
    pub fn of(labels: &VoxelVolume<u16>, coarsest: &Config) -> Result<Self, MeshError> {
        check_config(coarsest)?;
        let most_mm = |mm3| coarsest.smoothing * search::uniform_spacing(mm3, coarsest.target_tets);
        let labels = regions::largest_part(labels)?;
        Ok(Self { whole: Regions::whole(&labels, most_mm), labels, thickness: OnceLock::new() })
    }

    /// Fills the labels with tetrahedra, as the function [`labelled`].
    ///
    /// # Errors
    /// If a setting is out of range or no mesh has about the requested count.
    pub fn labelled(&self, config: &Config) -> Result<LabelledMesh, MeshError> {
        check_config(config)?;
        let wanted = config.target_tets;
        let mut aim = *config;
        let mut nearest = 0;
        for _ in 0..ROUNDS {
            let mut whole = self.whole.clone();
            let spacing = search::first_spacing(&whole, &aim);
            whole.smooth(aim.smoothing * spacing);
            let found = search::search(&mut whole, &aim, spacing)?;
            let borders = match aim.least_thickness {
                0.0 => self.labels.clone(),
                _ => self.thickness.get_or_init(|| Thickness::of(&self.labels)).borders(
                    &self.labels,
                    &aim,
                    found.spacing,
                ),
            };
            let mut regions = whole.divided(&borders, aim.smoothing * spacing);
            let has_one = regions.names.len() == 2;
            let found = if has_one { found } else { search::divide(&mut regions, &aim, &found) };
            nearest = found.labelled.mesh.tets.len();
            if search::meets(nearest, wanted) {
                return Ok(self.finished(found, &regions, &borders));
            }
            aim.target_tets = (aim.target_tets as f64 * wanted as f64 / nearest.max(1) as f64) as usize;
            aim.target_tets = aim.target_tets.max(100);
        }
        Err(MeshError::Target { wanted, nearest })
    }

    /// Moves nodes of flat elements, and gives each tetrahedron its labels.
    fn finished(&self, found: search::Found, regions: &Regions, borders: &VoxelVolume<u16>) -> LabelledMesh {
        let mut labelled = found.labelled;
        polish::polish(&mut labelled, found.spacing, regions);
        labelled.label_of_tet.iter_mut().for_each(|label| *label = regions.names[usize::from(*label)]);
        let differs = |(label, border): (&u16, &u16)| label != border;
        let Some(at) = self.labels.data.iter().zip(&borders.data).position(differs) else { return labelled };
        let host = borders.data[at];
        let mut thin = self.labels.clone();
        thin.data.iter_mut().zip(&borders.data).for_each(|(label, border)| *label *= u16::from(*border == host));
        let all = materials::shares(&labelled.mesh, &thin, |tet| labelled.label_of_tet[tet] == host);
        for of_tet in all.chunk_by(|a, b| a.tet == b.tet) {
            let most = of_tet.iter().max_by(|a, b| a.share.total_cmp(&b.share).then(b.label.cmp(&a.label)));
            labelled.label_of_tet[of_tet[0].tet as usize] = most.map_or(host, |most| most.label);
            labelled.shares.extend(of_tet);
        }
        labelled
    }
}

impl Config {
    /// A brain with an opening: with small elements there, whose surface is smoothed as little as
    /// voxels allow.
    pub fn with_opening(target_tets: usize, fine: Option<Fine>) -> Self {
        let usual = Self::default();
        let smoothing = if fine.is_some() { usual.smoothing / 3.0 } else { usual.smoothing };
        Self { target_tets, smoothing, fine, ..usual }
    }
}

fn check_config(config: &Config) -> Result<(), MeshError> {
    let fine = config.fine.unwrap_or(Fine { centre: Vec3::ZERO, radius_mm: 1.0, halvings: 1 });
    let off = fine.centre.length();
    let checks = [
        ("target_tets", config.target_tets as f64, 100.0..=2e7, "100 to 20000000"),
        ("smoothing", config.smoothing, 0.0..=2.0, "0 to 2 lattice spacings"),
        ("coarsening", f64::from(config.coarsening), 0.0..=6.0, "0 to 6 doublings"),
        ("least_thickness", config.least_thickness, 0.0..=f64::INFINITY, "0 or more lattice spacings"),
        ("fine.centre", f64::from(off), 0.0..=1e6, "finite, within a kilometre"),
        ("fine.radius_mm", f64::from(fine.radius_mm), 1e-3..=1e6, "0.001 to 1000000 mm"),
        ("fine.halvings", f64::from(fine.halvings), 1.0..=4.0, "1 to 4"),
    ];
    match checks.into_iter().find(|(_, got, range, _)| !range.contains(got)) {
        Some((field, got, _, wanted)) => Err(MeshError::Config { field, got, wanted }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Quality, Surface, Topology};
    use glam::{DAffine3, DMat3, DVec3};
    use proptest::prelude::*;

    fn mask_of(dims: [usize; 3], world_from_voxel: DAffine3, inside: impl Fn(DVec3) -> bool) -> VoxelVolume<u8> {
        volume_with(dims, world_from_voxel, |p| u16::from(inside(p))).map(|l| l as u8)
    }

    fn volume_with(dims: [usize; 3], world_from_voxel: DAffine3, label: impl Fn(DVec3) -> u16) -> VoxelVolume<u16> {
        let mut labels = VoxelVolume::filled(dims, world_from_voxel, 0);
        for at in 0..labels.data.len() {
            let voxel = [at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])];
            labels.data[at] = label(labels.centre_of(voxel));
        }
        labels
    }

    fn millimetres(n: usize) -> DAffine3 {
        DAffine3::from_translation(DVec3::splat(-0.5 * (n as f64 - 1.0)))
    }

    fn assert_sound(mesh: &TetMesh, target: usize, mm3: f64) {
        assert_eq!(mesh.check(), Ok(()));
        assert!(Surface::of(mesh).is_closed());
        assert_eq!(Topology::of(mesh).components().1, 1);
        assert!(mesh.tets.len().abs_diff(target) * 10 <= target, "{} for {target}", mesh.tets.len());
        assert!((mesh.total_mm3() / mm3 - 1.0).abs() < 0.01, "{}", mesh.total_mm3() / mm3);
        let quality = Quality::of(mesh);
        assert!(quality.min_dihedral_deg > 15.0 && quality.max_dihedral_deg < 155.0, "{quality:?}");
    }

    #[test]
    fn a_ball_has_its_volume_and_lies_on_its_surface() {
        let mask = mask_of([64; 3], millimetres(64), |p| p.length() < 28.0);
        let mesh = tetrahedra(&mask, &Config { target_tets: 8000, ..Config::default() }).unwrap();
        assert_sound(&mesh, 8000, 4.0 / 3.0 * std::f64::consts::PI * 28f64.powi(3));
        for node in Surface::of(&mesh).nodes() {
            let radius = mesh.positions[node as usize].length();
            assert!((radius - 28.0).abs() < 0.5, "{radius}");
        }
    }

    #[test]
    fn labels_that_are_all_too_thin_for_borders_keep_their_shares() {
        let labels = volume_with([60; 3], millimetres(60), |p| match p.x.abs() < 1.0 {
            _ if p.length() > 25.0 => 0,
            true => 2,
            false => 5,
        });
        let LabelledMesh { mesh, label_of_tet, shares } =
            labelled(&labels, &Config { target_tets: 1_500, ..Config::default() }).unwrap();
        let most = label_of_tet.iter().filter(|label| **label == 5).count();
        assert!(most * 10 > 9 * label_of_tet.len(), "{most} of {}", label_of_tet.len());
        let of_sheet = shares.iter().filter(|share| share.label == 2);
        let mm3: f64 = of_sheet.map(|share| f64::from(share.share) * mesh.volume_mm3(share.tet as usize)).sum();
        let voxels = labels.data.iter().filter(|label| **label == 2).count() as f64;
        assert!((mm3 / voxels - 1.0).abs() < 0.1, "{mm3} mm3 for {voxels}");
    }

    /// Volume of each label's tetrahedra, mm³.
    fn volume_of(labelled: &LabelledMesh, label: u16) -> f64 {
        let tets = (0..labelled.mesh.tets.len()).filter(|&t| labelled.label_of_tet[t] == label);
        tets.map(|t| labelled.mesh.volume_mm3(t)).sum()
    }

    /// The boundary surface of one label's tetrahedra.
    fn border_of(labelled: &LabelledMesh, label: u16) -> (TetMesh, Surface) {
        let LabelledMesh { mesh, label_of_tet, .. } = labelled;
        let tets = mesh.tets.iter().zip(label_of_tet).filter(|(_, l)| **l == label).map(|(t, _)| *t).collect();
        let part = TetMesh { positions: mesh.positions.clone(), tets }.without_orphans();
        let surface = Surface::of(&part);
        (part, surface)
    }

    #[test]
    fn a_ball_in_a_ball_has_both_volumes_and_the_border_between() {
        let radii = [25.0, 14.0];
        let inside = |p: DVec3, r: f64| p.length() < r;
        let labels = volume_with([60; 3], millimetres(60), |p| {
            if inside(p, radii[1]) { 500 } else { 7 * u16::from(inside(p, radii[0])) }
        });
        let labelled = labelled(&labels, &Config { target_tets: 12_000, ..Config::default() }).unwrap();
        let ball = |r: f64| 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        assert_sound(&labelled.mesh, 12_000, ball(radii[0]));
        for (label, truth) in [(7, ball(radii[0]) - ball(radii[1])), (500, ball(radii[1]))] {
            let share = volume_of(&labelled, label) / truth;
            assert!((share - 1.0).abs() < 0.01, "{label}: {share}");
        }
        assert!((volume_of(&labelled, 7) + volume_of(&labelled, 500) - labelled.mesh.total_mm3()).abs() < 1e-6);
        let (inner, border) = border_of(&labelled, 500);
        assert!(border.is_closed());
        for node in border.nodes() {
            let radius = inner.positions[node as usize].length();
            assert!((radius - 14.0).abs() < 0.5, "{radius}");
        }
    }

    /// A folded body: a ball with a wavy surface, whose outer shell follows the waves.
    fn folded(p: DVec3) -> u16 {
        let radius = 24.0 + 2.5 * (0.6 * p.x).sin() * (0.5 * p.y).cos() - p.length();
        match radius {
            r if r < 0.0 => 0,
            r if r < 3.0 => 3,
            _ if p.length() < 8.0 => 4,
            _ if p.x > 3.0 && p.y > -2.0 => 7,
            _ => 2,
        }
    }

    #[test]
    fn whatever_lies_inside_the_outer_surface_is_that_of_the_unlabelled_body() {
        let labels = volume_with([64; 3], millimetres(64), folded);
        let fine = Some(Fine { centre: Vec3::new(0.0, 0.0, 25.0), radius_mm: 6.0, halvings: 2 });
        for (target_tets, fine) in [(1_500, None), (6_000, None), (6_000, fine)] {
            let with = |least_thickness| Config { target_tets, fine, least_thickness, ..Config::default() };
            let plain = tetrahedra(&labels.map(|label| label as u8), &with(2.0)).unwrap();
            let mixed = labelled(&labels, &with(f64::INFINITY)).unwrap();
            assert_eq!(mixed.mesh, plain);
            let some = labelled(&labels, &with(2.0)).unwrap();
            assert!(some.mesh.tets.len().abs_diff(target_tets) * 10 <= target_tets);
            // As cut they are the same bits (`stencil_bounds`); then nodes move for their elements.
            let [of_plain, of_some] = [&plain, &some.mesh].map(|mesh| (Surface::of(mesh), mesh));
            assert_eq!(of_some.0.triangles.len(), of_plain.0.triangles.len());
            let [area, of_some] = [of_plain, of_some].map(|(surface, mesh)| surface.area_mm2(&mesh.positions));
            assert!((of_some / area - 1.0).abs() < 2e-3, "{of_some} {area}");
            // Even where every label has borders, which takes coarser cubes.
            let all = labelled(&labels, &with(0.0)).unwrap();
            assert!(all.shares.is_empty());
            let area = |mesh: &TetMesh| Surface::of(mesh).area_mm2(&mesh.positions);
            assert!((area(&all.mesh) / area(&plain) - 1.0).abs() < 0.02, "{}", area(&all.mesh) / area(&plain));
        }
    }

    #[test]
    fn thin_labels_become_shares_that_keep_their_volume_and_thick_ones_keep_their_border() {
        let labels = volume_with([64; 3], millimetres(64), |p| match p.length() {
            r if r < 14.0 => 9,
            r if r < 25.0 => 5,
            r if r < 27.0 => 6,
            _ => 0,
        });
        let meshed = labelled(&labels, &Config { target_tets: 8_000, ..Config::default() }).unwrap();
        assert_sound(&meshed.mesh, 8_000, 4.0 / 3.0 * std::f64::consts::PI * 27f64.powi(3));
        let mixed = |label: u16| -> f64 {
            let of_label = meshed.shares.iter().filter(|share| share.label == label);
            of_label.map(|share| f64::from(share.share) * meshed.mesh.volume_mm3(share.tet as usize)).sum()
        };
        let voxels = |label: u16| labels.data.iter().filter(|l| **l == label).count() as f64;
        assert_eq!(mixed(9), 0.0);
        assert!((volume_of(&meshed, 9) / voxels(9) - 1.0).abs() < 0.01);
        assert!(border_of(&meshed, 9).1.is_closed());
        for label in [5, 6] {
            assert!((mixed(label) / voxels(label) - 1.0).abs() < 0.03, "{label}: {} {}", mixed(label), voxels(label));
        }
        for of_tet in meshed.shares.chunk_by(|a, b| a.tet == b.tet) {
            assert!((of_tet.iter().map(|share| share.share).sum::<f32>() - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn one_domain_gives_the_meshes_of_every_config() {
        let labels = volume_with([44; 3], millimetres(44), |p| u16::from(p.length() < 18.0));
        let config = |target_tets| Config { target_tets, ..Config::default() };
        let domain = Domain::of(&labels, &config(2_000)).unwrap();
        assert_eq!(domain.labelled(&config(2_000)).unwrap(), labelled(&labels, &config(2_000)).unwrap());
        let finer = domain.labelled(&config(9_000)).unwrap();
        assert_sound(&finer.mesh, 9_000, 4.0 / 3.0 * std::f64::consts::PI * 18f64.powi(3));
        assert_eq!(domain.labelled(&config(2_000)).unwrap(), labelled(&labels, &config(2_000)).unwrap());
    }

    #[test]
    fn a_ball_coarse_inside_has_its_count_and_follows_its_surface_more_closely() {
        let mask = mask_of([64; 3], millimetres(64), |p| p.length() < 28.0);
        let of = |coarsening| {
            let config = Config { target_tets: 20_000, coarsening, ..Config::default() };
            let mesh = tetrahedra(&mask, &config).unwrap();
            assert_sound(&mesh, 20_000, 4.0 / 3.0 * std::f64::consts::PI * 28f64.powi(3));
            mesh
        };
        let (even, graded) = (of(0), of(3));
        let triangles = [&even, &graded].map(|mesh| Surface::of(mesh).triangles.len());
        assert!(triangles[1] * 10 > triangles[0] * 13, "{triangles:?}");
        assert!(Quality::of(&graded).max_edge_mm > 1.2 * Quality::of(&even).max_edge_mm);
    }

    #[test]
    fn a_ball_is_finer_near_a_point() {
        let mask = mask_of([64; 3], millimetres(64), |p| p.length() < 28.0);
        let fine = Some(Fine { centre: Vec3::new(0.0, 0.0, 28.0), radius_mm: 10.0, halvings: 2 });
        let config = Config { target_tets: 15_000, coarsening: 1, fine, ..Config::default() };
        let mesh = tetrahedra(&mask, &config).unwrap();
        assert_eq!(mesh.check(), Ok(()));
        let surface = Surface::of(&mesh);
        assert!(surface.is_closed());
        assert!(mesh.tets.len().abs_diff(15_000) < 1500);
        assert!((mesh.total_mm3() / (4.0 / 3.0 * std::f64::consts::PI * 28f64.powi(3)) - 1.0).abs() < 0.01);
        let quality = Quality::of(&mesh);
        assert!(quality.min_dihedral_deg > 5.0 && quality.max_dihedral_deg < 170.0, "{quality:?}");
        let area = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|n| mesh.positions[n as usize]);
            0.5 * (b - a).cross(c - a).length()
        };
        let mean = |near: bool| {
            let here = |t: &&[u32; 3]| (mesh.positions[t[0] as usize].z > 20.0) == near;
            let (count, sum) = surface.triangles.iter().filter(here).fold((0, 0.0), |(n, s), t| (n + 1, s + area(t)));
            sum / count as f32
        };
        // Two halvings: triangles of a sixteenth, except across the rim of the ball.
        assert!(mean(false) > 8.0 * mean(true), "{} {}", mean(false), mean(true));
    }

    /// What the coarse part lacks in volume is not made up for in the finer one.
    #[test]
    fn a_finer_region_lies_on_the_surface() {
        let mask = mask_of([64; 3], millimetres(64), |p| p.length() < 28.0);
        let fine = Some(Fine { centre: Vec3::new(0.0, 0.0, 28.0), radius_mm: 10.0, halvings: 2 });
        let mesh = tetrahedra(&mask, &Config { target_tets: 1500, fine, ..Config::default() }).unwrap();
        assert!((mesh.total_mm3() / (4.0 / 3.0 * std::f64::consts::PI * 28f64.powi(3)) - 1.0).abs() < 0.01);
        let nodes = Surface::of(&mesh).nodes();
        let radii = nodes.iter().map(|n| mesh.positions[*n as usize]);
        let near: Vec<f32> = radii.filter(|p| p.truncate().length() < 8.0 && p.z > 0.0).map(Vec3::length).collect();
        let mean = near.iter().sum::<f32>() / near.len() as f32;
        assert!(near.len() > 10 && (mean - 28.0).abs() < 0.12, "{mean} mm at {} nodes", near.len());
    }

    #[test]
    fn three_labels_that_meet_leave_no_gap() {
        let labels = volume_with([50; 3], millimetres(50), |p| {
            if p.length() > 20.0 {
                0
            } else if p.x > 1.3 {
                1
            } else {
                2 + u16::from(p.y > 0.4 * p.z)
            }
        });
        let config = Config { target_tets: 10_000, least_thickness: 0.0, ..Config::default() };
        let labelled = labelled(&labels, &config).unwrap();
        assert_sound(&labelled.mesh, 10_000, 4.0 / 3.0 * std::f64::consts::PI * 8000.0);
        for label in 1..4 {
            let voxels = labels.data.iter().filter(|l| **l == label).count() as f64;
            assert!((volume_of(&labelled, label) / voxels - 1.0).abs() < 0.01);
            assert!(border_of(&labelled, label).1.is_closed());
        }
    }

    #[test]
    fn a_torus_keeps_its_hole() {
        let ring = |p: DVec3| DVec3::new(p.x.hypot(p.y) - 20.0, 0.0, p.z).length() < 8.0;
        let mesh = tetrahedra(
            &mask_of([64, 64, 24], DAffine3::from_translation(DVec3::new(-31.5, -31.5, -11.5)), ring),
            &Config { target_tets: 6000, ..Config::default() },
        )
        .unwrap();
        assert_sound(&mesh, 6000, 2.0 * std::f64::consts::PI.powi(2) * 20.0 * 64.0);
        let surface = Surface::of(&mesh);
        let euler = surface.nodes().len() as i64 - surface.triangles.len() as i64 / 2;
        assert_eq!(euler, 0);
    }

    #[test]
    fn an_oblique_anisotropic_mirrored_grid_lands_in_the_world() {
        let turn = DMat3::from_rotation_z(0.4) * DMat3::from_rotation_x(-0.7);
        let world_from_voxel = DAffine3::from_mat3_translation(
            turn * DMat3::from_diagonal(DVec3::new(-1.0, 1.5, 3.0)),
            DVec3::new(40.0, -90.0, 10.0),
        );
        let centre = world_from_voxel.transform_point3(DVec3::new(30.0, 20.0, 10.0));
        let mask = mask_of([60, 40, 20], world_from_voxel, |p| p.distance(centre) < 24.0);
        let mesh = tetrahedra(&mask, &Config { target_tets: 4000, ..Config::default() }).unwrap();
        let voxels = mask.data.iter().filter(|v| **v != 0).count();
        assert_sound(&mesh, 4000, voxels as f64 * mask.voxel_mm3());
        assert!((mesh.bounds().centre().as_dvec3() - centre).length() < 1.0);
    }

    #[test]
    fn the_same_mask_gives_the_same_bytes_on_any_number_of_threads() {
        let mask = mask_of([40; 3], millimetres(40), |p| p.length() < 15.0 && p.x < 9.0);
        let config = Config { target_tets: 3000, ..Config::default() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(tetrahedra(&mask, &config).unwrap(), pool.install(|| tetrahedra(&mask, &config)).unwrap());
    }

    #[test]
    fn a_mask_that_fills_its_grid_is_closed() {
        let mask = VoxelVolume::filled([20, 24, 18], DAffine3::IDENTITY, 7u8);
        let mesh = tetrahedra(&mask, &Config { target_tets: 3000, ..Config::default() }).unwrap();
        assert_sound(&mesh, 3000, 20.0 * 24.0 * 18.0);
    }

    #[test]
    fn only_the_largest_part_is_meshed() {
        let mask = mask_of([60, 30, 30], millimetres(30), |p| {
            p.length() < 12.0 || p.distance(DVec3::new(35.0, 0.0, 0.0)) < 7.0
        });
        let mesh = tetrahedra(&mask, &Config { target_tets: 2000, ..Config::default() }).unwrap();
        assert_sound(&mesh, 2000, 4.0 / 3.0 * std::f64::consts::PI * 12f64.powi(3));
    }

    #[test]
    fn a_sheet_that_the_lattice_cannot_hold_is_refused() {
        let mut sheet = VoxelVolume::filled([120, 120, 3], DAffine3::IDENTITY, 0u8);
        (14_400..28_800).for_each(|at| sheet.data[at] = 1);
        let refused = tetrahedra(&sheet, &Config { target_tets: 300, smoothing: 2.0, ..Config::default() });
        assert!(matches!(refused, Err(MeshError::Target { wanted: 300, .. })), "{refused:?}");
    }

    /// Labels thinner than the tetrahedra keep their volumes badly in every mesh; the count is met
    /// all the same.
    #[test]
    fn thin_labels_do_not_cost_the_count() {
        for radius in [2.0, 2.5, 3.0, 3.5, 4.0] {
            let mut labels = mask_of([80; 3], millimetres(80), |p| p.length() < 36.0).map(u16::from);
            let spots = mask_of([80; 3], millimetres(80), |p| p.distance(DVec3::new(9.0, 4.0, 7.0)) < radius);
            let shell = mask_of([80; 3], millimetres(80), |p| (p.length() - 33.0).abs() < 0.5 * radius);
            for (label, (spot, shell)) in labels.data.iter_mut().zip(spots.data.iter().zip(&shell.data)) {
                *label += u16::from(*spot) + 2 * u16::from(*shell);
            }
            let fine = Some(Fine { centre: Vec3::new(0.0, 0.0, 36.0), radius_mm: 20.0, halvings: 1 });
            let config = Config { target_tets: 1500, fine, ..Config::default() };
            let tets = labelled(&labels, &config).unwrap_or_else(|fault| panic!("{radius} mm: {fault}")).mesh.tets;
            assert!(tets.len().abs_diff(1500) <= 150, "{radius} mm: {}", tets.len());
        }
    }

    #[test]
    fn bad_input_has_its_own_error() {
        let good = mask_of([20; 3], millimetres(20), |p| p.length() < 8.0);
        let config = Config { target_tets: 1000, ..Config::default() };
        assert_eq!(tetrahedra(&good.map(|_| 0), &config), Err(MeshError::EmptyMask));
        let mut flat = good.clone();
        flat.world_from_voxel.matrix3.y_axis = DVec3::ZERO;
        assert!(matches!(tetrahedra(&flat, &config), Err(MeshError::Mask { field: "world_from_voxel", .. })));
        let mut short = good.clone();
        short.data.pop();
        assert!(matches!(tetrahedra(&short, &config), Err(MeshError::Mask { field: "dims", .. })));
        let error = |config: Config| tetrahedra(&good, &config).unwrap_err();
        assert!(matches!(error(Config { target_tets: 0, ..config }), MeshError::Config { field: "target_tets", .. }));
        assert!(matches!(error(Config { coarsening: 7, ..config }), MeshError::Config { field: "coarsening", .. }));
        let fine = |radius_mm, halvings| Some(Fine { centre: Vec3::ZERO, radius_mm, halvings });
        let wrong = Config { fine: fine(f32::NAN, 1), ..config };
        assert!(matches!(error(wrong), MeshError::Config { field: "fine.radius_mm", .. }));
        assert!(matches!(
            error(Config { fine: fine(1.0, 0), ..config }),
            MeshError::Config { field: "fine.halvings", .. }
        ));
        let mut image = VoxelVolume::filled([20; 3], DAffine3::IDENTITY, 0u16);
        image.data.iter_mut().enumerate().for_each(|(n, label)| *label = n as u16);
        assert!(matches!(labelled(&image, &config), Err(MeshError::Mask { field: "data", .. })));
        assert!(matches!(
            error(Config { smoothing: f64::NAN, ..config }),
            MeshError::Config { field: "smoothing", .. }
        ));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4))]
        #[test]
        fn rough_masks_still_give_sound_meshes(seed in any::<u64>(), full in 40u64..100) {
            let mut state = seed | 1;
            let mut next = || { state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407); state >> 33 };
            let mut mask = mask_of([24; 3], millimetres(24), |p| p.length() < 11.0);
            mask.data.iter_mut().for_each(|v| *v &= u8::from(next() % 100 < full));
            if let Ok(mesh) = tetrahedra(&mask, &Config { target_tets: 2000, smoothing: 0.1, ..Config::default() }) {
                prop_assert_eq!(mesh.check(), Ok(()));
                prop_assert!(Surface::of(&mesh).is_closed());
                prop_assert_eq!(Topology::of(&mesh).components().1, 1);
            }
        }
    }
}
