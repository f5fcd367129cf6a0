//! Folds the ticks of a log into the pieces that a viewer draws, and sums them up.
//!
//! A [`Fold`] can begin at any tick of a log: it needs the sums up to the tick before and that tick itself. A player
//! therefore computes the sums of any moment from the overview and the ticks of half a second.

use super::TickRow;
use crate::live::frame::{FoldedBody, FoldedHand};
use crate::live::{Event, EventKind, Folded, Range};
use crate::scene::Scene;
use rt_core::Vec3;
use rt_core::coupling::HostState;
use rt_core::record::BodyTelemetry;
use rt_core::safety::SafetyState;
use serde::{Deserialize, Serialize};

/// The facts of a scene that a fold needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FoldFacts {
    /// Period of the tick (ns).
    pub period_ns: u64,
    /// Names of the devices.
    pub devices: Vec<String>,
    /// Metres of the scene per metre of each device.
    pub scales: Vec<f64>,
    /// Names of the bodies.
    pub bodies: Vec<String>,
}

impl FoldFacts {
    /// The facts of `scene`.
    pub fn of(scene: &Scene) -> Self {
        let devices = scene.devices.iter();
        Self {
            period_ns: ((1e9 / scene.realtime.rate).round() as u64).max(1),
            devices: devices.clone().map(|device| device.name.clone()).collect(),
            scales: devices.map(|device| device.motion_scale).collect(),
            bodies: scene.bodies.iter().map(|body| body.name.clone()).collect(),
        }
    }
}

/// Sums over the ticks from the first of the log to some tick.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sums {
    /// Ticks with a record.
    pub ticks: u64,
    /// Deadlines missed.
    pub missed: u64,
    /// Most deadlines missed in a row.
    pub longest_miss: u64,
    /// Ticks whose record is missing.
    pub lost: u64,
    /// Trips of the last stage.
    pub trips: u64,
    /// Times that the newest model became too old.
    pub stale: u64,
    /// By device.
    pub hands: Vec<HandSums>,
}

/// Sums of one hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HandSums {
    /// Largest force (N).
    pub peak_force: f64,
    /// Work done on the hand (J), as in the summary of the run.
    pub work: f64,
    /// Largest distance from the first position (m).
    pub reach: f64,
    /// The first position (m).
    pub start: [f64; 3],
}

/// What the fold keeps of a tick for the next one.
#[derive(Clone, Debug, PartialEq)]
struct Last {
    tick: u64,
    time_ns: u64,
    /// By device: position, force, and the limit that acts.
    hands: Vec<(Vec3, Vec3, Option<&'static str>)>,
    /// By body: whether the model is too old, and how.
    bodies: Vec<Option<&'static str>>,
}

/// Folds ticks in their order.
#[derive(Clone, Debug)]
pub struct Fold {
    facts: FoldFacts,
    sums: Sums,
    last: Option<Last>,
}

impl Fold {
    /// A fold that begins with the first tick of a log.
    pub fn new(facts: FoldFacts) -> Self {
        Self {
            facts,
            sums: Sums::default(),
            last: None,
        }
    }

    /// A fold that continues after the tick `last`, up to which the sums are `sums`.
    pub fn after(facts: FoldFacts, sums: Sums, last: &TickRow) -> Self {
        Self {
            facts,
            sums,
            last: Some(Last::of(last)),
        }
    }

    /// The sums so far.
    pub fn sums(&self) -> &Sums {
        &self.sums
    }

