//! The hand's port: what a motion gets out of a controller through a device.

/// A controller as a hand meets it, along one axis. The device is where the hand leads it, and what the encoders
/// make of that is the controller's business.
pub trait Rendering {
    /// Back to the start, at rest at position zero.
    fn reset(&mut self);

    /// One tick with the device at `position` (m): the force commanded (N), along the same axis.
    fn tick(&mut self, position: f64) -> f64;
}

/// What lies between the commands and the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Port {
    /// The tick's period (s).
    pub period: f64,
    /// Viscous damping of the mechanism (N s/m).
    pub damping: f64,
    /// Coulomb friction of the mechanism (N).
    pub friction: f64,
    /// Ticks between a command and when the device holds it.
    pub delay: usize,
}

/// What a motion brought.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Net energy (J): the largest over time of the work done on the hand; zero at least, for it may stay at rest.
    pub energy: f64,
    /// When that was: the number of samples up to it.
    pub at: usize,
    /// The largest over time of the work done on the hand, as a fraction of what the mechanism dissipated till then:
    /// from -1, where the controller does nothing, to 0, where it makes up for all losses, and beyond.
    pub fraction: f64,
}

impl Port {
    /// Work done on the hand over a step `by` (m) under a held `force` (N): the motor's, less what the mechanism
    /// dissipates on the cheapest way, the straight one.
    pub fn work(&self, force: f64, by: f64) -> f64 {
        force * by - self.losses(by)
    }

    fn losses(&self, by: f64) -> f64 {
        self.damping * by * by / self.period + self.friction * by.abs()
    }

    /// Leads the device along `motion` (m, one sample a tick), from rest at zero.
    pub fn play(&self, rendering: &mut impl Rendering, motion: &[f64]) -> Outcome {
        // Commands that the device does not hold yet, oldest first; a ring over the delay.
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

    /// The longest delay that is played (ticks); longer ones count as this.
    pub const MOST_DELAY: usize = 15;
}
