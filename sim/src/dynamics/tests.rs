mod stick_slip;

use super::*;
use proptest::prelude::*;

fn along(x: f64) -> Vec3 {
    // An oblique direction, so that no axis is special.
    Vec3::new(2.0, -3.0, 6.0) * (x / 7.0)
}

#[test]
fn a_free_mass_under_a_constant_force_follows_the_parabola() {
    let mut body = Dynamics::new(0.15, 0.0, 0.0, Arm::NONE, Vec3::zeros());
    let force = along(0.3);
    for _ in 0..20_000 {
        body.step(50e-6, &force, &Vec3::zeros());
    }
    // The midpoint rule is exact here; 20,000 roundings at one metre per second.
    assert!((body.position() - force / (2.0 * 0.15)).norm() < 1e-11);
    assert!((body.velocity() - force / 0.15).norm() < 1e-11);
}

/// Largest distance over a second from the closed-form response to a step of force on a held device.
fn oscillator_error(steps_per_ms: u32) -> f64 {
    let (mass, damping) = (0.15, 0.5);
    let arm = Arm::TYPICAL;
    let (m, b, k) = (mass + arm.mass, damping + arm.damping, arm.stiffness);
    let natural = (k / m).sqrt();
    let ratio = b / (2.0 * (k * m).sqrt());
    let damped = natural * (1.0 - ratio * ratio).sqrt();
    let mut body = Dynamics::new(mass, damping, 0.0, arm, Vec3::zeros());
    let force = along(2.0);
    let h = 1e-3 / f64::from(steps_per_ms);
    let mut worst: f64 = 0.0;
    for n in 1..=1000 * steps_per_ms {
        body.step(h, &force, &Vec3::zeros());
        let t = h * f64::from(n);
        let (sin, cos) = libm::sincos(damped * t);
        let decay = libm::exp(-ratio * natural * t);
        let fraction = 1.0 - decay * (cos + ratio * natural / damped * sin);
        worst = worst.max((body.position() - force * (fraction / k)).norm());
    }
    worst
}

#[test]
fn a_held_device_follows_the_closed_form_to_second_order() {
    let errors = [1, 2, 4, 8].map(oscillator_error);
    for pair in errors.windows(2) {
        let order = libm::log2(pair[0] / pair[1]);
        // Second order; the next term is a relative (omega h)^2 = 2e-4 at the coarsest step.
        assert!((order - 2.0).abs() < 0.01, "{order} {errors:?}");
    }
    // (omega h)^2 / 12 * omega t * amplitude = 1.6e-5 * 13.8 * 15 mm = 3.3 um before damping at 1 ms; a 400th of that
    // at 20 steps per millisecond, far below an encoder count.
    assert!(oscillator_error(20) < 10e-9);
}

#[test]
fn coulomb_friction_brings_it_to_rest_at_the_analytic_place_and_time() {
    let (mass, friction, speed) = (0.2, 0.3, 0.4);
    let mut body = Dynamics::new(mass, 0.0, friction, Arm::NONE, Vec3::zeros());
    body.push(along(speed));
    let h = 50e-6;
    let deceleration = friction / mass;
    let rest = speed / deceleration;
    for n in 1..=20_000_u32 {
        body.step(h, &Vec3::zeros(), &Vec3::zeros());
        let t = h * f64::from(n);
        if t < rest - h {
            // Exact for constant force: 5,000 roundings at 0.4 m/s.
            assert!((body.velocity() - along(speed - deceleration * t)).norm() < 1e-12);
        } else if t > rest + 2.0 * h {
            assert_eq!(body.velocity(), Vec3::zeros());
        }
    }
    let stop = along(speed * speed / (2.0 * deceleration));
    // The stop may come up to a step early or late, at less than f_c h / M: f_c h^2 / M = 3.75 nm.
    assert!((body.position() - stop).norm() < friction * h * h / mass);
    // The whole kinetic energy is lost to friction; 5,000 roundings.
    assert!((body.energy().friction_loss - 0.5 * mass * speed * speed).abs() < 1e-13);
}

