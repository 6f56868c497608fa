//! Measures the force error of each method on each voxel size, against the CT itself. A ball slides
//! along the skull, a burr cuts into it.
//!
//! # Theory
//! The ground truth is [`trepan_rigid::truth`] in f64: a smooth density between the scanner's own
//! voxels, with nothing of any method in it. The error of a tick is the norm of the difference
//! between the forces. That of a choice is the 95th percentile over the ticks in contact, sliding
//! or cutting, whichever is worse. If the tool's centre is below the surface, pressed in or at a
//! ridge, several exits are valid, and correct methods may choose different ones. Hence the path is
//! no deeper than the tool's radius, and not much deeper than the scene's depth: at a ridge a hand
//! yields, which a path cannot.
//!
//! # When not to use it
//! To judge the CT itself: what the scanner has blurred is unknown.

use crate::methods;
use glam::{DAffine3, DVec3};
use trepan_bone::BoneVolume;
use trepan_budget::{Bone, Scene};
use trepan_geometry::{Pose, Tool, ToolState, Vec3, quantile};
use trepan_patient::progress::Stopwatch;
use trepan_rigid::removal::RemovalLaw;
use trepan_rigid::truth::{Ball, Bone as ExactBone, Scan};
use trepan_rigid::{Method, RigidStep};
use trepan_volume::{AIR_HU, Grid, Interpolation, VoxelVolume, resample};

/// Voxel edges, mm.
const SPACINGS: [f64; 10] = [0.35, 0.42, 0.5, 0.6, 0.75, 0.85, 1.0, 1.25, 1.5, 2.0];
/// Numbers of points of method `thesis`.
const POINTS: [usize; 3] = [211, 466, 932];
/// Voxel edge on which a path is laid out, mm.
const FINE_MM: f32 = 0.25;
/// Ticks of pressing in and of sliding.
const TICKS: [usize; 2] = [60, 120];
/// Largest depth where bone rises into the path, as a multiple of the pressed depth.
const RIDGE: f64 = 1.5;
/// Depth of the cut, mm, and its feed, mm/ms, as of a scripted hand.
const DRILL: [f32; 2] = [1.5, 1.4e-3];
/// Half the edge of the block around the opening, mm.
const ROOM_MM: f32 = 18.0;

/// All choices: every real-time method on every voxel size.
pub fn choices() -> Vec<Bone> {
    let methods = methods::bone_contacts().into_iter().filter(|m| !m.descriptor().is_oracle).map(|m| m.name());
    let with = |method: &'static str| match method {
        "thesis" => POINTS.to_vec(),
        _ => vec![0],
    };
    let all = methods.flat_map(|method| with(method).into_iter().map(move |points| (method, points)));
    all.flat_map(|(method, points)| SPACINGS.map(|spacing_mm| Bone { method, spacing_mm, points })).collect()
}

/// Method of a choice; `None` for an unknown name.
fn method(bone: &Bone) -> Option<Method> {
    methods::bone_contact(bone.method).map(|method| method.with_points(bone.points))
}

/// Measured error and time of a choice.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// Force error, N.
    pub error_n: f64,
    /// Mean time of a tick on the path that takes longest, µs: as a rule while it cuts.
    pub tick_us: f64,
}

/// A skull as scanned.
#[derive(Clone, Debug)]
pub struct Skull {
    /// CT in HU on the scanner's grid, skull only.
    pub ct: VoxelVolume<i16>,
    /// Isovalue of bone, HU.
    pub isovalue: i16,
}

/// A tool path: pressed in, then slid along the surface.
#[derive(Clone, Copy, Debug)]
pub struct Slide {
    /// Source of radius, depth and stiffness.
    pub scene: Scene,
    /// Start of the slide, near the surface.
    pub place: Vec3,
    /// Approximate outward normal there, a unit vector.
    pub outward: Vec3,
    /// Direction along the surface: rotation about the normal, rad.
    pub turn_rad: f32,
    /// Length of the slide, mm.
    pub length_mm: f32,
}

impl Slide {
    /// Unit direction of the slide, perpendicular to a normal.
    pub fn along(&self, normal: Vec3) -> Vec3 {
        let (a, b) = normal.any_orthonormal_pair();
        self.turn_rad.cos() * a + self.turn_rad.sin() * b
    }
}

