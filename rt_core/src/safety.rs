//! The last stage before a device: the limits of a command.
//!
//! - A wrench that is **not a number** becomes zero.
//! - A device that has given **no good state** for a while gets no force.
//! - After the **loop stood still** for nearly as long as a device waits for a command, the device gets no force: the
//!   device has let go by itself, and a force that came back at once would be a blow. The clock decides, before the
//!   tick looks at a reading and again before the command leaves.
//! - A device that **says that it renders no force** ([`Rendering`]) gets none.
//! - The force of a device that moves **too fast**, or is **out of reach**, fades. The force comes back once the device
//!   is below nine tenths of the limit.
//! - A moment for a device that actuates no moments is left out, and so is a force along an axis that the device does
//!   not actuate. Such a wrench is no fault, and is not counted.
//! - A wrench beyond the device's limits is scaled down to them; its direction stays.
//! - A force whose mean square heats the motors too much is scaled down to the **continuous force** ([`crate::heat`]).
//! - A force that would change faster than the device withstands follows at its **slew limit**.
//! - A device that is **disarmed**, or **stopped** by the emergency stop, gets no force. The force of a device fades if
//!   the hand does not hold the dead-man button ([`crate::engage`]).
//!
//! After a fault or an engagement, the force comes back along a smooth step, never at once. Only a device that is
//! engaged from the start gets the whole force at once, because the coupling begins smoothly. Each case has a named
//! state, a counter, the number that first tripped the limit, and this return. The energy account receives the wrench
//! that left, because a slew limit without an entry in the account injects energy.

use crate::count_one;
use crate::device::{DeviceState, Freedom, Rendering};
use crate::engage::{EngageConfig, Engaged, Engagement};
use crate::geometry::{Vec3, Wrench, smooth_step};
use crate::heat::{Heat, HeatConfig};

/// Fraction of a limit below which the limit releases the force.
const BACK: f64 = 0.9;
/// Time in which the force fades when the hand lets go of the dead-man button (s). A free handle of 0.2 kg under 5 N
/// reaches 0.25 m/s in this time, and a hand that only lifts its finger feels no blow.
const RELEASE: f64 = 0.02;

/// Time without a command (s) after which a device lets go by itself: the watchdog of the firmware protocol, and the time
/// after which the thread of a device that answers when it is asked commands zero.
const WATCHDOG: f64 = 0.01;
/// The time of the watchdog in ticks of a slow loop, which asks its devices for a longer watchdog.
const WATCHDOG_TICKS: f64 = 4.0;
/// Fraction of the time of the watchdog after which the loop counts as standing still. The rest covers the path of a
/// command to the device: the device may count from an earlier command that took longer.
const STANDSTILL: f64 = 0.8;

/// Limits of the commands to a device. Infinite limits never act.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyConfig {
    /// Degrees of freedom that the device actuates.
    pub actuated: Freedom,
    /// Largest force (N).
    pub max_force: f64,
    /// Largest moment (N m).
    pub max_moment: f64,
    /// Speed beyond which the force fades (m/s).
    pub max_speed: f64,
    /// Distance from the device's origin beyond which the force fades (m).
    pub max_reach: f64,
    /// Fastest change of the force (N/s).
    pub max_slew: f64,
    /// Number of ticks in a row that may pass without a good device state.
    pub patience: u32,
    /// Time in which the force fades (s).
    pub decay: f64,
    /// Time in which the force comes back after a fault (s).
    pub recovery: f64,
    /// How the device is engaged.
    pub engage: EngageConfig,
    /// The heat that the device's motors withstand.
    pub heat: HeatConfig,
    /// The tick's period (s).
    pub period: f64,
}

impl SafetyConfig {
    /// Limits that never act on a device of six degrees of freedom, for ticks of `period` (s). A device that falls
    /// silent still gets no force from the eleventh tick on, and a force fades or comes back within 0.1 s.
    pub fn unlimited(period: f64) -> Self {
        Self {
            actuated: Freedom::Six,
            max_force: f64::INFINITY,
            max_moment: f64::INFINITY,
            max_speed: f64::INFINITY,
            max_reach: f64::INFINITY,
            max_slew: f64::INFINITY,
            patience: 10,
            decay: 0.1,
            recovery: 0.1,
            engage: EngageConfig::default(),
            heat: HeatConfig::default(),
            period,
        }
    }

