//! The controller's record of the forces that it held back, against springs whose force is known.

use rt_core::Reading;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyConfig;
use rt_core::{
    Controller, ControllerConfig, DeviceError, DeviceState, Freedom, HeldBack, HeldBackByBody,
    HeldBackByDevice, LocalModel, MAX_DEVICES, PassivityConfig, Pose, Scheme, Vec3,
};

const PERIOD: f64 = 1e-3;
const STIFFNESS: f64 = 200.0;
/// Time in which a force fades, and in which it comes back (s).
const FADE: f64 = 0.05;
/// Age above which a model is not trusted (s).
const AGE_LIMIT: f64 = 0.3;

/// A controller of one device on one spring, with the last stage's limits changed by `change`.
fn controller(change: impl Fn(&mut SafetyConfig)) -> Controller {
    let mut safety = SafetyConfig {
        actuated: Freedom::Three,
        max_force: 8.0,
        max_moment: 0.0,
        patience: 10,
        decay: FADE,
        recovery: FADE,
        ..SafetyConfig::unlimited(PERIOD)
    };
    change(&mut safety);
    let mut config = ControllerConfig::default();
    let frame = DeviceFrame::at(Vec3::zeros());
    config
        .devices
        .push(DeviceConfig { frame, safety })
        .expect("there is room");
    config
        .bodies
        .push(CouplingConfig {
            scheme: Scheme::Linear,
            period: PERIOD,
            blend: 0.5,
            age_limit: AGE_LIMIT,
            decay: FADE,
            recovery: FADE,
            hold_damping: [1.0; MAX_DEVICES],
            passivity: PassivityConfig::new(PERIOD),
        })
        .expect("there is room");
    Controller::new(&config)
}

/// Ticks the controller over `ticks` with a device at 10 mm (2 N of the spring), which is silent in the ticks `silent`.
/// A new model comes every 4 ms until `models_until`.
fn run(controller: &mut Controller, ticks: u64, silent: core::ops::Range<u64>, models_until: u64) {
    let mut model = LocalModel::empty();
    model.head.handle_count = 1;
    model.head.period = 4.0 * PERIOD;
    model.stiffness[0][0][(0, 0)] = STIFFNESS;
    for tick in 0..ticks {
        let now_ns = tick * 1_000_000;
        if tick % 4 == 0 && tick < models_until {
            model.head.sequence += 1;
            model.head.time_ns = now_ns;
            controller.accept(0, &model).expect("a good model");
        }
        let mut state = DeviceState::resting();
        state.pose = Pose::at(Vec3::new(0.01, 0.0, 0.0));
        state.device_time_ns = now_ns;
        let mut readings: [Reading; MAX_DEVICES] =
            [const { Err(DeviceError::NoReport) }; MAX_DEVICES];
        if !silent.contains(&tick) {
            readings[0] = Ok(state);
        }
        controller.tick(now_ns, &readings);
    }
}

fn near(found: f64, expected: f64) -> bool {
    (found - expected).abs() < 1e-9
}

#[test]
fn a_force_limit_holds_back_the_rest_of_the_force() {
    let mut controller = controller(|safety| safety.max_force = 1.5);
    run(&mut controller, 500, 0..0, 500);
    let limited = controller
        .held_back_by_devices()
        .next()
        .expect("a device")
        .limited;
    assert!(
        near(limited.most, 0.5) && near(limited.of, 2.0),
        "{limited:?}"
    );
    // The force grows along a smooth step in 50 ms, and then stays beyond the limit.
    assert!(limited.mean() > 0.49 && limited.mean() < 0.5);
    assert!(limited.first_ns > 20_000_000 && limited.first_ns < 50_000_000);
    assert_eq!(limited.last_ns, 499_000_000);
    assert_eq!(
        limited.ticks,
        (limited.last_ns - limited.first_ns) / 1_000_000 + 1
    );
}

#[test]
fn a_silent_device_holds_back_the_whole_force_until_it_has_returned() {
    let mut controller = controller(|_| {});
    run(&mut controller, 500, 200..300, 500);
    let held = controller.held_back_by_devices().next().expect("a device");
    // The last state serves for ten ticks. The force then is zero to the end of the silence.
    assert_eq!((held.silent.ticks, held.silent.first_ns), (90, 210_000_000));
    assert!(near(held.silent.mean(), 2.0) && near(held.silent.most, 2.0));
    // It returns along a smooth step in 50 ms, whose mean is one half.
    assert_eq!(held.recovering.first_ns, 300_000_000);
    assert!(
        held.recovering.ticks.abs_diff(47) <= 3,
        "{:?}",
        held.recovering
    );
    let sum = held.recovering.sum * PERIOD;
    assert!((sum - 2.0 * FADE / 2.0).abs() < 3e-3, "{sum}");
    assert_eq!(held.limited, HeldBack::default());
}

#[test]
fn an_old_model_holds_back_its_force_and_the_start_of_a_run_does_not() {
    let mut controller = controller(|_| {});
    run(&mut controller, 600, 0..0, 101);
    let held = controller.held_back_by_bodies().next().expect("a body");
    // The last model is of 100 ms, too old from 401 ms on, and fades in 50 ms.
    assert!(
        held.aged.first_ns.abs_diff(405_000_000) <= 4_000_000,
        "{:?}",
        held.aged
    );
    assert_eq!(held.aged.last_ns, 599_000_000);
    assert!(near(held.aged.most, 2.0), "{:?}", held.aged);
    assert_eq!(held.capped, HeldBack::default());
}

#[test]
fn a_whole_force_is_not_held_back() {
    let mut controller = controller(|_| {});
    run(&mut controller, 300, 0..0, 300);
    assert_eq!(
        controller.held_back_by_devices().next(),
        Some(HeldBackByDevice::default())
    );
    assert_eq!(
        controller.held_back_by_bodies().next(),
        Some(HeldBackByBody::default())
    );
}
