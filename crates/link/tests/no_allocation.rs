//! Cells and rings never allocate after creation, as real-time loops require.
#![expect(unsafe_code, reason = "counting allocations means being the allocator")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use trepan_link::wire::TickRecord;
use trepan_link::{cell, queue};

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

#[test]
fn exchange_allocates_nothing() {
    assert!(allocations(|| drop(vec![1, 2, 3])) > 0, "the counter counts");

    let (mut writer, mut reader) = cell::cell(vec![0.0f32; 3000]);
    let through_cell = allocations(|| {
        for round in 0..100 {
            writer.write(|slot| slot.fill(round as f32));
            assert_eq!(reader.latest().0[2999], round as f32);
        }
    });
    let (mut sender, mut receiver) = queue::bounded(8);
    let through_ring = allocations(|| {
        for tick in 0..100 {
            sender.send(TickRecord { tick, ..TickRecord::default() });
            if tick % 3 > 0 {
                receiver.receive();
            }
        }
    });
    assert_eq!((through_cell, through_ring), (0, 0));
    assert!(receiver.dropped() > 0, "the full ring was part of it");
}
