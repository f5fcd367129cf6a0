//! The tick allocates nothing in faults, either: every scheme and number of handles, through every fault that the tick
//! handles. Each stretch ends with a check that the fault occurred.

use alloc_count::calls::{Counting, count};
use devices::scripted::{Scripted, small};
use palpate_tests::law::{HANDLES, Limits, PATIENCE, SCHEMES, law, model, reading, scheme};
use rt_core::coupling::HostState::{self, Fading, Held, Live, Waiting};
use rt_core::safety::SafetyState::{
    self, Limited, Normal, NotANumber, OutOfReach, Recovering, Silent, TooFast,
};
use rt_core::{Corruption, DeviceError, Freedom, LocalModel, Telemetry, TickTime, Vec3, Wrench};
use runner::AnyDevice;
use runner::link::{HostEnd, LinkConfig, LogEnd, link};
use runner::tick_loop::TickLoop;
use std::sync::{Arc, Mutex, MutexGuard};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const TICK_NS: u64 = 1_000_000;
/// Ticks for which the rings have room.
const STALL: u64 = 200;

/// The behaviour of the devices.
#[derive(Clone, Copy)]
enum Script {
    Move,
    Fail(DeviceError),
    SayNotANumber,
    /// The velocity exceeds every limit.
    Rush,
    /// The hand is this far away (m).
    Stray(f64),
    RefuseWrenches,
}

/// A device that follows the script.
fn scripted(index: usize, script: &Arc<Mutex<Script>>) -> AnyDevice {
    let (by_read, by_write) = (Arc::clone(script), Arc::clone(script));
    let read = move |now_ns| {
        let mut state = reading(now_ns as f64 * 1e-8)[index]?;
        match *lock(&by_read) {
            Script::Move | Script::RefuseWrenches => {}
            Script::Fail(error) => return Err(error),
            Script::SayNotANumber => state.pose.position.y = f64::NAN,
            Script::Rush => state.twist.linear.x = 100.0,
            Script::Stray(distance) => state.pose.position = Vec3::new(distance, 0.0, 0.0),
        }
        Ok(state)
    };
    let write = move |_, _: &Wrench| match *lock(&by_write) {
        Script::RefuseWrenches => Err(DeviceError::Busy),
        _ => Ok(()),
    };
    Box::new(Scripted::new(small(Freedom::Six), read, write))
}

fn lock(script: &Mutex<Script>) -> MutexGuard<'_, Script> {
    script.lock().expect("nothing panics while it is held")
}

/// A loop in which the allocations of every tick are counted.
struct Watched {
    name: String,
    tick: TickLoop,
    script: Arc<Mutex<Script>>,
    now_ns: u64,
    model: LocalModel,
    last: Telemetry,
}

impl Watched {
    fn ticks(&mut self, ticks: u64) {
        self.late_ticks(ticks, 0);
    }

    fn late_ticks(&mut self, ticks: u64, lateness_ns: u64) {
        let found = count(|| {
            for _ in 0..ticks {
                self.now_ns += TICK_NS;
                let time = TickTime {
                    now_ns: self.now_ns,
                    lateness_ns,
                };
                self.last = self.tick.timed(time, || 0);
            }
        });
        assert_eq!(
            found, 0,
            "{}: allocations before {:?}",
            self.name, self.last
        );
    }

    fn script(&mut self, script: Script) {
        *lock(&self.script) = script;
    }

    /// The next model, with the present time stamp.
    fn next(&mut self) -> LocalModel {
        self.model.head.sequence += 1;
        self.model.head.time_ns = self.now_ns;
        self.model
    }

    /// Runs `ticks` ticks with a new model every `every` ticks, and empties the rings.
    fn live(&mut self, ends: &mut (HostEnd, LogEnd), ticks: u64, every: u64) {
        for k in 0..ticks {
            if k % every == 0 {
                let model = self.next();
                ends.0.publish(0, &model).expect("there is room");
            }
            self.ticks(1);
            ends.0.drain(|_| {});
            ends.1.drain(|_| {});
        }
    }

