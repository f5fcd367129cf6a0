//! Percentiles of a long series of times, each with an interval that assumes no distribution and allows for correlation.
//!
//! The times of successive ticks depend on each other: a busy stretch of the machine delays many ticks. The series is
//! therefore divided into blocks of equal length, which are much longer than such a stretch. For a level, the counts of
//! values above it vary from block to block. The **design effect** of the level is the ratio of this variance to the
//! variance that independent values would have (Kish, "Survey sampling", 1965, section 8.2). A series of `n` values with
//! design effect `d` knows a fraction as well as `n/d` independent values do. For these, the interval of Clopper and Pearson
//! ("The use of confidence or fiducial limits", Biometrika 26, 1934) is exact: a level belongs to the interval of a
//! percentile unless a binomial test rejects the percentile's fraction at that level.
//!
//! A level that few values exceed does not show how these values cluster. Its design effect is therefore the largest among
//! the levels down to one that two hundred values exceed.

use hdrhistogram::Histogram;
use serde::Serialize;
use statrs::function::beta::beta_reg;
use std::collections::BTreeMap;

/// The percentiles that a measurement states, in percent.
pub const PERCENTILES: [f64; 6] = [50.0, 90.0, 99.0, 99.9, 99.99, 99.999];
/// The probability with which an interval contains the percentile of the machine.
pub const CONFIDENCE: f64 = 0.9;
/// Number of blocks of a whole series.
const BLOCKS: u64 = 50;
/// Number of values above a level from which on the level shows how these values cluster.
const ENOUGH: f64 = 200.0;
/// The design effect up to which a series may be independent: the variance of [`BLOCKS`] independent counts is greater with a
/// probability of a twentieth.
const CHANCE: f64 = 1.35;
/// Significant digits of a value.
const DIGITS: u8 = 3;

/// A series of times (ns) in blocks.
#[derive(Clone, Debug)]
pub struct Series {
    blocks: Vec<Histogram<u32>>,
    /// Values of a block; the last block takes the rest.
    length: u64,
    count: u64,
    sum: f64,
    min: u64,
    max: u64,
    max_at: u64,
}

/// A percentile with its interval (s).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentile {
    /// The fraction of the values at or below this time (percent).
    pub percent: f64,
    /// The time, known to one part in a thousand (s).
    pub value: f64,
    /// Lower end of the interval (s).
    pub low: f64,
    /// Upper end of the interval (s).
    pub high: f64,
}

impl Series {
    /// An empty series, which will have about `expected` values.
    pub fn new(expected: u64) -> Self {
        Self {
            blocks: Vec::new(),
            length: (expected / BLOCKS).max(1),
            count: 0,
            sum: 0.0,
            min: u64::MAX,
            max: 0,
            max_at: 0,
        }
    }

    /// Adds a value (ns) of the time `at_ns`.
    pub fn record(&mut self, at_ns: u64, value_ns: u64) {
        let begins = self.count.is_multiple_of(self.length);
        if begins && (self.blocks.len() as u64) < BLOCKS {
            // Three digits are a valid precision.
            self.blocks.extend(Histogram::new(DIGITS));
        }
        if let Some(block) = self.blocks.last_mut() {
            // A histogram that grows takes every value.
            let _ = block.record(value_ns);
        }
        self.count += 1;
        self.sum += value_ns as f64;
        self.min = self.min.min(value_ns);
        if value_ns > self.max || self.count == 1 {
            (self.max, self.max_at) = (value_ns, at_ns);
        }
    }

    /// Number of values.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The mean (s); zero for an empty series.
    pub fn mean(&self) -> f64 {
        self.sum / self.count.max(1) as f64 * 1e-9
    }

    /// The smallest value (s); zero for an empty series.
    pub fn min(&self) -> f64 {
        if self.count == 0 {
            0.0
        } else {
            seconds(self.min)
        }
    }

    /// The largest value (s), and its time (s). Both are exact, and zero for an empty series.
    pub fn max(&self) -> (f64, f64) {
        (seconds(self.max), seconds(self.max_at))
    }

    /// The number of values of each interval of the histogram, by the upper end of the interval (ns), ascending.
    pub fn histogram(&self) -> BTreeMap<u64, u64> {
        let mut all = BTreeMap::new();
        for value in self.blocks.iter().flat_map(Histogram::iter_recorded) {
            // The largest value is known exactly.
            let edge = value.value_iterated_to().min(self.max);
            *all.entry(edge).or_insert(0) += u64::from(value.count_at_value());
        }
        all
    }

    /// The percentiles of [`PERCENTILES`] for which the series is long enough: those whose interval has an upper end. For
    /// independent values these are the percentiles beyond which three values are expected, so the last percentile takes
    /// 300,000 values. A correlated series needs more.
    pub fn percentiles(&self) -> Vec<Percentile> {
        let levels = self.levels();
        let all = self.count as f64;
        let each = PERCENTILES.iter().map_while(|&percent| {
            let fraction = 1.0 - percent / 100.0;
            let (low, high) = interval(&levels, all, fraction)?;
            let value = first(&levels, |level| level.above <= fraction * all)?;
            Some(Percentile {
                percent,
                value: seconds(value),
                low: seconds(low),
                high: seconds(high),
            })
        });
        each.collect()
    }

