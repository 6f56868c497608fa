//! Tetrahedra from masks: a brain at several voxel sizes, a ball, a torus and a ball in a ball, against the mask's own faces or a closed form.

use super::Scope;
use crate::suite::{Findings, Gate, Row};
use std::time::Instant;
use trepan_geometry::Vec3;
use trepan_mesh::{Csr, Quality, Surface, TetMesh, Topology, lattice, materials};
use trepan_volume::{Grid, Interpolation, VoxelVolume, resample};

/// Samples of a mesh's surface for each face of a voxel.
const DENSITY: f32 = 6.0;
/// Distances are sought up to this many voxels.
const REACH: i32 = 12;
/// A distance counts as small up to this many voxels.
const SMALL_VOXEL: f32 = 0.5;
/// Radii of the ball, the ball inside, and the torus's ring and tube, mm.
const BALL_MM: f32 = 28.0;
const INNER_MM: f32 = 14.0;
const TORUS_MM: [f32; 2] = [20.0, 8.0];

/// Voxel edges, mm, with the counts asked for and the least of them that can follow the voxels.
const MASKS: &[(f32, &[usize], usize)] = &[
    (1.0, &[15_000, 100_000, 300_000, 1_000_000], 300_000),
    (2.0, &[15_000, 100_000, 400_000], 100_000),
    (4.0, &[15_000, 60_000], 15_000),
];

/// A mask, and what is known about it.
struct Scene {
    name: String,
    mask: VoxelVolume<u8>,
    target: usize,
    /// Volume, mm³.
    mm3: f64,
    /// Euler characteristic of the surface, where it is known.
    euler: Option<f64>,
    /// Distance to the surface, mm; without it the mask's faces count.
    distance: Option<fn(Vec3) -> f32>,
    /// Whether the elements are small enough to follow the voxels, so that the distance is promised.
    follows: bool,
}

/// Every mask at every fineness.
pub fn run(scope: Scope) -> Findings {
    let mut findings = Findings::default();
    for (number, scene) in scenes(scope).iter().enumerate() {
        if scope.takes(number) {
            measure(scene, &mut findings);
        }
    }
    if scope.takes(0) {
        ball_in_a_ball(&mut findings);
    }
    findings
}

fn scenes(scope: Scope) -> Vec<Scene> {
    let brain = brain();
    let mut scenes = Vec::new();
    for &(spacing_mm, targets, follows) in scope.pick(&MASKS[2..], MASKS) {
        let grid = Grid::isotropic_over(&brain, spacing_mm);
        let mask = resample(&brain, &grid, Interpolation::Majority, 0);
        for &target in targets {
            let name = format!("brain at {spacing_mm} mm, {target} tetrahedra");
            let mm3 = mask.data.iter().filter(|v| **v != 0).count() as f64 * mask.voxel_mm3();
            scenes.push(Scene {
                name,
                mask: mask.clone(),
                target,
                mm3,
                euler: None,
                distance: None,
                follows: target >= follows,
            });
        }
    }
    let pi = std::f64::consts::PI;
    let [ring, tube] = TORUS_MM.map(f64::from);
    scenes.push(shape("ball", to_ball, 8000, 4.0 / 3.0 * pi * f64::from(BALL_MM).powi(3), 2.0));
    scenes.push(shape("torus", to_torus, 6000, 2.0 * pi * pi * ring * tube * tube, 0.0));
    scenes
}

fn brain() -> VoxelVolume<u8> {
    let file = trepan_fixtures::case_head().labels;
    trepan_volume::read(&file).expect("the built-in case can be read").map(|v| u8::from(v > 0.5))
}

fn to_ball(p: Vec3) -> f32 {
    p.length() - BALL_MM
}

fn to_torus(p: Vec3) -> f32 {
    (p.x.hypot(p.y) - TORUS_MM[0]).hypot(p.z) - TORUS_MM[1]
}

fn shape(name: &str, distance: fn(Vec3) -> f32, target: usize, mm3: f64, euler: f64) -> Scene {
    let mask = voxels(|p| u8::from(distance(p) < 0.0));
    Scene { name: name.into(), mask, target, mm3, euler: Some(euler), distance: Some(distance), follows: true }
}

