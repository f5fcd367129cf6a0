//! The controller: one tick, in order.
//!
//! `read -> proxy -> coupling with the local model -> safety -> write`. All devices are read, then the
//! wrenches are computed, then all devices are written, so that two hands on one body are felt at the same
//! instant. [`Controller::tick`] is the law; [`cycle`] puts the device calls around it.

use crate::channel::Channel;
use crate::coupling::{Coupling, CouplingConfig, CouplingCounters};
use crate::device::{Device, DeviceError, DeviceState};
use crate::device_frame::DeviceFrame;
use crate::geometry::{Pose, Twist, Vec3, Wrench};
use crate::local_model::{LocalModel, ModelFault};
use crate::passivity::EnergyAccount;
use crate::record::Telemetry;
use crate::safety::{SafetyConfig, SafetyCounters, Trip};
use crate::{MAX_BODIES, MAX_DEVICES, count_one};
use core::ops::DerefMut;

/// One device as the controller knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceConfig {
    /// Where it stands in the scene.
    pub frame: DeviceFrame,
    /// What may leave for it.
    pub safety: SafetyConfig,
}

/// What a controller is made of.
#[derive(Clone, Debug, Default)]
pub struct ControllerConfig {
    /// The devices, in the order in which they are read and written.
    pub devices: heapless::Vec<DeviceConfig, MAX_DEVICES>,
    /// One coupling for each connected body.
    pub bodies: heapless::Vec<CouplingConfig, MAX_BODIES>,
}

/// The controller's whole state.
#[derive(Clone, Debug)]
pub struct Controller {
    channels: heapless::Vec<Channel, MAX_DEVICES>,
    couplings: heapless::Vec<Coupling, MAX_BODIES>,
    /// Model sent to a body that does not exist.
    stray_models: u64,
    tick: u64,
}

/// A device's reading in one tick: its state, or why there is none.
pub type Reading = Result<DeviceState, DeviceError>;

impl Controller {
    /// A controller at rest, before its first model.
    pub fn new(config: &ControllerConfig) -> Self {
        let devices = config.devices.iter();
        let channels = devices.map(|device| Channel::new(device.frame, device.safety));
        Self {
            channels: channels.collect(),
            couplings: config
                .bodies
                .iter()
                .map(|body| Coupling::new(*body))
                .collect(),
            stray_models: 0,
            tick: 0,
        }
    }

    /// Hands over the newest local model of a body; the next tick takes it into use.
    ///
    /// # Errors
    /// The [`ModelFault`] for which it was refused; refusals are counted.
    pub fn accept(&mut self, body: usize, model: &LocalModel) -> Result<(), ModelFault> {
        if let Some(coupling) = self.couplings.get_mut(body) {
            coupling.accept(model)
        } else {
            count_one(&mut self.stray_models);
            Err(ModelFault::Handles)
        }
    }

    /// One tick of the law: from the devices' readings to the wrench for each (device axes), by device
    /// index, and the record of it.
    pub fn tick(
        &mut self,
        now_ns: u64,
        readings: &[Reading; MAX_DEVICES],
    ) -> ([Wrench; MAX_DEVICES], Telemetry) {
        let mut telemetry = Telemetry::empty();
        telemetry.tick = self.tick;
        telemetry.time_ns = now_ns;
        telemetry.device_count = self.channels.len() as u8;
        telemetry.body_count = self.couplings.len() as u8;
        telemetry.readings = *readings;

        let mut proxies = [(Pose::identity(), Twist::zero()); MAX_DEVICES];
        let fresh = self.read(now_ns, readings, &mut proxies);
        let mut forces = Forces::none();
        self.couple(now_ns, &proxies, &mut forces, &mut telemetry);
        let commands = self.limit(&proxies, fresh, &mut forces, &mut telemetry);
        self.account(&forces, &mut telemetry);
        self.tick = self.tick.wrapping_add(1);
        (commands, telemetry)
    }

    /// The first phase: where each proxy is. Returns which devices gave a state that is believed.
    fn read(
        &mut self,
        now_ns: u64,
        readings: &[Reading; MAX_DEVICES],
        proxies: &mut [(Pose, Twist); MAX_DEVICES],
    ) -> [bool; MAX_DEVICES] {
        let mut fresh = [false; MAX_DEVICES];
        let each = self
            .channels
            .iter_mut()
            .zip(readings)
            .zip(proxies)
            .zip(&mut fresh);
        for (((channel, reading), proxy), fresh) in each {
            if let Ok(state) = reading {
                *fresh = channel.follow(now_ns, state);
            }
            *proxy = channel.on_scene();
        }
        fresh
    }

    /// The second phase: the wrench of each body on each proxy.
    fn couple(
        &mut self,
        now_ns: u64,
        proxies: &[(Pose, Twist); MAX_DEVICES],
        forces: &mut Forces,
        telemetry: &mut Telemetry,
    ) {
        let bodies = self.couplings.iter_mut().zip(&mut forces.by_body);
        for ((coupling, by_device), record) in bodies.zip(&mut telemetry.bodies) {
            let wrenches = coupling.tick(now_ns, proxies);
            for (handle, wrench) in coupling.model().handles().zip(&wrenches) {
                let device = usize::from(handle.device);
                let sums = forces.on_proxies.get_mut(device).into_iter();
                for sum in sums.chain(by_device.get_mut(device)) {
                    *sum = sum.plus(wrench);
                }
            }
            record.sequence = coupling.model().sequence;
            record.epoch = coupling.model().epoch;
            record.age_ns = coupling.age_ns(now_ns);
            record.trust = coupling.trust();
            record.state = coupling.state();
            record.withheld = coupling.withheld();
        }
    }

