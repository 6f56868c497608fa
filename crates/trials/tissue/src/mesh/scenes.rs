//! What is meshed: the built-in case's brain or a given label volume, and bodies with a closed
//! form.

use std::path::PathBuf;
use trepan_evidence::part::Scope;
use trepan_geometry::Vec3;
use trepan_mesh::lattice::{Config, Fine};
use trepan_volume::{Grid, Interpolation, VoxelVolume, resample};

/// Radii of the ball, the ball inside, and the torus's ring and tube, mm.
const BALL_MM: f32 = 28.0;
const INNER_MM: f32 = 14.0;
const TORUS_MM: [f32; 2] = [20.0, 8.0];

/// Voxel edges, mm, and counts asked for with cubes of one size and coarser inside; the second is
/// the least that can follow the voxels.
type Counts = (&'static [usize], usize);
const MASKS: &[(f32, Counts, Counts)] = &[
    (1.0, (&[15_000, 100_000, 200_000, 300_000], 200_000), (&[60_000, 100_000, 200_000], 100_000)),
    (2.0, (&[15_000, 60_000, 100_000], 60_000), (&[15_000, 30_000, 60_000], 30_000)),
    (4.0, (&[4000, 8000, 15_000], 8000), (&[4000, 8000, 12_000], 8000)),
];
/// Voxel edges, mm, and between which counts the least is sought that follows them.
const SEARCHED: &[(f32, [usize; 2])] = &[(1.0, [40_000, 320_000]), (2.0, [10_000, 100_000]), (4.0, [2000, 20_000])];
/// The environment variable with another label volume (0 is outside) for the brain.
const LABELS: &str = "TREPAN_LABELS";

/// Labels, and what is known about them.
pub(super) struct Scene {
    pub(super) name: String,
    pub(super) labels: VoxelVolume<u16>,
    pub(super) config: Config,
    /// Volumes that are known, mm³, by label.
    pub(super) mm3: Vec<(u16, f64)>,
    /// How far each may be off, percent.
    pub(super) volume_limit_percent: f64,
    /// Euler characteristic of the surface, where it is known.
    pub(super) euler: Option<f64>,
    /// What is measured for distance.
    pub(super) borders: Vec<Border>,
    /// Whether the elements are small enough to follow the voxels, so that the distance is
    /// promised.
    pub(super) follows: bool,
}

/// The border of a label.
pub(super) struct Border {
    /// Which; 0 for all together.
    pub(super) label: u16,
    /// Distance to it, mm; without it the voxels' faces count.
    pub(super) distance: Option<fn(Vec3) -> f32>,
}

/// A label and the distance to its border.
type Known = (u16, fn(Vec3) -> f32);

const OUTER: Border = Border { label: 0, distance: None };

impl Scene {
    /// Labels whose voxels tell all.
    fn of_voxels(name: String, labels: VoxelVolume<u16>, config: Config, follows: bool) -> Self {
        let mut found: Vec<u16> = labels.data.iter().copied().filter(|label| *label != 0).collect();
        found.sort_unstable();
        let mm3 = found.chunk_by(|a, b| a == b).map(|all| (all[0], all.len() as f64 * labels.voxel_mm3())).collect();
        Self { name, labels, config, mm3, volume_limit_percent: 1.0, euler: None, borders: vec![OUTER], follows }
    }

    /// How the cubes are laid out, for the chart.
    pub(super) fn method(&self) -> &'static str {
        match (self.mm3.len(), self.config.fine, self.config.coarsening) {
            (2.., ..) => "several labels",
            (_, Some(_), _) => "fine at the opening",
            (_, None, 0) => "one size",
            _ => "coarse inside",
        }
    }
}

/// A scene that is made when its turn comes, by name.
pub(super) type Named = (String, Box<dyn FnOnce() -> Scene>);

fn named(name: impl Into<String>, make: impl FnOnce() -> Scene + 'static) -> Named {
    (name.into(), Box::new(make))
}