/// A cube of 64 voxels of 1 mm around the origin.
fn voxels<T: Copy + Default>(value: impl Fn(Vec3) -> T) -> VoxelVolume<T> {
    let n = 64;
    let mut volume = VoxelVolume::isotropic([n; 3], Vec3::splat(-31.5), 1.0, T::default());
    for at in 0..volume.data.len() {
        volume.data[at] = value(volume.centre_of([at % n, at / n % n, at / (n * n)]).as_vec3());
    }
    volume
}

/// One scene: its row and its gates.
fn measure(scene: &Scene, findings: &mut Findings) {
    let config = lattice::Config { target_tets: scene.target, ..Default::default() };
    forget_peak();
    let start = Instant::now();
    let built = lattice::tetrahedra(&scene.mask, &config);
    let (mesh_s, peak) = (start.elapsed().as_secs_f64(), peak_mb());
    let promise = |name: &str, value, limit| Gate::at_most(format!("{}: {name}", scene.name), value, limit);
    findings.gates.push(promise("refused", f64::from(u8::from(built.is_err())), 0.0));
    let Ok(mesh) = built else { return };
    let surface = Surface::of(&mesh);
    let quality = Quality::of(&mesh);
    let (there, back) = distances(scene, &mesh, &surface);
    let volume_percent = 100.0 * (mesh.total_mm3() / scene.mm3 - 1.0).abs();
    let count_percent = 100.0 * (mesh.tets.len() as f64 / scene.target as f64 - 1.0).abs();
    let there_p95 = quantile(there, 0.95);
    findings.gates.extend([
        promise("volume error, percent", volume_percent, 1.0),
        promise("elements beside the target, percent", count_percent, 10.0),
        promise("faults (unsound, open, in parts)", faults(&mesh, &surface), 0.0),
        promise("largest dihedral angle, degrees", quality.max_dihedral_deg, 164.8),
        Gate::at_least(format!("{}: smallest dihedral angle, degrees", scene.name), quality.min_dihedral_deg, 10.7),
    ]);
    if scene.follows {
        findings.gates.push(promise("surface distance, p95 voxel", there_p95, f64::from(SMALL_VOXEL)));
    }
    let euler = surface.nodes().len() as f64 - surface.triangles.len() as f64 / 2.0;
    findings.gates.extend(scene.euler.map(|known| promise("Euler characteristic off", (euler - known).abs(), 0.0)));
    let mut row = Row::new(&scene.name, "lattice")
        .with("target_tets", scene.target)
        .with("voxel_mm", scene.mask.spacing_mm().x)
        .metric("tets_count", mesh.tets.len() as f64)
        .metric("mesh_s", mesh_s)
        .metric("min_dihedral_deg", quality.min_dihedral_deg)
        .metric("max_dihedral_deg", quality.max_dihedral_deg)
        .metric("min_height_mm", quality.min_height_mm)
        .metric("mean_edge_mm", quality.mean_edge_mm)
        .metric("volume_error_percent", volume_percent)
        .metric("count_error_percent", count_percent)
        .metric("surface_p95_voxel", there_p95)
        .metric("mask_to_surface_p95_voxel", quantile(back, 0.95));
    if let Some(mb) = peak {
        row = row.metric("process_peak_mb", mb);
    }
    findings.rows.push(row);
}

/// How many of soundness, closedness and connectedness fail.
fn faults(mesh: &TetMesh, surface: &Surface) -> f64 {
    let parts = Topology::of(mesh).components().1;
    [mesh.check().is_err(), !surface.is_closed(), parts != 1].into_iter().filter(|bad| *bad).count() as f64
}

/// From the mesh's surface to the truth and from the mask's faces to the mesh's surface, voxels.
fn distances(scene: &Scene, mesh: &TetMesh, surface: &Surface) -> (Vec<f32>, Vec<f32>) {
    let voxel_mm = scene.mask.spacing_mm().x as f32;
    let samples = Spots::new(&scene.mask, samples(&scene.mask, &surface.triangles, &mesh.positions));
    let faces = Spots::new(&scene.mask, faces(&scene.mask, |a, b| (a != 0) != (b != 0)));
    let world = |p: Vec3| scene.mask.world_from_voxel.transform_point3(p.as_dvec3()).as_vec3();
    let there = samples.spots.iter().map(|&(p, _)| match scene.distance {
        Some(truth) => truth(world(p)).abs() / voxel_mm,
        None => faces.nearest(p),
    });
    (there.collect(), faces.spots.iter().map(|&(p, _)| samples.nearest(p)).collect())
}