    /// Time in which the force comes in after the device was engaged (s). Without a ramp of its own, the force comes in
    /// as it comes back after a fault.
    fn comes_in(&self) -> f64 {
        let ramp = self.engage.ramp;
        if ramp > 0.0 { ramp } else { self.recovery }
    }
}

/// The effect of the last stage on the wrench.
///
/// The numbers are the codes of the states in logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum SafetyState {
    /// The wrench passes.
    Normal = 0,
    /// The wrench is scaled to the device's limits.
    Limited = 1,
    /// The wrench is scaled down, because its mean square heats the motors.
    Hot = 8,
    /// The force changes at the slew limit of the device.
    Slewed = 5,
    /// The force comes back after a fault.
    Recovering = 2,
    /// The force comes in after the device was engaged.
    Engaging = 9,
    /// The force fades, because the device moves too fast.
    TooFast = 6,
    /// The force fades, because the device is out of reach.
    OutOfReach = 7,
    /// The force fades or is zero, because the hand does not hold the dead-man button.
    HandsOff = 10,
    /// The wrench is replaced by zero, because the device is not armed.
    Disarmed = 11,
    /// The wrench is replaced by zero, because of the emergency stop.
    Stopped = 12,
    /// The wrench is replaced by zero, because the device gives no good state, or the loop stood still.
    Silent = 3,
    /// The wrench is replaced by zero, because the device says that it renders none.
    LetGo = 13,
    /// The wrench is replaced by zero, because the device says that it has a fault.
    DeviceFault = 14,
    /// The wrench is replaced by zero, because it was not a number.
    NotANumber = 4,
}

impl SafetyState {
    /// All states, by their codes.
    pub const ALL: [Self; 15] = [
        Self::Normal,
        Self::Limited,
        Self::Recovering,
        Self::Silent,
        Self::NotANumber,
        Self::Slewed,
        Self::TooFast,
        Self::OutOfReach,
        Self::Hot,
        Self::Engaging,
        Self::HandsOff,
        Self::Disarmed,
        Self::Stopped,
        Self::LetGo,
        Self::DeviceFault,
    ];

    /// Its code in logs.
    pub fn code(self) -> u8 {
        self as u8
    }

    /// Its name in tables and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Limited => "limited",
            Self::Hot => "hot",
            Self::Slewed => "slewed",
            Self::Recovering => "recovering",
            Self::Engaging => "engaging",
            Self::TooFast => "too_fast",
            Self::OutOfReach => "out_of_reach",
            Self::HandsOff => "hands_off",
            Self::Disarmed => "disarmed",
            Self::Stopped => "stopped",
            Self::Silent => "silent",
            Self::LetGo => "let_go",
            Self::DeviceFault => "device_fault",
            Self::NotANumber => "not_a_number",
        }
    }

    /// The cause that holds back the force, and the effect on the force, in words for people; `None` if no cause does,
    /// or if the force only comes back.
    pub fn words(self) -> Option<&'static str> {
        Some(match self {
            Self::Normal | Self::Recovering => return None,
            Self::Limited => "force limited",
            Self::Hot => "motors hot, force limited",
            Self::Slewed => "force at its slew limit",
            Self::Engaging => "engaging, force coming in",
            Self::TooFast => "too fast, force fading",
            Self::OutOfReach => "out of reach, force fading",
            Self::HandsOff => "dead-man button not held, no force",
            Self::Disarmed => "disarmed, no force",
            Self::Stopped => "emergency stop, no force",
            Self::Silent => "device silent",
            Self::LetGo => "the device renders no force",
            Self::DeviceFault => "fault of the device, no force",
            Self::NotANumber => "force not a number",
        })
    }

    /// The cause alone, for people; as [`words`](Self::words).
    pub fn cause(self) -> Option<&'static str> {
        let words = self.words()?;
        Some(words.split_once(", ").map_or(words, |(cause, _)| cause))
    }
}

