//! Tetrahedral meshes from masks and labels, measured against the voxels' faces or a closed form.
//! Scenes: a brain at several voxel sizes, a ball, a torus and a ball in a ball.

mod classes;
mod odd;
pub mod rivals;
mod scenes;
mod spots;

use scenes::{Border, Scene};
use spots::{Spots, faces, samples};
use std::time::Instant;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Vec3, quantile};
use trepan_mesh::lattice::{self, LabelledMesh};
use trepan_mesh::{Quality, Surface, TetMesh, Topology};
use trepan_volume::VoxelVolume;

/// Largest distance that counts as small, voxels.
const SMALL_VOXEL: f64 = 0.5;
/// Bounds of the dihedral angles proven by Labelle and Shewchuk for isosurface stuffing, degrees:
/// with cubes of one size, and of several sizes.
const PROVEN_DEG: [[f64; 2]; 2] = [[10.7, 164.8], [1.66, 174.72]];

/// Lists a part for every scene.
pub fn parts(scope: Scope) -> Vec<Part> {
    let measured = scenes::all(scope)
        .into_iter()
        .map(|(name, make)| Part::new(name, move |_, findings: &mut Findings| measure(&make(), findings)));
    let searched = scenes::searched(scope).into_iter().map(|((name, make), range)| {
        Part::new(name, move |_, findings: &mut Findings| findings.rows.extend(least_count(&make(), range)))
    });
    let odd = || Part::new("odd masks", |_, findings: &mut Findings| odd::run(findings));
    measured.chain(searched).chain(classes::parts(scope)).chain((!scope.quick).then(odd)).collect()
}

/// Smallest element count between two, to about a fifteenth, with which a mesh's boundary follows
/// the voxels; `None` if not even the larger does.
fn least_count(scene: &Scene, [mut low, mut high]: [usize; 2]) -> Option<Row> {
    let at = |target_tets: usize| {
        let labelled = lattice::labelled(&scene.labels, &lattice::Config { target_tets, ..scene.config }).ok()?;
        let [there, back] = distances(scene, &labelled);
        let row = Row::new(&scene.name, scene.method())
            .with("coarsening", scene.config.coarsening)
            .with("voxel_mm", scene.labels.spacing_mm().x)
            .metric("tets_count", labelled.mesh.tets.len() as f64)
            .metric("min_height_mm", Quality::of(&labelled.mesh).min_height_mm)
            .metric("surface_p95_voxel", there)
            .metric("voxels_to_surface_p95_voxel", back);
        (there <= SMALL_VOXEL).then_some(row)
    };
    let mut best = at(high)?;
    while high * 15 > low * 16 {
        let middle = ((low * high) as f64).sqrt() as usize;
        match at(middle) {
            Some(row) => (high, best) = (middle, row),
            None => low = middle,
        }
    }
    Some(best)
}

/// Meshes one scene and adds its row and gates.
fn measure(scene: &Scene, findings: &mut Findings) {
    forget_peak();
    let start = Instant::now();
    let built = lattice::labelled(&scene.labels, &scene.config);
    let (mesh_s, peak) = (start.elapsed().as_secs_f64(), peak_mb());
    let at_most = |name: &str, value, limit| Gate::at_most(format!("{}: {name}", scene.name), value, limit);
    findings.gates.push(at_most("refused", f64::from(u8::from(built.is_err())), 0.0));
    let Ok(labelled) = built else { return };
    let mesh = &labelled.mesh;
    let (surface, quality) = (Surface::of(mesh), Quality::of(mesh));
    let wanted = scene.config.target_tets as f64;
    let volume_percent = volume_error_percent(scene, &labelled);
    let count_percent = 100.0 * (mesh.tets.len() as f64 / wanted - 1.0).abs();
    let [there, back] = distances(scene, &labelled);
    let [least, most] = PROVEN_DEG[usize::from(scene.config.fine.is_some())];
    findings.gates.extend([
        at_most("volume error of a label, percent", volume_percent, scene.volume_limit_percent),
        at_most("elements beside the target, percent", count_percent, 10.0),
        at_most("faults (degenerate, open, in parts, sum of labels)", faults(&labelled, &surface), 0.0),
        at_most("largest dihedral angle, degrees", quality.max_dihedral_deg, most),
        Gate::at_least(format!("{}: smallest dihedral angle, degrees", scene.name), quality.min_dihedral_deg, least),
    ]);
    if scene.follows {
        findings.gates.push(at_most("mesh's border to the truth, p95 voxel", there, SMALL_VOXEL));
    }
    let euler = surface.nodes().len() as f64 - surface.triangles.len() as f64 / 2.0;
    findings.gates.extend(scene.euler.map(|known| at_most("Euler characteristic off", (euler - known).abs(), 0.0)));
    let row = Row::new(&scene.name, scene.method())
        .with("target_tets", scene.config.target_tets)
        .with("coarsening", scene.config.coarsening)
        .with("voxel_mm", scene.labels.spacing_mm().x)
        .metric("tets_count", mesh.tets.len() as f64)
        .metric("surface_triangles_count", surface.triangles.len() as f64)
        .metric("mesh_s", mesh_s)
        .metric("min_dihedral_deg", quality.min_dihedral_deg)
        .metric("max_dihedral_deg", quality.max_dihedral_deg)
        .metric("min_height_mm", quality.min_height_mm)
        .metric("mean_edge_mm", quality.mean_edge_mm)
        .metric("volume_error_percent", volume_percent)
        .metric("count_error_percent", count_percent)
        .metric("surface_p95_voxel", there)
        .metric("voxels_to_surface_p95_voxel", back);
    findings.rows.push(peak.into_iter().fold(row, |row, mb| row.metric("process_peak_mb", mb)));
}

