//! Linear and quadratic tetrahedra by their integration points.
//!
//! # Theory
//! With barycentric coordinates L the quadratic tetrahedron has the shape functions
//! `L_i (2 L_i - 1)` at its corners and `4 L_i L_j` in the middle of its edges; edges are straight
//! at rest. Walkington's 14 points integrate its energy (degree 5; fewer would soften nearly
//! incompressible tissue by half a percent). Its weight acts consistently, -1/20 at a corner and
//! 1/5 at an edge; its mass is lumped in proportion to the diagonal of the consistent matrix
//! (Hinton, Rock and Zienkiewicz 1976): 1/36 and 4/27.

use crate::{Body, Shape};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

/// Corners of the six edges, in the order of the nodes in their middle.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Walkington's rule of 14 points: (coordinate, share of the volume) of four points near corners,
/// twice, and of six near edges.
const CORNERS: [(f64, f64); 2] =
    [(0.310_885_919_263_300_6, 0.112_687_925_718_015_85), (0.092_735_250_310_891_22, 0.073_493_043_116_361_95)];
const EDGE: f64 = 0.045_503_704_125_649_65;
const EDGE_WEIGHT: f64 = 0.042_546_020_777_081_466;

/// Degree of the shape functions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// 4-node tetrahedra, as the fast solvers have them: the truth of the same mesh.
    #[default]
    Linear,
    /// 10-node tetrahedra: near the truth of the continuum, and free of locking.
    Quadratic,
}

/// The cells of a body and all its nodes, those of the mesh first.
pub(super) struct Cells {
    pub cells: Vec<Cell>,
    /// Rest positions, mm.
    pub rest: Vec<DVec3>,
    pub fixed: Vec<bool>,
    /// Mass of every node, g.
    pub masses: Vec<f64>,
    /// Mass of every node as weight sees it, g.
    pub weights: Vec<f64>,
    /// Ends of the edge that each node after those of the mesh lies on.
    pub ends: Vec<[u32; 2]>,
}

/// One tetrahedron.
pub(super) struct Cell {
    pub nodes: Vec<u32>,
    pub points: Vec<Point>,
    /// Index of its material.
    pub material: usize,
}

/// An integration point.
pub(super) struct Point {
    /// Rest volume that it stands for, mm³.
    pub volume_mm3: f64,
    /// Gradients of the shape functions, 1/mm.
    pub gradients: Vec<DVec3>,
}

impl Cells {
    pub fn of(body: &Body, order: Order) -> Self {
        let mut all = Self {
            cells: Vec::with_capacity(body.mesh.tets.len()),
            rest: body.mesh.positions.iter().map(|p| p.as_dvec3()).collect(),
            fixed: body.fixed_mask(),
            masses: Vec::new(),
            weights: Vec::new(),
            ends: Vec::new(),
        };
        let mut middles = BTreeMap::new();
        for (t, corners) in body.mesh.tets.iter().enumerate() {
            let (shape, mut nodes) = (body.shape(t), corners.to_vec());
            if order == Order::Quadratic {
                nodes.extend(EDGES.map(|[i, j]| all.middle(&mut middles, corners[i], corners[j])));
            }
            all.cells.push(Cell { nodes, points: points(&shape, order), material: body.material_of_tet[t].into() });
        }
        all.weigh(body, order);
        all
    }