    /// Every level of the series, ascending.
    fn levels(&self) -> Vec<Level> {
        // The counts above a level, by block, from the lowest level to the highest one.
        let mut above: Vec<f64> = self.blocks.iter().map(|block| block.len() as f64).collect();
        let mut by_value: BTreeMap<u64, Vec<(usize, u32)>> = BTreeMap::new();
        for (index, block) in self.blocks.iter().enumerate() {
            for value in block.iter_recorded() {
                let edge = value.value_iterated_to().min(self.max);
                let counts = by_value.entry(edge).or_default();
                counts.push((index, value.count_at_value()));
            }
        }
        let all = self.count as f64;
        let mut levels: Vec<Level> = Vec::with_capacity(by_value.len());
        for (edge_ns, counts) in by_value {
            for (index, count) in counts {
                if let Some(above) = above.get_mut(index) {
                    *above -= f64::from(count);
                }
            }
            levels.push(Level {
                edge_ns,
                above: above.iter().sum(),
                effect: design_effect(&above, all),
            });
        }
        // From the last level that enough values exceed upwards, the largest effect so far.
        let rare = levels.partition_point(|level| level.above >= ENOUGH);
        let mut most: f64 = 1.0;
        for level in levels.iter_mut().skip(rare.saturating_sub(1)) {
            most = most.max(level.effect);
            level.effect = most;
        }
        levels
    }
}

/// A level of a series.
#[derive(Clone, Copy, Debug)]
struct Level {
    /// The time (ns).
    edge_ns: u64,
    /// Number of values above it.
    above: f64,
    /// Its design effect, at least one.
    effect: f64,
}

/// The design effect of a level, for the number of values `above` it in each block, of `all` values.
fn design_effect(above: &[f64], all: f64) -> f64 {
    let blocks = above.len() as f64;
    let mean = above.iter().sum::<f64>() / blocks;
    let fraction = mean * blocks / all;
    let independent = mean * (1.0 - fraction);
    if blocks < 2.0 || independent <= 0.0 {
        return 1.0;
    }
    let squares: f64 = above.iter().map(|count| (count - mean).powi(2)).sum();
    let effect = squares / (blocks - 1.0) / independent;
    if effect > CHANCE { effect } else { 1.0 }
}

/// The ends (ns) of the interval of the level that the fraction `fraction` of values exceeds, in a series of `count` values.
/// `None` if no level is provably beyond.
fn interval(levels: &[Level], count: f64, fraction: f64) -> Option<(u64, u64)> {
    let tail = (1.0 - CONFIDENCE) / 2.0;
    let effective = |level: &Level| (level.above / level.effect, count / level.effect);
    let low = first(levels, |level| {
        let (above, of) = effective(level);
        above == 0.0 || at_least(above, of, fraction) > tail
    })?;
    let high = first(levels, |level| {
        let (above, of) = effective(level);
        1.0 - at_least(above + 1.0, of, fraction) <= tail
    })?;
    Some((low, high))
}

/// The first level (ns) from which on `holds`.
fn first(levels: &[Level], holds: impl Fn(&Level) -> bool) -> Option<u64> {
    let first = levels.partition_point(|level| !holds(level));
    levels.get(first).map(|level| level.edge_ns)
}

