//! A tool pressed along its axis into a round block: by symmetry the force is axial, and an
//! independent code knows its size.
//!
//! # Theory
//! The block of brain is 30 mm in radius and depth, fixed below and free above and at the side. The
//! truth is `fixtures/fem/axial.csv` by `axial.py`: quadrilaterals in axial symmetry, quadratic
//! displacements and discontinuous linear pressure, Newton's method, f64, augmented Lagrange
//! against the exact ball, with and without a membrane on the top; its two finest meshes agree
//! within 0.5 percent. It has no friction. The
//! tool goes on its way as a hand does, at 40 mm/s, and rests at each depth. A tool that came on an
//! oblique way without friction is where an upright one would be at the same place.
//!
//! # Practice
//! TLED steps as in a session: law, element, mass scaling and contact of `auto`, without
//! relaxation, collision once in a millisecond. Beyond two radii a press without friction has no
//! proven truth; there only direction, rest and inverted elements are judged. Other stiffnesses of
//! the contact are charted, not judged.

mod moved;

use super::Scope;
use super::outside::{Shape, Size};
use anyhow::{Context, Result};
use trepan_contact::NodalContacts;
use trepan_deformable::{TissueCollision, TissueStep};
use trepan_evidence::part::Part;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Pose, Quat, Tool, ToolState, Twist, Vec3, quantile};
use trepan_mesh::{TetMesh, lattice};
use trepan_models::Ingredients;
use trepan_models::measure::tissue::MASS_ADDED;
use trepan_soft::{Body, Loads, Material, Membrane, SoftSolver, boxes};
use trepan_tled::{Config, Damping, Tled};
use trepan_volume::VoxelVolume;

/// Radius and depth of the block, mm, and edge of its voxels, mm.
const BLOCK_MM: f32 = 30.0;
const VOXEL_MM: f32 = 1.0;
/// Speed of the tool, mm/ms, its distance before the touch, mm, and rest at each depth, ms.
const SPEED: f32 = 0.04;
const BEFORE_MM: f32 = 0.5;
const REST_MS: u32 = 200;
/// End of that rest in which the force must stay what it is, ms.
const STILL_MS: usize = 50;
/// Force from which its direction counts, N.
const FELT_N: f32 = 0.01;
/// A session's share of added mass is one of the whole brain, and nearly all of it lies on the
/// small elements at the opening. With so many times that share the block's top is as heavy: its
/// stable step is that of a session's mesh of 12,000 tetrahedra, 0.24 ms.
const BRAIN_OVER_BLOCK: f32 = 6.0;
/// The middle of the block's top lies so far from the tool's way, mm: no node is special.
const ASIDE: Vec3 = Vec3::new(0.31, 0.17, 0.0);

/// Published shear stiffness of human pia-arachnoid, N/mm: modulus times thickness.
fn pia_arachnoid_n_per_mm() -> f32 {
    trepan_measurements::brain_membranes::PIA_SHEAR_STIFFNESS.f32()
}

/// What is pressed, and how.
#[derive(Clone, Copy)]
struct Scene {
    name: &'static str,
    tool: Tool,
    friction: f32,
    /// Angle between the way and the axis, degrees.
    oblique_deg: f32,
    /// It rests at every millimetre down to this depth.
    deepest_mm: u32,
    /// The deepest that the truth has, mm.
    truth_mm: u32,
    /// Stiffness of the contact, N/mm for each mm².
    stiffness_per_mm2: f32,
    /// Added mass over a session's share of it.
    heavier: f32,
    /// Shear stiffness of the membrane on the top, N/mm.
    membrane_n_per_mm: f32,
    /// Time from one collision step to the next where a hand presses, ms.
    collision_ms: u64,
}

impl Scene {
    /// An upright press with a tool, as a session's friction has it.
    fn pressed(name: &'static str, tool: Tool) -> Self {
        Self {
            name,
            tool,
            friction: Ingredients::default().friction,
            oblique_deg: 0.0,
            deepest_mm: 8,
            truth_mm: tool.tip_radius_mm as u32 * 2,
            stiffness_per_mm2: USUAL,
            heavier: 1.0,
            membrane_n_per_mm: 0.0,
            collision_ms: 1,
        }
    }

    fn as_in_session(self) -> Self {
        Self { heavier: BRAIN_OVER_BLOCK, ..self }
    }