/// Counts of the events in the last stage. The counts only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SafetyCounters {
    /// Ticks with the wrench scaled down.
    pub limited: u64,
    /// Ticks with the wrench scaled down because of the motors' heat.
    pub hot: u64,
    /// Times that the device was engaged.
    pub engaged: u64,
    /// Times that the hand let go of the dead-man button of an armed device.
    pub hands_off: u64,
    /// Times that the emergency stop acted.
    pub stopped: u64,
    /// Ticks with the force held back by the slew limit.
    pub slewed: u64,
    /// Ticks with a wrench that was not a number.
    pub not_a_number: u64,
    /// Ticks without a good device state.
    pub missed_reads: u64,
    /// Times that the device gave no good state for longer than its patience, or that the loop stood still.
    pub stale: u64,
    /// Times that the device began to report that it renders no force.
    pub let_go: u64,
    /// Times that the device began to report a fault.
    pub device_faults: u64,
    /// Times that the device began to move too fast.
    pub too_fast: u64,
    /// Times that the device left its reach.
    pub out_of_reach: u64,
}

/// The first event that tripped a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trip {
    /// The state that the limit led to.
    pub state: SafetyState,
    /// The tick of the event, from zero.
    pub tick: u64,
    /// The value found, in newtons, newton metres, metres per second, metres, newtons per second, ticks without a state
    /// or without a command, or the number of a device's fault.
    pub found: f64,
    /// The largest value allowed, in the same unit.
    pub limit: f64,
}

/// The last stage of one device.
///
/// ```
/// use rt_core::safety::{Limiter, SafetyConfig, SafetyState};
/// use rt_core::{DeviceState, Freedom, Vec3, Wrench};
///
/// let mut limiter = Limiter::new(SafetyConfig {
///     actuated: Freedom::Three,
///     max_force: 8.0,
///     max_speed: 1.5,
///     max_reach: 0.2,
///     ..SafetyConfig::unlimited(1e-3)
/// });
/// let mut wrench = Wrench::zero();
/// wrench.force = Vec3::new(0.0, 20.0, 0.0);
/// let command = limiter.pass(&wrench, Some(&DeviceState::resting()));
/// assert_eq!(command.force.y, 8.0);
/// assert_eq!(limiter.state(), SafetyState::Limited);
/// assert_eq!(limiter.counters().limited, 1);
/// ```
#[derive(Clone, Debug)]
pub struct Limiter {
    config: SafetyConfig,
    /// Longest time between two commands in which the loop does not count as standing still (s).
    standstill: f64,
    /// The linear ramp from zero to one whose smooth step is the fraction that passes.
    authority: f64,
    /// Whether the device may render force.
    engaged: Engaged,
    /// Whether the ramp rises because the device was engaged, and not after a fault.
    comes_in: bool,
    heat: Heat,
    misses: u32,
    /// The device's report on its commands.
    rendering: Rendering,
    /// Time of the last command by the clock (ns).
    commanded_ns: Option<u64>,
    /// Time from the command before this tick to the beginning of this tick (ns).
    waited_ns: u64,
    /// Whether the loop stood still before this tick.
    stood_still: bool,
    too_fast: bool,
    out_of_reach: bool,
    /// The force of the last command.
    last: Vec3,
    tick: u64,
    state: SafetyState,
    counters: SafetyCounters,
    trip: Option<Trip>,
    /// The tick of the first fault of the device's own, and its number.
    device_fault: Option<(u64, u8)>,
}

impl Limiter {
    /// A last stage before the first tick. A device that is engaged from the start without a ramp gets the whole force:
    /// the coupling's own start is smooth.
    pub fn new(config: SafetyConfig) -> Self {
        let whole = config.engage.is_whole_at_start();
        Self {
            config,
            standstill: STANDSTILL * WATCHDOG.max(WATCHDOG_TICKS * config.period),
            authority: if whole { 1.0 } else { 0.0 },
            engaged: Engagement::new(config.engage).engaged(),
            comes_in: !whole,
            heat: Heat::default(),
            misses: 0,
            rendering: Rendering::Commanded,
            commanded_ns: None,
            waited_ns: 0,
            stood_still: false,
            too_fast: false,
            out_of_reach: false,
            last: Vec3::zeros(),
            tick: 0,
            state: SafetyState::Normal,
            counters: SafetyCounters::default(),
            trip: None,
            device_fault: None,
        }
    }

