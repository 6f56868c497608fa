//! The tool's exact surface: a ball on a round shaft.

use trepan_geometry::{Tool, ToolState, Vec3};

/// A tool's radii and length, mm; no shaft where it is not asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Radii {
    tip: f32,
    shaft: Option<Shaft>,
}

#[derive(Clone, Copy, Debug)]
struct Shaft {
    radius: f32,
    length: f32,
}

/// The tool where it is now.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rod {
    tip: Vec3,
    axis: Vec3,
    radii: Radii,
}

impl Radii {
    pub(crate) fn of(tool: &Tool, with_shaft: bool) -> Self {
        let shaft = Shaft { radius: tool.shaft_radius_mm, length: tool.shaft_length_mm };
        let is_sound = shaft.radius > 0.0 && shaft.length > 0.0 && shaft.length.is_finite();
        Self { tip: tool.tip_radius_mm, shaft: Some(shaft).filter(|_| with_shaft && is_sound) }
    }

    /// The tool at a pose. It grows upwards along a direction, its lowest point fixed.
    pub(crate) fn at(self, state: &ToolState, grown: Vec3) -> Rod {
        let axis = state.world_from_tool.rotation * Vec3::Z;
        Rod { tip: state.tip() + grown, axis, radii: Self { tip: self.tip + grown.length(), ..self } }
    }
}

impl Rod {
    /// Distance of a place from the tool, mm, negative inside, and the unit vector from there to
    /// the tool's middle. For the union of two bodies it is exact outside, a bound inside.
    #[inline]
    pub(crate) fn gap(&self, place: Vec3) -> (f32, Vec3) {
        let to_tip = self.tip - place;
        let from_tip = to_tip.length();
        let ball = (from_tip - self.radii.tip, to_tip, from_tip);
        let along = -to_tip.dot(self.axis);
        let (gap, inwards, length) = match self.radii.shaft {
            Some(shaft) if along > 0.0 => {
                let to_axis = to_tip + self.axis * along.min(shaft.length);
                let from_axis = to_axis.length();
                let gap = from_axis - shaft.radius;
                if gap < ball.0 { (gap, to_axis, from_axis) } else { ball }
            }
            _ => ball,
        };
        (gap, if length > f32::MIN_POSITIVE { inwards / length } else { self.axis })
    }

    /// Middles and half widths of boxes that hold every place nearer than `reach_mm`, mm.
    pub(crate) fn boxes(&self, reach_mm: f32) -> impl Iterator<Item = (Vec3, f32)> {
        let (Self { tip, axis, radii }, pieces) = (*self, self.pieces());
        let along = move |piece: usize| tip + axis * (PIECE_MM * (piece as f32 + 0.5));
        let shaft = (0..pieces).map(move |piece| {
            let radius = radii.shaft.map_or(0.0, |shaft| shaft.radius);
            (along(piece), radius + reach_mm + 0.5 * PIECE_MM)
        });
        std::iter::once((tip, radii.tip + reach_mm)).chain(shaft)
    }

    fn pieces(&self) -> usize {
        self.radii.shaft.map_or(0, |shaft| ((shaft.length / PIECE_MM).ceil() as usize).min(MOST_PIECES))
    }
}

/// Length of shaft that asks for triangles at once, mm, and most such pieces.
const PIECE_MM: f32 = 6.0;
const MOST_PIECES: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use trepan_geometry::{Pose, Quat};

    fn rod(with_shaft: bool, grown: Vec3) -> Rod {
        let lies = Pose::from_parts(Vec3::new(1.0, 2.0, 3.0), Quat::from_rotation_y(core::f32::consts::FRAC_PI_2));
        Radii::of(&Tool::probe(2.0), with_shaft).at(&ToolState::at(lies), grown)
    }

    /// A ball of 2 mm at (1, 2, 3) on a shaft of 1.2 mm towards +x, by hand.
    #[test]
    fn the_gap_is_that_of_ball_and_shaft() {
        let near = |(gap, inwards): (f32, Vec3), wanted: f32, along: Vec3| {
            assert!(
                (gap - wanted).abs() < 1e-5 && inwards.distance(along) < 1e-5,
                "{gap} {inwards} for {wanted} {along}"
            );
        };
        near(rod(true, Vec3::ZERO).gap(Vec3::new(-2.0, 2.0, 3.0)), 1.0, Vec3::X);
        near(rod(true, Vec3::ZERO).gap(Vec3::new(31.0, 4.0, 3.0)), 0.8, Vec3::NEG_Y);
        near(rod(false, Vec3::ZERO).gap(Vec3::new(31.0, 2.0, 3.0)), 28.0, Vec3::NEG_X);
        near(rod(true, Vec3::ZERO).gap(Vec3::new(1.0, 2.0, 2.5)), -1.5, Vec3::Z);
        near(rod(true, Vec3::Z).gap(Vec3::new(1.0, 2.0, 1.0)), 0.0, Vec3::Z);
        assert!(rod(true, Vec3::ZERO).gap(Vec3::new(1.0, 2.0, 3.0)).1.is_normalized());
    }

    proptest! {
        #[test]
        fn every_near_place_lies_in_a_box(at in prop::array::uniform3(-10.0f32..100.0), reach in 0.1f32..2.0) {
            let (rod, place) = (rod(true, Vec3::ZERO), Vec3::from(at));
            let holds = |(middle, half): (Vec3, f32)| (place - middle).abs().max_element() <= half;
            prop_assert!(rod.gap(place).0 >= reach || rod.boxes(reach).any(holds));
        }
    }
}
