//! Devices of one and two degrees of freedom. They move along their axes alone, like a device of three degrees of
//! freedom that is never pulled across these axes.

use rt_core::{Axes, Device, Freedom, Vec3, Wrench};
use sim::{DeviceModel, Hand, SimDevice, SimError, Task, TaskKind, Tremor, Wired};

const MS: u64 = 1_000_000;

fn model(name: &str, free: [bool; 3]) -> DeviceModel {
    DeviceModel {
        axes: Axes::new(free),
        ..DeviceModel::named(name).expect("a built-in device")
    }
}

/// A hand that moves and trembles along every axis.
fn slanting() -> Hand {
    let task = Task::new(TaskKind::Rub, Vec3::new(0.6, -0.5, 0.7));
    let path = task.trajectory(5).expect("a hand can follow it");
    Hand::new(path).with_tremor(Tremor::new(2e-4, 5).expect("a sound tremor"))
}

/// A force that changes its direction in every tick and at times exceeds that of the motors.
fn force(tick: u64) -> Vec3 {
    let t = tick as f64 * 0.37;
    Vec3::new(libm::sin(t), libm::cos(1.7 * t), libm::sin(2.3 * t)) * 6.0
}

#[test]
fn a_device_stays_on_its_axes_to_the_last_bit_and_holds_no_force_across() {
    for free in [
        [true, false, false],
        [false, true, false],
        [true, false, true],
        [false, true, true],
    ] {
        let model = model("falcon", free);
        let freedom = model.freedom();
        let device = SimDevice::new(model, Some(slanting()), 1e-3).unwrap();
        let mut device = Wired::new(device);
        let mut farthest: f64 = 0.0;
        for k in 0..3000 {
            let state = device.read(k * MS).unwrap();
            let push = Wrench {
                force: force(k),
                moment: Vec3::zeros(),
            };
            device.write(k * MS, &push).unwrap();
            let probe = device.probe().unwrap();
            for vector in [
                state.pose.position,
                state.twist.linear,
                probe.pose.position,
                probe.twist.linear,
                probe.held.force,
            ] {
                assert_eq!(freedom.part(&vector), vector, "tick {k}");
            }
            farthest = farthest.max(probe.pose.position.norm());
        }
        let energy = device.device().energy();
        assert!(farthest > 1e-3 && energy.motor_work != 0.0);
        // Rounding of works of order 0.1 J.
        assert!(energy.residual().abs() < 1e-13, "{}", energy.residual());
    }
}

#[test]
fn along_its_axis_a_paddle_moves_as_a_device_of_three_degrees_of_freedom() {
    // A hand that moves along x alone: the path of a spatial device is a line, too.
    let hand = || {
        let task = Task::new(TaskKind::Tap, Vec3::x());
        Hand::new(task.trajectory(2).expect("a hand can follow it"))
    };
    let spatial = DeviceModel::named("touch").unwrap();
    let paddle = model("touch", [true, false, false]);
    let [mut spatial, mut paddle] =
        [spatial, paddle].map(|model| SimDevice::new(model, Some(hand()), 1e-3).unwrap());
    for k in 0..2000 {
        let [a, b] = [&mut spatial, &mut paddle].map(|device| device.read(k * MS).unwrap());
        assert_eq!(a, b);
        let push = Vec3::x() * force(k).x;
        let across = Vec3::new(0.0, 50.0, -1e300);
        for (device, force) in [(&mut spatial, push), (&mut paddle, push + across)] {
            let wrench = Wrench {
                force,
                moment: Vec3::zeros(),
            };
            device.write(k * MS, &wrench).unwrap();
        }
    }
    assert_eq!(spatial.energy(), paddle.energy());
    assert!(spatial.energy().motor_work != 0.0);
}

#[test]
fn a_device_starts_on_its_axes() {
    let make = || SimDevice::new(model("touch", [true, false, true]), None, 1e-3).unwrap();
    assert_eq!(
        make().capabilities().sensed,
        Freedom::Along(Axes::new([true, false, true]).unwrap())
    );
    let place = Vec3::new(0.01, 0.0, -0.02);
    assert_eq!(make().starting_at(place).unwrap().position(), place);
    let off = make().starting_at(Vec3::new(0.01, 1e-12, 0.0));
    assert_eq!(off.unwrap_err(), SimError::Start);
}
