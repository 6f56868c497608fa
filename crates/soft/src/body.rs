//! A body: tetrahedra, what they are made of, and which nodes do not move.

use crate::{Anchor, Material, MaterialError, Membrane, Shape};
use glam::DVec3;
use trepan_geometry::Vec3;
use trepan_mesh::{Csr, Split, TetMesh, Topology};

/// A deformable body in its rest state.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Rest positions, mm, and tetrahedra of positive volume.
    pub mesh: TetMesh,
    /// Nodes that do not move; order and repeats do not matter.
    pub fixed: Vec<u32>,
    /// What the body is made of, at most 256 materials; one that no tetrahedron has is allowed.
    pub materials: Vec<Material>,
    /// Which of `materials` each tetrahedron is of.
    pub material_of_tet: Vec<u8>,
    /// Springs to places at rest, at most one a node; the last one of a node counts.
    pub anchors: Vec<Anchor>,
    /// Membrane on the surface. [`trepan-tled`](https://docs.rs/trepan-tled) has it, other
    /// solvers have not.
    pub membrane: Membrane,
}

/// Why a body was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum BodyError {
    /// A material is not physical.
    #[error("materials[{index}]: {source}")]
    Material {
        /// Which one.
        index: usize,
        /// What is wrong with it.
        source: MaterialError,
    },
    /// Not one material index a tetrahedron.
    #[error("material_of_tet has {found} entries: it must have one for each of the {tets} tetrahedra")]
    MaterialCount {
        /// Entries.
        found: usize,
        /// Tetrahedra.
        tets: usize,
    },
    /// A tetrahedron names a material that does not exist.
    #[error("material_of_tet[{tet}] is {index}, but there are only {materials} materials")]
    MaterialRange {
        /// The tetrahedron.
        tet: usize,
        /// The material that it names.
        index: u8,
        /// Materials of the body.
        materials: usize,
    },
    /// There is nothing to simulate.
    #[error("mesh.tets is empty: a body needs at least one tetrahedron")]
    Empty,
    /// A tetrahedron names a node that does not exist.
    #[error("mesh.tets[{tet}] uses node {node}, but there are only {nodes} nodes")]
    NodeRange {
        /// The tetrahedron.
        tet: usize,
        /// The node that it names.
        node: u32,
        /// Nodes in the mesh.
        nodes: usize,
    },
    /// A node position is not a number.
    #[error("mesh.positions[{0}] is not finite")]
    Position(usize),
    /// A tetrahedron is flat or inside out.
    #[error(
        "mesh.tets[{tet}] has volume {volume_mm3:e} mm³: it must be positive (swap two of its nodes if it is inside out)"
    )]
    Volume {
        /// The tetrahedron.
        tet: usize,
        /// Its signed volume, mm³.
        volume_mm3: f64,
    },
    /// A node belongs to no tetrahedron, so it has no mass.
    #[error("mesh.positions[{0}] belongs to no tetrahedron: remove it")]
    Orphan(usize),
    /// A fixed node does not exist.
    #[error("fixed names node {node}, but there are only {nodes} nodes")]
    FixedRange {
        /// The node.
        node: u32,
        /// Nodes in the mesh.
        nodes: usize,
    },
    /// An anchor is on no node, or is not a spring.
    #[error(
        "anchors[{index}] is on node {node} of {nodes}: it needs a node of the mesh, finite numbers, none of them \
         negative, and `in_fluid` up to 1"
    )]
    Anchor {
        /// Which one.
        index: usize,
        /// The node that it names.
        node: u32,
        /// Nodes in the mesh.
        nodes: usize,
    },
    /// One of several parts of a held body is not held.
    #[error("nothing holds the part with mesh.tets[{0}]: fix or anchor a node of it, or drop the part")]
    Loose(usize),
    /// A membrane that is none, or not on the body's nodes.
    #[error(
        "membrane.triangles[{0}] is not right: it needs three nodes of the mesh that span an area, and the membrane a \
         finite stiffness that is not negative"
    )]
    Membrane(usize),
    /// A static solver was given a body that can float away.
    #[error(
        "fixed does not hold the part with mesh.tets[{0}]: it needs at least 3 nodes there that are not on one line"
    )]
    Floating(usize),
    /// A setting of the solver makes no sense.
    #[error("config.{field} is {value}: {right}")]
    Config {
        /// The setting.
        field: &'static str,
        /// What it was.
        value: f32,
        /// What would be right.
        right: &'static str,
    },
}

/// A tetrahedron as solvers need it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element {
    pub corners: [u32; 4],
    pub shape: Shape,
    /// Index of its material.
    pub material: u8,
}

