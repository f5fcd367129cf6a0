//! The demands on a run with a fault of the connection, and those that it did not meet.

use super::run::{Outcome, Plan};
use rt_core::Scheme;
use sim::emulated::fault::Kind;
use sim::protocol::Protocol;

/// Largest growth of a force in a millisecond beyond the growth that the motion of the hand and the ramps explain (N). The
/// damper of the cap stops in a tick in which the velocity disagrees with the last counts, and returns at once: a run
/// without models reached 0.052 N by that. All other runs stay below 0.02 N.
const JUMP: f64 = 0.1;

/// A fault on the way to a device of a protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Case {
    /// The protocol.
    pub protocol: Protocol,
    /// The fault.
    pub kind: Kind,
}

impl Case {
    /// Whether no sound state reaches a host that runs.
    pub(super) fn cuts_states(self) -> bool {
        match self.kind {
            Kind::Unplugged | Kind::Reset | Kind::Silent => true,
            Kind::Corrupt | Kind::Stale => self.protocol.is_checked(),
            // The others answer commands only.
            Kind::Deaf | Kind::BrieflyDeaf => !self.protocol.is_checked(),
            _ => false,
        }
    }

    /// Whether the device itself lets go, and its states say so.
    pub(super) fn is_told(self) -> bool {
        let lets_go = matches!(
            self.kind,
            Kind::Deaf | Kind::BrieflyDeaf | Kind::EmergencyStop | Kind::MotorsOff
        );
        lets_go && self.protocol.is_checked()
    }

    /// Whether no sound command reaches the device.
    pub(super) fn cuts_commands(self) -> bool {
        self.cuts_states() || self.is_told() || matches!(self.kind, Kind::Stopped | Kind::Killed)
    }

    /// Whether the loop itself takes the force away, without a fault of the connection.
    pub(super) fn is_meant(self) -> bool {
        matches!(self.kind, Kind::HandsOff | Kind::Ordered | Kind::StaleHost)
    }

    /// Whether a receiver can tell the packets of the fault from sound ones. WoodenHaptics and the Falcon have neither a
    /// check sum nor a number in their packets, and the packets say nothing of the motors.
    pub fn is_detectable(self) -> bool {
        let unseen = matches!(
            self.kind,
            Kind::Corrupt | Kind::Stale | Kind::EmergencyStop | Kind::MotorsOff
        );
        self.protocol.is_checked() || !unseen
    }

    /// Whether the host must continue as if nothing had happened.
    pub(super) fn is_harmless(self) -> bool {
        match self.kind {
            Kind::Nothing | Kind::Fast | Kind::Slow => true,
            Kind::Flooding => self.protocol != Protocol::Falcon,
            _ => false,
        }
    }
}

/// The limits that a run is held to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Longest time of a force at the device (s): its watchdog, one turn of its loop, and the exchange that was under
    /// way.
    pub device: f64,
    /// Longest time of a force in the commands of the host (s): five periods of the device, the answer that was under
    /// way, and the tick that finds out. If the device says that it released the force: its watchdog, a state, its
    /// answer, and the tick.
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
    pub fn of(case: Case) -> Self {
        let Case { protocol, kind } = case;
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
        let told = if case.is_told() { device } else { 0.0 };
        Self {
            device,
            host: if case.is_meant() {
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

/// The demands that a run did not meet. The controller took the device for silent `trips` times since the fault began;
/// `is_back` tells whether its last command passed.
pub(super) fn judge(
    case: Case,
    plan: &Plan,
    outcome: &Outcome,
    trips: u64,
    is_back: bool,
) -> Vec<String> {
    if !case.is_detectable() {
        return Vec::new();
    }
    let limits = Limits::of(case);
    let kind = case.kind;
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
    if case.cuts_commands() {
        problems.extend(within(
            "device",
            outcome.device,
            limits.device,
            kind != Kind::Killed,
        ));
    }
    if case.cuts_states() || case.is_told() || case.is_meant() {
        let ends = kind == Kind::StaleHost;
        problems.extend(within("host", outcome.host, limits.host, ends));
    }
    if case.is_harmless() && trips > 0 {
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
    problems
}
