//! Folds ticks into frames: the curves, the totals and the events of a run or of a log.
//!
//! A [`Gatherer`] takes every tick in order and gives a frame whenever it is asked for one. It has no threads, clocks or
//! files. The observer of a run and the playback of a log use the same gatherer, so a run and its log look the same. Its
//! totals come from the code and the histograms of the summary.
//!
//! A gatherer does not know the host, the deformed vertices and the sites of patches. The caller that asks for the frame adds them.

mod bins;
mod events;
mod fold;
mod resume;
mod state;
#[cfg(test)]
pub(crate) mod tests;
mod view;

pub use resume::{Checkpoint, HandSums};
pub use view::TickView;

use super::frame::{Event, EventKind, Folded, Frame, Totals};
use super::obstacle;
use crate::record::Clock;
use crate::record::Distribution;
use crate::record::TearEvent;
use crate::record::Touch;
use crate::record::totals::DeviceSum;
use crate::scene::LoadedScene;
use bins::bins;
use events::{Change, Watch};
use physics::contact::Obstacle;
use rt_core::record::{BodyTelemetry, DeviceTelemetry};
use rt_core::{MAX_DEVICES, Pose};
use runner::latency::{Latencies, LatencyHistogram, LatencyReader};
use std::sync::Arc;

/// Most events of a frame. A limit that flickers would otherwise fill the memory of a viewer.
pub const MAX_EVENTS: usize = 64;

/// Folds ticks into frames.
///
/// ```
/// use host::live::gather::Gatherer;
/// use host::run::Clock;
/// use host::scene::Scene;
/// use rt_core::Telemetry;
///
/// let mut gatherer = Gatherer::new(&Scene::embedded_default()?, Clock::Virtual);
/// for tick in 0..3 {
///     let telemetry = Telemetry { tick, time_ns: tick * 1_000_000, ..Telemetry::empty() };
///     gatherer.take(&(&telemetry).into());
/// }
/// let frame = gatherer.frame();
/// assert_eq!((frame.folded.ticks, frame.totals.ticks, frame.time_ns), (3, 3, 2_000_000));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Gatherer {
    device_names: Vec<String>,
    body_names: Vec<String>,
    real: bool,
    period_ns: u64,
    /// The totals that are counts. Distributions are added when a frame is made.
    counts: Totals,
    sums: Vec<DeviceSum>,
    lateness: LatencyHistogram,
    ages: Vec<LatencyHistogram>,
    /// Computing time of a tick, if it is measured.
    tick_time: Option<LatencyReader>,
    watch: Watch,
    /// The tick with the largest lateness: lateness (ns), number, time (ns).
    worst: Option<(u64, u64, u64)>,
    last: Last,
    folded: Folded,
    events: Vec<Event>,
    more_events: u64,
    number: u64,
    /// The obstacles that frames show.
    obstacles: Arc<[Obstacle]>,
    /// The tools, in the scene's order.
    tools: Vec<Tool>,
}

/// A tool, which is shown where it is on the surface.
#[derive(Clone, Debug)]
struct Tool {
    name: String,
    device: usize,
    /// Its number among the obstacles.
    obstacle: usize,
    /// Whether it turns with the hand.
    turns: bool,
}

/// The last tick.
#[derive(Clone, Debug, Default)]
struct Last {
    /// Number and nominal time (ns); `None` before the first tick.
    tick: Option<(u64, u64)>,
    devices: Vec<DeviceTelemetry>,
    bodies: Vec<BodyTelemetry>,
    tools: [Option<Touch>; MAX_DEVICES],
}

