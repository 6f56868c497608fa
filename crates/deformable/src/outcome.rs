//! What one collision step found.

use trepan_contact::{ContactManifold, NodalContact, NodalContacts, SurfacePatch};
use trepan_geometry::Vec3;

/// What one step found.
#[derive(Clone, Debug, PartialEq)]
pub struct TissueStep {
    /// How deep the tip's ball is in the tissue, and along which normal; at rest little more than
    /// nothing, since the tissue gives way.
    pub manifold: ContactManifold,
    /// Force of all that presses, which the haptic tick holds on to until the next result.
    pub patch: SurfacePatch,
    /// The spring that presses on the tissue's nodes, equal and opposite; where there are
    /// `surface_springs`, those count.
    pub nodal: NodalContact,
    /// Springs near the tool, one for each node, with friction, along the force of the tool on it;
    /// those around the contact wait. Empty where the response has one spring for all.
    pub surface_springs: NodalContacts,
    /// Tool points inside the tissue.
    pub points_in_contact: u32,
    /// Exact tests of a point in a tetrahedron.
    pub tests: u32,
    /// Candidates, triangles or nodes that did not fit their limits.
    pub overflow: u32,
    /// Inverted, flat or non-finite tetrahedra met and skipped; all of them, when the step was
    /// refused for lack of sound input.
    pub skipped: u32,
    /// Boxes of far surface that moved further than was allowed for; a contact there could be some
    /// steps late. 0 unless the tissue leaps.
    pub stale: u32,
}

impl Default for TissueStep {
    /// No contact, and room for every spring.
    fn default() -> Self {
        Self {
            manifold: ContactManifold::default(),
            patch: SurfacePatch::default(),
            nodal: NodalContact::none(),
            surface_springs: NodalContacts::with_room(),
            points_in_contact: 0,
            tests: 0,
            overflow: 0,
            skipped: 0,
            stale: 0,
        }
    }
}

impl TissueStep {
    /// Back to no contact; counters and springs that wait are kept.
    pub(crate) fn forget_contact(&mut self) {
        self.manifold.clear();
        self.patch = SurfacePatch { time_ms: self.patch.time_ms, tip_mm: self.patch.tip_mm, ..SurfacePatch::default() };
        self.nodal = NodalContact::none();
    }

    /// The springs that press.
    fn all(&self) -> &[NodalContact] {
        if self.surface_springs.is_empty() { core::slice::from_ref(&self.nodal) } else { &self.surface_springs }
    }

    /// Adds the springs to a solver's list.
    pub fn springs(&self, out: &mut NodalContacts) {
        self.all().iter().for_each(|spring| out.push(*spring));
    }

    /// Adds all forces on the nodes, N. Returns the force on the tool, equal and opposite.
    pub fn push(&self, positions: &[Vec3], velocities: &[Vec3], forces: &mut [Vec3]) -> Vec3 {
        let mut on_tool = Vec3::ZERO;
        for spring in self.all() {
            let (place, velocity) = (spring.mean(|n| positions[n as usize]), spring.mean(|n| velocities[n as usize]));
            let force = spring.pressure_n(place, velocity) * spring.normal;
            spring.nodes().for_each(|(node, weight)| forces[node as usize] -= weight * force);
            on_tool += force;
        }
        on_tool
    }
}
