//! Any closed triangle mesh as a point shell: points spread over its surface, with inward normals.
//!
//! # Theory
//! Each triangle is cut into pieces a third of the spacing in size; their centres are candidates.
//! In the order of the triangles a candidate becomes a point unless a point with a normal to the
//! same side is nearer than 0.7 of the spacing. So no two points crowd, and no place of the surface
//! is further than the spacing from a point: with a spacing of a voxel's edge nothing of the bone's
//! size slips between them.
//!
//! # Practice
//! Tool frame, mm: tip at the origin, shaft along +z. At load time; the mesh's own reader is
//! `trepan-mesh`'s. A mesh that is inside out is turned.
//!
//! # Sources
//! W. McNeely, K. Puterbaugh, J. Troy, *Six degree-of-freedom haptic rendering using voxel
//! sampling*, SIGGRAPH 1999, for the shell.
//!
//! # When not to use it
//! For balls: [`Pointshell::sphere`] is more even.

use std::collections::HashMap;
use trepan_geometry::{Pointshell, Vec3};

/// Most points of a shell: a tick looks at each.
const MAX_POINTS: usize = 20_000;
/// Most candidates: 16 for each point and more.
const MAX_CANDIDATES: u64 = 4_000_000;
/// Size of a triangle's pieces, and least way between two points, in spacings.
const PIECE: f32 = 0.33;
const APART: f32 = 0.7;

/// Why a mesh cannot be a tool.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ShellError {
    /// A corner that is not there, or not a number.
    #[error("triangle {triangle} of the tool has a corner that is missing or not a number; write the mesh anew")]
    Corner {
        /// Which triangle.
        triangle: usize,
    },
    /// A hole, or triangles that face different ways.
    #[error(
        "the tool's mesh is not closed: {sides} sides of triangles have no partner the other way round; close its holes and let all triangles face outwards"
    )]
    Open {
        /// How many sides.
        sides: usize,
    },
    /// More points than a tick can look at.
    #[error(
        "the tool would have more than {MAX_POINTS} points at {spacing_mm} mm; give a wider spacing or a smaller mesh"
    )]
    TooFine {
        /// The spacing asked for.
        spacing_mm: f32,
    },
}

/// Points on a closed mesh about `spacing_mm` apart, with their inward normals.
pub fn of_mesh(positions: &[Vec3], triangles: &[[u32; 3]], spacing_mm: f32) -> Result<Pointshell, ShellError> {
    let corners = corners(positions, triangles)?;
    check_closed(triangles)?;
    let too_fine = ShellError::TooFine { spacing_mm };
    let pieces = |[a, b, c]: &[Vec3; 3]| {
        let longest = a.distance(*b).max(b.distance(*c)).max(c.distance(*a));
        (longest / (PIECE * spacing_mm)).ceil().max(1.0)
    };
    let candidates: f64 = corners.iter().map(|triangle| f64::from(pieces(triangle)).powi(2)).sum();
    if candidates.is_nan() || candidates > MAX_CANDIDATES as f64 || spacing_mm <= 0.0 {
        return Err(too_fine);
    }
    let volume: f64 = corners.iter().map(|[a, b, c]| f64::from(a.dot(b.cross(*c)))).sum();
    let mut thin = Thinned::new(APART * spacing_mm);
    for triangle @ [a, b, c] in &corners {
        let outward = (*b - *a).cross(*c - *a).normalize_or_zero() * if volume < 0.0 { -1.0 } else { 1.0 };
        let n = pieces(triangle) as u32;
        let place = |i: f32, j: f32| *a + (*b - *a) * (i / n as f32) + (*c - *a) * (j / n as f32);
        for (i, j) in (0..n).flat_map(|i| (0..n - i).map(move |j| (i as f32, j as f32))) {
            thin.offer(place(i + 1.0 / 3.0, j + 1.0 / 3.0), -outward);
            if i + j + 1.0 < n as f32 {
                thin.offer(place(i + 2.0 / 3.0, j + 2.0 / 3.0), -outward);
            }
        }
        if thin.shell.points.len() > MAX_POINTS {
            return Err(too_fine);
        }
    }
    Ok(thin.shell)
}

