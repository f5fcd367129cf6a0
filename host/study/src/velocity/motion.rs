//! Motions of a handle whose velocity is known.

use serde::Serialize;
use sim::minimum_jerk;
use std::f64::consts::{PI, TAU};

/// The motion of the handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// 5 mm in a second, along a minimum-jerk path.
    Press,
    /// To and fro over 40 mm, one and a half times a second.
    Rub,
    /// 1, 2, 5 and 10 Hz at once, each of 30 mm/s.
    Hand,
    /// Taps at 0.2 m/s on a hard object, which reverses the velocity within 10 ms; seven times a second.
    Tap,
    /// A hold at the boundary of two counts, with a tremor of a tenth of a count at 9 Hz.
    Hold,
}

/// Speed of a tap (m/s), duration of the contact, and duration of the reversal away from it (s).
const TAP: (f64, f64, f64) = (0.2, 10e-3, 60e-3);
/// Time from the contact to the reversal (s).
const AWAY: f64 = 35e-3;

impl Motion {
    /// All motions.
    pub const ALL: [Self; 5] = [Self::Press, Self::Rub, Self::Hand, Self::Tap, Self::Hold];

    /// Duration of the measurement (s).
    pub fn duration(self) -> f64 {
        match self {
            Self::Press => 1.0,
            _ => 2.0,
        }
    }

    /// Position (m) and velocity (m/s) at `t` (s), with encoder counts of `step` (m).
    pub fn at(self, t: f64, step: f64) -> (f64, f64) {
        match self {
            Self::Press => {
                let (x, v) = minimum_jerk(t);
                (5e-3 * x, 5e-3 * v)
            }
            Self::Rub => wave(0.02, 1.5, 0.0, t),
            Self::Hand => {
                let parts = [(1.0, 0.0), (2.0, 1.0), (5.0, 2.0), (10.0, 3.0)];
                parts.iter().fold((0.0, 0.0), |(x, v), (f, phase)| {
                    let (dx, dv) = wave(0.03 / (TAU * f), *f, *phase, t);
                    (x + dx, v + dv)
                })
            }
            Self::Tap => tap(t),
            Self::Hold => {
                let (x, v) = wave(0.1 * step, 9.0, 0.0, t);
                (0.5 * step + x, v)
            }
        }
    }
}

fn wave(amplitude: f64, frequency: f64, phase: f64, t: f64) -> (f64, f64) {
    let w = TAU * frequency;
    let angle = w * t + phase;
    (
        amplitude * libm::sin(angle),
        amplitude * w * libm::cos(angle),
    )
}

/// A half wave of contact, the motion away, a half wave of reversal, the motion back.
fn tap(t: f64) -> (f64, f64) {
    let (speed, contact, turn) = TAP;
    let t = t.rem_euclid(contact + turn + 2.0 * AWAY);
    let bounce = |s: f64, length: f64| {
        let angle = PI * s / length;
        let depth = speed * length / PI;
        (depth * libm::sin(angle), speed * libm::cos(angle))
    };
    if t < contact {
        bounce(t, contact)
    } else if t < contact + AWAY {
        (-speed * (t - contact), -speed)
    } else if t < contact + AWAY + turn {
        let (x, v) = bounce(t - contact - AWAY, turn);
        (-speed * AWAY - x, -v)
    } else {
        let s = t - contact - AWAY - turn;
        (speed * (s - AWAY), speed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocities_are_those_of_the_positions() {
        for motion in Motion::ALL {
            let mut x = motion.at(0.0, 1e-5).0;
            // The trapezoidal rule with steps of a microsecond: its error is far below the tolerance.
            let h = 1e-6;
            for k in 0..400_000_u32 {
                let t = f64::from(k) * h;
                let (now, next) = (motion.at(t, 1e-5), motion.at(t + h, 1e-5));
                x += 0.5 * h * (now.1 + next.1);
                assert!((x - next.0).abs() < 1e-9, "{motion:?} {t}");
            }
        }
    }
}
