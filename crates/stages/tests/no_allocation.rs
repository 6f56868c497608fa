//! A collision step allocates nothing, whichever hands have a tool.
#![expect(unsafe_code, reason = "counting allocations means being the allocator")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use trepan_bleeding::Perfusion;
use trepan_deformable::Config;
use trepan_geometry::{Buttons, Pose, ToolState, Vec3};
use trepan_soft::boxes;
use trepan_stages::haptic_tick::{SecondTool, ToolSample};
use trepan_stages::program::Program;
use trepan_stages::second_hand::SecondHand;
use trepan_stages::{CollisionStage, SoftFrame};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: delegates to the system's allocator; counting uses only a plain thread-local.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller fulfils the allocator's contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

#[test]
fn a_collision_step_allocates_nothing() {
    let mesh = boxes::split_box([10, 10, 8], Vec3::new(20.0, 20.0, 16.0));
    let tets = mesh.tets.len();
    let stage = CollisionStage::new(Program::Brain, &mesh, &Config::default(), None)
        .and_then(|stage| stage.with_second_hand(&mesh, &Config::default()))
        .and_then(|stage| stage.folding(&mesh))
        .and_then(|stage| stage.aspirating(&mesh, &vec![0.05; tets]));
    let perfusion = vec![Perfusion { capillaries: 1.0, vessel: 1.0 }; tets];
    let mut stage = stage.expect("the block is sound").bleeding(&mesh, &perfusion, Vec3::Z);
    let velocities = vec![Vec3::ZERO; mesh.positions.len()];
    let brain = SoftFrame { step: 1, positions: mesh.positions, velocities, ..SoftFrame::default() };
    let tray = Program::Brain.tray();
    for tick in 1..=1200u64 {
        let at = |x: f32| {
            let place = Vec3::new(x, 10.2, 17.5 - 0.005 * tick.min(800) as f32);
            let state = ToolState { buttons: Buttons::PEDAL, ..ToolState::at(Pose::from_translation(place)) };
            ToolState { time_ms: tick as f64, ..state }
        };
        // Probe, spatula, aspirator and bipolar in turn; the second hand comes and goes.
        let slot = (tick / 100) as usize % tray.len();
        let second = SecondTool { tool: SecondHand::tool(), slot: tray.len(), state: at(14.0) };
        let second = (tick / 150 % 2 == 1).then_some(second);
        let idle = tick % 100 < 10;
        let sample = ToolSample { tick, state: at(6.0), tool: tray[slot], slot, drilling: false, second, idle };
        let before = ALLOCATIONS.with(Cell::get);
        stage.step(&sample, &brain);
        assert_eq!(ALLOCATIONS.with(Cell::get) - before, 0, "tick {tick}, {:?}", tray[slot].kind);
    }
    assert!(stage.aspirated_mm3() > 1.0, "{} mm³ were taken", stage.aspirated_mm3());
}
