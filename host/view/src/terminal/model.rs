//! The model of the display: the messages of a feed, put together.

use crate::history::History;
use crate::still::Shown;
use host::live::{Event, EventKind, Folded, Frame, Hello, Message, Playback, Source, Vertices};
use host::record::Surface;
use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

/// Span of the charts (s).
pub const SPAN: f64 = 10.0;
/// Events that are kept.
const EVENTS: usize = 1000;

/// How a source ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Over {
    /// In order. The summary as JSON, or an empty text.
    Ended(String),
    /// Early, for this reason.
    Broken(String),
}

/// The state that the display shows.
#[derive(Clone, Debug)]
pub struct Model {
    /// The facts that do not change.
    pub hello: Hello,
    /// The last frame.
    pub frame: Option<Frame>,
    /// The curves of the last seconds.
    pub history: History,
    /// The events of a run so far, oldest first.
    pub events: VecDeque<Event>,
    /// Events that are not in the list.
    pub more_events: u64,
    /// How a log is played back.
    pub playback: Option<Playback>,
    /// How the source ended.
    pub over: Option<Over>,
    surfaces: BTreeMap<(u32, u32), Surface>,
    /// By obstacle: the present positions (m).
    obstacles: Vec<Vec<[f32; 3]>>,
    vertices: Vec<Option<Vertices>>,
    bounds: Option<Bounds>,
    arrived: Option<Instant>,
}

/// A box that contains all that was drawn so far, so that the picture keeps its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub(super) least: [f64; 3],
    pub(super) most: [f64; 3],
}

impl Default for Model {
    fn default() -> Self {
        Self {
            hello: Hello::default(),
            frame: None,
            history: History::new(SPAN),
            events: VecDeque::new(),
            more_events: 0,
            playback: None,
            over: None,
            surfaces: BTreeMap::new(),
            obstacles: Vec::new(),
            vertices: Vec::new(),
            bounds: None,
            arrived: None,
        }
    }
}

impl Model {
    /// Takes a message that arrived at `now`.
    pub fn take(&mut self, message: Message, now: Instant) {
        match message {
            Message::Hello(hello) => {
                *self = Self {
                    hello: *hello,
                    ..Self::default()
                };
            }
            Message::Surface(surface) => self.take_surface(surface),
            Message::Frame(frame) => {
                self.arrived = Some(now);
                self.take_frame(*frame);
            }
            Message::History(pieces) => self.history.replace(pieces),
            Message::Playback(playback) => self.take_playback(*playback),
            Message::End(summary) => self.over = Some(Over::Ended(summary)),
            Message::Refused(reason) => self.over = Some(Over::Broken(reason)),
        }
    }

    fn take_surface(&mut self, surface: Surface) {
        // An unfinished list of positions would make the box of the bodies wrong.
        if surface.rest.len() == 3 * surface.vertices as usize {
            self.widen(surface.rest.as_chunks().0);
        }
        // The vertices of its epoch come after the surface. Until then, the surface before is drawn.
        let (body, shown) = (surface.body, self.vertices(surface.body as usize));
        let shown = shown.map(|vertices| vertices.epoch);
        self.surfaces
            .retain(|(of, epoch), _| *of != body || Some(*epoch) == shown);
        self.surfaces.insert((body, surface.epoch), surface);
    }

    fn take_frame(&mut self, mut frame: Frame) {
        self.history.push(&frame.folded);
        self.events.extend(frame.events.drain(..));
        self.more_events = self.more_events.saturating_add(frame.more_events);
        while self.events.len() > EVENTS {
            self.events.pop_front();
            self.more_events = self.more_events.saturating_add(1);
        }
        self.vertices
            .resize_with(frame.bodies.len().max(self.vertices.len()), || None);
        for (body, kept) in frame.bodies.iter_mut().zip(&mut self.vertices) {
            if let Some(vertices) = body.vertices.take() {
                *kept = Some(vertices);
            }
        }
        for body in 0..frame.bodies.len() {
            if let Some((_, positions)) = self.body(body) {
                let (mut least, mut most) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
                for point in positions.iter().filter(|p| p.iter().all(|x| x.is_finite())) {
                    least = std::array::from_fn(|axis| least[axis].min(point[axis]));
                    most = std::array::from_fn(|axis| most[axis].max(point[axis]));
                }
                if least[0] <= most[0] {
                    self.widen(&[least, most]);
                }
            }
        }
        self.place_obstacles(&frame);
        let hands: Vec<[f32; 3]> = frame
            .hands
            .iter()
            .map(|hand| hand.position.map(|x| x as f32))
            .collect();
        self.widen(&hands);
        self.frame = Some(frame);
    }

    /// Moves the obstacles. Planes are larger than what the picture has to show.
    fn place_obstacles(&mut self, frame: &Frame) {
        let infos = self.hello.obstacles.iter().zip(&frame.obstacles);
        self.obstacles = infos.map(|(info, state)| info.placed(state)).collect();
        let mut box_of = Vec::new();
        for (info, positions) in self.hello.obstacles.iter().zip(&self.obstacles) {
            if info.shape != "plane" {
                box_of.extend_from_slice(positions);
            }
        }
        self.widen(&box_of);
    }

    /// The triangles of an obstacle and its present positions (m).
    pub(super) fn obstacle(&self, index: usize) -> Option<(&[u32], &[[f32; 3]])> {
        let info = self.hello.obstacles.get(index)?;
        Some((&info.triangles, self.obstacles.get(index)?))
    }

