//! Bone: a ball slides along the skull and a burr cuts into it, by every method on every grid,
//! against fine voxels of the same CT.
//!
//! # Theory
//! The truth is the force by the oracle on voxels of 0.25 mm of the same CT, trilinear between its
//! samples. The error of a tick is the length of the difference of both forces; of a choice it is
//! that which 95 of 100 ticks in touch stay within, sliding or cutting, whichever is worse. A tool
//! whose centre comes under the surface, pressed in or led through a ridge, may leave by more ways
//! than one, and methods that are both right choose differently: it is led no deeper than its
//! radius. Nor much deeper than the scene says: at a ridge a hand gives way, which a path cannot.
//!
//! # When not to use it
//! To know how right the CT is: what the scanner has blurred, nobody knows.

use super::quantile;
use crate::run::clock::Clock;
use glam::DAffine3;
use trepan_budget::{Bone, Scene};
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_rigid::{Method, RigidStep};
use trepan_volume::{AIR_HU, BoneVolume, Grid, Interpolation, VoxelVolume, resample};

/// Edges of voxels, mm.
const SPACINGS: [f64; 10] = [0.35, 0.42, 0.5, 0.6, 0.75, 0.85, 1.0, 1.25, 1.5, 2.0];
/// Points of the thesis's shell.
const POINTS: [usize; 3] = [211, 466, 932];
/// Edge of the truth's voxels, mm.
const FINE_MM: f32 = 0.25;
/// Ticks of going in and of sliding.
const TICKS: [usize; 2] = [120, 240];
/// How deep it may come where the bone rises into its way, over how deep it is pressed.
const RIDGE: f64 = 1.5;
/// How deep the burr is led while it cuts, mm, and how fast, mm/ms: what a scripted hand does.
const DRILL: [f32; 2] = [1.5, 1.4e-3];
/// Least radius of a burr whose cut the truth's voxels resolve, mm.
const LEAST_CUT_MM: f64 = 4.0 * FINE_MM as f64;
/// Half the edge of what is cut out of the skull around the opening, mm.
const ROOM_MM: f32 = 18.0;

/// Every choice: all methods in real time on all grids.
pub fn choices() -> Vec<Bone> {
    let methods = Method::all().into_iter().filter(|m| m.name() != "brute").map(|m| m.name());
    let with = |method: &'static str| match method {
        "thesis" => POINTS.to_vec(),
        _ => vec![0],
    };
    let all = methods.flat_map(|method| with(method).into_iter().map(move |points| (method, points)));
    all.flat_map(|(method, points)| SPACINGS.map(|spacing_mm| Bone { method, spacing_mm, points })).collect()
}

/// The method of a choice; `None` where there is no such.
fn method(bone: &Bone) -> Option<Method> {
    Method::named(bone.method).map(|method| method.with_points(bone.points))
}

/// What a choice came to.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// Error of the force, N.
    pub error_n: f64,
    /// Median tick, µs.
    pub tick_us: f64,
}

/// A skull as the scanner saw it.
#[derive(Clone, Debug)]
pub struct Skull {
    /// HU, nothing but the skull, on the scanner's own grid.
    pub ct: VoxelVolume<i16>,
    /// Where bone begins, HU.
    pub isovalue: i16,
}

/// A tool pressed into bone and led along it.
#[derive(Clone, Copy, Debug)]
pub struct Slide {
    /// Radius, depth and stiffness are taken from here.
    pub scene: Scene,
    /// Where it is pressed in.
    pub place: Vec3,
    /// About the way out of the bone there, a unit vector.
    pub outward: Vec3,
    /// Way along the surface: turn around the normal, rad.
    pub turn_rad: f32,
    /// How far it is led, mm.
    pub length_mm: f32,
}

impl Slide {
    /// A unit vector at right angles to a normal, along which it goes.
    pub fn along(&self, normal: Vec3) -> Vec3 {
        let (a, b) = normal.any_orthonormal_pair();
        self.turn_rad.cos() * a + self.turn_rad.sin() * b
    }
}

/// A stretch of skull, ways over and into it, and what is felt there.
pub struct Stretch {
    fine: BoneVolume,
    slide: Slide,
    ways: Vec<Way>,
}

