//! Theory of a sampled wall: `F_k = -K x_k - B (x_k - x_(k-1)) / T`, held for a tick, `d` ticks late.
//!
//! **Passivity**, without friction and quantization. Over a step `D_k = x_k - x_(k-1)` the device holds `F_(k-1-d)`, so
//! a stiff hand supplies at least `sum b D_k^2 / T - F_(k-1-d) D_k` (the straight path is the cheapest). For a motion
//! at `theta` radians a tick, `x = D / (1 - e^(-i theta))`. With
//! `Re e^(-i (d + 1) theta) / (1 - e^(-i theta)) = -sin((2 d + 1) theta / 2) / (2 sin(theta / 2))`, the energy supplied
//! for each squared step, times `T`, is
//!
//! ```text
//! b - (K T / 2) sin((2 d + 1) theta / 2) / sin(theta / 2) + B cos((d + 1) theta)
//! ```
//!
//! This expression must not be negative at any `theta`. The condition is necessary, because the hand may make any
//! motion inside the wall. For `d = 0` it is `b > K T / 2 + |B|` of J. E. Colgate and G. Schenkel, "Passivity of a
//! class of sampled-data systems" (1997), which is sufficient for a unilateral wall, too. For `B = 0` and any `d` the
//! worst case is `theta = 0`: `b > (2 d + 1) K T / 2`. That condition is sufficient as well: a force of slope `K` at
//! most differs from the mean over the step by no more than `K (|D_k| / 2 + |D_(k-1)| + ... + |D_(k-d)|)`.
//!
//! **Quantization and friction.** J. J. Abbott and A. M. Okamura, "Effects of position quantization and sampling rate
//! on virtual-wall passivity" (2005): `K <= min(2 b / T, 2 f_c / delta)`, for any speed. A hand that steps by `n`
//! counts with every sample at the edge of a count gains `K n delta (n + 1) delta / 2` a step and spends
//! `b (n delta)^2 / T + f_c n delta`. With no more than `N` counts a tick, hence
//! `K <= min over n <= N of (2 b n delta / T + 2 f_c) / ((n + 1) delta)`. A hand that makes only `n - s` counts at once
//! and creeps through the rest gains `K n ((n + 1) / 2 - s) delta^2` for `b (n - s)^2 delta^2 / T + f_c n delta`. That
//! motion is cheaper if friction is low, `f_c / delta < b / T`. The measurement is compared with the smallest bound
//! over `n` and `s`.

use core::f64::consts::PI;
use nalgebra::{Matrix3, SMatrix};
use sim::{Arm, DeviceModel};

/// The parameters of wall and device that the theory needs (SI).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampled {
    /// The tick's period.
    pub period: f64,
    /// Ticks from a command to the tick in which the device holds it.
    pub delay: usize,
    /// The device's own damping.
    pub device: f64,
    /// The wall's damping.
    pub wall: f64,
}

impl Sampled {
    /// The largest passive stiffness (N/m), without friction and quantization; zero if the wall's damping alone is not
    /// passive.
    pub fn passive(&self) -> f64 {
        const FREQUENCIES: u32 = 20_000;
        let (half, late) = (self.delay as f64 + 0.5, (self.delay + 1) as f64);
        // The limit at zero, if both sines vanish.
        let mut least = 2.0 * (self.device + self.wall) / (self.period * 2.0 * half);
        for k in 1..=FREQUENCIES {
            let theta = PI * f64::from(k) / f64::from(FREQUENCIES);
            let spring = libm::sin(half * theta) / libm::sin(0.5 * theta);
            let left = self.device + self.wall * libm::cos(late * theta);
            if left <= 0.0 {
                return 0.0;
            }
            if spring > 0.0 {
                least = least.min(2.0 * left / (self.period * spring));
            }
        }
        least
    }

    /// The same without the wall's damping: `2 b / T`, divided by `2 d + 1` (N/m). Multiples refer to this bound.
    pub fn plain(&self) -> f64 {
        2.0 * self.device / (self.period * (2 * self.delay + 1) as f64)
    }

