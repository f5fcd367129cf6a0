//! The thread under the real clock. The tests assert counts and order, never durations.

mod common;

use common::{Seen, Trick, controller, lock, puppet, pushing, pushing_both};
use devices::scripted::{Scripted, small};
use rt_core::{DeviceError, DeviceState, Freedom, Wrench};
use runner::latency::{DeviceTimes, LatencyHistogram};
use runner::link::{HostEnd, LinkConfig, LogEnd, TickEnd, link};
use runner::thread::{SpawnError, TickPanic};
use runner::{CoreChoice, RunnerConfig, Stop, TickLoop, TickReport, spawn};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard};

fn ends() -> (TickEnd, HostEnd, LogEnd) {
    link(&LinkConfig::new(1000.0, 60.0))
}

/// A configuration without the resources that a test machine may refuse.
fn modest(ticks: u64) -> RunnerConfig {
    RunnerConfig {
        ticks: Some(ticks),
        core: CoreChoice::Anywhere,
        priority: None,
        lock_memory: false,
        keep_awake: false,
        ..RunnerConfig::default()
    }
}

#[test]
fn a_run_adds_up_and_ends_without_force() {
    let (tick, mut host, mut log) = ends();
    host.publish(0, &pushing(1, 0)).expect("the ring is empty");
    let (puppet, seen) = puppet(Trick::None);
    let run = spawn(
        modest(300),
        controller(1),
        vec![puppet],
        tick,
        Arc::new(Stop::new()),
    )
    .expect("it can run");
    assert!(run.degradations().is_empty());
    let tick_time = run.tick_time();
    // The times can be read while the loop runs.
    while !run.is_finished() {
        let summary = tick_time.read().summary();
        assert!(summary.count <= 300 && summary.min <= summary.max);
    }
    let report = run.join().expect("nothing panics");
    let (during, end) = (tick_time.read(), &report.latencies.tick_time);
    assert!(during.intervals().eq(end.intervals()) && during.summary() == end.summary());

    assert_eq!(report.ticks, 300);
    assert_eq!(report.ticks + report.missed_deadlines, report.slots);
    let times = &report.latencies;
    assert_eq!(
        (times.lateness.count(), times.tick_time.count()),
        (300, 300)
    );
    // The model was published before the first tick.
    assert_eq!(times.model_age.len(), 1);
    assert_eq!(times.model_age[0].count(), 300);
    // The two writes after the last tick belong to no tick. This device does not report its motion to force.
    assert_eq!(times.devices.len(), 1);
    let counts = |times: &DeviceTimes| {
        let histograms = [&times.read, &times.write, &times.motion_to_force];
        histograms.map(LatencyHistogram::count)
    };
    assert_eq!(counts(&times.devices[0]), [300, 300, 0]);
    assert_eq!(
        (report.refused_wrenches, report.controller.stray_models()),
        (0, 0)
    );

    // The force has been rendered, and is zero at the end.
    let seen = lock(&seen);
    assert_eq!((seen.reads, seen.writes), (300, 302));
    assert_eq!(seen.last, Some(Wrench::zero()));
    let mut pushed = false;
    let mut times_ns = Vec::new();
    log.drain(|record| {
        // On a busy machine, the ticks are late again and again, and the force grows little.
        pushed |= record.devices[0].wrench.force.x > 0.0;
        assert_eq!(record.tick as usize, times_ns.len());
        times_ns.push(record.time_ns);
    });
    assert!(pushed);
    // Nominal times are on the grid, in order, and equal to the times that the device was given.
    assert_eq!(times_ns, seen.times_ns);
    assert_eq!(times_ns[0], 0);
    assert!(times_ns.windows(2).all(|pair| pair[1] > pair[0]));
    assert!(times_ns.iter().all(|time| time % 1_000_000 == 0));
    assert_eq!(host.drain(|_| ()), 300);
    assert!(host.tick_is_gone() && log.tick_is_gone());
}

#[test]
fn a_device_that_blocks_once_costs_deadlines_and_nothing_else() {
    let (tick, _host, _log) = ends();
    let (puppet, seen) = puppet(Trick::Spin(20, 5_500_000));
    let run = spawn(
        modest(60),
        controller(1),
        vec![puppet],
        tick,
        Arc::new(Stop::new()),
    )
    .expect("it can run");
    let report = run.join().expect("nothing panics");
    assert_eq!(report.ticks, 60);
    // 5.5 ms from a point after the deadline span at least five whole periods.
    assert!(report.longest_miss >= 5, "{}", report.longest_miss);
    assert!(report.missed_deadlines >= report.longest_miss);
    assert_eq!(report.ticks + report.missed_deadlines, report.slots);
    assert!(report.latencies.tick_time.summary().max >= 5_500_000);
    assert!(report.latencies.devices[0].read.summary().max >= 5_500_000);
    // The devices' time has advanced by the skipped deadlines.
    let times = &lock(&seen).times_ns;
    assert!(times[20] - times[19] >= 6_000_000);
    // The deadlines that the last tick missed come after it.
    assert!(times[59] <= (report.slots - 1) * 1_000_000);
}

