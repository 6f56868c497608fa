//! TLED on the graphics device: the same step as compute passes, many steps to a submission.
//!
//! # Theory
//! ```text
//! volumes  elements ──▶ change of volume                          (only with averaged pressure)
//! node_groups    change of volume ──▶ its mean around each node  (only with averaged pressure)
//! forces   elements ──▶ slots, one a corner, sorted by node
//! membrane triangles ──▶ slots                                   (only with a membrane)
//! press    touched nodes ──▶ forces of the contact springs       (only where something touches)
//! update   slots ──▶ node, in their order; v⁺, u⁺
//! ```
//! Every law, averaged nodal pressure, Prony's relaxation and mass scaling are there, with the
//! processor's arithmetic. No atomics and no order that depends on timing: the same input gives the
//! same bytes on the same device. Against the processor's solver the difference is that of
//! rounding, since drivers may fuse a multiplication and an addition.
//!
//! # Practice
//! [`GpuTled::steps`] only submits; [`GpuTled::read`] waits and copies the state back. On this side
//! of the bus the stable step is checked against the present deformation at every
//! [`read`](GpuTled::read), not at every step, so read at least every few ms of simulated time.
//! [`SoftSolver::step`] submits and reads back at once: right, but it waits for the device, so it
//! is no choice for a fast loop.
//!
//! ```no_run
//! use trepan_gpu::{Gpu, Prefer};
//! use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
//! use trepan_tled::{Config, gpu::GpuTled};
//!
//! let mesh = boxes::split_box([8, 8, 8], trepan_geometry::Vec3::splat(80.0));
//! let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
//! let gpu = Gpu::open(Prefer::Hardware)?;
//! let body = Body::uniform(mesh, fixed, Material::BRAIN);
//! let mut tled = GpuTled::new(&gpu, &body, &Config::default())?;
//! tled.steps(&Loads { gravity: trepan_geometry::Vec3::NEG_Z * 9.81e-3, ..Loads::default() }, 30);
//! tled.read()?;
//! println!("{}", tled.positions()[0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # When not to use it
//! Small meshes, where several threads are faster (see the README). Dynamic mass scaling is not
//! applied: substeps get shorter instead. Bodies without supports that are damped: they are refused
//! with the field's name, and [`Tled`](crate::Tled) has them, as it has pressure on surfaces, moved
//! nodes and [`settle`](crate::Tled::settle).

mod device_state;
mod forces;
mod membrane;
mod pass;
mod press;
mod spare;
mod topology;
mod update;
mod volumes;

use crate::base::{Base, left_of};
use crate::config::Config;
use crate::node_groups::NodeGroups;
use crate::nodes::{keep_and_gain, kick_ms};
use crate::relaxation::Fade;
use device_state::{DeviceState, Step};
use forces::Forces;
use pass::Pass;
use press::Press;
pub use spare::WithSpare;
use topology::Topology;
use trepan_contact::{NodalContact, PlaneContact};
use trepan_geometry::Vec3;
use trepan_gpu::{Gpu, GpuError, PassTime, Readback, Recorder, Timer};
use trepan_soft::{Body, BodyError, Loads, NodeState, SoftSolver, StepReport};

/// Threads in a workgroup, as in the shaders.
pub(crate) const LANES: u32 = 64;
/// Most steps in one submission: the device runs some while the next are recorded, and no driver
/// takes them for a hang.
const STEPS_AT_ONCE: u32 = 16;
/// Most steps that are timed at once.
const TIMED_AT_ONCE: u32 = 256;
/// Time that a call of [`SoftSolver::step`] should take, ms of tissue: waiting for the device costs
/// as much as several substeps.
const CALL_MS: f32 = 0.5;

/// Why a body does not run on the device.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GpuTledError {
    /// The body or the settings make no sense on any solver.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The device is missing, too small or gone.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// There is no graphics card; the processor's solver is faster than a software driver.
    #[error("no graphics card here, only the software driver {0}; use trepan_tled::Tled")]
    Software(String),
    /// The device's kernels do not have this; the processor's solver does.
    #[error("{field}: the device has only {right}; use trepan_tled::Tled")]
    Unsupported {
        /// The field.
        field: &'static str,
        /// What would be right.
        right: &'static str,
    },
}

