//! Hertz's force and an energy balance of erosion from the bone inside the ball: its volume gives
//! the depth, its centre of mass the direction.
//!
//! # Theory
//! The ball overlaps bone of volume V with centre of mass m. Were the bone flat, V would be a
//! spherical cap of height h; the force is that of a ball on an elastic half-space:
//! ```text
//! V = π h² (r - h/3) ,   n = (c - m)/|c - m|
//! F = C r² (h/r)^(3/2) n ,   C r^(1/2) = k δ₀^(-1/2)   so that F(δ₀) = k δ₀
//! ```
//! with the caller's spring k and the reference depth δ₀ of 0.5 mm. Erosion spends the power of
//! friction where Hertz's pressure is, on the disc of contact of radius a:
//! ```text
//! P(ξ) ~ √(1 - ξ²/a²)        ξ: distance from the axis through c along n
//! ```
//! with a at the outermost bone in the ball: Hertz's own radius, √(r h), would leave a rim that
//! carries the burr and is never worn.
//!
//! # Practice
//! Voxels count by fraction, ½ + (hu - iso)/1000, and as balls of a voxel's size. Burr and bone
//! come into a voxel from opposite sides, so that their overlap in it is what is too much for it:
//! `max(0, bone + burr - 1)`. Wear takes that and leaves the rest. Rows of eight voxels in one go;
//! rows in bricks that never held bone cost nothing. Smooth, since it is a sum.
//!
//! # Sources
//! M. Agus et al., *Real-time haptic and visual simulation of bone dissection*, IEEE VR 2002 and
//! Presence 12 (2003): abstracts read (physically motivated burr-bone interaction, erosion,
//! voxels); voxels as balls of the same volume, elastic forces first, then an energy balance of the
//! motor's work and the energy to cut: as the thesis tells it (2.3.1); Hertz's exponent, pressure
//! and depth by volume from memory of section 3, without its numbers. Liberties: all voxels in the
//! ball, not 5³ samples of it; C by the closed form above; the friction that pulls a spinning burr
//! aside is left out, since no truth here has it; power by this crate's [`RemovalLaw`], which is
//! such a balance; a by the overlap; the burr's own axis makes no difference.
//!
//! # When not to use it
//! Where forces should grow in proportion to depth: stiffness at the reference depth is 1.5 k, at
//! first touch nothing. Against edges and thin walls, where there is less bone than a cap has.

use core::f32::consts::PI;
use glam::IVec3;
use trepan_bone::{BRICK, BoneVolume};
use trepan_contact::Contact;
use trepan_geometry::{Pose, Tool, Vec3};
use trepan_rigid::Descriptor;
use trepan_rigid::RigidStep;
use trepan_rigid::frame::WornVoxel;
use trepan_rigid::frame::wide;
use trepan_rigid::frame::{GridBall, rows};
use trepan_rigid::frame::{PenaltyProbe, REFERENCE_MM, WholeContact, answer, framed};
use trepan_rigid::removal::RemovalLaw;
use wide::f32x8;

/// Density over and under the isovalue within which a voxel is partly bone, HU.
const HALF_HU: f32 = 500.0;
/// Share of a voxel for each HU.
const PER_HU: f32 = 0.5 / HALF_HU;
/// Least distance of the centre of mass from the ball's that has a direction, voxels.
const LEAST_OFF: f32 = 1e-3;
/// Most voxels that are read in one go.
const ROW: usize = 32;
/// Most voxels that a burr wears at once.
const MAX_WORN: usize = 4096;

struct Sum {
    worn: Vec<WornVoxel>,
}

/// Bone in the ball, voxels.
#[derive(Default)]
struct Overlap {
    volume: f32,
    /// First moment about the ball's centre.
    moment: Vec3,
    voxels: u32,
    visited: u32,
}

