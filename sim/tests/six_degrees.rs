//! A device of six degrees of freedom: its rotation is sensed, actuated, held and accounted for.

use nalgebra::UnitQuaternion;
use rt_core::{Device, Freedom, Vec3, Wrench};
use sim::{Arm, DeviceModel, Hand, RotationModel, SimDevice, SimError, Trajectory, Wired, Wrist};

const MS: u64 = 1_000_000;

fn virtuose() -> DeviceModel {
    DeviceModel::named("virtuose6d").unwrap()
}

fn turn(moment: Vec3) -> Wrench {
    Wrench {
        force: Vec3::zeros(),
        moment,
    }
}

#[test]
fn a_moment_turns_the_handle_against_the_wrist() {
    let wrist = Wrist::named("typical").unwrap();
    let hand = Hand::new(Trajectory::still()).with_wrist(wrist);
    let model = virtuose();
    let rotation = model.rotation.unwrap();
    let mut device = SimDevice::new(model, Some(hand), 1e-3).unwrap();
    assert_eq!(device.capabilities().sensed, Freedom::Six);
    let moment = Vec3::new(0.0, 0.3, 0.4);
    device.write(0, &turn(moment)).unwrap();
    let mut state = device.read(0).unwrap();
    for k in 1..=3000 {
        state = device.read(k * MS).unwrap();
    }
    assert_eq!(device.angular_velocity(), Vec3::zeros());
    // At rest, friction may hold a part of the moment: 2 k sin(a / 2) differs from the moment by at most the friction.
    let found = device.orientation().scaled_axis();
    let pull = 2.0 * wrist.stiffness * libm::sin(0.5 * found.norm());
    assert!((pull - moment.norm()).abs() <= rotation.friction);
    assert!(found.cross(&moment).norm() < 1e-12);
    // The shown orientation errs by half a count per coordinate, and rounding.
    let shown = state.pose.rotation.scaled_axis();
    assert!((shown - found).amax() <= 0.5 * rotation.step * (1.0 + 1e-9));
    // The filter's memory decays by a factor of 0.6 per tick.
    assert!(state.twist.angular.norm() < 1e-300);
    // The position did not change, and one account holds the energy of both motions.
    assert_eq!(device.position(), Vec3::zeros());
    let energy = device.energy();
    assert!(energy.motor_work > 0.1 && energy.residual().abs() < 1e-13);
    // At the port: the energy of the spring and the loss to the wrist's damping.
    assert!((energy.on_hand() - energy.spring - energy.arm_loss).abs() < 1e-13);
}

#[test]
fn the_angular_velocity_is_estimated_from_counts() {
    let model = DeviceModel {
        rotation: Some(RotationModel {
            friction: 0.0,
            damping: 0.0,
            ..virtuose().rotation.unwrap()
        }),
        ..virtuose()
    };
    let step = model.rotation.unwrap().step;
    let mut device = SimDevice::new(model, None, 1e-3).unwrap();
    device.write(0, &turn(Vec3::new(0.0, 0.0, 0.05))).unwrap();
    for k in 1..=700 {
        let now = k * MS;
        if k == 100 {
            device.write(now, &turn(Vec3::zeros())).unwrap();
        }
        let state = device.read(now).unwrap();
        if k > 150 {
            // 2.5 rad/s, through half a turn, at which a rotation vector jumps. The filter keeps 40 % of a count per
            // tick, at both ends of a difference.
            let error = (state.twist.angular - device.angular_velocity()).norm();
            assert!(error < step / 1e-3, "{k} {error}");
        }
    }
    assert!((device.angular_velocity().z - 2.5).abs() < 1e-9);
}

#[test]
fn moments_are_shortened_and_refused_as_forces_are() {
    let mut device = SimDevice::new(virtuose(), None, 1e-3).unwrap();
    device.write(0, &turn(Vec3::new(3.0, 4.0, 0.0))).unwrap();
    // Rounding of one division and one product.
    assert!((device.moment() - Vec3::new(0.6, 0.8, 0.0)).norm() < 1e-15);
    let bad = Wrench {
        force: Vec3::new(f64::NAN, 0.0, 0.0),
        moment: Vec3::new(0.0, f64::INFINITY, 0.0),
    };
    device.write(0, &bad).unwrap();
    assert_eq!(
        (device.force(), device.moment()),
        (Vec3::zeros(), Vec3::zeros())
    );
    assert_eq!(device.refused_wrenches(), Some(1));
    // A device of three degrees of freedom ignores the moment.
    let falcon = DeviceModel::named("falcon").unwrap();
    let mut device = SimDevice::new(falcon, None, 1e-3).unwrap();
    assert_eq!(device.capabilities().actuated, Freedom::Three);
    device.write(0, &bad).unwrap();
    device
        .write(0, &turn(Vec3::new(0.0, f64::NAN, 0.0)))
        .unwrap();
    assert_eq!(device.refused_wrenches(), Some(1));
    assert_eq!(
        device.read(MS).unwrap().pose.rotation,
        UnitQuaternion::identity()
    );
}

#[test]
fn translation_is_that_of_the_device_without_rotation() {
    let plain = DeviceModel {
        rotation: None,
        ..virtuose()
    };
    let reach = [(0.0, Vec3::zeros()), (0.4, Vec3::new(0.03, 0.01, 0.0))];
    let hand = Hand::new(Trajectory::new_waypoints(&reach).unwrap()).with_arm(Arm::FIRM);
    let mut three = SimDevice::new(plain, Some(hand.clone()), 1e-3).unwrap();
    let mut six = Wired::new(SimDevice::new(virtuose(), Some(hand), 1e-3).unwrap());
    for k in 0..600 {
        let wrench = Wrench {
            force: Vec3::new(0.5, -1.25, 0.0),
            moment: Vec3::new(0.1, 0.2, 0.0),
        };
        three.read(k * MS).unwrap();
        let state = six.read(k * MS).unwrap();
        three.write(k * MS, &wrench).unwrap();
        six.write(k * MS, &wrench).unwrap();
        assert_eq!(three.position(), six.device().position());
        // The rotation also passes through the wire: 0.07 mrad, and half a count per coordinate.
        let error = state.pose.rotation.angle_to(&six.device().orientation());
        assert!(error < 0.07e-3 + 0.87 * 2e-4, "{error}");
    }
    assert!(six.device().orientation().angle() > 0.1);
}

#[test]
fn senseless_rotations_are_refused() {
    let with = |rotation| DeviceModel {
        rotation: Some(rotation),
        ..virtuose()
    };
    let sound = virtuose().rotation.unwrap();
    let error = |rotation| SimDevice::new(with(rotation), None, 1e-3).unwrap_err();
    assert_eq!(
        error(RotationModel {
            inertia: 0.0,
            ..sound
        }),
        SimError::NotPositive {
            field: "moment of inertia",
            found: 0.0
        }
    );
    assert_eq!(
        error(RotationModel {
            friction: -1.0,
            ..sound
        }),
        SimError::Negative {
            field: "rotation's friction",
            found: -1.0
        }
    );
    let wrist = Wrist {
        stiffness: -1.0,
        ..Wrist::default()
    };
    let hand = Hand::new(Trajectory::still()).with_wrist(wrist);
    let held = SimDevice::new(virtuose(), Some(hand), 1e-3);
    assert_eq!(held.unwrap_err(), SimError::Wrist { found: wrist });
}
