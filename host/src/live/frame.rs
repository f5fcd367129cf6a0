//! The frames of a run or of a log, as viewers receive them. All quantities are in SI units, in the axes of the scene; times in ns
//! are integers since the start of the run.

use super::Range;
use super::obstacle::{ObstacleInfo, ObstacleState};
use crate::record::Distribution;
use crate::record::contact::ContactPoint;
use crate::snapshot::HostCounts;
use rt_core::tool::Site;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the messages. A viewer refuses a stream of another version.
pub const PROTOCOL: &str = "palpate.view/1";

/// Where the frames come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// A run that is under way.
    #[default]
    Run,
    /// A log that is played back.
    Log,
}

/// The first message of a stream: the facts that do not change.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// [`PROTOCOL`].
    pub protocol: String,
    /// A run or a log.
    pub source: Source,
    /// The path of the log; empty for a run.
    pub file: String,
    /// Identifies the process of the run, for a viewer that connects again; zero for a log.
    pub run: u64,
    /// Name of the scene.
    pub scene: String,
    /// `virtual` or `real`.
    pub clock: String,
    /// The force scheme.
    pub scheme: String,
    /// Ticks a second (Hz).
    pub tick_rate: f64,
    /// Host steps a second that the scene asks for (Hz).
    pub step_rate: f64,
    /// Publications a second that the scene asks for (Hz).
    pub publish_rate: f64,
    /// Length of the run (s), as planned.
    pub duration: f64,
    /// The devices, in the scene's order.
    pub devices: Vec<DeviceInfo>,
    /// The bodies, in the scene's order.
    pub bodies: Vec<BodyInfo>,
    /// The obstacles, in the scene's order. A scene without obstacles has no such field, as have earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<ObstacleInfo>,
    /// Whether something may touch, so that the log has contacts.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub touches: bool,
    /// The tools, in the scene's order. A scene with tools has patches in its log.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tools: Vec<ToolInfo>,
    /// The facts of the log's header: seed, version and others.
    pub facts: BTreeMap<String, String>,
    /// The text of the scene. Scene and files let a viewer build the bodies, to compute stresses. They are not sent to
    /// a page.
    pub scene_text: String,
    /// The files that the scene names. In the binary part of the message.
    #[serde(skip)]
    pub files: BTreeMap<String, Vec<u8>>,
}

/// One device.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DeviceInfo {
    /// Name in the scene.
    pub name: String,
    /// Name of the device model.
    pub model: String,
    /// Largest force of the device (N).
    pub max_force: f64,
    /// Age of the local model at which its force fades (s).
    pub age_limit: f64,
}

/// One tool.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ToolInfo {
    /// Index of its device.
    pub device: u32,
    /// Its number among the obstacles, which have its name and its shape.
    pub obstacle: u32,
}

/// One body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BodyInfo {
    /// Name in the scene.
    pub name: String,
    /// `thread`, `sheet`, `woven` or `solid`.
    pub kind: String,
    /// Number of vertices.
    pub vertices: u32,
    /// Number of elements.
    pub elements: u32,
    /// The handles of devices.
    pub handles: Vec<HandleInfo>,
    /// By vertex: its cluster in the hierarchy of contact at the start. Empty in a scene without contact.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub clusters: Vec<u32>,
}

/// A handle of a body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HandleInfo {
    /// Index of the device that holds the handle.
    pub device: u32,
    /// The origin of the handle at rest (m).
    pub origin: [f64; 3],
}

/// One moment of a run or of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Number of the frame, from zero.
    pub number: u64,
    /// Nominal time of the last tick (ns).
    pub time_ns: u64,
    /// The ticks since the frame before.
    pub folded: Folded,
    /// Totals since the start of the run. Of a log, those up to this moment if they are known.
    pub totals: Totals,
    /// The hands at the last tick, by device.
    pub hands: Vec<HandState>,
    /// The bodies at the last tick.
    pub bodies: Vec<BodyState>,
    /// The obstacles at the last tick.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<ObstacleState>,
    /// The tools at the last tick. Each is on the surface where its obstacle is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tools: Vec<ToolState>,
    /// The strongest contacts of the newest host step.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<ContactArrow>,
    /// The host; `None` if nothing is known, as in a log.
    pub host: Option<HostCounts>,
    /// The events since the frame before, in order.
    pub events: Vec<Event>,
    /// Events that are left out because there were too many.
    pub more_events: u64,
    /// Frames that this viewer did not take and that were dropped, since it connected. Their curves and events are in
    /// the frame after them.
    pub dropped: u64,
    /// The log's messages since the frame before: in the binary part, for viewers that pass them on. Not sent to a page.
    pub log: Vec<LogMessage>,
    /// Messages of the log that are left out because there were too many.
    pub more_log: u64,
    /// The run is over, and this is its last frame.
    pub last: bool,
}