/// Where the tool is at each tick, whether it cuts, and the true forces, N.
struct Way {
    path: Vec<ToolState>,
    cuts: bool,
    truth: Vec<Vec3>,
}

impl Stretch {
    /// Cuts it out, with a way along it; `None` where there is too little bone under that, or so
    /// much that the tool comes far deeper than it is pressed, or its centre under the surface.
    pub fn of(skull: &Skull, slide: &Slide) -> Option<Self> {
        let fine = cut_out(skull, slide.place, FINE_MM)?;
        let path = path(&Surface::of(&fine, slide)?, slide)?;
        let stretch = Self { fine, slide: *slide, ways: Vec::new() }.with(path, false);
        let deep = stretch.ways[0].truth.iter().map(|force| f64::from(force.length()) / slide.scene.stiffness);
        let (touches, deepest) = (deep.clone().filter(|mm| *mm > 0.0).count(), deep.fold(0.0, f64::max));
        let deepest_allowed = slide.scene.tool_radius_mm.min(RIDGE * slide.scene.press_mm);
        (touches > TICKS[1] / 2 && deepest <= deepest_allowed).then_some(stretch)
    }

    /// With a cut straight in from just outside; without one for a burr under 1 mm in radius, which
    /// the truth's voxels do not resolve.
    pub fn cutting(self) -> Self {
        if self.slide.scene.tool_radius_mm < LEAST_CUT_MM {
            return self;
        }
        let path = &self.ways[0].path;
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

    /// With one more way.
    fn with(mut self, path: Vec<ToolState>, cuts: bool) -> Self {
        let truth = self.ride(&Method::Brute(Default::default()), &self.fine, &path, cuts).0;
        self.ways.push(Way { path, cuts, truth });
        self
    }

    /// Forces along a path, N, and the median tick, µs. What is cut on the way is there again
    /// afterwards.
    fn ride(&self, method: &Method, bone: &BoneVolume, path: &[ToolState], cuts: bool) -> (Vec<Vec3>, f64) {
        let mut contact = method.build(&Tool::burr(self.slide.scene.tool_radius_mm as f32));
        contact.reset(path[0].world_from_tool);
        let (mut out, mut us, clock) = (RigidStep::default(), Vec::with_capacity(path.len()), Clock::start());
        let stiffness = self.slide.scene.stiffness as f32;
        let tick = |tool: &ToolState| {
            let began_ms = clock.now_ms();
            contact.step(bone, tool, cuts, 1.0, &mut out);
            us.push(1e3 * (clock.now_ms() - began_ms));
            stiffness * out.manifold.depth_mm * out.manifold.normal
        };
        if cuts {
            bone.begin_stroke();
        }
        let forces = path.iter().map(tick).collect();
        if cuts {
            bone.undo_stroke();
        }
        (forces, quantile(us, 0.5))
    }

    /// Every choice, in the order given: the worst error of all ways, the tick of the first. The
    /// grid of each edge is made once.
    pub fn measure(&self, skull: &Skull, choices: &[Bone]) -> Vec<Measurement> {
        let mut grids: Vec<(f64, Option<BoneVolume>)> = Vec::new();
        let mut found = Vec::new();
        for choice in choices {
            if !grids.iter().any(|(edge, _)| *edge == choice.spacing_mm) {
                let cut = cut_out(skull, self.slide.place, choice.spacing_mm as f32);
                grids.push((choice.spacing_mm, cut));
            }
            let grid = grids.iter().find(|(edge, _)| *edge == choice.spacing_mm);
            let along = |way: &Way| {
                // Where a coarse grid holds no voxel of bone, nothing is felt.
                let (forces, tick_us) = match (grid.and_then(|(_, bone)| bone.as_ref()), method(choice)) {
                    (Some(bone), Some(method)) => self.ride(&method, bone, &way.path, way.cuts),
                    _ => (vec![Vec3::ZERO; way.path.len()], f64::NAN),
                };
                Measurement { error_n: error_n(&forces, &way.truth), tick_us }
            };
            let worse = |a: Measurement, b: Measurement| Measurement { error_n: a.error_n.max(b.error_n), ..a };
            found.extend(self.ways.iter().map(along).reduce(worse));
        }
        found
    }

    /// The recommended method on the truth's own voxels, sliding: what 95 of 100 ticks stay within,
    /// N.
    pub fn recommended_error_n(&self) -> f64 {
        let Way { path, cuts, truth } = &self.ways[0];
        error_n(&self.ride(&Method::RECOMMENDED, &self.fine, path, *cuts).0, truth)
    }

    /// The truth beside forces known otherwise, `of` a place of the tool, sliding: what 95 of 100
    /// ticks stay within, N.
    pub fn known_error_n(&self, of: impl Fn(Vec3) -> Vec3) -> f64 {
        let Way { path, truth, .. } = &self.ways[0];
        error_n(&path.iter().map(|tool| of(tool.tip())).collect::<Vec<_>>(), truth)
    }
}

/// What 95 of 100 ticks in touch stay within, N.
fn error_n(forces: &[Vec3], truth: &[Vec3]) -> f64 {
    let both = forces.iter().zip(truth).filter(|(a, b)| **a != Vec3::ZERO || **b != Vec3::ZERO);
    quantile(both.map(|(a, b)| f64::from(a.distance(*b))).collect(), 0.95)
}

/// The voxels of a session's grid around a place.
fn cut_out(skull: &Skull, place: Vec3, edge_mm: f32) -> Option<BoneVolume> {
    let whole = Grid::isotropic_over(&skull.ct, edge_mm);
    let middle = whole.world_from_voxel.inverse().transform_point3(place.as_dvec3()).round();
    let room = f64::from(ROOM_MM / edge_mm).ceil();
    let world_from_voxel = whole.world_from_voxel * DAffine3::from_translation(middle - room);
    let grid = Grid { dims: [2 * room as usize + 1; 3], world_from_voxel };
    let cut: VoxelVolume<i16> = resample(&skull.ct, &grid, Interpolation::Trilinear, AIR_HU);
    BoneVolume::new(&cut, skull.isovalue).ok()
}

/// The surface around an opening as a height over the plane of its normal.
struct Surface<'a> {
    bone: &'a BoneVolume,
    place: Vec3,
    normal: Vec3,
}