/// Largest error of a known volume, %.
fn volume_error_percent(scene: &Scene, labelled: &LabelledMesh) -> f64 {
    let off = |&(label, truth): &(u16, f64)| 100.0 * (mm3(labelled, label) / truth - 1.0).abs();
    scene.mm3.iter().map(off).fold(0.0, f64::max)
}

fn mm3(labelled: &LabelledMesh, label: u16) -> f64 {
    let tets = (0..labelled.mesh.tets.len()).filter(|&t| labelled.label_of_tet[t] == label);
    tets.map(|t| labelled.mesh.volume_mm3(t)).sum()
}

/// Number of failed checks: soundness (no gap, no overlap), closedness, connectedness, sum of all
/// labels.
fn faults(labelled: &LabelledMesh, surface: &Surface) -> f64 {
    let mesh = &labelled.mesh;
    let parts = Topology::of(mesh).components().1;
    let enclosed = surface.to_tri_mesh(&mesh.positions).volume_mm3();
    let gaps = (enclosed / mesh.total_mm3() - 1.0).abs() > 1e-4;
    let unlabelled = labelled.label_of_tet.len() != mesh.tets.len() || labelled.label_of_tet.contains(&0);
    let all = [mesh.check().is_err(), !surface.is_closed(), parts != 1, gaps, unlabelled];
    all.into_iter().filter(|bad| *bad).count() as f64
}

/// 95 % quantiles of the distance from the mesh's boundaries to the truth and back from the
/// voxels'.
/// In voxels; of several boundaries the worst.
fn distances(scene: &Scene, labelled: &LabelledMesh) -> [f64; 2] {
    let of_border = |border: &Border| {
        let holds = |label: u16| if border.label == 0 { label != 0 } else { label == border.label };
        let part = part(labelled, holds);
        let triangles = Surface::of(&part).triangles;
        let grid = &scene.labels;
        let counts =
            |p: Vec3| scene.config.fine.is_none_or(|fine| fine.centre.distance(world(grid, p)) < fine.radius_mm);
        let samples = Spots::new(grid, samples(grid, &triangles, &part.positions));
        let faces = Spots::new(grid, faces(grid, |a, b| holds(a) != holds(b)));
        let voxel_mm = grid.spacing_mm().x as f32;
        let to_truth =
            |p: Vec3| border.distance.map_or_else(|| faces.nearest(p), |to| to(world(grid, p)).abs() / voxel_mm);
        let there = samples.spots.iter().filter(|(p, _)| counts(*p)).map(|&(p, _)| to_truth(p));
        let back = faces.spots.iter().filter(|(p, _)| counts(*p)).map(|&(p, _)| samples.nearest(p));
        [there.map(f64::from).collect(), back.map(f64::from).collect()]
            .map(|mut all: Vec<f64>| quantile(&mut all, 0.95))
    };
    scene.borders.iter().map(of_border).fold([0.0; 2], |[a, b], [c, d]| [a.max(c), b.max(d)])
}

/// Submesh of some labels.
fn part(labelled: &LabelledMesh, holds: impl Fn(u16) -> bool) -> TetMesh {
    let LabelledMesh { mesh, label_of_tet, .. } = labelled;
    let tets = mesh.tets.iter().zip(label_of_tet).filter(|(_, label)| holds(**label)).map(|(tet, _)| *tet);
    TetMesh { positions: mesh.positions.clone(), tets: tets.collect() }
}

fn world<T>(grid: &VoxelVolume<T>, voxel: Vec3) -> Vec3 {
    grid.world_from_voxel.transform_point3(voxel.as_dvec3()).as_vec3()
}

/// Resets the system's record of this process's peak memory, where supported.
fn forget_peak() {
    _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Peak memory of this process since the reset, MB; `None` where the system does not report it.
fn peak_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kb = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?.trim().strip_suffix("kB")?.trim();
    kb.parse::<f64>().ok().map(|kb| kb / 1000.0)
}