impl BodyError {
    /// Refuses a setting that is not right, by its name, its value and what would be right.
    pub fn check_config(is_right: bool, field: &'static str, value: f32, right: &'static str) -> Result<(), Self> {
        if is_right { Ok(()) } else { Err(Self::Config { field, value, right }) }
    }
}

impl Body {
    /// A body of one material.
    pub fn uniform(mesh: TetMesh, fixed: Vec<u32>, material: Material) -> Self {
        let material_of_tet = vec![0; mesh.tets.len()];
        let (anchors, membrane) = (Vec::new(), Membrane::default());
        Self { material_of_tet, mesh, fixed, materials: vec![material], anchors, membrane }
    }

    /// Material of a tetrahedron.
    pub fn material(&self, tet: usize) -> &Material {
        &self.materials[usize::from(self.material_of_tet[tet])]
    }

    /// The same body of one material throughout.
    pub fn with_material(self, material: Material) -> Self {
        Self { anchors: self.anchors, membrane: self.membrane, ..Self::uniform(self.mesh, self.fixed, material) }
    }

    /// For each material the number of the first one with its bulk modulus, within 0.1 %. Averaged
    /// pressure is taken over the elements of one number around a node.
    pub fn bulk_groups(&self) -> Vec<u8> {
        let bulk: Vec<f64> = self.materials.iter().map(Material::bulk_mpa).collect();
        let first = |of: &f64| bulk.iter().position(|other| (of / other - 1.0).abs() < 1e-3).unwrap_or_default() as u8;
        bulk.iter().map(first).collect()
    }

    pub(crate) fn elements(&self) -> Vec<Element> {
        let of = |(t, &corners): (usize, &[u32; 4])| Element {
            corners,
            shape: self.shape(t),
            material: self.material_of_tet[t],
        };
        self.mesh.tets.iter().enumerate().map(of).collect()
    }

    /// Checks everything that a solver relies on.
    pub fn check(&self) -> Result<(), BodyError> {
        let (nodes, tets) = (self.mesh.positions.len(), &self.mesh.tets);
        if tets.is_empty() {
            return Err(BodyError::Empty);
        }
        self.check_materials()?;
        if let Some(bad) = self.mesh.positions.iter().position(|p| !p.is_finite()) {
            return Err(BodyError::Position(bad));
        }
        let mut used = vec![false; nodes];
        for (tet, corners) in tets.iter().enumerate() {
            for &node in corners {
                *used.get_mut(node as usize).ok_or(BodyError::NodeRange { tet, node, nodes })? = true;
            }
            let volume_mm3 = self.mesh.volume_mm3(tet);
            if volume_mm3.is_nan() || volume_mm3 <= 1e-9 {
                return Err(BodyError::Volume { tet, volume_mm3 });
            }
        }
        if let Some(orphan) = used.iter().position(|u| !u) {
            return Err(BodyError::Orphan(orphan));
        }
        let is_wrong = |anchor: &&Anchor| anchor.node as usize >= nodes || !anchor.is_sound();
        if let Some((index, anchor)) = self.anchors.iter().enumerate().find(|(_, anchor)| is_wrong(anchor)) {
            return Err(BodyError::Anchor { index, node: anchor.node, nodes });
        }
        let is_soft = (0.0..f32::INFINITY).contains(&self.membrane.shear_n_per_mm);
        let spans = |t: usize| self.membrane.shape(t, &self.mesh.positions).area_mm2 > 1e-9;
        let is_there = |corners: &[u32; 3]| corners.iter().all(|&n| (n as usize) < nodes);
        let mut triangles = self.membrane.triangles.iter().enumerate();
        if let Some((wrong, _)) = triangles.find(|(t, corners)| !(is_soft && is_there(corners) && spans(*t))) {
            return Err(BodyError::Membrane(wrong));
        }
        if let Some(&node) = self.fixed.iter().find(|&&n| n as usize >= nodes) {
            return Err(BodyError::FixedRange { node, nodes });
        }
        let mut held = self.fixed_mask();
        let pulling = self.anchors.iter().filter(|anchor| anchor.along.max(anchor.across) > 0.0);
        pulling.for_each(|anchor| held[anchor.node as usize] = true);
        let is_held = held.contains(&true);
        let loose = is_held.then(|| self.loose(held, |points| !points.is_empty())).flatten();
        loose.map_or(Ok(()), |tet| Err(BodyError::Loose(tet)))
    }

