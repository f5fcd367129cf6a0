//! The devices of a drawn cell and the hands that hold them, as the text of a scene.

use super::{Cause, Draw, DrawnHand, Task};
use crate::stress::scene::draw::{ARRIVED, BEGIN};
use physics::Vec3;
use sim::Arm;

/// The target of a hand lies at most this far beyond the place of its device (m).
const FURTHEST: f64 = 0.2;

/// One place of the march: for each hand the displacement of its device (m) and the force of the body on it (N), in the axes
/// of the device.
#[derive(Clone, Debug)]
pub(super) struct Step {
    /// The displacement as a fraction of the largest.
    pub(super) fraction: f64,
    pub(super) hands: Vec<[Vec3; 2]>,
}

/// How far the hands go.
#[derive(Clone, Debug)]
pub(super) struct Moves {
    /// From rest to the hold.
    pub(super) steps: Vec<Step>,
    /// For each hand, the displacement across in a rub (m), and the change of the force there (N).
    pub(super) across: Vec<[Vec3; 2]>,
}

impl Moves {
    /// Displacement and force of a hand at the fraction `fraction` of the way to the hold.
    fn at(&self, hand: usize, fraction: f64) -> [Vec3; 2] {
        let end = self.steps.last().map_or(0.0, |step| step.fraction);
        let wanted = fraction * end;
        let after = self.steps.iter().position(|step| step.fraction >= wanted);
        let after = after.unwrap_or(self.steps.len() - 1);
        let [from, to] = [after.saturating_sub(1), after].map(|number| &self.steps[number]);
        let part = if to.fraction > from.fraction {
            (wanted - from.fraction) / (to.fraction - from.fraction)
        } else {
            1.0
        };
        [0, 1].map(|k| from.hands[hand][k] + (to.hands[hand][k] - from.hands[hand][k]) * part)
    }
}

/// `[[device]]` of a hand. Without `moves` the hand stays.
pub(super) fn device(draw: &Draw, index: usize, hand: &DrawnHand, moves: Option<&Moves>) -> String {
    let model = draw.model(index);
    let arm = Arm::between(hand.grip);
    let names = ["relaxed", "typical", "firm", "rigid"];
    let name = names[(hand.grip * 3.999) as usize];
    let tremor = if draw.task == Task::Tremble && moves.is_some() {
        5e-5 + 1e-4 * draw.haste
    } else {
        0.0
    };
    let slew = if draw.cause == Cause::Slew {
        format!("max_slew = {:?}\n", model.max_force / draw.span.duration)
    } else {
        String::new()
    };
    // The spring of the hand must be stretched by the force of the body and by friction.
    let target = |fraction: f64, side: f64| {
        let Some(moves) = moves else {
            return Vec3::zeros();
        };
        let [[place, force], [_, rest]] = [fraction, 0.0].map(|f| moves.at(index, f));
        let [across, change] = moves.across[index];
        let place = place + across * side;
        let force = force - rest + change * side;
        let along = place.try_normalize(1e-12).unwrap_or_default();
        let beyond = (along * (model.friction * fraction) - force) / arm.stiffness;
        let shortened = beyond.norm().min(FURTHEST);
        place + beyond.try_normalize(1e-12).unwrap_or_default() * shortened
    };
    let rows: Vec<String> = times(draw)
        .into_iter()
        .map(|(time, fraction, side)| {
            let place = target(fraction, side);
            format!("[{time:?}, {:?}, {:?}, {:?}]", place.x, place.y, place.z)
        })
        .collect();
    format!(
        "[[device]]\nname = \"device {index}\"\nmodel = \"{}\"\nwire = false\nmotion_scale = {:?}\n{slew}\n\
         [device.hand]\ngrip = \"{name}\"\nmass = {:?}\ndamping = {:?}\nstiffness = {:?}\ntremor = {tremor:?}\n\
         waypoints = [{}]\n\n",
        hand.device,
        hand.scale,
        arm.mass,
        arm.damping,
        arm.stiffness,
        rows.join(", ")
    )
}

/// The waypoints of the task: time (s), fraction of the way to the hold, and side across.
fn times(draw: &Draw) -> Vec<(f64, f64, f64)> {
    let mut rows = vec![(BEGIN, 0.0, 0.0)];
    match (draw.cause, draw.task) {
        (Cause::Fast, _) => rows.push((BEGIN + draw.span.duration, 1.0, 0.0)),
        // The force follows in time.
        (Cause::Slew, _) => rows.push((BEGIN + 0.8 - 0.6 * draw.haste, 1.0, 0.0)),
        (_, Task::Press | Task::Tremble) => {
            rows.push((ARRIVED - 1.6 * draw.haste, 1.0, 0.0));
        }
        (_, Task::Rub) => {
            let (there, end) = (BEGIN + 0.8, ARRIVED - 0.1);
            rows.push((there, 1.0, 0.0));
            for (fraction, side) in [(0.25, 1.0), (0.75, -1.0), (1.0, 0.0)] {
                rows.push((there + (end - there) * fraction, 1.0, side));
            }
        }
        (_, Task::Stages) => {
            let each = (ARRIVED - BEGIN) / 3.0;
            let goes = each * (0.9 - 0.5 * draw.haste);
            for stage in 1..=3 {
                let fraction = f64::from(stage) / 3.0;
                let arrives = BEGIN + each * f64::from(stage - 1) + goes;
                rows.push((arrives, fraction, 0.0));
                if stage < 3 {
                    rows.push((arrives + each - goes, fraction, 0.0));
                }
            }
        }
    }
    rows
}
