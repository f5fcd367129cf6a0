//! The controller: one tick, in order.
//!
//! `read -> proxy -> coupling with the local model -> safety -> write`. All devices are read, then all wrenches are
//! computed, then all devices are written, so that the wrenches on two hands of one body belong to the same instant.
//! [`Controller::tick`] is the law; [`cycle`] adds the calls of the devices.

use crate::channel::Channel;
use crate::coupling::{Coupling, CouplingConfig, CouplingCounters, Passed};
use crate::device::{Device, DeviceError, Freedom, Reading};
use crate::device_frame::DeviceFrame;
use crate::geometry::{Pose, Twist, Vec3, Wrench};
use crate::held_back::{HeldBackByBody, HeldBackByDevice};
use crate::local_model::{ModelFault, PublishedModel};
use crate::passivity::EnergyAccount;
use crate::publication::Publication;
use crate::record::{Stamps, Telemetry, ToolTelemetry};
use crate::safety::{SafetyConfig, SafetyCounters, Trip};
use crate::slip::Asked;
use crate::square_wave::SquareWave;
use crate::tool::{PatchFault, PatchHead, ToolCoupling, ToolCouplingConfig};
use crate::{MAX_BODIES, MAX_DEVICES, count_one};
#[expect(
    clippy::disallowed_types,
    reason = "the couplings are allocated before the first tick"
)]
use alloc::boxed::Box;
use core::ops::DerefMut;

/// Configuration of one device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceConfig {
    /// Place and axes of the device in the scene.
    pub frame: DeviceFrame,
    /// Limits of the commands to the device.
    pub safety: SafetyConfig,
}

/// Configuration of a controller.
#[derive(Clone, Debug, Default)]
pub struct ControllerConfig {
    /// The devices, in the order in which they are read and written.
    pub devices: heapless::Vec<DeviceConfig, MAX_DEVICES>,
    /// One coupling for each connected body.
    pub bodies: heapless::Vec<CouplingConfig, MAX_BODIES>,
    /// The tool of each device, by device. A device may hold a handle of a body, too: both forces add up.
    pub tools: [Option<ToolCouplingConfig>; MAX_DEVICES],
    /// The square wave that each device is commanded beside the forces of bodies and tools, by device.
    pub square_waves: [Option<SquareWave>; MAX_DEVICES],
}

/// The controller: the law and its whole state.
///
/// ```
/// use rt_core::controller::DeviceConfig;
/// use rt_core::coupling::CouplingConfig;
/// use rt_core::device_frame::DeviceFrame;
/// use rt_core::safety::SafetyConfig;
/// use rt_core::{
///     Controller, ControllerConfig, DeviceError, DeviceState, Freedom, LocalModel, MAX_DEVICES,
///     PassivityConfig, Pose, Scheme, Vec3,
/// };
///
/// // One device on one body, ticks of 1 ms.
/// let period = 1e-3;
/// let mut config = ControllerConfig::default();
/// let device = DeviceConfig {
///     frame: DeviceFrame::at(Vec3::zeros()),
///     safety: SafetyConfig {
///         actuated: Freedom::Three,
///         max_force: 8.0,
///         ..SafetyConfig::unlimited(period)
///     },
/// };
/// let body = CouplingConfig {
///     scheme: Scheme::Linear,
///     period,
///     blend: 0.5,
///     age_limit: 0.1,
///     decay: 0.1,
///     recovery: 0.1,
///     hold_damping: [1.0; MAX_DEVICES],
///     passivity: PassivityConfig::new(period),
/// };
/// config.devices.push(device).unwrap();
/// config.bodies.push(body).unwrap();
/// let mut controller = Controller::new(&config);
///
/// // The host publishes a spring of 200 N/m.
/// let mut model = LocalModel::empty();
/// model.head.sequence = 1;
/// model.head.period = 0.01;
/// model.head.horizon = 0.01;
/// model.head.handle_count = 1;
/// for axis in 0..3 {
///     model.stiffness[0][0][(axis, axis)] = 200.0;
/// }
/// controller.accept(0, &model).unwrap();
///
/// // The hand holds the handle 1 mm away from the reference.
/// let mut readings = [Err(DeviceError::NoReport); MAX_DEVICES];
/// readings[0] = Ok(DeviceState {
///     pose: Pose::at(Vec3::new(1e-3, 0.0, 0.0)),
///     ..DeviceState::resting()
/// });
/// let mut force = 0.0;
/// for tick in 0..100 {
///     let (commands, _) = controller.tick(tick * 1_000_000, &readings);
///     // The force grows smoothly to that of the model.
///     assert!(commands[0].force.x <= force);
///     force = commands[0].force.x;
/// }
/// assert!((force + 0.2).abs() < 1e-12);
/// ```
#[derive(Debug)]
pub struct Controller {
    channels: heapless::Vec<Channel, MAX_DEVICES>,
    /// On the heap, because a coupling takes 128 kB: a scene pays for the bodies that it has, and a thread with a small
    /// stack can make a controller. [`Controller::new`] allocates; a tick never does.
    #[expect(clippy::disallowed_types, reason = "allocated before the first tick")]
    couplings: heapless::Vec<Box<Coupling>, MAX_BODIES>,
    /// The tools, in the order of their devices.
    #[expect(clippy::disallowed_types, reason = "allocated before the first tick")]
    tools: heapless::Vec<Box<ToolCoupling>, MAX_DEVICES>,
    /// Number of models for bodies that do not exist, and of patches for devices without a tool.
    stray_models: u64,
    stray_patches: u64,
    tick: u64,
    /// Whether a proxy has slipped.
    has_slips: bool,
    /// Credit that bodies gave away because they pressed on others, and that no other body has taken yet (J).
    pool: f64,
}

