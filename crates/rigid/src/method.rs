//! The list of methods: one closed enum feeds tests, charts and command lines.

use crate::{RigidContact, distance_field};
use trepan_geometry::Tool;

/// A way to handle a tool against bone, with its configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// A ball that slides on the density's isosurface: the default.
    DistanceField(distance_field::Config),
}

impl Method {
    /// What the simulators use.
    pub const RECOMMENDED: Self = Self::DistanceField(distance_field::Config::RECOMMENDED);

    /// Every method in its default configuration.
    pub fn all() -> Vec<Self> {
        vec![Self::DistanceField(distance_field::Config::default())]
    }

    /// The name on command lines and charts.
    pub fn name(&self) -> &'static str {
        match self {
            Self::DistanceField(_) => "distance-field",
        }
    }

    /// The method of that name in its default configuration.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|method| method.name() == name)
    }

    /// Makes the method ready for a tool. All memory is taken here.
    pub fn build(&self, tool: &Tool) -> Box<dyn RigidContact> {
        match self {
            Self::DistanceField(config) => Box::new(distance_field::DistanceField::new(tool, *config)),
        }
    }
}

impl Default for Method {
    fn default() -> Self {
        Self::RECOMMENDED
    }
}
