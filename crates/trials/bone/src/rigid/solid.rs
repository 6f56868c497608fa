//! Bone with a closed form: its voxels, a way of the hand over it, and what a ball must feel there,
//! in f64.
//!
//! # Theory
//! A ball of radius r whose centre c is pressed past the surface is held at the nearest place where
//! the distance d to the bone is r. Where that place is unique,
//! ```text
//! depth = r - d(c),   normal = ∇d(c)
//! ```
//! A slot as wide as the ball leaves it a plane, a round pit a smaller pit: there the nearest place
//! is given directly.
//!
//! # Practice
//! Densities fall by 1000 HU a voxel through the surface, over one voxel either side, as in a
//! scanner's blur. The hand comes along the normal and slides, both at 50 mm/s; the shaft stands
//! along the normal, or along the axis where a normal would lead it into bone.

use glam::DVec3;
use trepan_bone::BoneVolume;
use trepan_geometry::{Pointshell, Pose, Quat, Spread, ToolState, Vec3};
use trepan_volume::VoxelVolume;

/// Radius of the ball, mm.
pub const RADIUS_MM: f32 = 3.0;
/// Isovalue of all scenes, HU.
pub const ISO: i16 = 400;
/// Way of the hand in a tick, mm: 50 mm/s.
pub const STEP_MM: f64 = 0.05;
/// Depth of the press, mm.
const PRESS_MM: f64 = 0.6;
/// From where the hand comes, mm above the surface.
const START_MM: f64 = 2.0;
const R: f64 = RADIUS_MM as f64;
const SLIDE_TICKS: usize = 130;
/// Voxels along an axis of a scene's grid.
const EDGE: usize = 64;
/// Middle of all scenes: off the grid's points.
const MIDDLE: DVec3 = DVec3::new(0.11, -0.19, 0.07);

/// What a ball must feel.
#[derive(Clone, Copy, Debug, Default)]
pub struct Touch {
    /// mm; 0 without contact.
    pub depth_mm: f64,
    /// Out of the bone; zero without contact.
    pub normal: DVec3,
}

/// One tick of the hand.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Where the hand holds the tool.
    pub tool: ToolState,
    /// What it must feel.
    pub truth: Touch,
    /// Whether the hand slides, no longer comes.
    pub slides: bool,
}

/// Bone and a way over it.
pub struct Scene {
    /// The bone.
    pub bone: BoneVolume,
    /// The way.
    pub path: Vec<Moment>,
}

/// A sort of bone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kind {
    /// Which scenes share a chart.
    pub group: &'static str,
    /// Its name.
    pub name: &'static str,
    /// Edge of a voxel, mm.
    pub voxel_mm: f64,
    shape: Shape,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    HalfSpace,
    /// So many voxels thick.
    Wall(f64),
    Sphere,
    Box,
    ShellOutside,
    ShellInside,
    Slot,
    Pit,
}

const SPHERE_MM: f64 = 10.0;
const BOX_MM: f64 = 8.0;
const SHELL_MM: (f64, f64) = (10.0, 6.0);
const PIT_MM: (f64, f64) = (4.0, 5.0);

/// Every sort.
pub const KINDS: [Kind; 13] = [
    kind("planes", "half-space, 0.5 mm voxels", 0.5, Shape::HalfSpace),
    kind("planes", "half-space, 1 mm voxels", 1.0, Shape::HalfSpace),
    kind("solids", "sphere", 0.5, Shape::Sphere),
    kind("solids", "cylinder shell, outside", 0.5, Shape::ShellOutside),
    kind("solids", "cylinder shell, inside", 0.5, Shape::ShellInside),
    kind("solids", "box, over an edge", 0.5, Shape::Box),
    kind("walls", "wall of 1 voxel", 0.5, Shape::Wall(1.0)),
    kind("walls", "wall of 2 voxels", 0.5, Shape::Wall(2.0)),
    kind("walls", "wall of 3 voxels", 0.5, Shape::Wall(3.0)),
    kind("walls", "wall of 4 voxels", 0.5, Shape::Wall(4.0)),
    kind("walls", "wall of 5 voxels", 0.5, Shape::Wall(5.0)),
    kind("confined", "slot as wide as the tool", 0.5, Shape::Slot),
    kind("confined", "pit", 0.5, Shape::Pit),
];

