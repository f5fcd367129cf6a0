//! The port of the hand: the energy that a motion gets out of a controller through a device.

/// A controller as a hand meets it, along one axis. The hand imposes the position of the device. The controller itself
/// models the encoders.
pub trait Rendering {
    /// Resets the controller to its start, at rest at position zero.
    fn reset(&mut self);

    /// One tick with the device at `position` (m). Returns the commanded force (N), along the same axis.
    fn tick(&mut self, position: f64) -> f64;
}

/// The device between the commands and the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanism {
    /// The tick's period (s).
    pub period: f64,
    /// Viscous damping of the mechanism (N s/m).
    pub damping: f64,
    /// Coulomb friction of the mechanism (N).
    pub friction: f64,
    /// Ticks from a command to when the device holds it.
    pub delay: usize,
}

/// The outcome of a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Net energy (J): the maximum over time of the work done on the hand. At least zero, since the hand may stay at
    /// rest.
    pub energy: f64,
    /// The number of samples up to that maximum.
    pub at: usize,
    /// The maximum over time of the work done on the hand, as a fraction of the energy that the mechanism had
    /// dissipated by then. The fraction is -1 if the controller does nothing, 0 if it makes up for all losses,
    /// and positive beyond.
    pub fraction: f64,
}

impl Mechanism {
    /// Work done on the hand over a step `by` (m) under a held `force` (N): the motor's work, minus the energy that the
    /// mechanism dissipates along the cheapest path, the straight one.
    pub fn work(&self, force: f64, by: f64) -> f64 {
        force * by - self.losses(by)
    }

    fn losses(&self, by: f64) -> f64 {
        self.damping * by * by / self.period + self.friction * by.abs()
    }

    /// Leads the device along `motion` (m, one sample a tick), from rest at zero. Returns the outcome.
    pub fn play(&self, rendering: &mut impl Rendering, motion: &[f64]) -> Outcome {
        // Commands that the device does not hold yet, oldest first, in a ring over the delay.
        let mut commands = [0.0; Self::MOST_DELAY + 1];
        let delay = self.delay.min(Self::MOST_DELAY);
        rendering.reset();
        commands[0] = rendering.tick(0.0);
        let mut outcome = Outcome {
            fraction: -1.0,
            ..Outcome::default()
        };
        let (mut energy, mut lost, mut last) = (0.0, 0.0, 0.0);
        for (k, &position) in (1..).zip(motion) {
            let by = position - last;
            let held = if k > delay {
                commands[(k - 1 - delay) % (delay + 1)]
            } else {
                0.0
            };
            energy += self.work(held, by);
            lost += self.losses(by);
            if energy > outcome.energy {
                (outcome.energy, outcome.at) = (energy, k);
            }
            if energy > outcome.fraction * lost {
                outcome.fraction = energy / lost;
            }
            commands[k % (delay + 1)] = rendering.tick(position);
            last = position;
        }
        outcome
    }

    /// The longest delay that is played (ticks). Longer delays count as this one.
    pub(crate) const MOST_DELAY: usize = 15;
}