impl Clone for Controller {
    fn clone(&self) -> Self {
        Self {
            channels: self.channels.clone(),
            couplings: self.couplings.clone(),
            tools: self.tools.clone(),
            stray_models: self.stray_models,
            stray_patches: self.stray_patches,
            tick: self.tick,
            has_slips: self.has_slips,
            pool: self.pool,
        }
    }

    /// Copies the couplings in place: a study resets a controller many times.
    fn clone_from(&mut self, source: &Self) {
        let Self {
            channels,
            couplings,
            tools,
            stray_models,
            stray_patches,
            tick,
            has_slips,
            pool,
        } = self;
        channels.clone_from(&source.channels);
        copy_in_place(couplings, &source.couplings);
        copy_in_place(tools, &source.tools);
        *stray_patches = source.stray_patches;
        (*stray_models, *tick) = (source.stray_models, source.tick);
        (*has_slips, *pool) = (source.has_slips, source.pool);
    }
}

/// Copies a list item by item.
fn copy_in_place<T: Clone, const N: usize>(to: &mut heapless::Vec<T, N>, from: &[T]) {
    to.truncate(from.len());
    let (same, more) = from.split_at_checked(to.len()).unwrap_or_default();
    for (to, from) in to.iter_mut().zip(same) {
        to.clone_from(from);
    }
    for from in more {
        // The lists have the same capacity.
        let _ = to.push(from.clone());
    }
}

/// The time of a tick. A number of nanoseconds alone is the time of a tick that is not late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickTime {
    /// Nominal time of the tick since the start of the run (ns). Skipped deadlines advance it, too.
    pub now_ns: u64,
    /// Time from the nominal time to the time at which the tick woke (ns).
    pub lateness_ns: u64,
}

impl TickTime {
    /// The time at which the tick woke (ns).
    pub fn clock_ns(&self) -> u64 {
        self.now_ns.saturating_add(self.lateness_ns)
    }
}

impl From<u64> for TickTime {
    fn from(now_ns: u64) -> Self {
        Self {
            now_ns,
            lateness_ns: 0,
        }
    }
}

impl Controller {
    /// A controller at rest, before its first model. It takes 128 kB of the heap for each body, and 56 kB for each tool. A tool
    /// whose device does not exist is left out.
    #[expect(clippy::disallowed_types, reason = "allocated before the first tick")]
    pub fn new(config: &ControllerConfig) -> Self {
        let mut new = Self {
            channels: heapless::Vec::new(),
            couplings: heapless::Vec::new(),
            tools: heapless::Vec::new(),
            stray_models: 0,
            stray_patches: 0,
            tick: 0,
            has_slips: false,
            pool: 0.0,
        };
        // The lists have the capacities of those in the configuration.
        for (device, wave) in config.devices.iter().zip(config.square_waves) {
            let number = new.channels.len();
            let mut channel = Channel::new(number, device.frame, device.safety);
            channel.square_wave = wave;
            let _ = new.channels.push(channel);
        }
        for body in &config.bodies {
            let _ = new.couplings.push(Box::new(Coupling::new(*body)));
        }
        for (tool, device) in config.tools.iter().zip(0..new.channels.len()) {
            if let Some(tool) = tool {
                let _ = new.tools.push(Box::new(ToolCoupling::new(device, *tool)));
            }
        }
        new
    }

