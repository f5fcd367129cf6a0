//! How much stiffer than the plain bound a scheme renders a wall before energy comes out of it.

use super::passive::{SURGE, adversary};
use super::rig::{Rig, Wall};
use sim::adversary::{Goal, Rendering};

/// What came of one wall.
#[derive(Clone, Copy, Debug)]
pub struct Attack {
    /// Most energy that the adversary got out (J).
    pub energy: f64,
    /// The family of the motion that got it.
    pub family: &'static str,
    /// Static stiffness rendered, as a share of what was asked.
    pub rendered: f64,
}

/// Sends the adversary at a wall, in any motion or as a hand, and presses on it slowly.
pub fn attack(wall: &Wall, as_hand: bool, budget: u64, seed: u64) -> Attack {
    let mut rig = Rig::new(*wall);
    let mut adversary = adversary(wall, budget, seed);
    if as_hand {
        adversary.limits.acceleration = SURGE;
    }
    let found = adversary.search(&mut rig, Goal::Most, &[]);
    Attack {
        energy: found.outcome.energy,
        family: found.family.name(),
        rendered: rendered(&mut rig),
    }
}

/// Most energy that the adversary gets out of a wall, in any motion (J).
pub fn most_energy(wall: &Wall, budget: u64, seed: u64) -> f64 {
    let mut rig = Rig::new(*wall);
    let found = adversary(wall, budget, seed).search(&mut rig, Goal::Most, &[]);
    found.outcome.energy
}

/// Static stiffness as a share of what was asked: pressed for a second, to half of what the motors can hold or 2 mm,
/// and held for another.
fn rendered(rig: &mut Rig) -> f64 {
    let wall = *rig.wall();
    let count = wall.count();
    let mut deep = (0.5 * wall.model.max_force / wall.stiffness).min(2e-3);
    if count > 0.0 {
        // In the middle of a count, so that what is asked is known.
        deep = (deep / count).round().max(1.0) * count;
    }
    rig.reset();
    let second = wall.rate;
    let mut force = 0.0;
    for k in 1..=2 * second {
        let share = f64::from(k.min(second)) / f64::from(second);
        force = rig.tick(-deep * share);
    }
    force / (wall.stiffness * deep)
}
