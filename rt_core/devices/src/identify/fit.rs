//! The fit of mass, damping and friction to a record of positions and forces.
//!
//! Within a swing the velocity keeps its sign `s`, and the balance of forces `m a = F - b v - s f + g` is integrated
//! twice from the swing's start:
//!
//! ```text
//! x(t) = x0 + v0 t + (1/m) IIF - (b/m) Ix - s (f/m) t^2/2 + (g/m) t^2/2
//! ```
//!
//! The equation is linear in 1/m, b/m, f/m and g/m, and contains no derivative of the counted positions: the
//! integral-equation method of continuous-time identification (Whitfield and Messali, Int. J. Control 1987), a relative
//! of Shinbrot's modulating functions (1957; Preisig and Rippin 1993). `x0` and `v0` are free in each swing. The error
//! of a counted position is nearly white if the handle moves, so ordinary least squares is close to the best estimate.
//! The held force is a staircase, so `IIF` is exact. Swings leave out the reversals, so the time of a reversal and
//! sticking do not matter. A spring term `-(k/m) IIx` in a second fit tells whether a hand holds the handle.
//!
//! The intervals are those of the jackknife over ten groups of swings (Efron and Stein, Ann. Statist. 1981), with
//! Student's distribution.

use super::{AxisIdentified, Estimate, Identified, IdentifyError};
use nalgebra::{SMatrix, SVector};

/// One tick of a record.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Position along the axis, from the start (m); not a number if no reading arrived.
    pub(super) offset: f64,
    /// The force that was written in this tick (N).
    pub(super) force: f64,
}

/// Half of the span over which the direction of the motion is judged (s).
const HALF_SPAN: f64 = 0.005;
/// Counts over that span from which on the handle moves.
const MOVING_COUNTS: f64 = 3.5;
/// Shortest swing (s).
const SHORTEST: f64 = 0.03;
/// Counts that the motion must span.
const NEEDED_COUNTS: f64 = 20.0;
/// Number of groups of the jackknife, and Student's 97.5 % point for one degree of freedom fewer.
const GROUPS: usize = 10;
const STUDENT: f64 = 2.262;
/// Swings that the fit needs.
const NEEDED_SWINGS: usize = 2 * GROUPS;
/// Longest delay that is tried (periods).
const LONGEST_DELAY: u32 = 5;
/// Steps of the delay about the best whole number of periods (periods).
const DELAY_STEP: f64 = 0.05;
/// Number of such steps on either side: less than a period.
const DELAY_STEPS: i32 = 19;
/// Number of columns without and with the spring.
const FREE: usize = 4;
const HELD: usize = 5;
/// A spring that makes up this fraction of the forces is a hand.
const HELD_FRACTION: f64 = 0.1;
/// A residual beyond these counts and this fraction of the motion is a disturbance.
const DISTURBED: (f64, f64) = (3.0, 0.05);

/// Sums of a least-squares problem of five columns, with the target as the sixth.
#[derive(Clone, Copy)]
struct Sums {
    products: [[f64; 6]; 6],
    rows: f64,
}

impl Sums {
    const ZERO: Self = Self {
        products: [[0.0; 6]; 6],
        rows: 0.0,
    };

    fn plus(mut self, other: &Self, sign: f64) -> Self {
        for (row, other) in self.products.iter_mut().zip(&other.products) {
            for (sum, other) in row.iter_mut().zip(other) {
                *sum += sign * other;
            }
        }
        self.rows += sign * other.rows;
        self
    }

    /// The least-squares solution with the first `N` columns, and the sum of squares that remains.
    fn solve<const N: usize>(&self) -> Option<([f64; N], f64)> {
        let scale = |i: usize| self.products[i][i].sqrt();
        let matrix =
            SMatrix::<f64, N, N>::from_fn(|i, j| self.products[i][j] / (scale(i) * scale(j)));
        let target = SVector::<f64, N>::from_fn(|i, _| self.products[i][5] / scale(i));
        let scaled = matrix.cholesky()?.solve(&target);
        let remains = self.products[5][5] - scaled.dot(&target);
        let values = core::array::from_fn(|i| scaled[i] / scale(i));
        let sound = values.iter().all(|value: &f64| value.is_finite());
        sound.then_some((values, remains.max(0.0)))
    }
}

