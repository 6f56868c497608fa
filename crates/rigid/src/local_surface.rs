//! The surface around a ball, as discs on the nodes of the cut.
//!
//! # Theory
//! Bone ends where the CT's density falls under the isovalue or where a tool has cut,
//! whichever comes first on an edge between two nodes. Both are read on the same nodes, so that the
//! rim of a hole and thin webs between holes keep their shape.
//!
//! # Practice
//! Lengths are nodes. Discs are gathered anew when the ball has moved by half a node, and while a
//! burr works in nearly every tick, since nodes open: about 10 us for 3 mm.

use crate::RigidStep;
use crate::burr::{Burr, MOST_OPENED};
use crate::disc::{Disc, EXTENT};
use crate::nodes::Nodes;
use crate::surface::Discs;
use glam::IVec3;
use trepan_bone::BoneVolume;
use trepan_geometry::{Tool, Vec3};

/// How far the tool may move before discs are gathered anew, nodes.
const AHEAD: f32 = 0.5;

/// The surface around a ball.
pub(crate) struct LocalSurface {
    pub nodes: Nodes,
    discs: Discs,
    /// Where the discs were gathered; `None` when they are not those of the bone as it is.
    at: Option<Vec3>,
    /// Whether the bone has given way since.
    worn: bool,
    /// Nodes that are not bone any more since.
    opened: Vec<IVec3>,
    /// Radius of a disc.
    disc: f32,
}

impl LocalSurface {
    /// Room for `limit` discs of at most `radius`, around a tool of `tool_mm`.
    pub fn new(tool_mm: f32, limit: usize, radius: f32) -> Self {
        let discs = Discs::new(limit, radius);
        let opened = Vec::with_capacity(MOST_OPENED);
        Self { nodes: Nodes::new(tool_mm), discs, at: None, worn: false, opened, disc: radius }
    }

    /// The bone is another.
    pub fn forget(&mut self) {
        self.nodes.forget();
        self.renew();
    }

    fn renew(&mut self) {
        self.discs.renew();
        self.at = None;
    }

    /// There is no bone near.
    pub fn leave(&mut self) {
        self.discs.forget();
        self.at = None;
    }

    /// Reads anew what others have changed. Returns whether there was anything.
    pub fn track_changes(&mut self, bone: &BoneVolume) -> bool {
        let changed = self.nodes.renew(bone);
        if changed {
            self.renew();
        }
        changed
    }

    /// The burr has cut; the nodes that `opened` are not bone any more.
    pub fn cut(&mut self, opened: &[IVec3]) {
        self.worn = true;
        self.discs.wear();
        if self.opened.len() + opened.len() > MOST_OPENED {
            self.at = None;
        } else {
            self.opened.extend_from_slice(opened);
        }
    }

    /// The whole node from which the discs are seen.
    pub fn base(&self) -> Vec3 {
        self.discs.base.as_vec3()
    }

    /// Nodes of bone that have a disc.
    pub fn owners(&self) -> u32 {
        self.discs.voxels
    }

    /// Gathers the discs within `reach` of a ball at `centre`; false when it is too large for that.
    /// Nothing is searched for more than a node inside a ball that is `outside` of bone.
    pub fn gather(
        &mut self,
        bone: &BoneVolume,
        tool: &Tool,
        centre: Vec3,
        (reach, outside): (f32, bool),
        out: &mut RigidStep,
    ) -> bool {
        let (radius, middle) = (tool.tip_radius_mm / bone.node_mm(), centre.round().as_ivec3());
        if self.at.is_some_and(|known| known.distance(centre) <= AHEAD) {
            if self.worn {
                let fine = self.nodes.fine();
                if !self.opened.is_empty() {
                    self.discs.open(&fine, &self.opened);
                    self.opened.clear();
                }
                self.discs.refresh(&fine, centre - self.discs.base.as_vec3(), radius + reach);
                self.worn = false;
                out.voxels_swept += self.discs.visited;
            }
            return true;
        }
        let half = Burr::reach(bone, tool.tip_radius_mm, tool.cutting_mm);
        let Some(read) = self.nodes.cover(bone, middle, half) else {
            out.fallbacks += 1;
            return false;
        };
        let far = radius + reach + AHEAD + EXTENT * self.disc * bone.cut_nodes() as f32;
        let hollow = if outside { radius - AHEAD - 1.0 } else { 0.0 };
        self.discs.gather(&self.nodes.fine(), centre, hollow, far);
        (self.at, self.worn) = (Some(centre), false);
        self.opened.clear();
        out.voxels_swept += read + self.discs.visited;
        out.fallbacks += u32::from(self.discs.overflow > 0);
        true
    }

