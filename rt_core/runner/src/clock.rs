//! The clock of the tick: monotonic time, and sleeping until an absolute deadline.
//!
//! The only system calls the loop makes of its own. Sleeping to an absolute time (rather than for a
//! duration) keeps the grid of deadlines free of drift: whatever a tick took, the next deadline is where
//! it was planned.
//!
//! On the hot path: reading the clock goes through the vDSO, not the kernel. Never sleep for a duration.

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

/// Sleeps until the monotonic clock reads `deadline_ns`, and returns what it reads on waking: never less.
/// Signals that interrupt the sleep do not shorten it. A deadline in the past returns at once.
pub fn sleep_until(deadline_ns: u64) -> u64 {
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
            // The kernel refuses only times that are not times. Should it ever refuse this one, being on
            // time matters more than the processor: wait for the clock.
            Err(_) => std::hint::spin_loop(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_does_not_run_backwards_and_a_sleep_never_ends_early() {
        let start = now_ns();
        let deadline = start + 2_000_000;
        let woke = sleep_until(deadline);
        assert!(woke >= deadline);
        assert!(now_ns() >= woke);
        // One that has passed already does not wait, and still reports the present.
        assert!(sleep_until(start) >= woke);
    }
}
