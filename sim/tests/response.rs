//! The delay from force to motion, found on simulated devices whose delay is known.

use devices::response::{Pulses, Response};
use rt_core::{Device, Wrench};
use sim::{DeviceModel, SimDevice};
use std::collections::VecDeque;

const MS: u64 = 1_000_000;

/// The response that the pulses find on a device whose wrenches arrive `late_ns` after their command.
fn found(name: &str, late_ns: u64) -> Response {
    let model = DeviceModel::named(name).expect("a built-in device");
    let mut device = SimDevice::new(model, None, 1e-3).expect("a sound model");
    let mut pulses = Pulses::new(&model, 1e-3);
    let mut waiting: VecDeque<(u64, Wrench)> = VecDeque::new();
    for tick in 0.. {
        let now_ns = tick * MS;
        while let Some(&(at, wrench)) = waiting.front()
            && at <= now_ns
        {
            waiting.pop_front();
            device.write(at, &wrench).expect("it takes every wrench");
        }
        let reading = device.read(now_ns);
        waiting.push_back((now_ns + late_ns, pulses.tick(&reading)));
        if pulses.ended() {
            break;
        }
    }
    pulses.result().expect("it ended").expect("it moved")
}

#[test]
fn the_delay_is_found_within_its_bound_on_every_device() {
    for (name, _) in sim::models::FILES {
        for late_ns in [0, MS / 2, 2 * MS, 5 * MS + 300_000] {
            let found = found(name, late_ns);
            let exact = late_ns as f64 * 1e-9;
            println!(
                "{name}: {:.3} +- {:.3} ms for {:.3} ms",
                1e3 * found.delay,
                1e3 * found.bound,
                1e3 * exact
            );
            assert!(
                (found.delay - exact).abs() <= found.bound,
                "{name}: {found:?} for {exact} s"
            );
            assert_eq!(found.pulses, 20);
        }
    }
}