    fn on_pia_arachnoid(self) -> Self {
        Self { membrane_n_per_mm: pia_arachnoid_n_per_mm(), ..self }
    }

    fn all() -> Vec<Self> {
        let rod = |radius: f32| Tool { shaft_radius_mm: radius, ..Tool::probe(radius) };
        let (probe, spatula) = (Tool::probe(2.0), Tool::spatula());
        let pressed = Self::pressed;
        let thick = |name| Self { truth_mm: 8, ..pressed(name, rod(5.0)) };
        let oblique = |name, tool| Self { friction: 0.0, oblique_deg: 30.0, deepest_mm: 4, ..pressed(name, tool) };
        vec![
            pressed("rod of 2 mm", rod(2.0)),
            thick("rod of 5 mm"),
            pressed("spatula", spatula),
            oblique("probe, 30 degrees", probe),
            oblique("spatula, 30 degrees", spatula),
            pressed("probe, as heavy as in a session", probe).as_in_session(),
            pressed("spatula, as heavy as in a session", spatula).as_in_session(),
            pressed("probe on pia-arachnoid", probe).on_pia_arachnoid(),
            pressed("probe on pia-arachnoid, as heavy as in a session", probe).as_in_session().on_pia_arachnoid(),
            thick("rod of 5 mm on pia-arachnoid, as heavy as in a session").as_in_session().on_pia_arachnoid(),
            pressed("spatula on pia-arachnoid, as heavy as in a session", spatula).as_in_session().on_pia_arachnoid(),
            Self { stiffness_per_mm2: 0.05, ..pressed("probe, soft contact", probe) },
            Self { stiffness_per_mm2: 0.2, ..pressed("probe, stiff contact", probe) },
            pressed("probe", probe),
        ]
    }

    /// Where the tip is when the tool's lowest point is at a depth over the middle, mm.
    fn above(&self, depth_mm: f32) -> Vec3 {
        ASIDE + Vec3::Z * (self.tool.tip_radius_mm - depth_mm)
    }

    /// Direction of the way into the block.
    fn way(&self) -> Vec3 {
        Quat::from_rotation_y(self.oblique_deg.to_radians()) * Vec3::NEG_Z
    }
}

/// Stiffness of the contact that is judged, N/mm for each mm².
const USUAL: f32 = 0.1;

/// Sizes of the block: tetrahedra, and halvings of their edges at the top's middle.
fn sizes(scope: Scope) -> &'static [(usize, u32)] {
    scope.pick(&[(12_000, 3)], &[(8_000, 3), (12_000, 3), (20_000, 3)])
}

/// The part of this suite.
pub fn parts() -> Vec<Part> {
    let of = |scene: Scene| {
        Part::new(format!("axial press: {}", scene.name), move |scope, findings: &mut Findings| {
            for &size in sizes(scope) {
                upright(&scene, size, findings).expect("the fixture and the mesh are sound");
            }
        })
    };
    Scene::all().into_iter().map(of).chain(moved::parts()).collect()
}

/// The block's top at z = 0, its middle at the origin.
fn block((target_tets, halvings): (usize, u32)) -> Result<TetMesh> {
    let (across, high, margin) = (2 * (BLOCK_MM / VOXEL_MM) as usize, (BLOCK_MM / VOXEL_MM) as usize, 2);
    let size = [across + 2 * margin, across + 2 * margin, high + 2 * margin];
    let first = Vec3::new(-BLOCK_MM, -BLOCK_MM, -BLOCK_MM) + VOXEL_MM * (0.5 - margin as f32);
    let mut mask = VoxelVolume::isotropic(size, first, VOXEL_MM, 0u16);
    for at in 0..mask.data.len() {
        let steps = [at % size[0], at / size[0] % size[1], at / (size[0] * size[1])];
        let place = first + VOXEL_MM * Vec3::from_array(steps.map(|n| n as f32));
        let inside = place.truncate().length() < BLOCK_MM && (margin..high + margin).contains(&steps[2]);
        mask.data[at] = u16::from(inside);
    }
    let fine = lattice::Fine { centre: Vec3::Z, radius_mm: 7.0, halvings };
    let config = lattice::Config::with_opening(target_tets, Some(fine));
    Ok(lattice::Domain::of(&mask, &config)?.labelled(&config)?.mesh)
}

