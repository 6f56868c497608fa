//! The background lattice: body-centred cubic, over cubes of one size or of several.
//!
//! # Theory
//! Nodes are the corners and centres of cubes. Between two cubes of one size a tetrahedron takes
//! one edge of their common face and both centres: 12 for each cube, all congruent, with two long
//! edges (dihedral angle 90°) and four short ones, √3/2 as long (60°).
//!
//! ```text
//!   q ───────── q'      centres of two cubes that share a face
//!    ╲  c ── c' ╱       one edge of that face: the tetrahedron is q q' c c'
//! ```
//!
//! Cubes of several sizes form an octree in which touching cubes differ by at most one doubling.
//! Where smaller cubes put a node on the midpoint of the edge c c', the tetrahedron is split in two
//! there. Where a cube meets a smaller one, their common square is split along the diagonal to the
//! centre of the larger face, and each half is joined to both centres. All angles are between 45°
//! and 120° (Labelle and Shewchuk 2007, section 4).
//!
//! # Practice
//! Positions are integers in half the smallest edge, so that all tetrahedra agree about a node. 16
//! bytes a cube, 12 a node, 16 a tetrahedron.

use glam::DVec3;
use rayon::prelude::*;

/// Largest coordinate that fits into 21 bits of a key, in half edges.
const MOST_HALVES: f64 = 2_000_000.0;

/// Nodes and tetrahedra that cover a body.
pub(super) struct Lattice {
    /// Edge of the smallest cubes, mm.
    pub(super) spacing: f64,
    origin: DVec3,
    /// Positions of the nodes, in half spacings from the origin.
    halves: Vec<[u32; 3]>,
    /// Positively oriented.
    pub(super) tets: Vec<[u32; 4]>,
}

/// Decision about a cube.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cube {
    /// The body may reach it, and it is fine enough.
    Keep,
    /// It is too large for its position.
    Split,
    /// It is far from the body.
    Drop,
}

impl Lattice {
    /// Covers the box with cubes of edge `spacing · 2^level`, level 0 to `levels`.
    /// The box's centre is `shift` spacings (0 to 1) off a corner of the largest cube.
    ///
    /// `judge` gets the centre of a cube and its level. Returns nothing if more than `most` cubes
    /// are needed.
    pub(super) fn over(
        [min, max]: [DVec3; 2],
        spacing: f64,
        shift: DVec3,
        levels: u32,
        most: usize,
        judge: impl Fn(DVec3, u32) -> Cube + Sync,
    ) -> Option<Self> {
        let largest = spacing * f64::from(1 << levels);
        let half = ((max - min) / (2.0 * largest)).ceil() + 2.0;
        let cells = (2.0 * half).to_array();
        if cells.iter().product::<f64>() > most as f64
            || cells.iter().any(|n| n * largest > spacing * MOST_HALVES / 2.0)
        {
            return None;
        }
        let origin = 0.5 * (min + max) - half * largest + shift * spacing;
        let roots = half.to_array().map(|n| 2 * n as u32);
        let leaves = leaves(roots, levels, most, |at, level| {
            let halves = at.map(|n| f64::from((2 * n + 1) << level));
            judge(origin + 0.5 * spacing * DVec3::from_array(halves), level)
        })?;
        let halves = nodes(&leaves);
        let tets = tets(&leaves, &halves);
        Some(Self { spacing, origin, halves: halves.into_iter().map(unpacked).collect(), tets })
    }

    /// World positions of the nodes, mm.
    pub(super) fn positions(&self) -> Vec<DVec3> {
        self.halves.iter().map(|h| self.origin + 0.5 * self.spacing * DVec3::from_array(h.map(f64::from))).collect()
    }

