//! The trust in the messages of the host: from zero, where only the safe hold is left, to one.
//!
//! A message older than the limit is not trusted: the trust falls. A new message brings it back. [`Trust::part`] is a smooth step
//! of it, so that no force jumps.

use crate::count_one;
use crate::coupling::HostState;
use crate::geometry::smooth_step;

/// How the messages of a kind age.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aging {
    /// The tick's period (s).
    pub(crate) period: f64,
    /// Age beyond which a message is no longer trusted (s).
    pub(crate) age_limit: f64,
    /// Time in which the trust falls (s).
    pub(crate) decay: f64,
    /// Time in which it comes back (s).
    pub(crate) recovery: f64,
}

/// The trust in the newest message.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trust {
    aging: Aging,
    value: f64,
    state: HostState,
    /// Times that a message grew too old.
    faded: u64,
    /// Time of the last tick (ns); `None` before the first.
    ticked_ns: Option<u64>,
}

impl Trust {
    /// No trust, before the first message.
    pub(crate) fn new(aging: Aging) -> Self {
        Self {
            aging,
            value: 0.0,
            state: HostState::Waiting,
            faded: 0,
            ticked_ns: None,
        }
    }

    /// Notes the time of a tick.
    pub(crate) fn begin(&mut self, now_ns: u64) {
        self.ticked_ns = Some(now_ns);
    }

    /// Whether a time is farther ahead of the last tick than the age that a message may have.
    pub(crate) fn is_to_come(&self, time_ns: u64) -> bool {
        self.ticked_ns.is_some_and(|ticked| {
            let ahead = time_ns.saturating_sub(ticked) as f64 * 1e-9;
            ahead > self.aging.age_limit
        })
    }

    /// Passes a tick with a message of this age (ns).
    pub(crate) fn grow_old(&mut self, age_ns: u64) {
        let aging = &self.aging;
        let fresh = age_ns as f64 <= aging.age_limit * 1e9;
        let was_live = self.state == HostState::Live;
        let step = if fresh {
            aging.period / aging.recovery
        } else {
            -aging.period / aging.decay
        };
        self.value = (self.value + step).clamp(0.0, 1.0);
        self.state = match (fresh, self.value > 0.0) {
            (true, _) => HostState::Live,
            (false, true) => HostState::Fading,
            (false, false) => HostState::Held,
        };
        if was_live && !fresh {
            count_one(&mut self.faded);
        }
    }

    /// The trust.
    pub(crate) fn value(&self) -> f64 {
        self.value
    }

    /// The part of a force that is rendered.
    pub(crate) fn part(&self) -> f64 {
        smooth_step(self.value)
    }

    /// What a reader of the messages does.
    pub(crate) fn state(&self) -> HostState {
        self.state
    }

    /// Times that a message grew too old.
    pub(crate) fn faded(&self) -> u64 {
        self.faded
    }
}
