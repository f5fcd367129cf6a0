//! How much stiffer than the plain bound a scheme can render a wall before the adversary extracts energy.

use super::passive::{SURGE, adversary};
use super::rig::{Rig, Wall};
use super::surprise;
use crate::adversary::{Goal, Rendering};

/// The result of an attack on one wall.
#[derive(Clone, Copy, Debug)]
pub struct Attack {
    /// Most energy that the adversary extracted (J).
    pub energy: f64,
    /// The family of the motion that extracted it.
    pub family: &'static str,
    /// Static stiffness rendered, as a fraction of the wall's.
    pub rendered: f64,
}

/// Attacks a wall with the adversary, in any motion or as a hand, and presses on it slowly.
pub fn attack(wall: &Wall, as_hand: bool, budget: u64, seed: u64) -> Attack {
    let mut rig = Rig::new(*wall);
    let mut adversary = adversary(wall, budget, seed);
    let first = if as_hand {
        adversary.limits.acceleration = SURGE;
        Vec::new()
    } else {
        surprise::motions(&adversary.limits, wall.delay)
    };
    let found = adversary.search(&mut rig, Goal::Most, &first);
    Attack {
        energy: found.outcome.energy,
        family: found.family.name(),
        rendered: rendered(&mut rig),
    }
}

/// Most energy that the adversary extracts from a wall, in any motion (J).
pub(crate) fn most_energy(wall: &Wall, budget: u64, seed: u64) -> f64 {
    let mut rig = Rig::new(*wall);
    let found = adversary(wall, budget, seed).search(&mut rig, Goal::Most, &[]);
    found.outcome.energy
}

/// Static stiffness rendered, as a fraction of the wall's. The hand presses for a second, to the depth at half of the
/// motors' largest force or 2 mm, and holds for two seconds with a tremor (10 Hz, 0.1 mm or a third of the depth). The
/// result is force over depth, in the last second.
fn rendered(rig: &mut Rig) -> f64 {
    let wall = *rig.wall();
    let deep = (0.5 * wall.model.max_force / wall.stiffness).min(2e-3);
    let tremor = (0.3 * deep).min(1e-4);
    rig.reset();
    let (mut exerted, mut asked) = (0.0, 0.0);
    for k in 1..=3 * wall.rate {
        let time = f64::from(k) * wall.period();
        let pressed = time.min(1.0);
        let depth = pressed * (deep + tremor * libm::sin(20.0 * core::f64::consts::PI * time));
        let force = rig.tick(-depth);
        if time > 2.0 {
            exerted += force;
            asked += wall.stiffness * depth;
        }
    }
    exerted / asked
}
