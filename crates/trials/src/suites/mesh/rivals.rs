//! Side by side with TetGen and fTetWild, which run as programs of their own in a throw-away Python environment.
//!
//! # Practice
//! Needs Python 3 with `venv`, and its package index once; without them it says so and finds nothing. The lattice fills a mask; the others fill the surface of
//! the lattice's mesh, so that all three have the same triangles to start from. Nothing of theirs is linked, kept or shipped: TetGen is under the AGPL.
//! Seconds are those of the mesher alone, each with all cores.

use super::super::Scope;
use super::scenes::{self, Scene};
use super::spots::{Spots, faces, quantile, samples};
use crate::suite::{Findings, Row};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;
use trepan_mesh::{Quality, Surface, TetMesh, lattice, obj};

/// The rivals: name, Python package, ending of what the script writes.
const RIVALS: [(&str, &str, &str); 2] = [("TetGen", "tetgen", "ele"), ("fTetWild", "pytetwild", "msh")];
/// What they need without saying so.
const ALSO: [&str; 1] = ["pyvista"];
/// Runs one of them.
const SCRIPT: &str = include_str!("rivals.py");
/// The environment variable with another Python.
const PYTHON: &str = "TREPAN_PYTHON";

/// A ball and a brain by all three.
pub fn run(scope: Scope) -> Findings {
    let mut findings = Findings::default();
    let workshop = match Workshop::new() {
        Ok(workshop) => workshop,
        Err(fault) => {
            println!("  left out, since there is no Python with the rivals: {fault}");
            return findings;
        }
    };
    for (_, scene) in scenes::for_rivals(scope).iter().enumerate().filter(|(number, _)| scope.takes(*number)) {
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
        match workshop.fill(name, ending, &own, scene.config.target_tets) {
            Ok((mesh, seconds)) => rows.push(row(scene, name, &mesh, seconds)),
            Err(fault) => println!("  {} by {name}: {fault}", scene.name),
        }
    }
}

fn row(scene: &Scene, method: &str, mesh: &TetMesh, seconds: f64) -> Row {
    let (quality, surface) = (Quality::of(mesh), Surface::of(mesh));
    let there = Spots::new(&scene.labels, samples(&scene.labels, &surface.triangles, &mesh.positions));
    let border = Spots::new(&scene.labels, faces(&scene.labels, |a, b| (a != 0) != (b != 0)));
    let distances = there.spots.iter().map(|&(p, _)| border.nearest(p)).collect();
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
        .metric("surface_p95_voxel", quantile(distances, 0.95))
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

/// A folder with a Python environment that goes when this is dropped.
struct Workshop {
    folder: tempfile::TempDir,
    python: PathBuf,
}

impl Workshop {
    fn new() -> Result<Self, String> {
        let folder = tempfile::tempdir().map_err(|fault| fault.to_string())?;
        let environment = folder.path().join("environment");
        let given = std::env::var_os(PYTHON).unwrap_or_else(|| "python3".into());
        said(Command::new(given).args(["-m", "venv"]).arg(&environment))?;
        let python = environment.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
        let packages = RIVALS.map(|(_, package, _)| package);
        let mut install = Command::new(&python);
        install.args(["-m", "pip", "install", "--quiet", "--only-binary", ":all:"]).args(packages).args(ALSO);
        said(&mut install)?;
        let version = said(Command::new(&python).args(["-m", "pip", "list", "--format", "freeze"]))?;
        let of_rivals = version.lines().filter(|line| packages.iter().any(|package| line.starts_with(package)));
        println!("  {}", of_rivals.collect::<Vec<_>>().join(", "));
        std::fs::write(folder.path().join("rivals.py"), SCRIPT).map_err(|fault| fault.to_string())?;
        Ok(Self { folder, python })
    }

    /// What a rival makes of the surface of a mesh, and its seconds.
    fn fill(&self, name: &str, ending: &str, own: &TetMesh, target: usize) -> Result<(TetMesh, f64), String> {
        let at = |file: &str| self.folder.path().join(file);
        let surface = Surface::of(own).to_tri_mesh(&own.positions);
        obj::write(&at("surface.obj"), &surface).map_err(|fault| fault.to_string())?;
        let mut command = Command::new(&self.python);
        command.arg(at("rivals.py")).arg(name).arg(at("surface.obj")).arg(target.to_string()).arg(at("filled"));
        // fTetWild leaves a file where it runs.
        let seconds = said(command.current_dir(self.folder.path()))?;
        let seconds = seconds.lines().find_map(|line| line.strip_prefix("seconds ")?.parse().ok());
        let mesh = read(&at("filled").with_extension(ending))?;
        Ok((mesh, seconds.ok_or("it does not tell its seconds")?))
    }
}

fn read(path: &Path) -> Result<TetMesh, String> {
    let mesh = trepan_mesh::read(path).map_err(|fault| fault.to_string())?;
    mesh.check().map_err(|fault| format!("its mesh is unsound: {fault}"))?;
    Ok(mesh)
}

/// What a program prints, or why it failed: the last line of its complaint.
fn said(command: &mut Command) -> Result<String, String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let out = command.output().map_err(|fault| format!("{program}: {fault}"))?;
    if out.status.success() {
        return Ok(String::from_utf8_lossy(&out.stdout).into_owned());
    }
    let complaint = [&out.stderr, &out.stdout].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    let last = complaint.iter().flat_map(|text| text.lines().rev()).find(|line| !line.trim().is_empty());
    Err(format!("{program}: {}", last.unwrap_or("it failed without a word")))
}