pub(super) fn all(scope: Scope) -> Vec<Named> {
    let mut scenes = Vec::new();
    for &(spacing_mm, one_size, coarse_inside) in scope.pick(&MASKS[2..], MASKS) {
        for ((targets, least), coarsening) in [(one_size, 0), (coarse_inside, 2)] {
            for &target_tets in targets {
                let config = Config { target_tets, coarsening, ..Config::default() };
                let inside = if coarsening == 0 { "" } else { ", coarse inside" };
                let name = format!("brain at {spacing_mm} mm, {target_tets} tetrahedra{inside}");
                let make = move |name| Scene::of_voxels(name, mask(spacing_mm), config, target_tets >= least);
                scenes.push(named(name.clone(), move || make(name)));
            }
        }
    }
    scenes.extend([named("ball", ball), named("torus", torus), named("ball in a ball", ball_in_a_ball)]);
    let (spacing_mm, tets) = (scope.pick(4.0, 1.0), scope.pick(10_000, 60_000));
    scenes.push(named("fine at an opening", move || opening(spacing_mm, tets)));
    if !scope.quick {
        scenes.push(named("four tissues", tissues));
    }
    scenes
}

/// The brain on voxels of an edge.
fn mask(spacing_mm: f32) -> VoxelVolume<u16> {
    let brain = brain();
    resample(&brain, &Grid::isotropic_over(&brain, spacing_mm), Interpolation::Majority, 0).map(u16::from)
}

/// A ball and a brain for a comparison.
pub(super) fn for_rivals(scope: Scope) -> Vec<Scene> {
    let mut ball = ball();
    ball.config.target_tets = scope.pick(2000, 8000);
    let (spacing_mm, target_tets) = scope.pick((4.0, 4000), (1.0, 15_000));
    let config = Config { target_tets, ..Config::default() };
    vec![ball, Scene::of_voxels(format!("brain at {spacing_mm} mm"), mask(spacing_mm), config, false)]
}

/// Brains of which the least count is sought that follows their voxels, and between which counts.
pub(super) fn searched(scope: Scope) -> Vec<(Named, [usize; 2])> {
    let mut scenes = Vec::new();
    for &(spacing_mm, range) in scope.pick(&SEARCHED[2..], SEARCHED) {
        for coarsening in [0, 2] {
            let name = format!("brain at {spacing_mm} mm, least count within half a voxel");
            let config = Config { coarsening, ..Config::default() };
            let part = format!("{name}, coarsening {coarsening}");
            let make = move || Scene::of_voxels(name, mask(spacing_mm), config, false);
            scenes.push((named(part, make), range));
        }
    }
    scenes
}

/// The largest part of what is labelled, in the built-in case or in the volume that is named.
fn brain() -> VoxelVolume<u8> {
    trepan_volume::largest_component(&read(trepan_fixtures::case_head().labels).map(|label| u8::from(label != 0)))
}

fn read(built_in: PathBuf) -> VoxelVolume<u16> {
    let file = std::env::var_os(LABELS).map_or(built_in, Into::into);
    let volume = trepan_volume::read(&file).and_then(|volume| trepan_volume::labels(&file, &volume));
    volume.unwrap_or_else(|fault| panic!("{fault} ({LABELS} names a label volume)"))
}

/// The brain with small elements where a skull is opened: at its highest point, 25 mm wide.
fn opening(spacing_mm: f32, target_tets: usize) -> Scene {
    let mask = mask(spacing_mm);
    let [nx, ny, _] = mask.dims;
    let at = |n: usize| mask.centre_of([n % nx, n / nx % ny, n / (nx * ny)]).as_vec3();
    let inside = (0..mask.data.len()).filter(|&n| mask.data[n] != 0).map(at);
    let centre = inside.max_by(|a, b| a.z.total_cmp(&b.z)).unwrap_or_default();
    let fine = Some(Fine { centre, radius_mm: 25.0, halvings: 2 });
    let config = Config { target_tets, coarsening: 1, fine, ..Config::default() };
    let name = format!("brain at {spacing_mm} mm, fine at an opening, {target_tets} tetrahedra");
    Scene::of_voxels(name, mask, config, true)
}

