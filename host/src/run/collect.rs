//! Totals of a run's telemetry: peaks, work, events, and the samples of a plot.
//!
//! The same collector takes the telemetry of both clocks. Under the real clock it runs on the log's
//! thread.

use super::beyond;
use super::marks::Marks;
use super::observer::{Observed, Observer};
use super::samples::{Sample, Samples};
use super::slips;
use super::tear_force::{TearForce, TearForces};
use super::tears::TearEvents;
use super::withheld::{Stretch, Watch};
use crate::plot::Mark;
use crate::record::Touch;
use crate::record::totals::{DeviceSum, DeviceTotals, place};
use crate::scene::Scene;
use rt_core::Telemetry;
use rt_core::coupling::HostState;
use rt_core::record::{DeviceTelemetry, ToolTelemetry};
use runner::link::LogRecord;

/// A stretch of time in which a device or a body was not in its normal state.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Span {
    /// Start (s).
    pub from: f64,
    /// End (s).
    pub to: f64,
    /// The event, in words.
    pub description: String,
}

/// What the tool of a device met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Touched {
    /// Ticks in which a surface pressed it.
    pub ticks: u64,
    /// Largest force of the surfaces on it (N), and the time of this force (s).
    pub peak_force: f64,
    pub peak_time: f64,
    /// Largest distance between the tool and its device (m).
    pub apart: f64,
}

impl Touched {
    fn take(&mut self, time: f64, tool: &ToolTelemetry, device: &DeviceTelemetry) {
        let force = tool.wrench.force.norm();
        self.ticks += u64::from(force > 0.0);
        if force > self.peak_force {
            (self.peak_force, self.peak_time) = (force, time);
        }
        let apart = (device.pose.position - tool.proxy.position).norm();
        self.apart = self.apart.max(if force > 0.0 { apart } else { 0.0 });
    }
}

/// The state of a tool's coupling, in words; `None` if it is normal.
fn age(state: HostState) -> Option<&'static str> {
    match state {
        HostState::Waiting | HostState::Live => None,
        HostState::Fading => Some("patch too old, force fading"),
        HostState::Held => Some("patch too old, safe hold"),
    }
}

/// Sums up telemetry.
#[derive(Debug)]
pub(super) struct Collector {
    device_names: Vec<String>,
    body_names: Vec<String>,
    /// With the device of each tool.
    tool_names: Vec<(usize, String)>,
    /// By device.
    touched: Vec<Touched>,
    /// By device.
    sums: Vec<DeviceSum>,
    slips: Vec<slips::Watch>,
    /// By device.
    states: Vec<States>,
    /// By device, then by body, then by tool.
    open: Vec<Option<(f64, &'static str)>>,
    /// By body, then by tool.
    withheld: Vec<Watch>,
    /// By tool.
    beyond: Vec<beyond::Watch>,
    spans: Vec<Span>,
    tears: TearEvents,
    tear_forces: TearForces,
    /// The samples of the plot, if there is one.
    samples: Option<(Samples, Marks)>,
    ticks: u64,
    end: f64,
}

impl Collector {
    /// A collector for the devices and bodies of `scene`. `keep_samples` keeps the samples of a plot, and
    /// `tears` says what tears.
    pub(super) fn new(scene: &Scene, keep_samples: bool, tears: TearEvents) -> Self {
        let devices = scene.devices.iter();
        let device_names: Vec<_> = devices.clone().map(|device| device.name.clone()).collect();
        let bodies = scene.bodies.iter();
        let body_names: Vec<_> = bodies.map(|body| body.name.clone()).collect();
        // Telemetry has the tools in the order of their devices.
        let tools = scene.numbered_tools();
        let mut tool_names: Vec<_> = tools
            .map(|(tool, device, _)| (device, tool.name.clone()))
            .collect();
        tool_names.sort();
        let holders = body_names.len() + tool_names.len();
        Self {
            touched: vec![Touched::default(); device_names.len()],
            sums: devices
                .map(|device| DeviceSum::new(device.mounting.turn()))
                .collect(),
            slips: vec![slips::Watch::default(); device_names.len()],
            states: vec![States::default(); device_names.len()],
            open: vec![None; device_names.len() + holders],
            withheld: vec![Watch::default(); holders],
            beyond: vec![beyond::Watch::default(); tool_names.len()],
            spans: Vec::new(),
            tears,
            tear_forces: TearForces::new(scene),
            samples: keep_samples
                .then(|| (Samples::default(), Marks::new(&device_names, &body_names))),
            ticks: 0,
            end: 0.0,
            device_names,
            body_names,
            tool_names,
        }
    }

