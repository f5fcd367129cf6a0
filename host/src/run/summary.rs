//! What a run ends with, for people (`print`) and (as JSON) for programs.

mod print;

use serde::Serialize;

/// Version of the JSON that `--json` writes. A field that changes its meaning changes this.
pub const SCHEMA: &str = "palpate.run/3";

/// A distribution of times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Distribution {
    /// Values counted.
    pub count: u64,
    /// Smallest.
    pub min: f64,
    /// Half of the values lie at or below it.
    pub p50: f64,
    /// 99 % do.
    pub p99: f64,
    /// 99.9 % do.
    pub p99_9: f64,
    /// Largest.
    pub max: f64,
    /// Values beyond the histogram's bound.
    pub overflow: u64,
}

impl From<runner::latency::Summary> for Distribution {
    /// From nanoseconds to seconds.
    fn from(s: runner::latency::Summary) -> Self {
        let seconds = |ns: u64| ns as f64 * 1e-9;
        Self {
            count: s.count,
            min: seconds(s.min),
            p50: seconds(s.p50),
            p99: seconds(s.p99),
            p99_9: seconds(s.p99_9),
            max: seconds(s.max),
            overflow: s.overflow,
        }
    }
}

/// Everything that a run has to say. Times in seconds.
#[derive(Clone, Debug, Serialize)]
pub struct RunSummary {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// `virtual` or `real`.
    pub clock: &'static str,
    /// The force scheme.
    pub scheme: &'static str,
    /// The seed.
    pub seed: u64,
    /// The realtime loop.
    pub tick: TickSummary,
    /// The host.
    pub host: HostSummary,
    /// By device.
    pub devices: Vec<DeviceSummary>,
    /// Between the hands and each body.
    pub energy: Vec<EnergySummary>,
    /// Messages that did not arrive.
    pub dropped: DroppedSummary,
    /// Stretches of time in which something was not as it should be.
    pub events: Vec<EventSummary>,
    /// Models that were refused, by body and reason.
    pub refusals: Vec<String>,
    /// What the system did not grant, and what that costs.
    pub degradations: Vec<String>,
    /// What ended a part of the run before its time.
    pub failures: Vec<String>,
}

/// The realtime loop.
#[derive(Clone, Debug, Serialize)]
pub struct TickSummary {
    /// Ticks a second (Hz).
    pub rate: f64,
    /// Ticks done.
    pub count: u64,
    /// Deadlines missed, skipped and survived.
    pub missed_deadlines: u64,
    /// Most deadlines missed in a row.
    pub longest_miss: u64,
    /// Deadlines from the first to the last: those met and those missed.
    pub slots: u64,
    /// Ticks whose telemetry arrived; with `dropped.telemetry` they add up to the ticks.
    pub records: u64,
    /// Whether the run ended early because it was asked to (a signal).
    pub stopped: bool,
    /// Where and how its thread ran; nothing under the virtual clock.
    pub place: Option<PlaceSummary>,
    /// How late it woke; nothing under the virtual clock.
    pub lateness: Option<Distribution>,
    /// How long a tick took; nothing under the virtual clock.
    pub duration: Option<Distribution>,
    /// Age of the local model in use, by body.
    pub model_age: Vec<Distribution>,
    /// Memory locked (bytes).
    pub locked_bytes: u64,
    /// Models that were refused: not finite, wrong handles, outdated, of a time to come.
    pub refused_models: u64,
    /// Times that the newest model grew too old.
    pub faded: u64,
}

/// What the system gave to the tick's thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct PlaceSummary {
    /// The core that it had to itself, among this program's threads; nothing where it had none.
    pub core: Option<usize>,
    /// Whether the kernel keeps other programs off that core.
    pub isolated: bool,
    /// Its priority under SCHED_FIFO; nothing under the ordinary scheduler.
    pub priority: Option<u8>,
}

