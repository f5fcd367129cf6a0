//! The host of a run: the driver of the device, and the controller with the wall.

use super::run::{DISTANCE, PATIENCE, PERIOD_NS, Plan, RECOVERY, WALL};
use rt_core::Reading;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::engage::{ARM_ORDER, EngageConfig, STOP_ORDER};
use rt_core::safety::{SafetyConfig, SafetyState};
use rt_core::velocity::{VelocityEstimator, most_damping};
use rt_core::{
    Controller, ControllerConfig, DeviceError, Freedom, LocalModel, MAX_DEVICES, PassivityConfig,
    Port, Scheme, Telemetry, TickTime, Vec3,
};
use sim::DeviceModel;
use sim::emulated::driver::Driver;
use sim::emulated::fault::{Injected, Kind};
use sim::emulated::link::Link;
use sim::protocol::Protocol;

/// Period of the tick (s).
const PERIOD: f64 = PERIOD_NS as f64 * 1e-9;
/// The dead-man button.
const DEAD_MAN: u32 = 1 << 8;
/// Time from a command to the force of the device, at most, if none is late (ns).
const ANSWERED_NS: u64 = 4 * PERIOD_NS;
/// Time between two models of a host that publishes more than one (ns).
const PUBLISHED_NS: u64 = 8 * PERIOD_NS;

/// The largest number of ticks from a command to its force that the cap assumes.
const DELAY: usize = 1;
/// Time in which the damper of the cap that takes out missing energy grows to the largest damping of the device (s).
const EASE: f64 = 0.02;

/// What the hand may feel of the wall in a tick.
#[derive(Clone, Copy, Debug, Default)]
struct Felt {
    /// Force of the wall at the proxy (N): of a wall that only pushes, and of one that also pulls. A model that comes while
    /// the hand is outside the wall replaces a model that does not push there, and is blended with it: the hand then feels a
    /// part of its way to the wall.
    forces: [f64; 2],
    /// Distance of the proxy behind the wall (m).
    depth: f64,
    /// Velocity of the proxy (m/s).
    velocity: Vec3,
    /// Number of ticks in which the scheme damped or capped.
    acted: u64,
}

/// The host.
pub(super) struct Host {
    link: Link,
    driver: Driver,
    controller: Controller,
    /// From shortly before the fault on: the time of each command (ns), its force, and the growth of the force that the
    /// motion of the hand and the ramps explain (N).
    commands: Vec<(u64, f64, f64)>,
    scheme: Scheme,
    /// What the hand may feel in the last tick.
    felt: Felt,
    /// Whether the scheme damped or capped in the last tick.
    acts: bool,
    /// Largest damping that is rendered on the device (N s/m).
    damping: f64,
    missed: u64,
    /// Ticks in a row without a state; `None` before the first state.
    without: Option<u64>,
    fault: Injected,
    /// Time of the last tick (ns): the host knows of no later one.
    told_ns: u64,
    /// Times that the controller took the device for silent, before the fault.
    trips_before: u64,
    /// What the last stage did in the last tick.
    safety: Option<SafetyState>,
}

impl Host {
    /// A host that has opened the device.
    pub(super) fn new(protocol: Protocol, plan: &Plan, link: &Link, fault: Injected) -> Self {
        let mut new = Self {
            link: link.clone(),
            driver: Driver::open(protocol, &plan.model, PERIOD, link),
            controller: Controller::new(&config(plan, fault.kind)),
            commands: Vec::new(),
            scheme: plan.scheme,
            felt: Felt::default(),
            acts: false,
            damping: late_damping(&plan.model),
            missed: 0,
            without: None,
            fault,
            told_ns: 0,
            trips_before: 0,
            safety: None,
        };
        new.publish(1);
        new
    }

    /// The host publishes the wall.
    fn publish(&mut self, now_ns: u64) {
        if let Err(fault) = self.controller.accept(0, &wall(now_ns)) {
            panic!("the wall is refused: {fault:?}");
        }
    }

    /// The process is stopped at `now_ns`.
    pub(super) fn stop(&mut self, now_ns: u64) {
        self.driver.run(&self.link, now_ns);
    }