    /// The node in the middle of an edge; fixed where both ends are.
    fn middle(&mut self, middles: &mut BTreeMap<[u32; 2], u32>, a: u32, b: u32) -> u32 {
        *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
            let (i, j) = (a as usize, b as usize);
            self.rest.push((self.rest[i] + self.rest[j]) * 0.5);
            self.fixed.push(self.fixed[i] && self.fixed[j]);
            self.ends.push([a, b]);
            self.rest.len() as u32 - 1
        })
    }

    fn weigh(&mut self, body: &Body, order: Order) {
        let ([corner_mass, edge_mass], [corner_weight, edge_weight]) = match order {
            Order::Linear => ([0.25, 0.0], [0.25, 0.0]),
            Order::Quadratic => ([1.0 / 36.0, 4.0 / 27.0], [-0.05, 0.2]),
        };
        (self.masses, self.weights) = (vec![0.0; self.rest.len()], vec![0.0; self.rest.len()]);
        for (t, cell) in self.cells.iter().enumerate() {
            let mass = f64::from(body.material(t).density_g_mm3()) * body.mesh.volume_mm3(t);
            for (a, &n) in cell.nodes.iter().enumerate() {
                let (m, w) = if a < 4 { (corner_mass, corner_weight) } else { (edge_mass, edge_weight) };
                self.masses[n as usize] += m * mass;
                self.weights[n as usize] += w * mass;
            }
        }
    }
}

impl Cell {
    /// F at a point, from the displacements of all nodes.
    pub fn deformation(&self, point: &Point, u: &[DVec3]) -> DMat3 {
        let add = |f: DMat3, (&n, g): (&u32, &DVec3)| {
            let u = u[n as usize];
            f + DMat3::from_cols(u * g.x, u * g.y, u * g.z)
        };
        self.nodes.iter().zip(&point.gradients).fold(DMat3::IDENTITY, add)
    }
}

fn points(shape: &Shape, order: Order) -> Vec<Point> {
    if order == Order::Linear {
        return vec![Point { volume_mm3: shape.volume_mm3, gradients: shape.gradients.to_vec() }];
    }
    let corner = |k: usize, a: f64| std::array::from_fn(|i| if i == k { 1.0 - 3.0 * a } else { a });
    let edge = |[j, k]: [usize; 2]| std::array::from_fn(|i| if i == j || i == k { EDGE } else { 0.5 - EDGE });
    let near = CORNERS.iter().flat_map(|&(a, weight)| (0..4).map(move |k| (corner(k, a), weight)));
    let all = near.chain(EDGES.map(|e| (edge(e), EDGE_WEIGHT)));
    let at = |(l, weight): ([f64; 4], f64)| {
        let corners = (0..4).map(|i| shape.gradients[i] * (4.0 * l[i] - 1.0));
        let edges = EDGES.iter().map(|&[i, j]| (shape.gradients[i] * l[j] + shape.gradients[j] * l[i]) * 4.0);
        Point { volume_mm3: weight * shape.volume_mm3, gradients: corners.chain(edges).collect() }
    };
    all.map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Material, boxes};
    use trepan_geometry::Vec3;

    #[test]
    fn quadratic_cells_weigh_what_the_body_weighs_and_take_a_quadratic_field_exactly() {
        let mesh = boxes::split_box([2, 1, 2], Vec3::new(6.0, 4.0, 5.0));
        let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
        let cells = Cells::of(&Body::uniform(mesh, fixed, Material::BRAIN), Order::Quadratic);
        for share in [&cells.masses, &cells.weights] {
            assert!((share.iter().sum::<f64>() - 0.12).abs() < 1e-7);
        }
        assert!(cells.masses.iter().all(|m| *m > 0.0));
        assert!(cells.rest.iter().zip(&cells.fixed).all(|(x, fixed)| (x.z < 1e-3) == *fixed));
        // u = (x², yz, 0): its gradient has the mean 2x̄ and so on over each cell.
        let u: Vec<DVec3> = cells.rest.iter().map(|x| DVec3::new(x.x * x.x, x.y * x.z, 0.0)).collect();
        let mut total = DMat3::ZERO;
        for cell in &cells.cells {
            for point in &cell.points {
                total += (cell.deformation(point, &u) - DMat3::IDENTITY) * point.volume_mm3;
            }
        }
        let exact = DMat3::from_cols(DVec3::X * 6.0, DVec3::Y * 2.5, DVec3::Y * 2.0) * 120.0;
        assert!((total - exact).to_cols_array().iter().all(|e| e.abs() < 1e-3), "{total}");
    }
}
