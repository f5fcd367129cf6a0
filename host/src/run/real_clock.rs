//! A run under the real clock: the tick, the host and the log each on a thread of its own.
//!
//! The tick's thread is that of `runner`. The host's thread steps when a step is due, or at once when it is late. The
//! log's thread empties its ring a hundred times a second, and reads what the kernel counted for the tick's thread. If
//! the host panics, the tick continues: its force fades, and the summary reports the panic.

use super::ended::{Ended, HostSide};
use super::observer::{Observed, Observers};
use super::prepare::Prepared;
use super::slow_host::SlowWatch;
use super::subscribers::Subscribers;
use super::{RunError, panics};
use crate::engine::faults::Failing;
use crate::engine::pacer::Pacer;
use crate::engine::records::Records;
use crate::engine::stats::WallStopwatch;
use runner::kernel::KernelWindows;
use runner::link::{HostEnd, LogEnd};
use runner::{RunnerConfig, Stop, spawn};
use std::any::Any;
use std::io;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Period at which the log's ring is emptied.
const LOG_PERIOD: Duration = Duration::from_millis(10);
/// Period at which progress is reported.
const WATCH_PERIOD: Duration = Duration::from_millis(50);
/// Longest time that the host sleeps before it checks whether the run is over.
const HOST_PAUSE: Duration = Duration::from_millis(20);

/// Runs what is prepared for its whole length, or until `stop` is requested. The log's thread gives each of `observers` every
/// tick's telemetry in order, and each model before the ticks that used it. From time to time `progress` is given the
/// number of ticks done.
///
/// # Errors
/// [`RunError`] if the loop cannot start, or if its thread panicked.
pub(super) fn run(
    prepared: Prepared,
    config: RunnerConfig,
    stop: &Arc<Stop>,
    observers: Observers,
    progress: &mut dyn FnMut(u64),
) -> Result<Ended, RunError> {
    let Prepared {
        tick,
        host,
        log,
        engine,
        faults,
        subscribers,
        view,
        pacer,
        slow,
        timing,
        told: _,
    } = prepared;
    let config = RunnerConfig {
        period_ns: timing.period_ns,
        ticks: Some(timing.ticks),
        ..config
    };
    // A display may show the preparation with a thread of its own. It ends that thread at this call, because the thread may
    // run on the tick's core.
    progress(0);
    let (controller, devices, end) = (tick.controller, tick.devices, tick.end);
    let thread = spawn(config, controller, devices, end, Arc::clone(stop))?;

    if let Some(view) = &view {
        // Set once, here.
        let _ = view.tick_time.set(thread.tick_time());
    }
    let kernel = KernelWindows::of(&thread);
    let over = Arc::new(Stop::new());
    let host_over = Arc::clone(&over);
    let engine = Failing::new(engine, faults);
    let host = named("palpate-host", move || {
        let mut running = Hosting {
            end: host,
            engine,
            pacer,
            slow,
            subscribers,
            period_ns: timing.period_ns,
        };
        // The counts before a panic belong to the summary.
        let ended = panics::caught(|| running.steps(&host_over));
        (running.into_side(), ended.err())
    })?;
    let log_over = Arc::clone(&over);
    let log = named("palpate-log", move || {
        log_loop(log, observers, kernel, &log_over)
    })?;

    while !thread.is_finished() {
        progress(thread.ticks());
        std::thread::sleep(WATCH_PERIOD);
    }
    let report = thread.join();
    over.request();
    let observed = log.join().map_or_else(
        |panic| Observed {
            failures: vec![format!(
                "the thread of the log panicked: {}",
                panics::text(&*panic)
            )],
            ..Observed::default()
        },
        Observers::finish,
    );
    let lost =
        |panic: Box<dyn Any + Send>| RunError::Thread(io::Error::other(panics::text(&*panic)));
    let (host, panicked) = host.join().map_err(lost)?;
    let tick = report?;
    Ok(Ended {
        stopped: tick.ticks < timing.ticks && stop.is_requested(),
        tick,
        host,
        panicked,
        observed,
    })
}

fn named<T: Send + 'static>(
    name: &str,
    body: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, RunError> {
    std::thread::Builder::new()
        .stack_size(runner::STACK)
        .name(name.into())
        .spawn(body)
        .map_err(RunError::Thread)
}

/// The host on its thread.
struct Hosting {
    end: HostEnd,
    engine: Failing,
    pacer: Pacer,
    slow: SlowWatch,
    subscribers: Subscribers,
    /// The tick's period (ns).
    period_ns: u64,
}

impl Hosting {
    /// Steps when a step is due, until the run is over.
    fn steps(&mut self, over: &Stop) {
        let Self {
            end,
            engine,
            pacer,
            slow,
            subscribers,
            period_ns,
        } = self;
        let mut records = Records::new(*period_ns);
        let watch = WallStopwatch::start();
        let start = Instant::now();
        while !over.is_requested() {
            let early = Duration::from_nanos(pacer.next_ns()).saturating_sub(start.elapsed());
            if !early.is_zero() {
                std::thread::sleep(early.min(HOST_PAUSE));
                continue;
            }
            let now = || u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
            let now_ns = now();
            if let Some(until_ns) = engine.stall(now_ns) {
                std::thread::sleep(Duration::from_nanos(until_ns.saturating_sub(now_ns)));
            }
            let now_ns = now();
            let due = pacer.begin(now_ns);
            end.drain(|record| records.take(record));
            let late_ns = now_ns.saturating_sub(due.time_ns);
            records.see(late_ns, |record| engine.follow(record));
            engine.step(due, &watch, &mut |body, model| {
                // The link counts a full ring.
                let _ = end.publish(body, model);
            });
            for (device, patch) in engine.patches() {
                let _ = end.publish_patch(device, patch);
            }
            slow.look(engine.stats());
            subscribers.after_step(due.time_ns, pacer.skipped(), engine.engine());
        }
    }

    fn into_side(self) -> HostSide {
        HostSide {
            engine: self.engine.into_engine(),
            pacer: self.pacer,
            end: self.end,
        }
    }
}

fn log_loop(
    mut log: LogEnd,
    mut observers: Observers,
    mut kernel: Option<KernelWindows>,
    over: &Stop,
) -> Observers {
    loop {
        // The flag is read before the ring is drained: a record pushed before the end of the run is still drained. So are
        // the ticks of the window.
        let last = over.is_requested();
        let window = kernel.as_mut().and_then(KernelWindows::window);
        log.records(|record| observers.take(record));
        if let Some(window) = window {
            observers.counted(&window);
        }
        if last {
            return observers;
        }
        observers.drained();
        std::thread::sleep(LOG_PERIOD);
    }
}
