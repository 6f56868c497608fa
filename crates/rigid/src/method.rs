//! The list of methods: one closed enum feeds tests, charts and command lines.

use crate::{RigidContact, brute, distance_field, thesis};
use trepan_geometry::Tool;

/// A way to handle a tool against bone, with its configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// The thesis's point shell, sweeps and god-object.
    Thesis(thesis::Config),
    /// A ball that slides on the density's isosurface: the default.
    DistanceField(distance_field::Config),
    /// The oracle: the same question answered slowly and obviously, in f64.
    Brute(brute::Config),
}

impl Method {
    /// What the simulators use.
    pub const RECOMMENDED: Self = Self::DistanceField(distance_field::Config::RECOMMENDED);

    /// Every method in its default configuration, and the thesis's once more as printed.
    pub fn all() -> Vec<Self> {
        vec![
            Self::Thesis(thesis::Config::default()),
            Self::Thesis(thesis::Config::PRINTED),
            Self::DistanceField(distance_field::Config::default()),
            Self::Brute(brute::Config::default()),
        ]
    }

    /// The name on command lines and charts.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Thesis(config) if *config == thesis::Config::PRINTED => "thesis-printed",
            Self::Thesis(_) => "thesis",
            Self::DistanceField(_) => "distance-field",
            Self::Brute(_) => "brute",
        }
    }

    /// The method of that name in its default configuration.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|method| method.name() == name)
    }

    /// Makes the method ready for a tool. All memory is taken here.
    pub fn build(&self, tool: &Tool) -> Box<dyn RigidContact> {
        match self {
            Self::Thesis(config) => Box::new(thesis::Thesis::new(tool, *config)),
            Self::Brute(config) => Box::new(brute::Brute::new(tool, *config)),
            Self::DistanceField(config) => Box::new(distance_field::DistanceField::new(tool, *config)),
        }
    }
}

impl Default for Method {
    fn default() -> Self {
        Self::RECOMMENDED
    }
}