    /// Squared distance of two nodes, in quarters of a squared spacing, exactly; and whether they
    /// are on one axis.
    pub(super) fn edge(&self, a: u32, b: u32) -> (u64, bool) {
        let [a, b] = [a, b].map(|n| self.halves[n as usize]);
        let by: [u64; 3] = std::array::from_fn(|d| u64::from(a[d].abs_diff(b[d])));
        (by.iter().map(|n| n * n).sum(), by.iter().filter(|n| **n != 0).count() == 1)
    }
}

/// Packs coordinates into one number, x fastest.
fn packed([x, y, z]: [u32; 3]) -> u64 {
    u64::from(x) | u64::from(y) << 21 | u64::from(z) << 42
}

fn unpacked(key: u64) -> [u32; 3] {
    [0, 21, 42].map(|shift| (key >> shift & 0x1F_FFFF) as u32)
}

/// The cubes around a cube, including itself.
fn around(at: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..27u32).filter_map(move |n| {
        let by = [n % 3, n / 3 % 3, n / 9];
        let moved = [0, 1, 2].map(|d| (at[d] + by[d]).checked_sub(1));
        Some([moved[0]?, moved[1]?, moved[2]?])
    })
}

fn sorted_set(mut keys: Vec<u64>) -> Vec<u64> {
    keys.par_sort_unstable();
    keys.dedup();
    keys
}

fn has(set: &[u64], at: [u32; 3]) -> bool {
    set.binary_search(&packed(at)).is_ok()
}

/// The unsplit cubes of each level, ascending.
fn leaves(
    roots: [u32; 3],
    levels: u32,
    most: usize,
    judge: impl Fn([u32; 3], u32) -> Cube + Sync,
) -> Option<Vec<Vec<u64>>> {
    let [nx, ny, nz] = roots;
    let all = |n: u32| packed([n % nx, n / nx % ny, n / (nx * ny)]);
    let whole: Vec<u64> = (0..nx * ny * nz).map(all).collect();
    let mut split = vec![Vec::new(); levels as usize + 1];
    let mut open = whole.clone();
    for level in (1..=levels).rev() {
        let wanted = |key: &u64| judge(unpacked(*key), level) == Cube::Split;
        split[level as usize] = open.par_iter().copied().filter(wanted).collect();
        open = children(&split[level as usize]);
        if open.len() > most {
            return None;
        }
    }
    balance(&mut split, roots);
    let mut leaves = Vec::with_capacity(split.len());
    for level in 0..=levels as usize {
        let cubes = if level == levels as usize { whole.clone() } else { children(&split[level + 1]) };
        let stays =
            |key: &u64| split[level].binary_search(key).is_err() && judge(unpacked(*key), level as u32) != Cube::Drop;
        leaves.push(cubes.into_par_iter().filter(stays).collect());
    }
    (leaves.iter().map(Vec::len).sum::<usize>() <= most).then_some(leaves)
}

fn children(split: &[u64]) -> Vec<u64> {
    let eight = |key: &u64| {
        let at = unpacked(*key);
        [0u32, 1, 2, 3, 4, 5, 6, 7].map(|n| packed([0, 1, 2].map(|d| 2 * at[d] + (n >> d & 1))))
    };
    sorted_set(split.iter().flat_map(eight).collect())
}

/// Splits more cubes, until all neighbours of a split cube exist.
fn balance(split: &mut [Vec<u64>], roots: [u32; 3]) {
    for level in 2..split.len() {
        let to_root = split.len() - 1 - level;
        let inside = |at: &[u32; 3]| (0..3).all(|d| at[d] >> to_root < roots[d]);
        let beside = split[level - 1].iter().flat_map(|&key| around(unpacked(key)));
        let parents = beside.map(|at| at.map(|n| n / 2)).filter(inside).map(packed);
        split[level] = sorted_set(parents.chain(split[level].iter().copied()).collect());
    }
}

