//! Casts the window's rays against the skull as it is drilled and the brain as it lies.
//!
//! # Practice
//! The bone's density is trilinear in steps of half a voxel with the crossing interpolated. The
//! brain's triangles are tested one by one: all of them for a line of sight, those around the tool
//! for the short rays below it.

use crate::session_setup::SessionSetup;
use crate::show::picture::Shape;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::{Aabb, Pose, Vec3};
use trepan_mesh::{Surface, TetMesh};
use trepan_runtime::View;
use trepan_stages::ahead::{bone_ahead_mm, density};
use trepan_stages::program::Phase;
use trepan_window::{Panel, Ray, SurfaceHit};

/// Distance from the tool within which short rays meet the brain, mm: more than at the start.
const NEAR_MM: f32 = 50.0;
/// Length up to which a ray is short, mm.
const SHORT_MM: f32 = 100.0;

/// The surfaces of a scene.
#[derive(Default)]
pub(crate) struct Raycast {
    bone: Option<Arc<BoneVolume>>,
    triangles: Vec<[u32; 3]>,
    /// Longest edge of a triangle at rest, mm.
    edge_mm: f32,
    /// The brain at rest.
    rest: TetMesh,
    /// Which of its tetrahedra the triangles leave out.
    gone: Vec<bool>,
    /// The triangles around the tool, mm.
    near: Vec<[Vec3; 3]>,
}

impl Raycast {
    /// Prepares the surfaces of a session: its bone if the program shows it, and its brain.
    pub fn of(setup: &SessionSetup) -> Self {
        let bone = setup.scene.bone.clone().filter(|_| setup.program.has_bone());
        let Some(brain) = &setup.scene.brain else { return Self { bone, ..Self::default() } };
        let mut made = Self { bone, rest: brain.mesh.clone(), ..Self::default() };
        made.cover(&[]);
        made
    }

    /// Takes the border of what is left of the brain.
    fn cover(&mut self, gone: &[bool]) {
        let at = &self.rest.positions;
        let is_left = |(tet, _): &(usize, &[u32; 4])| !gone.get(*tet).is_some_and(|gone| *gone);
        let tets = self.rest.tets.iter().enumerate().filter(is_left).map(|(_, tet)| *tet).collect();
        self.triangles = Surface::of(&TetMesh { positions: at.clone(), tets }).triangles;
        let edge = |[a, b, _]: &[u32; 3]| at[*a as usize].distance(at[*b as usize]);
        self.edge_mm = self.triangles.iter().map(edge).fold(0.0, f32::max);
        self.gone = gone.to_vec();
    }

    /// Takes the brain as it lies around the tool's tip.
    pub fn follow(&mut self, brain: &Shape, tip: Vec3) {
        if self.gone != brain.gone {
            self.cover(&brain.gone);
        }
        let at = if brain.positions.is_empty() { &self.rest.positions[..] } else { &brain.positions };
        self.near.clear();
        let corners = self.triangles.iter().map(|corners| corners.map(|node| at[node as usize]));
        self.near.extend(corners.filter(|corners| corners[0].distance_squared(tip) < NEAR_MM * NEAR_MM));
    }

    /// Returns the first surface that a ray meets from outside, with the brain as it lies.
    pub fn cast(&self, ray: &Ray, brain: &Shape) -> Option<SurfaceHit> {
        let bone = self.bone.as_ref().filter(|_| ray.bone).and_then(|bone| of_bone(bone, ray));
        let at = if brain.positions.is_empty() { &self.rest.positions[..] } else { &brain.positions };
        let brain = match ray.brain {
            true if ray.reach_mm <= SHORT_MM => of_triangles(self.near.iter().copied(), 2.0 * self.edge_mm, ray),
            true => of_triangles(self.triangles.iter().map(|t| t.map(|n| at[n as usize])), 2.0 * self.edge_mm, ray),
            false => None,
        };
        bone.into_iter().chain(brain).min_by(|a, b| a.distance_mm.total_cmp(&b.distance_mm))
    }
}

/// Largest distance to bone below a tool, and largest thickness of it, mm.
const BONE_MM: [f32; 2] = [100.0, 25.0];

/// Returns the thickness of the bone along a direction from a point, mm; 0 where there is none.
fn below_mm(bone: &BoneVolume, from: Vec3, along: Vec3) -> f32 {
    let ray = Ray { from, along, reach_mm: BONE_MM[0], bone: true, brain: false };
    let over_mm = of_bone(bone, &ray).map_or(0.0, |hit| hit.distance_mm);
    bone_ahead_mm(bone, from + over_mm * along, along, BONE_MM[1])
}

impl Raycast {
    /// Adds to a panel how much bone is left below the tool, and what can be undone and redone.
    pub fn describe(&self, view: &View, panel: &mut Panel) {
        let Some(bone) = &self.bone else { return };
        let Pose { translation: tip, rotation, .. } = view.sample.state.world_from_tool;
        let (tool, down) = (view.sample.tool, rotation * Vec3::NEG_Z);
        // The line stays with every tool for bone, so that no button below it moves.
        if view.sample.phase() == Phase::Craniotomy {
            let left_mm = below_mm(bone, tip + tool.tip_radius_mm * down, down);
            let text = if tool.cutting_mm > 0.0 { "cuts aside".into() } else { format!("{left_mm:.1} mm") };
            panel.task.insert(0, ("bone below the tool".into(), text));
        }
        panel.no_undo = (bone.strokes() == 0).then(|| "there is no stroke to undo".into());
        panel.no_redo = (bone.undone_strokes() == 0).then(|| "no stroke was undone since the last one".into());
    }
}