/// Mean edge of the surface within 3 mm of the top's middle, mm.
fn edge_mm(mesh: &TetMesh) -> f64 {
    let triangles = trepan_mesh::Surface::of(mesh).triangles.into_iter().map(|t| t.map(|n| mesh.positions[n as usize]));
    let near = triangles.filter(|[a, b, c]| ((*a + *b + *c) / 3.0).length() < 3.0);
    let edges: Vec<f64> =
        near.flat_map(|[a, b, c]| [a.distance(b), b.distance(c), c.distance(a)]).map(f64::from).collect();
    edges.iter().sum::<f64>() / edges.len() as f64
}

/// What was found at one depth.
#[derive(Default)]
struct Found {
    depth_mm: u32,
    force_n: f64,
    tilt_deg: f64,
    /// `None` where only the rest is judged.
    tilt_moving_deg: Option<f64>,
    wander_n: f64,
    /// Depth, mm, and force, N, in the last step at full speed.
    moving: Option<(f64, f64)>,
    inverted: u32,
    skipped_ms: f64,
    /// Force of the truth, N, and its slope, N/mm.
    exact_n: Option<f64>,
    slope: f64,
    collision_us: f64,
    stable_dt_ms: f64,
}

/// Damping of the built-in brain as a session damps it, 1/ms: critical for its lowest mode.
/// Critical damping of the block's own would hold back a moving tool.
fn damping_per_ms() -> Result<f32> {
    let size = Size { count: 3_000, halvings: 0, of_truth: false };
    let brain = Shape::brain()?.pressed(size, false)?.body;
    let body = Body::uniform(brain.mesh, brain.fixed, Material::WHOLE_BRAIN);
    Ok(Tled::new(&body, &Config::default())?.damping_per_ms())
}

/// A scene's tissue and what tests it against the tool.
struct Bench {
    solver: Tled,
    collision: TissueCollision,
    loads: Loads,
    out: TissueStep,
    now_ms: f32,
    skipped_ms: f64,
    /// Of every collision step, us.
    times_us: Vec<f64>,
}

impl Bench {
    fn new(scene: &Scene, mesh: &TetMesh) -> Result<Self> {
        let fixed = boxes::nodes_where(mesh, |p| p.z < 0.5 * VOXEL_MM - BLOCK_MM);
        let mut triangles = trepan_mesh::Surface::of(mesh).triangles;
        triangles.retain(|t| t.iter().all(|&n| mesh.positions[n as usize].z > -0.01));
        let membrane = Membrane { triangles, shear_n_per_mm: scene.membrane_n_per_mm };
        let body = Body { membrane, ..Body::uniform(mesh.clone(), fixed, Material::WHOLE_BRAIN) };
        let config = Config {
            mass_scaling: MASS_ADDED * scene.heavier,
            dynamic_mass_scaling: 16.0,
            selective_mass_scaling: true,
            averaged_pressure: true,
            damping: Damping::Rate(damping_per_ms()?),
            ..Config::default()
        };
        let (friction, stiffness_per_mm2) = (scene.friction, scene.stiffness_per_mm2);
        let touch = trepan_deformable::Config { friction, shaft: true, stiffness_per_mm2, ..Default::default() };
        Ok(Self {
            solver: Tled::new(&body, &config)?,
            collision: TissueCollision::new(mesh, &scene.tool, &touch)?,
            loads: Loads { contacts: NodalContacts::with_room(), ..Loads::default() },
            out: TissueStep::default(),
            now_ms: 0.0,
            skipped_ms: 0.0,
            times_us: Vec::new(),
        })
    }

    /// A collision step with the tool's tip at a place, mm, at a velocity, mm/ms; force on it, N.
    fn collide(&mut self, tip: Vec3, linear: Vec3) -> Vec3 {
        let twist = Twist { linear, angular: Vec3::ZERO };
        let state = ToolState { twist, time_ms: self.now_ms.into(), ..ToolState::at(Pose::from_translation(tip)) };
        let began = std::time::Instant::now();
        self.collision.step(self.solver.positions(), self.solver.velocities(), &state, &mut self.out);
        self.times_us.push(began.elapsed().as_secs_f64() * 1e6);
        self.loads.contacts.clear();
        self.out.springs(&mut self.loads.contacts);
        self.out.patch.normal * self.out.patch.force_n
    }

