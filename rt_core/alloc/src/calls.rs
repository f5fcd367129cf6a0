//! An allocator that counts the calls of each thread.
// An allocator needs unsafe code. This allocator only counts, and passes the calls on.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The system's allocator, with a counter of calls for each thread.
#[derive(Debug)]
pub struct Counting;

thread_local! {
    /// Calls of the allocator by this thread. The harness and other tests have counters of their own.
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

fn note() {
    CALLS.set(CALLS.get() + 1);
}

// SAFETY: every call goes to the system's allocator unchanged. Counting touches a plain thread-local number without a
// destructor, and so allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        note();
        // SAFETY: the caller's promises hold for the system's allocator, too.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        note();
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        note();
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

/// Number of allocations, reallocations and frees by this thread so far. The number is zero, too, if [`Counting`] is
/// not the allocator of the program.
pub fn so_far() -> u64 {
    CALLS.get()
}

/// Number of allocations, reallocations and frees by `body` on this thread, as in [`so_far`].
pub fn count(body: impl FnOnce()) -> u64 {
    let before = so_far();
    body();
    so_far() - before
}

/// Whether [`Counting`] is the allocator of the program. The call allocates.
pub fn are_counted() -> bool {
    count(|| drop(std::hint::black_box(Box::new(0_u64)))) > 0
}
