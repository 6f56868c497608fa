//! The step by size and option, and each of its passes alone: `cargo bench -p trepan-tled`.

use divan::Bencher;
use divan::counter::ItemsCount;
use trepan_geometry::Vec3;
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Kernel, Pass, Relaxation, Tled};

fn main() {
    divan::main();
}

fn body(cells: [usize; 3]) -> Body {
    let mesh = boxes::split_box(cells, Vec3::from_array(cells.map(|n| 8.0 * n as f32)));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1.0);
    Body::uniform(mesh, fixed, Material::BRAIN)
}

/// 22 thousand tetrahedra.
const BRAIN: [usize; 3] = [18, 17, 12];

fn loads() -> Loads {
    Loads { gravity: Vec3::NEG_Z * 9.81e-3, ..Loads::default() }
}

fn steps(bencher: Bencher<'_, '_>, cells: [usize; 3], config: &Config) {
    let body = body(cells);
    let mut tled = Tled::new(&body, config).expect("the block is sound");
    let (loads, dt_ms) = (loads(), tled.stable_dt_ms());
    bencher.counter(ItemsCount::new(body.mesh.tets.len())).bench_local(|| tled.step(&loads, dt_ms));
}

/// Cost over size: 5, 22, 50 and 80 thousand tetrahedra.
#[divan::bench(args = [10, 16, 20, 24])]
fn size(bencher: Bencher<'_, '_>, cells: usize) {
    steps(bencher, [cells; 3], &Config::default());
}

#[divan::bench(args = kernels())]
fn kernel(bencher: Bencher<'_, '_>, name: &str) {
    let kernel = Kernel::all().into_iter().find(|k| k.name() == name).expect("a kernel of that name");
    steps(bencher, BRAIN, &Config { kernel, ..Config::default() });
}

fn kernels() -> Vec<&'static str> {
    Kernel::all().into_iter().filter(|k| k.runs_here()).map(Kernel::name).collect()
}

#[divan::bench(args = [1, 2, 4])]
fn threads(bencher: Bencher<'_, '_>, threads: usize) {
    steps(bencher, BRAIN, &Config { threads, ..Config::default() });
}

#[divan::bench]
fn averaged_pressure(bencher: Bencher<'_, '_>) {
    steps(bencher, BRAIN, &Config { averaged_pressure: true, ..Config::default() });
}

#[divan::bench]
fn prony(bencher: Bencher<'_, '_>) {
    steps(bencher, BRAIN, &Config { relaxation: Relaxation::BRAIN, ..Config::default() });
}

#[divan::bench]
fn averaged_pressure_and_prony(bencher: Bencher<'_, '_>) {
    steps(bencher, BRAIN, &Config { averaged_pressure: true, relaxation: Relaxation::BRAIN, ..Config::default() });
}

/// Laws as the simulators run them, with averaged pressure and relaxation.
#[divan::bench(args = ["neo-hookean", "stiffening", "ogden"])]
fn law(bencher: Bencher<'_, '_>, name: &str) {
    let stiffening =
        Material::Stiffening { shear_mpa: 1e-3, share: 0.3, bound: 0.02, poisson: 0.45, density_g_mm3: 1e-3 };
    let material = match name {
        "stiffening" => stiffening,
        "ogden" => Material::BRAIN_OGDEN,
        _ => Material::BRAIN,
    };
    let body = Body { materials: vec![material], ..body(BRAIN) };
    let config = Config { averaged_pressure: true, relaxation: Relaxation::BRAIN, ..Config::default() };
    let mut tled = Tled::new(&body, &config).expect("the block is sound");
    let (loads, dt_ms) = (loads(), tled.stable_dt_ms());
    bencher.counter(ItemsCount::new(body.mesh.tets.len())).bench_local(|| tled.step(&loads, dt_ms));
}

/// One pass alone, of a step with averaged pressure.
#[divan::bench(args = Pass::ALL.map(Pass::name))]
fn pass(bencher: Bencher<'_, '_>, name: &str) {
    let pass = Pass::ALL.into_iter().find(|p| p.name() == name).expect("a pass of that name");
    let mut tled = Tled::new(&body(BRAIN), &Config { averaged_pressure: true, ..Config::default() }).expect("sound");
    let (loads, dt_ms) = (loads(), tled.stable_dt_ms());
    tled.step(&loads, dt_ms);
    bencher.bench_local(|| tled.pass(pass, &loads, dt_ms));
}
