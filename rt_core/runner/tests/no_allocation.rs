//! A tick with its rings and histograms allocates nothing, as an allocator that counts shows.

mod common;

use alloc_count::calls::{Counting, count};
use common::{Trick, controller, floor, puppet, pushing};
use rt_core::TickTime;
use runner::latency::recorder;
use runner::link::{LinkConfig, link};
use runner::{CoreChoice, LatencyHistogram, RunnerConfig, Stop, TickLoop, spawn};
use std::sync::Arc;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn no_tick_allocates_whatever_the_rings_hold() {
    let mut config = LinkConfig {
        stall: 0.05,
        ..LinkConfig::new(1000.0, 100.0)
    };
    config.tools[0] = true;
    let (tick, mut host, _log) = link(&config);
    let mut tick_loop = TickLoop::new(controller(1), vec![puppet(Trick::None).0], tick);
    let (mut tick_time, reader) = recorder(1_000_000_000);
    let mut sequence = 0;
    // The log is never read, so its ring is full from tick 52 on. The host reads every 70 ticks.
    for k in 0..1000_u64 {
        let now = k * 1_000_000;
        for _ in 0..k % 3 {
            sequence += 1;
            let _ = host.publish(0, &pushing(sequence, now + sequence % 2));
            let _ = host.publish_patch(0, &floor(sequence, now + sequence % 2));
        }
        let found = count(|| {
            let time = TickTime {
                now_ns: now,
                lateness_ns: k % 2_000,
            };
            tick_loop.timed(time, || k % 3_000);
            tick_time.record(k * k * k * 10);
        });
        assert_eq!(found, 0, "tick {k}");
        if k % 70 == 0 {
            host.drain(|_| ());
        }
    }
    let counters = tick_loop.end.counters();
    assert!(counters.refused_records > 0 && counters.refused_telemetry > 0);
    assert!(counters.superseded_models > 0 && counters.superseded_patches > 0);
    // The handle stays at the origin, where the tool comes to press on the floor.
    let tool = tick_loop.controller.tools().next().expect("a tool");
    assert!(tool.counters().accepted > 300 && tool.tool().wrench().force.z > 0.9);
    assert!(reader.read().overflow() > 0);
    assert_eq!(tick_loop.ticks, 1000);
}

#[test]
fn the_counter_counts() {
    assert!(count(|| drop(LatencyHistogram::new(1000))) > 0);
}

/// The calls of the allocator that the report of a loop with `trick` names.
fn reported(trick: Trick) -> Option<u64> {
    let (tick, _host, _log) = link(&LinkConfig::new(1000.0, 60.0));
    let config = RunnerConfig {
        ticks: Some(20),
        core: CoreChoice::Anywhere,
        priority: None,
        lock_memory: false,
        keep_awake: false,
        ..RunnerConfig::default()
    };
    let devices = vec![puppet(trick).0];
    let stop = Arc::new(Stop::new());
    let thread = spawn(config, controller(1), devices, tick, stop).expect("the loop starts");
    thread.join().expect("nothing panics").allocator_calls
}

#[test]
fn the_report_of_a_loop_counts_the_calls_in_its_ticks_alone() {
    assert_eq!(reported(Trick::None), Some(0));
    // An allocation and its end.
    assert_eq!(reported(Trick::Allocate(10)), Some(2));
}
