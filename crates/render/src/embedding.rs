//! The places of a fine surface in the tetrahedra that move it.
//!
//! # Theory
//! A vertex x lies in a tetrahedron with corners pᵢ at barycentric weights wᵢ, `x = Σ wᵢ pᵢ`, and
//! moves with them. One just outside follows the motion of the tetrahedron that it is least outside
//! of, relative to that one's size: some weights are negative then.
//!
//! # Practice
//! Tetrahedra are found by a grid of cells of their mean size, once for a scene.
//!
//! # Sources
//! As in the mappings of SOFA (Faure et al. 2012).

use glam::{IVec3, Mat3, Vec3};
use trepan_geometry::Aabb;
use trepan_mesh::{NONE, TetMesh};

/// A vertex as a weighted sum of nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Embedding {
    pub nodes: [u32; 4],
    pub weights: [f32; 4],
    /// Added to that sum, mm.
    pub offset: Vec3,
    /// The tetrahedron, or [`NONE`] for a node.
    pub tet: u32,
}

impl Embedding {
    /// A node itself.
    pub fn node(node: u32) -> Self {
        Self { nodes: [node; 4], weights: [1.0, 0.0, 0.0, 0.0], offset: Vec3::ZERO, tet: NONE }
    }

    /// A place at rest in a tetrahedron, or beside it; `None` in a flat one.
    pub fn within(tet: u32, mesh: &TetMesh, place: Vec3) -> Option<Self> {
        let (inverse, corner) = inverse(mesh.corners(tet as usize));
        let w = inverse * (place - corner);
        let weights = [1.0 - w.x - w.y - w.z, w.x, w.y, w.z];
        w.is_finite().then_some(Self { nodes: mesh.tets[tet as usize], weights, offset: Vec3::ZERO, tet })
    }

    /// Its place, by the places of all nodes.
    pub fn place(&self, positions: &[Vec3]) -> Vec3 {
        let [a, b, c, d] = self.nodes.map(|n| positions[n as usize]);
        let [u, v, w, x] = self.weights;
        u * a + v * b + w * c + x * d + self.offset
    }
}

/// Cells along an axis at most, numerical.
const MOST_CELLS: f32 = 200.0;

/// Tetrahedra by the cells of a grid that they reach.
struct Cells {
    origin: Vec3,
    edge_mm: f32,
    dims: IVec3,
    /// First tetrahedron of each cell in `tets`, and the end.
    first: Vec<u32>,
    tets: Vec<u32>,
}

impl Cells {
    fn of(mesh: &TetMesh) -> Self {
        let boxes = || mesh.tets.iter().map(|tet| Aabb::of_points(&tet.map(|n| mesh.positions[n as usize])));
        let sum: f32 = boxes().map(|b| b.size().max_element()).filter(|mm| mm.is_finite()).sum();
        let all = mesh.bounds();
        let mean_mm = sum / mesh.tets.len().max(1) as f32;
        let edge_mm = mean_mm.max(all.size().max_element() / MOST_CELLS).max(1e-3);
        let (origin, dims) = (all.min - edge_mm, (all.size() / edge_mm).ceil().as_ivec3() + 2);
        let mut cells = Self { origin, edge_mm, dims, first: Vec::new(), tets: Vec::new() };
        // Half a cell of room, for what lies just outside.
        let range = |b: Aabb| [cells.cell(b.min - 0.5 * edge_mm), cells.cell(b.max + 0.5 * edge_mm)];
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for (tet, [low, high]) in (0u32..).zip(boxes().map(range)) {
            for (z, y) in (low.z..=high.z).flat_map(|z| (low.y..=high.y).map(move |y| (z, y))) {
                pairs.extend((low.x..=high.x).map(|x| (cells.index(IVec3::new(x, y, z)) as u32, tet)));
            }
        }
        pairs.sort_unstable();
        let last = cells.dims.element_product() as u32;
        cells.first = (0..=last).map(|cell| pairs.partition_point(|pair| pair.0 < cell) as u32).collect();
        cells.tets = pairs.into_iter().map(|(_, tet)| tet).collect();
        cells
    }

    fn cell(&self, place: Vec3) -> IVec3 {
        ((place - self.origin) / self.edge_mm).floor().as_ivec3().clamp(IVec3::ZERO, self.dims - 1)
    }

    fn index(&self, cell: IVec3) -> usize {
        (cell.x + self.dims.x * (cell.y + self.dims.y * cell.z)) as usize
    }

    fn tets_at(&self, place: Vec3) -> &[u32] {
        let at = self.index(self.cell(place));
        &self.tets[self.first[at] as usize..self.first[at + 1] as usize]
    }
}

/// Weight of a corner beyond which a vertex is too far outside its tetrahedron, numerical.
const LEAST_WEIGHT: f32 = -2.0;