/// The corners and centres of all cubes, ascending, in half spacings.
fn nodes(leaves: &[Vec<u64>]) -> Vec<u64> {
    let mut keys = Vec::with_capacity(3 * leaves.iter().map(Vec::len).sum::<usize>());
    for (level, cubes) in leaves.iter().enumerate() {
        for &cube in cubes {
            let at = unpacked(cube);
            keys.push(packed(centre(at, level)));
            keys.extend((0..8u32).map(|n| packed([0, 1, 2].map(|d| (2 * (at[d] + (n >> d & 1))) << level))));
        }
    }
    sorted_set(keys)
}

fn centre(at: [u32; 3], level: usize) -> [u32; 3] {
    at.map(|n| (2 * n + 1) << level)
}

fn tets(leaves: &[Vec<u64>], nodes: &[u64]) -> Vec<[u32; 4]> {
    let mut tets = Vec::new();
    for (level, cubes) in leaves.iter().enumerate() {
        let larger: &[u64] = leaves.get(level + 1).map_or(&[], |cubes| cubes);
        let of_cube = |&cube: &u64| {
            let at = unpacked(cube);
            let sides = (0..6).filter_map(move |side| Some((side % 3, side > 2, beside(at, side % 3, side > 2)?)));
            let mut found = Vec::new();
            for (axis, ahead, next) in sides {
                let face = square(at, level, axis, ahead);
                let apexes = |other: [u32; 3]| [centre(at, level), other].map(|c| number(nodes, c));
                if ahead && has(cubes, next) {
                    found.extend(between_equals(nodes, apexes(centre(next, level)), face));
                } else if has(larger, next.map(|n| n / 2)) {
                    let parent = next.map(|n| n / 2);
                    found.extend(between_sizes(
                        nodes,
                        apexes(centre(parent, level + 1)),
                        face,
                        centre(parent, level + 1),
                    ));
                }
            }
            found
        };
        tets.par_extend(cubes.par_iter().flat_map_iter(of_cube));
    }
    tets
}

/// The cube of the same size across a face.
fn beside(mut at: [u32; 3], axis: usize, ahead: bool) -> Option<[u32; 3]> {
    at[axis] = if ahead { at[axis] + 1 } else { at[axis].checked_sub(1)? };
    Some(at)
}

/// The corners of a cube's face in a ring, counterclockwise from ahead along its axis.
fn square(at: [u32; 3], level: usize, axis: usize, ahead: bool) -> [[u32; 3]; 4] {
    [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[s, t]| {
        let mut corner = at;
        corner[axis] += u32::from(ahead);
        corner[(axis + 1) % 3] += s;
        corner[(axis + 2) % 3] += t;
        corner.map(|n| (2 * n) << level)
    })
}

/// The index of an existing node.
fn number(nodes: &[u64], halves: [u32; 3]) -> u32 {
    nodes.binary_search(&packed(halves)).unwrap_or_default() as u32
}

/// The tetrahedra around the line between two centres: one per edge of the face, two if the edge
/// has a midpoint node.
fn between_equals(nodes: &[u64], [near, far]: [u32; 2], face: [[u32; 3]; 4]) -> impl Iterator<Item = [u32; 4]> {
    (0..4).flat_map(move |n| {
        let (from, to) = (face[n], face[(n + 1) % 4]);
        let middle = nodes.binary_search(&packed([0, 1, 2].map(|d| (from[d] + to[d]) / 2))).ok();
        let [from, to] = [from, to].map(|corner| number(nodes, corner));
        let first = middle.map_or(to, |m| m as u32);
        std::iter::once([near, far, from, first]).chain(middle.map(|m| [near, far, m as u32, to]))
    })
}

