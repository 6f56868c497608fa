//! Extracts the isosurface of a voxel volume as closed triangles, such as a drilled skull for STL.
//!
//! # Theory
//! Each cell of eight voxel centres is split into the six tetrahedra around its diagonal. The
//! density, linear in each, crosses the isovalue in one triangle or two (Doi and Koide 1991).
//! Neighbouring cells split their common face in the same way, so that the triangles close without
//! the ambiguous cases of marching cubes. Outside the grid is air, so that bone cut by the grid's
//! border is closed there too.
//!
//! ```text
//!   •───┄○      • at or over the isovalue
//!   │ ╲ ╱       ╲ surface, seen from ○
//!   •──┄○
//! ```
//!
//! # Practice
//! World mm. Vertices are shared, each on a grid edge, in the order of the cells; equal volumes
//! give bit-identical results. About a second for 50 million voxels and 100 bytes a triangle.
//!
//! # Sources
//! A. Doi, A. Koide, *An efficient method of triangulating equi-valued surfaces by using
//! tetrahedral cells*, IEICE Trans. E74, 1991.
//!
//! # When not to use it
//! For printing without inspection: slender triangles remain. For finite elements:
//! [`lattice`](crate::lattice) makes valid tetrahedra.

use crate::TriMesh;
use glam::DVec3;
use std::collections::HashMap;
use trepan_geometry::Vec3;
use trepan_volume::VoxelVolume;

/// The six paths from corner 0 to corner 7 along axes, each a tetrahedron, and whether it is
/// right-handed.
const WAYS: [([usize; 3], bool); 6] = [
    ([0, 1, 2], true),
    ([1, 2, 0], true),
    ([2, 0, 1], true),
    ([0, 2, 1], false),
    ([2, 1, 0], false),
    ([1, 0, 2], false),
];

/// The closed isosurface of voxels at or over `isovalue`; triangles are counterclockwise from
/// outside.
pub fn isosurface(volume: &VoxelVolume<i16>, isovalue: i16) -> TriMesh {
    let mut surface = Surface { volume, isovalue, points: HashMap::new(), mesh: TriMesh::default() };
    let [nx, ny, nz] = volume.dims.map(|n| n as i64);
    for k in -1..nz {
        for j in -1..ny {
            // Bits 0 to 3: the corners at x; bits 4 to 7: those at x + 1.
            let mut solid = 0u8;
            for i in -1..nx {
                let next = (0..4).map(|n| u8::from(surface.is_solid([i + 1, j + (n & 1), k + (n >> 1)])) << n);
                solid = solid >> 4 | next.sum::<u8>() << 4;
                if solid != 0 && solid != u8::MAX {
                    surface.cell([i, j, k]);
                }
            }
        }
    }
    if volume.world_from_voxel.matrix3.determinant() < 0.0 {
        surface.mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    surface.mesh
}

struct Surface<'a> {
    volume: &'a VoxelVolume<i16>,
    isovalue: i16,
    /// Vertex indices by the ends of their edges.
    points: HashMap<[[i64; 3]; 2], u32>,
    mesh: TriMesh,
}