impl Gatherer {
    /// A gatherer before the first tick of a run of `loaded` under `clock`.
    pub fn new(loaded: &LoadedScene, clock: Clock) -> Self {
        let scene = &loaded.scene;
        let devices = scene.devices.iter();
        let bodies = scene.bodies.iter();
        // The histograms have the bounds of the summary's, so that their numbers are equal.
        let empty = Latencies::new(scene.bodies.len());
        Self {
            device_names: devices.clone().map(|device| device.name.clone()).collect(),
            body_names: bodies.map(|body| body.name.clone()).collect(),
            real: clock == Clock::Real,
            period_ns: ((1e9 / scene.realtime.rate).round() as u64).max(1),
            counts: Totals::default(),
            sums: devices
                .map(|device| DeviceSum::new(device.mounting.turn()))
                .collect(),
            lateness: empty.lateness,
            ages: empty.model_age,
            tick_time: None,
            watch: Watch::default(),
            worst: None,
            last: Last::default(),
            folded: Folded::default(),
            events: Vec::new(),
            more_events: 0,
            number: 0,
            obstacles: Arc::default(),
            tools: (scene.numbered_tools())
                .map(|(tool, device, obstacle)| Tool {
                    name: tool.name.clone(),
                    device,
                    obstacle,
                    turns: (loaded.models.get(device)).is_some_and(|m| m.rotation.is_some()),
                })
                .collect(),
        }
    }

    /// The gatherer whose frames show these obstacles.
    #[must_use]
    pub fn with_obstacles(mut self, obstacles: &[Obstacle]) -> Self {
        self.obstacles = obstacles.into();
        self
    }

    /// Gives the frames the computing times of the tick from now on: see
    /// [`TickThread::tick_time`](runner::TickThread::tick_time).
    pub fn set_tick_time(&mut self, reader: LatencyReader) {
        self.tick_time = Some(reader);
    }

    /// Takes a tick. Ticks come in their order; some may be missing.
    pub fn take(&mut self, tick: &TickView<'_>) {
        let missed = self.count_gap(tick);
        if missed > 0 {
            let plural = if missed == 1 { "" } else { "s" };
            let text = format!("{missed} deadline{plural}");
            self.push(EventKind::MissedDeadline, tick, text);
        }
        self.counts.ticks += 1;
        let time = tick.time_ns as f64 * 1e-9;
        let devices = tick.devices.iter().zip(tick.places);
        for ((device, place), sum) in devices.zip(&mut self.sums) {
            sum.take(time, device, place);
        }
        for (body, ages) in tick.bodies.iter().zip(&mut self.ages) {
            // A sequence number of zero means that no model has arrived, so there is no age.
            if body.sequence > 0 {
                ages.record(body.age_ns);
            }
        }
        if self.real {
            self.lateness.record(tick.lateness_ns);
            if self.worst.is_none_or(|(most, ..)| tick.lateness_ns > most) {
                self.worst = Some((tick.lateness_ns, tick.tick, tick.time_ns));
            }
        }
        for change in self.watch.take(tick) {
            self.push_change(change, tick);
        }
        fold::take(&mut self.folded, tick, missed, self.real);
        self.last.tick = Some((tick.tick, tick.time_ns));
        tick.devices.clone_into(&mut self.last.devices);
        tick.bodies.clone_into(&mut self.last.bodies);
        self.last.tools = tick.tools;
    }

    /// Counts the deadlines that were missed and the records that were lost since the last tick. Returns the missed
    /// deadlines. A missed deadline advances the time without a tick. If records are lost, all deadlines missed in
    /// the gap count as missed in a row.
    fn count_gap(&mut self, tick: &TickView<'_>) -> u64 {
        let Some((number, time_ns)) = self.last.tick else {
            return 0;
        };
        let ticks = tick.tick.saturating_sub(number);
        let elapsed = tick.time_ns.saturating_sub(time_ns);
        let slots = elapsed.saturating_add(self.period_ns / 2) / self.period_ns;
        let missed = slots.saturating_sub(ticks);
        self.counts.missed += missed;
        self.counts.longest_miss = self.counts.longest_miss.max(missed);
        self.counts.lost += ticks.saturating_sub(1);
        missed
    }

    /// Adds an edit by which a body tore, before the tick that follows the edit. `words` say what happened.
    pub fn tear(&mut self, tick: &TickView<'_>, event: &TearEvent, words: &str) {
        let text = match self.body_names.get(event.body as usize) {
            Some(name) => format!("{name}: {words}"),
            None => words.to_owned(),
        };
        self.push(EventKind::Tear, tick, text);
    }

