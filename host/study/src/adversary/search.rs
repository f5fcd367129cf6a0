//! The search: sweep frequencies, draw, evolve and refine, within a budget of ticks.

use super::mechanism::{Mechanism, Outcome, Rendering};
use super::shapes::{Family, GENES, Limits, Shape};
use rand_core::Rng;
use rand_pcg::Pcg64;

/// The stream of the random generator: no other part of the program draws from it.
const STREAM: u128 = 0x6164_7665_7273;
/// Number of the best motions of each family that are kept and varied, so that families do not crowd each other out.
const ELITE: usize = 3;
/// Energies below this one (J) are rounding.
const FLOOR: f64 = 1e-12;

/// The goal of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Any motion that gets more than this energy (J): the search ends with the first.
    MoreThan(f64),
    /// The motion that gets the most energy.
    Most,
}

/// A search for the motion of a hand that gets the most energy; the module [`crate::adversary`] has an example.
#[derive(Clone, Debug)]
pub struct Adversary {
    /// The device between controller and hand.
    pub port: Mechanism,
    /// Limits of the motions.
    pub limits: Limits,
    /// Number of the controller's ticks that the search may spend.
    pub budget: u64,
    /// The seed, which fixes every random choice.
    pub seed: u64,
}

/// The result of a search.
#[derive(Clone, Debug)]
pub struct Found {
    /// The outcome of the best motion.
    pub outcome: Outcome,
    /// The best motion (m, one sample a tick), up to the maximum of its energy.
    pub motion: Vec<f64>,
    /// The family of the best motion.
    pub family: Family,
    /// The best motion as the start of another search, such as on a softer wall.
    pub start: Start,
    /// Number of ticks spent.
    pub spent: u64,
}

/// A motion that a search starts from.
#[derive(Clone, Debug, Default)]
pub struct Start {
    shape: Option<Shape>,
    motion: Vec<f64>,
}

impl From<Vec<f64>> for Start {
    /// A start from bare samples (m, one a tick).
    fn from(motion: Vec<f64>) -> Self {
        Self {
            shape: None,
            motion,
        }
    }
}

#[derive(Clone)]
struct Candidate {
    start: Start,
    outcome: Outcome,
    score: f64,
}

impl Candidate {
    fn family(&self) -> Family {
        self.start.family()
    }
}

impl Start {
    fn family(&self) -> Family {
        self.shape.map_or(Family::Samples, |shape| shape.family)
    }
}

struct Run<'a, R> {
    adversary: &'a Adversary,
    rendering: &'a mut R,
    goal: Goal,
    random: Pcg64,
    spent: u64,
    /// The best candidates, best first.
    elite: Vec<Candidate>,
}

impl Adversary {
    /// Searches, starting from the motions of `first`.
    pub fn search(&self, rendering: &mut impl Rendering, goal: Goal, first: &[Start]) -> Found {
        let mut run = Run {
            adversary: self,
            rendering,
            goal,
            random: Pcg64::new(u128::from(self.seed), STREAM),
            spent: 0,
            elite: Vec::new(),
        };
        run.all(first);
        let spent = run.spent;
        let (start, outcome) = run
            .elite
            .into_iter()
            .next()
            .map_or_else(Default::default, |best| (best.start, best.outcome));
        let mut motion = start.motion.clone();
        if outcome.energy > 0.0 {
            motion.truncate(outcome.at);
        }
        Found {
            outcome,
            motion,
            family: start.family(),
            start,
            spent,
        }
    }
}

