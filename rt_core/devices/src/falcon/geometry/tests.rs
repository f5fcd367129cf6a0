use super::*;
use proptest::prelude::*;

/// A position inside the workspace: a direction and a fraction of the radius.
fn inside() -> impl Strategy<Value = Vec3> {
    let x = || -1.0..1.0_f64;
    (x(), x(), x())
        .prop_filter("in the ball", |(x, y, z)| x * x + y * y + z * z <= 1.0)
        .prop_map(|(x, y, z)| CENTRE + Vec3::new(x, y, z) * WORKSPACE)
}

/// Points of a grid of 5 mm inside the workspace, and points on its surface.
fn grid() -> impl Iterator<Item = Vec3> {
    let line = || (-10..=10).map(|k| f64::from(k) * 5e-3);
    line()
        .flat_map(move |x| line().flat_map(move |y| line().map(move |z| Vec3::new(x, y, z))))
        .filter(|p| p.norm() > 0.0)
        .flat_map(|p| [p, p * (WORKSPACE / p.norm())])
        .filter(|p| p.norm() <= WORKSPACE * (1.0 + 1e-12))
        .map(|p| CENTRE + p)
}

/// The closure of the loop as Stamper writes it, from all three angles of a leg.
fn closure(leg: f64, t: f64, k: f64, q: f64) -> Vec3 {
    let (a, b, c, d, e, f, r, s) = (
        0.06, 0.1025, 0.01443, 0.01125, 0.01125, -0.025, 0.04, -0.02309,
    );
    let u = a * t.cos() - c + (d + e + b * q.sin()) * k.cos() + r;
    let v = b * q.cos() - f + s;
    let w = a * t.sin() + (d + e + b * q.sin()) * k.sin();
    Vec3::new(
        u * leg.cos() - v * leg.sin(),
        u * leg.sin() + v * leg.cos(),
        w,
    )
}

#[test]
fn the_inverse_closes_stampers_loop() {
    for p in grid() {
        let angles = inverse(&p).expect("in reach");
        for (leg, t) in LEGS.into_iter().zip(angles) {
            let local = in_leg(&p, libm::sincos(leg));
            let q = ((local.y + 0.02309 - 0.025) / 0.1025).acos();
            let k = (local.z - 0.06 * t.sin()).atan2(local.x - 0.04 + 0.01443 - 0.06 * t.cos());
            // Rounding of lengths of 0.1 m.
            assert!((closure(leg, t, k, q) - p).norm() < 1e-15 * 10.0, "{p}");
            // The knee is the outer one: the arm is turned less than the shin.
            assert!(t < k, "{p}");
        }
    }
}

#[test]
fn the_published_lengths_give_the_published_count() {
    // 0.03643 degrees, as it is published to four digits.
    assert!((COUNT.to_degrees() - 0.03643).abs() < 5e-6);
    assert_eq!(angle_of(0).to_degrees(), 35.0);
    for count in [i16::MIN, -1867, -1, 0, 1, 1235, i16::MAX] {
        // Rounding of up to 32,768 counts.
        assert!((count_of(angle_of(count)) - f64::from(count)).abs() < 1e-10);
    }
}

#[test]
fn spheres_start_within_3_1_mm_and_newton_ends_within_a_nanometre() {
    let mut worst = (0.0_f64, 0.0_f64);
    let mut volumes = (f64::MAX, 0.0_f64);
    for p in grid() {
        let angles = inverse(&p).expect("in reach");
        let found = forward(&angles).expect("in reach");
        let mut centres = [Vec3::zeros(); 3];
        let mut normals = centres;
        for i in 0..3 {
            let turn = libm::sincos(LEGS[i]);
            centres[i] = from_leg(&knee(angles[i]), turn);
            normals[i] = shin(&p, &knee(angles[i]), turn).unwrap().0;
        }
        let start = three_spheres(&centres, SHIN + HINGES).expect("spheres meet");
        let volume = normals[0].dot(&normals[1].cross(&normals[2])).abs();
        volumes = (volumes.0.min(volume), volumes.1.max(volume));
        worst = (
            worst.0.max((start - p).norm()),
            worst.1.max((found - p).norm()),
        );
    }
    assert!(worst.0 < 3.1e-3, "{worst:?}");
    assert!(volumes.0 > 0.28 && volumes.1 < 0.89, "{volumes:?}");
    // The tolerance of the specification is 1 um. Newton's method ends in rounding: 1e-12 leaves it a factor of 1,000.
    assert!(worst.1 < 1e-12, "{worst:?}");
}

