//! A run under virtual time: devices, hands, host and log on one clock, in one thread. The host's threads share the
//! work of a step only.
//!
//! A host step starts when it is due and the host is free. The step sees the records of the ticks before its due time,
//! and its model arrives after the scene's latency. Only the stopwatch, which measures the time of a stage, reads the
//! machine's clock. Its readings never enter the state: two runs give the same bytes under any load.

use super::late::LateLink;
use super::panics;
use super::setup::{HostSide, Running, Setup};
use super::slow_host::SlowWatch;
use super::taps::Taps;
use super::timeline::{Host, Timeline};
use crate::engine::Engine;
use crate::engine::faults::Failing;
use crate::engine::pacer::Pacer;
use crate::engine::records::Records;
use crate::engine::stats::WallStopwatch;
use crate::engine::threads::{Threads, awake};
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
    let Setup {
        mut tick,
        host,
        mut log,
        engine,
        threads,
        faults,
        taps,
        pacer,
        slow,
        timing,
        told: _,
    } = setup;
    let bodies = engine.bodies().len();
    let mut host = CatchPanic::new(Paced {
        engine: Failing::new(engine, faults),
        taps,
        threads,
        pacer,
        slow,
        link: LateLink::new(host, bodies),
        records: Records::new(timing.period_ns),
        latency_ns: timing.latency_ns,
        free_at: 0,
        watch: WallStopwatch::start(),
    });
    let timeline = Timeline {
        period_ns: timing.period_ns,
        ticks: timing.ticks,
    };
    let mut done = 0;
    let mut said = Instant::now();
    // A request to stop is the only error.
    let _ = timeline.drive(&mut host, |host, now_ns| {
        let telemetry = tick.tick(now_ns);
        let engine = host.panicked.is_none().then(|| host.host.engine.engine());
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

/// A host that is busy from the start of a publishing step until the arrival of its model.
struct Paced {
    engine: Failing,
    taps: Taps,
    threads: Threads,
    pacer: Pacer,
    slow: SlowWatch,
    link: LateLink,
    records: Records,
    latency_ns: u64,
    /// The time until which the host is busy (ns).
    free_at: u64,
    watch: WallStopwatch,
}

impl Paced {
    fn start_ns(&self) -> u64 {
        self.pacer.next_ns().max(self.free_at)
    }

    fn into_side(self) -> HostSide {
        HostSide {
            engine: self.engine.into_engine(),
            pacer: self.pacer,
            end: self.link.into_end(),
        }
    }
}

impl Host for Paced {
    type Error = Stopped;

    fn next_ns(&self) -> Option<u64> {
        Some(self.start_ns())
    }

    fn step(&mut self) -> Result<(), Stopped> {
        let start = self.start_ns();
        if let Some(until_ns) = self.engine.stall(start) {
            self.free_at = until_ns;
            return Ok(());
        }
        let due = self.pacer.begin(start);
        let (engine, link, records) = (&mut self.engine, &mut self.link, &mut self.records);
        link.drain(|record| records.take(record));
        records.see(start - due.time_ns, |record| engine.follow(record));
        let arrival_ns = start + self.latency_ns;
        let watch = &self.watch;
        self.threads.run(|| {
            awake(|| {
                engine.step(due, watch, |body, model| {
                    link.send(arrival_ns, body, model);
                });
            });
        });
        self.slow.look(self.engine.stats());
        let skipped = self.pacer.skipped();
        (self.taps).after_step(due.time_ns, skipped, self.engine.engine());
        if due.publishes {
            self.free_at = arrival_ns;
        }
        Ok(())
    }

    fn deliver(&mut self, now_ns: u64) {
        self.link.deliver(now_ns, |_, _| {});
    }
}

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

impl<H: Host> Host for CatchPanic<H> {
    type Error = H::Error;

    fn next_ns(&self) -> Option<u64> {
        match self.panicked {
            None => self.host.next_ns(),
            Some(_) => None,
        }
    }

    fn step(&mut self) -> Result<(), H::Error> {
        let host = &mut self.host;
        panics::caught(|| host.step()).unwrap_or_else(|panic| {
            self.panicked = Some(panic);
            Ok(())
        })
    }

    fn deliver(&mut self, now_ns: u64) {
        if self.panicked.is_none() {
            self.host.deliver(now_ns);
        }
    }
}