/// A block of skull, with tool paths and their ground-truth forces.
pub struct Stretch<'a> {
    skull: &'a Skull,
    fine: BoneVolume,
    slide: Slide,
    paths: Vec<ToolPath>,
}

/// A tool path: the tool at each tick, whether it cuts, and the ground-truth forces, N.
struct ToolPath {
    path: Vec<ToolState>,
    cuts: bool,
    truth: Vec<Vec3>,
}

impl<'a> Stretch<'a> {
    /// Cuts out the block and adds the slide as a path. `None` if the path has too little contact,
    /// or is much deeper than pressed, or deeper than the tool's radius.
    pub fn of(skull: &'a Skull, slide: &Slide) -> Option<Self> {
        let fine = cut_out(skull, slide.place, FINE_MM)?;
        let path = path(&Surface::of(&fine, slide)?, slide)?;
        let stretch = Self { skull, fine, slide: *slide, paths: Vec::new() }.with(path, false);
        let deep = stretch.paths[0].truth.iter().map(|force| f64::from(force.length()) / slide.scene.stiffness);
        let (touches, deepest) = (deep.clone().filter(|mm| *mm > 0.0).count(), deep.fold(0.0, f64::max));
        let deepest_allowed = slide.scene.tool_radius_mm.min(RIDGE * slide.scene.press_mm);
        (touches > TICKS[1] / 2 && deepest <= deepest_allowed).then_some(stretch)
    }

    /// Adds a straight cut from just outside.
    pub fn cutting(self) -> Self {
        let path = &self.paths[0].path;
        let [outside, inside] = [&path[0], &path[TICKS[0] - 1]];
        let inward = (inside.tip() - outside.tip()).normalize_or_zero();
        let ticks = ((1.0 + DRILL[0]) / DRILL[1]) as usize;
        let first = (0.9 / DRILL[1]) as usize;
        let at = |n: usize| {
            let Pose { translation, rotation, .. } = outside.world_from_tool;
            ToolState::at(Pose::from_parts(translation + n as f32 * DRILL[1] * inward, rotation))
        };
        let path = (first..ticks).map(at).collect();
        self.with(path, true)
    }

    /// Adds a path.
    fn with(mut self, path: Vec<ToolState>, cuts: bool) -> Self {
        let truth = self.exact(&path, cuts);
        self.paths.push(ToolPath { path, cuts, truth });
        self
    }

    /// The ground-truth forces along a path, N.
    fn exact(&self, path: &[ToolState], cuts: bool) -> Vec<Vec3> {
        let Slide { place, scene, .. } = &self.slide;
        let scan = Scan::around(&self.skull.ct, self.skull.isovalue, place.as_dvec3(), ROOM_MM.into());
        let (mut bone, law) = (ExactBone::new(scan), RemovalLaw::RATE);
        let mut ball =
            Ball::new(scene.tool_radius_mm as f32, path.first().map_or(DVec3::ZERO, |tool| tool.tip().as_dvec3()));
        let tick = |tool: &ToolState| {
            let device = tool.tip().as_dvec3();
            let lifted = ball.follow(&bone, device);
            if cuts {
                let axis = (tool.world_from_tool.rotation * Vec3::Z).as_dvec3();
                ball.drill(&mut bone, (device, axis), &law, 1.0);
            }
            (scene.stiffness * lifted).as_vec3()
        };
        path.iter().map(tick).collect()
    }

    /// Forces along a path, N, and the mean time of a tick, µs. Removed bone is restored
    /// afterwards.
    fn follow(&self, method: &Method, bone: &BoneVolume, path: &[ToolState], cuts: bool) -> (Vec<Vec3>, f64) {
        let mut contact = method.build(&Tool::burr(self.slide.scene.tool_radius_mm as f32));
        contact.reset(path[0].world_from_tool);
        let (mut out, mut us, clock) = (RigidStep::default(), 0.0, Stopwatch::start());
        let stiffness = self.slide.scene.stiffness as f32;
        let tick = |tool: &ToolState| {
            let began_ms = clock.now_ms();
            contact.step(bone, tool, cuts, 1.0, &mut out);
            us += 1e3 * (clock.now_ms() - began_ms);
            stiffness * out.manifold.depth_mm * out.manifold.normal
        };
        if cuts {
            bone.begin_stroke();
        }
        let forces = path.iter().map(tick).collect();
        if cuts {
            bone.undo_stroke();
        }
        (forces, us / path.len().max(1) as f64)
    }

