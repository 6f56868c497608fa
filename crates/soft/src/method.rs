//! The closed list of the solvers in this crate, by name, for tests, charts and command lines.

use crate::{Body, BodyError, SoftSolver, corotational, linear, mass_spring, reference, xpbd};

/// A soft-tissue solver with its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Small strain, explicit.
    Linear(linear::Config),
    /// Masses and springs, explicit.
    MassSpring(mass_spring::Config),
    /// Large rotations, implicit.
    Corotational(corotational::Config),
    /// Position based, neo-Hookean.
    Xpbd(xpbd::Config),
    /// Static hyperelastic oracle, f64.
    Reference(reference::Config),
}

impl Method {
    /// Every method with its default settings.
    pub fn all() -> Vec<Self> {
        vec![
            Self::Linear(linear::Config::default()),
            Self::MassSpring(mass_spring::Config::default()),
            Self::Corotational(corotational::Config::default()),
            Self::Xpbd(xpbd::Config::default()),
            Self::Reference(reference::Config::default()),
        ]
    }

    /// The method of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|method| method.name() == name)
    }

    /// Its name on a command line and in charts.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Linear(_) => "linear",
            Self::MassSpring(_) => "mass-spring",
            Self::Corotational(_) => "corotational",
            Self::Xpbd(_) => "xpbd",
            Self::Reference(_) => "reference",
        }
    }

    /// Makes the solver for a body at rest.
    pub fn build(&self, body: &Body) -> Result<Box<dyn SoftSolver>, BodyError> {
        Ok(match self {
            Self::Linear(config) => Box::new(linear::Linear::new(body, config)?),
            Self::MassSpring(config) => Box::new(mass_spring::MassSpring::new(body, config)?),
            Self::Corotational(config) => Box::new(corotational::Corotational::new(body, config)?),
            Self::Xpbd(config) => Box::new(xpbd::Xpbd::new(body, config)?),
            Self::Reference(config) => Box::new(reference::Reference::new(body, config)?),
        })
    }
}