/// Total Lagrangian explicit solver of one body on the graphics device.
pub struct GpuTled {
    gpu: Gpu,
    base: Base,
    state: DeviceState,
    /// Passes of averaged pressure.
    volumes: Option<[Pass; 2]>,
    forces: Forces,
    membrane: Option<Pass>,
    press: Press,
    update: Pass,
    readback: Readback,
    elements: u32,
    node_groups: u32,
    /// Largest growth of an element's ω² between the last two reads, 1/ms².
    growth: f32,
    submitted: u32,
    /// Whether the newest submission copies the state back.
    copied: bool,
    fault: Option<GpuError>,
}

impl GpuTled {
    /// Takes a body at rest to the device.
    pub fn new(gpu: &Gpu, body: &Body, config: &Config) -> Result<Self, GpuTledError> {
        let config = &Config { selective_mass_scaling: false, ..*config };
        let (base, masses, scaling) = Base::of(body, config)?;
        refuse(&base)?;
        let (layout, averages) = (&base.layout, config.averaged_pressure);
        let node_groups = NodeGroups::of(body, layout, averages);
        let state = DeviceState::new(gpu, body, layout, &masses)?;
        let topology = Topology::new(gpu, body, layout, &node_groups, averages)?;
        let forces = Forces::new(gpu, (body, layout, &scaling), config, &state, &topology)?;
        let volumes = || volumes::passes(gpu, (body, layout, &node_groups), &state, &topology, &forces);
        let sheet = || membrane::pass(gpu, body, &state, &topology, &forces);
        let membrane = (!topology.sheet_corners.is_empty()).then(sheet).transpose()?;
        let press = Press::new(gpu, &state, &topology, &forces)?;
        let read = [state.u.raw(), state.v.raw(), state.noticed.raw(), press.pressure.raw()];
        Ok(Self {
            readback: Readback::new(gpu, "tissue", &read)?,
            volumes: averages.then(volumes).transpose()?,
            update: update::pass(gpu, &state, &topology, &forces, &press)?,
            gpu: gpu.clone(),
            elements: body.mesh.tets.len() as u32,
            node_groups: node_groups.place_of.len() as u32,
            growth: 0.0,
            submitted: 0,
            copied: false,
            fault: None,
            base,
            state,
            forces,
            membrane,
            press,
        })
    }

    /// Submits `count` steps of the longest stable length under the same loads, and gives that
    /// length, ms. Does not wait.
    pub fn steps(&mut self, loads: &Loads, count: u32) -> f32 {
        let dt_ms = self.base.longest_ms(self.growth);
        self.submit(loads, dt_ms, count, false);
        dt_ms
    }

    /// Waits for the device and copies positions and velocities back. Counts are of all steps since
    /// the last time, inverted elements those of every node's worst step.
    pub fn read(&mut self) -> Result<StepReport, GpuError> {
        if !std::mem::take(&mut self.copied) {
            let mut recorder = self.gpu.record("read");
            self.copy(&mut recorder);
            recorder.submit();
        }
        let Base { layout, rest, state, .. } = &mut self.base;
        let (noticed, contact_n) = self.readback.read(&self.gpu, |part| {
            let [u, v] = [0, 1].map(|n| bytemuck::cast_slice::<u8, [f32; 4]>(part[n]));
            for (place, node) in layout.node_at.iter().map(|&n| n as usize).enumerate() {
                state.positions[node] = rest[node] + Vec3::from_slice(&u[place]);
                state.velocities[node] = Vec3::from_slice(&v[place]);
            }
            let mut noticed = [0u32; 4];
            for [inverted, limited, non_finite, growth] in bytemuck::cast_slice::<u8, [u32; 4]>(part[2]) {
                noticed[0] += inverted;
                noticed[1] += limited;
                noticed[2] += non_finite;
                // Of numbers that are not negative the bits are in the numbers' order.
                noticed[3] = noticed[3].max(*growth);
            }
            (noticed, bytemuck::cast_slice::<u8, f32>(part[3])[0])
        })?;
        if self.submitted > 0 {
            self.growth = f32::from_bits(noticed[3]);
        }
        Ok(StepReport {
            inverted: noticed[0],
            limited: noticed[1],
            non_finite: noticed[2],
            substeps: std::mem::take(&mut self.submitted),
            contact_n,
            converged: true,
            ..StepReport::default()
        })
    }