/// Points spread over triangles, in voxel indices, about [`DENSITY`] for each face of a voxel.
fn samples(mask: &VoxelVolume<u8>, triangles: &[[u32; 3]], positions: &[Vec3]) -> Vec<(Vec3, usize)> {
    let voxel_from_world = mask.world_from_voxel.inverse();
    let mut points = Vec::new();
    for triangle in triangles {
        let [a, b, c] = triangle.map(|n| voxel_from_world.transform_point3(positions[n as usize].as_dvec3()).as_vec3());
        let (u, v) = (b - a, c - a);
        let parts = (0.5 * u.cross(v).length() * DENSITY).sqrt().ceil().max(1.0) as usize;
        let at = |i: usize, j: usize, third: f32| {
            (a + (u * (i as f32 + third) + v * (j as f32 + third)) / parts as f32, POINT)
        };
        for i in 0..parts {
            points.extend((0..parts - i).map(|j| at(i, j, 1.0 / 3.0)));
            points.extend((1..parts - i).map(|j| at(i, j - 1, 2.0 / 3.0)));
        }
    }
    points
}

/// The faces between voxels of a kind that `parted` tells apart, as (middle in voxel indices, axis across).
fn faces<T: Copy + Default>(volume: &VoxelVolume<T>, parted: impl Fn(T, T) -> bool) -> Vec<(Vec3, usize)> {
    let [nx, ny, nz] = volume.dims;
    let mut found = Vec::new();
    for (k, j, i) in (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| (k, j, i)))) {
        let own = volume.data[volume.index([i, j, k])];
        let middle = Vec3::new(i as f32, j as f32, k as f32);
        for (axis, next) in [[i + 1, j, k], [i, j + 1, k], [i, j, k + 1]].into_iter().enumerate() {
            if parted(own, volume.get(next).unwrap_or_default()) {
                found.push((middle + 0.5 * Vec3::AXES[axis], axis));
            }
        }
    }
    found
}

/// The third entry of a spot without extent.
const POINT: usize = 3;

/// Points and unit squares sorted into the voxels of a grid.
struct Spots {
    spots: Vec<(Vec3, usize)>,
    dims: [i32; 3],
    of_voxel: Csr,
}

impl Spots {
    fn new<T>(grid: &VoxelVolume<T>, spots: Vec<(Vec3, usize)>) -> Self {
        let dims = grid.dims.map(|n| n as i32);
        let cell = |p: Vec3| index(dims, voxel(dims, p)) as u32;
        let of_voxel = Csr::of_pairs(grid.data.len(), spots.iter().enumerate().map(|(n, s)| (cell(s.0), n as u32)));
        Self { spots, dims, of_voxel }
    }

    /// Distance to the nearest, at most [`REACH`].
    fn nearest(&self, p: Vec3) -> f32 {
        let middle = voxel(self.dims, p);
        let mut best = REACH as f32;
        for radius in 0..=REACH {
            if best <= radius as f32 - 1.5 {
                break;
            }
            self.each_in_shell(middle, radius, |(centre, axis)| best = best.min(apart(p - centre, axis)));
        }
        best
    }

    /// Visits what lies in the voxels exactly `radius` away.
    fn each_in_shell(&self, middle: [i32; 3], radius: i32, mut visit: impl FnMut((Vec3, usize))) {
        let range = |d: usize| (middle[d] - radius).max(0)..=(middle[d] + radius).min(self.dims[d] - 1);
        for k in range(2) {
            for j in range(1) {
                let rim = (k - middle[2]).abs() == radius || (j - middle[1]).abs() == radius;
                for i in range(0).filter(|i| rim || (i - middle[0]).abs() == radius) {
                    for &n in self.of_voxel.row(index(self.dims, [i, j, k])) {
                        visit(self.spots[n as usize]);
                    }
                }
            }
        }
    }
}

