//! Bone: a ball slides along the skull, by every method on every grid, against the truth.
//!
//! # Theory
//! On a ball of bone the force is known in closed form: `k (R + r - |p|)` along the radius. On a skull it is that of the recommended method on voxels of 0.25 mm
//! of the same CT, trilinear between its samples. The error of a tick is the length of the difference of both forces; of a choice it is that which 95 of 100 ticks in touch
//! stay within. Cost is time a tick, measured where rows are made only.

use super::case::Case;
use super::scene::Situation;
use crate::timer::Samples;
use glam::DAffine3;
use std::time::Instant;
use trepan_budget::Bone;
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_rigid::{Method, RigidStep, thesis};
use trepan_volume::{AIR_HU, BoneVolume, Grid, Interpolation, VoxelVolume, resample};

/// Edges of voxels, mm.
const SPACINGS: [f64; 10] = [0.35, 0.42, 0.5, 0.6, 0.75, 0.85, 1.0, 1.25, 1.5, 2.0];
/// Points of the thesis's shell.
const POINTS: [usize; 3] = [211, 466, 932];
/// Edge of the truth's voxels, mm.
const FINE_MM: f32 = 0.25;
/// Ticks of going in and of sliding.
const TICKS: [usize; 2] = [120, 240];
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

/// The method of a choice.
pub fn method(bone: &Bone) -> Method {
    match bone.points {
        0 => Method::named(bone.method).expect("a stored method exists"),
        points => Method::Thesis(thesis::Config { points, ..thesis::Config::default() }),
    }
}

/// What a choice came to.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// Error of the force, N.
    pub error_n: f64,
    /// Median tick, µs.
    pub tick_us: f64,
}

/// A stretch of skull and a path over it.
pub struct Stretch {
    fine: BoneVolume,
    around: Grid,
    path: Vec<ToolState>,
    truth: Vec<Vec3>,
    situation: Situation,
}

impl Stretch {
    /// Cuts it out; `None` where there is too little bone under the path.
    pub fn of(case: &Case, situation: &Situation) -> Option<Self> {
        let fine = cut_out(case, situation.bone_site, FINE_MM)?;
        let surface = Surface::of(&fine, situation)?;
        let path = path(&surface, situation)?;
        let around = Grid::of(&fine.snapshot());
        let mut stretch = Self { fine, around, path, truth: Vec::new(), situation: situation.clone() };
        stretch.truth = match case.ball {
            Some((middle, radius)) => stretch.on_a_ball(middle.as_vec3(), radius),
            None => stretch.ride(&Method::RECOMMENDED, &stretch.fine).0,
        };
        (stretch.truth.iter().filter(|force| **force != Vec3::ZERO).count() > TICKS[1] / 2).then_some(stretch)
    }

    /// Forces on a ball of bone in closed form, N.
    fn on_a_ball(&self, middle: Vec3, radius: f64) -> Vec<Vec3> {
        let scene = &self.situation.scene;
        let force = |tool: &ToolState| {
            let away = (tool.tip() - middle).as_dvec3();
            let depth = (radius + scene.tool_radius_mm - away.length()).max(0.0);
            (scene.stiffness * depth * away.normalize()).as_vec3()
        };
        self.path.iter().map(force).collect()
    }

    /// Forces along the path, N, and the median tick, µs.
    fn ride(&self, method: &Method, bone: &BoneVolume) -> (Vec<Vec3>, f64) {
        let mut contact = method.build(&Tool::burr(self.situation.scene.tool_radius_mm as f32));
        contact.reset(self.path[0].world_from_tool);
        let (mut out, mut us) = (RigidStep::default(), Vec::with_capacity(self.path.len()));
        let stiffness = self.situation.scene.stiffness as f32;
        let tick = |tool: &ToolState| {
            let start = Instant::now();
            contact.step(bone, tool, false, 1.0, &mut out);
            us.push(start.elapsed().as_secs_f64() * 1e6);
            stiffness * out.manifold.depth_mm * out.manifold.normal
        };
        let forces = self.path.iter().map(tick).collect();
        (forces, Samples::from(us).quantile(0.5))
    }

    /// Every choice, in the order given; the grid of each edge is made once.
    pub fn measure(&self, case: &Case, choices: &[Bone]) -> Vec<Found> {
        let mut grids: Vec<(f64, Option<BoneVolume>)> = Vec::new();
        let mut found = Vec::new();
        for choice in choices {
            if !grids.iter().any(|(edge, _)| *edge == choice.spacing_mm) {
                let cut = cut_out(case, self.situation.bone_site, choice.spacing_mm as f32);
                grids.push((choice.spacing_mm, cut));
            }
            let grid = grids.iter().find(|(edge, _)| *edge == choice.spacing_mm);
            // Where a coarse grid holds no voxel of bone, nothing is felt.
            let (forces, tick_us) = match grid.and_then(|(_, bone)| bone.as_ref()) {
                Some(bone) => self.ride(&method(choice), bone),
                None => (vec![Vec3::ZERO; self.path.len()], f64::NAN),
            };
            found.push(Found { error_n: self.error_n(&forces), tick_us });
        }
        found
    }

