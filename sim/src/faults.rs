//! Faults on the way between a driver and its device, at random times, in virtual time.
//!
//! A run has an emulated device in a simulated hand, the true driver of `devices`, and the true controller, which renders
//! a wall. The hand pushes into the wall, holds, and leaves it. A fault of one [`Kind`] begins at a random time of the
//! push. The run then shows how long the force lasts at the device and in the commands of the host, how it comes back,
//! and how much energy the hand was given.
//!
//! Two parts of the program cannot run in virtual time, because they are threads of the system, and are written again
//! here (`driver`): the thread of [`devices::Exchanged`], with its times, and the writing thread of `devices::hid`, which
//! writes at once here. Everything else is the code of the program. The same seed gives the same run.
//!
//! What must hold ([`Limits`]): no force at the device after its own watchdog, and none commanded after five of its
//! periods; a force that comes back without a restart of the host and without a jump; and less than a millijoule of net
//! energy at the hand ([`crate::NetEnergy`]).

pub(crate) mod driver;
mod host;
pub(crate) mod link;

use crate::tremor::unit;
use crate::{Arm, DeviceModel, Hand, SimDevice, Trajectory, Tremor};
use host::Host;
use link::{Injected, Link, World};
use rand_pcg::Pcg64;
use rt_core::{Scheme, Vec3};
use std::fmt;

/// The stream of the random generator: no other part of the program draws from it.
const STREAM: u128 = 0x6661_756c_7473;
/// Period of the ticks and of the devices (ns).
const PERIOD_NS: u64 = 1_000_000;
/// Periods without a state after which the force ends, as in the program.
const PATIENCE: u32 = 5;
/// Stiffness (N/m) and damping (N s/m) of the wall.
const WALL: [f64; 2] = [300.0, 1.0];
/// Distance of the wall from the origin of the device, towards negative z (m).
const DISTANCE: f64 = 0.003;
/// Aim of the hand at the push, towards negative z (m).
const DEPTH: f64 = 0.012;
/// Time in which a force returns after a fault (s).
const RECOVERY: f64 = 0.2;
/// Largest growth of a force in a millisecond beyond the growth that the motion of the hand and the ramps explain (N). The
/// damper of the cap stops in a tick in which the velocity disagrees with the last counts, and returns at once: a run
/// without models reached 0.052 N by that. All other runs stay below 0.02 N.
const JUMP: f64 = 0.1;
/// Root mean square of the tremor (m).
const TREMOR: f64 = 1e-4;

/// A device and its protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Protocol {
    /// The firmware protocol, in reports (HID).
    Reports,
    /// The firmware protocol, in a stream of bytes (tty, TCP).
    Stream,
    /// WoodenHaptics: HID reports without sequence, time and check sum.
    WoodenHaptics,
    /// The Falcon: packets of letters through an FTDI chip.
    Falcon,
}

impl Protocol {
    /// All protocols.
    pub const ALL: [Self; 4] = [
        Self::Reports,
        Self::Stream,
        Self::WoodenHaptics,
        Self::Falcon,
    ];

    /// Whether each packet has a check sum, a number and a session, so that a receiver detects every wrong one.
    fn is_checked(self) -> bool {
        matches!(self, Self::Reports | Self::Stream)
    }
}

impl fmt::Display for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Reports => "firmware, HID",
            Self::Stream => "firmware, stream",
            Self::WoodenHaptics => "WoodenHaptics",
            Self::Falcon => "Falcon",
        })
    }
}