/// Part of a ray within a box, mm.
fn within(bounds: &Aabb, ray: &Ray) -> Option<(f32, f32)> {
    let (a, b) = ((bounds.min - ray.from) / ray.along, (bounds.max - ray.from) / ray.along);
    let (from, to) = (a.min(b).max_element().max(0.0), a.max(b).min_element().min(ray.reach_mm));
    (from < to).then_some((from, to))
}

fn of_bone(bone: &BoneVolume, ray: &Ray) -> Option<SurfaceHit> {
    let (from, to) = within(&bone.bounds(), ray)?;
    let step = 0.5 * bone.spacing_mm();
    let over = |mm: f32| density(bone, ray.from + mm * ray.along) - f32::from(bone.isovalue());
    let mut last = if from > 0.0 { -1.0 } else { over(0.0) };
    for n in 1..=((to - from) / step).ceil() as usize {
        let now = over(from + n as f32 * step);
        if now >= 0.0 && last < 0.0 {
            let distance_mm = from + (n as f32 - 1.0 + last / (last - now)) * step;
            let at = ray.from + distance_mm * ray.along;
            let slope = |axis: Vec3| density(bone, at - axis) - density(bone, at + axis);
            let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| slope(bone.spacing_mm() * axis));
            return Some(SurfaceHit { distance_mm, normal: Vec3::new(x, y, z).normalize_or(-ray.along) });
        }
        last = now;
    }
    None
}

/// The first front face that a ray meets (Möller and Trumbore 1997); `reach_mm`: largest distance
/// from a met triangle's corner to the ray.
fn of_triangles(triangles: impl Iterator<Item = [Vec3; 3]>, reach_mm: f32, ray: &Ray) -> Option<SurfaceHit> {
    let meets = |[a, b, c]: [Vec3; 3]| {
        let from = ray.from - a;
        if from.cross(ray.along).length_squared() > reach_mm * reach_mm {
            return None;
        }
        let (ab, ac) = (b - a, c - a);
        let (normal, turn) = (ab.cross(ac), from.cross(ray.along));
        let facing = -normal.dot(ray.along);
        let (u, v) = (ac.dot(turn), -ab.dot(turn));
        let distance_mm = from.dot(normal) / facing;
        let inside = facing > 1e-9 && u >= 0.0 && v >= 0.0 && u + v <= facing;
        let meets = inside && (0.0..=ray.reach_mm).contains(&distance_mm);
        meets.then(|| SurfaceHit { distance_mm, normal: normal.normalize_or(-ray.along) })
    };
    triangles.filter_map(meets).min_by(|a, b| a.distance_mm.total_cmp(&b.distance_mm))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::IVec3;
    use trepan_volume::{AIR_HU, VoxelVolume};

    fn ray(from: Vec3, along: Vec3) -> Ray {
        Ray { from, along: along.normalize(), reach_mm: 90.0, bone: true, brain: true }
    }

    #[test]
    fn a_ray_meets_bone_from_outside_where_it_is_and_goes_through_a_hole() {
        let mut ct = VoxelVolume::isotropic([30; 3], Vec3::splat(-15.0), 1.0, AIR_HU);
        for at in 0..ct.data.len() {
            if (8..14).contains(&(at / 900)) {
                ct.data[at] = 1000;
            }
        }
        let bone = BoneVolume::new(&ct, 0).unwrap();
        let top = -15.0 + 13.5;
        let hit = of_bone(&bone, &ray(Vec3::new(0.2, 0.1, 40.0), Vec3::NEG_Z)).unwrap();
        assert!((hit.distance_mm - (40.0 - top)).abs() < 0.05 && hit.normal.z > 0.99, "{hit:?}");
        let slanted = of_bone(&bone, &ray(Vec3::new(0.0, 0.0, 10.0), Vec3::new(0.5, 0.0, -1.0))).unwrap();
        assert!((slanted.distance_mm - (10.0 - top) * 1.25f32.sqrt()).abs() < 0.1, "{slanted:?}");
        assert_eq!(of_bone(&bone, &ray(Vec3::new(0.2, 0.1, -4.0), Vec3::NEG_Z)), None, "from within");
        let below = |z: f32| below_mm(&bone, Vec3::new(0.2, 0.1, z), Vec3::NEG_Z);
        assert!((below(40.0) - 6.0).abs() < 0.2 && (below(-4.0) - 3.5).abs() < 0.2, "{} {}", below(40.0), below(-4.0));
        for n in 0..30 * 25 {
            bone.set_hu(IVec3::new(13 + n % 5, 13 + n / 5 % 5, n / 25), AIR_HU);
        }
        assert_eq!(of_bone(&bone, &ray(Vec3::new(0.2, 0.1, 40.0), Vec3::NEG_Z)), None, "a hole");
    }

    #[test]
    fn a_ray_meets_the_front_of_the_nearest_triangle() {
        let at = |z: f32| [Vec3::new(-1.0, -1.0, z), Vec3::new(3.0, -1.0, z), Vec3::new(-1.0, 3.0, z)];
        let back = at(4.0).map(|corner| Vec3::new(corner.y, corner.x, corner.z));
        let cast = |from| of_triangles([at(0.0), back, at(-2.0)].into_iter(), 9.0, &ray(from, Vec3::NEG_Z));
        let hit = cast(Vec3::new(0.5, 0.5, 10.0)).unwrap();
        assert!((hit.distance_mm - 10.0).abs() < 1e-5 && hit.normal == Vec3::Z);
        assert_eq!(cast(Vec3::new(2.5, 2.5, 10.0)), None, "beside it");
    }
}
