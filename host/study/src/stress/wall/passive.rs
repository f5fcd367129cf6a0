//! The measured boundary of passivity: the stiffness from which on the adversary extracts energy.

use super::rig::{Rig, Wall};
use crate::adversary::{Adversary, Goal, Limits, Rendering, Start, best_among};

/// Fastest hand (m/s).
pub const SPEED: f64 = 0.5;
/// Largest acceleration of an adversary that moves as a hand (m/s^2): five times gravity.
pub(crate) const SURGE: f64 = 50.0;
/// Deepest position (m), if the motors allow it.
const DEEPEST: f64 = 5e-3;
/// Most ticks of a motion.
const LONGEST: usize = 2000;
/// Ratio of stiffnesses at which the bisection ends.
const CLOSE: f64 = 1.01;

/// An adversary for a wall that may spend `budget` ticks.
pub fn adversary(wall: &Wall, budget: u64, seed: u64) -> Adversary {
    Adversary {
        port: wall.port(),
        limits: Limits {
            period: wall.period(),
            deepest: DEEPEST.min(wall.model.max_force / wall.stiffness),
            speed: SPEED,
            acceleration: f64::INFINITY,
            longest: LONGEST,
            count: wall.count(),
        },
        budget,
        seed,
    }
}

/// The measured boundary.
#[derive(Clone, Debug)]
pub struct Boundary {
    /// The smallest stiffness at which energy was extracted (N/m).
    pub stiffness: f64,
    /// The family of the motion that extracted it.
    pub family: &'static str,
    /// Ticks spent.
    pub spent: u64,
}

/// Bisects the range of stiffness until the boundary is known to a hundredth. The motion that extracted energy from a
/// stiffer wall is tried first on the next wall. None if no stiffness gave energy.
pub fn boundary(wall: &Wall, start: f64, budget: u64, seed: u64) -> Option<Boundary> {
    let mut spent = 0;
    let mut first: Vec<Start> = Vec::new();
    let mut attack = |stiffness: f64| {
        let wall = Wall { stiffness, ..*wall };
        let adversary = adversary(&wall, budget, seed);
        let mut rig = Rig::new(wall);
        let mut seeds = first.clone();
        if wall.delay == 0 && wall.damping == 0.0 {
            seeds.push(planned(&mut rig, &adversary).into());
        }
        let found = adversary.search(&mut rig, Goal::MoreThan(0.0), &seeds);
        spent += found.spent;
        let won = found.outcome.energy > 0.0;
        if won {
            first.clear();
        }
        if first.len() < 6 {
            first.push(found.start);
        }
        won.then(|| found.family.name())
    };
    let mut high = start;
    let mut family = None;
    for _ in 0..14 {
        family = attack(high);
        if family.is_some() {
            break;
        }
        high *= 2.0;
    }
    let mut family = family?;
    let mut low = high / 2.0;
    while let Some(lower) = attack(low) {
        (high, low, family) = (low, low / 2.0, lower);
        if low < 1e-6 * start {
            break;
        }
    }
    while high > CLOSE * low {
        let middle = (high * low).sqrt();
        if let Some(lower) = attack(middle) {
            (high, family) = (middle, lower);
        } else {
            low = middle;
        }
    }
    Some(Boundary {
        stiffness: high,
        family,
        spent,
    })
}

/// The best motion over a set of positions, by dynamic programming, for a force that is a function of the position
/// alone. The positions lie on both sides of the edge of every count, or are evenly spaced if there are no counts.
/// The force at each position is that of the controller at rest there.
fn planned(rig: &mut Rig, adversary: &Adversary) -> Vec<f64> {
    const TICKS: usize = 120;
    const MOST_PLACES: usize = 300;
    let Limits {
        deepest,
        period,
        speed,
        count,
        ..
    } = adversary.limits;
    let step = speed * period;
    let mut places = vec![0.0];
    if count > 0.0 {
        let hair = 1e-3 * count;
        let counts = ((deepest / count) as usize).min(MOST_PLACES / 2);
        for edge in (0..counts).map(|k| (k as f64 + 0.5) * count) {
            places.extend([-(edge - hair), -(edge + hair)]);
        }
    } else {
        let spacing = (step / 4.0).min(deepest / 20.0);
        let number = ((deepest / spacing) as usize).min(MOST_PLACES);
        places.extend((1..=number).map(|k| -spacing * k as f64));
    }
    let mut forces = Vec::with_capacity(places.len());
    for place in &places {
        rig.reset();
        let mut force = 0.0;
        for _ in 0..3 {
            force = rig.tick(*place);
        }
        forces.push(force);
    }
    best_among(&adversary.port, &places, &forces, step, TICKS).1
}
