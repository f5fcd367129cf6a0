use super::*;
use proptest::prelude::*;

fn default() -> Kinematics {
    Kinematics::new(&Geometry::default()).expect("a sound geometry")
}

/// A 3 x 3 matrix by rows, for the chain of rotations.
type Matrix = [[f64; 3]; 3];

fn apply(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| (0..3).map(|k| m[i][k] * v[k]).sum())
}

fn about_z(angle: f64) -> Matrix {
    let (s, c) = angle.sin_cos();
    [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
}

fn about_y(angle: f64) -> Matrix {
    let (s, c) = angle.sin_cos();
    [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
}

/// The position of the handle from counts, by a chain of rotations in the order of the mechanism.
fn chained(geometry: &Geometry, counts: [f64; 3]) -> [f64; 3] {
    let angle = |i: usize| {
        let motor = std::f64::consts::TAU * counts[i] / geometry.counts_per_turn[i];
        geometry.signs[i] * motor * geometry.capstans[i] / geometry.bodies[i]
    };
    let [height, first, second] = geometry.lengths;
    // The first link points up and leans about y; the second hangs down and leans the other way about y.
    let first = apply(&about_y(angle(1)), [0.0, 0.0, first]);
    let second = apply(&about_y(-angle(2)), [0.0, 0.0, -second]);
    let arm = [0, 1, 2].map(|i| first[i] + second[i]);
    let turned = apply(&about_z(angle(0)), arm);
    let foot = [0.0, 0.0, height];
    [0, 1, 2].map(|i| turned[i] + foot[i] - geometry.origin[i])
}

fn direction() -> impl Strategy<Value = Vec3> {
    let x = || -1.0..1.0_f64;
    (x(), x(), x())
        .prop_filter("a direction", |(x, y, z)| x * x + y * y + z * z > 1e-4)
        .prop_map(|(x, y, z)| Vec3::new(x, y, z).normalize())
}

/// A point in the workspace: the ball of 0.1 m about the origin.
fn place() -> impl Strategy<Value = Vec3> {
    (direction(), 0.0..0.1_f64).prop_map(|(direction, radius)| direction * radius)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_inverse_leads_back_to_the_position(position in place()) {
        let kinematics = default();
        let angles = kinematics.inverse(&position).expect("in the workspace");
        prop_assert!((kinematics.forward(angles) - position).norm() < 1e-12);
    }

    #[test]
    fn positions_are_those_of_chained_rotations(
        a in -4000..4000_i64, b in -6000..6000_i64, c in -6000..6000_i64,
    ) {
        let (geometry, kinematics) = (Geometry::default(), default());
        let position = kinematics.forward(kinematics.angles([a, b, c]));
        let expected = Vec3::from(chained(&geometry, [a, b, c].map(|n| n as f64)));
        // Rounding of lengths below 1 m; a hand needs a micrometre.
        prop_assert!((position - expected).norm() < 1e-12, "{position} {expected}");
    }

    #[test]
    fn the_jacobian_is_the_derivative_of_the_position(position in place()) {
        let kinematics = default();
        let angles = kinematics.inverse(&position).expect("in the workspace");
        let h = 1e-5;
        for (i, column) in kinematics.jacobian(angles).into_iter().enumerate() {
            let at = |by: f64| {
                let mut moved = angles;
                moved[i] += by;
                kinematics.forward(moved)
            };
            // The error of the central difference is h^2 / 6 times the third derivative, which is at most the length of
            // the arm, 0.45 m: 1e-11 m. Rounding adds 1e-16 / h.
            let difference = (at(h) - at(-h)) / (2.0 * h);
            prop_assert!((difference - column).norm() < 5e-11, "{difference} {column}");
        }
    }

    #[test]
    fn force_and_torques_do_the_same_work(
        position in place(), force in direction(), turn in direction(),
    ) {
        let kinematics = default();
        let angles = kinematics.inverse(&position).expect("in the workspace");
        let torques = kinematics.torques(angles, &force);
        let h = 1e-4;
        let at = |by: f64| {
            kinematics.forward([0, 1, 2].map(|i| angles[i] + by * turn[i]))
        };
        // The work over a small turn, from the positions alone. The central difference errs by h^2 relative.
        let moved = (at(h) - at(-h)) / (2.0 * h);
        let work: f64 = torques.iter().zip(turn.iter()).map(|(t, q)| t * q).sum();
        prop_assert!((force.dot(&moved) - work).abs() < 1e-6 * 0.45);
    }

    #[test]
    fn the_currents_of_a_force_make_that_force(position in place(), force in direction()) {
        let kinematics = default();
        let angles = kinematics.inverse(&position).expect("in the workspace");
        let currents = kinematics.currents(angles, &force);
        let back = kinematics.force(angles, currents).expect("not singular");
        // Rounding, times the condition of the Jacobian, which is below 1e3 in the workspace.
        prop_assert!((back - force).norm() < 1e-12);
    }

    #[test]
    fn limited_currents_keep_the_direction_of_the_force(
        position in place(), force in direction(), size in 0.1..1000.0_f64,
    ) {
        let kinematics = default();
        let angles = kinematics.inverse(&position).expect("in the workspace");
        let currents = kinematics.currents(angles, &(force * size));
        let limited = kinematics.limited(currents);
        prop_assert!(limited.iter().all(|x| (-3000..=3000).contains(x)));
        let largest = currents.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let scale = (3000.0 / largest).min(1.0);
        for (wanted, found) in currents.iter().zip(limited) {
            // Half a milliampere of rounding.
            prop_assert!((wanted * scale - f64::from(found)).abs() <= 0.5 + 1e-9);
        }
    }

    #[test]
    fn any_numbers_give_finite_forces_and_no_panic(
        angles in prop::array::uniform3(any::<f64>()),
        currents in prop::array::uniform3(any::<f64>()),
        position in prop::array::uniform3(any::<f64>()),
        counts in prop::array::uniform3(any::<i64>()),
    ) {
        let kinematics = default();
        if let Some(force) = kinematics.force(angles, currents) {
            prop_assert!(force.iter().all(|x| x.is_finite()));
        }
        let _ = kinematics.limited(kinematics.currents(angles, &Vec3::from(position)));
        let found = kinematics.forward(kinematics.angles(counts));
        prop_assert!(found.iter().all(|x| x.is_finite()));
        if let Some(angles) = kinematics.inverse(&Vec3::from(position)) {
            prop_assert!(angles.iter().all(|x| x.is_finite()));
        }
    }
}

#[test]
fn a_motor_turns_its_joint_by_the_ratio_of_the_diameters() {
    // One turn of each motor, in the direction of the joint: 1/16, 1/12 and 1/12 of a turn.
    let angles = default().angles([2000, -2000, 2000]);
    let expected = [16.0, 12.0, 12.0].map(|ratio| std::f64::consts::TAU / ratio);
    for (found, expected) in angles.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-15, "{found} {expected}");
    }
    // A count of joint b moves the handle by 0.054 mm, a count of joint c by 0.064 mm: about 0.06 mm.
    let kinematics = default();
    let [_, b, c] = kinematics.jacobian(kinematics.inverse(&Vec3::zeros()).unwrap());
    let [_, per_b, per_c] = kinematics.angle_per_count();
    assert!((b.norm() * per_b - 53.7e-6).abs() < 0.1e-6);
    assert!((c.norm() * per_c - 64.1e-6).abs() < 0.1e-6);
}

