//! The wake-up of the loop beside the wake-up of another program on the same core, in alternating slices.
//!
//! The two cannot have the core at the same time. Host, log and load run throughout. In a slice of the loop, the tick's thread
//! has the core. In a slice of the other program, the tick's thread runs on the other cores. A pair of slices is close in time, so
//! a busy stretch of the machine meets both. The ratio of two percentiles has an interval by resampling whole pairs
//! (block bootstrap: Künsch, "The jackknife and the bootstrap for general stationary observations", 1989).

use host::run::observer::{Observed, Observer};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use runner::link::LogRecord;
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::mpsc::Sender;

/// Number of resampled series.
const RESAMPLES: usize = 2000;
/// Seed of the resampling.
const SEED: u64 = 44;
/// Time after a change of the slice in which ticks belong to neither (ns).
const MARGIN_NS: u64 = 1_000_000_000;

/// Counts of latencies (ns).
pub type Counts = BTreeMap<u64, u64>;

/// The latencies of two slices.
#[derive(Clone, Debug, Default)]
pub struct Pair {
    /// Those of the loop.
    pub loop_ns: Counts,
    /// Those of the other program.
    pub other_ns: Counts,
}

/// The other program, and the core for which both compete.
pub trait Other: Send {
    /// Gives the core to the tick's thread.
    ///
    /// # Errors
    /// The reason, in words.
    fn give(&mut self) -> Result<(), String>;
    /// Takes the core from the tick's thread, and starts the other program there.
    ///
    /// # Errors
    /// The reason, in words.
    fn take(&mut self) -> Result<(), String>;
    /// The latencies of the other program, once it has ended.
    fn ended(&mut self) -> Option<Result<Counts, String>>;
}

/// The ratio of a percentile of the loop to that of the other program.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Ratio {
    /// The percentile (percent).
    pub percent: f64,
    /// That of the loop (s).
    pub loop_value: f64,
    /// That of the other program (s).
    pub other_value: f64,
    /// Their ratio (fraction).
    pub ratio: f64,
    /// Lower end of its 95 % interval (fraction).
    pub low: f64,
    /// Upper end of the interval (fraction).
    pub high: f64,
}

/// The ratios of the ascending percentiles `percents` over all pairs; none without pairs.
pub fn ratios(pairs: &[Pair], percents: &[f64]) -> Vec<Ratio> {
    if pairs.is_empty() {
        return Vec::new();
    }
    let mut chance = Pcg64::seed_from_u64(SEED);
    let all = vec![1; pairs.len()];
    let programs: [fn(&Pair) -> &Counts; 2] = [|pair| &pair.loop_ns, |pair| &pair.other_ns];
    let sorted = programs.map(|of| sorted(pairs, of));
    let values = |weights: &[u64]| {
        let [ours, others] = sorted
            .each_ref()
            .map(|sorted| percentiles(sorted, weights, percents));
        ours.into_iter().zip(others).collect::<Vec<_>>()
    };
    let resampled: Vec<_> = (0..RESAMPLES)
        .map(|_| {
            let mut weights = vec![0; pairs.len()];
            for _ in pairs {
                let index = (chance.next_u64() % pairs.len() as u64) as usize;
                weights[index] += 1;
            }
            values(&weights)
        })
        .collect();
    let each = percents.iter().zip(values(&all)).enumerate();
    let each = each.map(|(index, (&percent, (ours, other)))| {
        let ratio = |(ours, other): (u64, u64)| ours as f64 / other.max(1) as f64;
        let mut spread: Vec<f64> = resampled
            .iter()
            .map(|values| ratio(values[index]))
            .collect();
        spread.sort_by(f64::total_cmp);
        Ratio {
            percent,
            loop_value: ours as f64 * 1e-9,
            other_value: other as f64 * 1e-9,
            ratio: ratio((ours, other)),
            low: spread[RESAMPLES / 40],
            high: spread[RESAMPLES - 1 - RESAMPLES / 40],
        }
    });
    each.collect()
}

/// A latency (ns), the index of its pair, and the number of its values.
type Counted = (u64, usize, u64);

/// The latencies of one program in all pairs, ascending.
fn sorted(pairs: &[Pair], of: fn(&Pair) -> &Counts) -> Vec<Counted> {
    let each = pairs.iter().enumerate();
    let mut all: Vec<Counted> = each
        .flat_map(|(index, pair)| of(pair).iter().map(move |(&ns, &count)| (ns, index, count)))
        .collect();
    all.sort_unstable();
    all
}

/// The ascending percentiles `percents` (ns), in which each pair counts as often as its weight says.
fn percentiles(sorted: &[Counted], weights: &[u64], percents: &[f64]) -> Vec<u64> {
    let weighted = |&(_, pair, count): &Counted| count * weights.get(pair).copied().unwrap_or(0);
    let total: u64 = sorted.iter().map(weighted).sum();
    let mut up_to = 0;
    let mut latencies = sorted.iter();
    let mut last = 0;
    let each = percents.iter().map(|percent| {
        let rank = (percent / 100.0 * total as f64).ceil() as u64;
        while up_to < rank
            && let Some(counted) = latencies.next()
        {
            up_to += weighted(counted);
            last = counted.0;
        }
        last
    });
    each.collect()
}

/// What a comparison found: the pairs, or why it ended early.
pub type Found = (Vec<Pair>, Option<String>);

/// The observer of a run that alternates slices.
pub struct Slices {
    other: Box<dyn Other>,
    pairs: Vec<Pair>,
    wanted: usize,
    slice_ns: u64,
    /// Whether the loop has the core.
    ours: bool,
    /// The nominal time at which the slice began (ns).
    began_ns: u64,
    now_ns: u64,
    failure: Option<String>,
    to: Option<Sender<Found>>,
}