/// A kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// No fault, for comparison.
    Nothing,
    /// The cable is pulled, and plugged in again. The device has power of its own.
    Unplugged,
    /// The device is switched off and on.
    Reset,
    /// Every packet, both ways, has one byte changed.
    Corrupt,
    /// Every packet, both ways, is the last one before the fault.
    Stale,
    /// Packets come in pairs, the later one first.
    Reordered,
    /// Packets are lost, both ways.
    Silent,
    /// The device sends twenty times as many packets.
    Flooding,
    /// The device is 10 % faster than the tick.
    Fast,
    /// The device is 10 % slower than the tick.
    Slow,
    /// The process of the host is stopped, and continues.
    Stopped,
    /// The process of the host ends without a last word.
    Killed,
    /// The commands are lost, and the device's own watchdog lets go. Its states arrive, where it sends them by itself.
    Deaf,
    /// The commands of 20 ms are lost.
    BrieflyDeaf,
    /// The emergency stop at the device is pressed, and released. A device of the firmware protocol then starts anew, and
    /// knows its place at once.
    EmergencyStop,
    /// The motors have no power for a while.
    MotorsOff,
    /// The hand lets go of the dead-man button, and presses it again.
    HandsOff,
    /// An order stops the device, and another one arms it.
    Ordered,
    /// The host publishes no model, and the last one grows too old.
    StaleHost,
    /// The thread of the tick is kept from its processor between the reading of the device and the command.
    Preempted,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 20] = [
        Self::Nothing,
        Self::Unplugged,
        Self::Reset,
        Self::Corrupt,
        Self::Stale,
        Self::Reordered,
        Self::Silent,
        Self::Flooding,
        Self::Fast,
        Self::Slow,
        Self::Stopped,
        Self::Killed,
        Self::Deaf,
        Self::BrieflyDeaf,
        Self::EmergencyStop,
        Self::MotorsOff,
        Self::HandsOff,
        Self::Ordered,
        Self::StaleHost,
        Self::Preempted,
    ];

    /// Whether no sound state reaches a host that runs.
    fn cuts_states(self, protocol: Protocol) -> bool {
        match self {
            Self::Unplugged | Self::Reset | Self::Silent => true,
            Self::Corrupt | Self::Stale => protocol.is_checked(),
            // The others answer commands only.
            Self::Deaf | Self::BrieflyDeaf => !protocol.is_checked(),
            _ => false,
        }
    }

    /// Whether the device itself lets go, and its states say so.
    fn is_told(self, protocol: Protocol) -> bool {
        let lets_go = matches!(
            self,
            Self::Deaf | Self::BrieflyDeaf | Self::EmergencyStop | Self::MotorsOff
        );
        lets_go && protocol.is_checked()
    }

    /// Whether no sound command reaches the device.
    fn cuts_commands(self, protocol: Protocol) -> bool {
        self.cuts_states(protocol)
            || self.is_told(protocol)
            || matches!(self, Self::Stopped | Self::Killed)
    }

    /// Whether the loop itself takes the force away, without a fault of the connection.
    fn is_meant(self) -> bool {
        matches!(self, Self::HandsOff | Self::Ordered | Self::StaleHost)
    }

    /// Whether a receiver can tell the packets of the fault from sound ones. WoodenHaptics and the Falcon have neither a
    /// check sum nor a number in their packets, and the packets say nothing of the motors.
    pub fn is_detectable(self, protocol: Protocol) -> bool {
        let unseen = matches!(
            self,
            Self::Corrupt | Self::Stale | Self::EmergencyStop | Self::MotorsOff
        );
        protocol.is_checked() || !unseen
    }

    /// Whether the host must go on as if nothing had happened.
    fn is_harmless(self, protocol: Protocol) -> bool {
        match self {
            Self::Nothing | Self::Fast | Self::Slow => true,
            Self::Flooding => protocol != Protocol::Falcon,
            _ => false,
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Nothing => "none",
            Self::Unplugged => "unplugged",
            Self::Reset => "reset",
            Self::Corrupt => "corrupt",
            Self::Stale => "stale",
            Self::Reordered => "reordered",
            Self::Silent => "silent",
            Self::Flooding => "flooding",
            Self::Fast => "10 % fast",
            Self::Slow => "10 % slow",
            Self::Stopped => "host stopped",
            Self::Killed => "host killed",
            Self::Deaf => "commands lost",
            Self::BrieflyDeaf => "20 ms of commands lost",
            Self::EmergencyStop => "emergency stop",
            Self::MotorsOff => "motors off",
            Self::HandsOff => "dead-man button",
            Self::Ordered => "stop and arm",
            Self::StaleHost => "no models",
            Self::Preempted => "tick preempted",
        })
    }
}

