//! A strict loop: a forbidden call ends the loop in order and without force.
//!
//! If the kernel takes no filter of system calls, the tests are skipped with a visible line.

mod common;

use common::{Call, Seen, Trick, controller, lock, puppet, pushing, pushing_both};
use rt_core::Wrench;
use runner::link::{LinkConfig, link};
use runner::thread::{SpawnError, TickPanic};
use runner::trap::FilterError;
use runner::{CallPolicy, CoreChoice, RunnerConfig, Stop, TickReport, spawn};
use rustix::event::poll;
use rustix::io::{Errno, read, write};
use rustix::thread::{
    ClockId, NanosleepRelativeResult, clock_nanosleep_absolute, clock_nanosleep_relative, futex,
};
use rustix::time::{Timespec, clock_gettime};
use std::fs::File;
use std::io::Write as _;
use std::sync::atomic::AtomicU32;
use std::sync::{Arc, LazyLock, Mutex};

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

/// A run over one device; `None` if this system cannot watch system calls. In every case, the last wrench
/// is zero.
fn run(trick: Trick) -> Option<Ended> {
    run_with(CallPolicy::Simulated, trick)
}

fn run_with(policy: CallPolicy, trick: Trick) -> Option<Ended> {
    let (tick, mut host, _log) = link(&LinkConfig::new(1000.0, 60.0));
    host.publish(0, &pushing(1, 0)).expect("the ring is empty");
    let (puppet, seen) = puppet(trick);
    let stop = Arc::new(Stop::new());
    let config = RunnerConfig {
        calls: Some(policy),
        ..strict()
    };
    let thread = match spawn(config, controller(1), vec![puppet], tick, stop) {
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

/// A file that can be read and written, opened before any run.
static NULL: LazyLock<File> = LazyLock::new(|| {
    let mut options = File::options();
    options.read(true).write(true);
    options.open("/dev/null").expect("the file can be opened")
});
static FUTEX: AtomicU32 = AtomicU32::new(1);

/// Opens a file. The path is short, so the call allocates nothing.
fn open() -> Result<(), Errno> {
    let opened = File::open("/dev/null").map(drop);
    opened.map_err(|error| Errno::from_io_error(&error).expect("the system's error"))
}

/// Waits as for a lock that another thread holds. The expected number differs, so the wait would end at once.
fn wait(flags: futex::Flags) -> Result<(), Errno> {
    match futex::wait(&FUTEX, flags, 0, None) {
        Err(Errno::AGAIN) => Ok(()),
        other => other,
    }
}

fn wake(flags: futex::Flags) -> Result<(), Errno> {
    futex::wake(&FUTEX, flags, 1).map(drop)
}

const PAST: Timespec = Timespec {
    tv_sec: 1,
    tv_nsec: 0,
};

/// Calls with their names, and the number of policies (of `Simulated`, then `Hid`) that refuse them.
const CALLS: [(&str, usize, Call); 12] = [
    ("openat", 2, open),
    ("futex", 2, || wait(futex::Flags::PRIVATE)),
    ("futex", 2, || wait(futex::Flags::empty())),
    ("futex", 2, || wake(futex::Flags::empty())),
    ("clock_nanosleep", 2, || {
        clock_nanosleep_absolute(ClockId::Realtime, &PAST)
    }),
    ("clock_nanosleep", 2, || {
        match clock_nanosleep_relative(ClockId::Monotonic, &Timespec::default()) {
            NanosleepRelativeResult::Ok => Ok(()),
            NanosleepRelativeResult::Interrupted(_) => Err(Errno::INTR),
            NanosleepRelativeResult::Err(error) => Err(error),
        }
    }),
    // The trap makes this call for the standard error alone.
    ("write", 2, || write(&*NULL, b"text").map(drop)),
    ("read", 1, || read(&*NULL, &mut [0_u8; 8]).map(drop)),
    ("poll", 1, || {
        poll(&mut [], Some(&Timespec::default())).map(drop)
    }),
    ("", 0, || wake(futex::Flags::PRIVATE)),
    ("", 0, || {
        clock_nanosleep_absolute(ClockId::Monotonic, &PAST)
    }),
    // The kernel alone knows this clock.
    ("", 0, || {
        let _ = clock_gettime(ClockId::ThreadCPUTime);
        Ok(())
    }),
];

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
    LazyLock::force(&NULL);
    for (refusing, policy) in [(1, CallPolicy::Simulated), (2, CallPolicy::Hid)] {
        for (name, refused, call) in CALLS {
            let Some((result, seen)) = run_with(policy, Trick::Call(10, call)) else {
                return;
            };
            let report = result.expect("nothing panics");
            let outcome = lock(&seen).called.expect("the call was made");
            if refused < refusing {
                assert_eq!(outcome, Ok(()), "{policy:?}: {name}");
                assert_eq!((report.ticks, report.forbidden_call), (50, None), "{name}");
                continue;
            }
            assert_eq!(outcome, Err(Errno::PERM), "{policy:?}: {name}");
            let found = report.forbidden_call.expect("it was seen");
            assert_eq!((report.ticks, found.count), (10, 1), "{policy:?}: {name}");
            assert!(found.to_string().contains(name), "{name}: {found}");
        }
    }
}

#[test]
fn the_first_of_several_stray_calls_is_named_and_both_devices_are_released() {
    let (tick, mut host, _log) = link(&LinkConfig::new(1000.0, 60.0));
    (host.publish(0, &pushing_both(1, 0))).expect("the ring is empty");
    LazyLock::force(&NULL);
    let (first, seen_by_first) = puppet(Trick::Call(10, || write(&*NULL, b"text").map(drop)));
    let (second, seen_by_second) = puppet(Trick::Call(10, open));
    let stop = Arc::new(Stop::new());
    let Ok(thread) = spawn(strict(), controller(2), vec![first, second], tick, stop) else {
        // Another test of this file shows the reason.
        return;
    };
    let report = thread.join().expect("nothing panics");
    let call = report.forbidden_call.expect("it was seen");
    assert_eq!((call.number, call.count), (libc::SYS_write, 2));
    assert!(call.to_string().ends_with(", the first of 2"), "{call}");
    for seen in [seen_by_first, seen_by_second] {
        let seen = lock(&seen);
        assert!(
            seen.wrenches[..10]
                .iter()
                .any(|wrench| wrench.force.x != 0.0)
        );
        assert_eq!(seen.wrenches[10..], [Wrench::zero(); 2]);
    }
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
