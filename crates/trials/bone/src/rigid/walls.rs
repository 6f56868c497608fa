//! Walls of 1 to 5 voxels against fast tools: who lets one through.
//!
//! # Theory
//! A ball that goes v a tick meets a wall of thickness w at an angle. Methods that look where the
//! hand is see bone on its near or far side, or none; methods with a proxy sweep the way. Two
//! questions a cell:
//! ```text
//! pressed   the hand stops 1.65 mm past the wall's face: what 3.3 N, a Touch's peak, are at 2 N/mm
//! pierced   the hand goes on to 6 mm past it: no device could stop it, but the tool stays outside
//! ```
//! held in both: works; held only when pressed: degrades; else fails.
//!
//! # Practice
//! Held: at rest the proxy's centre is on the side it came from and the normal points back there.

use super::solid::{directions, held, voxels};
use super::{STIFFNESS, map_of, passes};
use trepan_bone::BoneVolume;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::picture::{Map, Outcome};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Tool, Vec3};
use trepan_rigid::{Method, RigidStep};
use trepan_rivals::Family;

const VOXEL_MM: f64 = 0.5;
const EDGE: usize = 48;
const THICK: [f64; 4] = [1.0, 2.0, 3.0, 5.0];
/// mm/s at 1 kHz; the last is past anything a hand does.
const SPEEDS: [f32; 7] = [10.0, 50.0, 100.0, 500.0, 1000.0, 2000.0, 12_000.0];
const ANGLES: [f32; 4] = [0.0, 30.0, 45.0, 54.7];
/// Radii of the ball, mm: the map is of the first.
const RADII_MM: [f32; 3] = [1.0, 0.5, 3.0];
const PRESSED_MM: f32 = 1.65;
const PIERCED_MM: f32 = 6.0;
/// Ticks at rest before judgement.
const REST: usize = 20;

/// A tool on its way through a wall.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// Radius of the ball, mm.
    pub radius_mm: f32,
    /// Speed, mm/s.
    pub speed: f32,
    /// Off the normal, degrees.
    pub angle: f32,
}

/// The grid, by every method.
pub fn parts(scope: Scope) -> Vec<Part> {
    let part =
        |method: Method| Part::new(format!("walls {}", method.name()), move |scope, found| by(&method, scope, found));
    Method::all().into_iter().filter(|method| !method.descriptor().is_oracle || !scope.quick).map(part).collect()
}

fn by(method: &Method, scope: Scope, findings: &mut Findings) {
    let normals = normals(scope.pick(1, 6));
    let speeds = scope.pick(&SPEEDS[1..], &SPEEDS[..]);
    let slow = method.descriptor().is_oracle;
    let used = if slow { &normals[..1] } else { &normals[..] };
    // The smallest ball is the hardest; the recommended method must hold walls with all.
    let sizes = if *method == Method::RECOMMENDED { &RADII_MM[..] } else { &RADII_MM[..1] };
    let grids: Vec<Vec<Vec<Outcome>>> = sizes.iter().map(|&r| grid(method, used, speeds, r)).collect();
    let all: Vec<&Outcome> = grids.iter().flatten().flatten().collect();
    let tunnelled = all.iter().filter(|outcome| **outcome != &Outcome::Works).count();
    let share = 100.0 * tunnelled as f64 / all.len() as f64;
    let cells = grids.into_iter().next().unwrap_or_default();
    let map = Map {
        title: format!("{}: walls, ball of {} mm", method.name(), RADII_MM[0]),
        x: "speed, mm/s".into(),
        y: "voxels, angle".into(),
        columns: speeds.iter().map(|v| format!("{v}")).collect(),
        rows: THICK.iter().flat_map(|t| ANGLES.map(|a| format!("{t}, {a}°"))).collect(),
        cells,
        ..Map::default()
    };
    findings.rows.push(
        passes(Row::new("walls x speed x angle", method.name()), &map)
            .with("orientations", used.len())
            .metric("tunnelled_cells_count", tunnelled as f64)
            .metric("tunnelled_cells_percent", share),
    );
    if *method == Method::RECOMMENDED {
        findings.gates.push(Gate::at_most("walls: cells in which the tool tunnels", tunnelled as f64, 0.0));
    }
    findings.maps.push(map_of(method, map));
}

