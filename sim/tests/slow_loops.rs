//! Loops of every rate hold their force on devices of every protocol, and no device lets go between two ticks.

use devices::{DeviceModel, Registry, Request};
use rt_core::{Rendering, Vec3, Wrench};
use sim::protocol::Protocol;
use sim::{EmulatedDriver, Hand, Held, Trajectory};

#[test]
fn a_force_is_held_between_the_ticks_of_a_slow_loop() {
    let devices = [
        // 4 kHz, and 1 kHz.
        ("omega3", Protocol::Reports),
        ("omega3", Protocol::Stream),
        ("touch", Protocol::Stream),
        ("woodenhaptics", Protocol::WoodenHaptics),
        ("falcon", Protocol::Falcon),
    ];
    let held = |(_, protocol)| Held {
        hand: Some(Hand::new(Trajectory::still())),
        wired: false,
        start: Vec3::zeros(),
        protocol,
    };
    let registry = Registry::new().with(EmulatedDriver::new(devices.map(held).to_vec()));
    let push = Wrench {
        force: Vec3::new(0.0, 0.5, 0.0),
        moment: Vec3::zeros(),
    };
    for (index, (name, protocol)) in devices.into_iter().enumerate() {
        let model = DeviceModel::named(name).expect("a built-in device");
        // A loop has at least 100 Hz.
        for rate in [100, 120, 150, 400, 1000] {
            let at = format!("{protocol} ({name}) at {rate} Hz");
            let period_ns = 1_000_000_000 / rate;
            let request = Request {
                index,
                period: 1.0 / rate as f64,
                ..Request::new(&model, "")
            };
            let device = registry.open("emulated", &request);
            let mut device = device.unwrap_or_else(|error| panic!("{at}: {error}"));
            for tick in 0..100 {
                let state = device.read(tick * period_ns);
                // The first state comes for the first wrench.
                if tick > 3 {
                    let rendering = state.map(|state| state.rendering);
                    assert_eq!(rendering, Ok(Rendering::Commanded), "{at}, tick {tick}");
                    let force = device.probe().expect("it is simulated").held.force;
                    // Whole currents and torques are some millinewtons, and the handle yields between two ticks.
                    let error = (force - push.force).norm();
                    assert!(error < 0.02, "{at}, tick {tick}: {force}");
                }
                device
                    .write(tick * period_ns, &push)
                    .expect("there is room");
            }
            assert_eq!(device.refused_wrenches().unwrap_or(0), 0, "{at}");
        }
    }
}
