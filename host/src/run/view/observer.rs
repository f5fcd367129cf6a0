//! The observer of a run that makes frames, on the thread of the log.
//!
//! It takes every tick, so the totals and the least and greatest values are those of all ticks, watched or not. While a
//! viewer is connected, it makes up to sixty frames a second of the wall clock, adds the newest positions of the host, and
//! gives the frames to the thread of the viewers without waiting.

use crate::live::frame::{ContactArrow, Frame, LogMessage, Vertices, sites};
use crate::live::gather::Gatherer;
use crate::live::merge::MAX_LOG;
use crate::live::socket::{Update, UpdateSender};
use crate::record::{ContactStep, Kind, ModelRow, PatchRow, Surface, TickRow};
use crate::run::observer::{Observed, Observer};
use crate::run::tears::TearEvents;
use crate::snapshot::{HostCounts, Rate, Reader, Snapshot, Watchers, after_change};
use rt_core::publication::Publication;
use rt_core::tool::Patch;
use runner::LatencyReader;
use runner::link::LogRecord;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Instant;

/// Patches whose sites are kept: more than a host publishes for eight tools between two frames.
const PATCHES: usize = 128;

/// Length of the time over which the rate of the host's steps is counted (ns).
const RATE_SPAN_NS: u64 = 1_000_000_000;

/// The observer.
pub(crate) struct ViewObserver {
    watchers: Watchers,
    /// Whether a viewer was connected at the last look.
    watched: bool,
    rate: Rate,
    frames: Frames,
    log: LogTail,
    /// The edits of the sheets that tear.
    tears: TearEvents,
    snapshots: Reader,
    sender: UpdateSender,
    /// The surfaces and the frame that the thread of the viewers has not taken.
    waiting: Option<(Vec<Surface>, Box<Frame>)>,
    /// Surfaces of a frame that was dropped when the last viewer left. The next viewer needs them.
    owed: Vec<Surface>,
    /// Where the tick's thread leaves its computing times.
    tick_time: TickTime,
    /// Where the frames go at the end of the run.
    rest: Rest,
}

/// The reader of the computing times of the ticks, once the tick's thread has started. Under virtual time there is none.
pub(crate) type TickTime = Arc<OnceLock<LatencyReader>>;

/// What is left of the observer at the end of the run; `None` before.
pub(super) type Rest = Arc<Mutex<Option<Frames>>>;

impl ViewObserver {
    pub(super) fn new(
        watchers: Watchers,
        frames: Frames,
        snapshots: Reader,
        sender: UpdateSender,
        (tick_time, rest): (TickTime, Rest),
    ) -> Self {
        Self {
            watchers,
            watched: false,
            rate: Rate::of_frames(),
            frames,
            log: LogTail::default(),
            tears: TearEvents::default(),
            snapshots,
            sender,
            waiting: None,
            owed: Vec::new(),
            tick_time,
            rest,
        }
    }

    /// The observer that also tells viewers of `tears`.
    pub(crate) fn with_tears(self, tears: TearEvents) -> Self {
        Self { tears, ..self }
    }

    fn send(&mut self) {
        let snapshot = self.snapshots.newest();
        let (newer, mut frame) = self.frames.make(snapshot.as_deref());
        let mut surfaces = std::mem::take(&mut self.owed);
        add_newer(&mut surfaces, newer);
        if let Some(snapshot) = snapshot {
            self.snapshots.give_back(snapshot);
        }
        (frame.log, frame.more_log) = self.log.take();
        let (surfaces, frame) = match self.waiting.take() {
            None => (surfaces, Box::new(frame)),
            Some((mut before, first)) => {
                frame.merge_before(*first);
                add_newer(&mut before, surfaces);
                (before, Box::new(frame))
            }
        };
        if let Some(Update::Frame(surfaces, frame)) =
            self.sender.try_send(Update::Frame(surfaces, frame))
        {
            self.waiting = Some((surfaces, frame));
        }
    }
}