fn voxel(dims: [i32; 3], p: Vec3) -> [i32; 3] {
    let p = p.round().to_array();
    std::array::from_fn(|d| (p[d] as i32).clamp(0, dims[d] - 1))
}

fn index(dims: [i32; 3], [i, j, k]: [i32; 3]) -> usize {
    (i + dims[0] * (j + dims[1] * k)) as usize
}

/// Distance to a point, or to a unit square across an axis, from its middle.
fn apart(by: Vec3, axis: usize) -> f32 {
    let half = if axis == POINT { Vec3::ZERO } else { 0.5 * (Vec3::ONE - Vec3::AXES[axis]) };
    (by.abs() - half).max(Vec3::ZERO).length()
}

/// A ball of one label in a ball of another: volumes and the surface between them.
fn ball_in_a_ball(findings: &mut Findings) {
    let labels = voxels(|p| if p.length() < INNER_MM { 2u16 } else { u16::from(p.length() < BALL_MM) });
    let config = lattice::Config { target_tets: 20_000, ..Default::default() };
    let mesh = lattice::tetrahedra(&labels.map(|l| u8::from(l != 0)), &config).expect("a ball can be meshed");
    let of_tet = materials::majority(&mesh, &labels);
    let mut row = Row::new("ball in a ball", "majority of each element").with("target_tets", config.target_tets);
    let ball = |radius: f32| 4.0 / 3.0 * std::f64::consts::PI * f64::from(radius).powi(3);
    for (label, truth) in [(1, ball(BALL_MM) - ball(INNER_MM)), (2, ball(INNER_MM))] {
        let mm3: f64 = (0..mesh.tets.len()).filter(|&t| of_tet[t] == label).map(|t| mesh.volume_mm3(t)).sum();
        let percent = 100.0 * (mm3 / truth - 1.0).abs();
        row = row.metric(&format!("label_{label}_volume_error_percent"), percent);
    }
    let mut inner = TetMesh { positions: mesh.positions.clone(), tets: mesh.tets.clone() };
    let mut keep = of_tet.iter().map(|label| *label == 2);
    inner.tets.retain(|_| keep.next().unwrap_or(false));
    let border = Surface::of(&inner);
    let mask = labels.map(|l| u8::from(l == 2));
    let off = samples(&mask, &border.triangles, &inner.positions)
        .into_iter()
        .map(|(p, _)| (mask.world_from_voxel.transform_point3(p.as_dvec3()).length() as f32 - INNER_MM).abs());
    findings.rows.push(row.metric("surface_p95_voxel", quantile(off.collect(), 0.95)));
}

fn quantile(mut values: Vec<f32>, share: f64) -> f64 {
    values.sort_by(f32::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((share * last as f64).round() as usize).map_or(f64::NAN, |v| f64::from(*v))
}

/// Lets the system count this process's peak memory anew, where it can.
fn forget_peak() {
    _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Most memory of this process since then, MB; nothing where the system does not tell.
fn peak_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kb = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?.trim().strip_suffix("kB")?.trim();
    kb.parse::<f64>().ok().map(|kb| kb / 1000.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_face_is_as_far_as_its_nearest_point() {
        assert_eq!(apart(Vec3::new(0.4, -0.3, 2.0), 2), 2.0);
        assert_eq!(apart(Vec3::new(0.0, 3.5, 4.0), 2), 5.0);
        assert_eq!(apart(Vec3::new(0.0, 3.0, 4.0), POINT), 5.0);
    }

    #[test]
    fn the_nearest_is_found_as_by_brute_force() {
        let mask = voxels(|p| u8::from(p.distance(Vec3::new(3.0, 1.0, -2.0)) < 9.3));
        let spots = Spots::new(&mask, faces(&mask, |a, b| a != b));
        for n in 0..60 {
            let p =
                Vec3::splat(34.0) + 11.0 * Vec3::new((n as f32).sin(), (1.7 * n as f32).cos(), (2.9 * n as f32).sin());
            let brute = spots.spots.iter().map(|&(centre, axis)| apart(p - centre, axis)).fold(REACH as f32, f32::min);
            assert_eq!(spots.nearest(p), brute);
        }
    }
}