    /// The largest stable stiffness (N/m) with the device in a hand that keeps it on the wall: the first stiffness at
    /// which an eigenvalue of the discrete closed loop, exact between ticks, lies on the unit circle.
    pub fn stable(&self, plant: &Plant) -> f64 {
        let radius = |k: f64| spectral_radius(&self.closed_loop(plant, k));
        let mut high = 1.0;
        // The ratios are so small that no window of instability is skipped.
        while radius(high) < 1.0 && high < 1e8 {
            high *= 1.05;
        }
        let mut low = high / 1.05;
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if radius(middle) < 1.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }

    /// One tick of device, hand and wall. The state is position, velocity, previous position and the delayed forces.
    fn closed_loop(&self, plant: &Plant, stiffness: f64) -> Loop {
        let motion = Step::exact(plant, self.period);
        let mut matrix = Loop::zeros();
        for column in 0..STATES {
            let mut state = [0.0; STATES];
            state[column] = 1.0;
            let [x, v, last, delayed @ ..] = state;
            let command = -stiffness * x - self.wall * (x - last) / self.period;
            // Newest first.
            let [a, b, c] = delayed;
            let forces = [command, a, b, c];
            let [x_next, v_next] = motion.advance([x, v], forces[self.delay.min(3)]);
            let next = [x_next, v_next, x, command, a, b];
            matrix.set_column(column, &next.into());
        }
        matrix
    }
}

/// States of the closed loop, with three delayed forces: the longest delay.
const STATES: usize = 6;
type Loop = SMatrix<f64, STATES, STATES>;

/// The spectral radius: `|A^n|^(1/n)` for `n = 2^40`, by squaring.
fn spectral_radius(matrix: &Loop) -> f64 {
    let mut power = *matrix;
    let (mut log, mut weight) = (0.0, 1.0);
    for _ in 0..40 {
        let size = power.norm();
        if size == 0.0 {
            return 0.0;
        }
        log += weight * libm::log(size);
        power /= size;
        power *= power;
        weight *= 0.5;
    }
    libm::exp(log)
}

/// A device and the arm that holds it, about the position in which the arm presses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plant {
    /// Mass of both (kg).
    pub mass: f64,
    /// Damping of both (N s/m).
    pub damping: f64,
    /// Stiffness of the arm (N/m).
    pub stiffness: f64,
}

impl Plant {
    /// A device held by an arm.
    pub fn held(model: &DeviceModel, arm: &Arm) -> Self {
        Self {
            mass: model.mass + arm.mass,
            damping: model.damping + arm.damping,
            stiffness: arm.stiffness,
        }
    }
}

/// The motion of a plant over a tick under a constant force.
#[derive(Clone, Copy, Debug)]
pub struct Step(Matrix3<f64>);

impl Step {
    /// The exact motion: the exponential of the plant's matrix, with the force as a third, constant state.
    pub fn exact(plant: &Plant, period: f64) -> Self {
        let Plant {
            mass,
            damping,
            stiffness,
        } = *plant;
        let rate = Matrix3::new(
            0.0,
            1.0,
            0.0,
            -stiffness / mass,
            -damping / mass,
            1.0 / mass,
            0.0,
            0.0,
            0.0,
        );
        // The series converges far below rounding, because a hand moves little in a tick.
        let (mut sum, mut term) = (Matrix3::identity(), Matrix3::identity());
        for k in 1..=20 {
            term = term * rate * (period / f64::from(k));
            sum += term;
        }
        Self(sum)
    }

    /// Position and velocity a tick later.
    pub fn advance(&self, [x, v]: [f64; 2], force: f64) -> [f64; 2] {
        let m = &self.0;
        [0, 1].map(|row| m[(row, 0)] * x + m[(row, 1)] * v + m[(row, 2)] * force)
    }
}

/// Abbott and Okamura's largest passive stiffness (N/m), with friction and counts, for any speed.
pub fn any_speed(model: &DeviceModel, period: f64) -> f64 {
    let viscous = 2.0 * model.damping / period;
    viscous.min(2.0 * model.friction / model.position_step)
}

