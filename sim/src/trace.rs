//! A hand that traces a contour: it presses a surface that it does not see, and moves along it.
//!
//! The hand knows the pose of its handle and the force that the device renders. It takes the direction of this force, over its reaction
//! time, for the normal of the surface. It presses against this force, and moves at right angles to it, towards its heading. While it
//! feels less than 0.3 of the force with which it means to press, it goes towards its first direction, and the less along the
//! surface: it begins so, and also finds a surface again that it lost.
//!
//! The aim of the arm's spring moves, and nothing else does. The work of the muscles is thus in the account of the device's motion.

use rt_core::Vec3;

/// The time constant of what the hand feels, and in which it corrects its force (s): the reaction time to a touch.
const REACTION: f64 = 0.1;
/// The fraction of its force from which on the hand goes by what it feels alone.
const TOUCHES: f64 = 0.3;
/// The part of the heading along the surface (1) below which the hand slows down: where the surface stands across its way, it rests.
const ACROSS: f64 = 0.1;

/// A contour that a hand traces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trace {
    /// Start (s).
    pub from: f64,
    /// End (s).
    pub to: f64,
    /// Where the surface is (device axes); the length has no effect.
    pub direction: Vec3,
    /// Where the hand goes on, as far as the surface lets it (device axes); the length has no effect.
    pub heading: Vec3,
    /// The force with which the hand presses (N).
    pub force: f64,
    /// Speed along the surface, and at most towards it (m/s).
    pub speed: f64,
}

/// What a hand feels of its device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Felt {
    /// Place of the handle from the start (m).
    pub place: Vec3,
    /// Its velocity (m/s).
    pub velocity: Vec3,
    /// The force that the device renders (N).
    pub force: Vec3,
}

/// What a hand that traces remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tracing {
    /// The force (N), and the speed of the handle against it (m/s), over the reaction time.
    force: Vec3,
    speed: f64,
    /// The direction in which the hand presses; zero before the first step.
    into: Vec3,
}

