//! A feed that computes a waving sheet in two hands: a sound input for the displays.

use host::live::frame::{FoldedBody, FoldedHand, PROTOCOL};
use host::live::{
    Bins, BodyInfo, BodyState, DeviceInfo, Event, EventKind, Folded, Frame, HandState, HandleInfo,
    Hello, Message, Range, Totals, Vertices,
};
use host::record::Distribution;
use host::record::Surface;
use host::snapshot::HostCounts;
use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;
use view::feed::{Command, Feed, FeedError};

/// Vertices along an edge of the sheet.
const EDGE: u32 = 21;
/// Side of the sheet (m).
const SIDE: f64 = 0.1;
/// Ticks a frame.
const TICKS: u64 = 16;

/// A waving sheet. Every call of `next` gives the next message at once, up to the number of frames, and then an end.
pub struct Synthetic {
    waiting: VecDeque<Message>,
    sent: Vec<Message>,
    number: u64,
    frames: u64,
    edge: u32,
}

impl Synthetic {
    /// A feed of `frames` frames of 16 ms each.
    pub fn new(frames: u64) -> Self {
        Self::with_edge(frames, EDGE)
    }

    /// As [`Synthetic::new`], with `edge` vertices along an edge of the sheet, at least two.
    pub fn with_edge(frames: u64, edge: u32) -> Self {
        let edge = edge.max(2);
        Self {
            waiting: VecDeque::from([
                Message::Hello(Box::new(hello(edge))),
                Message::Surface(surface(edge)),
            ]),
            sent: Vec::new(),
            number: 0,
            frames,
            edge,
        }
    }

    /// The messages one after another. The last one, an end, is repeated.
    pub fn messages(mut self) -> impl Iterator<Item = Message> {
        std::iter::from_fn(move || Some(self.message()))
    }

    fn message(&mut self) -> Message {
        if let Some(message) = self.waiting.pop_front() {
            self.sent.push(message.clone());
            return message;
        }
        self.number += 1;
        if self.number > self.frames {
            return Message::End(String::new());
        }
        let message = Message::Frame(Box::new(frame(self.number - 1, self.edge)));
        self.sent.truncate(2);
        self.sent.push(message.clone());
        message
    }

    /// The events up to a time (ns), as a log has them.
    pub fn events(&self, to_ns: u64) -> Vec<Event> {
        let frames = (0..to_ns / (TICKS * 1_000_000)).map(|number| frame(number, 2));
        frames.flat_map(|frame| frame.events).collect()
    }

    /// The ticks up to a time (ns) in pieces of 10 frames, as the timeline of a log has them.
    pub fn overview(&self, to_ns: u64) -> Vec<Folded> {
        let pieces = (0..to_ns / (TICKS * 10_000_000)).map(|piece| {
            let mut folded = frame(10 * piece, 2).folded;
            (1..10).for_each(|i| {
                let older = std::mem::replace(&mut folded, frame(10 * piece + i, 2).folded);
                folded.merge_before(&older);
            });
            folded
        });
        pieces.collect()
    }
}

impl Feed for Synthetic {
    fn next(&mut self, _wait: Duration) -> Result<Option<Message>, FeedError> {
        Ok(Some(self.message()))
    }

    fn command(&mut self, _command: &Command) {}

    fn present(&self) -> Vec<Message> {
        self.sent.clone()
    }
}

fn hello(edge: u32) -> Hello {
    let device = |name: &str| DeviceInfo {
        name: name.into(),
        model: "falcon".into(),
        max_force: 8.9,
        age_limit: 0.1,
    };
    let handle = |device, x| HandleInfo {
        device,
        origin: [x, 0.0, 0.0],
    };
    Hello {
        protocol: PROTOCOL.into(),
        run: 1,
        scene: "synthetic".into(),
        clock: "real".into(),
        scheme: "capped".into(),
        tick_rate: 1000.0,
        step_rate: 250.0,
        publish_rate: 125.0,
        duration: 60.0,
        devices: vec![device("left"), device("right")],
        bodies: vec![BodyInfo {
            name: "sheet".into(),
            kind: "sheet".into(),
            vertices: edge * edge,
            elements: 2 * (edge - 1) * (edge - 1),
            handles: vec![handle(0, -SIDE / 2.0), handle(1, SIDE / 2.0)],
            ..BodyInfo::default()
        }],
        ..Hello::default()
    }
}

fn grid(edge: u32) -> impl Iterator<Item = (f64, f64)> {
    let along = move |i: u32| SIDE * (f64::from(i) / f64::from(edge - 1) - 0.5);
    (0..edge * edge).map(move |v| (along(v % edge), along(v / edge)))
}

