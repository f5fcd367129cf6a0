//! The next action of the thread of a device, as a state machine without a thread, a clock or a ring.
//!
//! The driver of the machine gives it the time and the newest wrench of the tick, and carries out each [`Step`]. The
//! machine never repeats a force by itself, and never commands a force that waited while the process was stopped. If
//! the tick hands over no wrench for a while ([`let_go_after`](super::let_go_after)), the machine commands zero. The
//! state that comes back reports the let-go ([`rt_core::Rendering`]). The machine commands no wrench from before that
//! state ([`Gate`]), so the force returns along the tick's ramp. The machine tries to reopen a lost device every
//! [`RETRY_NS`], so the device comes back without a restart of the run.

use super::gate::Gate;
use super::{MotionSource, SLOTS};
use rt_core::{DeviceError, Reading, Wrench};
use std::time::Duration;

/// Time between two attempts to reopen a lost device (ns).
pub const RETRY_NS: u64 = 100_000_000;
/// Number of exchanges whose beginning is remembered: more than can wait for the tick.
pub(super) const BEGUN: usize = 2 * SLOTS;

/// The wrench that the tick hands over, with the exchanges to which it refers.
#[derive(Clone, Copy, Debug)]
pub struct Handed {
    pub(super) wrench: Wrench,
    /// The number of the exchange whose state the wrench answers; zero if the tick had no new state.
    pub(super) answers: u64,
    /// The number of the newest exchange whose state the tick has read; zero before the first.
    pub(super) seen: u64,
}

impl Default for Handed {
    /// No force.
    fn default() -> Self {
        Self {
            wrench: Wrench::zero(),
            answers: 0,
            seen: 0,
        }
    }
}

/// The reply to the tick.
#[derive(Clone, Copy, Debug)]
pub struct Reply {
    pub(super) answer: Reading,
    /// The number of the exchange, from one.
    pub(super) number: u64,
    pub(super) motion_to_force_ns: Option<u64>,
    pub(super) refused_wrenches: Option<u64>,
}

impl Default for Reply {
    fn default() -> Self {
        Self {
            answer: Err(DeviceError::NoReport),
            number: 0,
            motion_to_force_ns: None,
            refused_wrenches: None,
        }
    }
}

/// The next action of the driver of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Exchange this wrench (N, N m, device axes) for a state, and then call [`Poller::answered`].
    Exchange(Wrench),
    /// Wait until this time (ns), or until the tick hands a wrench over.
    Wait(u64),
    /// Try once to reopen the device, and then call [`Poller::reopened`].
    Reopen,
}

/// The presence of the device.
#[derive(Clone, Copy, Debug)]
enum Phase {
    /// The device answers. The poller waits for a wrench since this time (ns).
    Present { since_ns: u64 },
    /// The device is lost until an attempt at this time (ns) or later.
    Lost { retry_ns: u64 },
    /// The device is open again. The tick hands over no wrench before it has seen a state.
    Back,
}

/// The state machine. Times are of one clock (ns), with any origin.
#[derive(Clone, Debug)]
pub struct Poller {
    phase: Phase,
    gate: Gate,
    /// Time without a wrench after which the device is commanded zero (ns).
    let_go_ns: u64,
    /// When the poller last looked for a wrench (ns).
    looked_ns: u64,
    /// The command of the exchange that is under way; `None` for a zero that the tick did not command.
    handed: Option<Handed>,
    /// Number of wrenches that the device had refused when the tick began. Refusals of an idle device before the tick
    /// do not count.
    refused_before: Option<u64>,
    /// The last exchanges, by number, and when each began (ns).
    begun: [(u64, u64); BEGUN],
}

impl Poller {
    /// The poller of a device that is open. It commands zero after the time `let_go` without a wrench.
    pub fn new(now_ns: u64, let_go: Duration) -> Self {
        Self {
            phase: Phase::Present { since_ns: now_ns },
            gate: Gate::default(),
            let_go_ns: let_go.as_nanos() as u64,
            looked_ns: now_ns,
            handed: None,
            refused_before: None,
            begun: [(0, now_ns); BEGUN],
        }
    }

    /// The action at `now_ns`. `newest` is the newest wrench that was handed over since the call before.
    pub fn next(&mut self, now_ns: u64, newest: Option<Handed>) -> Step {
        match self.phase {
            Phase::Lost { retry_ns } if now_ns < retry_ns => Step::Wait(retry_ns),
            Phase::Lost { .. } => Step::Reopen,
            Phase::Back => self.begin(now_ns, None),
            Phase::Present { since_ns } => {
                // After a longer time between two looks, the process was stopped or the device blocked. The wrench may
                // then be just as old. A late wake-up does not count as such a case.
                let away_ns = now_ns.saturating_sub(self.looked_ns);
                self.looked_ns = now_ns;
                let handed = newest.filter(|_| away_ns <= self.let_go_ns.saturating_mul(2));
                let due_ns = since_ns.saturating_add(self.let_go_ns);
                if handed.is_none() && now_ns < due_ns {
                    return Step::Wait(due_ns);
                }
                self.begin(now_ns, handed)
            }
        }
    }

    /// Begins an exchange, with zero if the tick has handed over no wrench.
    fn begin(&mut self, now_ns: u64, handed: Option<Handed>) -> Step {
        self.handed = handed;
        let wrench = match &handed {
            Some(handed) => self.gate.pass(&handed.wrench, handed.seen),
            None => self.gate.let_go(),
        };
        let number = self.gate.number();
        self.begun[number as usize % BEGUN] = (number, now_ns);
        Step::Exchange(wrench)
    }

    /// Ends the exchange that [`next`](Self::next) asked for, with the `answer` of the device. The device also reported
    /// its `motion` to force and the number of wrenches that it `refused`. Returns the reply for the tick.
    pub fn answered(
        &mut self,
        now_ns: u64,
        mut answer: Reading,
        motion: MotionSource,
        refused: Option<u64>,
    ) -> Reply {
        self.gate.end(&mut answer);
        self.phase = match answer {
            Err(DeviceError::Disconnected(_)) => Phase::Lost {
                retry_ns: now_ns.saturating_add(RETRY_NS),
            },
            _ => Phase::Present { since_ns: now_ns },
        };
        let number = self.gate.number();
        let motion_to_force_ns = match motion {
            MotionSource::Device(time_ns) => time_ns,
            MotionSource::Thread => {
                let asked = self.handed.map_or(0, |handed| handed.answers);
                let [(_, begun_ns), (answered, asked_ns)] =
                    [number, asked].map(|number| self.begun[number as usize % BEGUN]);
                let is_known = asked > 0 && answered == asked;
                is_known.then(|| begun_ns.saturating_sub(asked_ns))
            }
        };
        if self.handed.is_some() && self.refused_before.is_none() {
            self.refused_before = refused;
        }
        let before = self.refused_before;
        Reply {
            answer,
            number,
            motion_to_force_ns,
            refused_wrenches: refused.map(|count| count.saturating_sub(before.unwrap_or(count))),
        }
    }

    /// Ends the attempt that [`next`](Self::next) asked for.
    pub fn reopened(&mut self, now_ns: u64, result: Result<(), DeviceError>) {
        self.phase = match result {
            Ok(()) => Phase::Back,
            Err(_) => Phase::Lost {
                retry_ns: now_ns.saturating_add(RETRY_NS),
            },
        };
    }
}
