//! How the thesis's proxy moves: along the way towards its goal until bone stands before it.
//!
//! # Theory
//! A ball on its way touches first, if the bone is flat across the way, with the pole that leads.
//! The line rules follow that pole; the sphere rule tests the whole shell at close steps (thesis,
//! Figure 3.7), which a ball that grazes a wall or meets a cavity narrower than itself needs.
//!
//! # When not to use it
//! The line rules, for tools wider than a cavity: they pass bone that lies beside the line.

use super::traverse::{clipped, first_bone};
use trepan_bone::BoneVolume;
use trepan_geometry::Vec3;

/// How the way is searched for bone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sweep {
    /// The thesis as printed: one look per voxel edge along the line. Skips voxels at corners.
    Steps,
    /// Every voxel that the line touches (Amanatides and Woo).
    #[default]
    Line,
    /// The whole ball, a third of a voxel at a time.
    Sphere,
}

/// Where a sweep ended.
#[derive(Clone, Copy, Debug)]
pub struct Stop {
    /// Centre of the tool, world mm.
    pub centre: Vec3,
    /// Whether bone stopped it before its goal.
    pub hit: bool,
}

/// What is swept.
pub struct Ball<'a> {
    /// Radius, mm.
    pub radius_mm: f32,
    /// Points of the surface relative to the centre, world axes, mm.
    pub shell: &'a [Vec3],
}

impl Ball<'_> {
    /// Moves from `from` towards `to`, world mm, and stops in light touch with the first bone. Adds
    /// to `visited`.
    pub fn sweep(&self, bone: &BoneVolume, how: Sweep, from: Vec3, to: Vec3, visited: &mut u32) -> Stop {
        let way = to - from;
        let length = way.length();
        if length == 0.0 {
            return Stop { centre: to, hit: false };
        }
        let pole = way * (self.radius_mm / length);
        let share = match how {
            Sweep::Steps => stepped(bone, from + pole, to + pole, visited),
            Sweep::Line => first_bone(bone, from + pole, to + pole, visited),
            Sweep::Sphere => self.whole(bone, from, to, visited),
        };
        match share {
            // A hundredth of a voxel into the voxel: so that the shell finds it.
            Some(share) => {
                let into = 0.01 * bone.spacing_mm() / length;
                let into = if how == Sweep::Sphere { 0.0 } else { into };
                Stop { centre: from.lerp(to, (share + into).min(1.0)), hit: true }
            }
            None => Stop { centre: to, hit: false },
        }
    }

    /// Share of the way at which a point of the shell first enters bone. A ball that touches
    /// already may move where no more of it touches.
    fn whole(&self, bone: &BoneVolume, from: Vec3, to: Vec3, visited: &mut u32) -> Option<f32> {
        let (enter, leave) = clipped(from, to, bone.bounds().inflated(self.radius_mm + bone.spacing_mm()))?;
        let steps = (from.distance(to) * (leave - enter) / (0.33 * bone.spacing_mm())).ceil().clamp(1.0, 4096.0) as u32;
        let mut touching = self.touching(bone, from, visited);
        for step in 1..=steps {
            let share = enter + (leave - enter) * step as f32 / steps as f32;
            let now = self.touching(bone, from.lerp(to, share), visited);
            if now > touching {
                return Some(if touching > 0 {
                    enter + (leave - enter) * (step - 1) as f32 / steps as f32
                } else {
                    share
                });
            }
            touching = now;
        }
        None
    }

    fn touching(&self, bone: &BoneVolume, centre: Vec3, visited: &mut u32) -> u32 {
        *visited += self.shell.len() as u32;
        self.shell.iter().filter(|&&p| bone.is_bone(bone.voxel_of(centre + p))).count() as u32
    }
}

/// The thesis's sweep: looks at one point per voxel edge.
fn stepped(bone: &BoneVolume, from: Vec3, to: Vec3, visited: &mut u32) -> Option<f32> {
    let (enter, leave) = clipped(from, to, bone.bounds().inflated(bone.spacing_mm()))?;
    let share_of_step = bone.spacing_mm() / from.distance(to);
    // Counted from the start of the way, as printed: where it enters the box of the bone makes no
    // difference to what is skipped.
    let (first, last) = ((enter / share_of_step).floor(), (leave / share_of_step).ceil());
    let steps = (last - first).clamp(0.0, 1e5) as u32;
    (0..=steps).map(|step| ((first + step as f32) * share_of_step).min(1.0)).find(|&share| {
        *visited += 1;
        bone.is_bone(bone.voxel_of(from.lerp(to, share)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Pointshell, Spread};
    use trepan_volume::VoxelVolume;

    /// Air with bone in the given voxels, 1 mm each.
    fn bone(voxels: impl IntoIterator<Item = [usize; 3]>) -> BoneVolume {
        let mut ct = VoxelVolume::isotropic([12, 12, 12], Vec3::ZERO, 1.0, -1000i16);
        for voxel in voxels {
            let at = ct.index(voxel);
            ct.data[at] = 1000;
        }
        BoneVolume::new(&ct, 400).expect("there is bone")
    }

    fn sweep(bone: &BoneVolume, how: Sweep, radius_mm: f32, from: Vec3, to: Vec3) -> Stop {
        let shell = Pointshell::sphere(radius_mm, 466, Spread::Fibonacci).points;
        Ball { radius_mm, shell: &shell }.sweep(bone, how, from, to, &mut 0)
    }

    #[test]
    fn fixed_steps_skip_a_voxel_at_a_corner_and_traversal_does_not() {
        let bone = bone([[5, 4, 5]]);
        // The line cuts 0.2 mm of the corner of voxel (5, 4, 5).
        let (from, to) = (Vec3::new(2.0, 0.2, 5.0), Vec3::new(8.0, 6.2, 5.0));
        let missed = (0..20).filter(|&i| {
            let shift = Vec3::new(0.05, 0.05, 0.0) * i as f32;
            let line = sweep(&bone, Sweep::Line, 0.01, from + shift, to + shift).hit;
            line && !sweep(&bone, Sweep::Steps, 0.01, from + shift, to + shift).hit
        });
        assert!(missed.count() > 0, "the printed rule must show its fault");
    }

    #[test]
    fn only_the_whole_ball_notices_a_gap_narrower_than_itself() {
        let plate = (0..12).flat_map(|i| (0..12).map(move |j| [i, j, 5])).filter(|v| v[0] != 6);
        let bone = bone(plate);
        let (from, to) = (Vec3::new(6.0, 6.0, 9.0), Vec3::new(6.0, 6.0, 1.0));
        assert!(!sweep(&bone, Sweep::Line, 2.0, from, to).hit);
        let stop = sweep(&bone, Sweep::Sphere, 2.0, from, to);
        assert!(stop.hit && (6.5..7.6).contains(&stop.centre.z), "{stop:?}");
    }
}
