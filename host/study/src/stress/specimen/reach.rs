//! How far the hands of a cell go, and what they feel on the way: a slow march with the reference's bodies.

use super::hands::{Moves, Step};
use super::{Draw, Task};
use crate::StudyError;
use crate::chance::Chance;
use crate::stress::scene::reference::Bodies;
use crate::stress::scene::trial::frames;
use host::scene::LoadedScene;
use physics::{HandlePose, Vec3};
use rt_core::MAX_DEVICES;
use rt_core::device_frame::DeviceFrame;

/// Number of places of the march, and the ratio of the displacement of one place to that of the place before. A body that is
/// far stiffer than its device ends the march after a thousandth of the largest displacement.
const PLACES: i32 = 24;
const GROWTH: f64 = 1.35;
/// Steps at each place, and the length of a step (s): so long that the bodies come to rest.
const SETTLES: usize = 3;
const STEP: f64 = 0.02;
/// The largest displacement of a device, as a fraction of the radius of its workspace.
const WORKSPACE: f64 = 0.5;
/// The largest force of a device in a rub, as a fraction of its largest force, and the largest displacement across as a
/// fraction of the depth.
const RUB: [f64; 2] = [0.75, 0.5];

/// The march of a cell.
struct March {
    bodies: Bodies,
    frames: Vec<DeviceFrame>,
    limits: Vec<f64>,
}

impl March {
    /// Holds the body with the hands at these displacements (m, axes of the scene), and returns what they feel.
    fn hold(&mut self, fraction: f64, displaced: &[Vec3]) -> Result<Step, StudyError> {
        let frames = &self.frames;
        for _ in 0..SETTLES {
            self.bodies.step(STEP, |device| {
                HandlePose::at(frames[device].origin + displaced[device])
            })?;
        }
        let wrenches = self.bodies.exerted().0;
        let each = self.frames.iter().zip(displaced).zip(wrenches);
        let hands = each.map(|((frame, displaced), wrench)| {
            let place = displaced / frame.motion_scale;
            [place, frame.to_device(&wrench).force]
        });
        Ok(Step {
            fraction,
            hands: hands.collect(),
        })
    }

    /// The largest force of a hand beyond those at rest, as a fraction of the largest force of its device.
    fn load(&self, step: &Step) -> f64 {
        let each = step.hands.iter().zip(&self.limits);
        each.map(|([_, force], limit)| force.norm() / limit)
            .fold(0.0, f64::max)
    }
}

/// Marches with the hands of `draw` on the body of `loaded`, at most by `most` (m).
pub(super) fn march(loaded: &LoadedScene, draw: &Draw, most: f64) -> Result<Moves, StudyError> {
    let scales = draw.hands.iter().enumerate();
    let most = scales.fold(most, |most, (index, hand)| {
        most.min(WORKSPACE * draw.model(index).workspace_radius * hand.scale)
    });
    let mut march = March {
        bodies: Bodies::new(loaded)?,
        frames: frames(loaded)?,
        limits: loaded.models.iter().map(|model| model.max_force).collect(),
    };
    let reach = |fraction: f64| -> Vec<Vec3> {
        let hands = march_hands(draw);
        hands
            .map(|(along, share)| along * (share * most * fraction))
            .collect()
    };
    let rest = march.hold(0.0, &reach(0.0))?;
    let mut steps = vec![rest];
    for place in 0..PLACES {
        let fraction = GROWTH.powi(place + 1 - PLACES);
        // A body that cannot be moved so far ends the march, too.
        let Ok(step) = march.hold(fraction, &reach(fraction)) else {
            break;
        };
        let (before, load) = (march.load(&steps[steps.len() - 1]), march.load(&step));
        if load > draw.force {
            // To the place at which the force is the drawn one.
            let last = steps[steps.len() - 1].fraction;
            let part = ((draw.force - before) / (load - before)).clamp(0.1, 1.0);
            let fraction = last + (fraction - last) * part;
            steps.push(march.hold(fraction, &reach(fraction))?);
            break;
        }
        steps.push(step);
    }
    let end = steps[steps.len() - 1].clone();
    let mut across = vec![[Vec3::zeros(); 2]; draw.hands.len()];
    if draw.task == Task::Rub {
        let hold = reach(end.fraction);
        let sideways: Vec<_> = march_hands(draw)
            .enumerate()
            .map(|(index, (along, _))| sideways(draw, index, along) * hold[index].norm())
            .collect();
        for place in (0..6).rev() {
            let width = RUB[1] * GROWTH.powi(-2 * place);
            let displaced: Vec<_> = hold
                .iter()
                .zip(&sideways)
                .map(|(hold, side)| hold + side * width)
                .collect();
            let Ok(step) = march.hold(end.fraction, &displaced) else {
                break;
            };
            if march.load(&step) > RUB[0] {
                break;
            }
            let each = step.hands.iter().zip(&end.hands);
            let each = each.map(|([place, force], [held, holds])| [place - held, force - holds]);
            across = each.collect();
        }
    }
    Ok(Moves { steps, across })
}

/// The direction and the share of each hand.
fn march_hands(draw: &Draw) -> impl Iterator<Item = (Vec3, f64)> + '_ {
    let hands = draw.hands.iter().take(MAX_DEVICES);
    hands.map(|hand| (Vec3::from(hand.direction), hand.share))
}

/// A direction across `along` (unit vector).
fn sideways(draw: &Draw, index: usize, along: Vec3) -> Vec3 {
    let chance = Chance::new((draw.haste * 1e9) as u64, index as u64).of("across");
    let any = Vec3::from_fn(|axis, _| chance.between(axis as u64, -1.0, 1.0));
    let across = any - along * any.dot(&along);
    across.try_normalize(1e-6).unwrap_or_default()
}