#[test]
fn a_force_across_the_arm_takes_one_motor() {
    // At the origin the arm is 0.22 m long in the direction x, so 1 N along y is 0.22 N m about z: a sixteenth of it at
    // the motor, over 0.0259 N m/A.
    let kinematics = default();
    let angles = kinematics.inverse(&Vec3::zeros()).unwrap();
    let currents = kinematics.currents(angles, &Vec3::new(0.0, 1.0, 0.0));
    assert!((currents[0] - 0.22 / 16.0 / 0.0259 * 1000.0).abs() < 1e-9);
    assert!(
        currents[1].abs() < 1e-12 && currents[2].abs() < 1e-12,
        "{currents:?}"
    );
}

#[test]
fn no_position_beyond_the_links_has_angles() {
    let kinematics = default();
    let foot = -Geometry::default().origin + Vec3::new(0.0, 0.0, 0.080);
    // The links reach from 0.04 m to 0.45 m.
    for (distance, reached) in [(0.039, false), (0.041, true), (0.449, true), (0.451, false)] {
        for direction in [Vec3::x(), Vec3::z(), Vec3::new(0.6, -0.8, 0.0)] {
            let position = foot + direction * distance;
            let angles = kinematics.inverse(&position);
            assert_eq!(angles.is_some(), reached, "{distance} m along {direction}");
            if let Some(angles) = angles {
                // Near the ends of the reach the arc cosine costs half the digits.
                assert!((kinematics.forward(angles) - position).norm() < 1e-9);
            }
        }
    }
}

