use super::*;
use crate::live::Vertices;
use crate::live::frame::Folded;
use crate::live::gather::tests::{gatherer, tick};
use crate::record::Clock;
use proptest::prelude::*;
use rt_core::Vec3;
use rt_core::safety::SafetyState;

/// Frames of ticks with these values, cut after each value that says so. Each frame has a message of the log.
fn frames(values: &[(f64, u8, usize, bool)], cuts: bool) -> Vec<Frame> {
    let mut gatherer = gatherer(Clock::Real);
    let mut frames = Vec::new();
    let mut missed = 0;
    let mut log = Vec::new();
    for (number, (value, kind, bytes, cut)) in (0..).zip(values) {
        missed += u64::from(*kind == 0);
        let mut telemetry = tick(number, missed);
        telemetry.lateness_ns = (value.abs() * 1e6) as u64;
        telemetry.devices[0].wrench.force = Vec3::new(*value, -value, 0.5 * value);
        telemetry.devices[1].pose.position.z = value.sin();
        telemetry.bodies[0].sequence = number;
        telemetry.bodies[0].age_ns = (value.abs() * 1e9) as u64;
        telemetry.bodies[0].energy.stored = *value;
        if kind.is_multiple_of(2) {
            telemetry.devices[1].safety = SafetyState::Limited;
        }
        gatherer.take(&(&telemetry).into());
        log.push(LogMessage {
            topic: "/tick".to_owned(),
            time_ns: telemetry.time_ns,
            length: *bytes as u32,
            data: vec![*kind; *bytes],
        });
        if *cut && cuts {
            let mut frame = gatherer.frame();
            frame.log = std::mem::take(&mut log);
            frames.push(frame);
        }
    }
    let mut frame = gatherer.last_frame();
    frame.log = log;
    frames.push(frame);
    frames
}

/// Merges from the oldest on, as the frames come.
fn from_the_left(frames: &[Frame]) -> Frame {
    let mut frames = frames.iter().cloned();
    let first = frames.next().expect("a frame");
    frames.fold(first, |older, mut newer| {
        newer.merge_before(older);
        newer
    })
}

/// Merges the two halves, each merged likewise.
fn by_halves(frames: &[Frame]) -> Frame {
    if let [frame] = frames {
        return frame.clone();
    }
    let (older, newer) = frames.split_at(frames.len() / 2);
    let mut merged = by_halves(newer);
    merged.merge_before(by_halves(older));
    merged
}

proptest! {
    #[test]
    fn merging_in_any_grouping_is_folding_all_ticks_at_once(
        values in prop::collection::vec(
            (-5.0..5.0_f64, 0_u8..12, prop_oneof![0_usize..9, Just(60_000)], any::<bool>()),
            1..180,
        ),
    ) {
        let apart = frames(&values, true);
        let merged = from_the_left(&apart);
        prop_assert_eq!(&merged, &by_halves(&apart));
        let whole = frames(&values, false).remove(0);
        prop_assert_eq!(&merged.folded, &whole.folded);
        prop_assert_eq!(&merged.totals, &whole.totals);
        prop_assert_eq!((&merged.hands, &merged.bodies), (&whole.hands, &whole.bodies));
        prop_assert_eq!(merged.dropped, apart.len() as u64 - 1);
        prop_assert!(merged.last);
        // Nothing is lost without being counted.
        prop_assert_eq!(
            merged.events.len() as u64 + merged.more_events,
            apart.iter().map(|f| f.events.len() as u64 + f.more_events).sum::<u64>()
        );
        prop_assert_eq!(merged.log.len() as u64 + merged.more_log, values.len() as u64);
        prop_assert!(merged.log.iter().zip(&whole.log).all(|(a, b)| a == b));
        let bytes: usize = merged.log.iter().map(|message| message.data.len()).sum();
        let first: usize = apart[0].log.iter().map(|message| message.data.len()).sum();
        prop_assert!(bytes <= MAX_LOG.max(first));
    }
}

#[test]
fn the_newest_vertices_stay() {
    let with = |step: u64| {
        let mut gatherer = gatherer(Clock::Virtual);
        gatherer.take(&(&tick(step, 0)).into());
        let mut frame = gatherer.frame();
        frame.bodies[0].vertices = (step > 0).then(|| Vertices {
            step,
            ..Vertices::default()
        });
        frame
    };
    let step = |frame: &Frame| frame.bodies[0].vertices.as_ref().map(|v| v.step);
    for (older, newer, expected) in [(1, 2, Some(2)), (1, 0, Some(1)), (0, 0, None)] {
        let mut merged = with(newer);
        merged.merge_before(with(older));
        assert_eq!(step(&merged), expected);
    }
}

#[test]
fn a_frame_without_ticks_changes_no_curve() {
    let whole = frames(&[(1.0, 3, 0, false), (2.0, 0, 0, false)], false).remove(0);
    let empty = Frame {
        folded: Folded::default(),
        ..Frame::default()
    };
    let mut merged = empty.clone();
    merged.merge_before(whole.clone());
    assert_eq!(merged.folded, whole.folded);
    let mut merged = whole.clone();
    merged.merge_before(empty);
    assert_eq!(merged.folded, whole.folded);
    assert_eq!(merged.dropped, 1);
}
