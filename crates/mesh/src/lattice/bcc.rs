//! The body-centred cubic lattice and its tetrahedra.
//!
//! # Theory
//! Nodes are the corners and centres of cubes of edge a. A tetrahedron takes one edge between two corners and one, at right angles, between the centres of
//! neighbouring cubes around it: 12 for each cube, all congruent, with two long edges of length a (dihedral angle 90°) and
//! four short ones of √3/2 a (60°).
//!
//! ```text
//!   q ───────── q'      centres of two cubes that share a face
//!    ╲  c ── c' ╱       one edge of that face: the tetrahedron is q q' c c'
//! ```

use glam::DVec3;

/// A block of the lattice that covers a box.
pub(super) struct Bcc {
    /// Edge of a cube, mm.
    pub(super) spacing: f64,
    origin: DVec3,
    cells: [usize; 3],
}

impl Bcc {
    /// Covers the box and at least half a cube around it, with the middle of the box `shift` spacings (0 to 1) off a corner.
    pub(super) fn over(min: DVec3, max: DVec3, spacing: f64, shift: DVec3) -> Self {
        let half = ((max - min) / (2.0 * spacing)).ceil() + 2.0;
        let cells = half.to_array().map(|n| 2 * n as usize);
        Self { spacing, origin: 0.5 * (min + max) - (half - shift) * spacing, cells }
    }

    fn corners(&self) -> usize {
        self.cells.iter().map(|n| n + 1).product()
    }

    /// How many cubes there are.
    pub(super) fn cubes(&self) -> usize {
        self.cells.iter().fold(1, |n, &c| n.saturating_mul(c))
    }

    /// How many nodes there are: first the corners, then the centres, x fastest.
    pub(super) fn nodes(&self) -> usize {
        self.corners() + self.cells.iter().product::<usize>()
    }

    /// Whether a node is the centre of a cube.
    pub(super) fn is_centre(&self, node: usize) -> bool {
        node >= self.corners()
    }

    /// Where a node is, in half spacings from the origin: even at corners, odd at centres.
    pub(super) fn halves(&self, node: usize) -> [usize; 3] {
        let centre = self.is_centre(node);
        let (at, odd) = if centre { (node - self.corners(), 1) } else { (node, 0) };
        let [nx, ny, _] = self.cells.map(|n| n + 1 - odd);
        [at % nx, at / nx % ny, at / (nx * ny)].map(|n| 2 * n + odd)
    }

    /// World position of a node, mm.
    pub(super) fn position(&self, node: usize) -> DVec3 {
        let halves = DVec3::from_array(self.halves(node).map(|n| n as f64));
        self.origin + 0.5 * self.spacing * halves
    }

    fn corner(&self, [i, j, k]: [usize; 3]) -> u32 {
        let [nx, ny, _] = self.cells.map(|n| n + 1);
        (i + nx * (j + ny * k)) as u32
    }

    fn centre(&self, [i, j, k]: [usize; 3]) -> u32 {
        (self.corners() + i + self.cells[0] * (j + self.cells[1] * k)) as u32
    }

    /// All tetrahedra, positively oriented.
    pub(super) fn tets(&self) -> Vec<[u32; 4]> {
        let mut tets = Vec::with_capacity(12 * self.cubes());
        for k in 0..self.cells[2] {
            for j in 0..self.cells[1] {
                for i in 0..self.cells[0] {
                    for axis in (0..3).filter(|&axis| [i, j, k][axis] + 1 < self.cells[axis]) {
                        tets.extend(self.around_face([i, j, k], axis));
                    }
                }
            }
        }
        tets
    }

    /// The four tetrahedra around the face between a cube and the next one along `axis`.
    fn around_face(&self, cell: [usize; 3], axis: usize) -> [[u32; 4]; 4] {
        let moved = |x: usize, s: usize, t: usize| {
            let by = [x, s, t];
            std::array::from_fn(|d| cell[d] + by[(d + 3 - axis) % 3])
        };
        let (near, far) = (self.centre(cell), self.centre(moved(1, 0, 0)));
        let ring = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[s, t]| self.corner(moved(1, s, t)));
        [0, 1, 2, 3].map(|n| [near, far, ring[n], ring[(n + 1) % 4]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Quality, Surface, TetMesh, Topology};

    #[test]
    fn the_lattice_is_sound_and_its_angles_are_60_and_90() {
        let lattice = Bcc::over(DVec3::ZERO, DVec3::new(2.0, 3.0, 1.0), 1.0, DVec3::ZERO);
        let positions = (0..lattice.nodes()).map(|n| lattice.position(n).as_vec3()).collect();
        let mesh = TetMesh { positions, tets: lattice.tets() }.without_orphans();
        assert_eq!(mesh.check(), Ok(()));
        assert!(Surface::of(&mesh).is_closed());
        assert_eq!(Topology::of(&mesh).components().1, 1);
        let quality = Quality::of(&mesh);
        assert!((quality.min_dihedral_deg - 60.0).abs() < 1e-4 && (quality.max_dihedral_deg - 90.0).abs() < 1e-4);
        assert!((quality.max_mm3 - 1.0 / 12.0).abs() < 1e-6);
    }
}