/// Thickness and angle by speed.
fn grid(method: &Method, normals: &[Vec3], speeds: &[f32], radius_mm: f32) -> Vec<Vec<Outcome>> {
    let mut cells = Vec::new();
    for &thick in &THICK {
        let walls: Vec<(Vec3, BoneVolume)> = normals.iter().map(|&n| (n, wall(thick, n))).collect();
        for &angle in &ANGLES {
            let at = |&speed: &f32| judge(method, &walls, Cell { radius_mm, speed, angle });
            cells.push(speeds.iter().map(at).collect());
        }
    }
    cells
}

/// Directions of the wall's normal: a diagonal one first, as the hardest.
pub fn normals(count: usize) -> Vec<Vec3> {
    let mut all = vec![Vec3::splat(1.0).normalize(), Vec3::Z, Vec3::new(0.36, 0.48, 0.8)];
    all.extend(directions(8));
    all.truncate(count);
    all
}

/// A wall whose near face goes through the middle, its near side along `normal`.
pub fn wall(thick: f64, normal: Vec3) -> BoneVolume {
    wall_of(thick * VOXEL_MM, VOXEL_MM, normal)
}

/// A wall of some thickness in voxels of some edge, mm.
pub fn wall_of(thick_mm: f64, voxel_mm: f64, normal: Vec3) -> BoneVolume {
    let normal = normal.as_dvec3();
    voxels(EDGE, voxel_mm, |p| p.dot(normal).max(-p.dot(normal) - thick_mm))
}

/// How a method fares in a cell, in the worst of the walls.
pub fn judge(method: &Method, walls: &[(Vec3, BoneVolume)], cell: Cell) -> Outcome {
    let worst = |past: f32| walls.iter().find_map(|(normal, wall)| lost(method, wall, *normal, cell, past, |_| ()));
    match (worst(PRESSED_MM), worst(PIERCED_MM)) {
        (Some(reason), _) => Outcome::Fails(format!("{reason}, when pressed with 3.3 N")),
        (None, Some(reason)) => Outcome::Degrades(format!("{reason}, when the hand goes 6 mm past the face")),
        (None, None) => Outcome::Works,
    }
}

/// Why the wall does not hold a tool whose foremost point goes `past` mm beyond its face; `None`
/// when it does. `record` gets the force out of the wall at every tick, N at 2 N/mm.
pub fn lost(
    method: &Method,
    wall: &BoneVolume,
    normal: Vec3,
    cell: Cell,
    past: f32,
    mut record: impl FnMut(f32),
) -> Option<&'static str> {
    let (sin, cos) = cell.angle.to_radians().sin_cos();
    let way = normal.any_orthonormal_vector() * sin - normal * cos;
    let end = normal * (cell.radius_mm - past);
    let length = (2.5 + past) / cos;
    let step = cell.speed / 1000.0;
    let ticks = (length / step).ceil() as usize;
    let mut contact = method.build(&Tool::burr(cell.radius_mm));
    let mut out = RigidStep::default();
    contact.reset(held(end - way * length, normal).world_from_tool);
    for tick in 1..=ticks + REST {
        let left = (length - step * tick as f32).max(0.0);
        contact.step(wall, &held(end - way * left, normal), false, 1.0, &mut out);
        record(STIFFNESS * out.manifold.depth_mm * out.manifold.normal.dot(normal));
    }
    let proxy = contact.proxy().translation;
    let push = out.manifold.normal.dot(normal);
    if !proxy.is_finite() || !out.manifold.is_finite() {
        Some("no number")
    } else if proxy.dot(normal) < 0.0 {
        Some("through the wall")
    } else if !out.manifold.touches() {
        Some("no contact")
    } else if push < 0.0 {
        Some("pushed out on the far side")
    } else if push < 0.5 {
        Some("normal more than 60° off")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The border: thin walls that methods without a proxy lose at any speed, and the recommended
    /// one holds at 12 m/s.
    #[test]
    fn methods_without_a_proxy_lose_thin_walls_and_the_recommended_one_holds_them() {
        let normal = normals(1)[0];
        let walls = [(normal, wall(1.0, normal))];
        let at = |name: &str, speed: f32, angle: f32| {
            let method = Method::named(name).unwrap();
            judge(&method, &walls, Cell { radius_mm: RADII_MM[0], speed, angle }).grade()
        };
        for name in ["pointshell-sum", "pointshell-average", "ray-trace", "voxel-sum"] {
            assert!(at(name, 100.0, 0.0) >= 1, "{name} holds what it cannot");
        }
        for speed in [50.0, 500.0, 2000.0, 12_000.0] {
            for angle in ANGLES {
                assert_eq!(at(Method::RECOMMENDED.name(), speed, angle), 0, "{speed} mm/s, {angle}°");
            }
        }
    }
}