    /// Why the device did not answer in the last [`step`](SoftSolver::step), which then left the
    /// state as it was.
    pub fn fault(&self) -> Option<&GpuError> {
        self.fault.as_ref()
    }

    /// Length of a step that the elements just bear at rest, ms, without any margin. A membrane
    /// bears [`stable_dt_ms`](SoftSolver::stable_dt_ms) only.
    pub fn bound_ms(&self) -> f32 {
        self.base.bound.at_rest_ms
    }

    /// Submits `count` steps of one length. Where the last step had another length, the first of
    /// these lets past stress fade for as long as that, and changes velocities from its middle on.
    /// With `reads` the state is copied back by the same submission.
    fn submit(&mut self, loads: &Loads, dt_ms: f32, count: u32, reads: bool) {
        let (mut step, mut clears) = self.numbers(loads, dt_ms);
        let first = u32::from(self.base.elapsed_ms != dt_ms).min(count);
        for (elapsed_ms, now, is_last) in
            [(self.base.elapsed_ms, first, count == first), (dt_ms, count - first, count > first)]
        {
            if now == 0 {
                continue;
            }
            let fade = self.base.config.relaxation.fade(elapsed_ms);
            let of_terms = |of: fn(&Fade) -> f32| std::array::from_fn(|term| fade.get(term).map_or(0.0, of));
            [step.keep, step.gain] = keep_and_gain(self.base.damping_per_ms, kick_ms(elapsed_ms, dt_ms));
            (step.fade_keep, step.fade_gain) = (of_terms(|fade| fade.keep), of_terms(|fade| fade.gain));
            self.state.step.write(&self.gpu, 0, &[step]);
            self.run(now, std::mem::take(&mut clears), reads && is_last);
        }
        if count > 0 {
            self.base.elapsed_ms = dt_ms;
        }
        self.submitted += count;
    }

    /// Submits steps by the numbers that the device has; `clears` what pushed the nodes before,
    /// `reads` the state afterwards.
    fn run(&mut self, count: u32, mut clears: bool, reads: bool) {
        let mut left = count;
        while left > 0 {
            let now = left.min(STEPS_AT_ONCE);
            let mut recorder = self.gpu.record("tled");
            if std::mem::take(&mut clears) {
                recorder.clear(&self.press.pushed);
                recorder.clear(&self.press.pressure);
            }
            self.record(&mut recorder, now, self.press.presses());
            left -= now;
            self.copied = reads && left == 0;
            if self.copied {
                self.copy(&mut recorder);
            }
            recorder.submit();
        }
    }

    /// Records the copy of the state to the host.
    fn copy(&self, recorder: &mut Recorder) {
        recorder.copy(&self.readback);
        recorder.clear(&self.state.noticed);
    }

    /// Records some steps as one pass.
    fn record(&self, recorder: &mut Recorder, steps: u32, presses: bool) {
        recorder.compute("tled", |to| {
            for _ in 0..steps {
                self.passes(presses).for_each(|(_, pass)| pass.dispatch(to));
            }
        });
    }

    /// The passes of a step in their order.
    fn passes(&self, presses: bool) -> impl Iterator<Item = (&'static str, &Pass)> {
        let volumes = ["volumes", "node_groups"].into_iter().zip(self.volumes.iter().flatten());
        let forces = self.forces.laws.iter().map(|pass| ("forces", pass));
        let forces = forces.chain(self.membrane.iter().map(|pass| ("membrane", pass)));
        let press = presses.then_some(("press", &self.press.pass));
        volumes.chain(forces).chain(press).chain([("update", &self.update)])
    }

    /// Runs `count` further steps, at most 256, like the last one, and returns the device's time.
    /// That is of all together, µs, and of each pass of one more step; NaN and nothing where the
    /// device has no clock.
    pub fn timed(&mut self, count: u32) -> Result<(f64, Vec<PassTime>), GpuError> {
        let presses = self.press.presses();
        let Some(mut timer) = Timer::new(&self.gpu, 16)? else { return Ok((f64::NAN, Vec::new())) };
        let mut recorder = self.gpu.record("timed").timed(Some(&mut timer));
        self.record(&mut recorder, count.min(TIMED_AT_ONCE), presses);
        self.passes(presses).for_each(|(name, pass)| recorder.compute(name, |to| pass.dispatch(to)));
        recorder.submit();
        self.submitted += count.min(TIMED_AT_ONCE) + 1;
        let mut times = timer.read(&self.gpu)?;
        let all = times.remove(0);
        Ok((all.us, times))
    }

