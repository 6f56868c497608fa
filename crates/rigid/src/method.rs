//! A method as a value: what it says of itself, and how many points it has.
//!
//! # Practice
//! A method is one file with a [`RigidContact`] and a [`Descriptor`]. `Method::of` makes it usable
//! from any crate (`tests/toy_method.rs`); its name in a list of `trepan-rivals` brings it to the
//! command lines, suites and charts.

use crate::chain::Chain;
use crate::removal::RemovalLaw;
use crate::seam::RigidContact;
use trepan_geometry::Tool;

/// A method: what it is called, what it can, how it is made.
#[derive(Debug)]
pub struct Descriptor {
    /// Name on command lines, in charts and recordings.
    pub name: &'static str,
    /// Paper or chapter that it follows.
    pub source: &'static str,
    /// Which part of the tool it feels.
    pub extent: Extent,
    /// Whether it keeps a proxy on the side of the bone that it came from. One that does not loses
    /// thin walls.
    pub has_proxy: bool,
    /// Whether it answers slowly and exactly: a truth for the others, not for a haptic tick.
    pub is_oracle: bool,
    /// Points on the burr; 0 for a method without points.
    pub points: usize,
    /// What a burr takes away under it.
    pub removal: RemovalLaw,
    /// Makes it ready for a tool that cuts with its tip only, with so many points. All memory is
    /// taken here.
    pub build: fn(&Tool, usize) -> Box<dyn RigidContact>,
}

impl Descriptor {
    /// A method that feels the ball, without proxy and points, with the default law of removal.
    pub const fn of(
        name: &'static str,
        source: &'static str,
        build: fn(&Tool, usize) -> Box<dyn RigidContact>,
    ) -> Self {
        let (extent, removal) = (Extent::Ball, RemovalLaw::RATE);
        Self { name, source, extent, has_proxy: false, is_oracle: false, points: 0, removal, build }
    }
}

/// Which part of a tool a method feels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// The ball at the tip.
    Ball,
    /// The ball and the shaft. The tool must then be held with its axis out of the bone.
    BallAndShaft,
    /// The axis without thickness. A burr sinks in to its centre before it touches.
    Axis,
}

/// A way to handle a tool against bone: a described method with a number of points.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    descriptor: &'static Descriptor,
    points: usize,
    removal: RemovalLaw,
}

impl Method {
    /// The method of a descriptor in its default configuration.
    pub const fn of(descriptor: &'static Descriptor) -> Self {
        Self { descriptor, points: descriptor.points, removal: descriptor.removal }
    }

    /// What the method says of itself.
    pub fn descriptor(&self) -> &'static Descriptor {
        self.descriptor
    }

    /// The name on command lines and charts.
    pub fn name(&self) -> &'static str {
        self.descriptor.name
    }

    /// The method with so many points on the burr; 0, or a method without points, leaves it as it
    /// is.
    pub fn with_points(self, points: usize) -> Self {
        if points == 0 || self.points == 0 { self } else { Self { points, ..self } }
    }

    /// Points on the burr; 0 for a method without points.
    pub fn points(&self) -> usize {
        self.points
    }

    /// Whether the method keeps a proxy on the side of the bone that it came from.
    pub fn has_proxy(&self) -> bool {
        self.descriptor.has_proxy
    }

    /// Whether the method also touches with the tool's shaft. Then the tool must be held as a hand
    /// holds it, with its axis out of the bone.
    pub fn has_shaft(&self) -> bool {
        self.descriptor.extent != Extent::Ball
    }

    /// The method with another law of removal; one whose law is per tick keeps it.
    pub fn with_removal(self, removal: RemovalLaw) -> Self {
        if matches!(self.removal, RemovalLaw::PerTick { .. }) { self } else { Self { removal, ..self } }
    }

    /// What a burr takes away under this method.
    pub fn removal(&self) -> RemovalLaw {
        self.removal
    }

    /// Makes the method ready for a tool. All memory is taken here.
    pub fn build(&self, tool: &Tool) -> Box<dyn RigidContact> {
        let ready = |tool: &Tool| {
            let mut contact = (self.descriptor.build)(tool, self.points);
            contact.cut_by(self.removal.for_tool(tool));
            contact
        };
        if tool.cutting_mm > 0.0 { Box::new(Chain::new(tool, ready)) } else { ready(tool) }
    }
}

/// Two are the same if they have the same name and the same number of points.
impl PartialEq for Method {
    fn eq(&self, other: &Self) -> bool {
        (self.name(), self.points) == (other.name(), other.points)
    }
}