/// A tool at a tick.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ToolState {
    /// Index of its device. A device has one tool.
    pub device: u32,
    /// The pose to which its device leads it: position (m), and the quaternion x, y, z, w. The surface holds it back from there.
    pub led: [f64; 7],
    /// Number of contacts within reach.
    pub contacts: u32,
    /// The force of the surface on the tool (N).
    pub force: [f64; 3],
    /// Number of the patch in use; zero before the first.
    pub patch: u64,
    /// The points of the surface among which the tick looks for contacts (m), where the patch in use has them. Empty if the patch is
    /// not known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sites: Vec<[f32; 3]>,
}

/// The sites of a patch as a frame has them (m).
pub fn sites<'a>(patch: impl IntoIterator<Item = &'a Site>) -> Vec<[f32; 3]> {
    let places = patch.into_iter().map(|site| site.place);
    places.map(|place| place.map(|x| x as f32).into()).collect()
}

/// A contact of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactArrow {
    /// Its place (m).
    pub at: [f32; 3],
    /// The force on the body, of two bodies on the first one (N).
    pub force: [f32; 3],
    /// The depth by which the sides overlap (m).
    pub depth: f32,
}

impl From<&ContactPoint> for ContactArrow {
    fn from(point: &ContactPoint) -> Self {
        let [one, other] = point.sides;
        let force = if one <= other {
            point.force
        } else {
            -point.force
        };
        Self {
            at: point.at.map(|x| x as f32).into(),
            force: force.map(|x| x as f32).into(),
            depth: point.depth as f32,
        }
    }
}

/// A message as the log has it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LogMessage {
    /// Its channel: `/tick`, `/model`, or a channel of the bodies' frames.
    pub topic: String,
    /// Its time (ns).
    pub time_ns: u64,
    /// Number of bytes.
    pub length: u32,
    /// Its content (CDR). In the binary part.
    #[serde(skip)]
    pub data: Vec<u8>,
}

/// Some ticks in a row, folded: of each curve the least and the greatest value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Folded {
    /// Number of the first tick.
    pub first: u64,
    /// Number of the last tick.
    pub last: u64,
    /// Nominal time of the first tick (ns).
    pub from_ns: u64,
    /// Nominal time of the last tick (ns).
    pub to_ns: u64,
    /// Ticks with a record.
    pub ticks: u64,
    /// Deadlines missed.
    pub missed: u64,
    /// Lateness (s).
    pub lateness: Range,
    /// By device.
    pub hands: Vec<FoldedHand>,
    /// By body.
    pub bodies: Vec<FoldedBody>,
}

/// The curves of one hand.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FoldedHand {
    /// Components of the force (N).
    pub force: [Range; 3],
    /// Magnitude of the force (N).
    pub force_norm: Range,
    /// Magnitude of the moment (N m).
    pub moment_norm: Range,
    /// Components of the position of the proxy (m).
    pub position: [Range; 3],
    /// Speed of the proxy (m/s).
    pub speed: Range,
}

/// The curves of one body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FoldedBody {
    /// Age of the model in use (s).
    pub age: Range,
    /// Trust in the model in use.
    pub trust: Range,
    /// Force that the cap withholds (N).
    pub withheld: Range,
    /// Net work of the hands (J).
    pub supplied: Range,
    /// Energy that the hands could recover (J).
    pub stored: Range,
}

/// Totals since the start.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Totals {
    /// Ticks with a record.
    pub ticks: u64,
    /// Deadlines missed.
    pub missed: u64,
    /// Most deadlines missed in a row.
    pub longest_miss: u64,
    /// Ticks whose record did not arrive.
    pub lost: u64,
    /// Lateness (s); `None` under virtual time.
    pub lateness: Option<Distribution>,
    /// Computing time of a tick (s); `None` under virtual time and in a log.
    pub duration: Option<Distribution>,
    /// Age of the model in use (s), by body.
    pub model_age: Vec<Distribution>,
    /// Histogram of the lateness.
    pub lateness_bins: Bins,
    /// Histogram of the computing time of a tick.
    pub duration_bins: Bins,
    /// Trips of the last stage.
    pub trips: u64,
    /// Times that the newest model became too old.
    pub stale: u64,
}

