//! The clock of the tick: monotonic time, and sleep until an absolute deadline.
//!
//! These are the only system calls of the loop itself. A sleep until an absolute time (rather than for a duration)
//! keeps the grid of deadlines free of drift: the duration of a tick does not move the next deadline.
//!
//! On the hot path, the clock is read through the vDSO, without the kernel. Never sleep for a duration.

use rustix::io::Errno;
use rustix::thread::{ClockId, clock_nanosleep_absolute};
use rustix::time::{Timespec, clock_gettime};

const NANOSECONDS_PER_SECOND: u64 = 1_000_000_000;

/// Monotonic time (ns) since some moment before the process started.
pub fn now_ns() -> u64 {
    let time = clock_gettime(ClockId::Monotonic);
    // The monotonic clock is never negative, and 64 bits of nanoseconds last 584 years.
    (time.tv_sec as u64) * NANOSECONDS_PER_SECOND + time.tv_nsec as u64
}

/// Sleeps until the monotonic clock reads `deadline_ns`. Returns the reading on waking, which is never less. Signals
/// that interrupt the sleep do not shorten it. A deadline in the past returns at once.
pub(crate) fn sleep_until(deadline_ns: u64) -> u64 {
    let deadline = Timespec {
        tv_sec: (deadline_ns / NANOSECONDS_PER_SECOND) as i64,
        tv_nsec: (deadline_ns % NANOSECONDS_PER_SECOND) as _,
    };
    loop {
        let now = now_ns();
        if now >= deadline_ns {
            return now;
        }
        match clock_nanosleep_absolute(ClockId::Monotonic, &deadline) {
            Ok(()) | Err(Errno::INTR) => {}
            // The kernel refuses only invalid times. If it ever refuses this time, punctuality matters more than the
            // processor: wait actively.
            Err(_) => std::hint::spin_loop(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn time_does_not_run_backwards_and_a_sleep_never_ends_early() {
        let start = now_ns();
        let deadline = start + 2_000_000;
        let woke = sleep_until(deadline);
        assert!(woke >= deadline);
        assert!(now_ns() >= woke);
        // A deadline in the past does not wait, and still returns the present time.
        assert!(sleep_until(start) >= woke);
    }

    #[test]
    fn the_time_is_that_of_the_monotonic_clock() {
        let read = || {
            let time = clock_gettime(ClockId::Monotonic);
            Duration::new(time.tv_sec as u64, time.tv_nsec as u32).as_nanos()
        };
        for _ in 0..100 {
            let (before, now, after) = (read(), u128::from(now_ns()), read());
            assert!((before..=after).contains(&now), "{before} {now} {after}");
        }
    }

    /// The number of times that this thread has waited, as Linux counts them.
    fn waits() -> Option<u64> {
        let status = std::fs::read_to_string("/proc/thread-self/status").ok()?;
        let line = status
            .lines()
            .find(|line| line.starts_with("voluntary_ctxt"))?;
        line.split_whitespace().nth(1)?.parse().ok()
    }

    #[test]
    fn a_sleep_waits_in_the_kernel_rather_than_actively() {
        for ns in [2_000_000, 20_000_000] {
            let before = waits();
            sleep_until(now_ns() + ns);
            assert!(before.is_none() || waits() > before, "{ns} ns");
        }
    }
}