    /// Hands over the newest local model of a body. The next tick takes the model into use.
    ///
    /// # Errors
    /// The [`ModelFault`] for which the model was refused. Refusals are counted.
    pub fn accept(&mut self, body: usize, model: &impl PublishedModel) -> Result<(), ModelFault> {
        if let Some(coupling) = self.couplings.get_mut(body) {
            coupling.accept(model)
        } else {
            count_one(&mut self.stray_models);
            Err(ModelFault::Handles)
        }
    }

    /// Hands over the newest patch for the tool of a device. The next tick takes the patch into use.
    ///
    /// # Errors
    /// The [`PatchFault`] for which the patch was refused. Refusals are counted.
    pub fn accept_patch(
        &mut self,
        device: usize,
        patch: &impl Publication<Head = PatchHead>,
    ) -> Result<(), PatchFault> {
        let mut tools = self.tools.iter_mut();
        if let Some(tool) = tools.find(|tool| tool.device() == device) {
            tool.accept(patch)
        } else {
            count_one(&mut self.stray_patches);
            Err(PatchFault::NoTool)
        }
    }

    /// One tick of the law. Returns the command for each device (device axes), by device index, and the record of the
    /// tick.
    pub fn tick(
        &mut self,
        time: impl Into<TickTime>,
        readings: &[Reading; MAX_DEVICES],
    ) -> ([Wrench; MAX_DEVICES], Telemetry) {
        self.tick_at(time.into(), readings)
    }

    /// The tick with a time of one type. The compiler compiles a generic function in the crate that calls it, and does
    /// not inline its phases there. That costs some 300 instructions more.
    fn tick_at(
        &mut self,
        time: TickTime,
        readings: &[Reading; MAX_DEVICES],
    ) -> ([Wrench; MAX_DEVICES], Telemetry) {
        let now_ns = time.now_ns;
        let mut telemetry = Telemetry::empty();
        telemetry.tick = self.tick;
        telemetry.time_ns = now_ns;
        telemetry.lateness_ns = time.lateness_ns;
        telemetry.device_count = self.channels.len() as u8;
        telemetry.body_count = self.couplings.len() as u8;
        telemetry.readings = *readings;

        // Not an array, which would be filled for devices that do not exist.
        let mut hands = Proxies::new();
        self.read(time, readings, &mut hands);
        let slipped = self.has_slips.then(|| self.slipped(&hands, &mut telemetry));
        let proxies = slipped.as_ref().unwrap_or(&hands);
        for (proxy, record) in proxies.iter().zip(&mut telemetry.devices) {
            (record.pose, record.twist) = *proxy;
        }
        let mut forces = [[Wrench::zero(); MAX_DEVICES]; MAX_BODIES + 1];
        self.couple(now_ns, &hands, proxies, &mut forces, &mut telemetry);
        let commands = self.limit(&mut forces, &mut telemetry);
        self.account(&forces, &mut telemetry);
        self.tick = self.tick.wrapping_add(1);
        (commands, telemetry)
    }

    /// The first phase: finds the pose to which each hand leads its proxy.
    fn read(&mut self, time: TickTime, readings: &[Reading; MAX_DEVICES], hands: &mut Proxies) {
        let mut couplings = self.couplings.iter();
        if couplings.any(|coupling| coupling.asks_for_slips()) {
            self.slip();
        }
        for (channel, reading) in self.channels.iter_mut().zip(readings) {
            channel.limiter.begin(time.clock_ns());
            channel.read(time.now_ns, reading);
            // There are no more channels than places.
            let _ = hands.push(channel.on_scene());
        }
        self.engage();
    }

    /// Slips the proxies as the bodies asked in the last tick.
    #[cold]
    #[inline(never)]
    fn slip(&mut self) {
        for channel in &mut self.channels {
            let device = channel.device;
            let asked = self.couplings.iter().map(|coupling| coupling.asked(device));
            let asked = asked.fold(Asked::Nothing, Asked::and);
            if let Some(way_back) = channel.slip(&asked) {
                for coupling in &mut self.couplings {
                    coupling.slipped(device, &way_back);
                }
            }
        }
        let mut channels = self.channels.iter();
        self.has_slips = channels.any(|channel| channel.slipped().is_some());
    }