    /// Tells whether the device may render force from the next wrench on.
    pub fn engage(&mut self, engaged: Engaged) {
        if engaged == self.engaged {
            return;
        }
        match engaged {
            Engaged::Yes => count_one(&mut self.counters.engaged),
            Engaged::HandsOff if self.engaged == Engaged::Yes => {
                count_one(&mut self.counters.hands_off);
            }
            Engaged::Stopped => count_one(&mut self.counters.stopped),
            Engaged::HandsOff | Engaged::Disarmed => {}
        }
        self.comes_in = true;
        self.engaged = engaged;
    }

    /// Begins the tick, before the tick looks at its reading. `clock_ns` is the time at which the tick woke. If the
    /// loop stood still, the device counts as away up to this tick, which commands no force.
    pub fn begin(&mut self, clock_ns: u64) {
        let last_ns = self.commanded_ns.unwrap_or(clock_ns);
        self.waited_ns = clock_ns.saturating_sub(last_ns);
        self.commanded_ns = Some(clock_ns);
        if self.stands_still(self.waited_ns) {
            if !self.is_stale() {
                count_one(&mut self.counters.stale);
            }
            self.misses = self.misses.max(self.config.patience.saturating_add(1));
            self.stood_still = true;
            self.authority = 0.0;
        }
    }

    /// Takes the device's report on its commands from the reading of this tick.
    pub fn hear(&mut self, rendering: Rendering) {
        if rendering == self.rendering {
            return;
        }
        match rendering {
            Rendering::Commanded => {}
            Rendering::LetGo => count_one(&mut self.counters.let_go),
            Rendering::Fault(fault) => {
                count_one(&mut self.counters.device_faults);
                self.device_fault.get_or_insert((self.tick, fault));
                self.comes_in = true;
            }
        }
        self.rendering = rendering;
        if !self.is_rendered() {
            // The device did not render the last commands either.
            self.authority = 0.0;
        }
    }

    /// Ends the tick, just before its command leaves, `took_ns` after the tick woke. Returns whether zero must leave in
    /// place of the command, because the loop stood still within the tick.
    pub fn end(&mut self, took_ns: u64) -> bool {
        let waited_ns = self.waited_ns.saturating_add(took_ns);
        self.commanded_ns = self
            .commanded_ns
            .map(|began_ns| began_ns.saturating_add(took_ns));
        let stood_still = self.stands_still(waited_ns);
        if stood_still {
            count_one(&mut self.counters.stale);
            // The tick has been counted already.
            self.tick = self.tick.saturating_sub(1);
            self.stall(waited_ns);
            self.tick = self.tick.saturating_add(1);
            self.last = Vec3::zeros();
            // The device counts as away up to its next good state, so its proxy does not follow the motion of the pause.
            self.misses = self.misses.max(self.config.patience.saturating_add(1));
        }
        stood_still
    }

    /// Whether a loop that commanded nothing for this time (ns) counts as standing still.
    fn stands_still(&self, waited_ns: u64) -> bool {
        waited_ns as f64 * 1e-9 > self.standstill
    }

    /// No wrench, because the loop stood still for `waited_ns`.
    fn stall(&mut self, waited_ns: u64) -> Wrench {
        let found = waited_ns as f64 * 1e-9 / self.config.period;
        let limit = self.standstill / self.config.period;
        self.fault(SafetyState::Silent, found, limit)
    }

    /// The wrench that may leave. `state` is the good state that the device gave in this tick (its own axes), if there
    /// is one.
    pub fn pass(&mut self, wrench: &Wrench, state: Option<&DeviceState>) -> Wrench {
        let passed = self.decide(wrench, state);
        self.last = passed.force;
        if self.config.heat.continuous_force.is_finite() {
            let whole = (passed.force + self.grip_force()).norm();
            self.heat.note(&self.config.heat, whole, self.config.period);
        }
        self.tick = self.tick.saturating_add(1);
        passed
    }

    /// The force that carries the weight of the grip in this tick, beside the force of [`Self::pass`] (N, device axes).
    pub fn grip_force(&self) -> Vec3 {
        self.config.engage.grip_force * self.fraction()
    }

    /// Whether the device has given no good state for longer than its patience. Other faults do not matter here.
    pub fn is_stale(&self) -> bool {
        self.misses > self.config.patience
    }

