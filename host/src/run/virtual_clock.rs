//! A run under virtual time: devices, hands, host and log on one clock, in one thread. The host's threads share the
//! work of a step only.
//!
//! The host is [`Paced`]. Its stopwatch, which measures the time of a stage, reads the processor time of its thread. The
//! readings never enter the state: two runs give the same bytes under any load.

use super::paced::Paced;
use super::panics;
use super::setup::{Running, Setup};
use super::timeline::{Host, Timeline};
use crate::engine::Engine;
use core::convert::Infallible;
use rt_core::Telemetry;
use runner::Stop;
use runner::TickLoop;
use runner::link::LogRecord;
use std::time::{Duration, Instant};

/// Longest time on the wall between two reports of progress, unless a single step takes longer.
const SAID: Duration = Duration::from_millis(100);

/// Runs `setup` for its whole length. `sink` is given every tick's telemetry in order, and each model before the
/// ticks that used it. From time to time `progress` is given the number of ticks done.
pub fn run(setup: Setup, sink: impl FnMut(LogRecord<'_>), progress: impl FnMut(u64)) -> Running {
    run_seen(setup, |_, _, _| {}, sink, progress)
}

/// As [`run`]. Ends after the tick during which `stop` was requested.
pub(super) fn run_until(
    setup: Setup,
    stop: &Stop,
    sink: impl FnMut(LogRecord<'_>),
    progress: impl FnMut(u64),
) -> Running {
    run_seen_until(setup, stop, |_, _, _| {}, sink, progress)
}

/// As [`run`]. After each tick, `see` is given the tick's side with the simulated devices, the record of the tick, and
/// the physics, which is absent after a panic of the host.
pub fn run_seen(
    setup: Setup,
    see: impl FnMut(&TickLoop, &Telemetry, Option<&Engine>),
    sink: impl FnMut(LogRecord<'_>),
    progress: impl FnMut(u64),
) -> Running {
    run_seen_until(setup, &Stop::new(), see, sink, progress)
}

fn run_seen_until(
    setup: Setup,
    stop: &Stop,
    mut see: impl FnMut(&TickLoop, &Telemetry, Option<&Engine>),
    mut sink: impl FnMut(LogRecord<'_>),
    mut progress: impl FnMut(u64),
) -> Running {
    let timing = setup.timing;
    let (mut tick, mut log, host) = Paced::of(setup, |link| link);
    let mut host = CatchPanic::new(host);
    let timeline = Timeline {
        period_ns: timing.period_ns,
        ticks: timing.ticks,
    };
    let mut done = 0;
    let mut said = Instant::now();
    // A request to stop is the only error.
    let _ = timeline.drive(&mut host, |host, now_ns| {
        let telemetry = tick.tick(now_ns);
        let engine = host.panicked.is_none().then(|| host.host.engine());
        see(&tick, &telemetry, engine);
        log.records(&mut sink);
        // Large bodies take long for a step: a person who waits sees something by the clock on the wall, too.
        if done % 256 == 0 || said.elapsed() > SAID {
            said = Instant::now();
            progress(done);
        }
        done += 1;
        if stop.is_requested() {
            return Err(Stopped);
        }
        Ok(())
    });
    tick.release(done * timing.period_ns);
    Running {
        tick,
        log,
        host: host.host.into_side(),
        panicked: host.panicked,
    }
}

/// The run was asked to end.
struct Stopped;

/// A host that may panic. After a panic the host does nothing more, as under the real clock, and the tick continues.
/// Its counts are kept for the summary.
struct CatchPanic<H> {
    host: H,
    /// The text of the panic, after a panic.
    panicked: Option<String>,
}

impl<H> CatchPanic<H> {
    fn new(host: H) -> Self {
        Self {
            host,
            panicked: None,
        }
    }
}

impl<H: Host<Error = Infallible>> Host for CatchPanic<H> {
    type Error = Stopped;

    fn next_ns(&self) -> Option<u64> {
        match self.panicked {
            None => self.host.next_ns(),
            Some(_) => None,
        }
    }

    fn step(&mut self) -> Result<(), Stopped> {
        let host = &mut self.host;
        self.panicked = panics::caught(|| host.step()).err();
        Ok(())
    }

    fn deliver(&mut self, now_ns: u64) {
        if self.panicked.is_none() {
            self.host.deliver(now_ns);
        }
    }
}
