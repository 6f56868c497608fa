//! The list of methods: one closed enum feeds tests, charts and command lines.

use crate::penalty::Penalty;
use crate::{RigidContact, brute, distance_field, pointshell, ray_trace, thesis, voxel_sum};
use trepan_geometry::Tool;

/// A way to handle a tool against bone, with its configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// The thesis's point shell, sweeps and god-object.
    Thesis(thesis::Config),
    /// Points under the tangent planes of their voxels, summed or averaged.
    Pointshell(pointshell::Config),
    /// Rays from the points inwards to the isosurface.
    RayTrace(ray_trace::Config),
    /// Volume and centre of mass of the bone in the ball.
    VoxelSum(voxel_sum::Config),
    /// A ball that slides on the density's isosurface: the default.
    DistanceField(distance_field::Config),
    /// The oracle: the same question answered slowly and obviously, in f64.
    Brute(brute::Config),
}

impl Method {
    /// What the simulators use.
    pub const RECOMMENDED: Self = Self::DistanceField(distance_field::Config::RECOMMENDED);

    /// Every method in its default configuration, the thesis's once more as printed, and both ways to combine points.
    pub fn all() -> Vec<Self> {
        vec![
            Self::Thesis(thesis::Config::default()),
            Self::Thesis(thesis::Config::PRINTED),
            Self::Pointshell(pointshell::Config::SUM),
            Self::Pointshell(pointshell::Config::default()),
            Self::RayTrace(ray_trace::Config::default()),
            Self::VoxelSum(voxel_sum::Config::default()),
            Self::DistanceField(distance_field::Config::default()),
            Self::Brute(brute::Config::default()),
        ]
    }

    /// The name on command lines and charts.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Thesis(config) if *config == thesis::Config::PRINTED => "thesis-printed",
            Self::Thesis(_) => "thesis",
            Self::Pointshell(config) if config.combine == pointshell::Combine::Sum => "pointshell-sum",
            Self::Pointshell(_) => "pointshell-average",
            Self::RayTrace(_) => "ray-trace",
            Self::VoxelSum(_) => "voxel-sum",
            Self::DistanceField(_) => "distance-field",
            Self::Brute(_) => "brute",
        }
    }

    /// The method of that name in its default configuration.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|method| method.name() == name)
    }

    /// Whether the method keeps a proxy on the side of the bone that it came from. One that does not loses thin walls.
    pub fn has_proxy(&self) -> bool {
        matches!(self, Self::Thesis(_) | Self::DistanceField(_) | Self::Brute(_))
    }

    /// Makes the method ready for a tool. All memory is taken here.
    pub fn build(&self, tool: &Tool) -> Box<dyn RigidContact> {
        match self {
            Self::Thesis(config) => Box::new(thesis::Thesis::new(tool, *config)),
            Self::Pointshell(config) => {
                Box::new(Penalty::new(tool, pointshell::Shell::new(tool, config), config.removal))
            }
            Self::RayTrace(config) => Box::new(Penalty::new(tool, ray_trace::Rays::new(tool, config), config.removal)),
            Self::VoxelSum(config) => Box::new(Penalty::new(tool, voxel_sum::Sum::new(tool), config.removal)),
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