/// The host.
#[derive(Clone, Debug, Serialize)]
pub struct HostSummary {
    /// Steps done.
    pub steps: u64,
    /// Steps left out because the host was late.
    pub skipped_steps: u64,
    /// Steps a second over the run (Hz), on the run's own clock.
    pub step_rate: f64,
    /// Local models published.
    pub publications: u64,
    /// Triangles and vertices over all bodies.
    pub elements: usize,
    /// See `elements`.
    pub vertices: usize,
    /// How each body is solved, and why so.
    pub solvers: Vec<String>,
    /// Computing time of the stages, as measured; it does not enter the state.
    pub assemble: Distribution,
    /// Factors made beside the steps.
    pub factors: u64,
    /// See `assemble`.
    pub solve: Distribution,
    /// See `assemble`; a publication.
    pub condense: Distribution,
    /// Solver iterations: median, 99th percentile, most.
    pub iterations: [u64; 3],
    /// Steps that stopped at the iteration limit.
    pub unconverged_steps: u64,
    /// Largest relative residual of any step.
    pub worst_residual: f64,
    /// Publications with a clipped eigenvalue, and the worst, relative to the matrix's largest.
    pub clipped: u64,
    /// See `clipped`.
    pub worst_clip: f64,
    /// Steps or publications that failed.
    pub faults: u64,
}

/// One device.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceSummary {
    /// Name in the scene.
    pub name: String,
    /// Largest force on the hand (N), and when (s).
    pub peak_force: f64,
    /// See `peak_force`.
    pub peak_time: f64,
    /// Work done on the hand (J), from telemetry: held force times motion.
    pub work: f64,
    /// The same at the motor port of a simulated device, integrated between ticks (J).
    pub port_work: Option<f64>,
    /// Largest distance from its start (m).
    pub reach: f64,
    /// Ticks with the force limited.
    pub limited_ticks: u64,
    /// Ticks with a force that was not a number.
    pub not_a_number_ticks: u64,
    /// Ticks with the force at its slew limit.
    pub slewed_ticks: u64,
    /// Ticks without a good state.
    pub missed_reads: u64,
    /// Times that it moved too fast.
    pub too_fast: u64,
    /// Times that it was out of reach.
    pub out_of_reach: u64,
    /// What tripped first, if anything did.
    pub first_trip: Option<TripSummary>,
}

/// The first time that a device's last stage took something away.
#[derive(Clone, Debug, Serialize)]
pub struct TripSummary {
    /// What tripped.
    pub what: &'static str,
    /// When (s).
    pub time: f64,
    /// What was found, and what may be at most.
    pub found: f64,
    /// See `found`.
    pub limit: f64,
    /// Unit of both.
    pub unit: &'static str,
}

/// What passed between the hands and one body (J).
#[derive(Clone, Debug, Serialize)]
pub struct EnergySummary {
    /// Name of the body.
    pub body: String,
    /// Net work of the hands, by held wrenches.
    pub supplied: f64,
    /// Part of it that lifted the body's weight.
    pub raised: f64,
    /// What hands at rest could get back at the end, by the last local model; nothing where the scheme knows none.
    pub stored: Option<f64>,
    /// Supplied, and neither stored nor raised.
    pub dissipated: Option<f64>,
    /// The most that ever came out at the hands beyond what had been put in, lifted, dissipated by their devices (as far
    /// as that is relied on) or there at the start.
    pub most_out: f64,
    /// What devices dissipated by themselves and a cap relied on.
    pub credited: f64,
    /// Ticks in which a cap took something off.
    pub capped_ticks: u64,
}

/// Messages that did not arrive.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct DroppedSummary {
    /// Tick records that found the host's ring full.
    pub tick_records: u64,
    /// Telemetry that found the log's ring full.
    pub telemetry: u64,
    /// Models that found the tick's ring full.
    pub models: u64,
    /// Models that found the log's ring full.
    pub logged_models: u64,
    /// Models that arrived together with a newer one and were passed over.
    pub superseded_models: u64,
    /// Wrenches that a device did not take.
    pub wrenches: u64,
}

/// One event.
#[derive(Clone, Debug, Serialize)]
pub struct EventSummary {
    /// Start (s).
    pub from: f64,
    /// End (s).
    pub to: f64,
    /// What it was.
    pub what: String,
}
