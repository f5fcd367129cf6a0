//! A run: a scene from beginning to end, under virtual time or the real clock, with its log, plot and summary.

mod collect;
mod devices;
mod hand;
pub mod late;
mod log_observer;
pub mod observer;
mod real_clock;
pub mod replay;
mod report;
pub mod setup;
pub mod summary;
pub mod timeline;
pub mod virtual_clock;
mod withheld;

use crate::atomic_file::{AtomicFileError, write_atomically};
use crate::engine::body::HostBody;
use crate::engine::build::How;
use crate::engine::faults::{Faults, HostFault};
use crate::log::{LogError, LogHeader, LogWriter};
use crate::plot;
use crate::scene::{LoadedScene, SceneError};
use collect::{Collected, Collector};
use log_observer::LogObserver;
use observer::Observers;
use physics::{Body, FactorCode};
use rt_core::Controller;
use runner::latency::Latencies;
use runner::link::TickCounters;
use runner::thread::{RunnerConfig, SpawnError, Stop, TickPanic};
use runner::{AnyDevice, CoreChoice, Cores, Reserved};
use setup::HostSide;
use std::any::Any;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use summary::{PlaceSummary, RunSummary};

/// Which clock a run follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Virtual time: exact, repeatable, and as fast as the machine computes.
    Virtual,
    /// The machine's monotonic clock.
    Real,
}

/// The options of a run beyond its scene.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// The clock that the run follows.
    pub clock: Clock,
    /// Length (s), if not the scene's.
    pub duration: Option<f64>,
    /// Seed, if not the scene's.
    pub seed: Option<u64>,
    /// Path of the log; `None` for a run without a log.
    pub log: Option<PathBuf>,
    /// Path of the plot; `None` for a run without a plot.
    pub plot: Option<PathBuf>,
    /// Path of the summary as JSON; `None` for a run without this file.
    pub json: Option<PathBuf>,
    /// The instructions that the linear algebra uses: the machine's fastest, or those that every machine has.
    pub instructions: FactorCode,
    /// How the tick's thread runs under the real clock.
    pub runner: RunnerConfig,
    /// Faults that the host makes on purpose.
    pub faults: Vec<HostFault>,
    /// A request to end a run under the real clock early and in order.
    pub stop: Arc<Stop>,
}

impl RunOptions {
    /// A run of the scene as it is, without log, plot and JSON.
    pub fn new(clock: Clock) -> Self {
        Self {
            clock,
            duration: None,
            seed: None,
            log: None,
            plot: None,
            json: None,
            instructions: FactorCode::default(),
            runner: RunnerConfig::default(),
            faults: Vec::new(),
            stop: Arc::default(),
        }
    }
}

/// Why a run could not be done.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The scene cannot be built.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The log cannot be written.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] AtomicFileError),
    /// The tick's thread cannot start.
    #[error(transparent)]
    Spawn(#[from] SpawnError),
    /// The tick's thread panicked.
    #[error(transparent)]
    Tick(#[from] TickPanic),
    /// No thread for the host or the log.
    #[error("the system gave no thread: {0}")]
    Thread(std::io::Error),
}

/// The progress of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Ticks done.
    pub ticks: u64,
    /// Ticks in the whole run.
    pub of: u64,
    /// Ticks in the log that survive this process; zero without a log.
    pub logged: u64,
}

impl Progress {
    /// The fraction done.
    pub fn fraction(&self) -> f64 {
        self.ticks as f64 / self.of.max(1) as f64
    }
}

/// Runs a scene and writes the files that `options` name. `progress` is called from time to time.
///
/// # Errors
/// [`RunError`].
///
/// ```
/// use host::run::{Clock, RunOptions, run};
/// use host::scene::Scene;
///
/// // A twentieth of a second of the built-in scene, under virtual time.
/// let mut options = RunOptions::new(Clock::Virtual);
/// options.duration = Some(0.05);
/// let summary = run(&Scene::embedded_default()?, &options, |_| ())?;
/// assert_eq!(summary.tick.count, 50);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(
    loaded: &LoadedScene,
    options: &RunOptions,
    progress: impl FnMut(Progress),
) -> Result<RunSummary, RunError> {
    run_watched(loaded, options, Observers::new(), progress)
}

