//! A run: a scene from beginning to end, under virtual time or the real clock, with its log, plot and summary.

mod beyond;
mod collect;
mod contacts;
mod csv;
mod devices;
pub mod ended;
pub mod frames;
mod held_back;
mod histogram;
pub mod late;
mod load_curve;
pub mod log_frames;
mod log_observer;
mod marks;
pub mod observer;
mod pace;
pub mod paced;
pub mod panics;
pub mod prepare;
mod real_clock;
pub mod replay;
mod report;
mod samples;
pub mod session;
mod slips;
pub mod slow_host;
mod subscribers;
pub mod summary;
pub mod tear_force;
pub mod tears;
mod tick_outputs;
pub mod view;
mod virtual_clock;
mod withheld;

use crate::atomic_file::{AtomicFileError, write_json};
use crate::engine::body::HostBody;
use crate::engine::faults::HostFault;
use crate::live::socket::{Listener, SocketError};
use crate::log::series::{Series, SeriesOptions};
use crate::log::{LogError, LogFile, LogHeader, LogWriter};
use crate::plot;
use crate::preparation::Preparation;
use crate::record::Group;
use crate::scene::{LoadedScene, Scene, SceneError, connections};
use crate::world::{World, scheme};
use ::devices::panel::{Operated, Panel, TimedOrder};
use collect::Collector;
use ended::Ended;
use frames::{FrameOptions, FrameRateError, FrameWriter};
use log_frames::LogFrames;
use log_observer::{LogObserver, Next};
use observer::Observers;
use physics::{Body, FactorCode};
use prepare::{Options, Prepared};
use runner::RunnerConfig;
use runner::thread::{SpawnError, Stop, TickPanic};
use runner::{AnyDevice, CoreChoice, Cores, Reserved, ThreadPlace};
use slow_host::StepTime;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use summary::RunSummary;
use tears::TearSender;
use view::{Session, ViewOptions};

pub use crate::record::Clock;
pub use devices::simulated_hand;
pub use tick_outputs::TickOutputs;

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
    /// A series of logs in place of `log`, for a run without an end.
    pub series: Option<SeriesOptions>,
    /// Frames of the bodies in the log a second of the run's own time (Hz); `None` for a log without frames. Without a
    /// log, this has no effect.
    pub log_frames: Option<f64>,
    /// Path of the plot; `None` for a run without a plot.
    pub plot: Option<PathBuf>,
    /// The component of forces and displacements that the plot shows.
    pub component: plot::Component,
    /// The table and the picture of force against displacement.
    pub ticks: TickOutputs,
    /// Path of the distributions of lateness and tick time (CSV or SVG) of a run under the real clock; `None` for a run
    /// without this file.
    pub histogram: Option<PathBuf>,
    /// Frames of the deformed bodies; `None` for a run without frames.
    pub frames: Option<FrameOptions>,
    /// Lets viewers watch the run; `None` for a run without viewers.
    pub view: Option<ViewOptions>,
    /// Path of the summary as JSON; `None` for a run without this file.
    pub json: Option<PathBuf>,
    /// The instructions that the linear algebra uses: the machine's fastest, or those that every machine has.
    pub instructions: FactorCode,
    /// How the tick's thread runs under the real clock.
    pub runner: RunnerConfig,
    /// Whether the other threads of the program leave the siblings of the tick's core alone, too.
    pub idle_sibling: bool,
    /// Where the threads of the devices run.
    pub device_threads: ThreadPlace,
    /// Faults that the host makes on purpose.
    pub faults: Vec<HostFault>,
    /// The operator's panel, which arms and stops the devices, and lets simulated hands take hold.
    pub panel: Panel,
    /// Orders of the operator at times of the run.
    pub orders: Vec<TimedOrder>,
    /// A request to end the run early and in order.
    pub stop: Arc<Stop>,
    /// The commit from which the program was built, if the program knows it.
    pub commit: Option<&'static str>,
}