#[test]
fn a_stretched_arm_has_no_force() {
    let kinematics = default();
    let quarter = std::f64::consts::FRAC_PI_2;
    // Both links level and straight, then the handle on the vertical axis.
    for angles in [[0.0, quarter, quarter], [0.3, 0.0, 0.0]] {
        assert_eq!(kinematics.force(angles, [100.0; 3]), None);
    }
}

#[test]
fn a_bad_parameter_is_named() {
    let bad = [
        (
            Geometry {
                lengths: [0.08, 0.0, 0.245],
                ..Geometry::default()
            },
            "lengths",
        ),
        (
            Geometry {
                bodies: [f64::NAN; 3],
                ..Geometry::default()
            },
            "bodies",
        ),
        (
            Geometry {
                signs: [1.0, 0.5, 1.0],
                ..Geometry::default()
            },
            "signs",
        ),
        (
            Geometry {
                torque_constant: -1.0,
                ..Geometry::default()
            },
            "torque constant",
        ),
        (
            Geometry {
                current_limit: 33.0,
                ..Geometry::default()
            },
            "current limit",
        ),
        (
            Geometry {
                origin: Vec3::new(0.0, f64::INFINITY, 0.0),
                ..Geometry::default()
            },
            "origin",
        ),
    ];
    for (geometry, field) in bad {
        let error = Kinematics::new(&geometry).expect_err("refused");
        assert_eq!(error.field, field);
        assert!(error.to_string().contains(field), "{error}");
    }
}

/// A pose is singular if three columns of the Jacobian are nearly in one plane, whatever their lengths.
#[test]
fn a_force_is_told_down_to_a_millionth_of_the_volume_of_a_singular_pose() {
    let kinematics = default();
    let volume = |angles: [f64; 3]| {
        let [a, b, c] = kinematics.jacobian(angles);
        a.dot(&b.cross(&c)) / (a.norm() * b.norm() * c.norm())
    };
    // Between these two poses the links come in line.
    let pose = |bend: f64| [0.1, 0.4, bend];
    let (mut from, mut to) = (-0.36_f64, -0.45_f64);
    assert!(volume(pose(from)) * volume(pose(to)) < 0.0);
    while volume(pose(from)).abs() > 1e-8 {
        let middle = 0.5 * (from + to);
        let same = volume(pose(middle)) * volume(pose(from)) > 0.0;
        *(if same { &mut from } else { &mut to }) = middle;
    }
    for k in 0..40 {
        let angles = pose(from + libm::exp2(-0.5 * f64::from(k)) * 1e-3);
        let told = kinematics.force(angles, [100.0, 200.0, 300.0]).is_some();
        assert_eq!(told, volume(angles).abs() > 1e-6, "{k} {}", volume(angles));
    }
}