/// The probability of at least `above` successes in `of` trials of probability `fraction`; `above` and `of` need not be whole.
fn at_least(above: f64, of: f64, fraction: f64) -> f64 {
    let fails = of - above + 1.0;
    if fails <= 0.0 {
        0.0
    } else {
        beta_reg(above, fails, fraction)
    }
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use libm::{erfc, exp, log, sqrt};
    use rand_core::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    /// A number between zero and one.
    fn uniform(chance: &mut Pcg64) -> f64 {
        (chance.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number of the standard normal distribution (Box and Muller).
    fn normal(chance: &mut Pcg64) -> f64 {
        let (a, b) = (uniform(chance).max(1e-300), uniform(chance));
        sqrt(-2.0 * log(a)) * libm::cos(std::f64::consts::TAU * b)
    }

    /// A machine that is quiet or busy for stretches, whose latencies are correlated, and that stalls now and then.
    struct Machine {
        /// Correlation of the logarithms of successive values.
        correlation: f64,
        /// Mean length of a quiet and of a busy stretch (ticks).
        stretches: [f64; 2],
        /// Factor of the values in a busy stretch.
        busy: f64,
    }

    impl Machine {
        fn series(&self, chance: &mut Pcg64, count: u64) -> Series {
            let mut series = Series::new(count);
            let mut state = usize::from(
                uniform(chance) * (self.stretches[0] + self.stretches[1]) > self.stretches[0],
            );
            let mut noise = normal(chance);
            for k in 0..count {
                let fresh = sqrt(1.0 - self.correlation * self.correlation) * normal(chance);
                noise = self.correlation * noise + fresh;
                let factor = if state == 1 { self.busy } else { 1.0 };
                series.record(k, (1e4 * factor * exp(0.5 * noise)) as u64);
                if uniform(chance) * self.stretches[state] < 1.0 {
                    state = 1 - state;
                }
            }
            series
        }

        /// The percentile of an endless series (s), by bisection.
        fn truth(&self, percent: f64) -> f64 {
            let busy = self.stretches[1] / (self.stretches[0] + self.stretches[1]);
            let above = |value: f64, factor: f64| {
                0.5 * erfc(log(value / (1e4 * factor)) / 0.5 / std::f64::consts::SQRT_2)
            };
            let (mut low, mut high) = (1.0, 1e9);
            for _ in 0..200 {
                let middle = 0.5 * (low + high);
                let fraction = (1.0 - busy) * above(middle, 1.0) + busy * above(middle, self.busy);
                if fraction > 1.0 - percent / 100.0 {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            low * 1e-9
        }
    }

    /// Of a thousand correlated series, the stated fraction of intervals contains the percentile. The bound is three standard
    /// deviations of such a count below the stated fraction.
    #[test]
    fn intervals_cover_their_stated_fraction_of_a_thousand_correlated_series() {
        const SERIES: u64 = 1000;
        let machines = [
            (
                "independent",
                Machine {
                    correlation: 0.0,
                    stretches: [1e3, 1e3],
                    busy: 1.0,
                },
            ),
            (
                "correlated",
                Machine {
                    correlation: 0.95,
                    stretches: [1e3, 1e3],
                    busy: 1.0,
                },
            ),
            (
                "busy stretches",
                Machine {
                    correlation: 0.5,
                    stretches: [400.0, 40.0],
                    busy: 5.0,
                },
            ),
        ];
        for (name, machine) in machines {
            let mut chance = Pcg64::seed_from_u64(44);
            let truths = PERCENTILES.map(|percent| machine.truth(percent));
            let mut covered = [0_u64; PERCENTILES.len()];
            let mut stated = [0_u64; PERCENTILES.len()];
            for _ in 0..SERIES {
                let series = machine.series(&mut chance, 20_000);
                for (index, found) in series.percentiles().iter().enumerate() {
                    stated[index] += 1;
                    // An interval of the histogram is known to one part in a thousand.
                    let inside = 0.999 * found.low <= truths[index] && truths[index] <= found.high;
                    covered[index] += u64::from(inside);
                }
            }
            println!("{name}: {covered:?} of {stated:?}");
            for (index, (&covered, &stated)) in covered.iter().zip(&stated).enumerate() {
                let least = CONFIDENCE
                    - 3.0 * (CONFIDENCE * (1.0 - CONFIDENCE) / stated.max(1) as f64).sqrt();
                let of = PERCENTILES[index];
                assert!(
                    stated == 0 || covered as f64 >= least * stated as f64,
                    "{name}, {of} %: {covered} of {stated}"
                );
            }
            assert_eq!(stated[..3], [SERIES; 3], "{name}");
            assert_eq!(stated[5], 0, "{name}: 20,000 values cannot tell 99.999 %");
        }
    }

    #[test]
    fn the_last_percentile_takes_three_hundred_thousand_values() {
        let mut chance = Pcg64::seed_from_u64(7);
        for (count, stated) in [(299_000, 5), (300_000, 6)] {
            let mut series = Series::new(count);
            for k in 0..count {
                series.record(k, 1_000_000 + (1e6 * uniform(&mut chance)) as u64);
            }
            assert_eq!(series.percentiles().len(), stated, "{count}");
        }
    }

    #[test]
    fn a_stall_is_one_event_and_not_evidence_of_many() {
        let mut chance = Pcg64::seed_from_u64(3);
        let mut series = Series::new(300_000);
        for k in 0..300_000_u64 {
            // 50 deadlines pass while the loop stands still.
            let late = if (1_000..1_050).contains(&k) {
                1_000_000 * (1_050 - k)
            } else {
                0
            };
            series.record(k, late + 1_000 + (1e3 * uniform(&mut chance)) as u64);
        }
        assert_eq!(
            (series.max().1 * 1e9).round(),
            1_000.0,
            "the first deadline of the stall is the latest"
        );
        let last = series.percentiles().last().map(|found| found.percent);
        assert!(
            last < Some(99.999),
            "one stall does not tell how often stalls come: {last:?}"
        );
    }

    #[test]
    fn an_empty_and_a_constant_series_have_no_false_precision() {
        let empty = Series::new(1000);
        assert!(empty.percentiles().is_empty());
        assert_eq!(
            (empty.mean(), empty.min(), empty.max()),
            (0.0, 0.0, (0.0, 0.0))
        );
        let mut constant = Series::new(1000);
        for k in 0..1000 {
            constant.record(k, 5_000);
        }
        let found = constant.percentiles();
        assert_eq!(found.len(), 3, "{found:?}");
        assert!(
            found.iter().all(|p| [p.value, p.low, p.high] == [5e-6; 3]),
            "{found:?}"
        );
    }
}