/// Mass, damping, friction and constant force of a solution.
fn mechanics(sums: &Sums) -> Option<[f64; 4]> {
    let (values, _) = sums.solve::<FREE>()?;
    let mass = 1.0 / values[0];
    (mass.is_finite() && mass > 0.0).then(|| {
        let [b, f, g] = [1, 2, 3].map(|i| values[i] * mass);
        [mass, b, f, g]
    })
}

/// Identifies a device from the records of its axes (by number), which were written every `period` (s) with forces of
/// at most `most_force` (N).
pub(super) fn identify(
    records: &[(usize, &[Sample])],
    period: f64,
    most_force: f64,
) -> Result<Identified, IdentifyError> {
    let steps = records.iter().map(|(_, samples)| smallest_change(samples));
    let step = steps.fold(f64::INFINITY, f64::min);
    let mut swings = Vec::new();
    for &(axis, samples) in records {
        let span = span_of(samples);
        let needed = NEEDED_COUNTS * step;
        if !(span >= needed && span.is_finite()) {
            return Err(IdentifyError::TooLittleMotion {
                axis,
                moved: span,
                needed: if needed.is_finite() { needed } else { 1e-3 },
                force: most_force,
            });
        }
        let found = swings_of(samples, step, period);
        if found.len() < NEEDED_SWINGS {
            return Err(IdentifyError::TooFewSwings {
                axis,
                found: found.len(),
                needed: NEEDED_SWINGS,
            });
        }
        swings.push(found);
    }
    let sums_at = |delay: f64| -> Vec<Vec<Sums>> {
        let axes = records.iter().zip(&swings);
        axes.map(|((_, samples), swings)| {
            let swings = swings.iter();
            swings
                .map(|swing| sums_of(samples, swing, period, delay))
                .collect()
        })
        .collect()
    };
    let remains = |axes: &[Vec<Sums>]| -> f64 {
        let axes = axes.iter().map(|swings| total(swings).solve::<FREE>());
        axes.map(|solved| solved.map_or(f64::INFINITY, |(_, remains)| remains))
            .sum()
    };
    let at = |delay: f64| remains(&sums_at(delay));
    let least_of = |delays: &mut dyn Iterator<Item = f64>| {
        let tried = delays.map(|delay| (delay, at(delay)));
        let least = tried.min_by(|a, b| a.1.total_cmp(&b.1));
        least.unwrap_or((0.0, f64::INFINITY))
    };
    let longest = f64::from(LONGEST_DELAY);
    let (whole, _) = least_of(&mut (0..=LONGEST_DELAY).map(f64::from));
    let steps = (-DELAY_STEPS..=DELAY_STEPS).map(|step| whole + DELAY_STEP * f64::from(step));
    let (delay, least) = least_of(&mut steps.filter(|delay| (0.0..=longest).contains(delay)));
    let beside = [delay - 1.0, delay + 1.0].map(|other| {
        let tried = (0.0..=longest).contains(&other);
        if tried { at(other) } else { f64::INFINITY }
    });
    let sums = sums_at(delay);
    let mut axes = Vec::new();
    for (&(axis, samples), sums) in records.iter().zip(&sums) {
        axes.push(identify_axis(axis, samples, sums, step)?);
    }
    let over = |of: fn(&AxisIdentified) -> Estimate| {
        let estimates: Vec<Estimate> = axes.iter().map(of).collect();
        combined(&estimates).not_negative()
    };
    Ok(Identified {
        mass: over(|axis| axis.mass),
        damping: over(|axis| axis.damping),
        friction: over(|axis| axis.friction),
        position_step: step,
        // The record does not tell the delay if another delay, a period away, fits hardly worse.
        delay_periods: (least < 0.9 * beside[0].min(beside[1])).then_some(delay),
        period,
        axes,
    })
}