/// Brain tissue, ventricles, cerebellum and brain stem (FreeSurfer's numbers), each with its
/// border.
fn tissues() -> Scene {
    let labels = read(trepan_fixtures::case_head().aseg);
    let tissue = |label: u16| match label {
        0 => 0,
        4 | 5 | 14 | 15 | 43 | 44 => 2,
        7 | 8 | 46 | 47 => 3,
        16 => 4,
        _ => 1,
    };
    let tissues = labels.map(tissue);
    let whole = trepan_volume::largest_component(&tissues.map(|label| u8::from(label != 0)));
    let mut kept = tissues;
    kept.data.iter_mut().zip(&whole.data).for_each(|(label, kept)| *label *= u16::from(*kept));
    let config = Config { target_tets: 300_000, coarsening: 2, ..Config::default() };
    let mut scene = Scene::of_voxels("four tissues at 1 mm, 300000 tetrahedra".into(), kept, config, false);
    scene.borders = (0..5).map(|label| Border { label, distance: None }).collect();
    scene
}

fn to_ball(p: Vec3) -> f32 {
    p.length() - BALL_MM
}

fn to_inner(p: Vec3) -> f32 {
    p.length() - INNER_MM
}

fn to_torus(p: Vec3) -> f32 {
    (p.x.hypot(p.y) - TORUS_MM[0]).hypot(p.z) - TORUS_MM[1]
}

fn ball_mm3(radius: f32) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * f64::from(radius).powi(3)
}

fn ball() -> Scene {
    shape("ball", |p| u16::from(to_ball(p) < 0.0), 8000, &[(1, ball_mm3(BALL_MM))], &[(0, to_ball)], 2.0)
}

fn torus() -> Scene {
    let [ring, tube] = TORUS_MM.map(f64::from);
    let mm3 = 2.0 * std::f64::consts::PI.powi(2) * ring * tube * tube;
    shape("torus", |p| u16::from(to_torus(p) < 0.0), 6000, &[(1, mm3)], &[(0, to_torus)], 0.0)
}

fn ball_in_a_ball() -> Scene {
    let label = |p| if to_inner(p) < 0.0 { 2 } else { u16::from(to_ball(p) < 0.0) };
    let mm3 = [(1, ball_mm3(BALL_MM) - ball_mm3(INNER_MM)), (2, ball_mm3(INNER_MM))];
    shape("ball in a ball", label, 20_000, &mm3, &[(0, to_ball), (2, to_inner)], 2.0)
}

fn shape(
    name: &str,
    label: impl Fn(Vec3) -> u16,
    target_tets: usize,
    mm3: &[(u16, f64)],
    borders: &[Known],
    euler: f64,
) -> Scene {
    let border = |&(label, distance): &Known| Border { label, distance: Some(distance) };
    Scene {
        name: name.into(),
        labels: voxels(label),
        config: Config { target_tets, ..Config::default() },
        mm3: mm3.to_vec(),
        volume_limit_percent: 1.0,
        euler: Some(euler),
        borders: borders.iter().map(border).collect(),
        follows: true,
    }
}

/// A cube of 64 voxels of 1 mm around the origin.
pub(super) fn voxels(value: impl Fn(Vec3) -> u16) -> VoxelVolume<u16> {
    let n = 64;
    let mut volume = VoxelVolume::isotropic([n; 3], Vec3::splat(-31.5), 1.0, 0);
    for at in 0..volume.data.len() {
        volume.data[at] = value(volume.centre_of([at % n, at / n % n, at / (n * n)]).as_vec3());
    }
    volume
}