/// The four tetrahedra between the centres of a cube and of a larger one, and the halves of the
/// smaller one's face.
fn between_sizes(nodes: &[u64], apexes: [u32; 2], face: [[u32; 3]; 4], larger: [u32; 3]) -> [[u32; 4]; 4] {
    let off = |corner: [u32; 3]| (0..3).map(|d| corner[d].abs_diff(larger[d])).sum::<u32>();
    let first = (0..4).min_by_key(|&n| off(face[n])).unwrap_or(0);
    let ring = [0, 1, 2, 3].map(|n| number(nodes, face[(first + n) % 4]));
    let [small, large] = apexes;
    [
        [small, ring[0], ring[1], ring[2]],
        [small, ring[0], ring[2], ring[3]],
        [large, ring[0], ring[1], ring[2]],
        [large, ring[0], ring[2], ring[3]],
    ]
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::{Quality, Surface, TetMesh, Topology};

    /// A uniform lattice over a cube.
    pub(crate) fn uniform(edge: f64, spacing: f64) -> Lattice {
        Lattice::over([DVec3::ZERO, DVec3::splat(edge)], spacing, DVec3::ZERO, 0, usize::MAX, |_, _| Cube::Keep)
            .unwrap()
    }

    fn mesh(lattice: &Lattice) -> TetMesh {
        let positions: Vec<DVec3> = lattice.positions();
        let turned = |t: &[u32; 4]| {
            let [a, b, c, d] = *t;
            let volume = crate::quality::volume(t.map(|n| positions[n as usize]));
            if volume < 0.0 { [a, b, d, c] } else { *t }
        };
        let tets = lattice.tets.iter().map(turned).collect();
        TetMesh { positions: positions.iter().map(|p| p.as_vec3()).collect(), tets }.without_orphans()
    }

    #[test]
    fn one_size_is_sound_and_its_angles_are_60_and_90() {
        let mesh = mesh(&uniform(3.0, 1.0));
        assert_eq!(mesh.check(), Ok(()));
        assert!(Surface::of(&mesh).is_closed());
        assert_eq!(Topology::of(&mesh).components().1, 1);
        let quality = Quality::of(&mesh);
        assert!((quality.min_dihedral_deg - 60.0).abs() < 1e-4 && (quality.max_dihedral_deg - 90.0).abs() < 1e-4);
        assert!((quality.max_mm3 - 1.0 / 12.0).abs() < 1e-6);
    }

    #[test]
    fn several_sizes_leave_no_gap_and_their_angles_are_45_to_120() {
        let (min, max) = (DVec3::ZERO, DVec3::splat(20.0));
        let point = DVec3::new(3.0, 5.0, 4.0);
        let judge = |centre: DVec3, level: u32| {
            let size = f64::from(1 << level);
            if centre.distance(point) < 1.5 * size { Cube::Split } else { Cube::Keep }
        };
        let lattice = Lattice::over([min, max], 1.0, DVec3::ZERO, 4, 1_000_000, judge).unwrap();
        let mesh = mesh(&lattice);
        assert_eq!(mesh.check(), Ok(()));
        assert!(Surface::of(&mesh).is_closed());
        assert_eq!(Topology::of(&mesh).components().1, 1);
        let quality = Quality::of(&mesh);
        assert!((quality.min_dihedral_deg - 45.0).abs() < 1e-4 && (quality.max_dihedral_deg - 120.0).abs() < 1e-4);
        assert!(quality.max_mm3 / quality.min_mm3 > 1000.0);
        // Without gaps the boundary encloses exactly the tetrahedra's volume.
        let enclosed = Surface::of(&mesh).to_tri_mesh(&mesh.positions).volume_mm3();
        assert!((enclosed / mesh.total_mm3() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn too_many_cubes_are_refused() {
        let over =
            |most| Lattice::over([DVec3::ZERO, DVec3::splat(9.0)], 1.0, DVec3::ZERO, 1, most, |_, _| Cube::Split);
        assert!(over(100).is_none() && over(100_000).is_some());
        let huge = Lattice::over([DVec3::ZERO, DVec3::splat(9e9)], 1.0, DVec3::ZERO, 1, usize::MAX, |_, _| Cube::Keep);
        assert!(huge.is_none());
    }
}