#[test]
fn a_panic_in_a_device_comes_back_as_an_error_and_leaves_no_force() {
    let (tick, host, _log) = ends();
    let (broken, seen_by_broken) = puppet(Trick::Panic(10));
    let (whole, seen_by_whole) = puppet(Trick::None);
    let run = spawn(
        modest(1000),
        controller(2),
        vec![broken, whole],
        tick,
        Arc::new(Stop::new()),
    )
    .expect("it can run");
    let panic = run.join().expect_err("the device panics");
    assert_eq!(
        (panic.message.as_str(), panic.ticks),
        ("the cable was cut", 9)
    );
    assert!(panic.to_string().contains("after 9 ticks"));
    for seen in [seen_by_broken, seen_by_whole] {
        assert_eq!(lock(&seen).last, Some(Wrench::zero()));
    }
    assert!(host.tick_is_gone());
}

/// A run of two devices that a model pushes in opposite directions, and the calls that the devices received.
fn pair(
    config: RunnerConfig,
    tricks: [Trick; 2],
) -> (Result<TickReport, TickPanic>, [Arc<Mutex<Seen>>; 2]) {
    let (tick, mut host, _log) = ends();
    (host.publish(0, &pushing_both(1, 0))).expect("the ring is empty");
    let [(first, by_first), (second, by_second)] = tricks.map(puppet);
    let stop = Arc::new(Stop::new());
    let run = spawn(config, controller(2), vec![first, second], tick, stop).expect("it can run");
    (run.join(), [by_first, by_second])
}

/// Checks that a device was pushed in its ticks, and that two commands of zero force followed, after `ticks` writes. On a
/// machine that stalls, the loop may have let go meanwhile.
fn assert_released(seen: &MutexGuard<'_, Seen>, ticks: usize, case: &str) {
    assert_eq!(seen.wrenches.len(), ticks + 2, "{case}");
    let (during, end) = seen.wrenches.split_at(ticks);
    assert_eq!(end, [Wrench::zero(); 2], "{case}");
    assert!(during.iter().any(|wrench| wrench.force.x != 0.0), "{case}");
}

#[test]
fn each_device_is_released_however_the_loop_ends_and_whatever_the_other_does() {
    use Trick::{None, Panic, PanicInWrites, RefuseWrites, Spin};
    let (cable, motor) = ("the cable was cut", "the motor was cut");
    // The ticks, the message of the panic that ends the loop, and the writes of each device in its ticks.
    let cases = [
        ([None, None], 40, "", [40, 40]),
        // After a pause in the last tick but one.
        ([Spin(39, 3_500_000), None], 40, "", [40, 40]),
        ([None, Spin(39, 3_500_000)], 40, "", [40, 40]),
        // A panic while the devices are read: neither is written in that tick.
        ([Panic(10), None], 9, cable, [9, 9]),
        ([None, Panic(10)], 9, cable, [9, 9]),
        // A panic while they are written.
        ([PanicInWrites(10), None], 9, motor, [10, 9]),
        ([None, PanicInWrites(10)], 9, motor, [10, 10]),
        // A panic of a release: a run that has rendered all its ticks is reported as a panic.
        ([PanicInWrites(41), None], 40, motor, [40, 40]),
        ([None, PanicInWrites(42)], 40, motor, [40, 40]),
        ([RefuseWrites(41), None], 40, "", [40, 40]),
        ([RefuseWrites(31), RefuseWrites(41)], 40, "", [40, 40]),
    ];
    for (tricks, ticks, message, writes) in cases {
        let case = format!("{tricks:?}");
        let (outcome, seen) = pair(modest(40), tricks);
        match outcome {
            Ok(report) => {
                assert_eq!((report.ticks, message), (ticks, ""), "{case}");
                // The refusals of the release are not counted.
                let refused = if case.contains("31") { 10 } else { 0 };
                assert_eq!(report.refused_wrenches, refused, "{case}");
                assert_eq!(report.ticks + report.missed_deadlines, report.slots);
            }
            Err(panic) => {
                assert_eq!((panic.ticks, &*panic.message), (ticks, message), "{case}");
            }
        }
        for (seen, writes) in seen.iter().zip(writes) {
            assert_released(&lock(seen), writes, &case);
        }
    }
}