    /// Measures each choice, in the order given: the worst error and time of all paths. Each voxel
    /// size is resampled once.
    pub fn measure(&self, choices: &[Bone]) -> Vec<Measurement> {
        let mut grids: Vec<(f64, Option<BoneVolume>)> = Vec::new();
        let mut found = Vec::new();
        for choice in choices {
            if !grids.iter().any(|(edge, _)| *edge == choice.spacing_mm) {
                let cut = cut_out(self.skull, self.slide.place, choice.spacing_mm as f32);
                grids.push((choice.spacing_mm, cut));
            }
            let grid = grids.iter().find(|(edge, _)| *edge == choice.spacing_mm);
            let along = |tool_path: &ToolPath| {
                // A coarse grid without any voxel of bone gives no force.
                let (forces, tick_us) = match (grid.and_then(|(_, bone)| bone.as_ref()), method(choice)) {
                    (Some(bone), Some(method)) => self.follow(&method, bone, &tool_path.path, tool_path.cuts),
                    _ => (vec![Vec3::ZERO; tool_path.path.len()], f64::NAN),
                };
                Measurement { error_n: error_n(&forces, &tool_path.truth), tick_us }
            };
            let worse = |a: Measurement, b: Measurement| Measurement {
                error_n: a.error_n.max(b.error_n),
                tick_us: a.tick_us.max(b.tick_us),
            };
            found.extend(self.paths.iter().map(along).reduce(worse));
        }
        found
    }

    /// Error of the recommended method on voxels of 0.25 mm, sliding, 95th percentile, N.
    pub fn recommended_error_n(&self) -> f64 {
        let ToolPath { path, cuts, truth } = &self.paths[0];
        error_n(&self.follow(&Method::RECOMMENDED, &self.fine, path, *cuts).0, truth)
    }

    /// Error of the ground truth against known forces `of` the tool's position, sliding, 95th
    /// percentile, N.
    pub fn known_error_n(&self, of: impl Fn(Vec3) -> Vec3) -> f64 {
        let ToolPath { path, truth, .. } = &self.paths[0];
        error_n(&path.iter().map(|tool| of(tool.tip())).collect::<Vec<_>>(), truth)
    }
}

/// Force error over the ticks in contact, 95th percentile, N.
fn error_n(forces: &[Vec3], truth: &[Vec3]) -> f64 {
    let both = forces.iter().zip(truth).filter(|(a, b)| **a != Vec3::ZERO || **b != Vec3::ZERO);
    quantile(&mut both.map(|(a, b)| f64::from(a.distance(*b))).collect::<Vec<_>>(), 0.95)
}

/// Resamples the block around a place on the grid of a session.
fn cut_out(skull: &Skull, place: Vec3, edge_mm: f32) -> Option<BoneVolume> {
    let whole = Grid::isotropic_over(&skull.ct, edge_mm);
    let middle = whole.world_from_voxel.inverse().transform_point3(place.as_dvec3()).round();
    let room = f64::from(ROOM_MM / edge_mm).ceil();
    let world_from_voxel = whole.world_from_voxel * DAffine3::from_translation(middle - room);
    let grid = Grid { dims: [2 * room as usize + 1; 3], world_from_voxel };
    let cut: VoxelVolume<i16> = resample(&skull.ct, &grid, Interpolation::Cubic, AIR_HU);
    BoneVolume::new(&cut, skull.isovalue).ok()
}

/// Bone surface around an opening, as a height over its tangent plane.
struct Surface<'a> {
    bone: &'a BoneVolume,
    place: Vec3,
    normal: Vec3,
}

impl<'a> Surface<'a> {
    fn of(bone: &'a BoneVolume, slide: &Slide) -> Option<Self> {
        let mut surface = Self { bone, place: slide.place, normal: slide.outward };
        surface.place += surface.height(Vec3::ZERO)? * surface.normal;
        // The tangent plane through heights at 3 mm distance.
        let (a, b) = surface.normal.any_orthonormal_pair();
        let slope = |along: Vec3| Some((surface.height(3.0 * along)? - surface.height(-3.0 * along)?) / 6.0);
        let normal = (surface.normal - slope(a)? * a - slope(b)? * b).normalize();
        (normal.dot(slide.outward) > 0.6).then_some(Self { normal, ..surface })
    }