    /// Hands the springs over; returns the uniform, and whether what pushed before must be cleared.
    fn numbers(&mut self, loads: &Loads, dt_ms: f32) -> (Step, bool) {
        let Base { config, layout, rest, max_displacement_mm, .. } = &self.base;
        let (press, state, place_of) = (&mut self.press, &self.state, &layout.place_of);
        let at_rest = |n: u32| rest.get(n as usize).copied().unwrap_or_default();
        let deep = |spring: &NodalContact| spring.offset_mm + spring.mean(at_rest).dot(spring.normal);
        let [springs, singles] = press.list_springs(&loads.contacts, deep, place_of, state);
        let added =
            |plane: &&PlaneContact| press.list.add_plane(plane, plane.depth_mm(at_rest(plane.node)), place_of, state);
        let planes = loads.contacts.planes().iter().filter(added).count() as u32;
        let (touched, clears) = press.hand_over(&self.gpu);
        let step = Step {
            gravity: (loads.gravity - config.balanced_gravity).to_array(),
            opening_mpa: loads.fluid.opening_mpa,
            up: loads.fluid.up.to_array(),
            level_mm: loads.fluid.level_mm,
            weight: loads.fluid.weight.to_array(),
            dt: dt_ms,
            max_speed: config.max_speed,
            max_displacement: *max_displacement_mm,
            springs,
            singles,
            planes,
            touched,
            elements: self.elements,
            nodes: layout.node_at.len() as u32,
            node_groups: self.node_groups,
            ..Step::default()
        };
        (step, clears)
    }
}

impl SoftSolver for GpuTled {
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport {
        let (dt_ms, most) = (dt_ms.max(0.0), self.base.config.substeps);
        let needed = self.base.substeps(dt_ms, self.growth);
        let count = if most == 0 { 1.0 } else { needed.min(most as f32) };
        let each_ms = if most == 0 { dt_ms } else { dt_ms / needed };
        let before = self.submitted;
        self.submit(loads, each_ms, count as u32, true);
        match self.read() {
            Ok(mut report) => {
                report.substeps -= before;
                report.skipped_ms = left_of(dt_ms, dt_ms - each_ms * count);
                self.fault = None;
                report
            }
            Err(fault) => {
                self.fault = Some(fault);
                StepReport { skipped_ms: dt_ms, ..StepReport::default() }
            }
        }
    }

    fn state(&self) -> &NodeState {
        &self.base.state
    }

    fn stable_dt_ms(&self) -> f32 {
        self.base.stable_dt_ms()
    }

    fn next_dt_ms(&self) -> f32 {
        let substep_ms = self.base.next_dt_ms(self.growth);
        // One substep is left for an element that grows stiffer on the way.
        substep_ms * (CALL_MS / substep_ms).floor().clamp(1.0, self.base.config.substeps.max(2) as f32 - 1.0)
    }
}

/// Refuses what the kernels lack.
fn refuse(base: &Base) -> Result<(), GpuTledError> {
    if base.config.still_mm > 0.0 {
        return Err(GpuTledError::Unsupported { field: "still_mm", right: "every element in every step (0)" });
    }
    if base.damping_per_ms > 0.0 && !base.supported {
        let right = "undamped bodies where no fixed nodes hold them";
        return Err(GpuTledError::Unsupported { field: "damping", right });
    }
    Ok(())
}

/// Refuses more workgroups than the device runs at once.
pub(crate) fn groups(gpu: &Gpu, label: &str, threads: usize) -> Result<(), GpuError> {
    let (wanted, limit) = (threads.div_ceil(LANES as usize) as u64, gpu.limits().max_compute_workgroups_per_dimension);
    if wanted <= u64::from(limit) {
        return Ok(());
    }
    Err(GpuError::TooLarge {
        label: label.into(),
        wanted,
        limit: limit.into(),
        unit: "workgroups",
        adapter: gpu.name(),
    })
}
