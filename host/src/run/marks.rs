//! The intervals that the plot of a run marks: the force was not that of the newest model, or a tear grew.

use crate::plot::{Cause, Mark};
use rt_core::Telemetry;
use rt_core::coupling::HostState;
use rt_core::safety::SafetyState;

/// Age of a model above which the host counts as stalled (s). Between two publications of the slowest usual host, at
/// 20 Hz and late by two periods, models reach 0.15 s.
const STALLED: f64 = 0.25;
/// Longest gap within an interval (s). What acts in most ticks is felt as acting in all.
const GAP: f64 = 0.02;
/// Longest time from one edge to the next in an interval in which a tear grows (s). Hands tear some hundred edges a
/// second at most, and ten a second are felt as one tear.
const TEARING: f64 = 0.1;
/// Most intervals that are kept. If there are more, neighbours of one cause become one: a picture of a long run does not
/// show the gaps between them.
const MOST: usize = 1 << 13;

/// Collects the intervals tick by tick.
#[derive(Clone, Debug)]
pub(super) struct Marks {
    device_names: Vec<String>,
    body_names: Vec<String>,
    /// By device; by body, for the age of the model; by body, for the cap.
    open: Vec<Option<Mark>>,
    /// By body, for its tears.
    torn: Vec<Option<Mark>>,
    ended: Vec<Mark>,
}

impl Marks {
    pub(super) fn new(device_names: &[String], body_names: &[String]) -> Self {
        // A name says nothing if there is one only.
        let named = |names: &[String]| match names.len() {
            1 => vec![String::new()],
            _ => names.to_vec(),
        };
        Self {
            device_names: named(device_names),
            body_names: named(body_names),
            open: vec![None; device_names.len() + 2 * body_names.len()],
            torn: vec![None; body_names.len()],
            ended: Vec::new(),
        }
    }

    /// Takes the record of one tick.
    pub(super) fn take(&mut self, telemetry: &Telemetry) {
        let time = telemetry.time_ns as f64 * 1e-9;
        let device = telemetry.devices().map(|device| match device.safety {
            SafetyState::Normal | SafetyState::Recovering => None,
            SafetyState::Engaging => Some((Cause::Engaging, time)),
            SafetyState::Limited | SafetyState::Slewed | SafetyState::Hot => {
                Some((Cause::Limited, time))
            }
            SafetyState::HandsOff | SafetyState::Disarmed | SafetyState::Stopped => {
                Some((Cause::Disengaged, time))
            }
            SafetyState::TooFast | SafetyState::OutOfReach => Some((Cause::Fading, time)),
            SafetyState::Silent => Some((Cause::Silent, time)),
            SafetyState::LetGo => Some((Cause::LetGo, time)),
            SafetyState::DeviceFault => Some((Cause::Fault, time)),
            SafetyState::NotANumber => Some((Cause::NotANumber, time)),
        });
        let aged = telemetry.bodies().map(|body| {
            let age = body.age_ns as f64 * 1e-9;
            match body.state {
                HostState::Waiting => None,
                // The stall began when the newest model was made.
                HostState::Live => (age > STALLED).then_some((Cause::Stalled, time - age)),
                HostState::Fading => Some((Cause::Fading, time)),
                HostState::Held => Some((Cause::Held, time)),
            }
        });
        let capped = telemetry.bodies().map(|body| {
            body.withheld
                .is_noticeable()
                .then_some((Cause::Capped, time))
        });
        let names = self.device_names.iter();
        let names = names.chain(&self.body_names).chain(&self.body_names);
        let mut too_many = false;
        for ((now, open), name) in device
            .chain(aged)
            .chain(capped)
            .zip(&mut self.open)
            .zip(names)
        {
            let same = |mark: &Mark| now.is_some_and(|(cause, _)| cause == mark.cause);
            if let Some(mark) = open.as_mut().filter(|mark| same(mark)) {
                mark.to = time;
                continue;
            }
            // Another cause ends the interval at once, the absence of all causes after a gap.
            let ends = |mark: &Mark| now.is_some() || time - mark.to > GAP;
            if open.as_ref().is_some_and(ends) {
                self.ended.extend(open.take());
                too_many = self.ended.len() >= MOST;
            }
            if let (None, Some((cause, from))) = (&open, now) {
                *open = Some(Mark {
                    from: from.max(0.0),
                    to: time,
                    cause,
                    of: name.clone(),
                });
            }
        }
        if too_many {
            self.thin();
        }
    }

    /// Joins neighbours of one cause until half of the intervals are left at most.
    fn thin(&mut self) {
        let kind = |mark: &Mark| mark.cause as u8;
        self.ended.sort_by(|a, b| {
            let kinds = kind(a).cmp(&kind(b)).then_with(|| a.of.cmp(&b.of));
            kinds.then(a.from.total_cmp(&b.from))
        });
        let mut gap = GAP;
        while self.ended.len() > MOST / 2 {
            gap *= 2.0;
            self.ended.dedup_by(|next, mark| {
                let near = next.cause == mark.cause && next.of == mark.of;
                let joins = near && next.from <= mark.to + gap;
                if joins {
                    mark.to = mark.to.max(next.to);
                }
                joins
            });
        }
    }

