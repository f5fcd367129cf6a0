//! The due times of the host's steps, and the steps that a late host leaves out.
//!
//! Due times are integer nanoseconds, computed from the rate itself, so that 60 Hz against 1 kHz never drifts. The
//! same pacer serves the real clock and virtual time.

/// Due times of physics steps and which of them publish.
#[derive(Clone, Debug)]
pub struct Pacer {
    step_rate: f64,
    steps_per_publication: u64,
    next: u64,
    /// The last step done; zero before the first.
    last: u64,
    skipped: u64,
}

/// One step that is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Due {
    /// Due time (ns).
    pub time_ns: u64,
    /// Whether the step publishes.
    pub publishes: bool,
}

impl Pacer {
    /// Steps at `step_rate` (Hz), of which every `steps_per_publication`-th publishes.
    pub fn new(step_rate: f64, steps_per_publication: u64) -> Self {
        Self {
            step_rate,
            steps_per_publication,
            next: 1,
            last: 0,
            skipped: 0,
        }
    }

    fn time_ns(&self, step: u64) -> u64 {
        (step as f64 * 1e9 / self.step_rate) as u64
    }

    /// The next step.
    pub fn due(&self) -> Due {
        Due {
            time_ns: self.time_ns(self.next),
            publishes: self.next.is_multiple_of(self.steps_per_publication),
        }
    }

    /// Counts a step that is done at `now_ns`. A host that is behind by a whole publication period leaves out the
    /// missed steps and does not catch up. The physics then runs slower than the clock, and [`Pacer::skipped`] counts
    /// the steps left out.
    pub fn done(&mut self, now_ns: u64) {
        self.last = self.next;
        self.next += 1;
        while self.time_ns(self.next + self.steps_per_publication) <= now_ns {
            self.next += self.steps_per_publication;
            self.skipped += self.steps_per_publication;
        }
    }

    /// Due time of the last step done (ns); zero before the first.
    pub fn last_ns(&self) -> u64 {
        self.time_ns(self.last)
    }

    /// Steps left out so far because the host was late.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn due_times_do_not_drift_and_every_nth_publishes() {
        let mut pacer = Pacer::new(60.0, 2);
        let mut publications = 0;
        for step in 1..=60_u64 {
            let due = pacer.due();
            assert_eq!(due.time_ns, step * 1_000_000_000 / 60);
            publications += u64::from(due.publishes);
            pacer.done(due.time_ns);
        }
        assert_eq!((publications, pacer.skipped()), (30, 0));
    }

    #[test]
    fn a_late_host_leaves_steps_out_and_counts_them() {
        let mut pacer = Pacer::new(1000.0, 4);
        pacer.done(1_000_000);
        // The second step is two periods late. The pacer skips steps and keeps the rhythm of publications.
        pacer.done(11_000_000);
        assert_eq!((pacer.skipped(), pacer.last_ns()), (8, 2_000_000));
        assert_eq!(
            pacer.due(),
            Due {
                time_ns: 11_000_000,
                publishes: false
            }
        );
    }
}
