//! The times at which a subscriber is due a snapshot: at a rate of the run's own time, or of the wall clock while a viewer
//! is connected.

use super::host::Medians;
use super::ring::Missing;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// The times of a subscriber's snapshots.
#[derive(Debug)]
pub enum When {
    /// At the times of a series, each once.
    Series(Schedule),
    /// While there are viewers, at most sixty times a second of the wall clock.
    Watched(Watched),
}

/// The state of [`When::Watched`].
#[derive(Debug)]
pub struct Watched {
    pub(super) watchers: Watchers,
    pub(super) rate: Rate,
    pub(super) medians: Medians,
}

impl When {
    /// While there are `watchers`.
    pub fn watched(watchers: Watchers) -> Self {
        Self::Watched(Watched {
            watchers,
            rate: Rate::of_frames(),
            medians: Medians::default(),
        })
    }
}

/// Number of viewers. The host reads this number after each step.
#[derive(Clone, Debug, Default)]
pub struct Watchers(Arc<AtomicUsize>);

impl Watchers {
    /// Sets the number.
    pub fn set(&self, count: usize) {
        // Relaxed: no other memory depends on this number.
        self.0.store(count, Ordering::Relaxed);
    }

    /// Whether there is a viewer.
    pub fn any(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 0
    }
}

/// A series of snapshots of the run's own time, the first at time zero.
#[derive(Debug)]
pub struct Schedule {
    /// Snapshots a second (Hz).
    rate: f64,
    /// Number of the next snapshot.
    next: usize,
}

impl Schedule {
    /// Snapshots at `rate` (Hz).
    pub fn new(rate: f64) -> Self {
        Self { rate, next: 0 }
    }

    /// Time of a snapshot (ns), computed as the pacer computes the times of the steps.
    fn time_ns(&self, number: usize) -> u64 {
        (number as f64 * 1e9 / self.rate) as u64
    }

    /// The number of the snapshot that is due after a step at `time_ns`, if one is. Snapshots for which the host made no
    /// step are counted as missing.
    pub(super) fn due(&mut self, time_ns: u64, missing: &Missing) -> Option<usize> {
        if time_ns < self.time_ns(self.next) {
            return None;
        }
        while self.time_ns(self.next + 1) <= time_ns {
            self.next += 1;
            missing.count_skipped();
        }
        let number = self.next;
        self.next += 1;
        Some(number)
    }
}

/// Frames a second of the wall clock, at most (Hz).
const FRAMES: u32 = 60;

/// Says when the next frame is due. The times are a grid, so that a step that comes late does not delay the frames
/// after it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rate {
    period: Duration,
    next: Option<Instant>,
}

impl Rate {
    /// The rate of frames. The first frame is due at once.
    pub(crate) fn of_frames() -> Self {
        Self {
            period: Duration::from_secs(1) / FRAMES,
            next: None,
        }
    }

    /// Whether a frame is due at `now`. The next frame is then due one period later.
    pub(crate) fn is_due(&mut self, now: Instant) -> bool {
        let due = self.next.unwrap_or(now);
        if now < due {
            return false;
        }
        let next = due + self.period;
        self.next = Some(if next > now { next } else { now + self.period });
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_stay_on_their_grid_and_do_not_catch_up() {
        let start = Instant::now();
        let mut rate = Rate::of_frames();
        let mut due = |microseconds| rate.is_due(start + Duration::from_micros(microseconds));
        assert!(due(0));
        assert!(!due(10_000));
        // The second frame comes 5 ms late, and the third still belongs to 33.3 ms.
        assert!(due(21_700));
        assert!(!due(33_000));
        assert!(due(33_400));
        // After a long pause one frame is due, and not all that were missed.
        assert!(due(500_000));
        assert!(!due(501_000));
        assert!(!due(516_000));
        assert!(due(516_700));
    }
}
