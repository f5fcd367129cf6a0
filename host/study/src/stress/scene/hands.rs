//! The targets of the hands for a drawn task: waypoints for the devices of the scene.
//!
//! The scene decides the direction and the largest displacement of each hand: the furthest point of the trajectory that
//! the scene gives it. A hand that is soft compared with the body would not reach this point. Its target therefore lies
//! further out, by the deflection of the arm under the force of the body and the friction of the device. All lengths and
//! forces are in the axes of the devices.

use super::draw::{ARRIVED, BEGIN, Draw, Task as Drawn};
use crate::chance::Chance;
use host::scene::LoadedScene;
use physics::Vec3;
use physics::linear::dense::Square;
use sim::Task;

/// The body's force is at most this fraction of the largest force of a device.
const MOST_FORCE: f64 = 0.7;
/// The target of a hand lies at most this far beyond the intended position of its device (m).
const FURTHEST: f64 = 0.2;

/// The furthest point of each device's own trajectory, relative to its start (m).
pub(super) fn reaches(loaded: &LoadedScene) -> Vec<Vec3> {
    let devices = loaded.scene.devices.iter().enumerate();
    devices
        .map(|(index, device)| {
            let Some(hand) = &device.hand else {
                return Vec3::zeros();
            };
            let rows = hand
                .waypoints
                .iter()
                .map(|[_, x, y, z]| Vec3::new(*x, *y, *z));
            let start = rows.clone().next().unwrap_or_default();
            let recorded = loaded.recordings.get(index).and_then(Option::as_ref);
            let first = recorded.and_then(|samples| samples.first());
            let first = first.map_or_else(Vec3::zeros, |(_, place)| Vec3::from(*place));
            let samples = recorded.into_iter().flatten();
            let samples = samples.map(|(_, place)| Vec3::from(*place) - first);
            let sines = hand.sines.iter().map(|sine| Vec3::from(sine.amplitude));
            let task = hand.task.map(|name| {
                let usual = Task::new(name.kind(), Vec3::from(hand.direction.unwrap_or_default()));
                let along = usual.direction.try_normalize(1e-9).unwrap_or_default();
                along * hand.depth.unwrap_or(usual.depth)
            });
            let all = rows.map(|row| row - start).chain(samples).chain(sines);
            let all = all.chain(task);
            all.fold(Vec3::zeros(), |far: Vec3, place| {
                if place.norm_squared() > far.norm_squared() {
                    place
                } else {
                    far
                }
            })
        })
        .collect()
}

/// The path of one hand through a task: rows of time, displacement along its reach, and displacement across.
struct Path {
    rows: Vec<(f64, f64, f64)>,
}

impl Path {
    fn new() -> Self {
        Self {
            rows: vec![(BEGIN, 0.0, 0.0)],
        }
    }

    fn to(&mut self, time: f64, along: f64, across: f64) {
        self.rows.push((time, along, across));
    }

    /// Oscillates between the last time and `end`, for `times` whole periods.
    fn swing(&mut self, times: u32, end: f64, mut place: impl FnMut(f64) -> (f64, f64)) {
        let begin = self.rows.last().map_or(BEGIN, |row| row.0);
        let each = (end - begin) / f64::from(2 * times);
        for half in 1..=2 * times {
            let side = match half {
                _ if half == 2 * times => 0.0,
                _ if half % 2 == 1 => 1.0,
                _ => -1.0,
            };
            let (along, across) = place(side);
            self.to(begin + each * f64::from(half), along, across);
        }
    }
}

/// The path of the task in `draw`; lengths are multiples of the reach.
fn path(draw: &Draw, width: f64) -> Path {
    let haste = draw.haste;
    let depth = draw.depth;
    let mut path = Path::new();
    // The first reach takes 0.9 to 0.3 s.
    let there = BEGIN + 0.9 - 0.6 * haste;
    match draw.task {
        Drawn::Press => {
            path.to(there, depth, 0.0);
            path.to(0.5 * (there + ARRIVED), 0.5 * depth, 0.0);
            path.to(ARRIVED, depth, 0.0);
        }
        Drawn::Tap => {
            let taps = 2 + (4.0 * haste) as u32;
            let each = (ARRIVED - BEGIN) / (f64::from(taps) + 0.5);
            for tap in 0..taps {
                let begin = BEGIN + each * f64::from(tap);
                path.to(begin + 0.5 * each, depth, 0.0);
                path.to(begin + each, 0.0, 0.0);
            }
            path.to(ARRIVED, depth, 0.0);
        }
        Drawn::Rub => {
            path.to(there, depth, 0.0);
            path.swing(1 + (2.0 * haste) as u32, ARRIVED, |side| {
                (depth, side * width)
            });
        }
        Drawn::Shake => {
            path.to(there, depth, 0.0);
            // 2 to 5 Hz.
            let times = ((2.0 + 3.0 * haste) * (ARRIVED - there)) as u32;
            path.swing(times.max(1), ARRIVED, |side| {
                (depth * (1.0 + 0.3 * side), 0.0)
            });
        }
        Drawn::Carry => {
            path.to(there, depth, 0.0);
            path.to(0.5 * (there + ARRIVED), depth, -width);
            path.to(ARRIVED, depth, width);
        }
    }
    path
}

