//! Virtual time: one loop, in one thread, for the ticks and for the host.
//!
//! Every tick and every host step happens at a time that is counted in integer nanoseconds. Before each tick the host
//! takes the steps that start by the time of the tick, and the models that have arrived by that time reach the tick.
//! A run of a scene, the runs of the stress studies and their references differ in their host and in their tick.
//! Faults and traces are wrappers around the device, the link and the host.

/// A host that steps between the ticks, with its end of the link.
pub trait Host {
    /// The reason why a step or a tick cannot be taken.
    type Error;

    /// The time at which the next step starts (ns); `None` if there is no next step.
    fn next_ns(&self) -> Option<u64>;

    /// Takes the next step.
    ///
    /// # Errors
    /// The step cannot be taken, which ends the run.
    fn step(&mut self) -> Result<(), Self::Error>;

    /// Gives the tick the models that have arrived by `now_ns`.
    fn deliver(&mut self, now_ns: u64);
}

/// The times of a run's ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeline {
    /// The tick's period (ns).
    pub period_ns: u64,
    /// Ticks in the run.
    pub ticks: u64,
}

impl Timeline {
    /// Makes all steps and ticks of the run. `tick` is given the host and the tick's time (ns).
    ///
    /// # Errors
    /// The first error of `host` or `tick`.
    pub fn drive<H: Host>(
        self,
        host: &mut H,
        mut tick: impl FnMut(&mut H, u64) -> Result<(), H::Error>,
    ) -> Result<(), H::Error> {
        for number in 0..self.ticks {
            let now_ns = number * self.period_ns;
            loop {
                host.deliver(now_ns);
                if host.next_ns().is_none_or(|start_ns| start_ns > now_ns) {
                    break;
                }
                host.step()?;
            }
            tick(host, now_ns)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A host that steps every 3 ns. A model arrives 2 ns after the start of its step.
    #[derive(Default)]
    struct Diary {
        next: u64,
        under_way: Vec<u64>,
        seen: Vec<(&'static str, u64)>,
    }

    impl Host for Diary {
        type Error = &'static str;

        fn next_ns(&self) -> Option<u64> {
            (self.next < 9).then_some(self.next)
        }

        fn step(&mut self) -> Result<(), &'static str> {
            self.seen.push(("step", self.next));
            self.under_way.push(self.next + 2);
            self.next += 3;
            Ok(())
        }

        fn deliver(&mut self, now_ns: u64) {
            for arrival in self.under_way.extract_if(.., |arrival| *arrival <= now_ns) {
                self.seen.push(("arrival", arrival));
            }
        }
    }

    #[test]
    fn steps_and_arrivals_come_in_order_before_their_tick() {
        let timeline = Timeline {
            period_ns: 4,
            ticks: 3,
        };
        let mut diary = Diary::default();
        let done = timeline.drive(&mut diary, |diary, now_ns| {
            diary.seen.push(("tick", now_ns));
            Ok(())
        });
        assert_eq!(done, Ok(()));
        let expected = [
            ("step", 0),
            ("tick", 0),
            ("arrival", 2),
            ("step", 3),
            ("tick", 4),
            ("arrival", 5),
            ("step", 6),
            ("arrival", 8),
            ("tick", 8),
        ];
        assert_eq!(diary.seen, expected);
    }

    #[test]
    fn the_first_error_ends_the_run() {
        let timeline = Timeline {
            period_ns: 1,
            ticks: 5,
        };
        let mut ticks = 0;
        let done = timeline.drive(&mut Diary::default(), |_, now_ns| {
            ticks += 1;
            if now_ns == 2 { Err("over") } else { Ok(()) }
        });
        assert_eq!((done, ticks), (Err("over"), 3));
    }
}