#[test]
fn every_count_of_every_leg_comes_back() {
    let mut met = 0;
    for leg in 0..3 {
        for others in [-800, -200, 0, 300, 700] {
            for count in -1900..=1250_i16 {
                let mut counts = [others; 3];
                counts[leg] = count;
                let angles = counts.map(angle_of);
                let Some(p) = forward(&angles) else { continue };
                if (p - CENTRE).norm() > WORKSPACE {
                    continue;
                }
                met += 1;
                let back = inverse(&p).expect("in reach").map(count_of);
                for i in 0..3 {
                    // 1e-9 m are 1.4e-5 counts at an arm of 60 mm with its shin at a right angle.
                    assert!((back[i] - f64::from(counts[i])).abs() < 1e-4, "{counts:?}");
                }
            }
        }
    }
    // Otherwise the test would check nothing.
    assert!(met > 8000, "{met}");
}

#[test]
fn a_count_at_each_arm_moves_the_grip_by_a_step_at_most() {
    let step_at = |p: &Vec3| {
        let jacobian = Jacobian::at(p, &inverse(p).unwrap()).unwrap();
        let along = |axis: usize| {
            jacobian
                .per_angle
                .iter()
                .map(|c| c[axis].abs())
                .sum::<f64>()
        };
        (0..3).map(along).fold(0.0, f64::max) * COUNT
    };
    let inner = grid().map(|p| CENTRE + (p - CENTRE) * (0.04 / WORKSPACE));
    let most = inner.map(|p| step_at(&p)).fold(0.0, f64::max);
    assert!(most <= STEP && most > 0.98 * STEP, "{most}");
    assert!((step_at(&CENTRE) - 0.077e-3).abs() < 0.5e-6);
}

#[test]
fn positions_and_angles_out_of_reach_are_refused() {
    for p in [
        Vec3::new(0.0, 0.0, 0.3),
        Vec3::new(0.2, 0.0, 0.1),
        Vec3::new(f64::NAN, 0.0, 0.1),
        Vec3::new(f64::INFINITY, 0.0, 0.1),
    ] {
        assert_eq!(inverse(&p), None, "{p}");
    }
    for angles in [[f64::NAN, 0.5, 0.5], [f64::INFINITY, 0.5, 0.5]] {
        assert_eq!(forward(&angles), None, "{angles:?}");
    }
}

#[test]
fn a_force_at_the_limit_keeps_its_direction() {
    assert_eq!(torque_counts(&[0.1, -0.2, 0.0]), [-1000, 2000, 0]);
    assert_eq!(torque_counts(&[0.0; 3]), [0; 3]);
    assert_eq!(torque_counts(&[0.4096, 0.0, 0.0]), [-4096, 0, 0]);
    assert_eq!(torque_counts(&[4.096, -2.048, 0.4096]), [-4096, 2048, -410]);
    assert_eq!(torque_counts(&[f64::MAX, -f64::MAX, 0.0]), [-4096, 4096, 0]);
    assert_eq!(torque_counts(&[f64::NAN, 0.1, 0.1]), [0; 3]);
    assert_eq!(torque_counts(&[0.1, f64::NEG_INFINITY, 0.1]), [0; 3]);
    assert_eq!(torque_of(-1000), 0.1);
}

