//! What one collision step found.

use trepan_contact::{Contact, ContactManifold, NodalContact, NodalContacts, SurfacePatch};
use trepan_geometry::Vec3;

/// What one step found.
#[derive(Clone, Debug, PartialEq)]
pub struct TissueStep {
    /// The contact, as force models read it.
    pub manifold: ContactManifold,
    /// The tangent plane that the haptic tick holds on to until the next result.
    pub patch: SurfacePatch,
    /// The spring that presses on the tissue's nodes, equal and opposite; where there are
    /// `surface_springs`, the one that stands for all of them.
    pub nodal: NodalContact,
    /// Springs under the ball, one for each node, together as strong as `nodal`. Each presses along
    /// its own normal as deep as the ball is there, so that tissue finer than the ball takes its
    /// shape. Empty where the response has one spring for all.
    pub surface_springs: NodalContacts,
    /// Dry friction of the tissue on the tool's tip, N; the nodes take the opposite by the weights
    /// of `nodal`.
    pub friction_n: Vec3,
    /// The contact of the tool's shaft; depth 0 when it is free or not asked for.
    pub shaft: Contact,
    /// The spring with which the shaft presses on the tissue's nodes.
    pub shaft_nodal: NodalContact,
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
            friction_n: Vec3::ZERO,
            shaft: Contact::default(),
            shaft_nodal: NodalContact::none(),
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
        self.friction_n = Vec3::ZERO;
    }

    /// The springs of tip and shaft.
    fn all(&self) -> impl Iterator<Item = &NodalContact> {
        let tip =
            if self.surface_springs.is_empty() { core::slice::from_ref(&self.nodal) } else { &self.surface_springs };
        tip.iter().chain([&self.shaft_nodal])
    }

    /// Adds the springs of tip and shaft to a solver's list, and that of friction.
    pub fn springs(&self, out: &mut NodalContacts) {
        self.all().for_each(|spring| out.push(*spring));
        out.push(self.friction_spring());
    }

    /// The spring across the normal that holds the tissue to the tool: as stiff as the contact, and
    /// stretched by the slip. Nothing without friction.
    fn friction_spring(&self) -> NodalContact {
        let Some(normal) = self.friction_n.try_normalize() else { return NodalContact::none() };
        let mut spring = self.nodal;
        (spring.normal, spring.damping, spring.lateral_damping) = (normal, 0.0, 0.0);
        spring.offset_mm = self.patch.slip_mm.length() - self.manifold.point.dot(normal);
        spring
    }

    /// Adds all forces on the nodes, N: springs of tip and shaft, and friction. Returns the force
    /// on the tool, equal and opposite.
    pub fn push(&self, positions: &[Vec3], velocities: &[Vec3], forces: &mut [Vec3]) -> Vec3 {
        let mut on_tool = Vec3::ZERO;
        let mut press = |nodal: &NodalContact, force: Vec3| {
            nodal.nodes().for_each(|(node, weight)| forces[node as usize] -= weight * force);
            on_tool += force;
        };
        for spring in self.all() {
            let (place, velocity) = (spring.mean(|n| positions[n as usize]), spring.mean(|n| velocities[n as usize]));
            press(spring, spring.pressure_n(place, velocity) * spring.normal);
        }
        press(&self.nodal, self.friction_n);
        on_tool
    }
}