#[test]
fn the_work_on_the_hand_equals_the_gains_and_losses_of_the_arm() {
    // Two computations of the same work: from the device's side of the port, and from the arm's side. A constant force
    // holds device and arm against the arm's spring. The motors do the work F d. Half of it ends in the spring, and
    // half in the dampers, in proportion to their damping. There is no friction.
    let (mass, damping, force) = (0.15, 0.5, 2.0);
    let arm = Arm::TYPICAL;
    let mut body = Dynamics::new(mass, damping, 0.0, arm, Vec3::zeros());
    let rate = (damping + arm.damping) / (2.0 * (mass + arm.mass));
    let mut throughput = 0.0;
    for n in 1..=200_000_u32 {
        let before = *body.energy();
        body.step(50e-6, &along(force), &Vec3::zeros());
        let energy = body.energy();
        throughput += (energy.motor_work - before.motor_work).abs();
        let arm_side = energy.kinetic - energy.device_kinetic + energy.spring + energy.arm_loss
            - energy.hand_work;
        // Both computations express the same identity: rounding of the sums, as for the residual.
        assert!((energy.on_hand() - arm_side).abs() < 5e-13 * throughput);
        if n % 1000 == 0 {
            let fraction = mass / (mass + arm.mass);
            assert!((energy.device_kinetic - fraction * energy.kinetic).abs() <= 1e-16);
        }
    }
    let work = force * force / arm.stiffness;
    let exact = work - 0.5 * work * damping / (damping + arm.damping);
    // The swing has decayed (e^(-2 rate t) at 10 s: e^-99), and the midpoint rule is an identity at any step: rounding.
    assert!(rate * 10.0 > 45.0);
    assert!((body.energy().on_hand() - exact).abs() < 1e-12);
}

#[test]
fn a_free_device_does_no_work_on_a_hand_that_is_not_there() {
    let mut body = Dynamics::new(0.15, 0.5, 0.3, Arm::NONE, Vec3::zeros());
    body.push(along(0.2));
    for n in 0..20_000_u32 {
        let push = if (n / 100).is_multiple_of(2) {
            2.0
        } else {
            -2.0
        };
        body.step(50e-6, &along(push), &Vec3::zeros());
        let energy = body.energy();
        // Without an arm, the port passes no energy, whatever the motors do. Rounding of the account.
        assert!(energy.on_hand().abs() < 5e-13 * energy.lost().max(1e-3));
    }
    // The motors did work: the losses exceed the initial 3 mJ.
    assert!(body.energy().lost() > 0.004, "{}", body.energy().lost());
}

#[test]
fn a_throw_gives_the_device_the_kinetic_energy_of_the_arm() {
    // Device and arm move together, stopped by friction alone. The arm's part of the kinetic energy passes through the
    // port into friction, so the hand does that much work on the device.
    let (mass, friction, speed) = (0.2, 0.3, 0.4);
    let arm = Arm {
        mass: 0.6,
        damping: 0.0,
        stiffness: 0.0,
    };
    let mut body = Dynamics::new(mass, 0.0, friction, arm, Vec3::zeros());
    body.push(along(speed));
    for _ in 0..40_000 {
        body.step(50e-6, &Vec3::zeros(), &Vec3::zeros());
    }
    let energy = body.energy();
    assert_eq!(body.velocity(), Vec3::zeros());
    // Thousands of roundings of sums below 0.1 J.
    assert!((energy.on_hand() + 0.5 * arm.mass * speed * speed).abs() < 1e-13);
    assert!((energy.device_initial - 0.5 * mass * speed * speed).abs() < 1e-17);
}

#[test]
fn friction_holds_up_to_its_limit_for_ever_and_not_beyond() {
    for (force, holds) in [(0.2999, true), (0.3, true), (0.3001, false)] {
        let mut body = Dynamics::new(0.2, 0.1, 0.3, Arm::NONE, Vec3::zeros());
        for _ in 0..10_000 {
            // Along one axis, so that the force's length is exact.
            body.step(50e-6, &Vec3::new(0.0, force, 0.0), &Vec3::zeros());
        }
        assert_eq!(body.position() == Vec3::zeros(), holds, "{force}");
        assert_eq!(body.velocity() == Vec3::zeros(), holds, "{force}");
    }
}

