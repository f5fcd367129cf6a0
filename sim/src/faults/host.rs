//! The host of a run: the driver of the device, and the controller with the wall.

use super::driver::Driver;
use super::link::Link;
use super::{DISTANCE, PATIENCE, PERIOD_NS, Protocol, WALL};
use crate::DeviceModel;
use rt_core::controller::{DeviceConfig, Reading};
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::{SafetyConfig, SafetyState};
use rt_core::velocity::{VelocityEstimator, most_damping};
use rt_core::{
    Controller, ControllerConfig, DeviceError, Freedom, LocalModel, MAX_DEVICES, PassivityConfig,
    Port, Scheme, Vec3,
};

/// Period of the tick (s).
const PERIOD: f64 = PERIOD_NS as f64 * 1e-9;

/// The host.
pub(super) struct Host {
    link: Link,
    driver: Driver,
    controller: Controller,
    commands: Vec<(u64, f64)>,
    missed: u64,
    /// Ticks in a row without a state; `None` before the first state.
    without: Option<u64>,
    from_ns: u64,
    /// Times that the controller took the device for silent, before the fault.
    trips_before: u64,
    jump: f64,
    /// What the last stage did in the last tick.
    safety: Option<SafetyState>,
}

impl Host {
    /// A host that has opened the device.
    pub(super) fn new(protocol: Protocol, model: &DeviceModel, link: &Link, from_ns: u64) -> Self {
        let driver = Driver::open(protocol, model, PERIOD, link);
        let mut controller = Controller::new(&config(model));
        if let Err(fault) = controller.accept(0, &wall()) {
            panic!("the wall is refused: {fault:?}");
        }
        Self {
            link: link.clone(),
            driver,
            controller,
            commands: Vec::new(),
            missed: 0,
            without: None,
            from_ns,
            trips_before: 0,
            jump: 0.0,
            safety: None,
        }
    }

    /// The process is stopped at `now_ns`.
    pub(super) fn stop(&mut self, now_ns: u64) {
        self.driver.run(&self.link, now_ns);
    }

    /// One tick.
    pub(super) fn tick(&mut self, now_ns: u64) {
        let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
        let reading = self.driver.read(&self.link, now_ns);
        match (&reading, self.without) {
            (Ok(_), _) => self.without = Some(0),
            (Err(_), Some(without)) => {
                self.without = Some(without + 1);
                self.missed += 1;
            }
            (Err(_), None) => {}
        }
        readings[0] = reading;
        let (commands, telemetry) = self.controller.tick(now_ns, &readings);
        self.safety = telemetry.devices().next().map(|device| device.safety);
        let [command, ..] = commands;
        self.driver.write(&self.link, now_ns, &command);
        let force = command.force.norm();
        if now_ns >= self.from_ns {
            if let Some((_, last)) = self.commands.last() {
                self.jump = self.jump.max(force - last);
            }
            self.commands.push((now_ns, force));
        } else {
            self.trips_before = self.silences();
        }
    }

    /// When the first command of no force left after the fault began (ns).
    pub(super) fn gone_ns(&self) -> Option<u64> {
        let gone = self.commands.iter().find(|(_, force)| *force == 0.0);
        gone.map(|(at_ns, _)| *at_ns)
    }

    /// Largest growth of a command since the fault began, from one tick to the next (N).
    pub(super) fn jump(&self) -> f64 {
        self.jump
    }

    /// Number of ticks without a state, after the first state.
    pub(super) fn missed(&self) -> u64 {
        self.missed
    }

    /// Whether there has been no state for a while.
    pub(super) fn is_without_state(&self) -> bool {
        self.without.is_none_or(|ticks| ticks > 20)
    }

    /// Whether the last command passed, up to the largest force of the device.
    pub(super) fn is_back(&self) -> bool {
        matches!(
            self.safety,
            Some(SafetyState::Normal | SafetyState::Limited)
        )
    }

    /// Number of times that the controller took the device for silent since the fault began.
    pub(super) fn trips(&self) -> u64 {
        self.silences() - self.trips_before
    }

    fn silences(&self) -> u64 {
        self.controller
            .safety_counters()
            .map(|counts| counts.stale)
            .sum()
    }
}

/// The controller of one device and one body.
fn config(model: &DeviceModel) -> ControllerConfig {
    let mut passivity = PassivityConfig::new(PERIOD);
    // A wrench acts before the next tick but one.
    passivity.delay = 1;
    let late = VelocityEstimator::for_encoder(PERIOD, model.position_step).delay() + PERIOD;
    passivity.ports[0] = Port {
        damping: model.damping,
        friction: model.friction,
        count: model.position_step,
        most_damping: most_damping(model.mass, PERIOD, late),
        ..Port::UNKNOWN
    };
    let mut config = ControllerConfig::default();
    let device = DeviceConfig {
        frame: DeviceFrame::at(Vec3::new(0.0, 0.0, DISTANCE)),
        safety: SafetyConfig {
            actuated: Freedom::Three,
            // The driver of the Falcon asks for no more.
            max_force: model.max_force.min(5.0),
            max_moment: 0.0,
            patience: PATIENCE,
            recovery: 0.2,
            ..SafetyConfig::unlimited(PERIOD)
        },
    };
    let body = CouplingConfig {
        scheme: Scheme::Capped,
        period: PERIOD,
        blend: 0.5,
        // The wall is published once, and stays valid.
        age_limit: 1e6,
        decay: 0.1,
        recovery: 0.2,
        hold_damping: [0.0; MAX_DEVICES],
        passivity,
    };
    // The lists have room for one.
    let _ = config.devices.push(device);
    let _ = config.bodies.push(body);
    config
}

/// A wall at the origin of the scene, which pushes towards positive z.
fn wall() -> LocalModel {
    let [stiffness, damping] = WALL;
    let mut model = LocalModel::empty();
    model.sequence = 1;
    model.time_ns = 1;
    model.period = PERIOD;
    model.handle_count = 1;
    model.handles[0].contact[2] = 1.0;
    model.stiffness[0][0][(2, 2)] = stiffness;
    model.damping[0][0][(2, 2)] = damping;
    model
}
