//! A step of TLED on the card: its time by size and option, against what must be moved and
//! computed, and beside the processor.
//!
//! # Practice
//! A block of brain under gravity sideways. Wall clock: 512 steps submitted and waited for. Device:
//! the card's own clock over 256 steps, and over each pass of one. Bytes are counted once for each
//! number that a pass reads or writes; numbers of nodes once a pass, since caches serve the rest.

use super::{floors, row};
use trepan_contact::{NodalContact, NodalContacts};
use trepan_evidence::part::Scope;
use trepan_evidence::suite::{Findings, Gate};
use trepan_evidence::timer::Samples;
use trepan_geometry::{Vec3, units};
use trepan_gpu::{Gpu, GpuError};
use trepan_rivals::Family;
use trepan_soft::{Body, Loads, Material, Method, SoftSolver, boxes};
use trepan_tled::gpu::GpuTled;
use trepan_tled::{Config, Relaxation, Tled};

/// 5, 22, 50, 200 thousand tetrahedra and a million.
const SIZES: [[usize; 3]; 5] = [[10, 10, 9], [18, 17, 12], [22, 20, 19], [34, 33, 30], [56, 55, 54]];
const STEPS: u32 = 512;
const TIMED: u32 = 256;
const WARM_S: f64 = 0.4;

/// A law with options: floating-point operations a tetrahedron by hand, and bytes of its own.
struct Kind {
    name: &'static str,
    material: Material,
    config: Config,
    flops: f64,
    own_bytes: f64,
}

fn kinds() -> [Kind; 3] {
    let plain = Config::default();
    let free = Config { averaged_pressure: true, ..plain };
    // Locking-free: corners, rows and a quarter again, a change of volume written and read by four
    // corners beside their elements' numbers, four means.
    let averaged = 16.0 + 16.0 + 48.0 + 4.0 + 4.0 + 4.0 + 16.0;
    [
        Kind { name: "plain", material: Material::BRAIN, config: plain, flops: 400.0, own_bytes: 0.0 },
        Kind { name: "locking-free", material: Material::BRAIN, config: free, flops: 530.0, own_bytes: averaged },
        Kind {
            name: "stiffening, locking-free, three Prony terms",
            material: Material::WHOLE_BRAIN,
            config: Config { relaxation: Relaxation::BRAIN, ..free },
            flops: 1100.0,
            // Constants, and the memory of three terms of six numbers, read and written.
            own_bytes: averaged + 16.0 + 144.0,
        },
    ]
}

impl Kind {
    /// Bytes of a step. Each tetrahedron: corners and slots, rows, forces written and read. Each
    /// node: its run, mass, anchor, what pushes it, displacement twice, velocity and counts, the
    /// last three written.
    fn bytes(&self, body: &Body) -> f64 {
        let (tets, nodes) = (body.mesh.tets.len() as f64, body.mesh.positions.len() as f64);
        tets * (32.0 + 48.0 + 128.0 + self.own_bytes) + nodes * (4.0 + 16.0 + 64.0 + 16.0 + 32.0 + 16.0 + 16.0 + 48.0)
    }
}

/// A block of cubes of 8 mm on its base.
pub fn block(cells: [usize; 3], material: Material) -> Body {
    let mesh = boxes::split_box(cells, Vec3::from_array(cells.map(|n| 8.0 * n as f32)));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    Body::uniform(mesh, fixed, material)
}

fn gravity() -> Loads {
    Loads { gravity: Vec3::X * units::GRAVITY_MM_PER_MS2, ..Loads::default() }
}

fn largest(a: &[Vec3], b: &[Vec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a.distance(*b))).fold(0.0, f64::max)
}