    /// The poses of the proxies that these `hands` lead, with their slips.
    #[cold]
    #[inline(never)]
    fn slipped(&self, hands: &Proxies, telemetry: &mut Telemetry) -> Proxies {
        let mut proxies = hands.clone();
        let each = proxies.iter_mut().zip(&self.channels);
        for (((pose, _), channel), record) in each.zip(&mut telemetry.devices) {
            let slip = channel.slipped();
            slip.carry(pose);
            (record.slip, record.slip_angle) = slip.extent();
        }
        proxies
    }

    /// Tells each last stage whether its device may render force. A stop of one device stops all. Only the states of this
    /// tick ask for a stop: an older state would keep the other devices from being armed.
    fn engage(&mut self) {
        let mut channels = self.channels.iter();
        let stop = channels.any(|channel| channel.fresh && channel.engagement.asks_to_stop());
        for channel in &mut self.channels {
            if stop {
                channel.engagement.stop();
            }
            channel.limiter.engage(channel.engagement.engaged());
        }
    }

    /// The second phase: computes the wrench of each body and of each tool on each proxy.
    fn couple(
        &mut self,
        now_ns: u64,
        hands: &[(Pose, Twist)],
        proxies: &[(Pose, Twist)],
        forces: &mut Forces,
        telemetry: &mut Telemetry,
    ) {
        let bodies = self.couplings.iter_mut().zip(&mut *forces);
        for ((coupling, by_device), record) in bodies.zip(&mut telemetry.bodies) {
            let wrenches = coupling.tick_slipped(now_ns, hands, proxies);
            for (handle, wrench) in coupling.model().handles().zip(&wrenches) {
                let device = usize::from(handle.device);
                let channel = self.channels.get_mut(device);
                let sums = channel.map(|channel| &mut channel.wrench).into_iter();
                for sum in sums.chain(by_device.get_mut(device)) {
                    *sum = sum.plus(wrench);
                }
            }
            record.sequence = coupling.model().head.sequence;
            record.epoch = coupling.model().head.epoch;
            record.age_ns = coupling.age_ns(now_ns);
            record.trust = coupling.trust();
            record.state = coupling.state();
            record.withheld = coupling.withheld();
        }
        let mut couplings = self.couplings.iter();
        if couplings.any(|coupling| coupling.passivity().is_due()) {
            self.exchange();
        }
        if !self.tools.is_empty() {
            self.touch(now_ns, hands, proxies, forces, telemetry);
        }
    }

    /// Computes the wrench of each tool on the proxy of its device.
    #[inline(never)]
    fn touch(
        &mut self,
        now_ns: u64,
        hands: &[(Pose, Twist)],
        proxies: &[(Pose, Twist)],
        forces: &mut Forces,
        telemetry: &mut Telemetry,
    ) {
        telemetry.tool_count = self.tools.len() as u8;
        let mut forces = forces.get_mut(self.couplings.len());
        for (tool, record) in self.tools.iter_mut().zip(&mut telemetry.tools) {
            let device = tool.device();
            if let Some(channel) = self.channels.get(device) {
                tool.see(now_ns, channel.state.buttons);
            }
            let wrench = tool.tick_slipped(now_ns, hands, proxies);
            if let Some(channel) = self.channels.get_mut(device) {
                channel.wrench = channel.wrench.plus(&wrench);
            }
            let place = forces.as_mut().and_then(|forces| forces.get_mut(device));
            if let Some(place) = place {
                *place = wrench;
            }
            *record = ToolTelemetry {
                device: device as u8,
                state: tool.state(),
                contacts: tool.tool().contacts().len() as u8,
                sequence: tool.tool().sequence(),
                age_ns: tool.age_ns(now_ns),
                trust: tool.trust(),
                way: tool.tool().way(),
                reach: tool.tool().reach(),
                proxy: tool.tool().proxy(),
                wrench: tool.tool().wrench(),
                withheld: tool.withheld(),
                energy: EnergyAccount::default(),
            };
        }
    }

    /// Passes credit between bodies whose contacts passed energy on.
    #[cold]
    #[inline(never)]
    fn exchange(&mut self) {
        for coupling in &mut self.couplings {
            self.pool += coupling.passivity_mut().give();
        }
        for coupling in &mut self.couplings {
            self.pool -= coupling.passivity_mut().take(self.pool);
        }
    }

