//! The list of methods: one closed enum feeds tests, charts and command lines.

use crate::chain::Chain;
use crate::penalty::Penalty;
use crate::removal::RemovalLaw;
use crate::{RigidContact, brute, burr_and_shaft, centre_line, exposed_faces, god_object_sphere};
use crate::{pointshell, ray_trace, surface_vertices, thesis, voxel_sum};
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
    /// Tangent planes by the bare faces of voxels at the surface.
    ExposedFaces(exposed_faces::Config),
    /// Volume and centre of mass of the bone in the ball.
    VoxelSum(voxel_sum::Config),
    /// Distance of voxels from burr and shaft, with torque.
    BurrAndShaft(burr_and_shaft::Config),
    /// Vertices along the axis, each with its own proxy, with torque.
    CentreLine(centre_line::Config),
    /// Vertices on burr and shaft, with torque.
    SurfaceVertices(surface_vertices::Config),
    /// A ball that slides on the density's isosurface: the default.
    GodObjectSphere(god_object_sphere::Config),
    /// The oracle: the same question answered slowly and obviously, in f64.
    Brute(brute::Config),
}

impl Method {
    /// What the simulators use.
    pub const RECOMMENDED: Self = Self::GodObjectSphere(god_object_sphere::Config::RECOMMENDED);

    /// Every method in its default configuration, the thesis's once more as printed, and both ways
    /// to combine points.
    pub fn all() -> Vec<Self> {
        vec![
            Self::Thesis(thesis::Config::default()),
            Self::Thesis(thesis::Config::PRINTED),
            Self::Pointshell(pointshell::Config::SUM),
            Self::Pointshell(pointshell::Config::default()),
            Self::RayTrace(ray_trace::Config::default()),
            Self::ExposedFaces(exposed_faces::Config::default()),
            Self::VoxelSum(voxel_sum::Config::default()),
            Self::BurrAndShaft(burr_and_shaft::Config::default()),
            Self::CentreLine(centre_line::Config::default()),
            Self::SurfaceVertices(surface_vertices::Config::default()),
            Self::GodObjectSphere(god_object_sphere::Config::default()),
            Self::GodObjectSphere(god_object_sphere::Config::WITH_SHAFT),
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
            Self::ExposedFaces(_) => "exposed-faces",
            Self::VoxelSum(_) => "voxel-sum",
            Self::BurrAndShaft(_) => "burr-and-shaft",
            Self::CentreLine(_) => "centre-line",
            Self::SurfaceVertices(_) => "surface-vertices",
            Self::GodObjectSphere(config) if config.shaft => "god-object-sphere-shaft",
            Self::GodObjectSphere(_) => "god-object-sphere",
            Self::Brute(_) => "brute",
        }
    }

    /// The method of that name in its default configuration. Also takes the names that recordings
    /// and command lines of version 0.1 have.
    pub fn named(name: &str) -> Option<Self> {
        let name = match name {
            "distance-field" => "god-object-sphere",             // version 0.1
            "distance-field-shaft" => "god-object-sphere-shaft", // version 0.1
            name => name,
        };
        Self::all().into_iter().find(|method| method.name() == name)
    }

    /// The method with so many points on the burr; 0, or a method without points to choose, leaves
    /// it as it is.
    pub fn with_points(mut self, points: usize) -> Self {
        let own = match &mut self {
            Self::Thesis(config) => &mut config.points,
            Self::Pointshell(config) => &mut config.points,
            Self::RayTrace(config) => &mut config.points,
            Self::ExposedFaces(config) => &mut config.points,
            Self::SurfaceVertices(config) => &mut config.points,
            Self::VoxelSum(_)
            | Self::BurrAndShaft(_)
            | Self::CentreLine(_)
            | Self::GodObjectSphere(_)
            | Self::Brute(_) => return self,
        };
        if points > 0 {
            *own = points;
        }
        self
    }

    /// Whether the method keeps a proxy on the side of the bone that it came from. One that does
    /// not loses thin walls.
    pub fn has_proxy(&self) -> bool {
        matches!(self, Self::Thesis(_) | Self::CentreLine(_) | Self::GodObjectSphere(_) | Self::Brute(_))
    }

    /// Whether the method also touches with the tool's shaft. Then the tool must be held as a hand
    /// holds it, with its axis out of the bone.
    pub fn has_shaft(&self) -> bool {
        match self {
            Self::GodObjectSphere(config) => config.shaft,
            Self::BurrAndShaft(_) | Self::CentreLine(_) | Self::SurfaceVertices(_) => true,
            _ => false,
        }
    }

    /// What a burr takes away under this method.
    pub fn removal(&self) -> RemovalLaw {
        match self {
            Self::Thesis(config) => config.removal,
            Self::Pointshell(config) => config.removal,
            Self::RayTrace(config) => config.removal,
            Self::ExposedFaces(config) => config.removal,
            Self::VoxelSum(config) => config.removal,
            Self::BurrAndShaft(config) => config.removal,
            Self::CentreLine(config) => config.removal,
            Self::SurfaceVertices(config) => config.removal,
            Self::GodObjectSphere(config) => config.removal,
            Self::Brute(config) => config.removal,
        }
    }

    /// Makes the method ready for a tool. All memory is taken here.
    pub fn build(&self, tool: &Tool) -> Box<dyn RigidContact> {
        if tool.cutting_mm > 0.0 {
            return Box::new(Chain::new(tool, self));
        }
        match self {
            Self::Thesis(config) => Box::new(thesis::Thesis::new(tool, *config)),
            Self::Pointshell(config) => {
                Box::new(Penalty::new(tool, pointshell::Shell::new(tool, config), config.removal))
            }
            Self::RayTrace(config) => Box::new(Penalty::new(tool, ray_trace::Rays::new(tool, config), config.removal)),
            Self::ExposedFaces(config) => {
                Box::new(Penalty::new(tool, exposed_faces::Faces::new(tool, config), config.removal))
            }
            Self::BurrAndShaft(config) => {
                Box::new(Penalty::new(tool, burr_and_shaft::BurrAndShaft::new(tool), config.removal))
            }
            Self::CentreLine(config) => Box::new(centre_line::CentreLine::new(tool, *config)),
            Self::SurfaceVertices(config) => {
                Box::new(Penalty::new(tool, surface_vertices::Vertices::new(tool, config), config.removal))
            }
            Self::VoxelSum(config) => Box::new(Penalty::new(tool, voxel_sum::Sum::new(tool), config.removal)),
            Self::Brute(config) => Box::new(brute::Brute::new(tool, *config)),
            Self::GodObjectSphere(config) => Box::new(god_object_sphere::GodObjectSphere::new(tool, *config)),
        }
    }
}

impl Default for Method {
    fn default() -> Self {
        Self::RECOMMENDED
    }
}
