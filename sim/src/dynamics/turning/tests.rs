use super::*;
use proptest::prelude::*;

fn model(inertia: f64, damping: f64, friction: f64) -> RotationModel {
    RotationModel {
        inertia,
        damping,
        friction,
        step: 1e-4,
        max_moment: 10.0,
        driver_stiffness: 1.0,
        driver_damping: 0.0,
    }
}

const FREE: Wrist = Wrist {
    inertia: 0.0,
    damping: 0.0,
    stiffness: 0.0,
};

fn along(x: f64) -> Vec3 {
    // An oblique direction, so that no axis is special.
    Vec3::new(2.0, -3.0, 6.0) * (x / 7.0)
}

#[test]
fn a_constant_moment_turns_it_along_the_parabola() {
    let mut body = Turning::new(&model(2e-3, 0.0, 0.0), FREE);
    let h = 50e-6;
    for _ in 0..10_000 {
        body.step(h, &along(0.02));
    }
    // 0.5 * 10 rad/s^2 * (0.5 s)^2 = 1.25 rad. The velocity is exact. A step turns by 4 atan(h u / 4) instead of h u,
    // which is less by a fraction of (h u)^2 / 48: 1e-9 at 5 rad/s, and rounding.
    assert!((body.velocity() - along(5.0)).norm() < 1e-11);
    let turn = body.orientation().scaled_axis();
    assert!((turn - along(1.25)).norm() < 2e-9);
}

#[test]
fn it_comes_to_rest_at_the_analytic_angle_whatever_the_step() {
    let (inertia, friction, speed) = (2e-3, 0.02, 3.0);
    let angle = 0.5 * inertia * speed * speed / friction;
    for h in [13e-6, 50e-6, 1e-3] {
        let mut body = Turning::new(&model(inertia, 0.0, friction), FREE);
        body.push(along(speed));
        for _ in 0..(0.4 / h) as u32 {
            body.step(h, &Vec3::zeros());
        }
        assert_eq!(body.velocity(), Vec3::zeros());
        // (h u)^2 / 48 of 0.45 rad, and rounding.
        let short = h * h * speed * speed / 48.0 * angle;
        let turn = body.orientation().scaled_axis();
        assert!((turn - along(angle)).norm() < short + 1e-11, "{h}");
        let lost = body.energy().friction_loss;
        assert!((lost - 0.5 * inertia * speed * speed).abs() < 1e-14);
        // Friction holds the handle from then on, and releases it beyond its limit.
        body.step(h, &along(0.0199));
        assert_eq!(body.velocity(), Vec3::zeros());
        body.step(h, &along(0.0201));
        assert!(body.velocity() != Vec3::zeros());
    }
}

/// Largest error over a second against the closed form of a wrist that is pushed, at small angles.
fn swing_error(steps_per_ms: u32) -> f64 {
    let wrist = Wrist {
        inertia: 1e-3,
        damping: 0.01,
        stiffness: 1.0,
    };
    let mut body = Turning::new(&model(1e-3, 0.005, 0.0), wrist);
    let speed = 1e-4;
    body.push(along(speed));
    let rate: f64 = 0.015 / (2.0 * 2e-3);
    let damped = (1.0 / 2e-3 - rate * rate).sqrt();
    let h = 1e-3 / f64::from(steps_per_ms);
    let mut worst: f64 = 0.0;
    for n in 1..=1000 * steps_per_ms {
        body.step(h, &Vec3::zeros());
        let t = h * f64::from(n);
        let exact = speed / damped * libm::exp(-rate * t) * libm::sin(damped * t);
        // For small angles, the vector part is half of the angle; its cube is 1e-17.
        worst = worst.max((body.orientation().imag() * 2.0 - along(exact)).norm());
    }
    worst
}

#[test]
fn a_wrist_swings_as_the_closed_form_to_second_order() {
    let errors = [1, 2, 4].map(swing_error);
    for pair in errors.windows(2) {
        let order = libm::log2(pair[0] / pair[1]);
        // Second order; the next term is (omega h)^2 = 5e-4 of it.
        assert!((order - 2.0).abs() < 0.01, "{order} {errors:?}");
    }
}

#[test]
fn far_from_rest_the_potential_is_a_cosine() {
    // A free swing without losses about one axis. Energy gives the largest angle: 4 k (1 - cos(a / 2)) = J w^2 / 2.
    let (inertia, stiffness, speed) = (2e-3, 1.0, 40.0_f64);
    let wrist = Wrist { stiffness, ..FREE };
    let mut body = Turning::new(&model(inertia, 0.0, 0.0), wrist);
    body.push(along(speed));
    let most = 2.0 * libm::acos(1.0 - inertia * speed * speed / (8.0 * stiffness));
    let mut farthest: f64 = 0.0;
    for _ in 0..20_000 {
        body.step(10e-6, &Vec3::zeros());
        farthest = farthest.max(body.orientation().angle());
        assert!(body.energy().residual().abs() < 1e-12);
    }
    // 1.85 rad, 106 degrees. At the reversal, a step of 10 us misses at most a w' h^2 / 8 = 8e-9 rad.
    assert!(
        most > 1.8 && (farthest - most).abs() < 1e-8,
        "{farthest} {most}"
    );
}

proptest! {
    #[test]
    fn no_step_and_no_moment_makes_energy(
        inertia in 1e-4..1e-2_f64, damping in 0.0..0.05_f64, friction in 0.0..0.1_f64,
        wrist in (0.0..1e-2_f64, 0.0..0.3_f64, 0.0..20.0_f64),
        h in 1e-6..2e-4_f64,
        moments in proptest::collection::vec((-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64), 1..100),
    ) {
        let wrist = Wrist { inertia: wrist.0, damping: wrist.1, stiffness: wrist.2 };
        let mut body = Turning::new(&model(inertia, damping, friction), wrist);
        let mut throughput = 1e-9;
        let mut lost = 0.0;
        for (x, y, z) in moments {
            let before = *body.energy();
            body.step(h, &Vec3::new(x, y, z));
            let after = body.energy();
            throughput += (after.motor_work - before.motor_work).abs();
            prop_assert!(after.lost() >= lost);
            lost = after.lost();
            // The quaternion keeps its length; one rounding.
            prop_assert!((body.orientation().norm() - 1.0).abs() < 1e-15);
        }
        // Rounding of 100 steps: momenta 2 J w / h up to some thousand times the moments.
        prop_assert!(body.energy().residual().abs() < 1e-11 * throughput, "{}", body.energy().residual());
    }
}

/// A wrist whose aim turns leads the handle there. The muscles give what friction and dampers take.
#[test]
fn a_handle_follows_the_aim_of_its_wrist_and_its_energy_closes() {
    let wrist = Wrist {
        inertia: 1e-3,
        damping: 0.05,
        stiffness: 3.0,
    };
    let mut body = Turning::new(&model(1e-3, 0.005, 0.01), wrist);
    let to = Vec3::new(0.8, -0.5, 1.2);
    for step in 0..40_000 {
        let part = (f64::from(step) / 20_000.0).min(1.0);
        body.aim_at(UnitQuaternion::from_scaled_axis(to * part));
        body.step(50e-6, &Vec3::zeros());
        assert!(body.energy().residual().abs() < 1e-12);
    }
    let apart = body
        .orientation()
        .angle_to(&UnitQuaternion::from_scaled_axis(to));
    // The angle at which the spring gives no more than friction.
    assert!(apart <= 0.01 / 3.0 && body.velocity() == Vec3::zeros());
    assert!(body.energy().hand_work > 0.0);
}