/// The limits that a run is held to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Longest time of a force at the device (s): its watchdog, one turn of its loop, and the exchange that was under
    /// way.
    pub device: f64,
    /// Longest time of a force in the commands of the host (s): five periods of the device, the answer that was under
    /// way, and the tick that finds out. Where the device says that it let go: its watchdog, a state, its answer, and the
    /// tick.
    pub host: f64,
    /// Largest growth of a force from one millisecond to the next, beyond the growth that the motion of the hand and the
    /// ramps explain (N).
    pub jump: f64,
    /// Largest net energy at the hand (J).
    pub energy: f64,
}

impl Limits {
    /// The limits of a fault on a protocol. WoodenHaptics cuts its motors half a second after the last command. Nobody documents
    /// what the Falcon does: the emulator's choice is a tenth of a second. A driver of WoodenHaptics learns
    /// of a restart by its first report, and has sent one more command by then: a pulse of one exchange.
    pub fn of(protocol: Protocol, kind: Kind) -> Self {
        let device = match protocol {
            Protocol::Reports | Protocol::Stream => 0.010_1,
            Protocol::WoodenHaptics => 0.501_5,
            Protocol::Falcon => 0.101_5,
        };
        // A stop acts in its tick, a released button fades the force within 20 ms, and an old model within its age and the
        // time of the decay.
        let meant = match kind {
            Kind::Ordered => 0.001,
            Kind::HandsOff => 0.022,
            Kind::StaleHost => 0.135,
            _ => 0.0,
        };
        // The watchdog of the device lets go first, and its next state tells.
        let told = if kind.is_told(protocol) { device } else { 0.0 };
        Self {
            device,
            host: if kind.is_meant() {
                meant
            } else {
                (told + 0.003).max(0.007)
            },
            jump: if (protocol, kind) == (Protocol::WoodenHaptics, Kind::Reset) {
                f64::INFINITY
            } else {
                JUMP
            },
            energy: 1e-3,
        }
    }
}

/// What a run showed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Time from the fault until the device made no force (s); `None` where commands still reached it, or where the fault
    /// ended first.
    pub device: Option<f64>,
    /// Time from the fault until the host commanded no force (s); `None` where states still reached it.
    pub host: Option<f64>,
    /// Largest growth of the commanded force from one tick to the next, after the fault began, beyond the growth that the
    /// motion of the hand and the ramps explain (N).
    pub host_jump: f64,
    /// Largest growth of the force at the device from one millisecond to the next, after the fault began, beyond the growth
    /// that the motion of the hand and the ramps explain (N).
    pub device_jump: f64,
    /// Net energy at the hand (J).
    pub energy: f64,
    /// Ticks without a state, after the first state.
    pub missed: u64,
    /// Force before the fault, and at the end (N).
    pub forces: [f64; 2],
    /// What the run was to show and did not.
    pub failures: Vec<String>,
}

/// The times of a run (s).
struct Plan {
    /// The hand moves the handle out and in, by which a Falcon is homed. None for the other devices.
    homing: Option<f64>,
    /// The operator presses the button for calibration, where there has been no state for a while.
    presses: [f64; 2],
    /// The path of the hand along z (m).
    path: Vec<(f64, f64)>,
    fault: [f64; 2],
    arm: Arm,
    end: f64,
    model: DeviceModel,
    scheme: Scheme,
    /// Time in which the force comes in after an engagement (s); zero where that time is [`RECOVERY`].
    ramp: f64,
}

