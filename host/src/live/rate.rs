//! When work is due that happens at most a number of times a second of the wall clock.

use std::time::{Duration, Instant};

/// Frames a second of the wall clock, at most (Hz).
const FRAMES: u32 = 60;

/// Says when the next frame is due. The times are a grid, so that a step that comes late does not delay the frames
/// after it.
#[derive(Clone, Debug)]
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