/// Bone in a ball; grid units.
fn overlap(bone: &BoneVolume, centre: Vec3, radius: f32) -> Overlap {
    let mut found = Overlap::default();
    let (low, high) = (centre - radius - 1.0, centre + radius + 1.0);
    if !bone.may_hold_bone(low.floor().as_ivec3(), high.ceil().as_ivec3()) {
        return found;
    }
    let lanes = f32x8::from([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let border = f32x8::splat(f32::from(bone.isovalue()) - HALF_HU);
    let (zero, one) = (f32x8::ZERO, f32x8::ONE);
    let mut sums = [zero; 4];
    let (mut block, mut may_hold, mut row) = (IVec3::MAX, false, [0; ROW]);
    rows(GridBall { centre, radius: radius + 0.5 }, GridBall::NONE, |start, to| {
        let of_row = start.with_x(0).div_euclid(IVec3::splat(BRICK as i32));
        if of_row != block {
            // A voxel less than half a voxel out of bone counts: the next brick may hold it.
            let low = of_row * BRICK as i32 - 1;
            let high = low + BRICK as i32 + 1;
            let ends = (low.with_x(start.x - ROW as i32), high.with_x(to + ROW as i32));
            (block, may_hold) = (of_row, bone.may_hold_bone(ends.0, ends.1));
        }
        if !may_hold {
            return;
        }
        let across = start.as_vec3() - centre;
        let away = f32x8::splat(across.y * across.y + across.z * across.z);
        let [volume, x_sum, y_sum, z_sum] = &mut sums;
        let (y, z) = (f32x8::splat(across.y), f32x8::splat(across.z));
        let mut at = start;
        while at.x <= to {
            let count = (to - at.x + 1).min(ROW as i32) as usize;
            bone.read_row(at, &mut row[..count]);
            row[count..count.next_multiple_of(8)].fill(i16::MIN);
            for (eight, hu) in row[..count.next_multiple_of(8)].as_chunks().0.iter().enumerate() {
                let x = lanes + ((at.x + 8 * eight as i32) as f32 - centre.x);
                let share = ((wide(hu) - border) * PER_HU).fast_max(zero).fast_min(one);
                if share.simd_gt(zero).to_bitmask() == 0 {
                    continue;
                }
                let inside = (f32x8::splat(radius + 0.5) - (x * x + away).sqrt()).fast_max(zero).fast_min(one);
                let within = (share + inside - one).fast_max(zero);
                *volume += within;
                *x_sum += within * x;
                *y_sum += within * y;
                *z_sum += within * z;
                found.voxels += within.simd_gt(f32x8::splat(0.5)).to_bitmask().count_ones();
            }
            found.visited += count as u32;
            at.x += ROW as i32;
        }
    });
    let [volume, x, y, z] = sums.map(|sum| sum.reduce_add());
    (found.volume, found.moment) = (volume, Vec3::new(x, y, z));
    found
}

impl PenaltyProbe for Sum {
    fn feel(&mut self, bone: &BoneVolume, tool: &Tool, pose: &Pose, out: &mut RigidStep) -> Option<WholeContact> {
        let (tip, spacing) = (pose.translation, bone.spacing_mm());
        let radius = tool.tip_radius_mm / spacing;
        let found = overlap(bone, bone.grid_of(tip), radius);
        (out.voxels_swept, out.voxels_in_contact) = (found.visited, found.voxels);
        out.points_in_contact = found.voxels;
        // Past half of the ball there is no flat bone that would press on it.
        let cap_mm = (cap_height(found.volume, radius) * spacing).min(tool.tip_radius_mm);
        // A centre of mass so near to the ball's is rounding: there is no way to push.
        let push = if found.moment.length() > LEAST_OFF * found.volume { -found.moment } else { Vec3::ZERO };
        let felt = answer(push, cap_mm * (cap_mm / REFERENCE_MM).sqrt(), out);
        if let Some(WholeContact { normal, depth_mm, .. }) = felt {
            out.manifold.push(Contact { point: tip - tool.tip_radius_mm * normal, normal, depth_mm });
        }
        felt
    }

    fn wears(&mut self, bone: &BoneVolume, tool: &Tool, pose: &Pose, felt: &WholeContact) -> Option<&[WornVoxel]> {
        let (centre, spacing, worn) = (bone.grid_of(pose.translation), bone.spacing_mm(), &mut self.worn);
        let radius = tool.tip_radius_mm / spacing + 0.5;
        let aside = |voxel: IVec3| (voxel.as_vec3() - centre).reject_from_normalized(felt.normal).length_squared();
        let mut widest = 0.0f32;
        worn.clear();
        rows(GridBall { centre, radius }, GridBall::NONE, |start, to| {
            for voxel in (start.x..=to).map(|x| start.with_x(x)) {
                // What is within the ball goes, what is left of the voxel stays.
                let inside = (radius - voxel.as_vec3().distance(centre)).clamp(0.0, 1.0);
                let floor_hu = f32::from(bone.isovalue()) + HALF_HU - inside / PER_HU;
                let over = f32::from(bone.hu(voxel)) - floor_hu;
                if over >= 1.0 && worn.len() < MAX_WORN {
                    widest = widest.max(aside(voxel));
                    worn.push(WornVoxel { voxel, share: (over * PER_HU).min(1.0), floor_hu });
                }
            }
        });
        // Half a voxel beyond the outermost, so that it is worn too.
        let disc = (widest.sqrt() + 0.5).powi(2);
        worn.iter_mut().for_each(|worn| worn.share *= (1.0 - aside(worn.voxel) / disc).sqrt());
        Some(worn)
    }
}

/// Height of the cap of a ball of `radius` that holds `volume`; at most the diameter.
fn cap_height(volume: f32, radius: f32) -> f32 {
    let (mut low, mut high) = (0.0, 2.0 * radius);
    for _ in 0..24 {
        let h = 0.5 * (low + high);
        if PI * h * h * (radius - h / 3.0) < volume { low = h } else { high = h }
    }
    low
}

/// What the method says of itself.
pub const METHOD: Descriptor = Descriptor::of("voxel-sum", "Agus et al. 2003", |tool, _| {
    framed(tool, RemovalLaw::RATE, Sum { worn: Vec::with_capacity(MAX_WORN) })
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cap_of_half_a_ball_is_its_radius() {
        assert!((cap_height(2.0 / 3.0 * PI * 8.0, 2.0) - 2.0).abs() < 1e-3);
        assert_eq!(cap_height(0.0, 2.0), 0.0);
    }
}