    fn push_change(&mut self, change: Change, tick: &TickView<'_>) {
        let (kind, names, index, words) = match change {
            Change::Trip(device, words) => {
                self.counts.trips += 1;
                (EventKind::Trip, &self.device_names, device, words)
            }
            Change::Stale(body, words) => {
                self.counts.stale += 1;
                (EventKind::StaleModel, &self.body_names, body, words)
            }
            Change::Beyond(device) => {
                let mut tools = self.tools.iter();
                let tool = tools.find(|tool| tool.device == device);
                let touch = tick.tools.get(device).copied().flatten();
                let words = touch.and_then(|touch| touch.beyond());
                if let (Some(tool), Some(words)) = (tool, words) {
                    let text = format!("{}: {words}", tool.name);
                    self.push(EventKind::Beyond, tick, text);
                }
                return;
            }
        };
        let text = match names.get(index) {
            Some(name) => format!("{name}: {words}"),
            None => words.to_owned(),
        };
        self.push(kind, tick, text);
    }

    fn push(&mut self, kind: EventKind, tick: &TickView<'_>, text: String) {
        if self.events.len() >= MAX_EVENTS {
            self.more_events += 1;
            return;
        }
        self.events.push(Event {
            kind,
            tick: tick.tick,
            time_ns: tick.time_ns,
            text,
        });
    }

    /// The tick with the largest lateness so far, as an event; `None` under virtual time and before the first tick.
    pub fn worst_tick(&self) -> Option<Event> {
        let (lateness_ns, tick, time_ns) = self.worst?;
        Some(Event {
            kind: EventKind::WorstTick,
            tick,
            time_ns,
            text: format!("largest lateness: {:.1} µs", lateness_ns as f64 * 1e-3),
        })
    }

    /// The frame of the ticks since the frame before. Its bodies have no vertices, and its host is not known.
    pub fn frame(&mut self) -> Frame {
        let number = self.number;
        self.number += 1;
        let time_ns = self.last.tick.map_or(0, |(_, time_ns)| time_ns);
        let mut obstacles = obstacle::states(&self.obstacles, time_ns as f64 * 1e-9);
        let mut tools = Vec::new();
        for tool in &self.tools {
            let touch = self.last.tools.get(tool.device).copied().flatten();
            let (Some(touch), Some(device)) = (touch, self.last.devices.get(tool.device)) else {
                continue;
            };
            if let Some(state) = obstacles.get_mut(tool.obstacle) {
                state.pose = state::pose(&touch.pose);
            }
            let led = if tool.turns {
                device.pose
            } else {
                Pose::at(device.pose.position)
            };
            tools.push(state::tool(tool.device, &touch, &led));
        }
        Frame {
            number,
            time_ns,
            obstacles,
            tools,
            folded: std::mem::take(&mut self.folded),
            totals: self.totals(),
            hands: (self.last.devices.iter().zip(&self.sums))
                .map(|(device, sum)| state::hand(device, sum.totals()))
                .collect(),
            bodies: self.last.bodies.iter().map(state::body).collect(),
            events: std::mem::take(&mut self.events),
            more_events: std::mem::take(&mut self.more_events),
            ..Frame::default()
        }
    }

    /// The last frame of a run. Its last event is the tick with the largest lateness of the run.
    pub fn last_frame(&mut self) -> Frame {
        let mut frame = self.frame();
        frame.last = true;
        if let Some(worst) = self.worst_tick() {
            // The last event always has a place.
            let left_out = frame.events.len().saturating_sub(MAX_EVENTS - 1);
            frame.events.truncate(MAX_EVENTS - 1);
            frame.more_events += left_out as u64;
            frame.events.push(worst);
        }
        frame
    }

    /// The totals so far.
    pub fn totals(&self) -> Totals {
        let of = |histogram: &LatencyHistogram| Distribution::from(histogram.summary());
        let duration = self.tick_time.as_ref().filter(|_| self.real);
        let duration = duration.map(LatencyReader::read);
        Totals {
            lateness: self.real.then(|| of(&self.lateness)),
            duration: duration.as_ref().map(of),
            model_age: self.ages.iter().map(of).collect(),
            lateness_bins: bins(&self.lateness),
            duration_bins: duration.as_ref().map(bins).unwrap_or_default(),
            ..self.counts.clone()
        }
    }
}
