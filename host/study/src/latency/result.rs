//! The result of a measurement of latency, for programs.

use super::gather::Gathered;
use super::percentile::{CONFIDENCE, Percentile, Series};
use super::stages::Named;
use super::worst::Tick;
use host::machine::Machine;
use host::record::Distribution;
use host::run::summary::{PlaceSummary, RunSummary};
use host::scene::Scene;
use runner::kernel::{KernelCounts, KernelWindow};
use serde::Serialize;

/// Version of the JSON of `palpate latency --json`. A change of a field's meaning changes this version.
pub const SCHEMA: &str = "palpate.latency/1";

/// The latency of a machine with a scene. Times are in seconds.
#[derive(Clone, Debug, Serialize)]
pub struct Latency {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// The program and the machine.
    pub machine: Machine,
    /// The core and the priority of the tick's thread.
    pub place: Option<PlaceSummary>,
    /// Ticks a second (Hz).
    pub rate: f64,
    /// The probability with which each interval contains the percentile of the machine (fraction).
    pub confidence: f64,
    /// A measurement for each load, in their order in time.
    pub loads: Vec<Load>,
}

/// The measurement under one load.
#[derive(Clone, Debug, Serialize)]
pub struct Load {
    /// The load: `idle`, or the kinds of work beside the run.
    pub load: String,
    /// Time from the first deadline to the last one (s).
    pub duration: f64,
    /// Deadlines that a tick served.
    pub met: u64,
    /// Deadlines that the loop skipped. Each is as late as the next tick that woke.
    pub skipped: u64,
    /// Deadlines whose record was lost.
    pub unknown: u64,
    /// The measured times. The first is the lateness.
    pub times: Vec<Time>,
    /// Measured time to solve, a host step.
    pub host_solve: Distribution,
    /// Measured time to condense, a publication of the host.
    pub host_condense: Distribution,
    /// The worst ticks, by the time from the deadline to the last command.
    pub worst: Vec<Worst>,
    /// What the kernel counted for the tick's thread; `None` if the system does not tell.
    pub kernel: Option<Counts>,
    /// The windows in which the kernel counted something, at most a thousand.
    pub windows: Vec<Window>,
    /// Edges of a square wave after which no motion was found.
    pub edges_without_motion: u64,
    /// Resources that the system did not grant, and the consequences.
    pub degradations: Vec<String>,
    /// Failures of the run.
    pub failures: Vec<String>,
}

/// A measured time.
#[derive(Clone, Debug, Serialize)]
pub struct Time {
    /// The name of the time.
    pub name: String,
    /// Number of values.
    pub count: u64,
    /// Mean (s).
    pub mean: f64,
    /// Smallest value (s).
    pub min: f64,
    /// Largest value (s). It is the largest of this run, and no bound on later ones.
    pub max: f64,
    /// Time of the largest value since the first deadline (s).
    pub max_time: f64,
    /// The percentiles for which the run is long enough.
    pub percentiles: Vec<Percentile>,
    /// The whole histogram: the upper end of each interval that has values (s), and the number of its values (count).
    pub histogram: Vec<(f64, u64)>,
}

/// One of the worst ticks.
#[derive(Clone, Debug, Serialize)]
pub struct Worst {
    /// Number of the tick.
    pub tick: u64,
    /// Its deadline since the first one (s).
    pub time: f64,
    /// Time from the deadline to the last command (s).
    pub whole: f64,
    /// The stage that took the longest beyond its usual time.
    pub cause: String,
    /// The stages in their order.
    pub stages: Vec<StageTime>,
    /// Deadlines that the loop skipped after the tick.
    pub skipped: u64,
    /// The length of the windows of `kernel` that the tick overlaps, together (s); zero if no window is known.
    pub window: f64,
    /// What the kernel counted for the thread in these windows.
    pub kernel: Counts,
}

/// The time of a stage of a tick.
#[derive(Clone, Debug, Serialize)]
pub struct StageTime {
    /// The name of the stage.
    pub stage: String,
    /// Its time (s).
    pub time: f64,
}

/// Counts of the kernel for the tick's thread.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Counts {
    /// Page faults that took no data from a disk.
    pub minor_faults: u64,
    /// Page faults that took data from a disk.
    pub major_faults: u64,
    /// Switches to another thread that the thread did not ask for.
    pub involuntary_switches: u64,
}

/// A window of the kernel's counts.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Window {
    /// Its start since the first deadline (s).
    pub from: f64,
    /// Its end (s).
    pub to: f64,
    /// What the kernel counted in it.
    #[serde(flatten)]
    pub counts: Counts,
}

