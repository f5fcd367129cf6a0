//! The thread under the real clock. The tests assert counts and order, never durations.

mod common;

use common::{Trick, controller, lock, puppet, pushing};
use rt_core::Wrench;
use runner::latency::{DeviceTimes, LatencyHistogram};
use runner::link::{HostEnd, LinkConfig, LogEnd, TickEnd, link};
use runner::thread::SpawnError;
use runner::{CoreChoice, RunnerConfig, Stop, spawn};
use std::sync::Arc;

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
    // The two writes after the last tick belong to no tick. This device does not tell its motion to force.
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
        pushed |= record.devices[0].wrench.force.x > 0.5;
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
    let report = run.join().expect("nothing panics");
    assert_eq!(report.ticks, 20);
    assert_eq!(report.degradations, named);
}
