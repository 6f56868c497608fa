//! What a user chooses, and what is refused.

use crate::method::{Method, Response};

/// How the tool is tested against the tissue and how the tissue answers.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// How the points inside the tissue are found.
    pub method: Method,
    /// How normal and depth come out of what was found; `None` takes the one that belongs to the
    /// method.
    pub response: Option<Response>,
    /// Points on the tool's ball. More points feel smaller features; the time grows in proportion.
    pub points: usize,
    /// Edge of a grid cell, mm, for the methods with a grid; `None` takes 1.45 x the mean edge of
    /// the mesh.
    pub cell_mm: Option<f32>,
    /// Contact of responses that have one spring for all places, N/mm.
    pub stiffness: f32,
    /// Stiffness of the contact for each mm² of surface, N/mm: pressure for each mm that a place is
    /// in the tool. Higher lets less of the tool in, and makes it jitter in motion.
    pub stiffness_per_mm2: f32,
    /// Contact damper along the normal, N ms/mm.
    pub damping: f32,
    /// Coulomb friction between tool and tissue at each place, 0 to 2, by [`Response::Ball`] only.
    /// More drags the tissue along before the tool slips; 0 is frictionless.
    pub friction: f32,
    /// Whether the tool's shaft touches too, by [`Response::Ball`] only. Costs little until it
    /// comes near the tissue.
    pub shaft: bool,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            method: Method::RECOMMENDED,
            response: None,
            points: trepan_geometry::Pointshell::DEFORMABLE_COUNT,
            cell_mm: None,
            // Numerical: the coupling between hand and tissue, not the tissue.
            stiffness: 0.3,
            stiffness_per_mm2: 0.1,
            damping: 0.3,
            friction: 0.0,
            shaft: false,
        }
    }
}

/// Why a collision test cannot be set up.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// A number that makes no sense.
    #[error("{field} is {value}; it must be {must}")]
    Value {
        /// Field of [`Config`] or of the tool.
        field: &'static str,
        /// What it is.
        value: f64,
        /// What would be right.
        must: &'static str,
    },
    /// There is nothing to collide with.
    #[error("the mesh has no tetrahedra; it needs at least one")]
    EmptyMesh,
    /// A tetrahedron names a node that is not there.
    #[error("tetrahedron {tet} names node {node}, but there are only {nodes} nodes")]
    NoSuchNode {
        /// The tetrahedron.
        tet: usize,
        /// The node that it names.
        node: u32,
        /// How many there are.
        nodes: usize,
    },
    /// Tetrahedra are to be taken away under a search that keeps a border of its own.
    #[error("{search} keeps the border that the mesh has at first; take walk where tissue is to be removed")]
    FixedBorder {
        /// The search.
        search: &'static str,
    },
    /// A node is nowhere.
    #[error("node {node} lies at {position}; every coordinate at rest must be finite")]
    NonFinite {
        /// The node.
        node: usize,
        /// Where it lies.
        position: trepan_geometry::Vec3,
    },
}

impl Config {
    /// Refuses what cannot work, naming the field.
    pub(crate) fn check(&self, tip_radius_mm: f32) -> Result<(), ConfigError> {
        let must = |field, value: f64, must, is_met: bool| match is_met {
            true => Ok(()),
            false => Err(ConfigError::Value { field, value, must }),
        };
        let positive =
            |field, value: f32| must(field, value.into(), "finite and above 0", value.is_finite() && value > 0.0);
        positive("tool.tip_radius_mm", tip_radius_mm)?;
        positive("stiffness", self.stiffness)?;
        positive("stiffness_per_mm2", self.stiffness_per_mm2)?;
        self.cell_mm.map_or(Ok(()), |cell_mm| positive("cell_mm", cell_mm))?;
        let damped = self.damping.is_finite() && self.damping >= 0.0;
        must("damping", self.damping.into(), "finite and 0 or more", damped)?;
        must("friction", self.friction.into(), "0 to 2", (0.0..=2.0).contains(&self.friction))?;
        must("points", self.points as f64, "1 to 65536", (1..=MAX_POINTS).contains(&self.points))
    }
}

/// Most points on one tool.
const MAX_POINTS: usize = 65_536;