    /// The third phase: limits the command for each device. If a limit reduces a wrench, the wrenches of the bodies and of the
    /// tool are reduced by the same part.
    fn limit(&mut self, forces: &mut Forces, telemetry: &mut Telemetry) -> [Wrench; MAX_DEVICES] {
        let mut commands = [Wrench::zero(); MAX_DEVICES];
        let now_ns = telemetry.time_ns;
        let by_tools = usize::from(!self.tools.is_empty());
        let sources = self.couplings.len().saturating_add(by_tools);
        let outputs = commands.iter_mut().zip(&mut telemetry.devices);
        for (channel, (command, record)) in self.channels.iter_mut().zip(outputs) {
            let (device, actuated) = (channel.device, channel.limiter.actuated());
            if let Freedom::Along(axes) = actuated {
                // The mechanism carries the force along the other axes. No account may take that force as rendered.
                let frame = &channel.frame;
                let here = forces.iter_mut().take(sources);
                for wrench in here.filter_map(|by_device| by_device.get_mut(device)) {
                    wrench.force = frame.rendered_along(axes, &wrench.force);
                }
            }
            let mut asked = channel.frame.to_device(&channel.wrench);
            asked.force = actuated.part(&asked.force);
            let fresh = channel.fresh;
            *command = channel
                .limiter
                .pass(&asked, fresh.then_some(&channel.state));
            let state = channel.limiter.state();
            (channel.held_back).note(state, now_ns, &asked.force, &command.force);
            let [force, moment] = fractions_passed(&asked, command);
            let allowed = channel.allow(force);
            // A slew limit may change the direction of the force. That change is attributed to the first body.
            let rest = Wrench {
                force: command.force - asked.force * force,
                moment: Vec3::zeros(),
            };
            let mut rest = channel.frame.on_proxy(&rest);
            // A proxy that follows its hand by a fraction `s` is pushed by `1 / s` times the force on the hand.
            let lever = channel.lever();
            rest.force *= lever;
            let (force, moment) = (force * lever, moment * lever);
            channel.passed = Passed {
                rendered: force,
                allowed,
            };
            let here = forces.iter_mut().take(sources);
            for wrench in here.filter_map(|by_device| by_device.get_mut(device)) {
                wrench.force = wrench.force * force + rest.force;
                wrench.moment *= moment;
                rest = Wrench::zero();
            }
            record.wrench = Wrench {
                force: channel.frame.rotation * command.force,
                moment: channel.frame.rotation * command.moment,
            };
            record.buttons = channel.state.buttons;
            record.device_time_ns = channel.state.device_time_ns;
            record.fresh = fresh;
            record.safety = state;
            // The weight of the grip takes this force up. Neither the hand nor the scene feels the force.
            command.force += channel.limiter.grip_force();
        }
        commands
    }

    /// The last phase: accounts for the energy of each body and of each tool, with the wrenches that its devices were finally commanded.
    fn account(&mut self, forces: &Forces, telemetry: &mut Telemetry) {
        // Zeros: other numbers would be copied from memory in each tick.
        let mut passed = [Passed::NONE; MAX_DEVICES];
        for (passed, channel) in passed.iter_mut().zip(&self.channels) {
            *passed = channel.passed;
        }
        for (coupling, held) in self.couplings.iter_mut().zip(forces) {
            coupling.hold(held, &passed);
        }
        for (coupling, record) in self.couplings.iter().zip(&mut telemetry.bodies) {
            record.energy = *coupling.energy();
        }
        let by_tools = forces.get(self.couplings.len());
        for (tool, record) in self.tools.iter_mut().zip(&mut telemetry.tools) {
            if let Some(held) = by_tools.and_then(|forces| forces.get(tool.device())) {
                tool.hold(held);
            }
            record.energy = *tool.energy();
        }
    }

    /// Ends the tick, just before its commands leave, `took_ns` after the tick woke. If the loop stood still within the
    /// tick, every device whose watchdog may have let go gets zero in place of its command, and the force returns along a
    /// ramp.
    pub fn end(
        &mut self,
        took_ns: u64,
        commands: &mut [Wrench; MAX_DEVICES],
        telemetry: &mut Telemetry,
    ) {
        telemetry.took_ns = took_ns;
        let each = self.channels.iter_mut().zip(commands);
        for ((channel, command), record) in each.zip(&mut telemetry.devices) {
            if channel.limiter.end(took_ns) {
                *command = Wrench::zero();
                record.wrench = Wrench::zero();
                record.safety = channel.limiter.state();
            }
        }
    }

    /// The energy account of each body's hands so far.
    pub fn energy(&self) -> impl Iterator<Item = EnergyAccount> {
        self.couplings.iter().map(|coupling| *coupling.energy())
    }

