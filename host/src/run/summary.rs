//! The summary of a run, for people (`print`) and (as JSON) for programs.

mod contact;
mod print;
mod tears;
mod tool;

use crate::engine::unrendered::{DampedSummary, StiffSummary};
use crate::machine::Machine;
use crate::record::Distribution;
use serde::Serialize;
use std::path::PathBuf;

pub use contact::{ContactPairSummary, ContactSummary};
pub use tears::TearSummary;
pub use tool::ToolSummary;

/// Version of the JSON that `--json` writes. A change of a field's meaning changes this version.
pub const SCHEMA: &str = "palpate.run/4";

/// The summary of a run. Times are in seconds.
#[derive(Clone, Debug, Serialize)]
pub struct RunSummary {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// `virtual` or `real`.
    pub clock: &'static str,
    /// The program and the machine.
    pub machine: Machine,
    /// The force scheme.
    pub scheme: &'static str,
    /// The seed.
    pub seed: u64,
    /// Values of the scene that few scenes mean, with the likely causes.
    pub warnings: Vec<String>,
    /// The realtime loop.
    pub tick: TickSummary,
    /// The host.
    pub host: HostSummary,
    /// The devices, in the scene's order.
    pub devices: Vec<DeviceSummary>,
    /// Forces that did not reach the hand whole, by body or device and cause. A force counts if a hand
    /// can notice the difference: more than 0.02 N and more than 1 % of it.
    pub held_back: Vec<HeldBackSummary>,
    /// The energy between the hands and each body.
    pub energy: Vec<EnergySummary>,
    /// The tools; not given for a scene without tools.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tools: Vec<ToolSummary>,
    /// The tears of each body that can tear.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tears: Vec<TearSummary>,
    /// The contacts; not given for a scene in which nothing can touch.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact: Option<ContactSummary>,
    /// Messages that did not arrive.
    pub dropped: DroppedSummary,
    /// Faults made on purpose, and stretches of time in which a device or a body was not in its normal state.
    pub events: Vec<EventSummary>,
    /// Models that were refused, by body and reason.
    pub refusals: Vec<String>,
    /// Resources that the system did not grant, and the consequences; also gaps in the log.
    pub degradations: Vec<String>,
    /// Failures, such as those that ended a part of the run early.
    pub failures: Vec<String>,
    /// The requested files that could not be written at the end. The reasons are among the failures.
    #[serde(skip)]
    pub unwritten: Vec<PathBuf>,
}

/// The realtime loop.
#[derive(Clone, Debug, Serialize)]
pub struct TickSummary {
    /// Ticks a second (Hz).
    pub rate: f64,
    /// Ticks done.
    pub count: u64,
    /// Deadlines that the loop missed and skipped.
    pub missed_deadlines: u64,
    /// Most deadlines missed in a row.
    pub longest_miss: u64,
    /// Deadlines from the first to the last, both met and missed.
    pub slots: u64,
    /// Ticks whose telemetry arrived. The sum of this number and `dropped.telemetry` is the number of ticks.
    pub records: u64,
    /// Whether the run ended early on request (a signal).
    pub stopped: bool,
    /// The core and the priority of its thread; `None` under virtual time.
    pub place: Option<PlaceSummary>,
    /// Lateness of its thread; `None` under virtual time.
    pub lateness: Option<Distribution>,
    /// Computing time of a tick; `None` under virtual time.
    pub duration: Option<Distribution>,
    /// The part of it from the last read to just before the first write; `None` under virtual time.
    pub compute: Option<Distribution>,
    /// Age of the local model in use, by body.
    pub model_age: Vec<Distribution>,
    /// Locked memory (bytes).
    pub locked_bytes: u64,
    /// Allocations, reallocations and frees in the ticks; `None` under virtual time.
    pub allocator_calls: Option<u64>,
    /// Models that were refused: not finite, of wrong handles, outdated, or timestamped in the future.
    pub refused_models: u64,
    /// Number of times that the newest model became too old.
    pub faded: u64,
}

