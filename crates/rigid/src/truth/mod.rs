//! Exact bone in f64: what a ball must feel and cut, found by other means than any method's.
//!
//! # Theory
//! Bone is where a density reaches the isovalue ([`Density`]: a closed form, or a CT between its
//! voxels), less the union of the balls that a burr has been ([`Cut`], exact capsules along its
//! way). No grid stores the cut and no discs stand for the surface.
//!
//! ```text
//! contact   4000 directions from the centre; where bone is near the ball along one, that ray's
//!           end bounds the centre; the deepest directions are polished between the 4000
//! proxy     steps to the point nearest to the device within those bounds, until it rests
//! removal   dV/ds = ∫ price(hu) max(0, n·f) r² dω over the front that lies in uncut bone
//! ```
//! The burr goes as far as the volume that its load earns in the tick, be it a nanometre; what its
//! front crosses is integrated, never counted.
//!
//! # Practice
//! Exact to about a micrometre ([`FLOOR_MM`]), 50 to 500 µs a tick. The hand is led: a pose a tick.
//! The first tick must be free of bone.
//!
//! # When not to use it
//! In a haptic loop: it allocates and takes as long as it needs. For a ball on its way out of a
//! long hole of its own width in a CT: there it takes up to seconds a tick, and may stay behind.

mod ball;
mod cut;
mod density;
mod directions;
mod price;
#[cfg(test)]
mod tests;

pub use ball::Ball;
pub use cut::Cut;
pub use density::{ClosedForm, Density, Scan};

/// What this truth is uncertain by, mm.
pub const FLOOR_MM: f64 = 2e-3;

/// Bone with what was cut from it.
pub struct Bone {
    density: Box<dyn Density>,
    cut: Cut,
}

impl Bone {
    /// Bone that nothing was cut from.
    pub fn new(density: impl Density + 'static) -> Self {
        Self { density: Box::new(density), cut: Cut::default() }
    }

    /// How deep a place is in bone, mm; at most. Negative in the free: bone is further than that.
    fn within(&self, place: glam::DVec3, enough: f64) -> f64 {
        let of_density = self.density.within(place) / self.density.steepest();
        if of_density < -enough { of_density } else { of_density.min(-self.cut.depth(place)) }
    }
}
