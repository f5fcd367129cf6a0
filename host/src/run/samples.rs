//! The samples of a run's plot, bounded however long the run is.
//!
//! Up to [`MOST`] samples all of them are kept. Then the time so far is divided into columns, about as narrow as the
//! pixels of the picture, and each column keeps its first and its last sample and those in which a component of a force or of a
//! position is least or greatest. The picture shows a fixed direction of each vector; a peak along any direction is a
//! peak of at least one component, up to a factor of the square root of three.

use rt_core::{Telemetry, Vec3};

/// Most samples that are kept: two minutes of ticks at 1 kHz.
const MOST: usize = 1 << 17;
/// Components of the force and the position of a device.
const COMPONENTS: usize = 6;

/// One sample for a plot.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sample {
    /// Time (s).
    pub time: f64,
    /// Force on the hand (N) and position of the proxy (m), by device.
    pub devices: Vec<(Vec3, Vec3)>,
}

impl Sample {
    /// The components of all forces and positions, in the same order for every sample.
    fn components(&self) -> impl Iterator<Item = f64> {
        let devices = self.devices.iter();
        devices.flat_map(|(force, position)| {
            [
                force.x, force.y, force.z, position.x, position.y, position.z,
            ]
        })
    }
}

/// Collects samples.
#[derive(Debug)]
pub(super) struct Samples {
    kept: Vec<Sample>,
    most: usize,
}

impl Default for Samples {
    fn default() -> Self {
        Self {
            kept: Vec::new(),
            most: MOST,
        }
    }
}

impl Samples {
    /// Takes the record of one tick. Ticks come in the order of time.
    pub(super) fn take(&mut self, telemetry: &Telemetry) {
        self.push(Sample {
            time: telemetry.time_ns as f64 * 1e-9,
            devices: telemetry
                .devices()
                .map(|d| (d.wrench.force, d.pose.position))
                .collect(),
        });
    }

    fn push(&mut self, sample: Sample) {
        self.kept.push(sample);
        if self.kept.len() >= self.most {
            self.thin();
        }
    }

    /// Keeps the extremes of each column, at most half of all samples.
    fn thin(&mut self) {
        let (Some(first), Some(last)) = (self.kept.first(), self.kept.last()) else {
            return;
        };
        let (from, span) = (first.time, last.time - first.time);
        let each = 2 + 2 * COMPONENTS * first.devices.len();
        let columns = (self.most / (2 * each)).max(1) as f64;
        // A run whose time stands still has one column.
        let column = |sample: &Sample| {
            let at = columns * (sample.time - from) / span.max(f64::MIN_POSITIVE);
            at.min(columns - 1.0) as usize
        };
        let mut kept = Vec::with_capacity(self.most);
        for samples in self.kept.chunk_by(|a, b| column(a) == column(b)) {
            kept.extend(
                extremes(samples)
                    .into_iter()
                    .filter_map(|at| samples.get(at).cloned()),
            );
        }
        self.kept = kept;
    }

    /// The samples, in the order of time.
    pub(super) fn finish(self) -> Vec<Sample> {
        self.kept
    }
}

/// The places of the first and the last sample and of the extremes of each component, in order.
fn extremes(samples: &[Sample]) -> Vec<usize> {
    let mut places = vec![0, samples.len().saturating_sub(1)];
    let Some(first) = samples.first() else {
        return Vec::new();
    };
    let mut range: Vec<_> = first.components().map(|x| ((0, x), (0, x))).collect();
    for (at, sample) in samples.iter().enumerate() {
        for ((least, greatest), x) in range.iter_mut().zip(sample.components()) {
            // What is not a number is replaced by the first number.
            if x < least.1 || least.1.is_nan() {
                *least = (at, x);
            }
            if x > greatest.1 || greatest.1.is_nan() {
                *greatest = (at, x);
            }
        }
    }
    places.extend(
        range
            .iter()
            .flat_map(|(least, greatest)| [least.0, greatest.0]),
    );
    places.sort_unstable();
    places.dedup();
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(time: f64, force: f64) -> Sample {
        let vectors = (Vec3::new(0.0, force, 0.0), Vec3::new(time, 0.0, 0.0));
        Sample {
            time,
            devices: vec![vectors, (Vec3::zeros(), Vec3::zeros())],
        }
    }

    fn of(ticks: usize, most: usize, force: impl Fn(usize) -> f64) -> Vec<Sample> {
        let mut samples = Samples {
            most,
            ..Samples::default()
        };
        let mut longest = 0;
        for tick in 0..ticks {
            samples.push(sample(tick as f64 * 1e-3, force(tick)));
            longest = longest.max(samples.kept.len());
        }
        assert!(longest <= most);
        samples.finish()
    }

    #[test]
    fn a_short_run_keeps_every_sample() {
        let kept = of(MOST - 1, MOST, |tick| tick as f64);
        assert_eq!(kept.len(), MOST - 1);
        assert!(
            kept.iter()
                .enumerate()
                .all(|(tick, s)| *s == sample(tick as f64 * 1e-3, tick as f64))
        );
    }

    /// However long a run is, each of its peaks is kept: here a tick in ten thousand, at places that no column begins with.
    #[test]
    fn a_long_run_is_bounded_and_loses_no_peak() {
        let (ticks, most) = (200_000, 4096);
        let peak = |tick: usize| match tick % 9973 {
            4321 => 5.0 + tick as f64,
            4322 => -5.0 - tick as f64,
            _ => (tick as f64 * 0.01).sin(),
        };
        let kept = of(ticks, most, peak);
        assert!(kept.is_sorted_by(|a, b| a.time < b.time));
        for tick in (0..ticks).filter(|tick| peak(*tick).abs() > 2.0) {
            assert!(
                kept.contains(&sample(tick as f64 * 1e-3, peak(tick))),
                "{tick}"
            );
        }
        // The first sample is kept, and no column is empty: the samples of the run's first part are as dense as the columns.
        assert_eq!(kept[0], sample(0.0, peak(0)));
        let widest = kept.windows(2).map(|pair| pair[1].time - pair[0].time);
        let column = ticks as f64 * 1e-3 / (most as f64 / 52.0);
        assert!(widest.fold(0.0, f64::max) < 2.0 * column);
    }

    #[test]
    fn a_column_without_numbers_keeps_a_sample_and_time_may_stand_still() {
        let kept = of(10_000, 256, |_| f64::NAN);
        assert!(kept.len() > 4 && kept.iter().all(|s| s.devices[0].0.y.is_nan()));
        let mut samples = Samples {
            most: 256,
            ..Samples::default()
        };
        for tick in 0..10_000 {
            samples.push(sample(1.0, f64::from(tick)));
        }
        assert!(samples.finish().len() <= 256);
    }
}