    /// Gives the discs their normals that the ball at `centre` has within `far`, seen from
    /// [`base`](Self::base).
    pub fn shaped(&mut self, centre: Vec3, far: f32) -> &[Disc] {
        self.discs.shape(&self.nodes.fine(), |_| centre, far);
        self.discs.list()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nodes::clearance;
    use glam::IVec3;
    use trepan_bone::{CUT_STEPS, CUT_SURFACE};
    use trepan_volume::VoxelVolume;

    #[test]
    fn discs_in_a_ball_shaped_hole_lie_on_the_ball() {
        for (r, off_nodes, off_degrees) in [(1.0, 0.01, 5.0), (2.0, 2e-3, 1.5), (3.0, 1e-3, 0.7)] {
            let ct = VoxelVolume::isotropic([20; 3], Vec3::splat(-6.0), 1.0, 1400i16);
            let bone = BoneVolume::new(&ct, 400).unwrap();
            let (centre, radius) = (bone.node_at(Vec3::new(0.123, 0.234, 0.345)), r / bone.node_mm());
            let (mut writer, half) = (bone.cut_writer(), (radius + 4.0) as i32);
            for at in 0..(2 * half + 1).pow(3) {
                let n = 2 * half + 1;
                let node = centre.round().as_ivec3() - half + IVec3::new(at % n, at / n % n, at / n / n);
                let depth = (radius - node.as_vec3().distance(centre)).clamp(-3.0, 3.0);
                if depth > -3.0 {
                    writer.set(node, (f32::from(CUT_SURFACE) + CUT_STEPS * depth).round() as i16);
                }
            }
            drop(writer);
            let (mut surface, mut out) = (LocalSurface::new(1000.0, 8192, 0.8), RigidStep::default());
            assert!(surface.gather(&bone, &Tool::burr(r), centre, (0.5, false), &mut out));
            let at = centre - surface.base();
            let discs = surface.shaped(at, radius + 0.5);
            let wall = radius + clearance(bone.node_mm(), 1000.0);
            let off = discs.iter().map(|disc| (disc.centre.distance(at) - wall).abs()).fold(0.0, f32::max);
            let tilt = |disc: &Disc| disc.normal.angle_between(at - disc.centre).to_degrees();
            let tilt = discs.iter().map(tilt).fold(0.0, f32::max);
            println!("{} discs in a ball of {radius} nodes: {off} nodes and {tilt} degrees off", discs.len());
            assert!(discs.len() as f32 > 2.0 * std::f32::consts::PI * radius * radius, "{}", discs.len());
            assert!(off < off_nodes && tilt < off_degrees, "{off} nodes {tilt} degrees");
        }
    }

    #[test]
    fn bent_discs_follow_a_ball_of_the_ct() {
        for (voxel_mm, off_mm, off_degrees) in [(2.0f32, 1e-3, 0.3), (1.0, 5e-4, 0.15), (0.5, 5e-4, 0.06)] {
            let edge = (36.0 / voxel_mm) as usize + 1;
            let mut ct = VoxelVolume::isotropic([edge; 3], Vec3::splat(-18.13), voxel_mm, 0i16);
            for at in 0..ct.data.len() {
                let place = ct.centre_of([at % edge, at / edge % edge, at / (edge * edge)]);
                let over = 800.0 * (10.0 - place.length()) / f64::from(voxel_mm);
                ct.data[at] = (400.0 + over).clamp(-1000.0, 1500.0).round() as i16;
            }
            let bone = BoneVolume::new(&ct, 400).unwrap();
            let tip = 13.0 * Vec3::new(0.3, 0.5, 0.7).normalize();
            let (mut surface, mut out) = (LocalSurface::new(1000.0, 8192, 0.8), RigidStep::default());
            assert!(surface.gather(&bone, &Tool::burr(3.0), bone.node_at(tip), (0.5, false), &mut out));
            let (at, reach) = (bone.node_at(tip) - surface.base(), 3.0 / bone.node_mm());
            let seen = surface.shaped(at, reach + 0.5).iter().map(|disc| disc.way_to(at - disc.centre));
            let near = seen.min_by(|a, b| a.0.length().total_cmp(&b.0.length())).expect("there is surface");
            let off = (near.0.length() * bone.node_mm() - 3.0).abs();
            let turned = near.1.angle_between(tip).to_degrees();
            println!("{voxel_mm} mm: {off} mm, {turned} degrees off");
            assert!(off < off_mm && turned < off_degrees, "{voxel_mm} mm: {off} mm, {turned} degrees off");
        }
    }
}