#[test]
fn a_loop_without_a_thread_releases_both_devices_though_one_refuses() {
    for tricks in [
        [Trick::RefuseWrites(1), Trick::None],
        [Trick::None, Trick::RefuseWrites(1)],
    ] {
        let (tick, mut host, _log) = ends();
        (host.publish(0, &pushing_both(1, 0))).expect("the ring is empty");
        let [(first, by_first), (second, by_second)] = tricks.map(puppet);
        let mut tick_loop = TickLoop::new(controller(2), vec![first, second], tick);
        for k in 0..20 {
            tick_loop.tick(k * 1_000_000);
        }
        tick_loop.release(20_000_000);
        assert_eq!((tick_loop.ticks, tick_loop.refused_wrenches), (20, 20));
        for seen in [by_first, by_second] {
            assert_released(&lock(&seen), 20, &format!("{tricks:?}"));
        }
    }
}

/// Bounds of a start of the grid (ns): the clock at which a tick woke is that of its deadline plus its lateness. It lies
/// after the last write of the tick before, and before the first read of the tick.
fn check_lateness(config: RunnerConfig, tricks: [Trick; 2]) {
    let (tick, mut host, mut log) = ends();
    (host.publish(0, &pushing_both(1, 0))).expect("the ring is empty");
    let [(first, by_first), (second, by_second)] = tricks.map(puppet);
    let stop = Arc::new(Stop::new());
    let run = spawn(config, controller(2), vec![first, second], tick, stop).expect("it can run");
    let report = run.join().expect("nothing panics");
    let (read_at, written_at) = (&lock(&by_first).read_at, &lock(&by_second).written_at);
    let (mut earliest, mut latest) = (i128::MIN, i128::MAX);
    let (mut sum, mut largest, mut tick) = (0, 0, 0);
    log.drain(|record| {
        let offset = i128::from(record.time_ns) + i128::from(record.lateness_ns);
        latest = latest.min(i128::from(read_at[tick]) - offset);
        if let Some(before) = tick.checked_sub(1) {
            earliest = earliest.max(i128::from(written_at[before]) - offset);
        }
        sum += record.lateness_ns;
        largest = largest.max(record.lateness_ns);
        tick += 1;
    });
    assert_eq!(tick as u64, report.ticks);
    assert!(earliest <= latest, "{config:?}: {earliest} > {latest}");
    // No timer wakes a thread at the nanosecond, in any of some hundred ticks.
    assert!(sum > 0);
    let summary = report.latencies.lateness.summary();
    assert_eq!((summary.count, summary.max), (report.ticks, largest));
    assert!((summary.mean * report.ticks as f64 - sum as f64).abs() < 1e-9 * sum as f64);
    // The duration of a tick contains the time from its first read to its last write. The writes at the end are not in a
    // tick.
    let spans = read_at
        .iter()
        .zip(written_at)
        .map(|(read, written)| written - read);
    let times = report.latencies.tick_time.summary();
    assert_eq!(times.count, report.ticks);
    assert!(times.max >= spans.clone().max().expect("a tick"));
    assert!(times.min >= spans.min().expect("a tick"));
}

#[test]
fn a_tick_is_late_by_the_time_from_its_deadline_to_its_waking() {
    let none = [Trick::None; 2];
    check_lateness(modest(200), none);
    // A tick that lasts longer than its period does not make the next one late: its deadline is a later one.
    check_lateness(modest(100), [Trick::Spin(20, 3_500_000), Trick::None]);
    check_lateness(modest(100), [Trick::None, Trick::Spin(20, 3_500_000)]);
    // Every deadline of this grid is past when the loop comes to it, so every tick is late.
    let period_ns = 1;
    check_lateness(
        RunnerConfig {
            period_ns,
            ..modest(2_000)
        },
        none,
    );
}