/// An embedding for each place, in a mesh at rest; what is too far from it keeps its way from the
/// nearest node.
pub(crate) fn embeddings(mesh: &TetMesh, places: &[Vec3]) -> Vec<Embedding> {
    use rayon::prelude::*;
    let cells = Cells::of(mesh);
    let weights_in: Vec<(Mat3, Vec3)> =
        mesh.tets.iter().map(|tet| inverse(tet.map(|n| mesh.positions[n as usize]))).collect();
    let embedding = |place: &Vec3| {
        let weights = |tet: u32| {
            let (inverse, corner) = weights_in[tet as usize];
            let w = inverse * (*place - corner);
            [1.0 - w.x - w.y - w.z, w.x, w.y, w.z]
        };
        let least = |w: &[f32; 4]| w.iter().copied().fold(f32::INFINITY, f32::min);
        let all = cells.tets_at(*place).iter().map(|tet| (*tet, weights(*tet)));
        let all = all.filter(|(_, weights)| weights.iter().all(|w| w.is_finite()));
        let best = all.max_by(|(_, a), (_, b)| least(a).total_cmp(&least(b)));
        match best.filter(|(_, weights)| least(weights) > LEAST_WEIGHT) {
            Some((tet, weights)) => Embedding { nodes: mesh.tets[tet as usize], weights, offset: Vec3::ZERO, tet },
            None => {
                let node = nearest(mesh, *place);
                Embedding { offset: *place - mesh.positions[node as usize], ..Embedding::node(node) }
            }
        }
    };
    places.par_iter().map(embedding).collect()
}

/// Maps a place, relative to the first corner, to the weights of the others; NaN when flat.
fn inverse([a, b, c, d]: [Vec3; 4]) -> (Mat3, Vec3) {
    (Mat3::from_cols(b - a, c - a, d - a).inverse(), a)
}

fn nearest(mesh: &TetMesh, place: Vec3) -> u32 {
    let squared = |n: &u32| mesh.positions[*n as usize].distance_squared(place);
    (0..mesh.positions.len() as u32).min_by(|a, b| squared(a).total_cmp(&squared(b))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A box of 6 tetrahedra for each cube of 5 mm.
    fn block() -> TetMesh {
        cubes([3, 2, 2])
    }

    fn cubes([nx, ny, nz]: [usize; 3]) -> TetMesh {
        let at = |i: usize, j: usize, k: usize| (i + (nx + 1) * (j + (ny + 1) * k)) as u32;
        let mut mesh = TetMesh { positions: Vec::new(), tets: Vec::new() };
        for (k, j, i) in (0..=nz).flat_map(|k| (0..=ny).flat_map(move |j| (0..=nx).map(move |i| (k, j, i)))) {
            mesh.positions.push(5.0 * Vec3::new(i as f32, j as f32, k as f32));
        }
        for (k, j, i) in (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| (k, j, i)))) {
            for [x, y] in [[0, 1], [1, 0], [1, 2], [2, 1], [2, 0], [0, 2]] {
                let mut corner = [0usize; 3];
                let mut tet = [at(i, j, k); 4];
                for (n, axis) in [x, y, 3 - x - y].into_iter().enumerate() {
                    corner[axis] = 1;
                    tet[n + 1] = at(i + corner[0], j + corner[1], k + corner[2]);
                }
                mesh.tets.push(tet);
            }
        }
        mesh
    }

    proptest! {
        #[test]
        fn a_linear_motion_moves_every_vertex_exactly(
            places in prop::collection::vec((-1.5f32..16.5, -1.5f32..11.5, -1.5f32..11.5), 30),
        ) {
            let mesh = block();
            let places: Vec<Vec3> = places.into_iter().map(Vec3::from).collect();
            let motion = |p: Vec3| Vec3::new(1.1 * p.x - 0.2 * p.z, p.y + 0.3 * p.x, 0.9 * p.z) + 2.0;
            let moved: Vec<Vec3> = mesh.positions.iter().map(|p| motion(*p)).collect();
            for (embedding, place) in embeddings(&mesh, &places).iter().zip(&places) {
                prop_assert!(embedding.place(&mesh.positions).distance(*place) < 1e-4);
                prop_assert!(embedding.place(&moved).distance(motion(*place)) < 1e-3);
            }
        }
    }

    #[test]
    fn what_is_far_outside_follows_the_nearest_node_and_no_mesh_gives_none_a_panic() {
        let mesh = block();
        let far = Vec3::new(90.0, 0.0, 0.0);
        assert_eq!(embeddings(&mesh, &[far]), [Embedding { offset: far - mesh.positions[3], ..Embedding::node(3) }]);
        let flat = TetMesh { positions: vec![Vec3::ZERO; 4], tets: vec![[0, 1, 2, 3]] };
        assert_eq!(embeddings(&flat, &[Vec3::X]), [Embedding { offset: Vec3::X, ..Embedding::node(0) }]);
    }
}