/// The core and the priority that the system gave to the tick's thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct PlaceSummary {
    /// The core that no other thread of this program used; `None` if there was none.
    pub core: Option<usize>,
    /// Whether the kernel keeps other programs off that core.
    pub isolated: bool,
    /// Its priority under SCHED_FIFO; `None` under the ordinary scheduler.
    pub priority: Option<u8>,
    /// Whether the processor was kept out of its deeper sleep states.
    pub kept_awake: bool,
}

/// The host.
#[derive(Clone, Debug, Serialize)]
pub struct HostSummary {
    /// Steps done.
    pub steps: u64,
    /// Steps left out because the host was late.
    pub skipped_steps: u64,
    /// Mean rate of the steps over the run (Hz), by the run's own clock.
    pub step_rate: f64,
    /// Local models published.
    pub publications: u64,
    /// Number of elements of all bodies.
    pub elements: usize,
    /// Number of vertices of all bodies.
    pub vertices: usize,
    /// The solver of each body, and the reason for the choice.
    pub solvers: Vec<String>,
    /// Background refactorizations.
    pub factors: u64,
    /// Measured time to solve, a step. Measured times do not enter the state. Under virtual time they are processor time.
    pub solve: Distribution,
    /// Measured time to condense, a publication.
    pub condense: Distribution,
    /// Solver iterations a step: median, 99th percentile, maximum.
    pub iterations: [u64; 3],
    /// Steps that stopped at the iteration limit.
    pub unconverged_steps: u64,
    /// Largest relative residual of any step.
    pub worst_residual: f64,
    /// Publications with a clipped eigenvalue.
    pub clipped: u64,
    /// The largest clipped eigenvalue, relative to the largest eigenvalue of its matrix.
    pub worst_clip: f64,
    /// Steps or publications that failed.
    pub faults: u64,
    /// The stiffest direction of each body that is stiffer along it than its devices can render.
    pub stiff: Vec<StiffSummary>,
    /// For each body of whose damping the devices render less than the whole: where they render the least part of it.
    pub damped: Vec<DampedSummary>,
}

/// The summary of one device.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceSummary {
    /// Name in the scene.
    pub name: String,
    /// Largest force on the hand (N).
    pub peak_force: f64,
    /// Time of the largest force (s).
    pub peak_time: f64,
    /// Work done on the hand as the controller knows it (J): the sum of each tick's commanded force times the
    /// displacement of the device until the next tick.
    pub work: f64,
    /// Work of the motors on mechanism and hand (J), integrated between ticks; `None` if the device is not simulated.
    pub motor_work: Option<f64>,
    /// Work done on the hand at the port between hand and handle (J): the work of the motors, less the losses and the
    /// kinetic energy of the mechanism, integrated between ticks. `None` if the device is not simulated.
    pub port_work: Option<f64>,
    /// Largest distance from its first position (m).
    pub reach: f64,
    /// Largest slip of its proxy (m).
    pub slip: f64,
    /// Ticks with the force limited.
    pub limited_ticks: u64,
    /// Ticks with a force that was not a number.
    pub not_a_number_ticks: u64,
    /// Ticks with the force at its slew limit.
    pub slewed_ticks: u64,
    /// Ticks without a good state.
    pub missed_reads: u64,
    /// States that the ticks found, a second, from the first to the last (Hz).
    pub states_rate: f64,
    /// Rate of the device's states by its profile (Hz).
    pub profile_rate: f64,
    /// Wrenches that the device itself refused, by its own count; `None` if the device does not tell.
    pub refused_wrenches: Option<u64>,
    /// Number of times that the device moved too fast.
    pub too_fast: u64,
    /// Number of times that the device was out of reach.
    pub out_of_reach: u64,
    /// Ticks with the force limited because of the motors' heat.
    pub hot_ticks: u64,
    /// Number of times that the device was engaged after the start of the run.
    pub engaged: u64,
    /// Number of times that the hand let go of the dead-man button.
    pub hands_off: u64,
    /// Number of times that the emergency stop acted.
    pub stopped: u64,
    /// Number of times that the device began to say that it renders no force.
    pub let_go: u64,
    /// Number of times that the device began to say that it has a fault.
    pub device_faults: u64,
    /// Time that each read of the device took; `None` under virtual time.
    pub read: Option<Distribution>,
    /// Time that each write took; `None` under virtual time.
    pub write: Option<Distribution>,
    /// Time from the reading of the encoders to the force that answers it, in the clock of the device. A device that is
    /// asked for each state and does not tell is measured from the request for a state to the request that brings the
    /// force, in the clock of the program. `None` if neither is known.
    pub motion_to_force: Option<Distribution>,
    /// The first trip, if there was one.
    pub first_trip: Option<TripSummary>,
}