impl Surface<'_> {
    /// The density at a voxel; air outside the grid.
    fn density(&self, [i, j, k]: [i64; 3]) -> i16 {
        let [nx, ny, nz] = self.volume.dims.map(|n| n as i64);
        let inside = (0..nx).contains(&i) && (0..ny).contains(&j) && (0..nz).contains(&k);
        if inside { self.volume.data[(i + nx * (j + ny * k)) as usize] } else { i16::MIN }
    }

    fn is_solid(&self, voxel: [i64; 3]) -> bool {
        self.density(voxel) >= self.isovalue
    }

    /// The triangles of the cell whose lowest corner is `low`.
    fn cell(&mut self, low: [i64; 3]) {
        for (way, right_handed) in WAYS {
            let mut corners = [low; 4];
            for n in 1..4 {
                corners[n] = corners[n - 1];
                corners[n][way[n - 1]] += 1;
            }
            self.tetrahedron(corners, right_handed);
        }
    }

    fn tetrahedron(&mut self, corners: [[i64; 3]; 4], right_handed: bool) {
        let solid = corners.map(|corner| self.is_solid(corner));
        // Solid corners first; each exchange flips the tetrahedron's orientation.
        let mut order = [0, 1, 2, 3];
        order.sort_by_key(|&n| !solid[n]);
        let exchanges = (0..4).flat_map(|n| (0..n).map(move |m| (m, n))).filter(|&(m, n)| order[m] > order[n]).count();
        let [mut a, mut b, mut c, mut d] = order.map(|n| corners[n]);
        let count = solid.into_iter().filter(|&solid| solid).count();
        match right_handed == (exchanges % 2 == 0) {
            true => {}
            false if count == 3 => (a, b) = (b, a),
            false => (c, d) = (d, c),
        }
        match count {
            1 => self.triangles([[a, b], [a, c], [a, d]]),
            2 => {
                self.triangles([[a, c], [a, d], [b, d]]);
                self.triangles([[a, c], [b, d], [b, c]]);
            }
            3 => self.triangles([[a, d], [b, d], [c, d]]),
            _ => {}
        }
    }

    /// Adds a triangle with its corners on edges from a solid voxel to an empty one.
    fn triangles(&mut self, edges: [[[i64; 3]; 2]; 3]) {
        let triangle = edges.map(|edge| self.point(edge));
        self.mesh.triangles.push(triangle);
    }

    fn point(&mut self, edge: [[i64; 3]; 2]) -> u32 {
        if let Some(&known) = self.points.get(&edge) {
            return known;
        }
        let [solid, bare] = edge.map(|end| DVec3::from_array(end.map(|x| x as f64)));
        let [over, under] = edge.map(|end| f64::from(self.density(end)) - f64::from(self.isovalue));
        // Strictly between the ends, so that no triangle degenerates.
        let share = (over / (over - under)).clamp(1e-3, 1.0 - 1e-3);
        let point: Vec3 = self.volume.world_from_voxel.transform_point3(solid.lerp(bare, share)).as_vec3();
        let at = self.mesh.positions.len() as u32;
        self.mesh.positions.push(point);
        self.points.insert(edge, at);
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    const EDGE: usize = 24;

    fn ball(radius: f64) -> VoxelVolume<i16> {
        let mut volume = VoxelVolume::isotropic([EDGE; 3], Vec3::splat(-11.7), 1.0, 0i16);
        for at in 0..volume.data.len() {
            let centre = volume.centre_of([at % EDGE, at / EDGE % EDGE, at / EDGE / EDGE]);
            volume.data[at] = (400.0 + 500.0 * (radius - centre.length()).clamp(-2.0, 2.0)) as i16;
        }
        volume
    }

    /// Whether each edge of a triangle belongs to one other triangle in the opposite direction.
    fn is_closed(mesh: &TriMesh) -> bool {
        let sides = || mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let all: HashSet<_> = sides().collect();
        all.len() == 3 * mesh.triangles.len() && sides().all(|(a, b)| all.contains(&(b, a)))
    }

    #[test]
    fn a_ball_is_closed_and_as_large_as_it_should_be() {
        let mesh = isosurface(&ball(8.0), 400);
        let truth = 4.0 / 3.0 * std::f64::consts::PI * 512.0;
        assert!(is_closed(&mesh));
        assert!((mesh.volume_mm3() / truth - 1.0).abs() < 0.01, "{} of {truth} mm³", mesh.volume_mm3());
        let off = mesh.positions.iter().map(|p| (p.length() - 8.0).abs()).fold(0.0, f32::max);
        assert!(off < 0.05, "a vertex is {off} mm off the ball");
    }

    #[test]
    fn bone_at_the_border_noise_and_mirrored_grids_are_closed_too() {
        let mut noise = ball(14.0);
        noise.data.iter_mut().enumerate().for_each(|(at, v)| *v += (at * 7919 % 1009) as i16 - 500);
        noise.data[0] = 400;
        for mut volume in [ball(14.0), noise] {
            assert!(is_closed(&isosurface(&volume, 400)));
            let size = isosurface(&volume, 400).volume_mm3();
            volume.world_from_voxel.matrix3.x_axis *= -1.0;
            assert!((isosurface(&volume, 400).volume_mm3() / size - 1.0).abs() < 1e-4 && size > 0.0);
        }
        assert!(isosurface(&ball(8.0), i16::MAX).triangles.is_empty());
    }
}