/// The largest passive stiffness (N/m) with friction and counts, for hands no faster than `speed` (m/s).
pub(crate) fn at_speed(model: &DeviceModel, period: f64, speed: f64) -> f64 {
    const PARTS: u32 = 1000;
    let count = model.position_step;
    let (viscous, friction) = (model.damping / period, model.friction / count);
    let most = (speed * period / count).floor().max(1.0) as u32;
    let mut least = f64::INFINITY;
    for n in (1..=most).map(f64::from) {
        for part in 0..PARTS {
            let s = f64::from(part) / f64::from(PARTS);
            let gain = n * (0.5 * (n + 1.0) - s);
            if gain > 0.0 {
                let jump = n - s;
                least = least.min((viscous * jump * jump + friction * n) / gain);
            }
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(wall: f64, delay: usize) -> Sampled {
        Sampled {
            period: 1e-3,
            delay,
            device: 0.5,
            wall,
        }
    }

    #[test]
    fn without_delay_the_bound_is_that_of_colgate_and_schenkel() {
        for wall in [-0.3, 0.0, 0.2, 0.45] {
            let expected = 2.0 * (0.5 - f64::abs(wall)) / 1e-3;
            let found = sampled(wall, 0).passive();
            // The scan meets both ends of the range of frequencies.
            assert!((found / expected - 1.0).abs() < 1e-12, "{wall} {found}");
        }
        assert_eq!(sampled(0.6, 0).passive(), 0.0);
    }

    #[test]
    fn a_tick_of_delay_divides_the_bound_by_three() {
        for (delay, expected) in [(1, 1000.0 / 3.0), (3, 1000.0 / 7.0)] {
            assert!((sampled(0.0, delay).passive() / expected - 1.0).abs() < 1e-12);
            assert!((sampled(0.0, delay).plain() / expected - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn stability_without_a_hand_is_known_in_closed_form() {
        // A free mass m with damping c under a sampled spring: with E = e^(-c T / m), Jury's condition on
        // z^2 - (1 + E - K p) z + E + K q, where p and q come from the exact step, is E + K q < 1.
        let plant = Plant {
            mass: 0.2,
            damping: 3.0,
            stiffness: 0.0,
        };
        let (t, ratio) = (1e-3_f64, 0.2 / 3.0);
        let e = (-t / ratio).exp();
        let q = (ratio / 3.0) * (1.0 - e) - t * e / 3.0;
        let wall = sampled(0.0, 0);
        let expected = (1.0 - e) / q;
        // The radius is accurate to log(C) / 2^40, some 1e-11, and changes by 0.007 of the relative change of the
        // stiffness.
        assert!((wall.stable(&plant) / expected - 1.0).abs() < 1e-8);
        // The result is near 2 c / T, as for a mass that hardly moves in a tick.
        assert!((expected / 6000.0 - 1.0).abs() < 0.01, "{expected}");
    }

    #[test]
    fn limits_of_speed_and_friction_are_those_known() {
        let model = DeviceModel {
            mass: 0.1,
            damping: 0.5,
            friction: 0.3,
            position_step: 0.03e-3,
            max_force: 8.0,
            workspace_radius: 0.1,
            driver_stiffness: 1000.0,
            driver_damping: 1.0,
            rate_hz: 1000,
            output_delay: 0.0,
            axes: None,
            rotation: None,
        };
        // With much friction, the bound falls towards 2 b / T with the speed, as (2 b n d / T + 2 f) / ((n + 1) d).
        let n = 33.0 * 0.03e-3;
        let expected = (2.0 * 0.5 * n / 1e-3 + 0.6) / (n + 0.03e-3);
        assert!((at_speed(&model, 1e-3, 1.0) / expected - 1.0).abs() < 1e-12);
        assert_eq!(any_speed(&model, 1e-3), 1000.0);
        // With little friction, the bound is twice the geometric mean of b / T and f / d, which exceeds twice the
        // smaller.
        let slippery = DeviceModel {
            friction: 0.003,
            ..model
        };
        let expected = 2.0 * (0.5 / 1e-3 * 0.003 / 0.03e-3_f64).sqrt();
        // The fractions of a step are multiples of a thousandth.
        let found = at_speed(&slippery, 1e-3, 1.0);
        assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
        assert!(found > any_speed(&slippery, 1e-3));
    }
}