impl Observer for ViewObserver {
    fn take(&mut self, record: LogRecord<'_>) {
        if let LogRecord::Tick(telemetry) = record {
            let tick = telemetry.into();
            while let Some((event, words)) = self.tears.next() {
                if let Some(words) = words {
                    self.frames.gatherer.tear(&tick, &event, &words);
                }
            }
            self.frames.gatherer.take(&tick);
        }
        if self.watched {
            if let LogRecord::Patch(device, patch) = record {
                self.frames.patches.take(device, patch);
            }
            self.log.add(record);
        }
    }

    fn touched(&mut self, step: &mut ContactStep) {
        if self.watched {
            let contacts = &mut self.frames.contacts;
            contacts.clear();
            contacts.extend(step.points.iter().map(ContactArrow::from));
            self.log.touched(step);
        }
    }

    fn drained(&mut self) {
        if !self.watchers.any() {
            self.watched = false;
            return;
        }
        if !self.watched {
            self.watched = true;
            if let Some(reader) = self.tick_time.get() {
                self.frames.gatherer.set_tick_time(reader.clone());
            }
            // The first frame begins now, and not at the start of the run or with the viewer before.
            self.frames.skip();
            self.log = LogTail::default();
            if let Some((surfaces, _)) = self.waiting.take() {
                add_newer(&mut self.owed, surfaces);
            }
            return;
        }
        if self.rate.is_due(Instant::now()) {
            self.send();
        }
    }

    fn finish(self: Box<Self>, _: &mut Observed) {
        let mut frames = self.frames;
        if let Some(reader) = self.tick_time.get() {
            frames.gatherer.set_tick_time(reader.clone());
        }
        frames.unsent = self.waiting.map(|(surfaces, frame)| (surfaces, *frame));
        frames.owed = self.owed;
        *self.rest.lock().unwrap_or_else(PoisonError::into_inner) = Some(frames);
    }
}

/// Adds the surfaces `newer` to `surfaces`. Of each body only the newest surface stays.
fn add_newer(surfaces: &mut Vec<Surface>, newer: Vec<Surface>) {
    surfaces.retain(|old| newer.iter().all(|new| new.body != old.body));
    surfaces.extend(newer);
}

/// Makes frames.
pub(super) struct Frames {
    gatherer: Gatherer,
    /// By body: the surface of the present topology epoch.
    surfaces: Vec<Surface>,
    /// The contacts of the newest host step.
    contacts: Vec<ContactArrow>,
    /// The newest patches.
    patches: Patches,
    host: HostCounts,
    steps: StepRate,
    /// A frame that the thread of the viewers did not take.
    unsent: Option<(Vec<Surface>, Frame)>,
    /// Surfaces that the thread of the viewers does not have, before those of `unsent`.
    owed: Vec<Surface>,
}

impl Frames {
    /// Frames of a run whose bodies have these surfaces.
    pub(super) fn new(gatherer: Gatherer, surfaces: Vec<Surface>) -> Self {
        Self {
            gatherer,
            surfaces,
            contacts: Vec::new(),
            patches: Patches::default(),
            host: HostCounts::default(),
            steps: StepRate::default(),
            unsent: None,
            owed: Vec::new(),
        }
    }

    /// By body: the epoch of the surface that the viewers have.
    pub(super) fn epochs(&self) -> Vec<u32> {
        self.surfaces.iter().map(|surface| surface.epoch).collect()
    }

    /// Drops the ticks since the last frame.
    fn skip(&mut self) {
        let _ = self.gatherer.frame();
    }

