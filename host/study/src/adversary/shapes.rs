//! Families of motions, each described by a few numbers from zero to one that can be drawn and varied.
//!
//! Depth counts towards negative positions: a wall begins at zero and pushes towards positive positions.

use core::f64::consts::{PI, TAU};

/// Limits of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The tick's period (s).
    pub period: f64,
    /// Largest depth (m).
    pub deepest: f64,
    /// Fastest speed (m/s).
    pub speed: f64,
    /// Largest acceleration (m/s^2); infinite for a hand without that limit.
    pub acceleration: f64,
    /// Largest number of samples.
    pub longest: usize,
    /// Encoder count (m); zero if there are no counts.
    pub count: f64,
}

impl Limits {
    /// The longest step between samples (m).
    pub fn step(&self) -> f64 {
        self.speed * self.period
    }

    /// Bends a motion to keep the limits. Up to a hundredth of the depth may be outside the wall.
    pub(super) fn bend(&self, motion: &mut Vec<f64>) {
        motion.truncate(self.longest);
        let (step, surge) = (self.step(), self.acceleration * self.period * self.period);
        let (mut last, mut last_by) = (0.0, 0.0);
        for position in motion {
            let wanted = position.clamp(-self.deepest, 0.01 * self.deepest) - last;
            // The step is small enough for the motion to stop within the remaining distance.
            let fastest = step.min(libm::sqrt(2.0 * surge * wanted.abs()));
            let by = wanted.clamp(-fastest, fastest);
            last_by = by.clamp(last_by - surge, last_by + surge);
            last += last_by;
            *position = last;
        }
    }
}

/// The families of motions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Sinusoids about a depth, with slow ramps in and out.
    Sines,
    /// As [`Family::Sines`], with a period that changes.
    Chirps,
    /// A short cycle of steps about a depth, repeated.
    Steps,
    /// In, wait, out, wait: slow in and fast out, taps that leave the wall, strokes inside it.
    Strokes,
    /// In and out from edge to edge of encoder counts, so that the shown position lags on the path in and leads on the
    /// path out.
    Edges,
    /// Motions from outside, or bare samples after refinement.
    Samples,
}

impl Family {
    /// The families that the search draws from.
    pub(super) const DRAWN: [Self; 5] = [
        Self::Sines,
        Self::Strokes,
        Self::Edges,
        Self::Steps,
        Self::Chirps,
    ];

    /// Number of the parameters that the family uses.
    pub(super) fn genes(self) -> usize {
        match self {
            Self::Sines | Self::Edges => 6,
            Self::Chirps => 7,
            Self::Strokes => 9,
            Self::Steps | Self::Samples => GENES,
        }
    }

    /// The name of the family.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sines => "sines",
            Self::Chirps => "chirps",
            Self::Steps => "steps",
            Self::Strokes => "strokes",
            Self::Edges => "edges",
            Self::Samples => "samples",
        }
    }
}

/// Number of parameters of a motion.
pub(super) const GENES: usize = 12;

/// A motion of a family.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub(super) family: Family,
    /// The parameters, from zero to one.
    pub(super) genes: [f64; GENES],
}

/// Interpolates from `low` to `high` in equal ratios.
fn between(low: f64, high: f64, gene: f64) -> f64 {
    low * libm::exp(gene * libm::log(high / low))
}

impl Shape {
    /// Sinusoids to start with: all frequencies, from strokes out of the wall to small motions deep inside it.
    pub(super) fn sweep(limits: &Limits) -> impl Iterator<Item = Self> {
        const FREQUENCIES: u32 = 24;
        let longest = f64::from(u32::try_from(limits.longest).unwrap_or(u32::MAX));
        // The whole depth, a third of it, a twentieth: see `about`.
        let amplitudes = [1.0, 0.77, 0.43];
        (0..FREQUENCIES).flat_map(move |k| {
            // Consecutive frequencies lie far apart: a small budget covers the whole range.
            let k = 7 * k % FREQUENCIES + 1;
            // Uniform in frequency up to half the rate. The period is expressed as a parameter, see `waves`.
            let period = 2.0 * f64::from(FREQUENCIES) / f64::from(k);
            let fraction = libm::log(period / 2.0) / libm::log(longest / 2.0);
            amplitudes.into_iter().map(move |amplitude| {
                let mut genes = [0.25; GENES];
                // Long motions, with long ramps in and out if they are deep.
                genes[0] = 0.4;
                genes[1] = if amplitude < 1.0 { 0.9 } else { 0.2 };
                (genes[2], genes[4]) = (1.0, amplitude);
                genes[3] = libm::sqrt(fraction.clamp(0.0, 1.0));
                Self {
                    family: Family::Sines,
                    genes,
                }
            })
        })
    }

    /// The samples of the motion (m), within the limits.
    pub(super) fn samples(&self, limits: &Limits) -> Vec<f64> {
        let mut motion = match self.family {
            Family::Sines | Family::Chirps => self.waves(limits),
            Family::Steps => self.steps(limits),
            Family::Edges if limits.count > 0.0 => self.edges(limits),
            _ => self.strokes(limits),
        };
        limits.bend(&mut motion);
        motion
    }

    fn length(&self, limits: &Limits) -> usize {
        // Long motions find more, and short motions are cheap: half of the motions are long.
        let longest = limits.longest as f64;
        between(
            (longest / 32.0).max(8.0),
            longest,
            self.genes[0].min(0.5) * 2.0,
        ) as usize
    }

