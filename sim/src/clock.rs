//! Virtual time: when periodic events are due, in whole nanoseconds and without drift.
//!
//! The n-th event of a rate is due at `floor(n 1e9 / rate)` ns, computed from `n` and never by adding up, so
//! that rates that do not divide one another (a host at 60 Hz, a tick at 1 kHz) keep their places for ever.

use core::num::NonZeroU32;

const SECOND_NS: u128 = 1_000_000_000;

/// A rate of events, the first of which (number 0) is due at time zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Periodic {
    rate_hz: NonZeroU32,
}

impl Periodic {
    /// Events at a whole number of Hz; `None` for zero.
    pub fn new(rate_hz: u32) -> Option<Self> {
        NonZeroU32::new(rate_hz).map(|rate_hz| Self { rate_hz })
    }

    /// The rate (Hz).
    pub fn rate_hz(self) -> u32 {
        self.rate_hz.get()
    }

    /// When event `n` is due (ns): `floor(n 1e9 / rate)`; the last representable time where that is later.
    pub fn due_ns(self, n: u64) -> u64 {
        let due = u128::from(n) * SECOND_NS / u128::from(self.rate_hz.get());
        u64::try_from(due).unwrap_or(u64::MAX)
    }

    /// How many events are due at `now_ns` or before.
    pub fn count_until(self, now_ns: u64) -> u64 {
        // due(n) <= now  <=>  n 1e9 / rate < now + 1.
        let count = ((u128::from(now_ns) + 1) * u128::from(self.rate_hz.get())).div_ceil(SECOND_NS);
        u64::try_from(count).unwrap_or(u64::MAX)
    }

    /// Its events one after the other, from number 0.
    pub fn ticks(self) -> Ticks {
        Ticks {
            periodic: self,
            next: 0,
        }
    }
}

/// The events of a [`Periodic`] that are still to come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ticks {
    periodic: Periodic,
    next: u64,
}

impl Ticks {
    /// Number of the next event.
    pub fn number(&self) -> u64 {
        self.next
    }

    /// When the next event is due (ns).
    pub fn due_ns(&self) -> u64 {
        self.periodic.due_ns(self.next)
    }

    /// Takes the next event if it is due at `now_ns` or before: its number.
    pub fn take_due(&mut self, now_ns: u64) -> Option<u64> {
        if self.due_ns() > now_ns {
            return None;
        }
        let number = self.next;
        self.next += 1;
        Some(number)
    }
}

impl Iterator for Ticks {
    /// When the event is due (ns).
    type Item = u64;

    fn next(&mut self) -> Option<u64> {
        let due = self.due_ns();
        self.next += 1;
        Some(due)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn sixty_hertz_against_one_kilohertz_keeps_its_places() {
        let (tick, host) = (Periodic::new(1000).unwrap(), Periodic::new(60).unwrap());
        assert_eq!(
            host.ticks().take(5).collect::<Vec<_>>(),
            [0, 16_666_666, 33_333_333, 50_000_000, 66_666_666]
        );
        // A year later still on the whole second.
        let year = 365 * 24 * 3600;
        assert_eq!(host.due_ns(60 * year), year * 1_000_000_000);
        let mut frames = host.ticks();
        let mut taken = 0;
        for now in tick.ticks().take(1001) {
            while frames.take_due(now).is_some() {
                taken += 1;
            }
            assert_eq!(taken, host.count_until(now));
        }
        assert_eq!((taken, frames.number()), (61, 61));
        assert_eq!(Periodic::new(0), None);
    }

    proptest! {
        #[test]
        fn counting_inverts_the_due_time(rate in 1..1_000_000_000_u32, n in 0..1_u64 << 32) {
            let periodic = Periodic::new(rate).unwrap();
            let due = periodic.due_ns(n);
            prop_assert_eq!(periodic.count_until(due), n + 1);
            if due > 0 {
                prop_assert!(periodic.count_until(due - 1) == n);
            }
        }
    }
}
