//! The worst ticks of a run, each with its stages and with what the kernel counted around it.

use super::stages::{Stage, Stages, whole};
use runner::kernel::{KernelCounts, KernelWindow};

/// Number of ticks that are kept.
const MOST: usize = 10;

/// A tick among the worst ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// Number of the tick.
    pub tick: u64,
    /// Its deadline (ns).
    pub time_ns: u64,
    /// Its stages.
    pub stages: Stages,
    /// Deadlines that were skipped after it.
    pub skipped: u64,
    /// What the kernel counted for the thread in the windows that the tick overlaps.
    pub counts: KernelCounts,
    /// The length of these windows together (ns); zero if no window is known.
    pub window_ns: u64,
}

impl Tick {
    fn overlaps(&self, window: &KernelWindow) -> bool {
        let end_ns = self.time_ns + whole(&self.stages);
        self.time_ns <= window.to_ns && window.from_ns <= end_ns
    }

    fn add(&mut self, window: &KernelWindow) {
        if self.overlaps(window) {
            self.counts = self.counts.plus(&window.counts);
            self.window_ns += window.to_ns - window.from_ns;
        }
    }

    /// The stage that took the longest beyond `usual`, its usual time (ns).
    pub fn cause(&self, usual: impl Fn(Stage) -> u64) -> Option<Stage> {
        let beyond = |(stage, ns): &(Stage, u64)| ns.saturating_sub(usual(*stage));
        let stages = self.stages.iter().rev();
        stages
            .max_by_key(|stage| beyond(stage))
            .map(|(stage, _)| *stage)
    }
}

/// The ticks whose last command was the latest after its deadline.
#[derive(Clone, Debug, Default)]
pub struct Worst {
    /// The ticks, the worst one first.
    pub ticks: Vec<Tick>,
    /// The last window. A tick that ends later may have begun in it.
    window: Option<KernelWindow>,
}

impl Worst {
    /// Takes a tick of `stages`.
    pub fn take(&mut self, tick: u64, time_ns: u64, stages: &[(Stage, u64)]) {
        let whole_ns = whole(stages);
        let place = self
            .ticks
            .partition_point(|kept| whole(&kept.stages) >= whole_ns);
        if place == MOST {
            return;
        }
        let mut new = Tick {
            tick,
            time_ns,
            stages: stages.to_vec(),
            skipped: 0,
            counts: KernelCounts::default(),
            window_ns: 0,
        };
        if let Some(window) = &self.window {
            new.add(window);
        }
        self.ticks.insert(place, new);
        self.ticks.truncate(MOST);
    }

    /// Notes that `skipped` deadlines followed the tick of the number `tick`.
    pub fn skip_after(&mut self, tick: u64, skipped: u64) {
        if let Some(kept) = self.ticks.iter_mut().find(|kept| kept.tick == tick) {
            kept.skipped = skipped;
        }
    }

    /// Takes a window, after every tick that ended in it.
    pub fn count(&mut self, window: &KernelWindow) {
        for tick in &mut self.ticks {
            tick.add(window);
        }
        self.window = Some(*window);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick(worst: &mut Worst, number: u64, compute_ns: u64) {
        let stages = [(Stage::Wake, 5_000), (Stage::Compute, compute_ns)];
        worst.take(number, number * 1_000_000, &stages);
    }

    fn window(from_ms: u64, to_ms: u64, minor_faults: u64) -> KernelWindow {
        KernelWindow {
            from_ns: from_ms * 1_000_000,
            to_ns: to_ms * 1_000_000 - 1,
            counts: KernelCounts {
                minor_faults,
                ..KernelCounts::default()
            },
        }
    }

    #[test]
    fn the_worst_ticks_are_kept_in_their_order_with_the_counts_of_their_own_windows() {
        let mut worst = Worst::default();
        for ten in 0..10 {
            for number in 10 * ten..10 * ten + 10 {
                tick(
                    &mut worst,
                    number,
                    if number == 42 { 900_000 } else { number },
                );
            }
            worst.count(&window(10 * ten, 10 * ten + 10, ten));
        }
        worst.skip_after(42, 3);
        worst.skip_after(5, 9);
        let numbers: Vec<_> = worst.ticks.iter().map(|tick| tick.tick).collect();
        assert_eq!(numbers, [42, 99, 98, 97, 96, 95, 94, 93, 92, 91]);
        let first = &worst.ticks[0];
        assert_eq!((first.counts.minor_faults, first.skipped), (4, 3));
        assert_eq!(worst.ticks[1].counts.minor_faults, 9);
    }

    #[test]
    fn a_tick_across_two_windows_has_the_counts_of_both() {
        let mut worst = Worst::default();
        worst.count(&window(0, 10, 1));
        worst.count(&window(10, 20, 2));
        // The tick began in the last window. Its record comes with the next one.
        tick(&mut worst, 19, 2_000_000);
        worst.count(&window(20, 30, 4));
        worst.count(&window(30, 40, 8));
        assert_eq!(worst.ticks[0].counts.minor_faults, 2 + 4);
        assert_eq!(worst.ticks[0].window_ns, 20_000_000 - 2);
    }

    #[test]
    fn the_cause_is_the_stage_that_is_longest_beyond_its_usual_time() {
        let mut worst = Worst::default();
        tick(&mut worst, 0, 90_000);
        let cause = |compute: u64| {
            worst.ticks[0].cause(|stage| {
                if stage == Stage::Compute {
                    compute
                } else {
                    1_000
                }
            })
        };
        assert_eq!(cause(10_000), Some(Stage::Compute));
        assert_eq!(cause(89_000), Some(Stage::Wake));
    }
}