fn surface(edge: u32) -> Surface {
    let cells = (0..(edge - 1) * (edge - 1)).map(|c| (c % (edge - 1)) + edge * (c / (edge - 1)));
    let triangles: Vec<u32> = cells
        .flat_map(|v| [v, v + 1, v + edge, v + 1, v + edge + 1, v + edge])
        .collect();
    Surface {
        vertices: edge * edge,
        triangle_count: triangles.len() as u32 / 3,
        rest: grid(edge)
            .flat_map(|(x, y)| [x as f32, y as f32, 0.0])
            .collect(),
        triangles,
        ..Surface::default()
    }
}

fn frame(number: u64, edge: u32) -> Frame {
    let time = number as f64 * 0.016;
    let (first, last) = (number * TICKS, number * TICKS + TICKS - 1);
    let pull = 0.01 * (1.0 - (2.0 * time).cos());
    let wave = |x: f64, y: f64| 0.01 * (60.0 * x + 6.0 * time).sin() * (30.0 * y).cos();
    let stretch = 1.0 + 2.0 * pull / SIDE;
    let positions =
        grid(edge).flat_map(|(x, y)| [(x * stretch) as f32, y as f32, wave(x, y) as f32]);
    let sides = [-1.0, 1.0];
    let hands = sides.map(|side| HandState {
        position: [side * (SIDE / 2.0 + pull), 0.0, 0.0],
        rotation: [0.0, 0.0, 0.0, 1.0],
        force: [-side * 150.0 * pull, 0.2 * (3.0 * time).sin(), 0.0],
        fresh: true,
        safety: "normal".into(),
        peak_force: 3.0,
        ..HandState::default()
    });
    let folded = hands.iter().map(|hand| FoldedHand {
        force: hand.force.map(|f| Range {
            least: f - 0.05,
            most: f + 0.05,
        }),
        force_norm: Range {
            least: hand.force[0].abs() - 0.05,
            // A spike of one tick, once a second.
            most: hand.force[0].abs() + if number % 60 == 30 { 4.0 } else { 0.05 },
        },
        position: hand.position.map(Range::of),
        ..FoldedHand::default()
    });
    let event = |kind, text: &str| Event {
        kind,
        tick: last,
        time_ns: last * 1_000_000,
        text: text.into(),
    };
    let events = match number % 100 {
        40 => vec![event(EventKind::Trip, "left: force limited")],
        80 => vec![event(EventKind::MissedDeadline, "2 deadlines")],
        _ => Vec::new(),
    };
    let times = Distribution {
        count: last + 1,
        min: 1e-6,
        p50: 12e-6,
        p99: 40e-6,
        p99_9: 80e-6,
        p99_99: None,
        max: 150e-6,
        overflow: 0,
    };
    let share = |i: i32| (0.5 * f64::from(i - 8).abs()).exp().recip() * (last + 1) as f64;
    let bins = (0..24).map(|i| {
        (
            (2000.0 * (0.25 * f64::from(i)).exp2()) as u64,
            share(i) as u64,
        )
    });
    let bins = Bins(bins.filter(|(_, ticks)| *ticks > 0).collect());
    Frame {
        number,
        time_ns: last * 1_000_000,
        folded: Folded {
            first,
            last,
            from_ns: first * 1_000_000,
            to_ns: last * 1_000_000,
            ticks: TICKS,
            lateness: Range {
                least: 1e-6,
                most: 4e-5,
            },
            hands: folded.collect(),
            bodies: vec![FoldedBody {
                age: Range {
                    least: 0.004,
                    most: 0.008,
                },
                trust: Range::of(1.0),
                ..FoldedBody::default()
            }],
            ..Folded::default()
        },
        totals: Totals {
            ticks: last + 1,
            missed: 2 * (number / 100),
            longest_miss: 2,
            lateness: Some(times),
            duration: Some(times),
            model_age: vec![times],
            lateness_bins: bins.clone(),
            duration_bins: bins,
            trips: (number + 60) / 100,
            ..Totals::default()
        },
        hands: hands.to_vec(),
        bodies: vec![BodyState {
            state: "live".into(),
            sequence: number,
            age: 0.006,
            trust: 1.0,
            energy: BTreeMap::from([("supplied".into(), 0.001), ("stored".into(), 0.0006)]),
            vertices: Some(Vertices {
                step: 4 * number,
                time_ns: last * 1_000_000,
                count: edge * edge,
                positions: positions.collect(),
                ..Vertices::default()
            }),
            ..BodyState::default()
        }],
        host: Some(HostCounts {
            steps: 4 * number,
            step_rate: 250.0,
            publications: 2 * number,
            stages: [Some(8e-5), Some(2e-4)],
            medians: [8e-5, 2e-4],
            iterations: 3,
            ..HostCounts::default()
        }),
        events,
        ..Frame::default()
    }
}
