//! Fill of each tetrahedron: the share of its rest volume V that resection has left.
//!
//! # Theory
//! With the fill φ an element has stiffness, weight and averaged volume of `φ V`, and its stress
//! memory shrinks with it. The inertia of the full element stays on its nodes: no ω² grows, so the
//! step that was stable at rest remains so. Equilibria are those of the body without what was
//! taken; motion at the wound is a little slower. Averaged pressure hides opposite volume changes
//! at a node, and taking one of the elements releases the other: so a fill falls over
//! [`RAMP_STEPS`] steps.
//!
//! An empty element has no gradients: F = 1, and it is never inverted. A node without elements
//! stops where it is.
//!
//! # Practice
//! Sums over the elements around a node are taken anew, in the order of the mesh: what a solver
//! computes depends on the present fills, not on the order in which they fell.
//!
//! # Sources
//! Fill as the density of a cut element: finite cell method, Parvizian, Düster and Rank, Comput.
//! Mech. 41, 2007.

use crate::node_groups::NodeGroups;
use trepan_mesh::Csr;
use trepan_soft::Body;
use trepan_soft::simd::Layout;

/// Fill of a whole tetrahedron.
pub const FULL: u16 = u16::MAX;
/// Steps over which a whole tetrahedron is emptied.
pub const RAMP_STEPS: u16 = 10;

/// Fills of the tetrahedra, and where each lies in the solver.
pub(crate) struct Fills {
    /// Present fill by tetrahedron.
    pub now: Vec<u16>,
    goal: Vec<u16>,
    /// Tetrahedra whose fill is above its goal.
    pub falling: Vec<u32>,
    /// By tetrahedron: its part, and its index there.
    pub indices: Vec<PartIndex>,
    /// Tetrahedron below each triangle of the membrane, ascending; the triangle, and where it is.
    sheets: Vec<(u32, u32, PartIndex)>,
    tets_of_node: Csr,
    /// A quarter of each tetrahedron's rest volume, mm³, and of its mass, g.
    quarters: Vec<[f64; 2]>,
    pub node_groups: NodeGroups,
}

/// An element's part, and its index there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct PartIndex {
    pub part: u32,
    pub index: u32,
}

/// Change of an element's fill.
#[derive(Clone, Copy)]
pub(crate) struct Filling {
    /// Share of the rest volume, 0 to 1.
    pub share: f64,
    /// The same over that before.
    pub kept: f32,
}

impl Fills {
    /// Whole tetrahedra; `tets_of` and `sheets` name the elements of the parts in order.
    pub fn full(body: &Body, tets_of: &[&[u32]], sheets: &[Vec<u32>], node_groups: NodeGroups) -> Self {
        let tets = &body.mesh.tets;
        let pairs = (0..tets.len()).flat_map(|t| tets[t].map(|n| (n, t as u32)));
        let tets_of_node = Csr::of_pairs(body.mesh.positions.len(), pairs);
        let mut indices = vec![PartIndex::default(); tets.len()];
        for (part, of_part) in tets_of.iter().enumerate() {
            let index_of = |index: usize| PartIndex { part: part as u32, index: index as u32 };
            of_part.iter().enumerate().for_each(|(index, &t)| indices[t as usize] = index_of(index));
        }
        let below = |triangle: u32| {
            let [a, b, c] = body.membrane.triangles[triangle as usize];
            let has = |t: &&u32| [b, c].iter().all(|n| tets[**t as usize].contains(n));
            tets_of_node.row(a as usize).iter().find(has).copied()
        };
        let of_sheet = |(part, sheet): (usize, &Vec<u32>)| {
            let part = (tets_of.len() + part) as u32;
            let index_of = move |index: usize| PartIndex { part, index: index as u32 };
            let all = sheet.iter().enumerate().map(|(index, &t)| Some((below(t)?, t, index_of(index))));
            all.flatten().collect::<Vec<_>>()
        };
        let mut sheets: Vec<_> = sheets.iter().enumerate().flat_map(of_sheet).collect();
        sheets.sort_unstable();
        let quarter = |t: usize| {
            let mm3 = 0.25 * body.mesh.volume_mm3(t);
            [mm3, mm3 * f64::from(body.material(t).density_g_mm3())]
        };
        let quarters = (0..tets.len()).map(quarter).collect();
        let (now, goal) = (vec![FULL; tets.len()], vec![FULL; tets.len()]);
        Self {
            now,
            goal,
            falling: Vec::with_capacity(tets.len()),
            indices,
            sheets,
            tets_of_node,
            quarters,
            node_groups,
        }
    }

    /// Lowers the goal of a tetrahedron; a higher one changes nothing.
    pub fn lower(&mut self, tet: u32, fill: u16) {
        let Some(&goal) = self.goal.get(tet as usize).filter(|&&goal| fill < goal) else { return };
        if self.now[tet as usize] == goal {
            self.falling.push(tet);
        }
        self.goal[tet as usize] = fill;
    }

    /// Lets the fill of a tetrahedron fall by a step.
    pub fn fall(&mut self, tet: u32) -> Filling {
        let (now, goal) = (&mut self.now[tet as usize], self.goal[tet as usize]);
        let before = *now;
        *now = goal.max(before.saturating_sub(FULL.div_ceil(RAMP_STEPS)));
        Filling { share: share(*now), kept: f32::from(*now) / f32::from(before) }
    }

    /// Whether the fill of a tetrahedron is still above its goal.
    pub fn is_falling(&self, tet: u32) -> bool {
        self.now[tet as usize] > self.goal[tet as usize]
    }

    /// The membrane's triangles on a tetrahedron, with their indices.
    pub fn triangles_on(&self, tet: u32) -> impl Iterator<Item = (u32, PartIndex)> {
        let first = self.sheets.partition_point(|(on, ..)| *on < tet);
        self.sheets[first..]
            .iter()
            .take_while(move |(on, ..)| *on == tet)
            .map(|&(_, triangle, index)| (triangle, index))
    }

    /// Whether anything is left around a mesh node.
    pub fn is_left(&self, node: u32) -> bool {
        self.tets_of_node.row(node as usize).iter().any(|&t| self.now[t as usize] > 0)
    }

    /// Mass with weight of a mesh node, g; `None` where nothing is left around it.
    pub fn grams(&self, node: u32) -> Option<f64> {
        let around = self.tets_of_node.row(node as usize);
        let quarter = |&t: &u32| self.quarters[t as usize][1] * share(self.now[t as usize]);
        self.is_left(node).then(|| around.iter().map(quarter).sum())
    }

    /// Node groups of a mesh node with their volumes, mm³.
    pub fn volumes<'a>(
        &'a self,
        body: &'a Body,
        layout: &Layout,
        node: u32,
    ) -> impl Iterator<Item = (usize, f64)> + use<'a> {
        let around = self.tets_of_node.row(node as usize);
        let quarter = |t: u32| self.quarters[t as usize][0] * share(self.now[t as usize]);
        self.node_groups.all_at(layout.place_of[node as usize]).map(move |group| {
            let own = around.iter().filter(move |&&t| self.node_groups.has(group, body, t));
            (group, own.map(move |&t| quarter(t)).sum())
        })
    }
}

/// A fill as a share of the whole.
fn share(fill: u16) -> f64 {
    f64::from(fill) / f64::from(FULL)
}
