//! A step must not allocate: counted by an allocator that wraps the system's.
#![expect(unsafe_code, reason = "only a global allocator sees every allocation, and its trait is unsafe")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};
use trepan_contact::NodalContact;
use trepan_geometry::Vec3;
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Tled};

struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

thread_local! {
    static MINE: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        _ = MINE.try_with(|mine| mine.set(mine.get() + 1));
        // SAFETY: the caller keeps alloc's contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps dealloc's contract.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_step_never_allocates() {
    let mesh = boxes::split_box([4, 4, 4], Vec3::splat(10.0));
    let top = boxes::nodes_where(&mesh, |p| p.z > 9.0);
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 0.1);
    let mut body = Body::uniform(mesh, fixed, Material::BRAIN);
    let mut contact = NodalContact::none();
    top.iter().for_each(|&n| contact.add(n, 1.0));
    contact.normalise();
    (contact.normal, contact.stiffness, contact.offset_mm) = (Vec3::Z, 0.3, -9.5);
    let loads = Loads { gravity: Vec3::NEG_Z * 9.81e-3, contacts: contact.into(), ..Loads::default() };
    for (held, threads) in [(true, 1), (true, 2), (false, 1)] {
        if !held {
            body.fixed.clear();
        }
        // Some elements stiffen beyond what twice their mass makes up for.
        let config = Config { threads, dynamic_mass_scaling: 2.0, selective_mass_scaling: true, ..Config::default() };
        let mut tled = Tled::new(&body, &config).unwrap();
        let dt = tled.stable_dt_ms() * 2.5;
        tled.step(&loads, dt);
        let (before, mine) = (ALLOCATIONS.load(Ordering::Relaxed), MINE.get());
        let mut step = |t: u32| {
            if t.is_multiple_of(8) {
                tled.lower_fill(t, 0);
            }
            tled.step(&loads, dt)
        };
        let report = (0..300).map(&mut step).last().unwrap();
        assert_eq!(MINE.get(), mine, "the caller allocated");
        // Other threads: the worker's start, whenever that is, and the test harness; not 900
        // substeps.
        assert!(ALLOCATIONS.load(Ordering::Relaxed) - before < 100, "a worker allocated");
        assert!(report.substeps >= 3, "{}", report.substeps);
    }
}