/// Device beside processor after 300 steps, and beside the f64 reference at rest.
pub fn agreement(gpu: &Gpu, _: Scope, findings: &mut Findings) {
    let ogden = Config { averaged_pressure: true, relaxation: Relaxation::BRAIN, ..Config::default() };
    let of_ogden = [
        ("Ogden, plain", Material::BRAIN_OGDEN, Config::default()),
        ("Ogden, locking-free, three Prony terms", Material::BRAIN_OGDEN, ogden),
        ("neo-Hookean, locking-free, three Prony terms", Material::BRAIN, ogden),
    ];
    for (name, material, config) in kinds().map(|k| (k.name, k.material, k.config)).into_iter().chain(of_ogden) {
        // Short enough that the processor takes no substep of its own.
        let (body, config) = (block([6, 5, 4], material), Config { safety: 0.5, ..config });
        let mut device = GpuTled::new(gpu, &body, &config).expect("the device has these");
        let mut processor = Tled::new(&body, &config).expect("the block is sound");
        let dt_ms = device.steps(&gravity(), 300);
        (0..300).for_each(|_| _ = processor.step(&gravity(), dt_ms));
        let answered = device.read().is_ok();
        let way = largest(processor.positions(), &body.mesh.positions);
        let apart = largest(processor.positions(), device.positions()) / way;
        let apart = if answered { apart } else { f64::NAN };
        let scene = format!("{name}: device beside processor");
        findings.rows.push(row(&scene, gpu.name()).metric("moved_mm", way).metric("apart_share", apart));
        let gate = format!("{scene}: apart, share of the largest displacement");
        findings.gates.push(Gate::at_most(gate, apart, 1e-4));
    }
    let body = block([4, 4, 4], Material::BRAIN);
    let mut device = GpuTled::new(gpu, &body, &Config::default()).expect("the device has these");
    let mut reference = Method::named("reference").expect("listed").build(&body).expect("the block is sound");
    reference.step(&gravity(), 1.0);
    let mut ms = 0.0;
    while ms < 2000.0 {
        ms += 64.0 * device.steps(&gravity(), 64);
        if device.read().is_err() {
            break;
        }
    }
    let way = largest(reference.positions(), &body.mesh.positions);
    let apart = largest(reference.positions(), device.positions()) / way;
    let scene = "plain: device at rest beside the f64 reference";
    findings.rows.push(row(scene, gpu.name()).metric("moved_mm", way).metric("apart_share", apart));
    findings.gates.push(Gate::at_most(format!("{scene}: apart, share of the largest displacement"), apart, 1e-4));
}

/// Every size and kind.
pub fn run(gpu: &Gpu, scope: Scope, findings: &mut Findings) {
    let floors = floors::of(gpu).unwrap_or_else(|fault| {
        println!("  the floors are not measured: {fault}");
        None
    });
    if let Some(floors) = floors {
        let found = row("floors", gpu.name()).metric("copy_gb_per_s", floors.gb_per_s);
        findings.rows.push(found.metric("fma_gflop_per_s", floors.gflop_per_s));
    }
    let count = if gpu.is_software() { 1 } else { SIZES.len() };
    for cells in &SIZES[..count] {
        for kind in kinds() {
            if let Err(fault) = time(gpu, (*cells, &kind), scope, floors, findings) {
                println!("  {cells:?}, {}: {fault}", kind.name);
            }
        }
    }
}

fn time(
    gpu: &Gpu,
    (cells, kind): ([usize; 3], &Kind),
    scope: Scope,
    floors: Option<floors::Floors>,
    findings: &mut Findings,
) -> Result<(), GpuError> {
    let body = block(cells, kind.material);
    let tets = body.mesh.tets.len();
    let mut solver = GpuTled::new(gpu, &body, &kind.config).map_err(|fault| GpuError::Lost(fault.to_string()))?;
    let steps = if gpu.is_software() { 16 } else { STEPS };
    let mut submit = |_| {
        solver.steps(&gravity(), steps);
        gpu.wait().ok();
    };
    warm(&mut submit);
    let wall = Samples::of(scope.pick(3, 9), submit);
    let wall_us = wall.quantile(0.5) / f64::from(steps);
    let timed = (0..scope.pick(3, 9)).map(|_| solver.timed(steps.min(TIMED))).collect::<Result<Vec<_>, _>>()?;
    let device = Samples::from(timed.iter().map(|(us, _)| us / f64::from(steps.min(TIMED))).collect::<Vec<_>>());
    let device_us = device.quantile(0.5);
    let scene = format!("{tets} tetrahedra, {}", kind.name);
    let mut found = row(&scene, gpu.name())
        .with("tets", tets)
        .metric("wall_us", wall_us)
        .metric("wall_spread_percent", 100.0 * wall.spread())
        .metric("device_us", device_us)
        .metric("device_spread_percent", 100.0 * device.spread())
        .metric("tetrahedron_steps_per_s", 1e6 * tets as f64 / wall_us);
    let passes = timed.first().map_or(0, |(_, passes)| passes.len());
    let mut apart = row(&scene, gpu.name());
    for n in 0..passes {
        let name = timed[0].1[n].name;
        let us = Samples::from(timed.iter().map(|(_, passes)| passes[n].us).collect::<Vec<_>>()).quantile(0.5);
        apart = apart.metric(&format!("{name}_us"), us);
    }
    let mut over = f64::NAN;
    if let Some(floors) = floors {
        let bytes_us = 1e-3 * kind.bytes(&body) / floors.gb_per_s;
        let flops_us = 1e-3 * kind.flops * tets as f64 / floors.gflop_per_s;
        over = wall_us / bytes_us;
        found = found.metric("bytes_floor_us", bytes_us).metric("flops_floor_us", flops_us);
        found = found.metric("wall_over_bytes_floor", over);
    }
    findings.rows.push(found);
    findings.rows.extend((passes > 0).then_some(apart));
    // The processor beside it, where it is quick enough.
    if tets < 300_000 {
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get()).min(8);
        for threads in [1, threads] {
            let mut solver = Tled::new(&body, &Config { threads, ..kind.config }).expect("the block is sound");
            let dt_ms = solver.stable_dt_ms();
            let us = Samples::of(scope.pick(10, 40), |_| _ = solver.step(&gravity(), dt_ms)).quantile(0.5);
            let found = row(&scene, format!("processor, threads {threads}")).with("tets", tets);
            findings.rows.push(found.metric("wall_us", us).metric("tetrahedron_steps_per_s", 1e6 * tets as f64 / us));
        }
    }
    if gpu.is_software() {
        return Ok(());
    }
    let mut gate = |name: &str, gate: fn(String, f64, f64) -> Gate, value: f64, limit: f64| {
        findings.gates.push(gate(format!("{scene}: {name}"), value, limit));
    };
    match (tets, kind.name) {
        (22_032, "locking-free") => gate("a substep, us", Gate::at_most, wall_us, 20.0),
        (997_920, "plain" | "locking-free") => {
            gate("tetrahedron-steps a second", Gate::at_least, 1e6 * tets as f64 / wall_us, 5e9);
            gate("wall time over the floor of bytes", Gate::at_most, over, 2.0);
        }
        _ => {}
    }
    Ok(())
}

