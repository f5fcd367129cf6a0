//! The energy account of a simulated device, and the certificate that judges a controller.
//!
//! A coupling is judged by its effect on the person, and so by the energy at the port between device and hand. That
//! energy is the work of the motors, minus the losses of the mechanism, minus the energy of the mechanism's own mass
//! ([`MechanicalEnergy::on_hand`]). It is integrated between ticks from the true motion. The controller's own account,
//! which relies on encoder counts, is not used. [`NetEnergy`] keeps the maximum over time of this energy, summed over
//! all devices on one body. A maximum above zero means that the body gave back energy that no hand had supplied.

/// Sources and sinks of the energy since the start (J). Works and losses are sums over all steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MechanicalEnergy {
    /// Work of the motors on device and hand, at the motors' port. Negative if the hand does work on the motors.
    pub motor_work: f64,
    /// Work of the muscles, which move the aim against the arm's spring and damper.
    pub hand_work: f64,
    /// Energy lost to the mechanism's Coulomb friction; never decreases.
    pub friction_loss: f64,
    /// Energy lost to the mechanism's viscous damping; never decreases.
    pub damping_loss: f64,
    /// Energy lost to the arm's damping; never decreases.
    pub arm_loss: f64,
    /// Present kinetic energy of device and arm.
    pub kinetic: f64,
    /// The part of `kinetic` in the device's own moving mass.
    pub device_kinetic: f64,
    /// Present energy of the arm's spring.
    pub spring: f64,
    /// Kinetic and spring energy at the start.
    pub initial: f64,
    /// The part of `initial` in the device's own moving mass.
    pub device_initial: f64,
}

impl MechanicalEnergy {
    /// All energy supplied so far (J): works and initial energy.
    pub fn supplied(&self) -> f64 {
        self.motor_work + self.hand_work + self.initial
    }

    /// All energy lost so far (J).
    pub fn lost(&self) -> f64 {
        self.friction_loss + self.damping_loss + self.arm_loss
    }

    /// All energy stored now (J).
    pub fn stored(&self) -> f64 {
        self.kinetic + self.spring
    }

    /// The energy supplied, minus the energy lost, minus the energy stored (J). This difference is zero except for
    /// rounding.
    pub fn residual(&self) -> f64 {
        self.supplied() - self.lost() - self.stored()
    }

    /// Work that the device did on the hand so far (J), at the port between the two. This work is that of the motors,
    /// minus the losses to the mechanism's damping and friction, minus the gain of the mechanism's own mass. Negative
    /// if the hand worked on the device.
    pub fn on_hand(&self) -> f64 {
        self.motor_work - self.damping_loss - self.friction_loss - self.device_kinetic
            + self.device_initial
    }
}

impl core::ops::Add for MechanicalEnergy {
    type Output = Self;

    /// The account of two motions together, such as a handle's translation and its rotation.
    fn add(self, other: Self) -> Self {
        Self {
            motor_work: self.motor_work + other.motor_work,
            hand_work: self.hand_work + other.hand_work,
            friction_loss: self.friction_loss + other.friction_loss,
            damping_loss: self.damping_loss + other.damping_loss,
            arm_loss: self.arm_loss + other.arm_loss,
            kinetic: self.kinetic + other.kinetic,
            device_kinetic: self.device_kinetic + other.device_kinetic,
            spring: self.spring + other.spring,
            initial: self.initial + other.initial,
            device_initial: self.device_initial + other.device_initial,
        }
    }
}

/// The net energy that the devices on one body have given to their hands: the maximum over time of the work on the
/// hands, minus the energy stored at the start.
///
/// ```
/// # use sim::NetEnergy;
/// let mut net = NetEnergy::new(0.5);
/// for (left, right) in [(-0.1, 0.2), (0.4, 0.3), (0.1, 0.1)] {
///     net.observe([left, right]);
/// }
/// // 0.7 J came out of a body that held 0.5 J: 0.2 J came from nowhere.
/// assert!((net.largest() - 0.2).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetEnergy {
    stored: f64,
    now: f64,
    largest: f64,
}

impl NetEnergy {
    /// The account at the start, for a body that may give back `stored` (J: elastic, kinetic, gravity).
    pub fn new(stored: f64) -> Self {
        Self {
            stored,
            now: -stored,
            largest: -stored,
        }
    }

    /// Takes the work on the hand of each device so far (J), as [`MechanicalEnergy::on_hand`] gives it. Call this once a
    /// tick. A sum that is NaN counts as infinite, because such a run cannot be trusted.
    pub fn observe(&mut self, on_hands: impl IntoIterator<Item = f64>) {
        let sum: f64 = on_hands.into_iter().sum();
        self.now = if sum.is_nan() {
            f64::INFINITY
        } else {
            sum - self.stored
        };
        self.largest = self.largest.max(self.now);
    }

    /// Work on the hands so far, minus the energy stored at the start (J).
    pub fn now(&self) -> f64 {
        self.now
    }

    /// The maximum over time of that difference (J): above zero, energy was generated.
    pub fn largest(&self) -> f64 {
        self.largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn net_energy_is_the_largest_sum_ever_less_the_store() {
        let mut net = NetEnergy::new(0.1);
        assert_eq!((net.now(), net.largest()), (-0.1, -0.1));
        net.observe([0.25, 0.25]);
        assert_eq!(net.largest(), 0.4);
        net.observe([-1.0, 0.5]);
        // Energy that is put back later does not reduce the maximum.
        assert_eq!((net.now(), net.largest()), (-0.6, 0.4));
        net.observe([f64::NAN, 0.0]);
        assert_eq!(net.largest(), f64::INFINITY);
    }
}