#[test]
fn the_report_tells_of_each_device_and_of_no_model_before_the_first() {
    let (tick, mut host, _log) = ends();
    // One device reports its motion to force in every third tick; the other device never does.
    let device = |every, ns| {
        let read = |_| Ok(DeviceState::resting());
        Telling {
            device: Scripted::new(small(Freedom::Three), read, |_, _: &Wrench| Ok(())),
            every,
            ns,
            asked: 0.into(),
        }
    };
    let devices = vec![Box::new(device(3, 700)) as _, Box::new(device(4, 900)) as _];
    let mut tick_loop = TickLoop::new(controller(2), devices, tick);
    for k in 0..30 {
        if k == 10 {
            // Twenty ticks have this model; the first ten have none.
            (host.publish(0, &pushing_both(1, 10_000_000))).expect("the ring is empty");
        }
        if k == 6 {
            // The loop measures nothing until a caller asks for it.
            assert!(tick_loop.latencies.devices.is_empty());
            tick_loop.measure_devices();
        }
        tick_loop.tick(k * 1_000_000);
    }
    let ages = tick_loop.latencies.model_age[0].summary();
    assert_eq!((ages.count, ages.min, ages.max), (20, 0, 19_000_000));
    let counts = |times: &DeviceTimes| {
        [&times.read, &times.write, &times.motion_to_force].map(LatencyHistogram::count)
    };
    let [first, second] = &tick_loop.latencies.devices[..] else {
        panic!("two devices")
    };
    assert_eq!((counts(first), counts(second)), ([24, 24, 8], [24, 24, 6]));
    let shown = [first, second].map(|times| times.motion_to_force.summary());
    assert_eq!(
        shown.map(|shown| (shown.min, shown.max)),
        [(700, 700), (900, 900)]
    );
}

/// A device that reports its motion to force (ns) in every few ticks.
struct Telling<D> {
    device: D,
    every: u64,
    ns: u64,
    asked: std::cell::Cell<u64>,
}

impl<D: rt_core::Device> rt_core::Device for Telling<D> {
    fn capabilities(&self) -> rt_core::Capabilities {
        self.device.capabilities()
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        self.device.read(now_ns)
    }

    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        self.device.write(now_ns, wrench)
    }

    fn motion_to_force_ns(&self) -> Option<u64> {
        self.asked.set(self.asked.get() + 1);
        self.asked
            .get()
            .is_multiple_of(self.every)
            .then_some(self.ns)
    }
}

#[test]
fn a_panic_is_reported_with_its_message_if_it_has_one() {
    let with = |panic: fn()| {
        let (tick, _host, _log) = ends();
        let mut reads = 0;
        let read = move |_| {
            reads += 1;
            if reads == 3 {
                panic();
            }
            Ok(DeviceState::resting())
        };
        let device = Scripted::new(small(Freedom::Three), read, |_, _: &Wrench| Ok(()));
        let devices = vec![Box::new(device) as _];
        let run = spawn(
            modest(20),
            controller(1),
            devices,
            tick,
            Arc::new(Stop::new()),
        );
        run.expect("it can run").join().expect_err("a panic")
    };
    assert_eq!(with(|| panic!("a text")).message, "a text");
    assert_eq!(with(|| panic!("{} texts", 2)).message, "2 texts");
    let without = with(|| std::panic::panic_any(7));
    assert_eq!(
        (&*without.message, without.ticks),
        ("a panic without a message", 2)
    );
}

#[test]
fn a_request_to_stop_comes_from_its_flag_and_from_the_thread() {
    let endless = RunnerConfig {
        ticks: None,
        ..modest(0)
    };
    for by_flag in [true, false] {
        let stop = Arc::new(Stop::new());
        assert!(!stop.is_requested());
        let (puppet, seen) = puppet(Trick::None);
        let run = spawn(
            endless,
            controller(1),
            vec![puppet],
            ends().0,
            Arc::clone(&stop),
        )
        .expect("it can run");
        while run.ticks() < 5 {
            std::thread::yield_now();
        }
        if by_flag {
            stop.flag().store(true, Ordering::Relaxed);
        } else {
            run.stop();
        }
        assert!(stop.is_requested());
        let report = run.join().expect("nothing panics");
        assert_eq!(lock(&seen).writes, report.ticks + 2);
    }
}

#[test]
fn a_loop_without_end_ends_when_asked_or_dropped() {
    let endless = RunnerConfig {
        ticks: None,
        ..modest(0)
    };
    let (tick, host, log) = ends();
    // The host ends; the tick continues.
    drop((host, log));
    let stop = Arc::new(Stop::new());
    let run = spawn(
        endless,
        controller(1),
        vec![puppet(Trick::None).0],
        tick,
        Arc::clone(&stop),
    )
    .expect("it can run");
    while run.ticks() < 20 {
        std::thread::yield_now();
    }
    assert!(!run.is_finished());
    stop.request();
    let report = run.join().expect("nothing panics");
    assert!(report.ticks >= 20);
    assert_eq!(report.link.refused_records, 0);

    let (tick, host, _log) = ends();
    let run = spawn(
        endless,
        controller(0),
        Vec::new(),
        tick,
        Arc::new(Stop::new()),
    )
    .expect("it can run");
    drop(run);
    assert!(host.tick_is_gone());
}

