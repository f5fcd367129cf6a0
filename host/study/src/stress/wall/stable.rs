//! The measured boundary of stability: from which stiffness on a hand that presses on the wall feels it tremble.

use super::rig::{Rig, Wall};
use super::theory::{Plant, Step};
use sim::adversary::Rendering;

/// Ticks that a disturbance is watched.
const TICKS: usize = 6000;
/// Deepest place that is pressed to (m): it is taken in one tick, which must not look like a reading gone wrong.
const DEEPEST: f64 = 3e-3;
/// Ratio of stiffnesses at which halving ends.
const CLOSE: f64 = 1.005;

/// The smallest stiffness (N/m) at which a small disturbance grows, halving from about `start`.
pub fn boundary(wall: &Wall, plant: &Plant, start: f64) -> f64 {
    let grows = |stiffness: f64| grows(&Wall { stiffness, ..*wall }, plant);
    let (mut low, mut high) = (start, start);
    while !grows(high) && high < 1e8 {
        (low, high) = (high, high * 1.5);
    }
    while grows(low) && low > 1e-3 {
        (high, low) = (low, low / 1.5);
    }
    while high > CLOSE * low {
        let middle = (high * low).sqrt();
        if grows(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// Whether a disturbance grows of a hand that presses with up to half of what the motors can hold: whether, once the slow
/// motion of the arm has died away, the motion is larger in the last quarter of the time than in the third, or has
/// grown beyond the disturbance and come to where the hand bounces off the wall.
fn grows(wall: &Wall, plant: &Plant) -> bool {
    let step = Step::exact(plant, wall.period());
    let press = (0.5 * wall.model.max_force).min(DEEPEST * wall.stiffness);
    let rest = -press / wall.stiffness;
    let mut rig = Rig::new(*wall);
    rig.reset();
    for _ in 0..3 {
        rig.tick(rest);
    }
    let mut forces = vec![press; wall.delay];
    // A hundredth of the way to the surface: contact is kept unless it grows.
    let start = 0.01 * rest.abs();
    let mut state = [start, 0.0];
    let mut quarters = [0.0_f64; 4];
    for k in 0..TICKS {
        forces.push(rig.tick(rest + state[0]));
        state = step.advance(state, forces[k] - press);
        let quarter = &mut quarters[4 * k / TICKS];
        *quarter = quarter.max(state[0].abs());
    }
    // What is left of rounding is no motion.
    let grew = quarters[3] > quarters[2] && quarters[3] > 1e-7 * start;
    grew || quarters[3] > 2.0 * start
}