impl Plan {
    fn new(protocol: Protocol, kind: Kind, random: &mut Pcg64) -> Self {
        let mut draw = |low: f64, high: f64| low + (high - low) * unit(random);
        let mut path = Vec::new();
        let mut now = if protocol == Protocol::Falcon {
            3.0
        } else {
            0.1
        };
        let out_and_in = |path: &mut Vec<(f64, f64)>, now: &mut f64| {
            path.extend([(*now, 0.0), (*now + 0.5, 0.025), (*now + 1.0, 0.0)]);
            *now += 1.1;
        };
        let homing = (protocol == Protocol::Falcon).then_some(now);
        if homing.is_some() {
            out_and_in(&mut path, &mut now);
        }
        let first = now + 0.05;
        // The push, the hold, and the way back.
        let push = now + 0.2;
        let hold = draw(0.5, 1.0);
        let back = push + 0.3 + hold;
        path.extend([
            (push, 0.0),
            (push + 0.3, -DEPTH),
            (back, -DEPTH),
            (back + 0.4, 0.0),
        ]);
        let from = draw(push + 0.2, back + 0.1);
        let mut to = from + draw(0.05, 0.3);
        if kind == Kind::BrieflyDeaf {
            to = from + 0.02;
        }
        now = back + 0.5;
        let mut second = f64::INFINITY;
        if kind != Kind::Killed {
            if protocol == Protocol::Falcon && kind == Kind::Reset {
                // It counts as lost, its firmware is uploaded, and a person homes it again.
                now += 3.0;
                out_and_in(&mut path, &mut now);
            }
            second = now.max(to + 0.3);
            now = second + 0.2;
            path.extend([(now, 0.0), (now + 0.3, -DEPTH)]);
        }
        let arm = if draw(0.0, 1.0) < 0.5 {
            Arm::TYPICAL
        } else {
            Arm::FIRM
        };
        let schemes = [
            Scheme::Capped,
            Scheme::Capped,
            Scheme::Linear,
            Scheme::Classic,
        ];
        Self {
            homing,
            presses: [first, second],
            path,
            fault: [from, to],
            arm,
            end: now + 0.8,
            model: link::model(protocol, draw(0.0, 1.0)),
            scheme: schemes[draw(0.0, 4.0) as usize % schemes.len()],
            ramp: if draw(0.0, 1.0) < 0.5 { 0.0 } else { 0.4 },
        }
    }
}

/// Runs a device of `protocol` with a fault of `kind`, both at times that `seed` decides.
///
/// # Panics
/// Where the emulated device or its driver cannot be set up, which no seed causes.
pub fn run(protocol: Protocol, kind: Kind, seed: u64) -> Outcome {
    let mut random = Pcg64::new(u128::from(seed), STREAM);
    let plan = Plan::new(protocol, kind, &mut random);
    let ns = |seconds: f64| (seconds * 1e9) as u64;
    let [from_ns, to_ns] = plan.fault.map(ns);
    let injected = Injected {
        kind,
        from_ns,
        to_ns,
    };
    let device = held(plan.model, &plan, seed);
    let link = Link::new(World::new(protocol, device, injected, random));
    let mut host = Host::new(protocol, &plan, &link, injected);
    let end_ns = ns(plan.end);
    let mut presses = plan.presses.map(ns).to_vec();
    // A process that was stopped, or preempted within a tick, skips the deadlines that have passed.
    let mut woken_ns = 0;
    let mut now_ns = link.now_ns().next_multiple_of(PERIOD_NS);
    assert!(
        plan.homing.is_none_or(|homing| now_ns < ns(homing)),
        "the boot took too long"
    );
    while now_ns < end_ns {
        if kind == Kind::Killed && now_ns > from_ns {
            host.stop(from_ns);
            link.run(now_ns);
        } else if kind == Kind::Stopped && now_ns > from_ns && woken_ns == 0 {
            // The tick of this deadline wakes when the process goes on.
            woken_ns = to_ns.max(now_ns);
            host.stop(from_ns);
            link.run(woken_ns);
            host.tick(now_ns, woken_ns, woken_ns);
        } else if kind == Kind::Preempted && now_ns > from_ns && woken_ns == 0 {
            woken_ns = to_ns.max(now_ns);
            host.tick(now_ns, now_ns, woken_ns);
        } else {
            host.tick(now_ns, now_ns, now_ns);
        }
        if presses.first().is_some_and(|&press_ns| now_ns >= press_ns) {
            presses.remove(0);
            if host.is_without_state() {
                link.press();
            }
        }
        now_ns += PERIOD_NS;
        while now_ns < woken_ns {
            now_ns += PERIOD_NS;
        }
    }
    link.run(end_ns);
    let seen = link.seen();
    let since = |at_ns: Option<u64>| at_ns.map(|at_ns| (at_ns - from_ns) as f64 * 1e-9);
    // After the end of the fault, the host may command zero.
    let lasts = if kind == Kind::Killed {
        f64::INFINITY
    } else {
        plan.fault[1] - plan.fault[0]
    };
    let cuts = |gone: f64| kind.cuts_commands(protocol) && gone <= lasts;
    let mut outcome = Outcome {
        device: since(seen.gone_ns).filter(|gone| cuts(*gone)),
        host: since(host.gone_ns()).filter(|gone| {
            let meant = kind.is_meant() && *gone <= lasts;
            kind.cuts_states(protocol) || kind.is_told(protocol) || meant
        }),
        host_jump: host.jump(),
        device_jump: host.device_jump(&seen.forces),
        energy: seen.energy.largest(),
        missed: host.missed(),
        forces: [seen.before, seen.force],
        failures: Vec::new(),
    };
    judge(
        &mut outcome,
        protocol,
        kind,
        &plan,
        host.trips(),
        host.is_back(),
    );
    outcome
}

