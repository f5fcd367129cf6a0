//! A tick with its rings and histograms allocates nothing, as an allocator that counts shows.

// An allocator needs unsafe code. This one only counts and passes the calls on.
#![allow(unsafe_code)]

mod common;

use common::{Puppet, Trick, controller, pushing};
use runner::link::{LinkConfig, link};
use runner::{LatencyHistogram, TickLoop};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    /// Calls of the allocator by this thread (other tests and the harness have their own).
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

fn count() {
    CALLS.set(CALLS.get() + 1);
}

// SAFETY: every call goes to the system's allocator unchanged. Counting touches a plain thread-local number without a
// destructor, and so allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promises hold for the system's allocator, too.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn no_tick_allocates_whatever_the_rings_hold() {
    let config = LinkConfig {
        stall: 0.05,
        ..LinkConfig::new(1000.0, 100.0)
    };
    let (tick, mut host, _log) = link(&config);
    let mut tick_loop = TickLoop::new(controller(1), vec![Puppet::new(Trick::None)], tick);
    let mut sequence = 0;
    // The log is never read, so its ring is full from tick 52 on. The host reads every 70 ticks.
    for k in 0..1000_u64 {
        let now = k * 1_000_000;
        for _ in 0..k % 3 {
            sequence += 1;
            let _ = host.publish(0, &pushing(sequence, now + sequence % 2));
        }
        let before = CALLS.get();
        tick_loop.tick(now, k % 2_000);
        tick_loop.latencies.tick_time.record(k * k * k * 10);
        assert_eq!(CALLS.get(), before, "tick {k}");
        if k % 70 == 0 {
            host.drain(|_| ());
        }
    }
    let counters = tick_loop.end.counters();
    assert!(counters.refused_records > 0 && counters.refused_telemetry > 0);
    assert!(counters.superseded_models > 0);
    assert!(tick_loop.latencies.tick_time.overflow() > 0);
    assert_eq!(tick_loop.ticks, 1000);
}

#[test]
fn the_counter_counts() {
    let before = CALLS.get();
    let histogram = LatencyHistogram::new(1000);
    assert!(CALLS.get() > before);
    drop(histogram);
}