    fn expect(&self, host: HostState, safety: SafetyState) {
        let body = &self.last.bodies[0];
        assert_eq!(body.state, host, "{}: {body:?}", self.name);
        for device in self.last.devices() {
            assert_eq!(device.safety, safety, "{}: {device:?}", self.name);
        }
    }
}

#[test]
fn the_counter_counts() {
    let found = count(|| drop(std::hint::black_box(Box::new([0_u8; 64]))));
    assert_eq!(found, 2, "one allocation and its release");
}

#[test]
fn no_fault_makes_the_tick_allocate() {
    for name in SCHEMES {
        for handles in HANDLES {
            go_through_every_fault(name, handles);
        }
    }
}

fn go_through_every_fault(name: &str, handles: usize) {
    let (end, host, log) = link(&LinkConfig {
        // One body more than the controller has: a model may come for a body that does not exist.
        bodies: 2,
        stall: STALL as f64 * 1e-3,
        ..LinkConfig::new(1000.0, 250.0)
    });
    let script = Arc::new(Mutex::new(Script::Move));
    let devices = (0..handles).map(|index| scripted(index, &script));
    let controller = law(scheme(name), handles, Limits::WIDE);
    let mut run = Watched {
        name: format!("{name}, {handles}"),
        tick: TickLoop::new(controller, devices.collect(), end),
        script,
        now_ns: 0,
        // A period that keeps a blend going over ten ticks.
        model: model(handles, 0.02),
        last: Telemetry::empty(),
    };
    let mut ends = (host, log);

    run.ticks(10);
    run.expect(Waiting, Normal);
    run.live(&mut ends, 300, 2);
    run.expect(Live, Normal);

    models_that_cannot_be_used(&mut run, &mut ends.0);
    run.live(&mut ends, 20, 4);
    devices_that_fail(&mut run, &mut ends);
    forces_that_cannot_leave(&mut run, &mut ends, name);
    run.late_ticks(1, 5_000_000_000);
    assert_eq!(run.tick.latencies.lateness.overflow(), 1);
    // The loop stood still, so the force returns along a ramp.
    run.expect(Live, Silent);
    run.live(&mut ends, 300, 4);
    the_others_stall_and_go(&mut run, ends);
}

fn models_that_cannot_be_used(run: &mut Watched, host: &mut HostEnd) {
    let mut offer = |run: &mut Watched, body: usize, spoil: fn(&mut LocalModel)| {
        let mut model = run.next();
        spoil(&mut model);
        host.publish(body, &model).expect("there is room");
        run.ticks(1);
    };
    offer(run, 0, |model| model.damping[0][0][(5, 5)] = f64::NAN);
    offer(run, 0, |model| model.head.period = 0.0);
    offer(run, 0, |model| model.head.handle_count = 0);
    offer(run, 0, |model| model.head.handle_count = u8::MAX);
    offer(run, 0, |model| model.handles[0].device = u8::MAX);
    offer(run, 0, |model| model.head.time_ns = 0);
    offer(run, 1, |_| {});
    // Some models are lost before they arrive.
    offer(run, 0, |model| model.head.sequence += 7);
    let counters = run.tick.controller.coupling_counters().next();
    let counters = counters.expect("there is a body");
    assert_eq!(counters.not_finite, 2);
    assert_eq!(counters.wrong_handles, 3);
    assert_eq!(counters.outdated, 1);
    assert_eq!(run.tick.controller.stray_models(), 1);
    // Two models at once: the older one is superseded.
    for _ in 0..2 {
        let model = run.next();
        host.publish(0, &model).expect("there is room");
    }
    run.ticks(1);
    let link = run.tick.end.counters();
    assert!(
        link.lost_models >= 7 && link.superseded_models == 1,
        "{link:?}"
    );
}