    /// Adds a tick to the sums and to `piece`, and gives `event` the events of the tick.
    pub fn take(&mut self, row: &TickRow, piece: &mut Folded, mut event: impl FnMut(Event)) {
        let now = Last::of(row);
        let sums = &mut self.sums;
        sums.ticks += 1;
        let mut missed = 0;
        if let Some(last) = &self.last {
            let ticks = row.tick.saturating_sub(last.tick).max(1);
            let slots = (row.time_ns.saturating_sub(last.time_ns) + self.facts.period_ns / 2)
                / self.facts.period_ns.max(1);
            missed = slots.saturating_sub(ticks);
            sums.missed += missed;
            sums.longest_miss = sums.longest_miss.max(missed);
            sums.lost += ticks - 1;
        }
        let mut say = |kind, text: String| {
            event(Event {
                kind,
                tick: row.tick,
                time_ns: row.time_ns,
                text,
            });
        };
        if missed > 0 {
            let what = if missed == 1 { "deadline" } else { "deadlines" };
            say(EventKind::MissedDeadline, format!("{missed} {what} missed"));
        }
        sums.hands.resize_with(row.devices.len(), HandSums::default);
        for (index, ((position, force, limit), hand)) in
            now.hands.iter().zip(&mut sums.hands).enumerate()
        {
            let before = self.last.as_ref().and_then(|last| last.hands.get(index));
            hand.peak_force = hand.peak_force.max(force.norm());
            match before {
                None => hand.start = (*position).into(),
                Some((from, held, _)) => {
                    let scale = self.facts.scales.get(index).copied().unwrap_or(1.0);
                    // The force acts on the hand, and the proxy moves by `scale` times the displacement of the hand.
                    hand.work += held.dot(&(position - from)) / scale;
                }
            }
            hand.reach = hand.reach.max((position - Vec3::from(hand.start)).norm());
            if let Some(limit) = limit
                && before.and_then(|(_, _, limit)| *limit) != Some(limit)
            {
                sums.trips += 1;
                let name = self.facts.devices.get(index).map_or("", String::as_str);
                say(EventKind::Trip, format!("{name}: {limit}"));
            }
        }
        for (index, aged) in now.bodies.iter().enumerate() {
            let before = self.last.as_ref().and_then(|last| last.bodies.get(index));
            if let Some(aged) = aged
                && before.copied().flatten().is_none()
            {
                sums.stale += 1;
                let name = self.facts.bodies.get(index).map_or("", String::as_str);
                say(EventKind::StaleModel, format!("{name}: {aged}"));
            }
        }
        self.last = Some(now);
        fold(row, missed, piece);
    }
}

impl Last {
    fn of(row: &TickRow) -> Self {
        let hands = row.devices.iter().map(|device| {
            let limit = match device.safety {
                SafetyState::Normal | SafetyState::Recovering => None,
                SafetyState::Limited => Some("force limited"),
                SafetyState::Slewed => Some("force at its slew limit"),
                SafetyState::TooFast => Some("too fast, force fading"),
                SafetyState::OutOfReach => Some("out of reach, force fading"),
                SafetyState::DeviceStale => Some("device silent"),
                SafetyState::NotANumber => Some("force not a number"),
            };
            (device.pose.position, device.wrench.force, limit)
        });
        let bodies = row.bodies.iter().map(|body| match body.state {
            HostState::Waiting | HostState::Live => None,
            HostState::Fading => Some("model too old, force fading"),
            HostState::Held => Some("model too old, safe hold"),
        });
        Self {
            tick: row.tick,
            time_ns: row.time_ns,
            hands: hands.collect(),
            bodies: bodies.collect(),
        }
    }
}

/// Adds the curves of a tick to a piece.
fn fold(row: &TickRow, missed: u64, piece: &mut Folded) {
    if piece.ticks == 0 {
        piece.first = row.tick;
        piece.from_ns = row.time_ns;
    }
    piece.last = row.tick;
    piece.to_ns = row.time_ns;
    piece.ticks += 1;
    piece.missed += missed;
    piece.lateness.take(row.lateness_ns as f64 * 1e-9);
    piece
        .hands
        .resize_with(row.devices.len(), FoldedHand::default);
    for (hand, device) in piece.hands.iter_mut().zip(&row.devices) {
        let (force, position) = (&device.wrench.force, &device.pose.position);
        for axis in 0..3 {
            hand.force[axis].take(force[axis]);
            hand.position[axis].take(position[axis]);
        }
        hand.force_norm.take(force.norm());
        hand.moment_norm.take(device.wrench.moment.norm());
        hand.speed.take(device.twist.linear.norm());
    }
    piece
        .bodies
        .resize_with(row.bodies.len(), FoldedBody::default);
    for (folded, body) in piece.bodies.iter_mut().zip(&row.bodies) {
        fold_body(body, folded);
    }
}

fn fold_body(body: &BodyTelemetry, folded: &mut FoldedBody) {
    folded.age.take(body.age_ns as f64 * 1e-9);
    folded.trust.take(body.trust);
    folded.withheld.take(body.withheld.force);
    folded.supplied.take(body.energy.supplied);
    folded.stored.take(body.energy.stored);
}

/// Adds the later piece `next` to `piece`.
pub fn join(piece: &mut Folded, next: &Folded) {
    if next.ticks == 0 {
        return;
    }
    if piece.ticks == 0 {
        piece.clone_from(next);
        return;
    }
    piece.last = next.last;
    piece.to_ns = next.to_ns;
    piece.ticks += next.ticks;
    piece.missed += next.missed;
    piece.lateness.merge(&next.lateness);
    piece
        .hands
        .resize_with(piece.hands.len().max(next.hands.len()), Default::default);
    for (hand, other) in piece.hands.iter_mut().zip(&next.hands) {
        merge(&mut hand.force, &other.force);
        merge(&mut hand.position, &other.position);
        hand.force_norm.merge(&other.force_norm);
        hand.moment_norm.merge(&other.moment_norm);
        hand.speed.merge(&other.speed);
    }
    piece
        .bodies
        .resize_with(piece.bodies.len().max(next.bodies.len()), Default::default);
    for (body, other) in piece.bodies.iter_mut().zip(&next.bodies) {
        body.age.merge(&other.age);
        body.trust.merge(&other.trust);
        body.withheld.merge(&other.withheld);
        body.supplied.merge(&other.supplied);
        body.stored.merge(&other.stored);
    }
}

fn merge(ranges: &mut [Range; 3], others: &[Range; 3]) {
    for (range, other) in ranges.iter_mut().zip(others) {
        range.merge(other);
    }
}

/// At most `most` pieces, each of which joins some neighbours of `pieces`.
pub fn at_most(most: usize, pieces: &[Folded]) -> Vec<Folded> {
    let each = pieces.len().div_ceil(most.max(1)).max(1);
    let joined = pieces.chunks(each).map(|neighbours| {
        let mut piece = Folded::default();
        neighbours.iter().for_each(|next| join(&mut piece, next));
        piece
    });
    joined.collect()
}
