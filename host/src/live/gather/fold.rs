//! Folds ticks: the least and the greatest value of each curve.

use super::TickView;
use crate::live::Range;
use crate::live::frame::{Folded, FoldedBody, FoldedHand};
use rt_core::record::{BodyTelemetry, DeviceTelemetry};

/// Adds a tick, before which `missed` deadlines were missed, to `folded`. The lateness counts under the real clock only.
pub(super) fn take(folded: &mut Folded, tick: &TickView<'_>, missed: u64, real: bool) {
    if folded.ticks == 0 {
        (folded.first, folded.from_ns) = (tick.tick, tick.time_ns);
    }
    (folded.last, folded.to_ns) = (tick.tick, tick.time_ns);
    folded.ticks += 1;
    folded.missed += missed;
    if real {
        folded.lateness.take(tick.lateness_ns as f64 * 1e-9);
    }
    let (hands, bodies) = (tick.devices.len(), tick.bodies.len());
    if folded.hands.len() < hands {
        folded.hands.resize_with(hands, FoldedHand::default);
    }
    if folded.bodies.len() < bodies {
        folded.bodies.resize_with(bodies, FoldedBody::default);
    }
    for (hand, device) in folded.hands.iter_mut().zip(tick.devices) {
        take_hand(hand, device);
    }
    for (folded, body) in folded.bodies.iter_mut().zip(tick.bodies) {
        take_body(folded, body);
    }
}

fn take_hand(hand: &mut FoldedHand, device: &DeviceTelemetry) {
    let (force, position) = (&device.wrench.force, &device.pose.position);
    for (range, value) in hand.force.iter_mut().zip(force.iter()) {
        range.take(*value);
    }
    for (range, value) in hand.position.iter_mut().zip(position.iter()) {
        range.take(*value);
    }
    hand.force_norm.take(force.norm());
    hand.moment_norm.take(device.wrench.moment.norm());
    hand.speed.take(device.twist.linear.norm());
}

fn take_body(folded: &mut FoldedBody, body: &BodyTelemetry) {
    // Before the first model there is no age.
    if body.sequence > 0 {
        folded.age.take(body.age_ns as f64 * 1e-9);
    }
    folded.trust.take(body.trust);
    folded.withheld.take(body.withheld.force);
    folded.supplied.take(body.energy.supplied);
    folded.stored.take(body.energy.stored);
}

impl Folded {
    /// Adds the ticks of `older`, which came before.
    pub fn merge_before(&mut self, older: &Self) {
        self.missed += older.missed;
        if older.ticks == 0 {
            return;
        }
        if self.ticks == 0 {
            (self.last, self.to_ns) = (older.last, older.to_ns);
        }
        (self.first, self.from_ns) = (older.first, older.from_ns);
        self.ticks += older.ticks;
        self.lateness.merge(&older.lateness);
        if self.hands.len() < older.hands.len() {
            self.hands
                .resize_with(older.hands.len(), FoldedHand::default);
        }
        if self.bodies.len() < older.bodies.len() {
            self.bodies
                .resize_with(older.bodies.len(), FoldedBody::default);
        }
        for (hand, older) in self.hands.iter_mut().zip(&older.hands) {
            hand.merge(older);
        }
        for (body, older) in self.bodies.iter_mut().zip(&older.bodies) {
            body.merge(older);
        }
    }
}

impl FoldedHand {
    fn merge(&mut self, other: &Self) {
        let Self {
            force,
            force_norm,
            moment_norm,
            position,
            speed,
        } = self;
        let merge_all = |ranges: &mut [Range; 3], others: &[Range; 3]| {
            for (range, other) in ranges.iter_mut().zip(others) {
                range.merge(other);
            }
        };
        merge_all(force, &other.force);
        force_norm.merge(&other.force_norm);
        moment_norm.merge(&other.moment_norm);
        merge_all(position, &other.position);
        speed.merge(&other.speed);
    }
}

impl FoldedBody {
    fn merge(&mut self, other: &Self) {
        let Self {
            age,
            trust,
            withheld,
            supplied,
            stored,
        } = self;
        age.merge(&other.age);
        trust.merge(&other.trust);
        withheld.merge(&other.withheld);
        supplied.merge(&other.supplied);
        stored.merge(&other.stored);
    }
}