fn identify_axis(
    axis: usize,
    samples: &[Sample],
    sums: &[Sums],
    step: f64,
) -> Result<AxisIdentified, IdentifyError> {
    let few = IdentifyError::TooFewSwings {
        axis,
        found: sums.len(),
        needed: NEEDED_SWINGS,
    };
    let whole = total(sums);
    let (_, remains) = whole.solve::<FREE>().ok_or(few)?;
    let held = whole.solve::<HELD>().ok_or(few)?.0;
    let size = |of: fn(&Sample) -> f64| {
        let squares = samples.iter().map(of).filter(|value| value.is_finite());
        squares.map(|value| value * value).sum::<f64>().sqrt()
    };
    let stiffness = held[4] / held[0];
    let pull = stiffness.abs() * size(|sample| sample.offset);
    if !pull.is_finite() || pull > HELD_FRACTION * size(|sample| sample.force) {
        return Err(IdentifyError::Held { axis, stiffness });
    }
    let residual = (remains / whole.rows).sqrt();
    let motion = (whole.products[5][5] / whole.rows).sqrt();
    if residual > DISTURBED.0 * step && residual > DISTURBED.1 * motion {
        return Err(IdentifyError::Disturbed { axis, residual });
    }
    let value = mechanics(&whole).ok_or(IdentifyError::Disturbed { axis, residual })?;
    // Neighbouring swings share a group, so that slow variations show as scatter.
    let mut squares = [0.0; 4];
    for group in 0..GROUPS {
        let range = group * sums.len() / GROUPS..(group + 1) * sums.len() / GROUPS;
        let without = whole.plus(&total(&sums[range]), -1.0);
        let other = mechanics(&without).ok_or(few)?;
        for (square, (a, b)) in squares.iter_mut().zip(other.iter().zip(&value)) {
            *square += (a - b) * (a - b);
        }
    }
    let estimate = |i: usize| {
        let error = (squares[i] * (GROUPS as f64 - 1.0) / GROUPS as f64).sqrt();
        Estimate {
            value: value[i],
            low: value[i] - STUDENT * error,
            high: value[i] + STUDENT * error,
        }
    };
    Ok(AxisIdentified {
        axis,
        mass: estimate(0),
        damping: estimate(1),
        friction: estimate(2),
        bias: value[3],
        swings: sums.len(),
        residual,
    })
}

/// The mean of estimates of one number along several axes. The interval is as wide as those of the axes are in the mean,
/// because the axes may share their errors. It is widened to contain the value of an axis whose own interval lies
/// outside: such axes differ.
fn combined(axes: &[Estimate]) -> Estimate {
    let n = axes.len().max(1) as f64;
    let value = axes.iter().map(|axis| axis.value).sum::<f64>() / n;
    let error = axes
        .iter()
        .map(|axis| 0.5 * (axis.high - axis.low))
        .sum::<f64>()
        / n;
    let mut all = Estimate {
        value,
        low: value - error,
        high: value + error,
    };
    for axis in axes {
        if axis.low > value + error || axis.high < value - error {
            all.low = all.low.min(axis.value);
            all.high = all.high.max(axis.value);
        }
    }
    all
}

fn total(sums: &[Sums]) -> Sums {
    sums.iter().fold(Sums::ZERO, |all, one| all.plus(one, 1.0))
}

/// The smallest change between two readings (m); infinite if nothing changed.
fn smallest_change(samples: &[Sample]) -> f64 {
    let changes = samples
        .windows(2)
        .map(|pair| (pair[1].offset - pair[0].offset).abs());
    // Rounding of positions below a metre is below 1e-12 m.
    changes
        .filter(|change| *change > 1e-12)
        .fold(f64::INFINITY, f64::min)
}

/// The span of the positions (m).
fn span_of(samples: &[Sample]) -> f64 {
    let offsets = || samples.iter().map(|sample| sample.offset);
    offsets().fold(f64::NEG_INFINITY, f64::max) - offsets().fold(f64::INFINITY, f64::min)
}

/// A part of the record in which the handle moves in one direction.
struct Swing {
    from: usize,
    to: usize,
    sign: f64,
}