    /// The first tetrahedron of a part, connected by faces, of which `held` nodes are not enough.
    /// A part that is held holds others by the nodes that it shares with them.
    fn loose(&self, mut held: Vec<bool>, is_enough: impl Fn(&[DVec3]) -> bool) -> Option<usize> {
        let (part_of, parts) = Topology::of(&self.mesh).components();
        let tets_of = Csr::of_pairs(parts, part_of.iter().zip(0..).map(|(&part, tet)| (part, tet)));
        let mut open: Vec<usize> = (0..parts).collect();
        loop {
            let before = open.len();
            open.retain(|&part| {
                let nodes = || tets_of.row(part).iter().flat_map(|&tet| self.mesh.tets[tet as usize]);
                let held_here = nodes().filter(|&n| held[n as usize]);
                let points: Vec<_> = held_here.map(|n| self.mesh.positions[n as usize].as_dvec3()).collect();
                let is_loose = !is_enough(&points);
                nodes().for_each(|n| held[n as usize] |= !is_loose);
                is_loose
            });
            if open.len() == before {
                return open.first().map(|&part| tets_of.row(part)[0] as usize);
            }
        }
    }

    fn check_materials(&self) -> Result<(), BodyError> {
        for (index, material) in self.materials.iter().enumerate() {
            material.check().map_err(|source| BodyError::Material { index, source })?;
        }
        let (found, tets, materials) = (self.material_of_tet.len(), self.mesh.tets.len(), self.materials.len());
        if found != tets {
            return Err(BodyError::MaterialCount { found, tets });
        }
        match self.material_of_tet.iter().position(|&m| usize::from(m) >= materials) {
            Some(tet) => Err(BodyError::MaterialRange { tet, index: self.material_of_tet[tet], materials }),
            None => Ok(()),
        }
    }

    /// Splits nodes where faces are cut: copies of fixed nodes are fixed, an anchor is shared by
    /// the volume around each copy. `None`, and no change, where a split does not fit the mesh.
    ///
    /// Of each part that nothing holds any more one node is tied to its place by a spring that is
    /// too soft to be felt, 1e-6 N/mm: so the body passes its [check](Self::check), and the part is
    /// free.
    pub fn split(&mut self, splits: &[Split]) -> Option<()> {
        let mut mesh = self.mesh.clone();
        mesh.split(splits)?;
        split_triangles(&self.mesh, splits, &mut self.membrane.triangles);
        self.mesh = mesh;
        let mut copies: Vec<[u32; 2]> = splits.iter().map(|split| [split.from, split.node]).collect();
        copies.dedup();
        let around = self.lumped_masses_scaled_g(|tet| 1.0 / f64::from(self.material(tet).density_g_mm3()));
        for [from, node] in copies {
            let held = self.fixed.contains(&from).then_some(node);
            self.fixed.extend(held);
            let [own, other] = [from, node].map(|n| around[n as usize]);
            let Some(anchor) = self.anchors.iter_mut().rfind(|anchor| anchor.node == from) else { continue };
            let of = |share: f64, node| {
                let [along, across, open_mm2] =
                    [anchor.along, anchor.across, anchor.open_mm2].map(|whole| whole * share as f32);
                Anchor { node, along, across, open_mm2, ..*anchor }
            };
            let (kept, given) = (of(own / (own + other), from), of(other / (own + other), node));
            *anchor = kept;
            self.anchors.push(given);
        }
        while let Err(BodyError::Loose(tet)) = self.check() {
            let node = self.mesh.tets[tet][0];
            match self.anchors.iter_mut().rfind(|anchor| anchor.node == node) {
                Some(anchor) => (anchor.along, anchor.across) = (TIE, TIE),
                None => {
                    self.anchors.push(Anchor { node, normal: Vec3::Z, along: TIE, across: TIE, ..Anchor::default() });
                }
            }
        }
        Some(())
    }

    /// Rest shape of a tetrahedron, f64.
    pub fn shape(&self, tet: usize) -> Shape {
        Shape::of(self.mesh.corners(tet).map(Vec3::as_dvec3))
    }

    /// Mass of every node, g: a quarter of each of its tetrahedra.
    pub fn lumped_masses_g(&self) -> Vec<f64> {
        self.lumped_masses_scaled_g(|_| 1.0)
    }

    /// The same with a factor on the density of every tetrahedron.
    pub fn lumped_masses_scaled_g(&self, factor: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut masses = vec![0.0; self.mesh.positions.len()];
        for (tet, corners) in self.mesh.tets.iter().enumerate() {
            let density = f64::from(self.material(tet).density_g_mm3());
            let quarter = density * self.mesh.volume_mm3(tet) / 4.0 * factor(tet);
            corners.iter().for_each(|&n| masses[n as usize] += quarter);
        }
        masses
    }

