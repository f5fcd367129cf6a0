//! Two frames as one: the later state, and the curves and events of both.

use host::live::{Folded, Frame};

/// Most events of a frame.
const EVENTS: usize = 1000;

/// The frame in place of `older` and `later`.
pub(super) fn frames(older: Frame, later: &Frame) -> Frame {
    let mut merged = later.clone();
    merged.folded = folded(older.folded, &later.folded);
    merged.events = older.events;
    merged.events.extend(later.events.iter().cloned());
    let more = merged.events.len().saturating_sub(EVENTS);
    merged.events.truncate(EVENTS);
    merged.more_events = older.more_events + later.more_events + more as u64;
    for (body, older) in merged.bodies.iter_mut().zip(older.bodies) {
        body.vertices = body.vertices.take().or(older.vertices);
    }
    merged
}

fn folded(mut older: Folded, later: &Folded) -> Folded {
    if older.ticks == 0 {
        return later.clone();
    }
    if later.ticks == 0 {
        return older;
    }
    older.last = later.last;
    older.to_ns = later.to_ns;
    older.ticks += later.ticks;
    older.missed += later.missed;
    older.lateness.merge(&later.lateness);
    for (hand, later) in older.hands.iter_mut().zip(&later.hands) {
        for (range, later) in hand.force.iter_mut().zip(&later.force) {
            range.merge(later);
        }
        for (range, later) in hand.position.iter_mut().zip(&later.position) {
            range.merge(later);
        }
        hand.force_norm.merge(&later.force_norm);
        hand.moment_norm.merge(&later.moment_norm);
        hand.speed.merge(&later.speed);
    }
    for (body, later) in older.bodies.iter_mut().zip(&later.bodies) {
        body.age.merge(&later.age);
        body.trust.merge(&later.trust);
        body.withheld.merge(&later.withheld);
        body.supplied.merge(&later.supplied);
        body.stored.merge(&later.stored);
    }
    older
}