#[test]
fn friction_acts_against_the_motion_whatever_its_direction() {
    // The path stays straight, and the speed falls at f_c / M at first.
    let mut body = Dynamics::new(0.2, 0.0, 0.3, Arm::NONE, Vec3::zeros());
    body.push(Vec3::new(0.3, 0.4, 0.0));
    body.step(50e-6, &Vec3::zeros(), &Vec3::zeros());
    let speed = body.velocity().norm();
    // Rounding only.
    assert!((speed - (0.5 - 0.3 / 0.2 * 50e-6)).abs() < 1e-15);
    assert!((body.velocity().y / body.velocity().x - 4.0 / 3.0).abs() < 1e-14);
}

/// Two busy seconds: friction, both dampings, a moving aim and a force that switches.
fn busy(steps_per_ms: u32, friction: f64) -> (Vec3, MechanicalEnergy, f64) {
    let mut body = Dynamics::new(0.045, 0.05, friction, Arm::TYPICAL, along(0.01));
    let h = 1e-3 / f64::from(steps_per_ms);
    let mut throughput = 0.0;
    let mut losses = 0.0;
    for n in 0..2000 * steps_per_ms {
        let tick = n / steps_per_ms;
        let push = if (tick / 100).is_multiple_of(2) {
            2.0
        } else {
            -1.5
        };
        let t = h * f64::from(n + 1);
        let aim = along(0.01) + Vec3::new(0.0, 0.02, 0.01) * libm::sin(9.0 * t);
        let before = *body.energy();
        body.step(h, &(Vec3::new(push, 0.3, 0.0)), &aim);
        let after = body.energy();
        throughput += (after.motor_work - before.motor_work).abs();
        throughput += (after.hand_work - before.hand_work).abs();
        assert!(after.lost() >= losses, "a loss was negative");
        losses = after.lost();
    }
    (body.position(), *body.energy(), throughput)
}

#[test]
fn the_energy_account_closes_to_rounding_at_any_step() {
    for steps_per_ms in [1, 5, 20, 80] {
        let (_, energy, throughput) = busy(steps_per_ms, 0.26);
        // An identity of the discrete motion. Each of at most 160,000 steps rounds sums that stay below the throughput
        // at 1.1e-16. The roundings are independent: 400 * 1.1e-16, with a margin of ten.
        assert!(
            energy.residual().abs() < 5e-13 * throughput,
            "{} {throughput}",
            energy.residual()
        );
        assert!(energy.friction_loss > 0.0 && energy.arm_loss > 0.0 && energy.damping_loss > 0.0);
    }
}

#[test]
fn the_accounts_themselves_converge_to_second_order() {
    let work = |n| busy(n, 0.0).1.motor_work;
    let exact = work(320);
    let errors = [2, 4, 8].map(|n| (work(n) - exact).abs());
    for pair in errors.windows(2) {
        let order = libm::log2(pair[0] / pair[1]);
        // Second order; the reference itself errs by (8 / 320)^2 of the finest, 0.1 %.
        assert!((order - 2.0).abs() < 0.05, "{order} {errors:?}");
    }
}

proptest! {
    #[test]
    fn no_step_and_no_force_makes_energy(
        mass in 0.01..1.0_f64, damping in 0.0..5.0_f64, friction in 0.0..1.0_f64,
        arm in (0.0..1.0_f64, 0.0..50.0_f64, 0.0..2000.0_f64),
        h in 1e-6..5e-3_f64,
        drive in proptest::collection::vec((-8.0..8.0_f64, -8.0..8.0_f64, -0.02..0.02_f64), 1..100),
    ) {
        let arm = Arm { mass: arm.0, damping: arm.1, stiffness: arm.2 };
        let mut body = Dynamics::new(mass, damping, friction, arm, Vec3::zeros());
        let mut throughput = 1e-12;
        let mut lost = 0.0;
        for (fx, fz, aim) in drive {
            let before = *body.energy();
            body.step(h, &Vec3::new(fx, 0.0, fz), &Vec3::new(aim, -aim, 0.0));
            let after = body.energy();
            throughput += (after.motor_work - before.motor_work).abs()
                + (after.hand_work - before.hand_work).abs();
            prop_assert!(after.lost() >= lost);
            lost = after.lost();
        }
        // Rounding of at most 100 steps. A step's momentum 2 M v / h cancels to a few parts in 1e16. At worst, the
        // momentum exceeds the forces by a factor of some thousand: 1e-16 * 100 * 1e3, with a margin.
        prop_assert!(body.energy().residual().abs() < 1e-11 * throughput);
    }
}
