//! The motions of hands that touch with tools: they press, tap, rub and shake, or run round loops in phase with the host.

use crate::chance::Chance;
use physics::Vec3;

/// The part of a run after which the hands leave.
const LEAVES: f64 = 0.85;
/// The largest mean speed on a loop (m/s).
const FASTEST: f64 = 0.5;

/// What a hand does with its tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stroke {
    /// In, and stay.
    Press,
    /// In and out again, several times.
    Tap,
    /// In, and to and fro along the surface.
    Rub,
    /// In, and to and fro across the surface.
    Shake,
    /// The adversary: in, and round a loop whose period is a few of those of the host, so that each round meets the messages in the same
    /// phase. If forces between messages gave energy in that phase, each round would gain some.
    Loop,
}

impl Stroke {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Press => "presses",
            Self::Tap => "taps",
            Self::Rub => "rubs",
            Self::Shake => "shakes",
            Self::Loop => "loops",
        }
    }

    /// The stroke of a number below one.
    pub(super) fn of(number: f64) -> Self {
        let all = [Self::Press, Self::Tap, Self::Rub, Self::Shake, Self::Loop];
        all[(number * all.len() as f64) as usize]
    }
}

/// Where a hand goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    /// The direction into the surface, and one along it.
    pub(super) inward: Vec3,
    pub(super) along: Vec3,
    /// How far the surface is (m), and how far beyond it the hand aims (m).
    pub(super) gap: f64,
    pub(super) depth: f64,
    /// How far the hand goes along the surface (m).
    pub(super) width: f64,
}

impl Way {
    /// The times (s) and the aims (m, from the start) of a hand in a run of `duration` (s) with a host of this period (s).
    pub(super) fn points(
        &self,
        stroke: Stroke,
        chance: Chance,
        duration: f64,
        period: f64,
    ) -> Vec<(f64, Vec3)> {
        let of = chance.of("stroke");
        let within = self.gap + self.depth;
        let at = |inward: f64, along: f64| self.inward * inward + self.along * along;
        let begin = of.between(0, 0.02, 0.1) * duration;
        let mut points = vec![(begin, Vec3::zeros())];
        let end = LEAVES * duration;
        let mut time = begin + of.between(1, 0.05, 0.3);
        if stroke != Stroke::Tap {
            points.push((time, at(within, 0.0)));
        }
        match stroke {
            Stroke::Press => {}
            Stroke::Tap => {
                let (down, up) = (of.between(2, 0.02, 0.15), of.between(3, 0.02, 0.15));
                time = begin;
                while time + down < end {
                    points.push((time + down, at(within, 0.0)));
                    time += down + up;
                    points.push((time, at(of.between(4, 0.0, 0.8) * self.gap, 0.0)));
                }
            }
            Stroke::Rub | Stroke::Shake => {
                let half = of.between(2, 0.04, 0.25);
                let is_rub = stroke == Stroke::Rub;
                let (reach, shallow) = if is_rub {
                    (self.width, 0.0)
                } else {
                    (
                        of.between(3, 0.0, 0.2) * self.width,
                        of.between(4, 0.2, 1.2) * self.depth,
                    )
                };
                let mut side = 1.0;
                time += half;
                while time < end {
                    let out = if side > 0.0 { shallow } else { 0.0 };
                    points.push((time, at(within - out, side * reach)));
                    (side, time) = (-side, time + half);
                }
            }
            Stroke::Loop => {
                let rounds = [1.0, 1.0, 2.0, 3.0, 4.0][(5.0 * of.unit(2)) as usize];
                let round = rounds * period;
                // The parts of the four legs of a round.
                let legs = [5, 6, 7, 8].map(|n| of.between(n, 0.1, 1.0));
                let whole: f64 = legs.iter().sum();
                let shortest = legs.into_iter().fold(f64::INFINITY, f64::min) / whole * round;
                let most = FASTEST * shortest;
                let inward = (of.between(9, 0.1, 1.0) * self.depth).min(most);
                let along = (of.between(10, 0.0, 1.0) * self.width).min(most);
                // A whole number of periods from the start, and a phase.
                time = ((time / round).ceil() + of.unit(3)) * round;
                while time + round < end {
                    for (corner, leg) in legs.iter().enumerate() {
                        let out = if matches!(corner, 1 | 2) { inward } else { 0.0 };
                        let side = if matches!(corner, 2 | 3) { along } else { 0.0 };
                        points.push((time, at(within - out, side)));
                        time += leg / whole * round;
                    }
                }
            }
        }
        if let Some((last, _)) = points.last() {
            points.push((last.max(end) + 0.1 * duration, at(0.0, 0.0)));
        }
        points
    }
}