impl Tracing {
    /// The velocity (m/s) at which the aim `aim` (m from the start) of an arm of this stiffness (N/m) moves, after a further time `dt` (s).
    pub fn step(
        &mut self,
        trace: &Trace,
        stiffness: f64,
        aim: &Vec3,
        felt: &Felt,
        dt: f64,
    ) -> Vec3 {
        let unit = |vector: &Vec3| vector.try_normalize(0.0);
        let lead = trace.force / stiffness;
        let Some(first) = unit(&trace.direction).filter(|_| lead.is_finite()) else {
            return Vec3::zeros();
        };
        let share = dt / (REACTION + dt);
        self.force += (felt.force - self.force) * share;
        let (feels, touches) = (self.force.norm(), TOUCHES * trace.force);
        let into = unit(&(first * (touches - feels).max(0.0) - self.force)).unwrap_or(first);
        self.speed += (felt.velocity.dot(&into) - self.speed) * share;
        let before = core::mem::replace(&mut self.into, into);
        let turned = if before == Vec3::zeros() {
            before
        } else {
            into - before
        };
        let heading = unit(&trace.heading).unwrap_or_default();
        let along = heading - into * into.dot(&heading);
        let along = along / along.norm().max(ACROSS) * (feels / touches).min(1.0);
        // The handle's own motion, and the turn of the arm about it, are no errors of the force.
        let lacks = lead - (aim - felt.place).dot(&into);
        let towards = (self.speed + lacks / REACTION).clamp(-trace.speed, trace.speed);
        along * trace.speed + into * towards + turned * (lead / dt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Arm, Hand, SimDevice, Trajectory};
    use devices::DeviceModel;
    use proptest::prelude::*;
    use rt_core::{Device, Wrench};

    const MS: u64 = 1_000_000;
    const DOWN: Vec3 = Vec3::new(0.0, 0.0, -1.0);

    /// A sphere with its top below the start, as a device renders it: place of its centre (m), radius (m), friction (1).
    struct Ball {
        centre: Vec3,
        radius: f64,
        friction: f64,
    }

    impl Ball {
        fn below(gap: f64, radius: f64, friction: f64) -> Self {
            let centre = DOWN * (radius + gap);
            Self {
                centre,
                radius,
                friction,
            }
        }

        /// The normal at a place, and the force on a handle that is there (N).
        fn force(&self, place: &Vec3, velocity: &Vec3) -> (Vec3, Vec3) {
            let normal = (place - self.centre).normalize();
            let depth = self.radius - (place - self.centre).norm();
            let pressed = (1500.0 * depth - 2.0 * velocity.dot(&normal)).max(0.0);
            let pressed = if depth > 0.0 { pressed } else { 0.0 };
            let slides = velocity - normal * velocity.dot(&normal);
            let rubs = slides / slides.norm().max(2e-3) * self.friction;
            (normal, (normal - rubs) * pressed)
        }
    }

    fn traces(trace: Trace, arm: Arm) -> SimDevice {
        let hand = Hand::new(Trajectory::still())
            .with_arm(arm)
            .with_traces(vec![trace]);
        SimDevice::new(DeviceModel::named("omega3").unwrap(), Some(hand), 1e-3).unwrap()
    }

    /// The places of the handle and the rendered forces on a ball, in each millisecond from zero to `end` (s), in which the ball is there
    /// while `is_there` says so.
    fn run(
        device: &mut SimDevice,
        ball: &Ball,
        end: f64,
        is_there: impl Fn(f64) -> bool,
    ) -> Vec<(Vec3, Vec3)> {
        let each = (0..(end * 1e3) as u64).map(|ms| {
            let state = device.read(ms * MS).unwrap();
            let (_, force) = ball.force(&state.pose.position, &state.twist.linear);
            let force = force * f64::from(u8::from(is_there(ms as f64 * 1e-3)));
            let wrench = Wrench {
                force,
                moment: Vec3::zeros(),
            };
            device.write(ms * MS, &wrench).unwrap();
            (device.position(), force)
        });
        each.collect()
    }

    fn typical(trace_force: f64, speed: f64, heading: Vec3) -> Trace {
        Trace {
            from: 0.1,
            to: 20.0,
            direction: DOWN,
            heading,
            force: trace_force,
            speed,
        }
    }

    fn arm(stiffness: f64) -> Arm {
        Arm {
            mass: 0.5,
            damping: 12.0,
            stiffness,
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// On a sphere of any size the hand keeps its force and goes on at its speed. Where the sphere stands across the heading, the hand has
        /// come to its end. The hand presses against the whole force, which friction turns from the normal, and a part of its own force is
        /// for the friction of the device. The turn of the normal within the reaction time is a tenth of a radian, and 8 % are left to it.
        #[test]
        fn a_sphere_is_traced_with_the_force_and_at_the_speed_of_the_hand(
            force in 0.5..2.0_f64,
            speed in 0.01..0.03_f64,
            stiffness in 200.0..800.0_f64,
            radius in 0.05..0.1_f64,
            friction in 0.0..0.4_f64,
            azimuth in 0.0..core::f64::consts::TAU,
        ) {
            let heading = Vec3::new(azimuth.cos(), azimuth.sin(), 0.0);
            let mut device = traces(typical(force, speed, heading), arm(stiffness));
            let ball = Ball::below(0.004, radius, friction);
            let found = run(&mut device, &ball, 6.0, |_| true);
            // The account of the device has all work of the muscles.
            prop_assert!(device.energy().residual().abs() < 1e-12);
            let normals = found.iter().map(|(place, _)| (place - ball.centre).normalize());
            let normals: Vec<_> = normals.collect();
            let began = found.iter().position(|(_, force)| force.norm() > 0.0);
            let mut seen = 0;
            let tilt = friction.atan();
            let lost = device.model().friction * tilt.sin() / force;
            let least = tilt.cos() * (1.0 - lost) - 0.08;
            // The aim goes into the ball at the speed, too.
            let settled = began.unwrap() + 600 + (1e3 * force / stiffness / speed) as usize;
            for at in settled..6000 {
                if normals[at].dot(&heading) > 0.8 {
                    break;
                }
                seen += 1;
                let pressed = found[at].1.dot(&normals[at]) / force;
                prop_assert!((least..1.08).contains(&pressed), "{at}: {pressed}");
                let way = radius * normals[at].angle(&normals[at - 100]) / 0.1 / speed;
                prop_assert!((0.85..1.2).contains(&way), "{at}: {way}");
                prop_assert!(found[at].0.dot(&heading.cross(&DOWN)).abs() < 1e-3);
            }
            prop_assert!(seen > 100, "{seen}");
        }
    }

    /// A ball that vanishes and comes back, as a loss of the contact: the hand goes down at its speed at most, and presses again.
    #[test]
    fn a_hand_that_loses_the_surface_goes_down_until_it_finds_it() {
        let mut device = traces(typical(1.0, 0.02, Vec3::x()), arm(400.0));
        let ball = Ball::below(0.004, 0.08, 0.2);
        let found = run(&mut device, &ball, 5.0, |time| !(1.5..1.8).contains(&time));
        let fallen = found[1500].0.z - found[1799].0.z;
        // Its spring was stretched by 2.5 mm.
        assert!((0.002..0.0025 + 0.02 * 0.3).contains(&fallen), "{fallen}");
        let normal = |at: usize| (found[at].0 - ball.centre).normalize();
        for at in [1400, 3000, 4000] {
            let pressed = found[at].1.dot(&normal(at));
            assert!((0.85..1.1).contains(&pressed), "{at}: {pressed}");
        }
        assert!(normal(4000).angle(&normal(3000)) * 0.08 > 0.015);
    }

    /// Two contours one after the other: the aim never jumps, and stays where the first one left it.
    #[test]
    fn a_second_contour_begins_where_the_first_one_ended() {
        let first = Trace {
            to: 1.5,
            ..typical(1.0, 0.02, Vec3::x())
        };
        let second = Trace {
            from: 2.0,
            to: 3.0,
            heading: Vec3::y(),
            ..first
        };
        let hand = Hand::new(Trajectory::still())
            .with_arm(arm(400.0))
            .with_traces(vec![first, second]);
        let model = DeviceModel::named("omega3").unwrap();
        let mut device = SimDevice::new(model, Some(hand), 1e-3).unwrap();
        let ball = Ball::below(0.004, 0.1, 0.1);
        let found = run(&mut device, &ball, 4.0, |_| true);
        let moved = |from: usize, to: usize| found[to].0 - found[from].0;
        assert!(moved(0, 1500).x > 0.015 && moved(0, 1500).y.abs() < 1e-4);
        assert!(moved(1700, 2000).norm() < 2e-3 && moved(3200, 3999).norm() < 2e-3);
        assert!(moved(2000, 3000).y > 0.012);
        // 30 mm/s: the speed along the surface, and that towards it.
        let fastest = (1..4000)
            .map(|at| moved(at - 1, at).norm())
            .fold(0.0, f64::max);
        assert!(fastest < 3e-5, "{fastest}");
    }

    #[test]
    fn without_a_force_or_a_direction_to_go_by_the_aim_rests() {
        let felt = Felt {
            place: Vec3::zeros(),
            velocity: Vec3::zeros(),
            force: Vec3::zeros(),
        };
        let nowhere = Trace {
            direction: Vec3::zeros(),
            ..typical(1.0, 0.02, Vec3::x())
        };
        for (trace, stiffness) in [(nowhere, 300.0), (typical(1.0, 0.02, Vec3::x()), 0.0)] {
            let rate = Tracing::default().step(&trace, stiffness, &Vec3::zeros(), &felt, 1e-3);
            assert_eq!(rate, Vec3::zeros());
        }
    }
}