    /// Where the surface keeps the tool of a device (m).
    pub(super) fn tool(&self, device: u32) -> Option<[f64; 3]> {
        let obstacle = self.hello.obstacle_of(device)?;
        let [x, y, z, ..] = self.frame.as_ref()?.obstacles.get(obstacle)?.pose;
        Some([x, y, z])
    }

    fn take_playback(&mut self, mut playback: Playback) {
        if let Some(old) = self.playback.take() {
            // Empty lists mean that nothing changed.
            if playback.events.is_empty() {
                playback.events = old.events;
            }
            if playback.overview.is_empty() {
                playback.overview = old.overview;
            }
        }
        self.playback = Some(playback);
    }

    fn widen(&mut self, points: &[[f32; 3]]) {
        for point in points.iter().filter(|p| p.iter().all(|x| x.abs() < 1e6)) {
            let point = point.map(f64::from);
            let bounds = self.bounds.get_or_insert(Bounds {
                least: point,
                most: point,
            });
            for axis in 0..3 {
                bounds.least[axis] = bounds.least[axis].min(point[axis]);
                bounds.most[axis] = bounds.most[axis].max(point[axis]);
            }
        }
    }

    /// The box that contains all bodies and hands so far.
    pub(super) fn bounds(&self) -> Option<Bounds> {
        self.bounds
    }

    /// Whether a log is played back.
    pub fn is_log(&self) -> bool {
        self.hello.source == Source::Log
    }

    /// Wall time since the last frame arrived.
    pub fn frame_age(&self, now: Instant) -> Option<Duration> {
        Some(now.saturating_duration_since(self.arrived?))
    }

    /// The moment that is shown; `None` before the first frame.
    pub fn shown(&self) -> Option<Shown> {
        let mut frame = self.frame.clone()?;
        for (body, kept) in frame.bodies.iter_mut().zip(&self.vertices) {
            body.vertices.clone_from(kept);
        }
        Some(Shown {
            hello: self.hello.clone(),
            surfaces: self.surfaces.values().cloned().collect(),
            frame,
            history: self.history.clone(),
        })
    }

    /// The time that is shown (ns).
    pub fn time_ns(&self) -> u64 {
        self.frame.as_ref().map_or(0, |frame| frame.time_ns)
    }

    /// The surface of a body and its vertices: those of the last step, or those at rest before the first step.
    pub fn body(&self, index: usize) -> Option<(&Surface, &[[f32; 3]])> {
        let body = u32::try_from(index).ok()?;
        if let Some(vertices) = self.vertices.get(index).and_then(Option::as_ref) {
            let surface = self.surfaces.get(&(body, vertices.epoch))?;
            let fits = vertices.positions.len() == 3 * surface.vertices as usize;
            return fits.then_some((surface, vertices.positions.as_chunks().0));
        }
        let mut epochs = self.surfaces.range((body, 0)..=(body, u32::MAX));
        let surface = epochs.next()?.1;
        let fits = surface.rest.len() == 3 * surface.vertices as usize;
        fits.then_some((surface, surface.rest.as_chunks().0))
    }

    /// The vertices of a body as the last frame that had them brought them.
    pub fn vertices(&self, index: usize) -> Option<&Vertices> {
        self.vertices.get(index)?.as_ref()
    }

    /// The name of a device.
    pub(super) fn device(&self, index: usize) -> String {
        let device = self.hello.devices.get(index);
        device.map_or_else(|| format!("device {index}"), |device| device.name.clone())
    }

    /// The name of a body.
    pub(super) fn body_name(&self, index: usize) -> String {
        let body = self.hello.bodies.get(index);
        body.map_or_else(|| format!("body {index}"), |body| body.name.clone())
    }

    /// Ticks a second over the last second of the run's own time (Hz).
    pub(super) fn rate(&self) -> Option<f64> {
        let last = self.history.pieces().next_back()?.to_ns;
        let recent = |piece: &&Folded| piece.to_ns.saturating_add(1_000_000_000) > last;
        let (mut ticks, mut from) = (0, last);
        for piece in self.history.pieces().rev().take_while(recent) {
            ticks = piece.ticks.saturating_add(ticks);
            from = from.min(piece.from_ns);
        }
        // The last tick lasts until the next tick.
        let period = 1.0 / self.hello.tick_rate;
        let seconds = last.saturating_sub(from) as f64 * 1e-9 + period;
        let rate = ticks as f64 / seconds;
        rate.is_finite().then_some(rate)
    }

    /// All events that the display knows, oldest first, and how many of them are at or before the shown moment.
    pub(super) fn all_events(&self) -> (Vec<&Event>, usize) {
        let events: Vec<&Event> = match &self.playback {
            Some(playback) => playback.events.iter().collect(),
            None => self.events.iter().collect(),
        };
        let now = self.time_ns();
        let past = events.iter().filter(|event| event.time_ns <= now).count();
        (events, past)
    }
}

/// The letter and the word for a kind of event.
pub(super) fn kind(kind: EventKind) -> (char, &'static str) {
    match kind {
        EventKind::Trip => ('T', "trip"),
        EventKind::MissedDeadline => ('M', "missed"),
        EventKind::StaleModel => ('S', "stale"),
        EventKind::WorstTick => ('W', "worst"),
        EventKind::Tear => ('R', "tear"),
        EventKind::Beyond => ('B', "beyond"),
    }
}