/// The device in the hand that follows the plan.
fn held(model: DeviceModel, plan: &Plan, seed: u64) -> SimDevice {
    let path = plan
        .path
        .iter()
        .map(|(at, z)| (*at, Vec3::new(0.0, 0.0, *z)));
    let trajectory = Trajectory::new_waypoints(&path.collect::<Vec<_>>());
    let hand = trajectory.map(|trajectory| Hand::new(trajectory).with_arm(plan.arm));
    let hand = match (hand, Tremor::new(TREMOR, seed)) {
        (Ok(hand), Ok(tremor)) => hand.with_tremor(tremor),
        other => panic!("the hand cannot follow its path: {other:?}"),
    };
    match SimDevice::new(model, Some(hand), PERIOD_NS as f64 * 1e-9) {
        Ok(device) => device,
        Err(error) => panic!("{error}"),
    }
}

/// Notes what a run was to show and did not.
fn judge(
    outcome: &mut Outcome,
    protocol: Protocol,
    kind: Kind,
    plan: &Plan,
    trips: u64,
    is_back: bool,
) {
    if !kind.is_detectable(protocol) {
        return;
    }
    let limits = Limits::of(protocol, kind);
    let [from, to] = plan.fault;
    let within = |what: &str, found: Option<f64>, limit: f64, ends: bool| match found {
        Some(found) if found <= limit => None,
        Some(found) => Some(format!(
            "{what}: force for {:.2} ms, allowed {:.2} ms",
            1e3 * found,
            1e3 * limit
        )),
        // The fault ended before the limit did.
        None if ends && to - from < limit => None,
        None => Some(format!("{what}: force until the end")),
    };
    let mut problems = Vec::new();
    if kind.cuts_commands(protocol) {
        problems.extend(within(
            "device",
            outcome.device,
            limits.device,
            kind != Kind::Killed,
        ));
    }
    if kind.cuts_states(protocol) || kind.is_told(protocol) || kind.is_meant() {
        let ends = kind == Kind::StaleHost;
        problems.extend(within("host", outcome.host, limits.host, ends));
    }
    if kind.is_harmless(protocol) && trips > 0 {
        problems.push(format!("{trips} trips of a device that is there"));
    }
    for (what, jump) in [
        ("commanded", outcome.host_jump),
        ("device's", outcome.device_jump),
    ] {
        if jump > limits.jump {
            problems.push(format!("the {what} force jumped by {jump:.3} N"));
        }
    }
    // Only the capped scheme promises it.
    if plan.scheme == Scheme::Capped && outcome.energy > limits.energy {
        problems.push(format!("net energy {:.3} mJ", 1e3 * outcome.energy));
    }
    // The wall may stand elsewhere for the hand that moved meanwhile, so the force itself shows nothing.
    if kind != Kind::Killed && !is_back {
        problems.push("the force has not come back".to_owned());
    }
    outcome.failures = problems;
}