    /// Whether each node is fixed.
    pub fn fixed_mask(&self) -> Vec<bool> {
        let mut mask = vec![false; self.mesh.positions.len()];
        self.fixed.iter().for_each(|&n| mask[n as usize] = true);
        mask
    }

    /// Whether the fixed nodes hold every part of the body: three of them span a plane.
    pub fn is_supported(&self) -> bool {
        self.unsupported().is_none()
    }

    /// A tetrahedron of the first part that the fixed nodes do not hold.
    pub fn unsupported(&self) -> Option<usize> {
        self.loose(self.fixed_mask(), span_a_plane)
    }
}

/// Lets triangles on faces of a mesh's tetrahedra, as it was before the splits, follow those.
pub fn split_triangles(mesh: &TetMesh, splits: &[Split], triangles: &mut [[u32; 3]]) {
    let mut tets = mesh.tets.clone();
    for split in splits {
        let (tet, corner) = split.place();
        let Some(corners) = tets.get_mut(tet) else { continue };
        let on_it = triangles.iter_mut().filter(|t| t.iter().all(|n| corners.contains(n)));
        on_it.flatten().filter(|n| **n == split.from).for_each(|n| *n = split.node);
        corners[corner] = split.node;
    }
}

/// Spring that ties a loose part, N/mm; numerical.
const TIE: f32 = 1e-6;