/// A histogram over logarithmic bins, four an octave: upper edge (ns) and count of each bin that has a value, in
/// ascending order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bins(pub Vec<(u64, u64)>);

/// One hand.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HandState {
    /// Position of the proxy (m).
    pub position: [f64; 3],
    /// Rotation of the proxy: a unit quaternion x, y, z, w.
    pub rotation: [f64; 4],
    /// Force on the hand (N).
    pub force: [f64; 3],
    /// Moment on the hand about the handle (N m).
    pub moment: [f64; 3],
    /// Velocity of the proxy (m/s).
    pub velocity: [f64; 3],
    /// Buttons, one bit each.
    pub buttons: u32,
    /// Whether the device gave a good state in the last tick.
    pub fresh: bool,
    /// State of the last stage: `normal`, `limited`, `recovering`, `silent`, `let_go`, `device_fault`, `not_a_number`,
    /// `slewed`, `too_fast`, `out_of_reach`, `hot`, `engaging`, `hands_off`, `disarmed` or `stopped`.
    pub safety: String,
    /// Largest force since the start (N).
    pub peak_force: f64,
    /// Work done on the hand since the start (J), as in the summary of the run.
    pub work: f64,
    /// Largest distance from the first position (m).
    pub reach: f64,
}

/// One body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BodyState {
    /// State of the coupling: `waiting`, `live`, `fading` or `held`.
    pub state: String,
    /// Number of the model in use; zero before the first.
    pub sequence: u64,
    /// Topology epoch of the model in use.
    pub epoch: u32,
    /// Age of the model in use (s).
    pub age: f64,
    /// Trust in the model in use, from zero (safe hold) to one.
    pub trust: f64,
    /// Force that the cap withholds (N).
    pub withheld: f64,
    /// The sums of the energy account (J), by name: see `palpate_msgs/Body`.
    pub energy: BTreeMap<String, f64>,
    /// Ticks in which the cap reduced a force.
    pub capped_ticks: u64,
    /// The deformed vertices, if the frame has them. Without them, the vertices of the frame before are still valid.
    pub vertices: Option<Vertices>,
}

/// The deformed vertices of a body after a host step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vertices {
    /// Number of the host step, from one; zero before the first step. Zero in a log.
    pub step: u64,
    /// Time at which the step was due (ns).
    pub time_ns: u64,
    /// Topology epoch: that of the [`Surface`](crate::record::Surface) to draw.
    pub epoch: u32,
    /// Number of vertices.
    pub count: u32,
    /// Whether the message has stresses.
    pub stressed: bool,
    /// Positions (m), three numbers a vertex: those of the step, rounded to `f32`. In the binary part.
    #[serde(skip)]
    pub positions: Vec<f32>,
    /// Von Mises stress (Pa) by vertex: the mean over the elements around the vertex. Empty if `stressed` is
    /// false. In the binary part.
    #[serde(skip)]
    pub stress: Vec<f32>,
}

/// The kind of an event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// A limit of the last stage began to act, or a device fell silent.
    #[default]
    Trip,
    /// Deadlines were missed.
    MissedDeadline,
    /// The newest model became too old.
    StaleModel,
    /// The tick with the largest lateness of the run.
    WorstTick,
    /// A tear started, reached a border, or parted a sheet.
    Tear,
    /// A tool went beyond the surface that its patch has.
    Beyond,
}

/// An event.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Its kind.
    pub kind: EventKind,
    /// Number of its tick.
    pub tick: u64,
    /// Nominal time of its tick (ns).
    pub time_ns: u64,
    /// The event, in words, with the name of the device or body.
    pub text: String,
}

/// How a log is played back. Sent when it changes, and with each frame of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Playback {
    /// Whether the log plays.
    pub playing: bool,
    /// Seconds of the log for each second of the wall.
    pub speed: f64,
    /// Time of the first tick (ns).
    pub from_ns: u64,
    /// Time of the last tick (ns).
    pub to_ns: u64,
    /// The moment that is shown (ns).
    pub at_ns: u64,
    /// Number of the tick that is shown.
    pub tick: u64,
    /// Whether the log has its end; `false` if its writer was killed.
    pub complete: bool,
    /// Whether the log has frames of the bodies.
    pub has_frames: bool,
    /// The missing parts of the log, in words for people; empty for a log that has everything.
    pub notes: Vec<String>,
    /// All events of the log. Empty if nothing changed since the message before.
    pub events: Vec<Event>,
    /// The whole log in a few hundred pieces, for the timeline. Empty if nothing changed since the message before.
    pub overview: Vec<Folded>,
}