impl From<KernelCounts> for Counts {
    fn from(counts: KernelCounts) -> Self {
        Self {
            minor_faults: counts.minor_faults,
            major_faults: counts.major_faults,
            involuntary_switches: counts.involuntary_switches,
        }
    }
}

impl From<&KernelWindow> for Window {
    fn from(window: &KernelWindow) -> Self {
        Self {
            from: seconds(window.from_ns),
            to: seconds(window.to_ns),
            counts: window.counts.into(),
        }
    }
}

impl Latency {
    /// The result of measurements of `scene`, each with the name of its load.
    pub fn new(scene: &Scene, measured: &[(String, Gathered, RunSummary)]) -> Option<Self> {
        let (_, _, first) = measured.first()?;
        let loads = measured.iter();
        let loads =
            loads.map(|(load, gathered, summary)| Load::new(scene, load, gathered, summary));
        Some(Self {
            schema: SCHEMA,
            scene: first.scene.clone(),
            machine: first.machine.clone(),
            place: first.tick.place,
            rate: first.tick.rate,
            confidence: CONFIDENCE,
            loads: loads.collect(),
        })
    }
}

impl Load {
    fn new(scene: &Scene, load: &str, gathered: &Gathered, summary: &RunSummary) -> Self {
        let devices: Vec<String> = scene
            .devices
            .iter()
            .map(|device| device.name.clone())
            .collect();
        let deadlines = &gathered.deadlines;
        let slots = deadlines.met + deadlines.skipped + deadlines.unknown;
        let edges = || gathered.edges.iter().flatten();
        Self {
            load: load.to_owned(),
            duration: slots as f64 / summary.tick.rate,
            met: deadlines.met,
            skipped: deadlines.skipped,
            unknown: deadlines.unknown,
            times: times(scene, gathered),
            host_solve: summary.host.solve,
            host_condense: summary.host.condense,
            worst: gathered
                .worst
                .ticks
                .iter()
                .map(|tick| worst(tick, gathered, &devices))
                .collect(),
            kernel: gathered.counted.map(Counts::from),
            windows: gathered.windows.iter().map(Window::from).collect(),
            edges_without_motion: edges().map(|edges| edges.without_motion).sum(),
            degradations: summary.degradations.clone(),
            failures: summary.failures.clone(),
        }
    }
}

/// Every time that has values.
fn times(scene: &Scene, gathered: &Gathered) -> Vec<Time> {
    let mut times = vec![
        ("lateness".to_owned(), &gathered.lateness),
        ("read".to_owned(), &gathered.read),
        ("compute".to_owned(), &gathered.compute),
        ("write".to_owned(), &gathered.write),
        ("whole tick".to_owned(), &gathered.whole),
    ];
    let devices = || scene.devices.iter().map(|device| &device.name);
    let answers = devices().zip(&gathered.motion_to_force);
    times.extend(answers.map(|(name, series)| (format!("motion to force of {name}"), series)));
    let edges = devices().zip(&gathered.edges);
    let edges = edges.filter_map(|(name, edges)| Some((name, &edges.as_ref()?.bounds)));
    times.extend(edges.map(|(name, series)| (format!("force to motion of {name}, bound"), series)));
    let bodies = scene.bodies.iter().zip(&gathered.model_age);
    times.extend(bodies.map(|(body, series)| (format!("model age of {}", body.name), series)));
    times.retain(|(_, series)| series.count() > 0);
    times
        .into_iter()
        .map(|(name, series)| time(name, series))
        .collect()
}

fn time(name: String, series: &Series) -> Time {
    let (max, max_time) = series.max();
    let histogram = series.histogram().into_iter();
    Time {
        name,
        count: series.count(),
        mean: series.mean(),
        min: series.min(),
        max,
        max_time,
        percentiles: series.percentiles(),
        histogram: histogram
            .map(|(edge_ns, count)| (seconds(edge_ns), count))
            .collect(),
    }
}

fn worst(tick: &Tick, gathered: &Gathered, devices: &[String]) -> Worst {
    let name = |stage| Named(stage, devices).to_string();
    let cause = tick.cause(|stage| gathered.usual(stage));
    let stages = tick.stages.iter().map(|(stage, ns)| StageTime {
        stage: name(*stage),
        time: seconds(*ns),
    });
    Worst {
        tick: tick.tick,
        time: seconds(tick.time_ns),
        whole: seconds(super::stages::whole(&tick.stages)),
        cause: cause.map(name).unwrap_or_default(),
        stages: stages.collect(),
        skipped: tick.skipped,
        window: seconds(tick.window_ns),
        kernel: tick.counts.into(),
    }
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}