    /// Whether the engagement of the device forbids force.
    pub fn is_disengaged(&self) -> bool {
        self.engaged != Engaged::Yes
    }

    /// Whether the device renders its commands, according to its reports.
    fn is_rendered(&self) -> bool {
        self.rendering == Rendering::Commanded
    }

    /// Whether the hand may move the device without the scene: the device is away, does not render its commands, or is
    /// not engaged.
    pub fn is_apart(&self) -> bool {
        self.is_stale() || !self.is_rendered() || self.is_disengaged()
    }

    /// Fraction of the force that passes after faults and engagements: one if no limit has tripped for a while.
    pub fn fraction(&self) -> f64 {
        smooth_step(self.authority)
    }

    /// The part of the ramp by which the force returns in a tick.
    pub(crate) fn return_step(&self) -> f64 {
        let config = &self.config;
        let time = if self.comes_in {
            config.comes_in()
        } else {
            config.recovery
        };
        config.period / time
    }

    /// The tick's period (s).
    pub(crate) fn period(&self) -> f64 {
        self.config.period
    }

    /// Degrees of freedom that the device actuates.
    pub(crate) fn actuated(&self) -> Freedom {
        self.config.actuated
    }

    /// The effect of the last stage on the last wrench.
    pub fn state(&self) -> SafetyState {
        self.state
    }

    /// The counts so far.
    pub fn counters(&self) -> SafetyCounters {
        self.counters
    }

    /// The first trip, if there was any.
    pub fn first_trip(&self) -> Option<Trip> {
        self.trip
    }

    /// The first fault that the device reported, if there was any: the tick, and the number of the fault.
    pub fn first_device_fault(&self) -> Option<(u64, u8)> {
        self.device_fault
    }

    fn decide(&mut self, wrench: &Wrench, state: Option<&DeviceState>) -> Wrench {
        if let Some(state) = state {
            self.misses = 0;
            self.watch(state);
        } else {
            self.misses = self.misses.saturating_add(1);
            count_one(&mut self.counters.missed_reads);
            if self.misses == self.config.patience.saturating_add(1) {
                count_one(&mut self.counters.stale);
            }
        }
        if core::mem::take(&mut self.stood_still) {
            // The command is zero, so only a delay within this tick can still replace it.
            let waited_ns = core::mem::take(&mut self.waited_ns);
            return self.stall(waited_ns);
        }
        if !wrench.is_finite() {
            count_one(&mut self.counters.not_a_number);
            return self.fault(SafetyState::NotANumber, f64::NAN, self.config.max_force);
        }
        if self.is_stale() {
            let (found, limit) = (f64::from(self.misses), f64::from(self.config.patience));
            return self.fault(SafetyState::Silent, found, limit);
        }
        match self.rendering {
            Rendering::Commanded => {}
            Rendering::LetGo => return self.none(SafetyState::LetGo),
            Rendering::Fault(fault) => {
                return self.fault(SafetyState::DeviceFault, f64::from(fault), 0.0);
            }
        }
        match self.engaged {
            Engaged::Disarmed => return self.none(SafetyState::Disarmed),
            Engaged::Stopped => return self.none(SafetyState::Stopped),
            Engaged::HandsOff | Engaged::Yes => {}
        }
        self.state = SafetyState::Normal;
        let mut passed = *wrench;
        if !self.config.actuated.turns() {
            passed.moment = Vec3::zeros();
        }
        passed.force = self.config.actuated.part(&passed.force);
        if self.is_ramping() {
            passed = passed.scaled(self.ramp());
        }
        let largest = self.largest_force();
        if largest < self.config.max_force
            && let Some(found) = shorten(&mut passed.force, largest)
        {
            self.act(SafetyState::Hot);
            count_one(&mut self.counters.hot);
            self.note(SafetyState::Hot, found, largest);
        }
        let force = shorten(&mut passed.force, self.config.max_force);
        let moment = shorten(&mut passed.moment, self.config.max_moment);
        for (found, limit) in [
            (force, self.config.max_force),
            (moment, self.config.max_moment),
        ] {
            if let Some(found) = found {
                self.note(SafetyState::Limited, found, limit);
            }
        }
        if force.or(moment).is_some() {
            self.act(SafetyState::Limited);
            count_one(&mut self.counters.limited);
        }
        let mut change = passed.force - self.last;
        if let Some(found) = shorten(&mut change, self.config.max_slew * self.config.period) {
            passed.force = self.last + change;
            self.act(SafetyState::Slewed);
            count_one(&mut self.counters.slewed);
            let slew = found / self.config.period;
            self.note(SafetyState::Slewed, slew, self.config.max_slew);
        }
        passed
    }