/// Step of the finite differences (m). The error of a central difference is step^2 / 6 times a third derivative of
/// about 1 / (0.03 m)^3, which is 6e-8 of an angle a metre; rounding is 1e-16 / step = 1e-11.
const DIFFERENCE: f64 = 1e-5;

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn forward_undoes_inverse(p in inside()) {
        let found = forward(&inverse(&p).unwrap()).unwrap();
        prop_assert!((found - p).norm() < 1e-12, "{found} for {p}");
    }

    #[test]
    fn the_jacobian_is_the_derivative(p in inside()) {
        let angles = inverse(&p).unwrap();
        let jacobian = Jacobian::at(&p, &angles).unwrap();
        for axis in 0..3 {
            let mut step = Vec3::zeros();
            step[axis] = DIFFERENCE;
            let (more, less) = (inverse(&(p + step)).unwrap(), inverse(&(p - step)).unwrap());
            for leg in 0..3 {
                let slope = (more[leg] - less[leg]) / (2.0 * DIFFERENCE);
                let expected = jacobian.per_metre[leg][axis];
                // Relative to the largest slopes, about 100 rad/m.
                prop_assert!((slope - expected).abs() < 1e-6 * 100.0, "{slope} {expected}");
            }
        }
        // The columns are the inverse derivative.
        for leg in 0..3 {
            let step = DIFFERENCE * 10.0;
            let (mut more, mut less) = (angles, angles);
            more[leg] += step;
            less[leg] -= step;
            let slope = (forward(&more).unwrap() - forward(&less).unwrap()) / (2.0 * step);
            let mut rates = [0.0; 3];
            rates[leg] = 1.0;
            prop_assert!((slope - jacobian.velocity(&rates)).norm() < 1e-6);
        }
    }

    #[test]
    fn torques_do_the_work_of_the_force(
        p in inside(),
        force in (-8.0..8.0_f64, -8.0..8.0_f64, -8.0..8.0_f64),
        rates in (-3.0..3.0_f64, -3.0..3.0_f64, -3.0..3.0_f64),
    ) {
        let force = Vec3::new(force.0, force.1, force.2);
        let rates = [rates.0, rates.1, rates.2];
        let jacobian = Jacobian::at(&p, &inverse(&p).unwrap()).unwrap();
        let torques = jacobian.torques(&force);
        let power: f64 = torques.iter().zip(rates).map(|(torque, rate)| torque * rate).sum();
        // Rounding of a power of a few watts.
        prop_assert!((power - force.dot(&jacobian.velocity(&rates))).abs() < 1e-12);
        prop_assert!((jacobian.force(&torques) - force).norm() < 1e-11);
    }

    #[test]
    fn no_numbers_make_the_kinematics_panic(x in any::<[f64; 3]>(), y in any::<[f64; 3]>()) {
        let position = Vec3::from(y);
        let _ = (forward(&x), inverse(&position), torque_counts(&x));
        if let Some(jacobian) = Jacobian::at(&position, &x) {
            let _ = (jacobian.torques(&position), jacobian.force(&x));
        }
    }
}

#[test]
fn a_shin_shorter_than_its_hinges_and_an_arm_in_line_with_its_shin_are_refused() {
    let turn = libm::sincos(LEGS[0]);
    let angle = 0.6_f64;
    let from_knee = |local: Vec3| from_leg(&(knee(angle) + local), turn);
    let beside = |x: f64| from_knee(Vec3::new(x, 0.05, 0.0));
    assert!(shin(&beside(HINGES - 1e-6), &knee(angle), turn).is_none());
    assert!(shin(&beside(HINGES + 1e-6), &knee(angle), turn).is_some());
    // A shin in line with its arm does not turn it.
    let along = |away: f64| {
        let (sine, cosine) = libm::sincos(angle + away);
        from_knee(Vec3::new(cosine, 0.0, sine) * (SHIN + HINGES))
    };
    let angles = [angle, 0.5, 0.7];
    assert!(Jacobian::at(&along(0.0), &angles).is_none());
    assert!(Jacobian::at(&along(0.1), &angles).is_some());
}