    /// The frame of the ticks since the last frame, with the vertices of `snapshot` if there is one, and the surfaces of
    /// bodies that begin a topology epoch.
    fn make(&mut self, snapshot: Option<&Snapshot>) -> (Vec<Surface>, Frame) {
        let mut frame = self.gatherer.frame();
        frame.contacts.clone_from(&self.contacts);
        for tool in &mut frame.tools {
            tool.sites = self.patches.sites(tool.device, tool.patch);
        }
        let mut changed = Vec::new();
        if let Some(snapshot) = snapshot {
            self.host = snapshot.host.clone();
            for (known, body) in self.surfaces.iter_mut().zip(&snapshot.bodies) {
                *known = match (body.torn.fresh(), &body.changed) {
                    (Some(torn), _) => torn.clone(),
                    (None, Some(now)) => after_change(known, body.epoch, now),
                    (None, None) => continue,
                };
                changed.push(known.clone());
            }
            for (body, vertices) in frame.bodies.iter_mut().zip(vertices(snapshot)) {
                body.vertices = Some(vertices);
            }
        }
        self.host.step_rate = self.steps.at(frame.time_ns, self.host.steps);
        frame.host = Some(self.host.clone());
        (changed, frame)
    }

    /// The last frame of the run, after the last step of `host`.
    pub(super) fn last(&mut self, host: Option<&Snapshot>) -> (Vec<Surface>, Frame) {
        let (changed, mut frame) = self.make(host);
        let mut surfaces = std::mem::take(&mut self.owed);
        if let Some((unsent, before)) = self.unsent.take() {
            frame.merge_before(before);
            add_newer(&mut surfaces, unsent);
        }
        add_newer(&mut surfaces, changed);
        frame.last = true;
        (surfaces, frame)
    }
}

/// The vertices of each body, as a frame has them.
pub(super) fn vertices(snapshot: &Snapshot) -> impl Iterator<Item = Vertices> {
    snapshot.bodies.iter().map(|body| Vertices {
        step: snapshot.step,
        time_ns: snapshot.time_ns,
        epoch: body.epoch,
        count: body.positions.len() as u32,
        stressed: false,
        positions: body.rounded().collect(),
        stress: Vec::new(),
    })
}

/// The sites of the patches that ticks use or will use.
#[derive(Debug, Default)]
struct Patches(VecDeque<(u32, u64, Vec<[f32; 3]>)>);

impl Patches {
    /// Takes a patch for the tool of a device.
    fn take(&mut self, device: u8, patch: &Patch) {
        let sequence = patch.head.sequence;
        self.0
            .push_back((device.into(), sequence, sites(patch.rows())));
        if self.0.len() > PATCHES {
            self.0.pop_front();
        }
    }

    /// The sites of a patch (m); empty if the patch is not known.
    fn sites(&self, device: u32, sequence: u64) -> Vec<[f32; 3]> {
        let mut patches = self.0.iter().rev();
        let found = patches.find(|(of, number, _)| (*of, *number) == (device, sequence));
        found.map(|(.., sites)| sites.clone()).unwrap_or_default()
    }
}

/// The rate of the host's steps over the last second of the run's own time.
#[derive(Debug, Default)]
struct StepRate(VecDeque<(u64, u64)>);

impl StepRate {
    /// The rate (Hz) at a time (ns) after a number of steps.
    fn at(&mut self, time_ns: u64, steps: u64) -> f64 {
        self.0.push_back((time_ns, steps));
        // The oldest moment is the last that is at least a second old.
        while let Some((second, _)) = self.0.get(1)
            && time_ns.saturating_sub(*second) >= RATE_SPAN_NS
        {
            self.0.pop_front();
        }
        match self.0.front() {
            Some((from, before)) if time_ns > *from => {
                steps.saturating_sub(*before) as f64 * 1e9 / (time_ns - from) as f64
            }
            _ => 0.0,
        }
    }
}

/// The log's messages since the last frame.
#[derive(Debug, Default)]
struct LogTail {
    messages: Vec<LogMessage>,
    bytes: usize,
    more: u64,
}