#[test]
fn an_impossible_configuration_is_refused() {
    let stop = Arc::new(Stop::new());
    let config = RunnerConfig {
        period_ns: 0,
        ..modest(1)
    };
    let refused = spawn(
        config,
        controller(0),
        Vec::new(),
        ends().0,
        Arc::clone(&stop),
    );
    assert!(matches!(refused, Err(SpawnError::NoPeriod)));
    let refused = spawn(
        modest(1),
        controller(2),
        vec![puppet(Trick::None).0],
        ends().0,
        stop,
    );
    assert!(matches!(
        refused,
        Err(SpawnError::Devices {
            expected: 2,
            found: 1
        })
    ));
}

#[test]
fn each_refusal_of_the_system_is_named_once_and_the_run_continues() {
    let (tick, _host, _log) = ends();
    let config = RunnerConfig {
        ticks: Some(20),
        ..RunnerConfig::default()
    };
    let run = spawn(
        config,
        controller(1),
        vec![puppet(Trick::None).0],
        tick,
        Arc::new(Stop::new()),
    )
    .expect("it can run");
    let named = run.degradations().to_vec();
    // At most one degradation each for core, priority, sleep states and memory.
    assert!(named.len() <= 4);
    assert_eq!(
        run.core().is_some(),
        !named.iter().any(|d| d.missing.contains("pinned"))
    );
    for degradation in &named {
        let line = degradation.to_string();
        assert!(!line.contains('\n') && line.len() > 40, "{line}");
        println!("{line}");
    }
    println!("{} bytes locked", run.locked_bytes());
    let (core, locked) = (run.core(), run.locked_bytes());
    let report = run.join().expect("nothing panics");
    assert_eq!(report.ticks, 20);
    assert_eq!(report.degradations, named);
    assert_eq!((report.core, report.locked_bytes), (core, locked));
    if !named.iter().any(|d| d.missing.contains("locked")) {
        // The stack, the loop with its controller, and the rings.
        let rings = 5001 * (size_of::<rt_core::Telemetry>() + size_of::<rt_core::TickRecord>());
        let own = size_of::<TickLoop>() + size_of::<rt_core::Controller>();
        assert!(
            locked >= runner::memory::STACK_AHEAD + own + rings,
            "{locked}"
        );
    }
}

/// A configuration that asks for a core that no test machine has.
fn without_core(require_grants: bool) -> RunnerConfig {
    RunnerConfig {
        core: CoreChoice::Id(1023),
        require_grants,
        ..modest(10)
    }
}

#[test]
fn a_refusal_of_the_system_ends_a_run_only_where_the_grant_is_required() {
    let start = |config: RunnerConfig| {
        let stop = Arc::new(Stop::new());
        spawn(
            config,
            controller(1),
            vec![puppet(Trick::None).0],
            ends().0,
            stop,
        )
    };
    let run = start(without_core(false)).expect("the core is not required");
    let [degradation] = run.degradations() else {
        panic!("{:?}", run.degradations())
    };
    let line = degradation.to_string();
    assert!(line.contains("1023"), "{line}");
    assert_eq!((run.core(), run.locked_bytes()), (None, 0));
    let report = run.join().expect("nothing panics");
    assert_eq!(
        (report.ticks, report.core, report.isolated),
        (10, None, false)
    );
    match start(without_core(true)) {
        Err(error @ SpawnError::NotGranted(_)) => {
            let text = error.to_string();
            assert_eq!(text.lines().nth(1), Some(&*format!("  {line}")), "{text}");
        }
        other => panic!("{other:?}"),
    }
    // A run that gets all that it asks for starts, though it requires every grant.
    let strict = RunnerConfig {
        require_grants: true,
        ..modest(10)
    };
    let report = start(strict).expect("nothing is refused").join();
    assert_eq!(report.expect("nothing panics").ticks, 10);
}

/// A tick that the system holds up while it computes has old commands.
#[test]
fn a_tick_whose_computation_took_too_long_commands_nothing() {
    let (tick, mut host, _log) = ends();
    let (puppet, seen) = puppet(Trick::None);
    let mut tick_loop = TickLoop::new(controller(1), vec![puppet], tick);
    host.publish(0, &pushing(1, 0)).expect("the ring is empty");
    for k in 0..300_u64 {
        let took_ns = if k == 299 { 50_000_000 } else { 0 };
        tick_loop.timed((k * 1_000_000).into(), || took_ns);
    }
    let wrenches = &lock(&seen).wrenches;
    assert!(wrenches[298].force.x > 0.5);
    assert_eq!(wrenches[299], Wrench::zero());
}