/// As `run`, with the observers `others` in addition to the summary and the log.
///
/// # Errors
/// [`RunError`].
pub fn run_watched(
    loaded: &LoadedScene,
    options: &RunOptions,
    others: Observers,
    mut progress: impl FnMut(Progress),
) -> Result<RunSummary, RunError> {
    let scene = &loaded.scene;
    let duration = options.duration.unwrap_or(scene.duration);
    let seed = options.seed.unwrap_or(scene.seed);
    // The core is reserved before the run starts its first thread: the thread that makes factors starts with the
    // engine.
    let core = match options.clock {
        Clock::Real => options.runner.core,
        Clock::Virtual => CoreChoice::Anywhere,
    };
    let reserved = Reserved::new(core, &Cores::of_this_machine());
    let how = How {
        code: options.instructions,
        real: options.clock == Clock::Real,
    };
    let mut prepared = setup::setup_with(loaded, duration, seed, how)?;
    prepared.faults = Faults::new(options.faults.clone());
    let prepared = prepared;
    let bodies = || prepared.engine.bodies().iter().map(HostBody::body);
    let size = (
        bodies().map(Body::element_count).sum(),
        bodies().map(Body::vertex_count).sum(),
    );

    let names = |names: &mut dyn Iterator<Item = &String>| names.cloned().collect::<Vec<_>>();
    let collector = Collector::new(
        names(&mut scene.devices.iter().map(|d| &d.name)),
        names(&mut scene.bodies.iter().map(|b| &b.name)),
        options.plot.is_some(),
    );
    let logged = Arc::default();
    let mut observers = others.with(collector);
    if let Some(path) = &options.log {
        let log = LogWriter::create_file(path, &header(loaded, options, seed))?;
        let log = LogObserver::new(log, scene.realtime.rate, Arc::clone(&logged));
        observers = observers.with(log);
    }
    let of = prepared.timing.ticks;
    let progress = |ticks| {
        let logged = logged.load(Ordering::Relaxed);
        progress(Progress { ticks, of, logged });
    };

    let mut parts = match options.clock {
        Clock::Virtual => {
            let done = virtual_clock::run(prepared, |record| observers.take(record), progress);
            let observed = observers.finish();
            Parts {
                tick: TickSide {
                    missed: 0,
                    longest_miss: 0,
                    slots: done.tick.ticks,
                    stopped: false,
                    place: None,
                    locked_bytes: 0,
                    ticks: done.tick.ticks,
                    counters: done.tick.end.counters(),
                    refused_wrenches: done.tick.refused_wrenches,
                    latencies: done.tick.latencies,
                    controller: done.tick.controller,
                    devices: done.tick.devices,
                },
                host: done.host,
                collected: observed.collected,
                degradations: Vec::new(),
                failures: observed
                    .failures
                    .into_iter()
                    .chain(done.panicked.as_deref().map(host_panicked))
                    .collect(),
            }
        }
        Clock::Real => real(prepared, options, &reserved, observers, progress)?,
    };
    if let Some(HostSide { engine, .. }) = &parts.host
        && let Some(fault) = &engine.stats().first_fault
    {
        let count = engine.stats().faults;
        parts
            .failures
            .push(format!("{count} host steps failed; the first: {fault}"));
    }
    if options.log.is_some() {
        parts.degradations.extend(not_replayable(&parts));
    }
    let summary = report::summarize(loaded, options, seed, size, &parts);
    if let Some(path) = &options.plot {
        let svg = plot::force_and_position_svg(&report::plot_data(loaded, &parts.collected));
        write_atomically(path, svg.as_bytes())?;
    }
    if let Some(path) = &options.json {
        // This fails only for maps whose keys are no strings and for failing writers. There are none of either.
        let mut json = serde_json::to_string_pretty(&summary).unwrap_or_default();
        json.push('\n');
        write_atomically(path, json.as_bytes())?;
    }
    Ok(summary)
}