    /// The counts of each body's coupling so far.
    pub fn coupling_counters(&self) -> impl Iterator<Item = CouplingCounters> {
        self.couplings.iter().map(|coupling| coupling.counters())
    }

    /// The counts of each device's last stage so far.
    pub fn safety_counters(&self) -> impl Iterator<Item = SafetyCounters> {
        self.channels
            .iter()
            .map(|channel| channel.limiter.counters())
    }

    /// The first trip of each device's last stage.
    pub fn first_trips(&self) -> impl Iterator<Item = Option<Trip>> {
        self.channels
            .iter()
            .map(|channel| channel.limiter.first_trip())
    }

    /// The first fault that each device reported: the tick, and the number of the fault.
    pub fn first_device_faults(&self) -> impl Iterator<Item = Option<(u64, u8)>> {
        self.channels
            .iter()
            .map(|channel| channel.limiter.first_device_fault())
    }

    /// The force that each device's last stage held back so far.
    pub fn held_back_by_devices(&self) -> impl Iterator<Item = HeldBackByDevice> {
        self.channels.iter().map(|channel| channel.held_back)
    }

    /// The force that the cap and the age of the model held back from each body's hands so far.
    pub fn held_back_by_bodies(&self) -> impl Iterator<Item = HeldBackByBody> {
        self.couplings.iter().map(|coupling| coupling.held_back())
    }

    /// Number of models that came for a body that does not exist.
    pub fn stray_models(&self) -> u64 {
        self.stray_models
    }

    /// Number of patches that came for a device without a tool.
    pub fn stray_patches(&self) -> u64 {
        self.stray_patches
    }

    /// The tools, in the order of their devices.
    pub fn tools(&self) -> impl Iterator<Item = &ToolCoupling> {
        self.tools.iter().map(|tool| &**tool)
    }
}

/// Poses and twists in the scene, by device.
type Proxies = heapless::Vec<(Pose, Twist), MAX_DEVICES>;

/// The wrench of each body on each proxy (scene axes), then that of each proxy's tool.
type Forces = [[Wrench; MAX_DEVICES]; MAX_BODIES + 1];

/// The fractions of the force and of the moment asked for that are left in the command.
fn fractions_passed(asked: &Wrench, command: &Wrench) -> [f64; 2] {
    if asked == command {
        // The forces of several bodies may also cancel.
        return [1.0, 1.0];
    }
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

/// One whole tick with its devices: reads all, computes, writes all. Returns the record of the tick and the number of
/// devices that did not take their command.
///
/// `devices` are boxes or references, of one kind of device or of several behind `dyn Device`.
pub fn cycle<D: Device + ?Sized>(
    controller: &mut Controller,
    devices: &mut [impl DerefMut<Target = D>],
    now_ns: u64,
) -> (Telemetry, u32) {
    cycle_timed(controller, devices, now_ns, || 0)
}

/// Does what [`cycle`] does, and stamps the times within the tick. `took` returns the time since the tick woke (ns), or zero
/// if no clock runs.
pub fn cycle_timed<D: Device + ?Sized>(
    controller: &mut Controller,
    devices: &mut [impl DerefMut<Target = D>],
    time: impl Into<TickTime>,
    took: impl Fn() -> u64,
) -> (Telemetry, u32) {
    let time = time.into();
    let mut stamps = Stamps {
        began_ns: took(),
        ..Stamps::default()
    };
    let mut readings = [const { Err(DeviceError::NoReport) }; MAX_DEVICES];
    let each = readings.iter_mut().zip(&mut stamps.read_ns);
    for (device, (reading, read_ns)) in devices.iter_mut().zip(each) {
        *reading = device.read(time.now_ns);
        *read_ns = took();
    }
    let (mut commands, mut telemetry) = controller.tick(time, &readings);
    controller.end(took(), &mut commands, &mut telemetry);
    let mut refused: u32 = 0;
    let each = stamps
        .written_ns
        .iter_mut()
        .zip(&mut stamps.motion_to_force_ns);
    for ((device, command), (written_ns, motion_to_force_ns)) in
        devices.iter_mut().zip(&commands).zip(each)
    {
        if device.write(time.now_ns, command).is_err() {
            refused = refused.saturating_add(1);
        }
        *written_ns = took();
        *motion_to_force_ns = device.motion_to_force_ns().unwrap_or(0);
    }
    telemetry.stamps = stamps;
    (telemetry, refused)
}