impl Slices {
    /// Alternates `wanted` pairs of slices of `slice_ns`. The loop has the first slice.
    pub fn new(other: Box<dyn Other>, wanted: usize, slice_ns: u64, to: Sender<Found>) -> Self {
        Self {
            other,
            pairs: vec![Pair::default()],
            wanted,
            slice_ns,
            ours: true,
            began_ns: 0,
            now_ns: 0,
            failure: None,
            to: Some(to),
        }
    }

    /// Sends what was found, once.
    fn end(&mut self) {
        if let Some(to) = self.to.take() {
            self.pairs
                .retain(|pair| !pair.loop_ns.is_empty() && !pair.other_ns.is_empty());
            // The command that waits for the result may have failed.
            let _ = to.send((std::mem::take(&mut self.pairs), self.failure.take()));
        }
    }

    /// Changes the slice if it is over.
    fn change(&mut self) -> Result<(), String> {
        if self.ours && self.now_ns >= self.began_ns + self.slice_ns {
            self.other.take()?;
        } else if let Some(counts) = (!self.ours).then(|| self.other.ended()).flatten() {
            if let Some(pair) = self.pairs.last_mut() {
                pair.other_ns = counts?;
            }
            self.other.give()?;
            if self.pairs.len() == self.wanted {
                self.end();
                return Ok(());
            }
            self.pairs.push(Pair::default());
        } else {
            return Ok(());
        }
        self.ours = !self.ours;
        self.began_ns = self.now_ns;
        Ok(())
    }
}

impl Observer for Slices {
    fn take(&mut self, record: LogRecord<'_>) {
        let LogRecord::Tick(telemetry) = record else {
            return;
        };
        self.now_ns = telemetry.time_ns;
        let measures = self.ours && self.to.is_some() && self.now_ns >= self.began_ns + MARGIN_NS;
        if let Some(pair) = self.pairs.last_mut().filter(|_| measures) {
            *pair.loop_ns.entry(telemetry.lateness_ns).or_default() += 1;
        }
    }

    fn drained(&mut self) {
        if self.to.is_some()
            && let Err(failure) = self.change()
        {
            self.failure = Some(failure);
            self.end();
        }
    }

    fn finish(mut self: Box<Self>, _: &mut Observed) {
        self.end();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::Telemetry;
    use std::sync::mpsc::channel;

    /// A program whose latencies are `ns`, for a second at a time.
    struct Steady {
        ns: u64,
        calls: Sender<&'static str>,
    }

    impl Other for Steady {
        fn give(&mut self) -> Result<(), String> {
            let _ = self.calls.send("give");
            Ok(())
        }
        fn take(&mut self) -> Result<(), String> {
            let _ = self.calls.send("take");
            Ok(())
        }
        fn ended(&mut self) -> Option<Result<Counts, String>> {
            Some(Ok([(self.ns, 1000)].into()))
        }
    }

    #[test]
    fn slices_alternate_and_ticks_near_a_change_belong_to_none() {
        let (calls, called) = channel();
        let (to, found) = channel();
        let other = Box::new(Steady { ns: 10_000, calls });
        let mut slices = Slices::new(other, 2, 3_000_000_000, to);
        for tick in 0..20_000_u64 {
            let mut telemetry = Telemetry::empty();
            telemetry.time_ns = tick * 1_000_000;
            telemetry.lateness_ns = 12_000;
            slices.take(LogRecord::Tick(&telemetry));
            if tick % 10 == 9 {
                slices.drained();
            }
        }
        let (pairs, failure) = found.recv().expect("it was sent");
        assert_eq!((pairs.len(), failure), (2, None));
        assert_eq!(
            called.try_iter().collect::<Vec<_>>(),
            ["take", "give", "take", "give"]
        );
        for pair in &pairs {
            let ticks: u64 = pair.loop_ns.values().sum();
            // Two seconds of the three, to the next reading of the ring.
            assert!((2_000..=2_010).contains(&ticks), "{ticks}");
        }
        let ratios = ratios(&pairs, &[50.0, 99.0]);
        assert_eq!(ratios.len(), 2);
        for found in ratios {
            assert_eq!([found.ratio, found.low, found.high], [1.2; 3]);
        }
    }

    /// Two programs of the same machine: the interval of their ratio contains one.
    #[test]
    fn the_ratio_of_equal_programs_is_one_within_its_interval() {
        let mut chance = Pcg64::seed_from_u64(9);
        let mut covered = 0;
        for _ in 0..40 {
            let pairs: Vec<Pair> = (0..20)
                .map(|_| {
                    // A busy slice delays both programs.
                    let busy = 10_000 + chance.next_u64() % 20_000;
                    let mut counts = || {
                        let mut counts = Counts::new();
                        for _ in 0..500 {
                            *counts.entry(busy + chance.next_u64() % 5_000).or_default() += 1;
                        }
                        counts
                    };
                    Pair {
                        loop_ns: counts(),
                        other_ns: counts(),
                    }
                })
                .collect();
            let ratio = ratios(&pairs, &[99.0])[0];
            covered += u32::from(ratio.low <= 1.0 && 1.0 <= ratio.high);
        }
        // Of 40 intervals of 95 %, 38 are expected. Fewer than 33 have a probability of a thousandth.
        assert!(covered >= 33, "{covered}");
        assert!(ratios(&[], &[99.0]).is_empty());
    }
}