    /// Whether only a fraction of the force passes, now or soon.
    fn is_ramping(&self) -> bool {
        self.too_fast || self.out_of_reach || self.is_disengaged() || self.authority < 1.0
    }

    /// Moves the ramp by a tick. Returns the fraction of the force that passes.
    fn ramp(&mut self) -> f64 {
        let config = &self.config;
        let (state, step) = if self.is_disengaged() {
            (SafetyState::HandsOff, -config.period / RELEASE)
        } else if self.too_fast {
            (SafetyState::TooFast, -config.period / config.decay)
        } else if self.out_of_reach {
            (SafetyState::OutOfReach, -config.period / config.decay)
        } else if self.comes_in {
            (SafetyState::Engaging, self.return_step())
        } else {
            (SafetyState::Recovering, self.return_step())
        };
        self.state = state;
        self.authority = (self.authority + step).clamp(0.0, 1.0);
        if self.authority >= 1.0 {
            self.comes_in = false;
        }
        self.fraction()
    }

    /// The largest force that the motors' heat allows (N), beside the force that carries the grip.
    fn largest_force(&self) -> f64 {
        let SafetyConfig {
            max_force, heat, ..
        } = &self.config;
        if heat.continuous_force.is_infinite() {
            return *max_force;
        }
        let grip = self.config.engage.grip_force.norm();
        (self.heat.largest_force(heat, max_force + grip) - grip).max(0.0)
    }

    /// Watches the device's limits of motion.
    fn watch(&mut self, state: &DeviceState) {
        let speed = state.twist.linear.norm();
        let reach = state.pose.position.norm();
        let (max_speed, max_reach) = (self.config.max_speed, self.config.max_reach);
        if trips(&mut self.too_fast, speed, max_speed) {
            count_one(&mut self.counters.too_fast);
            self.note(SafetyState::TooFast, speed, max_speed);
        }
        if trips(&mut self.out_of_reach, reach, max_reach) {
            count_one(&mut self.counters.out_of_reach);
            self.note(SafetyState::OutOfReach, reach, max_reach);
        }
    }

    /// Sets the state, unless a graver state is set.
    fn act(&mut self, state: SafetyState) {
        if matches!(
            self.state,
            SafetyState::Normal | SafetyState::Recovering | SafetyState::Engaging
        ) {
            self.state = state;
        }
    }

    fn note(&mut self, state: SafetyState, found: f64, limit: f64) {
        let tick = self.tick;
        self.trip.get_or_insert(Trip {
            state,
            tick,
            found,
            limit,
        });
    }

    fn fault(&mut self, state: SafetyState, found: f64, limit: f64) -> Wrench {
        self.note(state, found, limit);
        self.none(state)
    }

    /// No wrench, in the given state. The force comes back along the ramp.
    fn none(&mut self, state: SafetyState) -> Wrench {
        self.authority = 0.0;
        self.state = state;
        Wrench::zero()
    }
}

/// Keeps `tripped` true from above `limit` to below nine tenths of it. Returns whether `tripped` has just become true.
fn trips(tripped: &mut bool, found: f64, limit: f64) -> bool {
    let before = *tripped;
    // A speed or a distance that overflowed to infinity exceeds every finite limit.
    *tripped = found > limit || (before && found >= BACK * limit);
    *tripped && !before
}

/// Scales `v` to the length `limit` if `v` is longer. Returns the original length in that case.
fn shorten(v: &mut Vec3, limit: f64) -> Option<f64> {
    let length = v.norm();
    if length <= limit {
        return None;
    }
    // The squares of very large components overflow to infinity. Such a vector has no usable direction left.
    *v = if length.is_finite() {
        *v * (limit / length)
    } else {
        Vec3::zeros()
    };
    Some(length)
}

#[cfg(test)]
mod tests;