    /// Takes the record of one tick.
    pub(super) fn take(&mut self, telemetry: &Telemetry) {
        let time = telemetry.time_ns as f64 * 1e-9;
        self.ticks += 1;
        self.end = time;
        let sums = self.sums.iter_mut().zip(&mut self.slips);
        let devices = telemetry.devices().zip(telemetry.readings());
        let each = devices.zip(sums).zip(&self.device_names);
        for (((device, reading), (sum, slip)), name) in each {
            sum.take(time, device, place(device, reading));
            if let Some(slip) = slip.take(time, device) {
                push_slip(&mut self.spans, name, &slip);
            }
        }
        for (states, reading) in self.states.iter_mut().zip(telemetry.readings()) {
            if reading.is_ok() {
                states.take(time);
            }
        }
        let limited = telemetry.devices().map(|device| device.safety.words());
        let aged = telemetry.bodies().map(|body| body.state.words());
        let old = telemetry.tools().map(|tool| age(tool.state));
        let tool_names = self.tool_names.iter().map(|(_, name)| name);
        let holders = self.body_names.iter().chain(tool_names);
        let names = self.device_names.iter().chain(holders.clone());
        let now = limited.chain(aged).chain(old);
        for ((now, open), name) in now.zip(&mut self.open).zip(names) {
            if open.map(|(_, description)| description) != now {
                if let Some((from, description)) = open.take() {
                    push_span(&mut self.spans, from, time, name, description);
                }
                *open = now.map(|description| (time, description));
            }
        }
        let bodies = telemetry.bodies().map(|body| body.withheld);
        let withheld = bodies.chain(telemetry.tools().map(|tool| tool.withheld));
        for ((withheld, watch), name) in withheld.zip(&mut self.withheld).zip(holders) {
            if let Some(stretch) = watch.take(time, withheld) {
                push_withheld(&mut self.spans, name, &stretch);
            }
        }
        let watched = telemetry.tools().zip(&mut self.beyond);
        for ((tool, watch), (_, name)) in watched.zip(&self.tool_names) {
            if let Some(stretch) = watch.take(time, &Touch::from(tool)) {
                push_beyond(&mut self.spans, name, &stretch);
            }
        }
        for tool in telemetry.tools() {
            let number = usize::from(tool.device);
            let device = telemetry.devices().nth(number);
            if let (Some(touched), Some(device)) = (self.touched.get_mut(number), device) {
                touched.take(time, tool, device);
            }
        }
        self.take_tears();
        self.tear_forces.take(telemetry);
        if let Some((samples, marks)) = &mut self.samples {
            marks.take(telemetry);
            samples.take(telemetry);
        }
    }

    /// Takes what has torn since the last tick.
    fn take_tears(&mut self) {
        while let Some((event, words)) = self.tears.next() {
            let time = event.time_ns as f64 * 1e-9;
            self.tear_forces.opened(event.body as usize, event.time_ns);
            if let Some((_, marks)) = &mut self.samples {
                marks.tear(event.body as usize, time);
            }
            let name = self.body_names.get(event.body as usize);
            if let (Some(words), Some(name)) = (words, name) {
                push_span(&mut self.spans, time, time, name, &words);
            }
        }
    }

