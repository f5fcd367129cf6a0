//! The motion that no controller can foresee: a hand that rests and then leaves without warning.
//!
//! A hand presses slowly to the depth `x`, rests, and leaves at the speed `v` with the next sample. Until the
//! controller can respond, `(d + 1) T` later, the device holds its last force. That force is at least `r K x` if a slow
//! press is to feel the fraction `r` of the wall. Over the displacement `D = v (d + 1) T` the hand receives `r K x D`
//! and spends `b v D + f_c D`. During the press the hand supplied at most `K x^2 / 2` (the force of a slow press is no
//! larger than that of the wall) and `f_c x`. The hand gains most from `x = D`:
//! ```text
//! (r - 1/2) K D^2 - b D^2 / ((d + 1) T) - 2 f_c D
//! ```
//!
//! The bound holds for every scheme. A scheme that keeps this gain below an energy for every motion either renders slow
//! presses too softly, or is no stiffer than [`most`]. A hand of limited acceleration cannot make this motion: its
//! first steps announce the rest.

use crate::adversary::{Limits, Start};
use sim::DeviceModel;

/// The largest stiffness (N/m) of which a scheme can render the fraction `rendered` while a hand of up to `speed` (m/s)
/// gains no more than `energy` (J). None if the motors are too weak for the motion: there is no such bound.
pub(super) fn most(
    model: &DeviceModel,
    period: f64,
    delay: usize,
    speed: f64,
    rendered: f64,
    energy: f64,
) -> Option<f64> {
    let time = (delay + 1) as f64 * period;
    let travel = speed * time;
    let paid = model.damping / time + (energy + 2.0 * model.friction * travel) / (travel * travel);
    let stiffness = paid / (rendered - 0.5);
    (stiffness * travel <= model.max_force).then_some(stiffness)
}

/// Motions of this kind, from one to eight times as deep as the displacement of the hand before the controller
/// responds.
pub(super) fn motions(limits: &Limits, delay: usize) -> Vec<Start> {
    let step = limits.speed * limits.period;
    let travel = step * (delay + 1) as f64;
    let (press, rest) = (limits.longest / 2, limits.longest / 4);
    [1.0, 1.5, 2.0, 3.0, 5.0, 8.0]
        .iter()
        .map(|multiple| (multiple * travel).min(limits.deepest))
        .map(|deep| {
            let down = (1..=press).map(|k| -deep * k as f64 / press as f64);
            let out = (1..limits.longest).map(|k| (step * k as f64 - deep).min(0.0));
            let leaves = out.take((deep / step).ceil() as usize + delay + 2);
            let motion = down.chain(std::iter::repeat_n(-deep, rest)).chain(leaves);
            motion.collect::<Vec<_>>().into()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adversary::{Goal, Rendering};
    use crate::stress::wall::passive::{SPEED, adversary};
    use crate::stress::wall::rig::Wall;
    use rt_core::Scheme;

    #[test]
    fn a_wall_of_the_requested_stiffness_gives_the_energy_of_theory() {
        // A sampled spring is as stiff as asked, so the bound for `r = 1` is the energy that the hand gains.
        struct Spring(f64);
        impl Rendering for Spring {
            fn reset(&mut self) {}
            fn tick(&mut self, position: f64) -> f64 {
                (-self.0 * position).max(0.0)
            }
        }
        let model = DeviceModel {
            max_force: 1e3,
            ..DeviceModel::named("virtuose6d").expect("it is known")
        };
        for delay in [0, 1] {
            let energy = 2e-3;
            let stiffness = most(&model, 1e-3, delay, SPEED, 1.0, energy).expect("strong motors");
            let wall = Wall {
                model,
                rate: 1000,
                delay,
                whole: true,
                scheme: Scheme::Linear,
                stiffness,
                damping: 0.0,
            };
            // Only these motions are tried.
            let adversary = adversary(&wall, 1, 1);
            let starts = motions(&adversary.limits, delay);
            let found = adversary.search(&mut Spring(stiffness), Goal::Most, &starts);
            // The press takes a thousand steps, each with the force of the step before, which changes the energy by a
            // thousandth. Other depths and the motion after the response extract more, as from any wall beyond the
            // plain bound.
            assert!(found.outcome.energy > 0.998 * energy, "{delay} {found:?}");
        }
    }
}