/// The forces of a linear body of stiffness `stiffness` (N/m, three rows and columns a device) on hands that are
/// displaced by `reaches` (m) from rest (N).
fn forces(stiffness: &Square, reaches: &[Vec3]) -> Vec<Vec3> {
    let row = |row: usize| -> f64 {
        let each = reaches.iter().enumerate();
        each.map(|(other, reach)| {
            (0..3)
                .map(|c| stiffness[(row, 3 * other + c)] * reach[c])
                .sum::<f64>()
        })
        .sum()
    };
    let devices = 0..reaches.len();
    devices
        .map(|d| Vec3::new(row(3 * d), row(3 * d + 1), row(3 * d + 2)))
        .collect()
}

/// Shortens `reaches` so that no force exceeds [`MOST_FORCE`] of the largest force of its device (N). Otherwise the
/// study would test the motors.
pub(super) fn within(reaches: &mut [Vec3], stiffness: &Square, limits: &[f64]) {
    let found = forces(stiffness, reaches);
    let factors = found
        .iter()
        .zip(limits)
        .map(|(force, limit)| MOST_FORCE * limit / force.norm());
    let factor = factors.fold(1.0, f64::min);
    for reach in reaches {
        *reach *= factor;
    }
}

/// Gives the hands of `draw` to the devices of `loaded`. `stiffness` is the stiffness between the handles at rest,
/// three rows and columns for each device. A device with zero rows meets no force.
pub(super) fn give(
    loaded: &mut LoadedScene,
    draw: &Draw,
    chance: Chance,
    reaches: &[Vec3],
    stiffness: &Square,
    friction: &[f64],
) {
    let across = across(chance, reaches.first().copied().unwrap_or_default());
    let width = chance.between(3, 0.3, 1.0);
    // The force of the body where the hands shall hold, with all hands there.
    let forces = forces(stiffness, reaches);
    let hands = loaded.scene.devices.iter_mut().enumerate();
    for (index, device) in hands {
        let (grip, reach) = (&draw.grips[index], reaches[index]);
        let along = reach.try_normalize(1e-9).unwrap_or_default();
        let held = (forces[index] * draw.depth).dot(&along).max(0.0) + friction[index];
        let beyond = along * (held / grip.stiffness).min(FURTHEST);
        // In a rub every other hand moves in the opposite direction; when carrying, all hands move in the same
        // direction.
        let side = if draw.task == Drawn::Rub && index % 2 == 1 {
            -1.0
        } else {
            1.0
        };
        let across = across * (side * reach.norm());
        // None but simulated devices are studied.
        let Some(hand) = &mut device.hand else {
            continue;
        };
        hand.mass = Some(grip.mass);
        hand.damping = Some(grip.damping);
        hand.stiffness = Some(grip.stiffness);
        hand.tremor = 0.0;
        hand.task = None;
        hand.sines.clear();
        hand.recording = None;
        let rows = path(draw, width).rows.into_iter();
        hand.waypoints = rows
            .map(|(time, a, c)| {
                let fraction = (a / draw.depth).min(1.0);
                let place = reach * a + beyond * fraction + across * c;
                [time, place.x, place.y, place.z]
            })
            .collect();
        device.wire = Some(false);
    }
    loaded.recordings.fill(None);
}

/// A random direction across `reach`.
fn across(chance: Chance, reach: Vec3) -> Vec3 {
    let any = Vec3::from_fn(|axis, _| chance.between(4 + axis as u64, -1.0, 1.0));
    let along = reach.try_normalize(1e-9).unwrap_or_default();
    let across = any - along * any.dot(&along);
    across.try_normalize(1e-6).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::scene::Scene;

    #[test]
    fn a_hand_with_a_task_reaches_as_deep_and_gives_up_its_task() {
        let text = include_str!("../../../../scenes/paddle.toml");
        let mut loaded =
            Scene::load_texts("paddle.toml", text, &std::collections::BTreeMap::new()).unwrap();
        let reaches = reaches(&loaded);
        assert_eq!(reaches, [Vec3::new(0.015, 0.0, 0.0)]);
        let draw = Draw::new(1, 0, 1);
        let chance = Chance::new(1, 0).of("task");
        let stiffness = Square::zeros(3);
        give(&mut loaded, &draw, chance, &reaches, &stiffness, &[0.0]);
        let hand = loaded.scene.devices[0].hand.as_ref().unwrap();
        assert!(hand.task.is_none() && hand.waypoints.len() > 2);
        // The hand holds at the end, as far along the reach as the trial says.
        let [_, x, ..] = hand.waypoints[hand.waypoints.len() - 1];
        assert!((x - 0.015 * draw.depth).abs() < 1e-12, "{x} {draw:?}");
    }
}