    /// Ends the stretches that are still open, and returns the totals.
    pub(super) fn finish(mut self) -> Collected {
        self.take_tears();
        let tool_names = self.tool_names.iter().map(|(_, name)| name);
        let holders = self.body_names.iter().chain(tool_names);
        let names = self.device_names.iter().chain(holders.clone());
        for (open, name) in self.open.iter().zip(names) {
            if let Some((from, description)) = *open {
                push_span(&mut self.spans, from, self.end, name, description);
            }
        }
        for (watch, name) in self.slips.iter().zip(&self.device_names) {
            if let Some(slip) = watch.finish() {
                push_slip(&mut self.spans, name, &slip);
            }
        }
        for (watch, name) in self.withheld.iter().zip(holders) {
            if let Some(stretch) = watch.finish() {
                push_withheld(&mut self.spans, name, &stretch);
            }
        }
        for (watch, (_, name)) in self.beyond.iter().zip(&self.tool_names) {
            if let Some(stretch) = watch.finish() {
                push_beyond(&mut self.spans, name, &stretch);
            }
        }
        let kept = self
            .samples
            .map(|(samples, marks)| (samples.finish(), marks.finish()));
        let (samples, marks) = kept.unwrap_or_default();
        Collected {
            touched: self.touched,
            totals: self.sums.iter().map(|sum| sum.totals().clone()).collect(),
            spans: self.spans,
            tear_forces: self.tear_forces.finish(),
            states: self.states,
            samples,
            marks,
            records: self.ticks,
        }
    }
}

/// The ticks of a device with a state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct States {
    count: u64,
    /// Times of the first and of the last (s).
    between: [f64; 2],
}

impl States {
    fn take(&mut self, time: f64) {
        if self.count == 0 {
            self.between[0] = time;
        }
        self.between[1] = time;
        self.count += 1;
    }

    /// States a second from the first to the last (Hz); zero for fewer than two.
    fn rate(&self) -> f64 {
        let [first, last] = self.between;
        if last > first {
            (self.count - 1) as f64 / (last - first)
        } else {
            0.0
        }
    }
}

impl Collected {
    /// States a second of the device number `index` from its first state to its last (Hz).
    pub(super) fn states_rate(&self, index: usize) -> f64 {
        self.states.get(index).map_or(0.0, States::rate)
    }
}

impl Observer for Collector {
    fn take(&mut self, record: LogRecord<'_>) {
        if let LogRecord::Tick(telemetry) = record {
            Self::take(self, telemetry);
        }
    }

    fn finish(self: Box<Self>, observed: &mut Observed) {
        observed.collected = Self::finish(*self);
    }
}

/// Most spans that are kept. Nobody reads more of them, and without a bound a flickering limit would fill the memory.
const MAX_SPANS: usize = 1000;

fn push_slip(spans: &mut Vec<Span>, name: &str, slip: &slips::Slip) {
    push_span(spans, slip.from, slip.to, name, &slip.description());
}

fn push_withheld(spans: &mut Vec<Span>, name: &str, stretch: &Stretch) {
    push_span(
        spans,
        stretch.from,
        stretch.to,
        name,
        &stretch.description(),
    );
}

fn push_beyond(spans: &mut Vec<Span>, name: &str, stretch: &beyond::Stretch) {
    push_span(
        spans,
        stretch.from,
        stretch.to,
        name,
        &stretch.description(),
    );
}

fn push_span(spans: &mut Vec<Span>, from: f64, to: f64, name: &str, description: &str) {
    if spans.len() < MAX_SPANS {
        spans.push(Span {
            from,
            to,
            description: format!("{name}: {description}"),
        });
    }
}

/// The totals of a [`Collector`].
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Collected {
    /// By device.
    pub totals: Vec<DeviceTotals>,
    /// By device.
    pub touched: Vec<Touched>,
    /// Stretches of time in which a device or a body was not in its normal state, at most a thousand.
    pub spans: Vec<Span>,
    /// The force at the tears of each body; `None` if nothing tore.
    pub tear_forces: Vec<Option<TearForce>>,
    /// By device.
    pub states: Vec<States>,
    /// The intervals that the plot marks, if samples were kept.
    pub marks: Vec<Mark>,
    /// The samples of the plot, if samples were kept.
    pub samples: Vec<Sample>,
    /// Number of tick records taken.
    pub records: u64,
}