    /// The third phase: the command for each device. What a device does not take of a wrench is taken off the bodies'
    /// wrenches, too.
    fn limit(
        &mut self,
        proxies: &[(Pose, Twist); MAX_DEVICES],
        fresh: [bool; MAX_DEVICES],
        forces: &mut Forces,
        telemetry: &mut Telemetry,
    ) -> [Wrench; MAX_DEVICES] {
        let mut commands = [Wrench::zero(); MAX_DEVICES];
        let inputs = self.channels.iter_mut().zip(proxies).zip(fresh);
        let inputs = inputs.zip(&forces.on_proxies).zip(&mut forces.passed);
        let outputs = commands.iter_mut().zip(&mut telemetry.devices);
        // Not `enumerate`: its count could overflow, as far as the compiler knows.
        for (((((channel, proxy), fresh), wrench), passed), ((command, record), device)) in
            inputs.zip(outputs.zip(0..MAX_DEVICES))
        {
            let asked = channel.frame.to_device(wrench);
            *command = channel
                .limiter
                .pass(&asked, fresh.then_some(&channel.state));
            let [force, moment] = fractions_passed(&asked, command);
            // The force that left in another direction than asked (a slew limit) is put down to the first body.
            let rest = Wrench {
                force: command.force - asked.force * force,
                moment: Vec3::zeros(),
            };
            let mut rest = channel.frame.on_proxy(&rest);
            // A proxy that follows its hand by a fraction is pushed by that much more than the hand.
            let lever = channel.lever();
            rest.force *= lever;
            let (force, moment) = (force * lever, moment * lever);
            *passed = force;
            let here = forces.by_body.iter_mut();
            for wrench in here.filter_map(|by_device| by_device.get_mut(device)) {
                wrench.force = wrench.force * force + rest.force;
                wrench.moment *= moment;
                rest = Wrench::zero();
            }
            record.pose = proxy.0;
            record.twist = proxy.1;
            record.wrench = Wrench {
                force: channel.frame.rotation * command.force,
                moment: channel.frame.rotation * command.moment,
            };
            record.buttons = channel.state.buttons;
            record.device_time_ns = channel.state.device_time_ns;
            record.fresh = fresh;
            record.safety = channel.limiter.state();
        }
        commands
    }

    /// The last phase: each body's energy, by the wrenches that its devices were in the end told to hold.
    fn account(&mut self, forces: &Forces, telemetry: &mut Telemetry) {
        for (coupling, held) in self.couplings.iter_mut().zip(&forces.by_body) {
            coupling.hold(held, &forces.passed);
        }
        for (coupling, record) in self.couplings.iter().zip(&mut telemetry.bodies) {
            record.energy = *coupling.energy();
        }
    }

    /// The energy of each body's hands so far.
    pub fn energy(&self) -> impl Iterator<Item = EnergyAccount> {
        self.couplings.iter().map(|coupling| *coupling.energy())
    }

    /// What each body's coupling met so far.
    pub fn coupling_counters(&self) -> impl Iterator<Item = CouplingCounters> {
        self.couplings.iter().map(Coupling::counters)
    }

    /// What each device's last stage met so far.
    pub fn safety_counters(&self) -> impl Iterator<Item = SafetyCounters> {
        self.channels
            .iter()
            .map(|channel| channel.limiter.counters())
    }

    /// What tripped each device's last stage first.
    pub fn first_trips(&self) -> impl Iterator<Item = Option<Trip>> {
        self.channels
            .iter()
            .map(|channel| channel.limiter.first_trip())
    }

    /// How many models came for a body that does not exist.
    pub fn stray_models(&self) -> u64 {
        self.stray_models
    }
}

/// The wrenches of one tick.
struct Forces {
    /// The sum over all bodies, on each proxy (scene axes).
    on_proxies: [Wrench; MAX_DEVICES],
    /// Each body's own part of it.
    by_body: [[Wrench; MAX_DEVICES]; MAX_BODIES],
    /// By device, the fraction of the force that the last stage passed, times the clutch's lever.
    passed: [f64; MAX_DEVICES],
}

impl Forces {
    fn none() -> Self {
        Self {
            on_proxies: [Wrench::zero(); MAX_DEVICES],
            by_body: [[Wrench::zero(); MAX_DEVICES]; MAX_BODIES],
            passed: [0.0; MAX_DEVICES],
        }
    }
}

/// The fractions of the commanded force and moment that passed the last stage.
fn fractions_passed(asked: &Wrench, command: &Wrench) -> [f64; 2] {
    let fraction = |asked: f64, left: f64| {
        if asked.is_finite() && asked > 0.0 {
            left / asked
        } else {
            0.0
        }
    };
    [
        fraction(asked.force.norm(), command.force.norm()),
        fraction(asked.moment.norm(), command.moment.norm()),
    ]
}

/// One whole tick with its devices: read all, compute, write all. Returns the record of it and how many
/// devices did not take their wrench.
///
/// `devices` are boxes or references, of one kind of device or of several behind `dyn Device`.
pub fn cycle<D: Device + ?Sized>(
    controller: &mut Controller,
    devices: &mut [impl DerefMut<Target = D>],
    now_ns: u64,
) -> (Telemetry, u32) {
    let mut readings = [const { Err(DeviceError::NoReport) }; MAX_DEVICES];
    for (device, reading) in devices.iter_mut().zip(&mut readings) {
        *reading = device.read(now_ns);
    }
    let (commands, telemetry) = controller.tick(now_ns, &readings);
    let mut refused: u32 = 0;
    for (device, command) in devices.iter_mut().zip(&commands) {
        if device.write(now_ns, command).is_err() {
            refused = refused.saturating_add(1);
        }
    }
    (telemetry, refused)
}
