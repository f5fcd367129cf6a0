use super::*;
use crate::trajectory::Trajectory;
use crate::tremor::Tremor;
use proptest::prelude::*;

const MS: u64 = 1_000_000;

fn falcon() -> DeviceModel {
    DeviceModel::named("falcon").unwrap()
}

fn touch() -> DeviceModel {
    DeviceModel::named("touch").unwrap()
}

fn push(force: Vec3) -> Wrench {
    Wrench {
        force,
        moment: Vec3::zeros(),
    }
}

fn reaching_hand(seed: u64) -> Hand {
    let reach = [
        (0.0, Vec3::zeros()),
        (0.4, Vec3::new(0.03, 0.01, 0.0)),
        (0.8, Vec3::zeros()),
    ];
    Hand::new(Trajectory::new_waypoints(&reach).unwrap())
        .with_tremor(Tremor::new(1e-4, seed).unwrap())
}

/// One second at 1 kHz against a viscous wall. Returns every state that was read.
fn run(seed: u64) -> Vec<DeviceState> {
    let mut device = SimDevice::new(falcon(), Some(reaching_hand(seed)), 1e-3).unwrap();
    (0..1000)
        .map(|k| {
            let state = device.read(k * MS).unwrap();
            let wall = -(state.pose.position * 300.0 + state.twist.linear * 2.0);
            device.write(k * MS, &push(wall)).unwrap();
            state
        })
        .collect()
}

