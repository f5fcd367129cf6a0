//! A strict loop: a forbidden call ends the loop in order and without force.
//!
//! The tests are skipped with a visible line where the kernel takes no filter of system calls.

mod common;

use common::{Seen, Trick, controller, lock, puppet, pushing};
use rt_core::Wrench;
use runner::link::{LinkConfig, link};
use runner::seccomp::FilterError;
use runner::thread::{SpawnError, TickPanic};
use runner::{CallPolicy, CoreChoice, RunnerConfig, Stop, TickReport, spawn};
use std::io::Write as _;
use std::sync::{Arc, Mutex};

fn strict() -> RunnerConfig {
    RunnerConfig {
        ticks: Some(50),
        core: CoreChoice::Anywhere,
        priority: None,
        lock_memory: false,
        keep_awake: false,
        calls: Some(CallPolicy::Simulated),
        ..RunnerConfig::default()
    }
}

/// The end of a run, and the calls that its device received.
type Ended = (Result<TickReport, TickPanic>, Arc<Mutex<Seen>>);

/// A run over one device; `None` where this system cannot watch system calls. In every case, the last wrench
/// is zero.
fn run(trick: Trick) -> Option<Ended> {
    let (tick, mut host, _log) = link(&LinkConfig::new(1000.0, 60.0));
    host.publish(0, &pushing(1, 0)).expect("the ring is empty");
    let (puppet, seen) = puppet(trick);
    let stop = Arc::new(Stop::new());
    let thread = match spawn(strict(), controller(1), vec![puppet], tick, stop) {
        Ok(thread) => thread,
        Err(SpawnError::Filter(error @ (FilterError::Platform | FilterError::Refused(_)))) => {
            // Not `eprintln`, whose output the test harness captures.
            let _ = writeln!(std::io::stderr(), "\n!! SKIPPED: strict loops: {error}");
            return None;
        }
        Err(error) => panic!("{error}"),
    };
    let result = thread.join();
    assert_eq!(lock(&seen).last, Some(Wrench::zero()));
    Some((result, seen))
}

#[test]
fn a_loop_that_keeps_to_its_calls_runs_to_its_end() {
    let Some((result, _)) = run(Trick::None) else {
        return;
    };
    let report = result.expect("nothing panics");
    assert_eq!((report.ticks, report.forbidden_call), (50, None));
}

#[test]
fn a_stray_call_is_refused_and_ends_the_loop_after_its_tick() {
    let Some((result, _)) = run(Trick::Call(10)) else {
        return;
    };
    let report = result.expect("nothing panics");
    let call = report.forbidden_call.expect("it was seen");
    assert_eq!((report.ticks, call.count), (10, 1));
    assert_eq!(call.number, libc::SYS_getppid);
    assert!(call.to_string().contains("getppid"), "{call}");
}

#[test]
fn memory_from_the_system_is_noted_but_given() {
    let Some((result, seen)) = run(Trick::Allocate(10)) else {
        return;
    };
    let report = result.expect("it got its memory");
    let call = report.forbidden_call.expect("it was seen");
    assert_eq!(report.ticks, 10);
    // The 64 MB are available: they were written and read.
    assert_eq!(lock(&seen).writes, 10 + 2);
    assert!(
        ["mmap", "brk"]
            .iter()
            .any(|name| call.to_string().contains(name)),
        "{call}"
    );
}

#[test]
fn a_panic_under_the_filter_is_still_reported() {
    let Some((result, _)) = run(Trick::Panic(10)) else {
        return;
    };
    let panic = result.expect_err("the device panics");
    assert_eq!(
        (panic.message.as_str(), panic.ticks),
        ("the cable was cut", 9)
    );
}

#[test]
fn a_loop_that_requires_grants_does_not_tick_after_a_refusal() {
    let (tick, _host, mut log) = link(&LinkConfig::new(1000.0, 60.0));
    let (puppet, seen) = puppet(Trick::None);
    let config = RunnerConfig {
        // No machine that runs this test has such a core.
        core: CoreChoice::Id(1023),
        require_grants: true,
        calls: None,
        ..strict()
    };
    let stop = Arc::new(Stop::new());
    match spawn(config, controller(1), vec![puppet], tick, stop) {
        Err(SpawnError::NotGranted(missing)) => assert_eq!(missing.len(), 1),
        other => panic!("{other:?}"),
    }
    assert_eq!(lock(&seen).last, Some(Wrench::zero()));
    assert_eq!(log.drain(|_| ()), 0);
    assert!(log.tick_is_gone());
}
