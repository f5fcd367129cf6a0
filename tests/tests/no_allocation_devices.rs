//! A simulated device runs inside the realtime tick. After its construction, reading and writing never allocate,
//! whatever the wrench and the time.

use alloc_count::calls::{Counting, count};
use devices::conformance::Suite;
use devices::hid::{HidDevice, ReadReport, WriteReport};
use devices::{Exchange, Exchanged, ReplayDevice};
use rt_core::{Device, DeviceError, DeviceState, Vec3, Wrench};
use runner::schedule::DEVICE_PRIORITY;
use sim::{
    DeviceModel, Fault, Faulty, Hand, SimDevice, Sine, Task, TaskKind, Trajectory, Tremor, Wired,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Loses the device now and then.
struct Lossy(u64);
impl Exchange for Lossy {
    fn exchange(&mut self, _: &Wrench) -> Result<DeviceState, DeviceError> {
        self.0 += 1;
        if self.0.is_multiple_of(20) {
            return Err(DeviceError::Disconnected(19));
        }
        Ok(DeviceState::resting())
    }
    fn release(&mut self) {}
    fn reopen(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// A HID device that is lost and comes back allocates and frees nothing on the thread of the tick, not even in the tick
/// that loses it. A device with a thread of its own does neither.
#[test]
fn losing_a_device_never_allocates() {
    let push = Wrench {
        force: Vec3::new(1.0, 0.0, 0.0),
        moment: Vec3::zeros(),
    };
    let tick = |device: &mut dyn Device, now: u64| {
        let mut result = Ok(DeviceState::resting());
        let calls = count(|| {
            result = device.read(now);
            let _ = device.write(now, &push);
        });
        assert_eq!(calls, 0, "allocations in a tick: {result:?}");
        result
    };

    let opened = Arc::new(AtomicU64::new(0));
    let times = Arc::clone(&opened);
    let open = move || {
        times.fetch_add(1, Ordering::Relaxed);
        let mut left = 20;
        let read: Box<ReadReport> = Box::new(move |_| {
            left -= 1;
            if left == 0 { Err(19) } else { Ok(0) }
        });
        let write: Box<WriteReport> = Box::new(|_| Ok(()));
        Ok((read, write))
    };
    let capabilities = DeviceModel::named("falcon").unwrap().capabilities();
    let mut device = HidDevice::reopened(open, capabilities).expect("a thread");
    let mut now = 0;
    while opened.load(Ordering::Relaxed) < 4 {
        let _ = tick(&mut device, now);
        now += 1_000_000;
        std::thread::yield_now();
    }

    let mut device =
        Exchanged::start(Lossy(0), capabilities, 1e-3, DEVICE_PRIORITY).expect("a thread");
    // It comes back twice.
    for _ in 0..2 {
        while tick(&mut device, 0) != Err(DeviceError::Disconnected(19)) {
            std::thread::yield_now();
        }
        while tick(&mut device, 0).is_err() {
            std::thread::yield_now();
        }
    }
}

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
    let task = Task::new(TaskKind::Rub, Vec3::new(0.0, 0.0, -1.0));
    let trajectory = Trajectory::new_sum([
        task.trajectory(1).unwrap(),
        Trajectory::new_waypoints(&reach).unwrap(),
        Trajectory::new_sines(&[sway], 0.5).unwrap(),
        Trajectory::new_recorded(&recording).unwrap(),
    ]);
    let hand = Hand::new(trajectory).with_tremor(Tremor::new(1e-4, 1).unwrap());
    assert_eq!(count(|| drop(std::hint::black_box(Box::new(7)))), 2);
    let watch = |call: &mut dyn FnMut()| assert_eq!(count(call), 0, "allocations in a call");
    // One device has three degrees of freedom, the other six.
    for model in ["falcon", "virtuose6d"] {
        let model = DeviceModel::named(model).unwrap();
        let make = || Wired::new(SimDevice::new(model, Some(hand.clone()), 1e-3).unwrap());
        let suite = Suite::new("wired").watched(&watch);
        suite.check(|| Box::new(make()));
        let fault = [(0..50_000_000, Fault::Silent)];
        let suite = suite.states(450);
        suite.check(|| Box::new(Faulty::new(Box::new(make()), fault.to_vec())));
        let readings: Vec<_> = (0..500).map(|k| make().read(k * 1_000_000)).collect();
        suite.check(|| Box::new(ReplayDevice::new(model.capabilities(), readings.clone())));
    }
}
