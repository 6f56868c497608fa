//! Side by side with TetGen and fTetWild, which run as programs of their own in a throw-away Python
//! environment.
//!
//! # Practice
//! Needs Python 3 with `venv`, and its package index once; without them it says so and finds
//! nothing. The lattice fills a mask; the others fill the surface of the lattice's mesh, so that
//! all three have the same triangles to start from. Nothing of theirs is linked, kept or shipped:
//! TetGen is under the AGPL. Seconds are those of the mesher alone, each with all cores.

use super::scenes::{self, Scene};
use super::spots::{Spots, faces, samples};
use anyhow::{Context, Result};
use std::ffi::OsStr;
use std::path::Path;
use std::time::Instant;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Row};
use trepan_geometry::quantile;
use trepan_mesh::{Quality, Surface, TetMesh, lattice, obj};
use trepan_trials_scenes::python::Workshop;

/// The rivals: name, Python package, ending of what the script writes.
const RIVALS: [(&str, &str, &str); 2] = [("TetGen", "tetgen", "ele"), ("fTetWild", "pytetwild", "msh")];
/// What they need without saying so.
const ALSO: [(&str, &str); 1] = [("pyvista", "pyvista")];
/// Runs one of them.
const SCRIPT: &str = include_str!("rivals.py");

/// A ball and a brain by all three.
pub fn parts(_: Scope) -> Vec<Part> {
    vec![Part::new("all", |scope, findings| findings.append(run(scope)))]
}

fn run(scope: Scope) -> Findings {
    let mut findings = Findings::default();
    let packages: Vec<_> = RIVALS.iter().map(|(_, package, _)| (*package, *package)).chain(ALSO).collect();
    let workshop = match Workshop::with(&packages, SCRIPT) {
        Ok(workshop) => workshop,
        Err(fault) => {
            println!("  left out, since there is no Python with the rivals: {fault:#}");
            return findings;
        }
    };
    for scene in &scenes::for_rivals(scope) {
        compare(scene, &workshop, &mut findings.rows);
    }
    print_table(&findings.rows);
    findings
}

fn compare(scene: &Scene, workshop: &Workshop, rows: &mut Vec<Row>) {
    let start = Instant::now();
    let own = match lattice::labelled(&scene.labels, &scene.config) {
        Ok(labelled) => labelled.mesh,
        Err(fault) => return println!("  {}: {fault}", scene.name),
    };
    rows.push(row(scene, "lattice", &own, start.elapsed().as_secs_f64()));
    for (name, _, ending) in RIVALS {
        match fill(workshop, name, ending, &own, scene.config.target_tets) {
            Ok((mesh, seconds)) => rows.push(row(scene, name, &mesh, seconds)),
            Err(fault) => println!("  {} by {name}: {fault:#}", scene.name),
        }
    }
}

fn row(scene: &Scene, method: &str, mesh: &TetMesh, seconds: f64) -> Row {
    let (quality, surface) = (Quality::of(mesh), Surface::of(mesh));
    let there = Spots::new(&scene.labels, samples(&scene.labels, &surface.triangles, &mesh.positions));
    let border = Spots::new(&scene.labels, faces(&scene.labels, |a, b| (a != 0) != (b != 0)));
    let mut distances: Vec<f64> = there.spots.iter().map(|&(p, _)| border.nearest(p).into()).collect();
    let truth: f64 = scene.mm3.iter().map(|(_, mm3)| mm3).sum();
    Row::new(&scene.name, method)
        .with("target_tets", scene.config.target_tets)
        .metric("tets_count", mesh.tets.len() as f64)
        .metric("mesh_s", seconds)
        .metric("min_dihedral_deg", quality.min_dihedral_deg)
        .metric("max_dihedral_deg", quality.max_dihedral_deg)
        .metric("mean_radius_ratio", quality.mean_radius_ratio)
        .metric("min_height_mm", quality.min_height_mm)
        .metric("volume_error_percent", 100.0 * (mesh.total_mm3() / truth - 1.0).abs())
        .metric("surface_p95_voxel", quantile(&mut distances, 0.95))
}

fn print_table(rows: &[Row]) {
    let columns =
        ["tets_count", "mesh_s", "min_dihedral_deg", "max_dihedral_deg", "mean_radius_ratio", "min_height_mm"];
    println!("  {:<28} {:<9} {}", "scene", "method", columns.map(|name| format!("{name:>18}")).concat());
    for row in rows {
        let values = columns.map(|name| format!("{:>18.2}", row.metrics.get(name).copied().unwrap_or(f64::NAN)));
        println!("  {:<28} {:<9} {}", row.scene, row.method, values.concat());
    }
}

/// What a rival makes of the surface of a mesh, and its seconds.
fn fill(workshop: &Workshop, name: &str, ending: &str, own: &TetMesh, target: usize) -> Result<(TetMesh, f64)> {
    let (from, to) = (workshop.at("surface.obj"), workshop.at("filled"));
    let surface = Surface::of(own).to_tri_mesh(&own.positions);
    obj::write(&from, &surface)?;
    let output = workshop.run([OsStr::new(name), from.as_os_str(), OsStr::new(&target.to_string()), to.as_os_str()])?;
    let seconds = output.lines().find_map(|line| line.strip_prefix("seconds ")?.parse().ok());
    let mesh = read(&to.with_extension(ending))?;
    Ok((mesh, seconds.context("it does not tell its seconds")?))
}

fn read(path: &Path) -> Result<TetMesh> {
    let mesh = trepan_mesh::read(path)?;
    mesh.check().context("its mesh is degenerate")?;
    Ok(mesh)
}
