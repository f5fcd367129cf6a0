//! The measured boundary of stability: the stiffness from which on a hand that presses on the wall feels it tremble.

use super::rig::{Rig, Wall};
use super::theory::{Plant, Step};
use crate::adversary::Rendering;

/// Ticks for which a disturbance is observed.
const TICKS: usize = 6000;
/// Deepest position of a press (m). The rig moves there in one tick, which must not look like an invalid reading.
const DEEPEST: f64 = 3e-3;
/// Ratio of stiffnesses at which the bisection ends.
const CLOSE: f64 = 1.005;

/// The smallest stiffness (N/m) at which a small disturbance grows, bisected from about `start`.
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

/// Whether a disturbance grows, for a hand that presses with up to half of the largest force of the motors. After the
/// slow motion of the arm has decayed, the motion grows if it is larger in the last quarter of the time than in the
/// third. The motion also grows if it exceeds twice the disturbance: the hand then bounces off the wall.
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
    // A hundredth of the depth: contact is kept unless the disturbance grows.
    let start = 0.01 * rest.abs();
    let mut state = [start, 0.0];
    let mut quarters = [0.0_f64; 4];
    for k in 0..TICKS {
        forces.push(rig.tick(rest + state[0]));
        state = step.advance(state, forces[k] - press);
        let quarter = &mut quarters[4 * k / TICKS];
        *quarter = quarter.max(state[0].abs());
    }
    // Rounding is not a motion.
    let grew = quarters[3] > quarters[2] && quarters[3] > 1e-7 * start;
    grew || quarters[3] > 2.0 * start
}