fn span_a_plane(points: &[DVec3]) -> bool {
    let Some(&origin) = points.first() else { return false };
    let furthest = |measure: &dyn Fn(DVec3) -> f64| {
        points.iter().max_by(|a, b| measure(**a).total_cmp(&measure(**b))).map(|&p| (p, measure(p)))
    };
    let Some((far, length)) = furthest(&|p| (p - origin).length()) else { return false };
    let axis = (far - origin).normalize_or_zero();
    furthest(&|p| (p - origin).cross(axis).length()).is_some_and(|(_, width)| width > 1e-3 * length && length > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boxes;

    fn cube() -> Body {
        let mesh = boxes::split_box([2, 2, 2], Vec3::splat(10.0));
        let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
        Body::uniform(mesh, fixed, Material::BRAIN)
    }

    #[test]
    fn masses_add_up_to_density_times_volume() {
        let total: f64 = cube().lumped_masses_g().iter().sum();
        assert!((total - 1.0).abs() < 1e-6);
        let mut half = cube();
        let dense = Material::NeoHookean { young_mpa: 0.003, poisson: 0.45, density_g_mm3: 3e-3 };
        half.materials.push(dense);
        half.material_of_tet.iter_mut().step_by(2).for_each(|m| *m = 1);
        let total: f64 = half.lumped_masses_g().iter().sum();
        assert!((total - 2.0).abs() < 1e-6, "{total}");
    }

    #[test]
    fn each_fault_is_named() {
        assert_eq!(cube().check(), Ok(()));
        let broken = |change: fn(&mut Body)| {
            let mut body = cube();
            change(&mut body);
            body.check().unwrap_err()
        };
        assert!(matches!(broken(|b| b.mesh.tets.clear()), BodyError::Empty));
        assert!(matches!(broken(|b| b.mesh.tets[3].swap(0, 1)), BodyError::Volume { tet: 3, .. }));
        assert!(matches!(broken(|b| b.mesh.tets[2][1] = 99), BodyError::NodeRange { tet: 2, node: 99, .. }));
        assert!(matches!(broken(|b| b.mesh.positions[4].y = f32::NAN), BodyError::Position(4)));
        assert!(matches!(broken(|b| b.mesh.positions.push(Vec3::ZERO)), BodyError::Orphan(27)));
        assert!(matches!(broken(|b| b.fixed.push(27)), BodyError::FixedRange { node: 27, .. }));
        let anchor = Anchor { node: 27, ..Anchor::default() };
        let fault = Body { anchors: vec![Anchor::default(), anchor], ..cube() }.check();
        assert!(matches!(fault, Err(BodyError::Anchor { index: 1, node: 27, nodes: 27 })));
        let fault = Body { anchors: vec![Anchor { along: -1.0, ..Anchor::default() }], ..cube() }.check();
        assert!(matches!(fault, Err(BodyError::Anchor { index: 0, .. })));
        for (triangle, shear_n_per_mm) in
            [([0, 1, 27], 0.1), ([0, 1, 1], 0.1), ([0, 1, 4], -0.1), ([0, 1, 4], f32::NAN)]
        {
            let membrane = Membrane { triangles: vec![triangle], shear_n_per_mm };
            assert_eq!(Body { membrane, ..cube() }.check(), Err(BodyError::Membrane(0)));
        }
        assert!(matches!(broken(|b| _ = b.material_of_tet.pop()), BodyError::MaterialCount { found: 47, tets: 48 }));
        assert!(matches!(broken(|b| b.material_of_tet[5] = 1), BodyError::MaterialRange { tet: 5, index: 1, .. }));
        assert!(matches!(broken(|b| b.materials.clear()), BodyError::MaterialRange { tet: 0, materials: 0, .. }));
        let bad = Material::NeoHookean { young_mpa: -1.0, poisson: 0.3, density_g_mm3: 1e-3 };
        let body = Body { materials: vec![Material::BRAIN, bad], ..cube() };
        assert!(body.check().unwrap_err().to_string().starts_with("materials[1]: young_mpa"));
    }

    #[test]
    fn a_body_that_is_cut_through_keeps_what_its_nodes_were_and_ties_what_is_loose() {
        let mut body = cube();
        body.membrane.triangles = trepan_mesh::Surface::of(&body.mesh).triangles;
        body.anchors = vec![Anchor { node: 13, along: 2.0, ..Anchor::default() }];
        let (mut splitter, mut splits) = (trepan_mesh::Splitter::of(&body.mesh), Vec::with_capacity(200));
        let is_low = |tet: usize| body.mesh.corners(tet).iter().all(|p| p.z <= 5.0);
        for (tet, face) in (0..48u32).flat_map(|tet| (0..4).map(move |face| (tet, face))) {
            let next = splitter.neighbours(tet)[face];
            if next != trepan_mesh::NONE && is_low(tet as usize) != is_low(next as usize) {
                splitter.cut(tet, face, |_| false, &mut splits);
            }
        }
        let mut cut = body.clone();
        cut.split(&splits).unwrap();
        assert_eq!((cut.check(), cut.mesh.positions.len()), (Ok(()), 27 + 9));
        let ends = |triangle: &[u32; 3]| trepan_mesh::Surface::of(&cut.mesh).triangles.contains(triangle);
        assert!(cut.membrane.triangles.iter().all(ends), "the membrane is cut too");
        let [given, copied] = [0, 1].map(|n| cut.anchors[n]);
        assert!(given.along > 0.0 && copied.along > 0.0 && copied.node >= 27 && cut.anchors.len() == 2);
        assert!((given.along + copied.along - 2.0).abs() < 1e-6, "{given:?} {copied:?}");
        let mut loose = Body { anchors: Vec::new(), ..body.clone() };
        loose.split(&splits).unwrap();
        assert!(loose.check() == Ok(()) && loose.anchors.len() == 1 && loose.anchors[0].along == TIE);
        assert!(cut.clone().split(&[Split { corner: 0, from: 0, node: 99 }]).is_none());
        let total: f64 = cut.lumped_masses_g().iter().sum();
        assert!((total - 1.0).abs() < 1e-6);
    }

    #[test]
    fn nodes_on_one_line_do_not_hold_a_body() {
        let mut body = cube();
        assert!(body.is_supported());
        body.fixed = boxes::nodes_where(&body.mesh, |p| p.z < 1e-3 && p.y < 1e-3);
        assert!(!body.is_supported());
        body.fixed.clear();
        assert!(!body.is_supported());
    }

    #[test]
    fn every_part_must_be_held() {
        // Two tetrahedra that share `shared` nodes, the second above the first.
        let two = |shared: u32, fixed: &[u32]| {
            let mut positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
            let above = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].into_iter().skip(shared as usize);
            positions.extend(above.map(|p| p + Vec3::Z));
            let tets = vec![[0, 1, 2, 3], [4, 5, 6, 7].map(|n| n - shared)];
            Body::uniform(TetMesh { positions, tets }, fixed.to_vec(), Material::BRAIN)
        };
        let verdict = |body: &Body| (body.check(), body.unsupported());
        assert_eq!(verdict(&two(0, &[0, 1, 2])), (Err(BodyError::Loose(1)), Some(1)));
        assert_eq!(verdict(&two(0, &[0, 1, 2, 4, 5, 6])), (Ok(()), None));
        assert_eq!(verdict(&two(0, &[])), (Ok(()), Some(0)), "a free body");
        assert_eq!(verdict(&two(1, &[0, 1, 2])), (Ok(()), Some(1)), "it hangs on one node, and can turn");
        let anchor = |along| vec![Anchor { node: 4, along, ..Anchor::default() }];
        assert_eq!(Body { anchors: anchor(1.0), ..two(0, &[0, 1, 2]) }.check(), Ok(()));
        assert_eq!(Body { anchors: anchor(0.0), ..two(0, &[0, 1, 2]) }.check(), Err(BodyError::Loose(1)));
    }
}