fn devices_that_fail(run: &mut Watched, ends: &mut (HostEnd, LogEnd)) {
    let errors = [
        DeviceError::NoReport,
        DeviceError::Disconnected(19),
        DeviceError::Corrupt(Corruption::Length),
        DeviceError::Busy,
    ];
    for error in errors {
        run.script(Script::Fail(error));
        run.live(ends, u64::from(PATIENCE), 4);
        run.expect(Live, Normal);
        run.live(ends, 3, 4);
        run.expect(Live, Silent);
        run.script(Script::Move);
        run.live(ends, 10, 4);
        run.expect(Live, Recovering);
        run.live(ends, 300, 4);
        run.expect(Live, Normal);
    }
    run.script(Script::SayNotANumber);
    run.live(ends, u64::from(PATIENCE) + 1, 4);
    run.expect(Live, Silent);
    run.script(Script::Move);
    run.live(ends, 300, 4);
    run.expect(Live, Normal);

    for (script, safety) in [(Script::Rush, TooFast), (Script::Stray(9.0), OutOfReach)] {
        run.script(script);
        run.live(ends, 50, 4);
        run.expect(Live, safety);
        run.script(Script::Move);
        // A hand that appears at another place is accepted when it stays there.
        run.live(ends, u64::from(PATIENCE) + 11, 4);
        run.expect(Live, Recovering);
        run.live(ends, 300, 4);
        run.expect(Live, Normal);
    }

    run.script(Script::RefuseWrenches);
    let before = run.tick.refused_wrenches;
    run.live(ends, 10, 4);
    let refused = run.tick.refused_wrenches - before;
    assert_eq!(refused, 10 * u64::from(run.last.device_count));
    run.script(Script::Move);
}

fn forces_that_cannot_leave(run: &mut Watched, ends: &mut (HostEnd, LogEnd), scheme: &str) {
    let sound = run.model.handles;
    // The largest numbers overflow in the axes of the device.
    for (force, safety) in [(1e5, Limited), (f64::MAX, NotANumber)] {
        for handle in &mut run.model.handles {
            handle.wrench.force = Vec3::new(force, force, force);
        }
        run.live(ends, 50, 4);
        // The cap withholds such a force, in part or completely, because no hand has supplied its energy.
        if scheme != "capped" {
            run.expect(Live, safety);
        }
        run.model.handles = sound;
        // Every blend may end. Otherwise the rest of the force would fade from each blend to the next.
        run.live(ends, 400, 20);
        run.expect(Live, Normal);
    }
    // A hand out of all bounds would overflow in the extrapolation: its state is ignored.
    run.script(Script::Stray(f64::MAX));
    run.live(ends, 50, 4);
    run.expect(Live, Silent);
    run.script(Script::Move);
    run.live(ends, 400, 4);
    run.expect(Live, Normal);
}

fn the_others_stall_and_go(run: &mut Watched, ends: (HostEnd, LogEnd)) {
    let (mut host, log) = ends;
    // No ring is read, and no model comes.
    run.ticks(101);
    run.expect(Fading, Normal);
    run.ticks(400);
    run.expect(Held, Normal);
    let counters = run.tick.end.counters();
    assert!(counters.refused_records > 0 && counters.refused_telemetry > 0);
    // The host returns, then fails for good. The log has ended before.
    let model = run.next();
    host.publish(0, &model).expect("there is room");
    run.ticks(10);
    run.expect(Live, Normal);
    drop(log);
    run.ticks(10);
    assert!(run.tick.end.log_is_gone() && !run.tick.end.host_is_gone());
    drop(host);
    run.ticks(500);
    assert!(run.tick.end.host_is_gone());
    run.expect(Held, Normal);
    assert_eq!(
        count(|| run.tick.release(run.now_ns)),
        0,
        "{}: allocations at the end",
        run.name
    );
}
