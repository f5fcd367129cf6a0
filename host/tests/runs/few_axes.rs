//! Scenes with devices of one and two degrees of freedom.

use host::run::prepare::{Options, Prepared};
use host::run::session::Session;
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Vec3, Wrench};
use runner::AnyDevice;
use runner::link::LogRecord;
use sim::NetEnergy;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

const PADDLE: &str = include_str!("../../scenes/paddle.toml");
const PANTOGRAPH: &str = include_str!("../../scenes/pantograph.toml");

fn load(text: &str, changes: &[(&str, &str)]) -> Result<LoadedScene, String> {
    let mut text = text.to_owned();
    for (piece, instead) in changes {
        assert!(text.contains(piece), "{piece} is not in the scene");
        text = text.replace(piece, instead);
    }
    Scene::load_texts("x.toml", &text, &BTreeMap::new()).map_err(|error| error.to_string())
}

#[test]
fn devices_of_shipped_scenes_stay_on_their_axes_and_feel_the_body_there() {
    for text in [PADDLE, PANTOGRAPH] {
        let loaded = load(text, &[]).unwrap();
        let freedom = loaded.models[0].freedom();
        let back = World::new(&loaded).unwrap().mounts[0].rotation.inverse();
        let built = Prepared::new(&World::new(&loaded).unwrap(), &Options::new(3.0, 1)).unwrap();
        let (mut largest, mut models) = (0.0_f64, 0);
        let sink = |record: LogRecord<'_>| match record {
            LogRecord::Tick(telemetry) => {
                let state = telemetry.readings[0].unwrap();
                for vector in [state.pose.position, state.twist.linear] {
                    assert_eq!(freedom.part(&vector), vector);
                }
                let force = back * telemetry.devices[0].wrench.force;
                // Rounding of forces of a newton that were turned there and back.
                assert!((freedom.part(&force) - force).norm() < 1e-15);
                largest = largest.max(force.norm());
            }
            LogRecord::Patch(..) => {}
            LogRecord::Model(_, model) => {
                models += 1;
                // The model that hands feel has no force, weight or stiffness across the axes.
                let handle = &model.handles[0];
                let column = model.stiffness[0][0].fixed_view::<3, 3>(0, 0) * Vec3::repeat(1.0);
                for (vector, unit) in [
                    (handle.wrench.force, 1.0),
                    (handle.weight, 1.0),
                    (column, 1e3),
                ] {
                    let own = back * vector;
                    assert!((freedom.part(&own) - own).norm() < 1e-14 * unit, "{own}");
                }
            }
        };
        Session::of(built).run(sink);
        assert!(
            largest > 0.5 && models > 100,
            "{largest} N, {models} models"
        );
    }
}

/// A device that notes the largest work on its hand over time (J), as the simulation integrates it between ticks.
struct Certified {
    device: AnyDevice,
    net: Arc<Mutex<NetEnergy>>,
}

impl Device for Certified {
    fn capabilities(&self) -> Capabilities {
        self.device.capabilities()
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        let state = self.device.read(now_ns);
        let on_hand = self.device.probe().map(|probe| probe.on_hand);
        self.net.lock().expect("nothing panics").observe(on_hand);
        state
    }

    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        self.device.write(now_ns, wrench)
    }
}

#[test]
fn paddles_and_pantographs_are_passive_at_the_port() {
    // Models of 20 Hz that are 50 ms late, which a plain spring would not survive without net energy.
    let late = "[host]\nstep_rate = 100.0\npublish_rate = 20.0\nlatency = 0.05\n";
    let paddle = "[host]\nstep_rate = 100.0\npublish_rate = 100.0\nlatency = 0.01\n";
    let sheet = "\n[[body]]\n";
    let late_sheet = format!("\n{late}{sheet}");
    let linear = |scene: &str, scheme: &str| format!("{scene}\n[loop]\nscheme = \"{scheme}\"\n");
    let mut worst: f64 = 0.0;
    for (text, changes) in [
        (PADDLE, (paddle, late)),
        (PANTOGRAPH, (sheet, &*late_sheet)),
    ] {
        let net = |scheme: &str| {
            let loaded = load(&linear(text, scheme), &[changes]).unwrap();
            let mut built =
                Prepared::new(&World::new(&loaded).unwrap(), &Options::new(4.0, 1)).unwrap();
            let net = Arc::new(Mutex::new(NetEnergy::new(0.0)));
            let device = built.tick.devices.remove(0);
            let net_of = Arc::clone(&net);
            let watched = Certified {
                device,
                net: net_of,
            };
            built.tick.devices.push(Box::new(watched));
            Session::of(built).run(|_| {});
            let net = net.lock().expect("nothing panics");
            net.largest()
        };
        let (capped, linear) = (net("capped"), net("linear"));
        // The bound of the cap: its allowance, and the debt up to which it damps.
        assert!(capped < 1e-3, "{capped} J");
        worst = worst.max(linear);
    }
    // The faults are such that a scheme without a cap fails.
    assert!(worst > 2e-3, "{worst} J");
}

#[test]
fn a_handle_off_the_axes_and_a_motion_across_them_are_errors() {
    let mount = "[device.mounting]\n";
    let near = "[device.mounting]\norigin = [0.0, 0.0, 0.05]\n";
    let loaded = load(PADDLE, &[(mount, near)]).unwrap();
    // The paddle's x is the scene's -z: the handle lies 20 mm along it.
    let start = World::new(&loaded).unwrap().mounts[0].start;
    assert!(
        (start - Vec3::new(0.02, 0.0, 0.0)).norm() < 1e-12,
        "{start}"
    );
    assert_eq!(start.yz(), Vec3::zeros().yz());

    let beside = "[device.mounting]\norigin = [0.0, 0.001, 0.05]\n";
    let loaded = load(PADDLE, &[(mount, beside)]).unwrap();
    let error = World::new(&loaded).unwrap_err().to_string();
    assert!(
        error.starts_with(
            "x.toml:40: device[0].mounting.origin: found a handle at rest that is off the axes"
        ) && error.contains("(0.000000, -0.001000, 0.000000) m"),
        "{error}"
    );

    let across = [("direction = [1, 0, 0]", "direction = [0, 2, 0]")];
    assert_eq!(
        load(PADDLE, &across).unwrap_err(),
        "x.toml:45: device[0].hand.direction: found [0.0, 2.0, 0.0], allowed: a direction with a part along x, the \
         axes along which this device moves"
    );
    assert!(load(PANTOGRAPH, &across).is_ok());
}