    /// What 95 of 100 ticks in touch stay within, N.
    fn error_n(&self, forces: &[Vec3]) -> f64 {
        let both = forces.iter().zip(&self.truth).filter(|(a, b)| **a != Vec3::ZERO || **b != Vec3::ZERO);
        Samples::from(both.map(|(a, b)| f64::from(a.distance(*b))).collect::<Vec<_>>()).quantile(0.95)
    }

    /// The truth beside the oracle on the same voxels: what 95 of every `n`th ticks stay within, N.
    pub fn oracle_error_n(&self, n: usize) -> f64 {
        let thinned: Vec<ToolState> = self.path.iter().copied().step_by(n).collect();
        let oracle = Self { path: thinned, truth: self.truth.iter().copied().step_by(n).collect(), ..self.like() };
        oracle.error_n(&oracle.ride(&Method::named("brute").expect("the oracle is a method"), &oracle.fine).0)
    }

    /// The same with a volume of its own and no path.
    fn like(&self) -> Self {
        let fine = BoneVolume::new(&self.fine.snapshot(), self.fine.isovalue()).expect("it was made once");
        let situation = self.situation.clone();
        Self { fine, around: self.around, path: Vec::new(), truth: Vec::new(), situation }
    }
}

/// The voxels of a session's grid around a place.
fn cut_out(case: &Case, place: Vec3, edge_mm: f32) -> Option<BoneVolume> {
    let whole = Grid::isotropic_over(&case.ct, edge_mm);
    let middle = whole.world_from_voxel.inverse().transform_point3(place.as_dvec3()).round();
    let room = f64::from(ROOM_MM / edge_mm).ceil();
    let world_from_voxel = whole.world_from_voxel * DAffine3::from_translation(middle - room);
    let grid = Grid { dims: [2 * room as usize + 1; 3], world_from_voxel };
    let cut: VoxelVolume<i16> = resample(&case.ct, &grid, Interpolation::Trilinear, AIR_HU);
    BoneVolume::new(&cut, case.isovalue).ok()
}

/// The surface around an opening as a height over the plane of its normal.
struct Surface<'a> {
    bone: &'a BoneVolume,
    place: Vec3,
    normal: Vec3,
}

impl<'a> Surface<'a> {
    fn of(bone: &'a BoneVolume, situation: &Situation) -> Option<Self> {
        let mut surface = Self { bone, place: situation.bone_site, normal: situation.towards };
        surface.place += surface.height(Vec3::ZERO)? * surface.normal;
        // The plane through heights 3 mm around.
        let (a, b) = surface.normal.any_orthonormal_pair();
        let slope = |along: Vec3| Some((surface.height(3.0 * along)? - surface.height(-3.0 * along)?) / 6.0);
        let normal = (surface.normal - slope(a)? * a - slope(b)? * b).normalize();
        (normal.dot(situation.towards) > 0.6).then_some(Self { normal, ..surface })
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
fn path(surface: &Surface, situation: &Situation) -> Option<Vec<ToolState>> {
    let (radius, press) = (situation.scene.tool_radius_mm as f32, situation.scene.press_mm as f32);
    let along = situation.along(surface.normal);
    let places = 24;
    let heights: Vec<f32> = (0..=places)
        .map(|n| surface.height(situation.slide_mm * n as f32 / places as f32 * along))
        .collect::<Option<_>>()?;
    let smooth = |n: usize| {
        let near = &heights[n.saturating_sub(2)..(n + 3).min(heights.len())];
        near.iter().sum::<f32>() / near.len() as f32
    };
    let at = |share: f32, depth: f32| {
        let (n, part) = ((share * places as f32) as usize, (share * places as f32).fract());
        let height = smooth(n) * (1.0 - part) + smooth((n + 1).min(places)) * part;
        let tip = surface.place + share * situation.slide_mm * along + (height + radius - depth) * surface.normal;
        let turn = glam::Quat::from_rotation_arc(Vec3::Z, surface.normal);
        ToolState::at(Pose::from_parts(tip, turn))
    };
    let way_in = (0..TICKS[0]).map(|n| at(0.0, -1.0 + (1.0 + press) * n as f32 / TICKS[0] as f32));
    let slide = (0..TICKS[1]).map(|n| at(n as f32 / TICKS[1] as f32, press));
    Some(way_in.chain(slide).collect())
}

/// Median tick of `distance-field` with a burr of 3 mm on 0.5 mm voxels, as a machine is measured, µs.
pub fn unit_us() -> f64 {
    let edge = 64;
    let mut ct = VoxelVolume::isotropic([edge; 3], Vec3::splat(-15.75), 0.5, 0i16);
    for at in 0..ct.data.len() {
        let z = -15.75 + 0.5 * (at / (edge * edge)) as f32;
        ct.data[at] = (400.0 - 2000.0 * z).clamp(-1000.0, 1500.0) as i16;
    }
    let bone = BoneVolume::new(&ct, 400).expect("half of the box is bone");
    let mut contact = Method::RECOMMENDED.build(&Tool::burr(3.0));
    contact.reset(Pose::from_translation(Vec3::Z * 4.0));
    let mut out = RigidStep::default();
    let tick = |n: usize| {
        let tip = Vec3::new(4.0 * (n as f32 * 0.02).sin(), 0.3, 2.5);
        contact.step(&bone, &ToolState::at(Pose::from_translation(tip)), false, 1.0, &mut out);
    };
    Samples::of(400, tick).quantile(0.5)
}
