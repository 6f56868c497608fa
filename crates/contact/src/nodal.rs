//! How a tool presses on tissue nodes: one spring between the tool and a weighted mean of nodes.
//!
//! # Theory
//! The contact acts on the point `x̄ = Σ wᵢ xᵢ` of the moving tissue. Its depth is
//! `d = offset + x̄·n`, so that tissue which gives way along `-n` relieves the spring by itself, at
//! every solver step, with the solver's own positions: a late collision result cannot pump energy
//! into the mesh as a held force would. The force on node i is `-wᵢ k d n`, d > 0 only.
//!
//! ```text
//!      tool  ↓ -n
//!   ────\___/────   surface, x̄ under the tool
//! ```
//!
//! # Practice
//! Explicit solvers take it implicitly, at any stiffness; `linear` and `mass-spring` whole, at the
//! cost of their stability. Weights may have signs: +1 on a node and -wⱼ on the triangle that it
//! went through make a spring between two parts of the tissue.

use trepan_geometry::Vec3;

/// Most nodes that one tool presses on; the rest is counted in [`NodalContact::overflow`].
pub const MAX_NODES: usize = 64;

/// A unilateral spring on a weighted set of nodes. Plain data, about 600 bytes, copied whole
/// between threads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodalContact {
    /// Unit vector out of the tissue, towards the tool.
    pub normal: Vec3,
    /// `d = offset_mm + x̄·normal` is the depth, mm.
    pub offset_mm: f32,
    /// Spring stiffness k, N/mm.
    pub stiffness: f32,
    /// Damping b against the relative normal velocity, N ms/mm.
    pub damping: f32,
    /// Normal velocity of the tool, mm/ms, along `normal`.
    pub tool_normal_velocity: f32,
    /// Damping across the normal while it presses, N ms/mm, by weight on each node for itself.
    pub lateral_damping: f32,
    /// Velocity to which that damping brings the nodes, mm/ms; only what lies across the normal
    /// counts.
    pub lateral_velocity: Vec3,
    /// Nodes that did not fit (their weight is lost; the rest is normalised).
    pub overflow: u32,
    count: u32,
    nodes: [u32; MAX_NODES],
    weights: [f32; MAX_NODES],
}

impl Default for NodalContact {
    fn default() -> Self {
        Self {
            normal: Vec3::ZERO,
            offset_mm: 0.0,
            stiffness: 0.0,
            damping: 0.0,
            tool_normal_velocity: 0.0,
            lateral_damping: 0.0,
            lateral_velocity: Vec3::ZERO,
            overflow: 0,
            count: 0,
            nodes: [0; MAX_NODES],
            weights: [0.0; MAX_NODES],
        }
    }
}

impl NodalContact {
    /// No contact: exerts no force.
    pub fn none() -> Self {
        Self::default()
    }

    /// Adds `weight` to `node`, merging with what is there; counts a node that does not fit.
    pub fn add(&mut self, node: u32, weight: f32) {
        let used = self.count as usize;
        if let Some(i) = self.nodes[..used].iter().position(|&n| n == node) {
            self.weights[i] += weight;
        } else if used < MAX_NODES {
            (self.nodes[used], self.weights[used]) = (node, weight);
            self.count += 1;
        } else {
            self.overflow += 1;
        }
    }

    /// Scales the weights to sum 1. Without any weight the contact becomes empty.
    pub fn normalise(&mut self) {
        let used = self.count as usize;
        let sum: f32 = self.weights[..used].iter().sum();
        if sum > f32::MIN_POSITIVE && sum.is_finite() {
            self.weights[..used].iter_mut().for_each(|w| *w /= sum);
        } else {
            self.count = 0;
        }
    }

    /// Gives each node another weight, by its number and the weight that it has.
    pub fn reweight(&mut self, mut weight_of: impl FnMut(u32, f32) -> f32) {
        let used = self.count as usize;
        let pairs = self.nodes[..used].iter().zip(&mut self.weights[..used]);
        pairs.for_each(|(&node, weight)| *weight = weight_of(node, *weight));
    }

    /// The nodes and their weights.
    pub fn nodes(&self) -> impl Iterator<Item = (u32, f32)> + '_ {
        let used = self.count as usize;
        self.nodes[..used].iter().copied().zip(self.weights[..used].iter().copied())
    }

    /// Whether no node is pressed.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The weighted mean x̄ of the nodes, mm (or their mean velocity, when given velocities).
    pub fn mean(&self, of: impl Fn(u32) -> Vec3) -> Vec3 {
        self.nodes().map(|(node, weight)| weight * of(node)).sum()
    }

    /// Force along `-normal` that the tool exerts on the tissue, N, never negative (it pushes, it
    /// never pulls).
    ///
    /// `mean_position` and `mean_velocity` are [`mean`](Self::mean) of the solver's present nodes,
    /// mm and mm/ms.
    pub fn pressure_n(&self, mean_position: Vec3, mean_velocity: Vec3) -> f32 {
        let depth = self.offset_mm + mean_position.dot(self.normal);
        if self.is_empty() || depth <= 0.0 {
            return 0.0;
        }
        let closing = mean_velocity.dot(self.normal) - self.tool_normal_velocity;
        (self.stiffness * depth + self.damping * closing).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tissue_that_gives_way_relieves_the_spring_and_is_never_pulled() {
        let mut contact = NodalContact { normal: Vec3::Z, offset_mm: 1.0, stiffness: 0.3, ..NodalContact::none() };
        contact.add(4, 1.0);
        contact.add(9, 3.0);
        contact.add(4, 1.0);
        contact.normalise();
        assert_eq!(contact.nodes().collect::<Vec<_>>(), [(4, 0.4), (9, 0.6)]);
        assert!((contact.pressure_n(Vec3::ZERO, Vec3::ZERO) - 0.3).abs() < 1e-7);
        assert_eq!(contact.pressure_n(Vec3::NEG_Z, Vec3::ZERO), 0.0);
        assert_eq!(contact.pressure_n(Vec3::new(0.0, 0.0, -2.0), Vec3::ZERO), 0.0);
    }

    #[test]
    fn no_weight_means_no_contact() {
        let mut contact = NodalContact::none();
        contact.add(1, 0.0);
        contact.normalise();
        assert!(contact.is_empty());
        (0..70).for_each(|n| contact.add(n, 1.0));
        assert_eq!(contact.overflow, 6);
    }
}
