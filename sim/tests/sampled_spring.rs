//! The simulated device against theory: the stiffness at which a sampled virtual spring becomes active.
//!
//! A mass `M` with damping `b` is pulled to its origin by a spring `K` that is sampled every `T` and held in between.
//! The motion is stable only for `K < 2 b / T` (Colgate & Schenkel 1997; exact to `b T / M`). The condition does not
//! hold with friction and encoder counts, so the device here has neither.

use rt_core::{Device, Vec3, Wrench};
use sim::{DeviceModel, SimDevice};

/// Whether the swing about the spring's rest position grows over 20 s.
fn grows(fraction_of_limit: f64) -> bool {
    let model = DeviceModel {
        friction: 0.0,
        position_step: 1e-12,
        max_force: 1e9,
        ..DeviceModel::named("falcon").unwrap()
    };
    let period = 1e-3;
    let stiffness = fraction_of_limit * 2.0 * model.damping / period;
    let start = Vec3::new(0.01, 0.0, 0.0);
    let mut device = SimDevice::new(model, None, period)
        .unwrap()
        .starting_at(start)
        .unwrap();
    for tick in 0..20_000 {
        let now = tick * 1_000_000;
        let state = device.read(now).unwrap();
        let force = state.pose.position * -stiffness;
        device
            .write(
                now,
                &Wrench {
                    force,
                    moment: Vec3::zeros(),
                },
            )
            .unwrap();
    }
    let swing = 0.5 * stiffness * device.position().norm_squared() + device.energy().kinetic;
    swing > 0.5 * stiffness * start.norm_squared()
}

#[test]
fn a_sampled_spring_is_active_beyond_twice_the_damping_over_the_period() {
    // b T / M is 0.3 % here. A change of the net damping by 1 % changes the swing by a factor of exp(0.01 * 0.5 / 0.15
    // * 20) = 2 in 20 s: 2 % on both sides of the limit, the answer is clear.
    assert!(!grows(0.98));
    assert!(grows(1.02));
}

#[test]
fn the_energy_of_a_sampled_spring_shows_at_the_port() {
    let work = |fraction: f64| {
        let model = DeviceModel {
            friction: 0.0,
            position_step: 1e-12,
            ..DeviceModel::named("falcon").unwrap()
        };
        let stiffness = fraction * 2.0 * model.damping / 1e-3;
        let start = Vec3::new(1e-3, 0.0, 0.0);
        let mut device = SimDevice::new(model, None, 1e-3)
            .unwrap()
            .starting_at(start)
            .unwrap();
        let spring = |x: Vec3| 0.5 * stiffness * x.norm_squared();
        for tick in 0..10_000 {
            let now = tick * 1_000_000;
            let position = device.read(now).unwrap().pose.position;
            let wrench = Wrench {
                force: position * -stiffness,
                moment: Vec3::zeros(),
            };
            device.write(now, &wrench).unwrap();
        }
        // A true spring could give at most the energy of its initial stretch, minus the energy that it holds now.
        device.energy().motor_work - (spring(start) - spring(device.position()))
    };
    // The sampled spring adds a negative damping of K T / 2 at any stiffness. The device's own damping keeps the whole
    // passive.
    assert!(work(0.5) > 0.0 && work(1.1) > work(0.5));
}
