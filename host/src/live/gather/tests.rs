use super::*;
use crate::scene::Scene;
use rt_core::Telemetry;
use rt_core::coupling::HostState;
use rt_core::safety::SafetyState;

/// A gatherer of the built-in scene: two devices, one body.
pub(crate) fn gatherer(clock: Clock) -> Gatherer {
    Gatherer::new(
        &Scene::embedded_default().expect("the scene is sound"),
        clock,
    )
}

/// A tick on the grid after `missed` deadlines were missed in all.
pub(crate) fn tick(number: u64, missed: u64) -> Telemetry {
    let mut telemetry = Telemetry::empty();
    telemetry.tick = number;
    telemetry.time_ns = (number + missed) * 1_000_000;
    (telemetry.device_count, telemetry.body_count) = (2, 1);
    telemetry.bodies[0].state = HostState::Live;
    telemetry
}

fn texts(frame: &Frame) -> Vec<(EventKind, u64, &str)> {
    let events = frame.events.iter();
    events.map(|e| (e.kind, e.tick, e.text.as_str())).collect()
}

#[test]
fn missed_deadlines_are_gaps_of_time_without_a_gap_of_numbers() {
    let mut gatherer = gatherer(Clock::Real);
    for (number, missed) in [(0, 0), (1, 0), (2, 3), (3, 3), (6, 3), (7, 4)] {
        gatherer.take(&(&tick(number, missed)).into());
    }
    let frame = gatherer.frame();
    let totals = &frame.totals;
    assert_eq!((totals.missed, totals.longest_miss, totals.lost), (4, 3, 2));
    assert_eq!((totals.ticks, frame.folded.missed), (6, 4));
    assert_eq!(
        texts(&frame),
        [
            (EventKind::MissedDeadline, 2, "3 deadlines"),
            (EventKind::MissedDeadline, 7, "1 deadline"),
        ]
    );
    // The next frame has the totals still, and no ticks.
    let next = gatherer.frame();
    assert_eq!((next.number, next.totals.missed), (1, 4));
    assert_eq!((next.folded.ticks, next.events.len()), (0, 0));
    assert_eq!((next.hands.len(), next.time_ns), (2, 11_000_000));
}

#[test]
fn a_gatherer_may_begin_in_the_middle() {
    let mut gatherer = gatherer(Clock::Real);
    gatherer.take(&(&tick(500, 7)).into());
    let frame = gatherer.frame();
    assert_eq!((frame.totals.missed, frame.totals.lost), (0, 0));
    assert_eq!((frame.folded.first, frame.folded.ticks), (500, 1));
}

#[test]
fn a_limit_that_begins_to_act_is_a_trip_and_an_old_model_is_one_event() {
    use SafetyState::{Limited, Normal, Recovering, TooFast};
    let mut gatherer = gatherer(Clock::Virtual);
    let safety = [
        Normal, Limited, Limited, TooFast, Recovering, Normal, Limited,
    ];
    let state = [
        HostState::Waiting,
        HostState::Live,
        HostState::Fading,
        HostState::Held,
        HostState::Live,
        HostState::Live,
        HostState::Held,
    ];
    for (number, (safety, state)) in (0..).zip(safety.into_iter().zip(state)) {
        let mut telemetry = tick(number, 0);
        telemetry.devices[1].safety = safety;
        telemetry.bodies[0].state = state;
        gatherer.take(&(&telemetry).into());
    }
    let frame = gatherer.frame();
    assert_eq!(
        texts(&frame),
        [
            (EventKind::Trip, 1, "right: force limited"),
            (
                EventKind::StaleModel,
                2,
                "sheet: model too old, force fading"
            ),
            (EventKind::Trip, 3, "right: too fast, force fading"),
            (EventKind::Trip, 6, "right: force limited"),
            (EventKind::StaleModel, 6, "sheet: model too old, safe hold"),
        ]
    );
    assert_eq!((frame.totals.trips, frame.totals.stale), (3, 2));
    assert_eq!(frame.hands[1].safety, "limited");
    assert_eq!(frame.bodies[0].state, "held");
}

#[test]
fn events_are_bounded_and_the_others_counted() {
    let mut gatherer = gatherer(Clock::Real);
    for number in 0..400 {
        let mut telemetry = tick(number, 0);
        if number % 2 == 1 {
            telemetry.devices[0].safety = SafetyState::Slewed;
        }
        telemetry.lateness_ns = if number == 333 { 70_500 } else { number };
        gatherer.take(&(&telemetry).into());
    }
    let frame = gatherer.clone().frame();
    assert_eq!((frame.events.len(), frame.more_events), (64, 136));
    let last = gatherer.last_frame();
    assert_eq!((last.events.len(), last.more_events), (64, 137));
    let worst = last.events.last().expect("the worst tick");
    assert_eq!((worst.kind, worst.tick), (EventKind::WorstTick, 333));
    assert_eq!(worst.text, "largest lateness: 70.5 µs");
    assert!(last.last && !frame.last);
    let lateness = last.totals.lateness.expect("a real clock");
    assert_eq!((lateness.count, lateness.max), (400, 70_500.0 * 1e-9));
}

#[test]
fn virtual_time_has_no_lateness() {
    let mut gatherer = gatherer(Clock::Virtual);
    gatherer.take(&(&tick(0, 0)).into());
    let frame = gatherer.last_frame();
    assert!(frame.totals.lateness.is_none() && frame.folded.lateness.is_empty());
    assert!(frame.events.is_empty() && frame.totals.duration.is_none());
}

#[test]
fn a_number_that_is_not_finite_is_zero_in_a_frame() {
    let mut gatherer = gatherer(Clock::Virtual);
    let mut telemetry = tick(0, 0);
    telemetry.devices[0].wrench.force.x = f64::NAN;
    telemetry.bodies[0].energy.stored = f64::INFINITY;
    gatherer.take(&(&telemetry).into());
    let frame = gatherer.frame();
    assert_eq!(frame.hands[0].force, [0.0; 3]);
    assert_eq!(frame.bodies[0].energy["stored"], 0.0);
    assert!(frame.folded.bodies[0].stored.is_empty());
}