    /// The tick of the deadline `now_ns`. The tick wakes at `woke_ns`, and its command leaves at `left_ns`.
    pub(super) fn tick(&mut self, now_ns: u64, woke_ns: u64, left_ns: u64) {
        let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
        let acts = |kind| self.fault.is(kind, now_ns);
        // The last model is in use at the first tick.
        let publishes = self.fault.kind == Kind::StaleHost && !acts(Kind::StaleHost);
        let mut buttons = if acts(Kind::HandsOff) { 0 } else { DEAD_MAN };
        if self.fault.kind == Kind::Ordered && now_ns >= self.fault.to_ns {
            buttons |= ARM_ORDER;
        } else if acts(Kind::Ordered) {
            buttons |= STOP_ORDER;
        }
        if publishes && self.told_ns > 0 && now_ns.is_multiple_of(PUBLISHED_NS) {
            self.publish(self.told_ns);
        }
        self.told_ns = now_ns;
        let reading = self.driver.read(&self.link, woke_ns);
        let reading = reading.map(|mut state| {
            state.buttons |= buttons;
            state
        });
        match (&reading, self.without) {
            (Ok(_), _) => self.without = Some(0),
            (Err(_), Some(without)) => {
                self.without = Some(without + 1);
                self.missed += 1;
            }
            (Err(_), None) => {}
        }
        readings[0] = reading;
        let time = TickTime {
            now_ns,
            lateness_ns: woke_ns - now_ns,
        };
        let (mut commands, mut telemetry) = self.controller.tick(time, &readings);
        if left_ns > woke_ns {
            // The other threads and the device continue.
            self.driver.run(&self.link, left_ns);
            self.link.run(left_ns);
        }
        (self.controller).end(left_ns - woke_ns, &mut commands, &mut telemetry);
        self.safety = telemetry.devices().next().map(|device| device.safety);
        let [command, ..] = commands;
        self.driver.write(&self.link, left_ns, &command);
        let force = command.force.norm();
        let explained = self.explained(&telemetry);
        // The device may answer a command from before the fault after it.
        if now_ns + ANSWERED_NS >= self.fault.from_ns {
            self.commands.push((left_ns, force, explained));
        }
        if now_ns < self.fault.from_ns {
            self.trips_before = self.silences();
        }
    }

    /// The growth of the force that the motion of the hand in a tick and the ramps explain (N).
    ///
    /// - The wall itself: its spring, and its damper, which the hand meets at once at the surface. Under the cap, the spring
    ///   resists a part of each step as a damper would.
    /// - One force comes in at a time. No smooth step rises faster than 1.5 times its mean.
    /// - The dampers that take out missing energy. They follow the velocity along all axes, in which each count shows. That
    ///   of the cap comes in gradually. That of the classic controller acts in full from one tick to the next, as its
    ///   authors propose, and takes back what has left the wall: after a force has faded while the hand was in the wall, its
    ///   return gives the hand more than it supplied.
    fn explained(&mut self, telemetry: &Telemetry) -> f64 {
        let Some(proxy) = telemetry.devices().next() else {
            return 0.0;
        };
        let before = self.felt;
        let depth = -proxy.pose.position.z;
        let velocity = proxy.twist.linear;
        let acted = telemetry.bodies[0].energy.capped;
        let [stiffness, damping] = WALL;
        let spring = stiffness * depth;
        let damper = -damping * velocity.z;
        let forces = if self.scheme == Scheme::Capped {
            let late = (0.5 + DELAY as f64).min(self.damping / (stiffness * PERIOD));
            let pulls = spring + damper + late * stiffness * (depth - before.depth);
            // The damper acts wherever the spring does, and pulls a hand that leaves. Rounding of a place.
            [if depth > -1e-12 { pulls.abs() } else { 0.0 }, pulls]
        } else {
            [(spring + damper).max(0.0), spring + damper]
        };
        self.felt = Felt {
            forces,
            depth,
            velocity,
            acted,
        };
        let acts = acted > before.acted;
        let did = std::mem::replace(&mut self.acts, acts);
        let changed = (velocity - before.velocity).norm();
        let damped = match self.scheme {
            Scheme::Capped => changed + PERIOD / EASE * velocity.norm(),
            Scheme::Classic if acts || did => velocity.norm() + before.velocity.norm(),
            _ => 0.0,
        };
        let grown = forces.into_iter().zip(before.forces);
        let grown = grown.map(|(now, before)| now - before).fold(0.0, f64::max);
        let [pushes, _] = forces;
        grown + 1.5 * pushes * PERIOD / RECOVERY + self.damping * damped
    }