    /// Takes an edge of the body of index `body` that opened at `time` (s).
    pub(super) fn tear(&mut self, body: usize, time: f64) {
        let (Some(open), Some(name)) = (self.torn.get_mut(body), self.body_names.get(body)) else {
            return;
        };
        if let Some(mark) = open.as_mut().filter(|mark| time - mark.to <= TEARING) {
            mark.to = time;
            return;
        }
        let mark = Mark {
            from: time,
            to: time,
            cause: Cause::Torn,
            of: name.clone(),
        };
        self.ended.extend(open.replace(mark));
        if self.ended.len() >= MOST {
            self.thin();
        }
    }

    /// All intervals, in the order of their beginnings.
    pub(super) fn finish(mut self) -> Vec<Mark> {
        let open = self.open.into_iter().chain(self.torn);
        self.ended.extend(open.flatten());
        self.ended.sort_by(|a, b| a.from.total_cmp(&b.from));
        self.ended
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::Withheld;

    /// The marks of two seconds of ticks of one device and one body.
    fn marks(set: impl Fn(f64, &mut Telemetry)) -> Vec<(Cause, f64, f64)> {
        let mut marks = Marks::new(&["hand".to_owned()], &["sheet".to_owned()]);
        for tick in 0..2000_u64 {
            let mut telemetry = Telemetry::empty();
            (telemetry.device_count, telemetry.body_count) = (1, 1);
            telemetry.time_ns = tick * 1_000_000;
            telemetry.bodies[0].state = HostState::Live;
            set(tick as f64 * 1e-3, &mut telemetry);
            marks.take(&telemetry);
        }
        let found = marks.finish();
        assert!(found.iter().all(|mark| mark.of.is_empty()));
        found.iter().map(|m| (m.cause, m.from, m.to)).collect()
    }

    fn near(found: &[(Cause, f64, f64)], expected: &[(Cause, f64, f64)]) {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (a, b) in found.iter().zip(expected) {
            // A tick on either side.
            let close = (a.1 - b.1).abs() < 1.1e-3 && (a.2 - b.2).abs() < 1.1e-3;
            assert!(a.0 == b.0 && close, "{found:?}");
        }
    }

    #[test]
    fn a_stall_is_marked_from_its_beginning_through_fading_to_the_hold() {
        let found = marks(|t, telemetry| {
            let body = &mut telemetry.bodies[0];
            let age = if (0.5..1.5).contains(&t) {
                t - 0.5
            } else {
                0.004
            };
            body.age_ns = (age * 1e9) as u64;
            body.state = match age {
                age if age > 0.8 => HostState::Held,
                age if age > 0.6 => HostState::Fading,
                _ => HostState::Live,
            };
        });
        near(
            &found,
            &[
                (Cause::Stalled, 0.5, 1.1),
                (Cause::Fading, 1.1, 1.3),
                (Cause::Held, 1.3, 1.5),
            ],
        );
    }

    #[test]
    fn the_ramp_after_the_engagement_is_marked() {
        let found = marks(|t, telemetry| {
            telemetry.devices[0].safety = match t {
                t if t < 0.5 => SafetyState::Disarmed,
                t if t < 0.8 => SafetyState::Engaging,
                _ => SafetyState::Normal,
            };
        });
        near(
            &found,
            &[(Cause::Disengaged, 0.0, 0.5), (Cause::Engaging, 0.5, 0.8)],
        );
    }

    /// A limit that acts for a tick in every tenth of a second, for hours.
    #[test]
    fn the_intervals_of_a_long_run_are_bounded_and_cover_what_acted() {
        let mut marks = Marks::new(&["hand".to_owned()], &[]);
        let mut telemetry = Telemetry::empty();
        telemetry.device_count = 1;
        let mut longest = 0;
        let acts = (1..40_000).map(|number: u64| number * 100_000_000);
        for time_ns in acts.clone() {
            for (after, safety) in [(0, SafetyState::Limited), (50_000_000, SafetyState::Normal)] {
                telemetry.time_ns = time_ns + after;
                telemetry.devices[0].safety = safety;
                marks.take(&telemetry);
                longest = longest.max(marks.ended.len());
            }
        }
        assert!(longest <= MOST, "{longest}");
        let found = marks.finish();
        let mut at = 0;
        for time in acts.map(|ns| ns as f64 * 1e-9) {
            while found[at].to < time {
                at += 1;
            }
            assert!(found[at].from <= time, "{time} s");
        }
        assert!(found.is_sorted_by(|a, b| a.to < b.from));
    }

    #[test]
    fn edges_that_open_soon_after_each_other_are_one_interval() {
        let mut marks = Marks::new(&[], &["sheet".to_owned()]);
        for time in [0.2, 0.25, 0.34, 0.5, 0.5] {
            marks.tear(0, time);
        }
        marks.tear(1, 0.6);
        let found = marks.finish();
        let found: Vec<_> = found.iter().map(|m| (m.cause, m.from, m.to)).collect();
        assert_eq!(found, [(Cause::Torn, 0.2, 0.34), (Cause::Torn, 0.5, 0.5)]);
    }

    #[test]
    fn a_cap_that_flickers_is_one_interval_and_a_small_one_is_none() {
        let found = marks(|t, telemetry| {
            let acts = (0.2..0.9).contains(&t) && !((t * 1e3) as u64).is_multiple_of(7);
            let force = if acts { 0.5 } else { 0.001 };
            telemetry.bodies[0].withheld = Withheld { force, of: 2.0 };
            if (1.0..1.1).contains(&t) {
                telemetry.devices[0].safety = SafetyState::Slewed;
            }
        });
        near(
            &found,
            &[(Cause::Capped, 0.2, 0.9), (Cause::Limited, 1.0, 1.1)],
        );
    }
}
