//! The due times of the host's steps, which of them publish, and what a late host leaves out.
//!
//! Due times are integer nanoseconds, computed from the rate itself, so that 60 Hz against 1 kHz never drifts. The
//! same pacer serves the real clock and virtual time.
//!
//! A late host leaves out **publications**, not steps: the time of the bodies then runs as fast as the clock, and the
//! hands feel the bodies' own dynamics. Steps are left out if they can no longer be made up for: when the host is
//! late by a tenth of a second, and when it is too slow even for the steps alone.

/// Lateness at which the host leaves out the steps that are due (ns). A body that made up for more would show the hands
/// a past that they still remember.
const LONGEST: u64 = 100_000_000;

/// Due times of physics steps and which of them publish.
#[derive(Clone, Debug)]
pub struct Pacer {
    step_rate: f64,
    /// Least number of steps from one publication to the next.
    steps_per_publication: u64,
    next: u64,
    /// The last step that published; zero before the first.
    published: u64,
    /// Lateness of the step before, if it did not publish (ns).
    late_ns: Option<u64>,
    /// Number of publications, in a row, by which the host did not make up for its lateness.
    hopeless: u32,
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
    /// Steps at `step_rate` (Hz), of which every `steps_per_publication`-th publishes while the host is on time.
    pub fn new(step_rate: f64, steps_per_publication: u64) -> Self {
        Self {
            step_rate,
            steps_per_publication,
            next: 1,
            published: 0,
            late_ns: None,
            hopeless: 0,
            skipped: 0,
        }
    }

    fn time_ns(&self, step: u64) -> u64 {
        (step as f64 * 1e9 / self.step_rate) as u64
    }

    /// Due time of the next step (ns).
    pub fn next_ns(&self) -> u64 {
        self.time_ns(self.next)
    }

    /// The step that the host takes at `now_ns`, which is not before [`Pacer::next_ns`].
    ///
    /// A step publishes if a period has passed since the last publication and no further step is due. A host whose
    /// steps alone do not make up for its lateness publishes nevertheless. If this happens twice in a row, the host
    /// leaves out the steps that are due: the bodies then run slower than the clock.
    pub fn begin(&mut self, now_ns: u64) -> Due {
        if now_ns.saturating_sub(self.next_ns()) >= LONGEST || self.hopeless > 1 {
            self.leave_out(now_ns);
        }
        let step = self.next;
        let time_ns = self.time_ns(step);
        let late_ns = now_ns.saturating_sub(time_ns);
        let further = self.time_ns(step + 1) <= now_ns;
        let gains = self.late_ns.is_none_or(|before| late_ns < before);
        let publishes = step >= self.published + self.steps_per_publication && !(further && gains);
        if publishes {
            self.published = step;
            self.hopeless = if further { self.hopeless + 1 } else { 0 };
        }
        self.late_ns = (!publishes).then_some(late_ns);
        self.next = step + 1;
        Due { time_ns, publishes }
    }

    /// Leaves out the steps before the last step that is due at `now_ns`.
    fn leave_out(&mut self, now_ns: u64) {
        let mut last = (now_ns as f64 * self.step_rate * 1e-9) as u64 + 1;
        while self.time_ns(last) > now_ns {
            last -= 1;
        }
        self.skipped += last.saturating_sub(self.next);
        self.next = self.next.max(last);
        (self.late_ns, self.hopeless) = (None, 0);
    }

    /// Due time of the last step (ns); zero before the first.
    pub fn last_ns(&self) -> u64 {
        self.time_ns(self.next - 1)
    }

    /// Steps left out so far because the host was late.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn due_times_do_not_drift_and_every_nth_publishes() {
        let mut pacer = Pacer::new(60.0, 2);
        let mut publications = 0;
        for step in 1..=60_u64 {
            assert_eq!(pacer.next_ns(), step * 1_000_000_000 / 60);
            let due = pacer.begin(pacer.next_ns());
            assert_eq!(due.time_ns, step * 1_000_000_000 / 60);
            assert_eq!(due.publishes, step % 2 == 0);
            publications += u64::from(due.publishes);
        }
        assert_eq!((publications, pacer.skipped()), (30, 0));
    }

    /// The numbers of the steps that publish until `until_ms`, by a host whose step takes `step_ns`, and whose
    /// publication takes `publication_ns` more; and the pacer at the end.
    fn published(
        mut pacer: Pacer,
        until_ms: u64,
        (step_ns, publication_ns): (u64, u64),
    ) -> (Vec<u64>, Pacer) {
        let (mut now_ns, mut steps) = (0, Vec::new());
        while now_ns < until_ms * MS {
            now_ns = now_ns.max(pacer.next_ns());
            let due = pacer.begin(now_ns);
            now_ns += step_ns;
            if due.publishes {
                now_ns += publication_ns;
                steps.push(due.time_ns / MS);
            }
        }
        (steps, pacer)
    }

    #[test]
    fn a_late_host_leaves_out_publications_and_no_steps() {
        for (period, step_ns, publication_ns, every) in [
            (4, 0, 4 * MS, 4),
            (4, 0, 6 * MS, 6),
            (1, 0, 10 * MS, 10),
            // Steps that take time make up for less.
            (4, MS / 2, 4 * MS, 8),
            (1, MS / 2, 3 * MS, 6),
        ] {
            let pacer = Pacer::new(1000.0, period);
            let (steps, pacer) = published(pacer, 2000, (step_ns, publication_ns));
            assert_eq!(pacer.skipped(), 0);
            let apart = steps.windows(2).map(|pair| pair[1] - pair[0]);
            for apart in apart.skip(2) {
                assert!(
                    apart.abs_diff(every) <= 1,
                    "{period} {publication_ns}: {apart}"
                );
            }
        }
    }

    #[test]
    fn a_host_too_slow_for_the_steps_alone_leaves_steps_out_and_goes_on_publishing() {
        let (steps, pacer) = published(Pacer::new(1000.0, 4), 2000, (2 * MS, MS));
        // A cycle of four steps and a publication takes 9 ms.
        assert!(steps.len() > 2000 / 11, "{}", steps.len());
        assert!(
            (900..1300).contains(&pacer.skipped()),
            "{}",
            pacer.skipped()
        );
    }

    #[test]
    fn after_a_stall_the_host_continues_at_the_present() {
        let mut pacer = Pacer::new(1000.0, 4);
        pacer.begin(MS);
        // A stall below the longest lateness is made up for.
        let due = pacer.begin(101 * MS);
        assert_eq!((due.time_ns, pacer.skipped()), (2 * MS, 0));
        let due = pacer.begin(103 * MS + MS / 2);
        let expected = Due {
            time_ns: 103 * MS,
            publishes: true,
        };
        assert_eq!((due, pacer.skipped()), (expected, 100));
        assert_eq!((pacer.last_ns(), pacer.next_ns()), (103 * MS, 104 * MS));
    }
}