    /// Height of the outermost bone over a point of the plane, mm.
    fn height(&self, aside: Vec3) -> Option<f32> {
        let step = 0.5 * self.bone.spacing_mm();
        let over = |height: f32| self.bone.over_isovalue(self.place + aside + height * self.normal);
        let mut height = 10.0;
        while height > -10.0 {
            let (above, below) = (over(height), over(height - step));
            if above < 0.0 && below >= 0.0 {
                return Some(height - step * above / (above - below));
            }
            height -= step;
        }
        None
    }
}

/// Path in along the normal, then along the surface at constant depth below its smoothed height.
fn path(surface: &Surface, slide: &Slide) -> Option<Vec<ToolState>> {
    let (radius, press) = (slide.scene.tool_radius_mm as f32, slide.scene.press_mm as f32);
    let along = slide.along(surface.normal);
    let places = 24;
    let heights: Vec<f32> = (0..=places)
        .map(|n| surface.height(slide.length_mm * n as f32 / places as f32 * along))
        .collect::<Option<_>>()?;
    let smooth = |n: usize| {
        let near = &heights[n.saturating_sub(2)..(n + 3).min(heights.len())];
        near.iter().sum::<f32>() / near.len() as f32
    };
    let at = |share: f32, depth: f32| {
        let (n, part) = ((share * places as f32) as usize, (share * places as f32).fract());
        let height = smooth(n) * (1.0 - part) + smooth((n + 1).min(places)) * part;
        let tip = surface.place + share * slide.length_mm * along + (height + radius - depth) * surface.normal;
        let turn = glam::Quat::from_rotation_arc(Vec3::Z, surface.normal);
        ToolState::at(Pose::from_parts(tip, turn))
    };
    let way_in = (0..TICKS[0]).map(|n| at(0.0, -1.0 + (1.0 + press) * n as f32 / TICKS[0] as f32));
    let along_it = (0..TICKS[1]).map(|n| at(n as f32 / TICKS[1] as f32, press));
    Some(way_in.chain(along_it).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bone below z = 0, and below z = 3 mm where x is over 3 mm.
    fn step() -> Skull {
        let edge = 90;
        let mut ct = VoxelVolume::isotropic([edge; 3], Vec3::splat(-22.25), 0.5, 0i16);
        for at in 0..ct.data.len() {
            let place = ct.centre_of([at % edge, at / edge % edge, at / (edge * edge)]);
            let over = place.z.min((place.z - 3.0).max(3.0 - place.x));
            ct.data[at] = (400.0 - 600.0 * over).clamp(-1000.0, 1500.0) as i16;
        }
        Skull { ct, isovalue: 400 }
    }

    #[test]
    fn a_path_into_a_step_is_refused() {
        let skull = step();
        let path_along = |turn_rad: f32, press_mm: f64| {
            let scene = Scene { tool_radius_mm: 2.0, press_mm, ..Scene::default() };
            Stretch::of(&skull, &Slide { scene, place: Vec3::ZERO, outward: Vec3::Z, turn_rad, length_mm: 5.0 })
        };
        let towards_x = |turn: f32| {
            let (a, b) = Vec3::Z.any_orthonormal_pair();
            turn.cos() * a.x + turn.sin() * b.x
        };
        let turns = [0.0, 0.5, 1.0, 1.5].map(|half| half * core::f32::consts::PI);
        let (into, away) =
            (turns.into_iter().find(|t| towards_x(*t) > 0.9), turns.into_iter().find(|t| towards_x(*t) < -0.9));
        assert!(path_along(into.unwrap(), 0.5).is_none(), "a wall stands in the way");
        let flat = path_along(away.unwrap(), 0.5).expect("flat bone is one");
        let error_mm = flat.known_error_n(|tip| Vec3::Z * (2.0 - tip.z).max(0.0) * flat.slide.scene.stiffness as f32);
        assert!(error_mm < 0.1, "{error_mm}");
    }
}