    /// Steps the tissue for a millisecond.
    fn advance(&mut self) {
        let next_ms = self.now_ms + 1.0;
        while self.now_ms < next_ms {
            let dt_ms = self.solver.next_dt_ms().min(next_ms - self.now_ms);
            self.skipped_ms += f64::from(self.solver.step(&self.loads, dt_ms).skipped_ms);
            self.loads.contacts.follow_tool(dt_ms);
            self.now_ms += dt_ms.max(1e-4);
        }
    }

    /// Sets what the tissue and the steps tell so far.
    fn tell(&self, mesh: &TetMesh, found: &mut Found) {
        let upside_down = |tet: &&[u32; 4]| {
            let [a, b, c, d] = tet.map(|n| self.solver.positions()[n as usize]);
            (b - a).dot((c - a).cross(d - a)) <= 0.0
        };
        found.inverted = mesh.tets.iter().filter(upside_down).count() as u32;
        found.skipped_ms = self.skipped_ms;
        found.collision_us = quantile(&mut self.times_us.clone(), 0.5);
        found.stable_dt_ms = self.solver.stable_dt_ms().into();
    }
}

impl Found {
    /// Sets force, wander and tilt of the end of a rest from its forces, N.
    fn rest(&mut self, forces: &[Vec3]) {
        let still = &forces[forces.len() - STILL_MS..];
        let sizes = still.iter().map(|force| f64::from(force.length()));
        self.force_n = sizes.clone().sum::<f64>() / STILL_MS as f64;
        self.wander_n = sizes.clone().fold(0.0, f64::max) - sizes.fold(f64::INFINITY, f64::min);
        self.tilt_deg = largest_tilt_deg(still);
    }
}

/// Largest angle between forces and the axis, degrees.
fn largest_tilt_deg<'a>(forces: impl IntoIterator<Item = &'a Vec3>) -> f64 {
    forces.into_iter().map(|force| f64::from(force.angle_between(Vec3::Z).to_degrees())).fold(0.0, f64::max)
}

fn press(scene: &Scene, mesh: &TetMesh) -> Result<Vec<Found>> {
    let mut bench = Bench::new(scene, mesh)?;
    let (mut way_mm, mut all) = (-BEFORE_MM, Vec::new());
    for depth_mm in 1..=scene.deepest_mm {
        let end_mm = depth_mm as f32 / scene.way().dot(Vec3::NEG_Z);
        let mut found = Found { depth_mm, ..Found::default() };
        let (mut rest_ms, mut moving, mut forces) = (0, Vec::new(), Vec::new());
        while rest_ms < REST_MS {
            let moves = way_mm < end_mm;
            let at_speed = way_mm + SPEED <= end_mm;
            way_mm = (way_mm + SPEED).min(end_mm);
            rest_ms += u32::from(!moves);
            let velocity = if moves { scene.way() * SPEED } else { Vec3::ZERO };
            let force = bench.collide(scene.above(0.0) + scene.way() * way_mm, velocity);
            if at_speed {
                let under_mm = way_mm * scene.way().dot(Vec3::NEG_Z);
                found.moving = Some((under_mm.into(), force.length().into()));
            }
            match moves {
                true if force.length() > FELT_N => moving.push(force),
                true => {}
                false => forces.push(force),
            }
            bench.advance();
        }
        found.rest(&forces);
        found.tilt_moving_deg = Some(largest_tilt_deg(&moving));
        bench.tell(mesh, &mut found);
        all.push(found);
    }
    Ok(all)
}

/// Forces of the truth on its finest mesh by radius and depth in mm, N.
fn truths(radius_mm: f32, membrane_n_per_mm: f32) -> Result<Vec<f64>> {
    let path = trepan_fixtures::reference_solution("axial").with_extension("csv");
    let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let rows = text.lines().skip(1).map(|line| line.split(',').map(str::parse::<f64>).collect::<Result<Vec<_>, _>>());
    let rows = rows.collect::<Result<Vec<_>, _>>().context("a line of axial.csv")?;
    let is = |a: f64, b: f32| (a - f64::from(b)).abs() < 1e-6;
    let of = rows.iter().filter(|row| is(row[0], radius_mm) && is(row[1], membrane_n_per_mm));
    Ok(of.map(|row| row[3]).collect())
}