impl LogTail {
    /// Adds the contacts of a host step.
    fn touched(&mut self, step: &mut ContactStep) {
        let mut data = Vec::new();
        step.encode(&mut data);
        self.push(ContactStep::topic(""), step.time_ns, data);
    }

    fn add(&mut self, record: LogRecord<'_>) {
        // A message that has no room is not made.
        if self.bytes >= MAX_LOG {
            self.more += 1;
            return;
        }
        let (topic, time_ns, data) = match record {
            LogRecord::Tick(telemetry) => (
                TickRow::topic(""),
                telemetry.time_ns,
                TickRow::from(telemetry).message(),
            ),
            LogRecord::Model(body, model) => (
                ModelRow::topic(""),
                model.head.time_ns,
                ModelRow::new(body, model).message(),
            ),
            LogRecord::Patch(device, patch) => (
                PatchRow::topic(""),
                patch.head.time_ns,
                PatchRow::new(device, patch).message(),
            ),
        };
        self.push(topic, time_ns, data);
    }

    fn push(&mut self, topic: String, time_ns: u64, data: Vec<u8>) {
        self.bytes += data.len();
        if self.bytes > MAX_LOG {
            self.more += 1;
            return;
        }
        self.messages.push(LogMessage {
            topic,
            time_ns,
            length: data.len() as u32,
            data,
        });
    }

    fn take(&mut self) -> (Vec<LogMessage>, u64) {
        let Self { messages, more, .. } = std::mem::take(self);
        (messages, more)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_of_steps_is_that_of_the_last_second() {
        let mut rate = StepRate::default();
        assert_eq!(rate.at(0, 0), 0.0);
        // 250 steps a second, in frames of 10 ms.
        for frame in 1..=300_u64 {
            let found = rate.at(frame * 10_000_000, frame * 5 / 2);
            assert!(
                (found - 250.0).abs() <= 100.0 / frame.min(100) as f64,
                "{frame} {found}"
            );
        }
        // The host stalls for a second.
        for frame in 301..=400_u64 {
            rate.at(frame * 10_000_000, 750);
        }
        assert_eq!(rate.at(4_010_000_000, 750), 0.0);
        assert!(rate.0.len() <= 102);
    }

    #[test]
    fn a_tool_has_the_sites_of_the_patch_that_its_tick_uses() {
        let patch = |sequence: u64| {
            let mut patch = Patch::empty();
            (patch.head.sequence, patch.head.site_count) = (sequence, 1);
            patch.sites[0].place.x = sequence as f64;
            patch
        };
        let mut patches = Patches::default();
        for sequence in 1..=3 {
            patches.take(0, &patch(sequence));
            patches.take(1, &patch(10 * sequence));
        }
        // The second tool still uses an older patch.
        let sites = |device, sequence| patches.sites(device, sequence);
        assert_eq!(sites(0, 3), [[3.0, 0.0, 0.0]]);
        assert_eq!(sites(1, 20), [[20.0, 0.0, 0.0]]);
        assert!(sites(1, 3).is_empty() && sites(0, 0).is_empty());
        (0..1000).for_each(|sequence| patches.take(1, &patch(sequence)));
        assert_eq!(patches.0.len(), PATCHES);
    }

    #[test]
    fn messages_of_the_log_beyond_the_bound_are_counted() {
        let mut tail = LogTail::default();
        let telemetry = rt_core::Telemetry::empty();
        for _ in 0..50_000 {
            tail.add(LogRecord::Tick(&telemetry));
        }
        let (messages, more) = tail.take();
        let bytes: usize = messages.iter().map(|message| message.data.len()).sum();
        assert!(bytes <= MAX_LOG && bytes > MAX_LOG - 4096, "{bytes}");
        assert_eq!(messages.len() as u64 + more, 50_000);
        assert!(more > 0);
        tail.add(LogRecord::Tick(&telemetry));
        assert_eq!((tail.messages.len(), tail.more), (1, 0));
    }
}