/// The swings of a record whose positions have counts of `step`.
fn swings_of(samples: &[Sample], step: f64, period: f64) -> Vec<Swing> {
    let ticks = |time: f64| ((time / period).round() as usize).max(1);
    let (half_span, shortest) = (ticks(HALF_SPAN), ticks(SHORTEST));
    // A position that is missing stays at the last one, so that a lost reading does not cut a swing.
    let mut last = f64::NAN;
    let held = samples.iter().map(|sample| {
        if sample.offset.is_finite() {
            last = sample.offset;
        }
        last
    });
    let held: Vec<f64> = held.collect();
    let direction = |i: usize| -> f64 {
        let ends = i
            .checked_sub(half_span)
            .and_then(|from| Some((held.get(from)?, held.get(i + half_span)?)));
        let moved = ends.map_or(0.0, |(from, to)| (to - from) / step);
        if moved.abs() >= MOVING_COUNTS {
            moved.signum()
        } else {
            0.0
        }
    };
    let mut swings = Vec::new();
    let mut i = 0;
    while i < samples.len() {
        let sign = direction(i);
        let mut end = i + 1;
        while end < samples.len() && direction(end) == sign {
            end += 1;
        }
        // The integrals start at a reading.
        let missing = samples[i..end].iter();
        let from = i + missing.take_while(|sample| sample.offset.is_nan()).count();
        if sign != 0.0 && end - from >= shortest {
            swings.push(Swing {
                from,
                to: end,
                sign,
            });
        }
        i = end;
    }
    swings
}

/// The sums of one swing, with its start and its speed at the start eliminated. A force acts `delay` periods after its
/// write; the delay need not be whole, because the device holds the force before until then.
fn sums_of(samples: &[Sample], swing: &Swing, period: f64, delay: f64) -> Sums {
    let whole = delay.floor();
    // The part of a period for which the force before still acts.
    let part = delay - whole;
    let force = |i: usize, older: usize| {
        let written = i.checked_sub(whole as usize + older);
        let written = written.and_then(|i| samples.get(i));
        written.map_or(0.0, |sample| sample.force)
    };
    let mut rows = Vec::with_capacity(swing.to - swing.from);
    // Integrals from the swing's start: of the force, once and twice, and of the position.
    let (mut force_1, mut force_2, mut offset_1, mut offset_2) = (0.0, 0.0, 0.0, 0.0);
    let mut last = samples[swing.from].offset;
    for i in swing.from..swing.to {
        let offset = samples[i].offset;
        if i > swing.from {
            for (held, time) in [
                (force(i - 1, 1), part * period),
                (force(i - 1, 0), (1.0 - part) * period),
            ] {
                force_2 += time * (force_1 + 0.5 * time * held);
                force_1 += time * held;
            }
            let now = if offset.is_finite() { offset } else { last };
            let mean = 0.5 * (last + now);
            offset_2 += period * (offset_1 + 0.5 * period * mean);
            offset_1 += period * mean;
            last = now;
        }
        let t = (i - swing.from) as f64 * period;
        if offset.is_finite() {
            let half_square = 0.5 * t * t;
            let columns = [
                force_2,
                -offset_1,
                -swing.sign * half_square,
                half_square,
                -offset_2,
                offset,
            ];
            rows.push((t, columns));
        }
    }
    without_lines(&mut rows);
    let mut sums = Sums::ZERO;
    for (_, columns) in &rows {
        for (sums, a) in sums.products.iter_mut().zip(columns) {
            for (sum, b) in sums.iter_mut().zip(columns) {
                *sum += a * b;
            }
        }
    }
    // Two degrees of freedom went to the start and its speed.
    sums.rows = (rows.len() as f64 - 2.0).max(0.0);
    sums
}

/// Takes from each column its best straight line over the time.
fn without_lines(rows: &mut [(f64, [f64; 6])]) {
    let n = rows.len().max(1) as f64;
    let middle = rows.iter().map(|(t, _)| t).sum::<f64>() / n;
    let spread: f64 = rows.iter().map(|(t, _)| (t - middle) * (t - middle)).sum();
    for column in 0..6 {
        let mean = rows.iter().map(|(_, row)| row[column]).sum::<f64>() / n;
        let slope = rows
            .iter()
            .map(|(t, row)| (t - middle) * row[column])
            .sum::<f64>()
            / spread.max(f64::MIN_POSITIVE);
        for (t, row) in rows.iter_mut() {
            row[column] -= mean + slope * (*t - middle);
        }
    }
}

#[cfg(test)]
mod tests;