/// Presses into a block of a size.
fn upright(scene: &Scene, size: (usize, u32), findings: &mut Findings) -> Result<()> {
    let mesh = block(size)?;
    let truth = truths(scene.tool.tip_radius_mm, scene.membrane_n_per_mm)?;
    anyhow::ensure!(!truth.is_empty(), "axial.csv lacks a ball of {} mm", scene.tool.tip_radius_mm);
    let mut all = press(scene, &mesh)?;
    for found in all.iter_mut().filter(|found| found.depth_mm <= scene.truth_mm) {
        let at = found.depth_mm as usize - 1;
        found.exact_n = truth.get(at).copied();
        found.slope = truth.get(at).map_or(0.0, |exact| exact - at.checked_sub(1).map_or(0.0, |before| truth[before]));
    }
    judge(scene, scene.name, &mesh, &all, findings);
    Ok(())
}

/// Rows of what was found, and gates of the worst of them.
fn judge(scene: &Scene, name: &str, mesh: &TetMesh, all: &[Found], findings: &mut Findings) {
    let edge = edge_mm(mesh);
    let what = format!("{name}, edge of {edge:.1} mm");
    let worst = |of: fn(&Found) -> f64| all.iter().map(of).fold(0.0, f64::max);
    // Without a truth nothing is right.
    let is_known = all.iter().any(|found| found.exact_n.is_some());
    let (mut over, mut over_moving) = (if is_known { 0.0f64 } else { f64::INFINITY }, None::<f64>);
    for found in all {
        let mut row = Row::new(format!("axial press: {name}"), "tled")
            .with("tets", mesh.tets.len())
            .with("depth_mm", found.depth_mm)
            .metric("edge_mm", edge)
            .metric("force_n", found.force_n)
            .metric("tilt_deg", found.tilt_deg)
            .metric("wander_n", found.wander_n)
            .metric("inverted", f64::from(found.inverted))
            .metric("skipped_ms", found.skipped_ms)
            .metric("collision_us", found.collision_us)
            .metric("stable_dt_ms", found.stable_dt_ms);
        if let Some(tilt_deg) = found.tilt_moving_deg {
            row = row.metric("tilt_moving_deg", tilt_deg);
        }
        let off = |force_n: f64, exact: f64| (force_n - exact).abs() / (0.1 * exact).max(0.02);
        if let Some(exact) = found.exact_n {
            row = row.metric("force_error_percent", 100.0 * (found.force_n / exact - 1.0));
            over = over.max(off(found.force_n, exact));
        }
        if let Some((under_mm, moving_n)) = found.moving {
            row = row.metric("moving_force_n", moving_n);
            if let Some(exact) = found.exact_n {
                let exact_moving = exact - found.slope * (f64::from(found.depth_mm) - under_mm);
                row = row.metric("moving_error_percent", 100.0 * (moving_n / exact_moving - 1.0));
                over_moving = Some(over_moving.unwrap_or(0.0).max(off(moving_n, exact_moving)));
            }
        }
        findings.rows.push(row);
    }
    if scene.stiffness_per_mm2 != USUAL {
        return;
    }
    let moving = format!("{what}: force off in motion, over what is allowed");
    findings.gates.extend(over_moving.map(|over| Gate::at_most(moving, over, 1.0)));
    let moving = format!("{what}: tilt of the force in motion, degrees");
    let tilt_deg = all.iter().filter_map(|found| found.tilt_moving_deg).reduce(f64::max);
    findings.gates.extend(tilt_deg.map(|tilt_deg| Gate::at_most(moving, tilt_deg, 5.0)));
    findings.gates.extend([
        Gate::at_most(format!("{what}: force off, over what is allowed"), over, 1.0),
        Gate::at_most(format!("{what}: tilt of the force at rest, degrees"), worst(|f| f.tilt_deg), 2.0),
        Gate::at_most(format!("{what}: wander of the force at rest, N"), worst(|f| f.wander_n), 1e-3),
        Gate::at_most(format!("{what}: elements inverted"), worst(|f| f64::from(f.inverted)), 0.0),
        Gate::at_most(format!("{what}: time skipped, ms"), worst(|f| f.skipped_ms), 0.0),
    ]);
}
