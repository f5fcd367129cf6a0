//! A simulated device runs inside the real-time tick: once built, reading and writing never allocate.
#![allow(unsafe_code)]

use rt_core::{Device, Vec3, Wrench};
use sim::{Hand, SimDevice, Sine, Trajectory, Tremor, Wired, models};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

struct Counting;

static CALLS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call is handed on to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        CALLS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps `alloc`'s contract, which is the system allocator's.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        CALLS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as above; `pointer` came from `alloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn reads_and_writes_never_allocate() {
    let reach = [(0.0, Vec3::zeros()), (0.5, Vec3::new(0.02, 0.0, 0.0))];
    let sway = Sine {
        amplitude: Vec3::new(0.0, 0.01, 0.0),
        frequency: 2.0,
        phase: 0.0,
    };
    let recording: Vec<_> = (0..100)
        .map(|k| {
            (
                0.01 * f64::from(k),
                Vec3::new(0.0, 0.0, 1e-4 * f64::from(k)),
            )
        })
        .collect();
    let trajectory = Trajectory::new_sum([
        Trajectory::new_waypoints(&reach).unwrap(),
        Trajectory::new_sines(&[sway], 0.5).unwrap(),
        Trajectory::new_recorded(&recording).unwrap(),
    ]);
    let hand = Hand::new(trajectory).with_tremor(Tremor::new(1e-4, 1).unwrap());
    let mut device = Wired::new(SimDevice::new(models::FALCON, Some(hand), 1e-3).unwrap());
    let before = CALLS.load(Ordering::Relaxed);
    let mut refused = 0;
    for tick in 0..2000 {
        let now = tick * 1_000_000;
        let state = device.read(now);
        refused += u32::from(state.is_err());
        let force = state.map_or(Vec3::zeros(), |state| state.pose.position * -500.0);
        let wrench = Wrench {
            force,
            moment: Vec3::zeros(),
        };
        refused += u32::from(device.write(now, &wrench).is_err());
    }
    let after = CALLS.load(Ordering::Relaxed);
    assert_eq!((after - before, refused), (0, 0));
}