/// Calls until the card has left its idle clock: a card that waited runs at a fifth of its speed.
fn warm(mut call: impl FnMut(usize)) {
    let start = std::time::Instant::now();
    while start.elapsed().as_secs_f64() < WARM_S {
        call(0);
    }
}

/// A pressing contact on 20 thousand tetrahedra, and what the hand waits for: one call of a step
/// with the state read back.
pub fn contact(gpu: &Gpu, scope: Scope, findings: &mut Findings) {
    let body = block(if gpu.is_software() { [6, 5, 4] } else { SIZES[1] }, Material::BRAIN);
    let top = body.mesh.bounds().max.z;
    let middle = body.mesh.bounds().centre().with_z(top);
    for springs in [0, 1, 64] {
        let loads = Loads { contacts: pressed(&body, middle, springs), ..gravity() };
        let config = Config { averaged_pressure: true, ..Config::default() };
        let Ok(mut solver) = GpuTled::new(gpu, &body, &config) else { return };
        let dt_ms = solver.stable_dt_ms();
        let calls = |solver: &mut GpuTled, substeps: f32| {
            Samples::of(scope.pick(20, 200), |_| _ = solver.step(&loads, substeps * 0.99 * dt_ms))
        };
        warm(|_| _ = solver.step(&loads, 0.99 * dt_ms));
        let mut found = row(format!("{} tetrahedra, {springs} contacts", body.mesh.tets.len()), gpu.name());
        for (name, substeps) in [("call", 1.0), ("call_of_3_substeps", 3.0)] {
            let times = calls(&mut solver, substeps);
            found = found.metric(&format!("{name}_p50_us"), times.quantile(0.5));
            found = found.metric(&format!("{name}_p99_us"), times.quantile(0.99));
        }
        if let Ok((_, passes)) = solver.timed(16) {
            for pass in passes {
                found = found.metric(&format!("{}_us", pass.name), pass.us);
            }
        }
        findings.rows.push(found);
    }
}

/// Springs that press a millimetre into the surface around a place, 2 mm apart.
pub fn pressed(body: &Body, middle: Vec3, springs: usize) -> NodalContacts {
    let near = |at: Vec3| {
        let mut nodes: Vec<(f32, u32)> = (0u32..).zip(&body.mesh.positions).map(|(n, p)| (p.distance(at), n)).collect();
        nodes.sort_by(|a, b| a.0.total_cmp(&b.0));
        nodes.truncate(3);
        nodes
    };
    let spring = |n: usize| {
        let mut contact = NodalContact::none();
        (contact.normal, contact.stiffness, contact.damping) = (Vec3::Z, 0.2 / springs as f32, 0.0);
        let across = Vec3::new((n % 8) as f32 - 3.5, (n / 8) as f32 - 3.5, 0.0) * 2.0;
        near(middle + across).iter().for_each(|(_, node)| contact.add(*node, 1.0));
        contact.normalise();
        contact.offset_mm = 1.0 - contact.mean(|n| body.mesh.positions[n as usize]).z;
        contact
    };
    let mut contacts = NodalContacts::none();
    (0..springs).for_each(|n| contacts.push(spring(n)));
    contacts
}