impl<R: Rendering> Run<'_, R> {
    fn all(&mut self, first: &[Start]) {
        let budget = self.adversary.budget;
        for start in first {
            match start.shape {
                Some(shape) => self.try_shape(shape),
                None => self.try_motion(start.clone()),
            };
        }
        for shape in Shape::sweep(&self.adversary.limits) {
            if self.spent >= budget / 3 || self.done() {
                break;
            }
            self.try_shape(shape);
        }
        let begun = self.spent;
        while self.spent < begun + budget / 5 && !self.done() {
            for family in Family::DRAWN {
                if family == Family::Edges && self.adversary.limits.count == 0.0 {
                    continue;
                }
                let mut genes = [0.0; GENES];
                for gene in &mut genes {
                    *gene = self.uniform();
                }
                self.try_shape(Shape { family, genes });
            }
        }
        while self.spent < budget * 3 / 4 && !self.done() {
            self.vary_shape();
        }
        let mut reach = 0.3;
        while self.spent < budget && !self.done() {
            // The size of the changes grows with success and shrinks without.
            reach = if self.vary_samples(reach) {
                f64::min(reach * 1.5, 0.5)
            } else {
                f64::max(reach * 0.95, 1e-3)
            };
        }
    }

    fn done(&self) -> bool {
        match self.goal {
            Goal::Most => false,
            Goal::MoreThan(energy) => {
                let best = self.elite.first();
                best.is_some_and(|best| best.outcome.energy > energy.max(FLOOR))
            }
        }
    }

    /// A uniform draw from zero to one.
    fn uniform(&mut self) -> f64 {
        (self.random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A draw about zero, mostly within one: the sum of three uniform draws.
    fn bell(&mut self) -> f64 {
        (0..3).map(|_| 2.0 * self.uniform() - 1.0).sum::<f64>() / 1.5
    }

    fn pick(&mut self, count: usize) -> usize {
        // Better candidates are more likely.
        let u = self.uniform();
        ((u * u * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// Plays a motion. Returns whether it is the best so far.
    fn try_motion(&mut self, mut start: Start) -> bool {
        self.adversary.limits.bend(&mut start.motion);
        self.spent += start.motion.len() as u64 + 1;
        let outcome = self.adversary.port.play(self.rendering, &start.motion);
        // The energy counts once it is positive. Until then, the score is how near it is.
        let score = match self.goal {
            Goal::Most if outcome.energy > FLOOR => 1e3 + outcome.energy,
            _ => outcome.fraction,
        };
        let at = self.elite.partition_point(|other| other.score >= score);
        let family = start.family();
        let kin = |other: &&Candidate| other.family() == family;
        if self.elite[..at].iter().filter(kin).count() < ELITE {
            let candidate = Candidate {
                start,
                outcome,
                score,
            };
            self.elite.insert(at, candidate);
            if self.elite.iter().filter(kin).count() > ELITE
                && let Some(worst) = self.elite.iter().rposition(|other| kin(&other))
            {
                self.elite.remove(worst);
            }
        }
        at == 0
    }

    fn try_shape(&mut self, shape: Shape) -> bool {
        let motion = shape.samples(&self.adversary.limits);
        self.try_motion(Start {
            shape: Some(shape),
            motion,
        })
    }

    /// Varies one of the best shapes slightly.
    fn vary_shape(&mut self) {
        let at = self.pick(self.elite.len());
        let Some(mut shape) = self.elite.get(at).and_then(|one| one.start.shape) else {
            // Bare samples have no parameters to vary.
            self.vary_samples(0.3);
            return;
        };
        let reach = [0.03, 0.1, 0.01, 0.3][self.pick(4)];
        for gene in 0..shape.family.genes() {
            if self.uniform() < 0.4 {
                let by = reach * self.bell();
                shape.genes[gene] = (shape.genes[gene] + by).clamp(0.0, 1.0);
            }
        }
        self.try_shape(shape);
    }

    /// Varies the samples of one of the best motions: bends a stretch, passes through it faster or slower, or repeats
    /// it. Returns whether the result is the best so far.
    fn vary_samples(&mut self, reach: f64) -> bool {
        let at = self.pick(self.elite.len());
        let Some(mut motion) = self.elite.get(at).map(|one| one.start.motion.clone()) else {
            return false;
        };
        if motion.is_empty() {
            return false;
        }
        let length = motion.len();
        let from = (self.uniform() * length as f64) as usize;
        let span = libm::exp(self.uniform() * libm::log(length as f64)) as usize;
        let to = (from + span.max(1)).min(length);
        let change = self.uniform();
        if change < 0.6 {
            let deep = motion.iter().fold(0.0, |deep, x| f64::max(deep, x.abs()));
            let by = reach * self.bell() * deep;
            let middle = 0.5 * (to - from) as f64;
            let flat = self.uniform() < 0.5;
            for (k, sample) in motion[from..to].iter_mut().enumerate() {
                let off = ((k as f64 + 0.5 - middle) / middle).abs();
                *sample += by * if flat { 1.0 } else { 1.0 - off };
            }
        } else if change < 0.85 {
            let kept = ((to - from) as f64 * libm::exp(2.0 * reach * self.bell())).round() as usize;
            let stretch: Vec<f64> = (0..kept)
                .map(|k| motion[from + k * (to - from) / kept.max(1)])
                .collect();
            motion.splice(from..to, stretch);
        } else {
            let stretch = motion[from..to].to_vec();
            motion.splice(to..to, stretch);
        }
        self.try_motion(motion.into())
    }
}
