//! The force of the sheet on a tool, without jumps.

use trepan_geometry::Vec3;

/// Change of the force where another triangle is met, N, from which on it is faded in, numerical.
const JUMP_N: f32 = 0.02;
/// Time over which it is faded in, ms, numerical.
const EASES_MS: f64 = 40.0;

/// Force of the sheet on a tool.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TouchForce {
    /// Whether it touches the sheet.
    pub touched: bool,
    /// Force on the tool, N.
    pub force: Vec3,
    /// The triangle that it met last, its force there, N, and the sheet's changes until then.
    met: (Option<u32>, Vec3, u32),
    /// The force when the triangle changed, N, and its share, which fades.
    held: (Vec3, f32),
}

impl TouchForce {
    /// Takes the mean force of some steps, N; `None` goes on with the last one.
    ///
    /// The hand feels no jump where another triangle is met, or a cut turns the sheet.
    pub fn feel(&mut self, triangle: Option<u32>, mean: Option<Vec3>, changes: u32, passed_ms: f64) {
        let now = if triangle.is_some() { mean.unwrap_or(self.met.1) } else { Vec3::ZERO };
        let is_other = (triangle, changes) != (self.met.0, self.met.2);
        if is_other && self.force.distance(now) > JUMP_N {
            self.held = (self.force, 1.0);
        }
        self.met = (triangle, now, changes);
        self.held.1 *= (-passed_ms / EASES_MS).exp() as f32;
        self.force = now.lerp(self.held.0, self.held.1);
    }

    /// Feels nothing while the sheet sleeps.
    pub fn sleep(&mut self) {
        (self.force, self.held.1) = (Vec3::ZERO, 0.0);
    }
}