fn corners(positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<Vec<[Vec3; 3]>, ShellError> {
    let corner = |n: u32| positions.get(n as usize).copied().filter(|p| p.is_finite());
    let all = triangles.iter().enumerate().map(|(triangle, &[a, b, c])| {
        let found = corner(a).zip(corner(b)).zip(corner(c));
        found.map(|((a, b), c)| [a, b, c]).ok_or(ShellError::Corner { triangle })
    });
    all.collect()
}

/// Each side must be met once each way round.
fn check_closed(triangles: &[[u32; 3]]) -> Result<(), ShellError> {
    let mut met = HashMap::<(u32, u32), i32>::new();
    for (a, b) in triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]) {
        *met.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
    }
    let sides = met.values().filter(|&&balance| balance != 0).count();
    if sides == 0 && !triangles.is_empty() { Ok(()) } else { Err(ShellError::Open { sides }) }
}

/// A shell whose points keep apart.
struct Thinned {
    shell: Pointshell,
    apart: f32,
    cells: HashMap<[i32; 3], Vec<usize>>,
}

impl Thinned {
    fn new(apart: f32) -> Self {
        let shell = Pointshell { points: Vec::new(), inward_normals: Vec::new() };
        Self { shell, apart, cells: HashMap::new() }
    }

    /// Takes a point in, unless one that looks the same way is near.
    fn offer(&mut self, point: Vec3, inward: Vec3) {
        let cell = (point / self.apart).floor().as_ivec3();
        let around = (0..27).map(|n| cell + glam::IVec3::new(n % 3, n / 3 % 3, n / 9) - 1);
        let near = around.filter_map(|cell| self.cells.get(&cell.to_array())).flatten().any(|&other| {
            let same_side = self.shell.inward_normals[other].dot(inward) > 0.0;
            same_side && self.shell.points[other].distance(point) < self.apart
        });
        if !near && inward != Vec3::ZERO {
            self.cells.entry(cell.to_array()).or_default().push(self.shell.points.len());
            self.shell.points.push(point);
            self.shell.inward_normals.push(inward);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parry3d::query::PointQuery;
    use parry3d::shape::{Cone, TriMesh, TriMeshFlags};

    /// A cone of 6 mm with its tip down, as a drill bit is, from parry.
    fn bit() -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let (positions, triangles) = Cone::new(3.0, 2.0).to_trimesh(24);
        (positions.into_iter().map(|p| Vec3::new(p.x, p.z, -p.y)).collect(), triangles)
    }

    #[test]
    fn points_cover_the_mesh_keep_apart_and_look_inwards() {
        let (positions, triangles) = bit();
        let parry = TriMesh::with_flags(positions.clone(), triangles.clone(), TriMeshFlags::ORIENTED).unwrap();
        let inside_out: Vec<_> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        for triangles in [&triangles, &inside_out] {
            let shell = of_mesh(&positions, triangles, 0.5).unwrap();
            assert!((200..800).contains(&shell.points.len()), "{}", shell.points.len());
            for (at, (&point, &inward)) in shell.points.iter().zip(&shell.inward_normals).enumerate() {
                assert!(parry.project_local_point(point, false).point.distance(point) < 1e-4, "on the mesh");
                assert!(parry.project_local_point(point + 1e-3 * inward, true).is_inside, "{point} looks out");
                let crowd = (0..at).filter(|&n| shell.inward_normals[n].dot(inward) > 0.0);
                assert!(crowd.map(|n| shell.points[n].distance(point)).all(|way| way >= 0.35));
            }
            for n in 0..2000u32 {
                let [a, b, c] = *parry.triangle(n % triangles.len() as u32).vertices();
                let (s, t) = ((n as f32 * 0.618).fract().sqrt(), (n as f32 * 0.755).fract());
                let place = a * (1.0 - s) + b * (s * (1.0 - t)) + c * (s * t);
                let nearest = shell.points.iter().map(|p| p.distance(place)).fold(f32::MAX, f32::min);
                assert!(nearest < 0.5, "{place} is {nearest} mm from the next point");
            }
        }
    }

    #[test]
    fn meshes_that_are_no_tools_are_refused_with_the_reason() {
        let (positions, triangles) = bit();
        assert_eq!(of_mesh(&positions, &triangles[1..], 0.5), Err(ShellError::Open { sides: 3 }));
        assert_eq!(of_mesh(&positions, &[], 0.5), Err(ShellError::Open { sides: 0 }));
        assert_eq!(of_mesh(&positions, &[[0, 1, 999]], 0.5), Err(ShellError::Corner { triangle: 0 }));
        for spacing_mm in [1e-3, 0.0, -1.0] {
            assert_eq!(of_mesh(&positions, &triangles, spacing_mm), Err(ShellError::TooFine { spacing_mm }));
        }
    }
}