/// A trip of a device's last stage.
#[derive(Clone, Debug, Serialize)]
pub struct TripSummary {
    /// The limit that began to act, in words.
    #[serde(rename = "what")]
    pub event: &'static str,
    /// Time of the trip (s).
    pub time: f64,
    /// The value found, in `unit`.
    pub found: f64,
    /// The largest value allowed, in `unit`.
    pub limit: f64,
    /// Unit of `found` and `limit`.
    pub unit: &'static str,
}

/// A force that one cause held below what it would have been. The forces of a body are those at the handle with the
/// largest force (scene); those of a device act on the hand.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldBackSummary {
    /// The name of the body, the tool or the device whose force was held back.
    pub of: String,
    /// The cause: `cap` or `old model` of a body; `cap` or `old patch` of a tool; `force limit`, `slew limit`, `heat limit`, `speed limit`,
    /// `reach limit`, `no reading`, `return` (after a fault), `engagement`, `dead-man button`, `disarmed` or
    /// `emergency stop` of a device.
    pub cause: &'static str,
    /// The cause, in words.
    pub why: String,
    /// Number of ticks in which the force was held back.
    pub ticks: u64,
    /// The time that these ticks take together (s).
    pub duration: f64,
    /// Start of the first of these ticks (s).
    pub from: f64,
    /// End of the last of these ticks (s).
    pub to: f64,
    /// Mean of the force that was held back, over these ticks (N).
    pub mean: f64,
    /// The largest force that was held back (N).
    pub most: f64,
    /// The whole force at that time (N).
    pub most_of: f64,
    /// That time (s).
    pub most_time: f64,
}

/// The energy between the hands and one body (J).
#[derive(Clone, Debug, Serialize)]
pub struct EnergySummary {
    /// Name of the body.
    pub body: String,
    /// Net work of the hands, computed from held wrenches. `supplied + initial + received = raised + stored + dissipated`.
    pub supplied: f64,
    /// Energy in the first local model that the body had before hands moved it.
    pub initial: f64,
    /// Energy that came through contacts from the hands of other bodies, less the energy that went to them.
    pub received: f64,
    /// The part of `supplied` that lifted the body's weight.
    pub raised: f64,
    /// Energy that hands at rest could recover at the end, by the last local model; `None` if the scheme does not use
    /// it.
    pub stored: Option<f64>,
    /// The rest; below zero, energy was made. `None` if the scheme uses no stored energy.
    pub dissipated: Option<f64>,
    /// Net energy: the largest value over the run of `raised - supplied - received - credited - initial`, but at least zero.
    pub most_out: f64,
    /// The part of the devices' own dissipation on which a cap relies.
    pub credited: f64,
    /// Ticks in which a cap reduced a wrench, or the classic controller damped.
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
    /// Models and patches that found the log's ring full.
    pub logged_models: u64,
    /// Models that arrived together with a newer model and were not used.
    pub superseded_models: u64,
    /// Patches that found the tick's ring full.
    pub patches: u64,
    /// Patches that arrived together with a newer patch and were not used.
    pub superseded_patches: u64,
    /// Wrenches that a device refused.
    pub wrenches: u64,
}

/// One event.
#[derive(Clone, Debug, Serialize)]
pub struct EventSummary {
    /// Start (s).
    pub from: f64,
    /// End (s).
    pub to: f64,
    /// The event, in words.
    #[serde(rename = "what")]
    pub description: String,
}