impl RunOptions {
    /// A run of the scene as it is, without log, plot and JSON.
    pub fn new(clock: Clock) -> Self {
        Self {
            clock,
            duration: None,
            seed: None,
            log: None,
            series: None,
            log_frames: None,
            plot: None,
            component: plot::Component::default(),
            ticks: TickOutputs::default(),
            histogram: None,
            frames: None,
            view: None,
            json: None,
            instructions: FactorCode::default(),
            runner: RunnerConfig::default(),
            idle_sibling: true,
            device_threads: ThreadPlace::default(),
            faults: Vec::new(),
            panel: Panel::default(),
            orders: Vec::new(),
            stop: Arc::default(),
            commit: None,
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
    /// The table or the folder of the frames cannot be written.
    #[error(transparent)]
    File(#[from] AtomicFileError),
    /// The rate of the frames is not allowed.
    #[error(transparent)]
    FrameRate(#[from] FrameRateError),
    /// The run cannot be watched.
    #[error(transparent)]
    View(#[from] SocketError),
    /// The tick's thread cannot start.
    #[error(transparent)]
    Spawn(#[from] SpawnError),
    /// The tick's thread panicked.
    #[error(transparent)]
    Tick(#[from] TickPanic),
    /// The folder of a series of logs cannot be read.
    #[error(
        "the folder of the logs cannot be read: {0}; create it, or name another one by `log.folder` of the settings"
    )]
    Folder(std::io::Error),
    /// No thread for the host or the log.
    #[error("the system gave no thread for the host or the log: {0}")]
    Thread(std::io::Error),
}

/// The progress of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// The part of the preparation that begins; `None` once ticks are made.
    pub preparation: Option<Preparation>,
    /// Ticks done.
    pub ticks: u64,
    /// Ticks in the whole run.
    pub of: u64,
    /// Ticks in the log that survive this process; zero without a log.
    pub logged: u64,
    /// The time of a step, if the first steps took longer than the scene allows.
    pub slow: Option<StepTime>,
}

impl Progress {
    /// The fraction done.
    pub fn fraction(&self) -> f64 {
        self.ticks as f64 / self.of.max(1) as f64
    }
}

/// Runs a world and writes the files that `options` name. `progress` is called from time to time. The log is locked
/// before anything else. A file that cannot be written at the end is one of the failures of the summary.
///
/// # Errors
/// [`RunError`].
///
/// ```
/// use host::run::{Clock, RunOptions, run};
/// use host::scene::Scene;
/// use host::world::World;
///
/// // A twentieth of a second of the built-in scene, under virtual time.
/// let mut options = RunOptions::new(Clock::Virtual);
/// options.duration = Some(0.05);
/// let scene = Scene::embedded_default()?;
/// let summary = run(&World::new(&scene)?, &options, &mut |_| ())?;
/// assert_eq!(summary.tick.count, 50);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(
    world: &World<'_>,
    options: &RunOptions,
    progress: &mut dyn FnMut(Progress),
) -> Result<RunSummary, RunError> {
    run_watched(world, options, Observers::new(), progress)
}

/// Runs a world as `run` does, with the observers `others` in addition to the summary and the log.
///
/// # Errors
/// [`RunError`].
pub fn run_watched(
    world: &World<'_>,
    options: &RunOptions,
    others: Observers,
    progress: &mut dyn FnMut(Progress),
) -> Result<RunSummary, RunError> {
    let loaded = world.loaded;
    connections::check(loaded)?;
    let seed = options.seed.unwrap_or(loaded.scene.seed);
    let series = options.series.as_ref().map(Series::new).transpose();
    let mut series = series.map_err(RunError::Folder)?;
    let path = series.as_mut().map(Series::next);
    let log = path
        .as_deref()
        .or(options.log.as_deref())
        .map(LogFile::open)
        .transpose()?;
    let view = options.view.as_ref();
    let listener = view.map(|view| Listener::bind(view.socket.as_deref()));
    let listener = listener.transpose()?;
    // The core is reserved before the run starts its first thread: the thread that makes factors starts with the
    // engine.
    let core = match options.clock {
        Clock::Real => options.runner.core,
        Clock::Virtual => CoreChoice::Anywhere,
    };
    let reserved = Reserved::new(core, options.idle_sibling, &Cores::of_this_machine());
    let mut preparing = |preparation| {
        progress(Progress {
            preparation: Some(preparation),
            ..Progress::default()
        });
    };
    let mut prepared = prepare(world, options, seed, &mut preparing)?;
    let told = std::mem::take(&mut prepared.told);
    let frames = options
        .frames
        .as_ref()
        .map(|frames| FrameWriter::begin(world, frames, options.clock, &prepared.engine));
    let writer = frames.transpose()?.map(|(subscriber, writer)| {
        prepared.subscribers.snapshots.push(subscriber);
        writer
    });
    let log_frames = options.log_frames.filter(|_| log.is_some());
    let log_frames = match log_frames {
        Some(rate) => {
            log_frames::check_rate(rate, &loaded.scene)?;
            let engine = &prepared.engine;
            let (subscriber, frames) = log_frames::begin(world, rate, options.clock, engine);
            prepared.subscribers.snapshots.push(subscriber);
            Some(frames)
        }
        None => None,
    };
    let bodies = || prepared.engine.bodies().iter().map(HostBody::body);
    let size = (
        bodies().map(Body::element_count).sum(),
        bodies().map(Body::vertex_count).sum(),
    );
    let logged = Arc::default();
    let tears = &mut prepared.subscribers.tears;
    *tears = TearSender::new(prepared.engine.bodies());
    let tears = tears.as_mut();
    let devices = &prepared.tick.devices;
    let log = log.map(|log| (log, header(loaded, options, seed, devices), log_frames));
    let is_logged = log.is_some();
    let mut observers = observers(loaded, options, others, (log, tears), &logged, series)?;
    if is_logged || options.ticks.csv.is_some() || view.is_some() {
        let channel = contacts::channel(&loaded.scene, &prepared.engine);
        if let Some((sender, steps)) = channel {
            prepared.subscribers.contacts = Some(sender);
            observers = observers.touching(steps);
        }
    }
    let session = match view.zip(listener) {
        None => None,
        Some((view, listener)) => {
            let engine = &prepared.engine;
            let (session, host, (subscriber, observer)) =
                Session::begin(view, listener, world, options, seed, engine)?;
            prepared.subscribers.snapshots.push(subscriber);
            let tears = prepared.subscribers.tears.as_mut();
            let tears = tears.map(TearSender::listen).unwrap_or_default();
            let observer = observer.with_tears(tears);
            prepared.view = Some(host);
            observers = observers.with(observer);
            Some(session)
        }
    };
    let of = prepared.timing.ticks;
    let found = prepared.slow.found();
    let mut progress = |ticks| {
        let logged = logged.load(Ordering::Relaxed);
        let slow = found.get().copied();
        progress(Progress {
            preparation: None,
            ticks,
            of,
            logged,
            slow,
        });
    };
    let mut ended = match options.clock {
        Clock::Virtual => virtual_clock::run(prepared, &options.stop, observers, &mut progress),
        Clock::Real => {
            let runner = RunnerConfig {
                core: reserved.core(),
                ..options.runner
            };
            real_clock::run(prepared, runner, &options.stop, observers, &mut progress)?
        }
    };
    if let Some(writer) = writer {
        writer.finish(&mut ended.observed);
    }
    ended.observed.degradations.extend(told);
    ended.judge(loaded, is_logged);
    let mut summary = report::summarize(world, options, seed, size, &ended);
    summary.unwritten.append(&mut ended.observed.unwritten);
    let slow = found.get().copied();
    let warning = slow.map(|slow| slow_warning(loaded, options, slow));
    summary.warnings.extend(warning);
    write_files(loaded, options, &ended, &mut summary);
    if let Some(session) = session {
        session.finish(&ended.host, &summary);
    }
    Ok(summary)
}

/// The note about a run whose steps take longer than its scene allows.
pub fn slow_warning(loaded: &LoadedScene, options: &RunOptions, slow: StepTime) -> String {
    let duration = options.duration.unwrap_or(loaded.scene.duration);
    slow.warning(
        &loaded.scene,
        Some(options.clock),
        duration,
        slow_host::cores(),
    )
}

/// The session of a run before its first tick.
fn prepare(
    world: &World<'_>,
    options: &RunOptions,
    seed: u64,
    preparing: &mut dyn FnMut(Preparation),
) -> Result<Prepared, SceneError> {
    let session = Options {
        duration: options.duration.unwrap_or(world.loaded.scene.duration),
        seed,
        code: options.instructions,
        real: options.clock == Clock::Real,
        faults: options.faults.clone(),
        threads: options.device_threads.clone(),
    };
    let mut prepared = Prepared::told(world, &session, preparing)?;
    let devices = std::mem::take(&mut prepared.tick.devices).into_iter();
    prepared.tick.devices = devices
        .enumerate()
        .map(|(index, device)| {
            let operated = Operated::new(device, options.panel.clone(), &options.orders);
            let take = world.loaded.scene.ordered_button(index);
            Box::new(operated.with_take(take)) as AnyDevice
        })
        .collect();
    Ok(prepared)
}

/// The parts from which a log begins: its file, its header, and the frames of the bodies, if it has them.
type LogParts = (LogFile, LogHeader, Option<LogFrames>);

/// The observers `others`, the one that collects for summary and plot, and the log. `logged` is the number of ticks in
/// the log that survive this process.
fn observers(
    loaded: &LoadedScene,
    options: &RunOptions,
    others: Observers,
    (log, mut tears): (Option<LogParts>, Option<&mut TearSender>),
    logged: &Arc<AtomicU64>,
    mut series: Option<Series>,
) -> Result<Observers, RunError> {
    let scene = &loaded.scene;
    let mut listen = || {
        tears
            .as_mut()
            .map(|tears| tears.listen())
            .unwrap_or_default()
    };
    let collector = Collector::new(scene, options.plot.is_some(), listen());
    let observers = options.ticks.observe(scene, others.with(collector))?;
    let Some((file, header, frames)) = log else {
        return Ok(observers);
    };
    let theirs = listen();
    let tearing = tears
        .as_ref()
        .map(|tears| tears.tearing())
        .unwrap_or_default();
    let groups = groups(scene, frames.is_some(), &tearing);
    let begin = move |file| {
        let mut log = LogWriter::begin_file(file, &header)?;
        for (group, index, name) in &groups {
            log.add(*group, *index, name)?;
        }
        // A full disk is known before the first tick.
        log.flush()?;
        Ok(log)
    };
    let log = begin(file).inspect_err(|_| {
        // A service tries again and again, and leaves no beginnings behind.
        if let Some(series) = &mut series {
            series.give_up();
        }
    })?;
    let clock = options.clock;
    let next = series.map(|series| Next {
        series,
        begin: Box::new(begin),
        loaded: loaded.clone(),
        clock,
        before: 0,
        lost: 0,
    });
    let log = LogObserver::new(log, loaded, clock, (frames, theirs), logged, next);
    Ok(observers.with(log))
}

/// The groups of channels of a log of `scene`, each with the index and the name of its body. `tearing` tells of each body whether it
/// tears.
fn groups(scene: &Scene, with_frames: bool, tearing: &[bool]) -> Vec<(Group, usize, String)> {
    let bodies = || scene.bodies.iter().enumerate();
    let frames = bodies().filter(|_| with_frames);
    let frames = frames.map(|(index, body)| (Group::Frames, index, body.name.clone()));
    let tears = bodies().filter(|(index, _)| tearing.get(*index) == Some(&true));
    let tears = tears.map(|(index, body)| (Group::Tears, index, body.name.clone()));
    let run = |group, present: bool| present.then(|| (group, 0, String::new()));
    let contacts = run(Group::Contacts, scene.has_contact());
    let tools = run(Group::Tools, !scene.tools.is_empty());
    frames.chain(tears).chain(contacts).chain(tools).collect()
}

/// Writes the plot and the summary to the files that `options` names. A file that cannot be written is one of the failures
/// of the summary.
fn write_files(
    loaded: &LoadedScene,
    options: &RunOptions,
    ended: &Ended,
    summary: &mut RunSummary,
) {
    let note = |summary: &mut RunSummary, path: &Path, written: Result<(), AtomicFileError>| {
        if let Err(error) = written {
            summary.failures.push(error.to_string());
            summary.unwritten.push(path.to_owned());
        }
    };
    if let Some(path) = &options.plot {
        let data = report::plot_data(loaded, &ended.observed.collected, options.component);
        let picture = plot::force_and_position(&data);
        note(summary, path, plot::write_picture(path, &picture));
    }
    if let Some(path) = &options.histogram {
        let written = histogram::write(path, &loaded.scene, &ended.tick.latencies);
        note(summary, path, written);
    }
    // Last, so that the file holds the failures before it.
    if let Some(path) = &options.json {
        let written = write_json(path, summary);
        note(summary, path, written);
    }
}

fn header(
    loaded: &LoadedScene,
    options: &RunOptions,
    seed: u64,
    devices: &[AnyDevice],
) -> LogHeader {
    LogHeader {
        facts: facts(loaded, options, seed),
        limits: devices.iter().map(|device| device.capabilities()).collect(),
        scene: loaded.source.text.clone(),
        files: loaded.files.clone(),
    }
}

/// The facts of a run with `seed` for its log and its viewers, by name.
pub fn facts(loaded: &LoadedScene, options: &RunOptions, seed: u64) -> BTreeMap<String, String> {
    let facts = [
        ("scene", loaded.scene.name.clone()),
        ("clock", options.clock.name().into()),
        ("scheme", scheme(&loaded.scene).name().into()),
        ("seed", seed.to_string()),
        ("version", env!("CARGO_PKG_VERSION").into()),
        ("instructions", instructions(options.instructions)),
    ];
    facts
        .into_iter()
        .map(|(name, fact)| (name.to_owned(), fact))
        .collect()
}

/// The instructions that the linear algebra uses. Two runs of the same program give equal bytes if these are
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
