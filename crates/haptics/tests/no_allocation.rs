//! Reading and driving a device never allocates, as a haptic tick requires.
#![expect(unsafe_code, reason = "counting allocations means being the allocator")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use trepan_contact::{ForceGuard, GuardConfig};
use trepan_geometry::{Buttons, Pose, Vec3, Wrench};
use trepan_haptics::script::{NAMES, Script, Site};
use trepan_haptics::simulated::{Config, HandModel, Simulated};
use trepan_haptics::{HapticDevice, Workspace, mouse, replay::Replay};

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

fn allocations(act: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.with(Cell::get);
    act();
    ALLOCATIONS.with(Cell::get) - before
}

fn session(device: &mut dyn HapticDevice) {
    let mut guard = ForceGuard::new(GuardConfig::default());
    let map = Workspace::default();
    for tick in 0..600 {
        let tool = map.world(&device.read(f64::from(tick)).tool);
        device.apply(guard.guard(Wrench { force: Vec3::X, torque: Vec3::ZERO }, &tool, 1.0));
    }
}

#[test]
fn a_tick_with_any_virtual_device_allocates_nothing() {
    assert!(allocations(|| drop(vec![1, 2, 3])) > 0, "the counter counts");
    let site = Site { entry: Vec3::ZERO, inward: Vec3::NEG_Z, bone_mm: 5.0, brain_mm: 7.0 };
    let script = |name| Script::named(name, &site, 500.0).unwrap();
    for name in NAMES {
        let mut device = script(name);
        assert_eq!(allocations(|| session(&mut device)), 0, "{name}");
    }
    let mut replay = Replay::new((0..300).map(|tick| script("probe").at(f64::from(tick))).collect());
    assert_eq!(allocations(|| session(&mut replay)), 0, "replay");
    let (mut handle, mut mouse) = mouse::pair(Pose::IDENTITY);
    handle.set(Pose::from_translation(Vec3::X), Buttons::PEDAL);
    assert_eq!(allocations(|| session(&mut mouse)), 0, "mouse");
    let mut simulated = Simulated::new(Config::default(), HandModel::LIGHT, Box::new(script("probe")));
    assert_eq!(allocations(|| session(&mut simulated)), 0, "simulated");
}