const fn kind(group: &'static str, name: &'static str, voxel_mm: f64, shape: Shape) -> Kind {
    Kind { group, name, voxel_mm, shape }
}

/// The axes of one orientation: z is the normal, or the axis of what has one.
#[derive(Clone, Copy)]
struct Frame {
    x: DVec3,
    y: DVec3,
    z: DVec3,
}

impl Frame {
    fn along(z: DVec3) -> Self {
        let x = z.any_orthonormal_vector();
        Self { x, y: z.cross(x), z }
    }

    fn local(&self, p: DVec3) -> DVec3 {
        let p = p - MIDDLE;
        DVec3::new(p.dot(self.x), p.dot(self.y), p.dot(self.z))
    }

    fn turned(&self, v: DVec3) -> DVec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

/// `count` directions spread evenly over the sphere.
pub fn directions(count: usize) -> Vec<Vec3> {
    Pointshell::sphere(1.0, count, Spread::Fibonacci).points
}

/// Bone of a signed distance in mm, negative inside.
pub fn voxels(edge: usize, voxel_mm: f64, distance: impl Fn(DVec3) -> f64) -> BoneVolume {
    let low = Vec3::splat((-0.5 * (edge as f64 - 1.0) * voxel_mm) as f32);
    let mut ct = VoxelVolume::isotropic([edge; 3], low, voxel_mm as f32, 0i16);
    for at in 0..ct.data.len() {
        let out = distance(ct.centre_of([at % edge, at / edge % edge, at / (edge * edge)])) / voxel_mm;
        ct.data[at] = (f64::from(ISO) - 1000.0 * out.clamp(-1.0, 1.0)).round() as i16;
    }
    BoneVolume::new(&ct, ISO).expect("the scene has bone")
}

/// A tool at rest at `tip`, its shaft along `up`.
pub fn held(tip: Vec3, up: Vec3) -> ToolState {
    ToolState::at(Pose::from_parts(tip, Quat::from_rotation_arc(Vec3::Z, up.normalize_or(Vec3::Z))))
}

impl Kind {
    /// The scene in one orientation.
    pub fn scene(&self, direction: Vec3) -> Scene {
        let frame = Frame::along(direction.as_dvec3().normalize());
        let bone = voxels(EDGE, self.voxel_mm, |p| self.distance(frame.local(p)));
        let press_ticks = ((START_MM + PRESS_MM) / STEP_MM).round() as usize;
        let path = (0..=press_ticks + SLIDE_TICKS)
            .map(|tick| {
                let pressed = STEP_MM * tick.min(press_ticks) as f64 - START_MM;
                let slid = STEP_MM * tick.saturating_sub(press_ticks) as f64;
                let (tip, up) = self.way(pressed, slid);
                let tip = (MIDDLE + frame.turned(tip)).as_vec3();
                let tool = held(tip, frame.turned(up).as_vec3());
                let felt = self.felt(frame.local(tip.as_dvec3()));
                let truth = Touch { normal: frame.turned(felt.normal), ..felt };
                Moment { tool, truth, slides: tick > press_ticks }
            })
            .collect();
        Scene { bone, path }
    }

    /// Signed distance, mm, negative in bone.
    fn distance(&self, p: DVec3) -> f64 {
        let across = p.truncate().length();
        match self.shape {
            Shape::HalfSpace => p.z,
            Shape::Wall(voxels) => p.z.max(-p.z - voxels * self.voxel_mm),
            Shape::Sphere => p.length() - SPHERE_MM,
            Shape::Box => {
                let q = p.abs() - BOX_MM;
                q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
            }
            Shape::ShellOutside | Shape::ShellInside => (across - SHELL_MM.0).max(SHELL_MM.1 - across),
            Shape::Slot => (R - p.x.abs()).max(p.z),
            Shape::Pit => {
                let (wall, floor) = (PIT_MM.0 - across, p.z + PIT_MM.1);
                wall.min(floor).max(p.z)
            }
        }
    }