impl<'a> Surface<'a> {
    fn of(bone: &'a BoneVolume, slide: &Slide) -> Option<Self> {
        let mut surface = Self { bone, place: slide.place, normal: slide.outward };
        surface.place += surface.height(Vec3::ZERO)? * surface.normal;
        // The plane through heights 3 mm around.
        let (a, b) = surface.normal.any_orthonormal_pair();
        let slope = |along: Vec3| Some((surface.height(3.0 * along)? - surface.height(-3.0 * along)?) / 6.0);
        let normal = (surface.normal - slope(a)? * a - slope(b)? * b).normalize();
        (normal.dot(slide.outward) > 0.6).then_some(Self { normal, ..surface })
    }

    /// Height of the outermost bone over a place of the plane, mm.
    fn height(&self, aside: Vec3) -> Option<f32> {
        let step = 0.5 * self.bone.spacing_mm();
        let over = |height: f32| {
            density(self.bone, self.place + aside + height * self.normal) - f32::from(self.bone.isovalue())
        };
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

/// Trilinear density, HU.
fn density(bone: &BoneVolume, place: Vec3) -> f32 {
    let grid = bone.grid_of(place);
    let (low, share) = (grid.floor().as_ivec3(), grid - grid.floor());
    let corner = |n: i32| {
        let bit = glam::IVec3::new(n & 1, n >> 1 & 1, n >> 2);
        let part = Vec3::select(bit.cmpeq(glam::IVec3::ONE), share, 1.0 - share);
        part.x * part.y * part.z * f32::from(bone.hu(low + bit))
    };
    (0..8).map(corner).sum()
}

/// In along the normal, then along the surface at the same depth under its smoothed height.
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

    /// Bone under z = 0, and under z = 3 mm where x is over 3 mm.
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
    fn a_burr_is_not_led_into_a_step_deeper_than_it_is_pressed() {
        let skull = step();
        let led = |turn_rad: f32, press_mm: f64| {
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
        assert!(led(into.unwrap(), 0.5).is_none(), "a wall stands in the way");
        let flat = led(away.unwrap(), 0.5).expect("flat bone is one");
        let error_mm = flat.known_error_n(|tip| Vec3::Z * (2.0 - tip.z).max(0.0) * flat.slide.scene.stiffness as f32);
        assert!(error_mm < 0.1, "{error_mm}");
    }
}