    /// When the first command of no force left after the fault began (ns).
    pub(super) fn gone_ns(&self) -> Option<u64> {
        let mut commands = self.commands.iter();
        let from_ns = self.fault.from_ns;
        let gone = commands.find(|(at_ns, force, _)| *at_ns >= from_ns && *force == 0.0);
        gone.map(|(at_ns, ..)| *at_ns)
    }

    /// Largest growth of a command since the fault began, from one tick to the next, beyond the growth that the motion of the
    /// hand and the ramps explain (N).
    pub(super) fn jump(&self) -> f64 {
        let pairs = self.commands.iter().zip(self.commands.iter().skip(1));
        let grown = pairs.map(|((_, before, _), (_, now, explained))| now - before - explained);
        grown.fold(0.0, f64::max)
    }

    /// The same growth of the force at the device, in `forces` at whole milliseconds since the fault began. A force at the
    /// device answers one of the last ticks.
    pub(super) fn device_jump(&self, forces: &[(u64, f64)]) -> f64 {
        let pairs = forces.iter().zip(forces.iter().skip(1));
        let grown = pairs.map(|((_, before), (at_ns, now))| {
            let least_ns = at_ns.saturating_sub(ANSWERED_NS);
            let from = self
                .commands
                .partition_point(|(left_ns, ..)| *left_ns < least_ns);
            let recent = self.commands.iter().skip(from);
            let recent = recent.take_while(|(left_ns, ..)| left_ns <= at_ns);
            now - before - recent.map(|(_, _, explained)| explained).sum::<f64>()
        });
        grown.fold(0.0, f64::max)
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

/// Largest damping that is rendered on a device (N s/m).
fn late_damping(model: &DeviceModel) -> f64 {
    let late = VelocityEstimator::for_encoder(PERIOD, model.position_step).delay() + PERIOD;
    most_damping(model.mass, PERIOD, late)
}

/// The controller of one device and one body.
fn config(plan: &Plan, kind: Kind) -> ControllerConfig {
    let model = &plan.model;
    let mut passivity = PassivityConfig::new(PERIOD);
    // A wrench acts before the next tick but one.
    passivity.delay = DELAY;
    passivity.ports[0] = Port {
        damping: model.damping,
        friction: model.friction,
        count: model.position_step,
        most_damping: late_damping(model),
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
            recovery: RECOVERY,
            engage: EngageConfig {
                dead_man: DEAD_MAN,
                ramp: plan.ramp,
                ..EngageConfig::default()
            },
            ..SafetyConfig::unlimited(PERIOD)
        },
    };
    let body = CouplingConfig {
        scheme: plan.scheme,
        period: PERIOD,
        blend: 0.5,
        // A wall that is published once stays valid.
        age_limit: if kind == Kind::StaleHost { 0.02 } else { 1e6 },
        decay: 0.1,
        recovery: RECOVERY,
        hold_damping: [0.0; MAX_DEVICES],
        passivity,
    };
    // The lists have room for one.
    let _ = config.devices.push(device);
    let _ = config.bodies.push(body);
    config
}

/// A wall at the origin of the scene, which pushes towards positive z, as published at `now_ns`.
fn wall(now_ns: u64) -> LocalModel {
    let [stiffness, damping] = WALL;
    let mut model = LocalModel::empty();
    model.head.sequence = now_ns;
    model.head.time_ns = now_ns;
    model.head.period = PERIOD;
    model.head.handle_count = 1;
    model.handles[0].contact[2] = 1.0;
    model.stiffness[0][0][(2, 2)] = stiffness;
    model.damping[0][0][(2, 2)] = damping;
    model
}