    /// Where the tip is and where its shaft points to, `pressed` mm deep after `slid` mm of way.
    fn way(&self, pressed: f64, slid: f64) -> (DVec3, DVec3) {
        let height = R - pressed;
        let round = |radius: f64, axial: f64| {
            let (sin, cos) = ((slid * (1.0 - axial * axial).sqrt()) / radius).sin_cos();
            (DVec3::new(radius * cos, radius * sin, slid * axial), DVec3::new(cos, sin, 0.0))
        };
        match self.shape {
            Shape::HalfSpace | Shape::Wall(_) => (DVec3::new(slid, 0.3 * slid, height), DVec3::Z),
            Shape::Sphere => {
                let (sin, cos) = (slid / (SPHERE_MM + height)).sin_cos();
                let up = DVec3::new(sin, 0.0, cos);
                ((SPHERE_MM + height) * up, up)
            }
            Shape::ShellOutside => round(SHELL_MM.0 + height, 0.6),
            Shape::ShellInside => (round(SHELL_MM.1 - height, 0.6).0, DVec3::Z),
            Shape::Box => over_the_edge(height, slid),
            // Down the middle, then against a wall, then along it.
            Shape::Slot => (DVec3::new(pressed.max(0.0), slid, -START_MM - pressed), DVec3::Z),
            Shape::Pit => (DVec3::new(slid.min(PIT_MM.0 - R + PRESS_MM), 0.0, height - PIT_MM.1), DVec3::Z),
        }
    }

    /// What the ball must feel at a place.
    fn felt(&self, p: DVec3) -> Touch {
        match self.shape {
            Shape::Slot => held_at(p, p.with_x(0.0)),
            Shape::Pit => {
                let room = p.truncate().clamp_length_max(PIT_MM.0 - R);
                held_at(p, room.extend(p.z.max(R - PIT_MM.1)))
            }
            _ => {
                let depth_mm = R - self.distance(p);
                if depth_mm <= 0.0 { Touch::default() } else { Touch { depth_mm, normal: self.gradient(p) } }
            }
        }
    }

    /// Direction in which the distance grows, by central differences of 1e-5 mm.
    fn gradient(&self, p: DVec3) -> DVec3 {
        let along = |axis: DVec3| self.distance(p + 1e-5 * axis) - self.distance(p - 1e-5 * axis);
        DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)).normalize_or_zero()
    }
}

/// A ball that the hand has at `device` and bone holds at `proxy`.
fn held_at(device: DVec3, proxy: DVec3) -> Touch {
    let lifted = proxy - device;
    Touch { depth_mm: lifted.length(), normal: lifted.normalize_or_zero() }
}

/// Along the upper face, round the edge, down the side.
fn over_the_edge(height: f64, slid: f64) -> (DVec3, DVec3) {
    const FLAT_MM: f64 = 1.5;
    let arc = height * std::f64::consts::FRAC_PI_2;
    let corner = DVec3::new(BOX_MM, 0.0, BOX_MM);
    if slid <= FLAT_MM {
        (corner + DVec3::new(slid - FLAT_MM, 0.0, height), DVec3::Z)
    } else if slid <= FLAT_MM + arc {
        let (sin, cos) = ((slid - FLAT_MM) / height).sin_cos();
        let up = DVec3::new(sin, 0.0, cos);
        (corner + height * up, up)
    } else {
        (corner + DVec3::new(height, 0.0, FLAT_MM + arc - slid), DVec3::X)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_presses_as_deep_as_it_says_and_its_truth_is_continuous() {
        for kind in KINDS {
            let scene = kind.scene(Vec3::new(0.36, 0.48, 0.8));
            let deepest = scene.path.iter().map(|m| m.truth.depth_mm).fold(0.0, f64::max);
            let least = if kind.name == "pit" { 0.8 } else { 0.6 };
            assert!((deepest - least).abs() < 0.06, "{}: {deepest} mm", kind.name);
            assert!(scene.path[0].truth.depth_mm < 1e-6, "{}", kind.name);
            for pair in scene.path.windows(2) {
                let [a, b] = [0, 1].map(|i| pair[i].truth.depth_mm * pair[i].truth.normal);
                assert!(a.distance(b) < 0.051, "{}: {a} {b}", kind.name);
                assert!(pair[0].tool.tip().distance(pair[1].tool.tip()) < 0.071, "{}", kind.name);
            }
        }
    }
}