fn header(loaded: &LoadedScene, options: &RunOptions, seed: u64) -> LogHeader {
    let facts = [
        ("scene", loaded.scene.name.clone()),
        ("clock", clock_name(options.clock).into()),
        ("scheme", setup::scheme(&loaded.scene).name().into()),
        ("seed", seed.to_string()),
        ("version", env!("CARGO_PKG_VERSION").into()),
        ("instructions", instructions(options.instructions)),
    ];
    LogHeader {
        facts: facts
            .into_iter()
            .map(|(k, v)| (k.to_owned(), v))
            .collect::<BTreeMap<_, _>>(),
        scene: loaded.source.text.clone(),
        files: loaded.files.clone(),
    }
}

fn clock_name(clock: Clock) -> &'static str {
    match clock {
        Clock::Virtual => "virtual",
        Clock::Real => "real",
    }
}

/// The instructions that the linear algebra uses. Two runs of the same program give equal bytes where these are
/// equal.
fn instructions(code: FactorCode) -> String {
    let mut path = std::env::consts::ARCH.to_owned();
    if code == FactorCode::Portable {
        path.push_str(" portable");
        return path;
    }
    #[cfg(target_arch = "x86_64")]
    for (name, found) in [
        ("avx2", std::arch::is_x86_feature_detected!("avx2")),
        ("fma", std::arch::is_x86_feature_detected!("fma")),
        ("avx512f", std::arch::is_x86_feature_detected!("avx512f")),
    ] {
        if found {
            path.push('+');
            path.push_str(name);
        }
    }
    path
}

/// The tick's side of a finished run.
struct TickSide {
    ticks: u64,
    missed: u64,
    longest_miss: u64,
    slots: u64,
    /// Whether the run ended early on request.
    stopped: bool,
    /// The core and the priority of its thread; `None` under virtual time.
    place: Option<PlaceSummary>,
    locked_bytes: u64,
    counters: TickCounters,
    refused_wrenches: u64,
    latencies: Latencies,
    controller: Controller,
    devices: Vec<AnyDevice>,
}

fn host_panicked(message: &str) -> String {
    format!("the host panicked, and the tick went on without it: {message}")
}

/// The message of a panic.
pub fn message(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}

/// A message on the ticks and models that a log lacks and a replay needs; `None` if the log is whole.
fn not_replayable(parts: &Parts) -> Option<String> {
    let ticks = parts.tick.counters.refused_telemetry;
    let host = parts.host.as_ref();
    let models = host.map_or(0, |host| host.end.refused_copies());
    (ticks + models > 0).then(|| {
        format!(
            "{ticks} ticks and {models} models found the log's ring full and are not in it: it \
             cannot be replayed, unless all that is missing is models that no tick used"
        )
    })
}

/// A finished run, under either clock.
struct Parts {
    tick: TickSide,
    host: Option<HostSide>,
    collected: Collected,
    degradations: Vec<String>,
    failures: Vec<String>,
}

fn real(
    prepared: setup::Setup,
    options: &RunOptions,
    reserved: &Reserved,
    observers: Observers,
    progress: impl FnMut(u64),
) -> Result<Parts, RunError> {
    let planned = prepared.timing.ticks;
    let stop = Arc::clone(&options.stop);
    let runner = RunnerConfig {
        core: reserved.core(),
        ..options.runner
    };
    let done = real_clock::run(prepared, runner, stop, observers, progress)?;
    let mut failures = done.failures;
    let observed = done.observers.map(Observers::finish).unwrap_or_default();
    failures.extend(observed.failures);
    let report = done.report;
    if let Some(call) = report.forbidden_call {
        failures.push(format!(
            "the tick made a system call that it may not make, and the loop ended after {} ticks: {call}",
            report.ticks
        ));
    }
    Ok(Parts {
        tick: TickSide {
            ticks: report.ticks,
            missed: report.missed_deadlines,
            longest_miss: report.longest_miss,
            slots: report.slots,
            stopped: report.ticks < planned && options.stop.is_requested(),
            place: Some(PlaceSummary {
                core: report.core,
                isolated: report.isolated,
                priority: report.priority,
            }),
            locked_bytes: report.locked_bytes as u64,
            counters: report.link,
            refused_wrenches: report.refused_wrenches,
            latencies: report.latencies,
            controller: report.controller,
            devices: report.devices,
        },
        host: done.host,
        collected: observed.collected,
        degradations: report
            .degradations
            .iter()
            .map(ToString::to_string)
            .collect(),
        failures,
    })
}