    /// A smooth ramp in, `inner` of size one at the depth, and the same ramp out. The amplitude is at most `most` (m).
    /// The whole motion shrinks with the amplitude, because the energy lost on a ramp that is too long is not regained.
    fn about(&self, limits: &Limits, most: f64, inner: impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let deepest = between(0.02, 1.0, self.genes[2]) * limits.deepest;
        // At most half of the depth, so that the motion reaches the surface.
        let fraction = between(0.005, 1.0, self.genes[4]);
        let amplitude = most.min(deepest * fraction / (1.0 + fraction));
        let depth = amplitude / fraction;
        let length = self.length(limits);
        let ramp = (between(0.01, 0.33, self.genes[1]) * length as f64) as usize;
        let run = length - 2 * ramp;
        let rise = |k: usize| 0.5 * (1.0 - libm::cos(PI * (k + 1) as f64 / ramp as f64));
        let path_in = (0..ramp).map(|k| depth * rise(k));
        let inside = (0..run).map(|k| depth + amplitude * inner(k, run));
        let path_out = (0..ramp).map(|k| depth * (1.0 - rise(k)));
        path_in.chain(inside).chain(path_out).map(|x| -x).collect()
    }

    fn waves(&self, limits: &Limits) -> Vec<f64> {
        let longest = limits.longest as f64;
        // Squared: most motions are fast, since small differences matter there.
        let period = |gene: f64| between(2.0, longest, gene * gene);
        let first = period(self.genes[3]);
        let last = match self.family {
            Family::Chirps => period(self.genes[6]),
            _ => first,
        };
        let start = TAU * self.genes[5];
        // No faster than the limits allow; otherwise `bend` would deform the motion.
        let most = 0.49 * limits.step() / libm::sin(PI / first.min(last));
        self.about(limits, most, |k, run| {
            // An angular speed (rad per tick) that changes uniformly.
            let (from, to) = (TAU / first, TAU / last);
            let k = k as f64;
            let phase = start + from * k + 0.5 * (to - from) * k * k / run as f64;
            libm::sin(phase)
        })
    }

    fn steps(&self, limits: &Limits) -> Vec<f64> {
        let levels = &self.genes[5..];
        let count = 2 + (self.genes[3] * (levels.len() - 1) as f64) as usize;
        self.about(limits, 0.5 * limits.step(), |k, _| {
            2.0 * levels[k % count.min(levels.len())] - 1.0
        })
    }

    fn strokes(&self, limits: &Limits) -> Vec<f64> {
        let length = self.length(limits);
        let ticks = |gene: f64| between(1.0, length as f64, gene) as usize;
        let dwell = |gene: f64| ticks(gene) - 1;
        let depth = between(0.005, 1.0, self.genes[2]) * limits.deepest;
        // Mostly out to the surface, or a little beyond.
        let back = match self.genes[8] {
            part if part < 0.3 => part / 0.3 * 0.95,
            part if part < 0.7 => 0.0,
            part => -0.03 * (part - 0.7),
        } * depth;
        let (path_in, inside) = (ticks(self.genes[3]), dwell(self.genes[4] * 0.9));
        let (path_out, outside) = (ticks(self.genes[5]), dwell(self.genes[6] * 0.9));
        let mut motion = Vec::with_capacity(length);
        let mut last = 0.0;
        while motion.len() < length {
            let lead = |motion: &mut Vec<f64>, last: &mut f64, to: f64, ticks: usize| {
                let from = *last;
                for k in 1..=ticks {
                    *last = from + (to - from) * k as f64 / ticks as f64;
                    motion.push(*last);
                }
            };
            lead(&mut motion, &mut last, -depth, path_in);
            lead(&mut motion, &mut last, -depth, inside);
            lead(&mut motion, &mut last, -back, path_out);
            lead(&mut motion, &mut last, -back, outside);
        }
        motion
    }

    /// Steps of whole counts. On the path in, every sample lies just before the next count shows; on the path out, just
    /// after it shows. Alternatively, most of the step is made at once and the rest slowly.
    fn edges(&self, limits: &Limits) -> Vec<f64> {
        let length = self.length(limits);
        let most = (limits.step() / limits.count).floor().max(1.0);
        let stride = between(1.0, most, self.genes[3]).round();
        let counts = between(2.0, (limits.deepest / limits.count).max(3.0), self.genes[2]);
        let strides = (counts / stride).floor().max(1.0) as usize;
        let creep = (2.0 * self.genes[4] - 1.0).max(0.0) * 0.99;
        let creeping = between(1.0, 40.0, self.genes[5]) as usize;
        let hair = 1e-3;
        let mut motion = Vec::with_capacity(length);
        let mut go = |from: f64, to: f64| {
            let displacement = to - from;
            if creep > 0.0 {
                let jump = from + displacement * (1.0 - creep / stride);
                for k in 0..creeping {
                    motion.push(jump + (to - jump) * k as f64 / creeping as f64);
                }
            }
            motion.push(to);
            motion.len() < length
        };
        loop {
            let mut at = 0.5 - hair;
            for _ in 0..strides {
                if !go(at, at + stride) {
                    break;
                }
                at += stride;
            }
            at += 2.0 * hair;
            let mut more = go(at - 2.0 * hair, at);
            for _ in 0..strides {
                more = more && go(at, at - stride);
                at -= stride;
            }
            if !more {
                break;
            }
        }
        for counts in &mut motion {
            *counts *= -limits.count;
        }
        motion
    }
}