#[test]
fn equal_seeds_give_equal_bits_and_others_differ() {
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn encoders_show_whole_counts_within_half_a_count() {
    for (name, model) in DeviceModel::all() {
        // The grip is firm enough to move the heaviest device.
        let hand = reaching_hand(5).with_arm(Arm::FIRM);
        let mut device = SimDevice::new(model, Some(hand), 1e-3).unwrap();
        for k in 0..800 {
            let shown = device.read(k * MS).unwrap().pose.position;
            let step = model.position_step;
            for (shown, true_) in shown.iter().zip(device.position().iter()) {
                // Half a count, plus the rounding of a quotient of some thousand counts.
                assert!((shown - true_).abs() <= 0.5 * step * (1.0 + 1e-9), "{name}");
                assert!(
                    (shown / step - (shown / step).round()).abs() < 1e-9,
                    "{name}"
                );
            }
        }
        // The hand moved the device (to 32 mm at 0.4 s, and back to rest at the start).
        assert!(device.velocity().norm() < 0.05, "{name}");
    }
}

#[test]
fn a_force_beyond_the_largest_keeps_its_direction() {
    let mut device = SimDevice::new(touch(), None, 1e-3).unwrap();
    device.write(0, &push(Vec3::new(3.0, -4.0, 0.0))).unwrap();
    // Rounding of one division and one product.
    assert!((device.force() - Vec3::new(3.0, -4.0, 0.0) * (3.3 / 5.0)).norm() < 1e-15);
    device.write(0, &push(Vec3::new(1.0, 0.5, 0.0))).unwrap();
    assert_eq!(device.force(), Vec3::new(1.0, 0.5, 0.0));
    for bad in [f64::NAN, f64::INFINITY, 1e200] {
        device.write(0, &push(Vec3::new(bad, 0.0, 1.0))).unwrap();
        assert_eq!(device.force(), Vec3::zeros());
    }
    assert_eq!(device.refused_wrenches(), Some(3));
}

#[test]
fn the_wrench_is_held_from_its_write_to_the_next() {
    let model = DeviceModel {
        friction: 0.0,
        damping: 0.0,
        ..falcon()
    };
    let mut device = SimDevice::new(model, None, 1e-3).unwrap();
    device.read(0).unwrap();
    device.write(0, &push(Vec3::new(1.0, 0.0, 0.0))).unwrap();
    // A write between two reads takes effect at its own time, not at the next read.
    device.write(300_000, &push(Vec3::zeros())).unwrap();
    device.read(MS).unwrap();
    // Rounding of 20 substeps.
    assert!((device.velocity().x - 0.3e-3 / model.mass).abs() < 1e-15);
    let expected = 0.5 * 9e-8 / model.mass + 0.3e-3 / model.mass * 0.7e-3;
    assert!((device.position().x - expected).abs() < 1e-17);
}

#[test]
fn the_estimated_velocity_is_the_true_one_but_for_counts() {
    let model = DeviceModel {
        friction: 0.0,
        damping: 0.0,
        ..falcon()
    };
    let mut device = SimDevice::new(model, None, 1e-3).unwrap();
    device.write(0, &push(Vec3::new(2.0, 0.0, 0.0))).unwrap();
    let mut now = 0;
    let mut states = Vec::new();
    for k in 1..=60 {
        // Every fifth tick is missed.
        if k % 5 != 0 {
            now = k * MS;
            states.push((device.read(now).unwrap(), device.velocity()));
        }
        if k == 20 {
            device.write(now, &Wrench::zero()).unwrap();
        }
    }
    for (state, velocity) in states.into_iter().skip(30) {
        // A ramp of rounded positions errs by up to a count per tick, of which the filter keeps 40 %.
        let error = (state.twist.linear - velocity).norm();
        assert!(error < 0.5 * model.position_step / 1e-3, "{error}");
    }
    // A second read at the same time changes nothing.
    assert_eq!(device.read(now).unwrap(), device.read(now).unwrap());
}

#[test]
fn a_jump_in_time_stands_still_for_the_excess_and_counts_it() {
    let hand = Some(reaching_hand(1));
    let mut device = SimDevice::new(falcon(), hand.clone(), 1e-3).unwrap();
    device.read(5 * MS).unwrap();
    let state = device.read(60_005 * MS).unwrap();
    assert_eq!(device.frozen_ns(), 59_900 * MS);
    assert_eq!(state.device_time_ns, 60_000 * MS);
    let mut steady = SimDevice::new(falcon(), hand, 1e-3).unwrap();
    for k in 0..=100 {
        steady.read(k * MS).unwrap();
    }
    assert_eq!(steady.frozen_ns(), 0);
    assert_eq!(device.position(), steady.position());
    // A time before the latest call changes nothing.
    assert_eq!(device.read(3).unwrap().device_time_ns, 60_000 * MS);
    assert_eq!(device.position(), steady.position());
}

#[test]
fn reads_at_odd_times_change_the_motion_only_by_the_step() {
    let model = DeviceModel {
        friction: 0.0,
        ..falcon()
    };
    let at = |step_ns: u64| {
        let mut device = SimDevice::new(model, Some(reaching_hand(4)), 1e-3).unwrap();
        device.read(0).unwrap();
        let mut now = 0;
        while now < 500 * MS {
            now = (now + step_ns).min(500 * MS);
            device.read(now).unwrap();
        }
        device.position()
    };
    // The error is of second order in the substep: at most (12 Hz * 2 pi * 50 us)^2 / 12 = 1e-6 of 30 mm.
    assert!((at(MS) - at(333_333)).norm() < 3e-8);
    assert!((at(MS) - at(1_000_003)).norm() < 3e-8);
}

#[test]
fn a_device_starts_where_it_is_put_with_the_arm_relaxed() {
    let start = Vec3::new(0.01, -0.02, 0.03);
    let hand = Hand::new(Trajectory::still());
    let mut device = SimDevice::new(falcon(), Some(hand), 1e-3)
        .unwrap()
        .starting_at(start)
        .unwrap();
    for k in 0..100 {
        device.read(k * MS).unwrap();
    }
    assert_eq!(device.position(), start);
    assert_eq!(*device.energy(), MechanicalEnergy::default());
}

#[test]
fn senseless_numbers_are_refused() {
    let still = || Some(Hand::new(Trajectory::still()));
    let error = |model, period| SimDevice::new(model, None, period).unwrap_err();
    assert_eq!(
        error(
            DeviceModel {
                mass: 0.0,
                ..falcon()
            },
            1e-3
        ),
        SimError::NotPositive {
            field: "mass",
            found: 0.0
        }
    );
    assert_eq!(
        error(
            DeviceModel {
                friction: -0.1,
                ..falcon()
            },
            1e-3
        ),
        SimError::Negative {
            field: "friction",
            found: -0.1
        }
    );
    assert_eq!(error(falcon(), 0.0), SimError::Period { found: 0.0 });
    let arm = Arm {
        mass: 0.5,
        damping: f64::INFINITY,
        stiffness: 1.0,
    };
    let held = SimDevice::new(falcon(), still().map(|hand| hand.with_arm(arm)), 1e-3);
    assert_eq!(held.unwrap_err(), SimError::Arm { found: arm });
    let device = SimDevice::new(falcon(), still(), 1e-3).unwrap();
    assert_eq!(
        device.clone().with_substep_ns(0).unwrap_err(),
        SimError::Substep { found: 0 }
    );
    assert_eq!(
        device
            .starting_at(Vec3::new(f64::NAN, 0.0, 0.0))
            .unwrap_err(),
        SimError::Start
    );
}

proptest! {
    #[test]
    fn the_account_closes_whatever_is_written_and_whenever(
        seed in any::<u64>(),
        calls in proptest::collection::vec((1..5_000_000_u64, -20.0..20.0_f64, -20.0..20.0_f64), 1..200),
    ) {
        let mut device = SimDevice::new(touch(), Some(reaching_hand(seed)), 1e-3).unwrap();
        let mut now = 0;
        for (gap, fx, fy) in calls {
            now += gap;
            prop_assert!(device.read(now).unwrap().is_finite());
            device.write(now, &push(Vec3::new(fx, fy, 0.0))).unwrap();
            prop_assert!(device.force().norm() <= 3.3 * (1.0 + 1e-15));
        }
        let energy = device.energy();
        let turned_over = energy.lost() + energy.stored() + energy.motor_work.abs() + 1e-9;
        // The tolerance covers the rounding of up to 20,000 substeps. A last substep of a few nanoseconds holds 2 M v /
        // h of up to 1e8 N, whose rounding (1e-8 N) acts over the few nanometres of that substep and does no relevant
        // work.
        prop_assert!(energy.residual().abs() < 1e-11 * turned_over, "{}", energy.residual());
    }
}
