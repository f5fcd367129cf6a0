//! The start of conjugate gradients: the velocity of the last step, extrapolated from its history.
//!
//! The last four velocities are kept as differences (the velocity, its change, the change of that change, ...), as in
//! polynomial extrapolation. The weight of each difference is not constant but fitted by least squares. Free nodes give
//! the weights that would have predicted the last step, and held nodes, whose motion is prescribed, give those for this
//! step. A smooth motion is thus followed closely. When a hand starts to move or stops, the fit finds no trend where
//! there is none. Extrapolation from earlier solutions with fitted factors is as old as time-dependent solvers (for
//! instance P. F. Fischer, "Projection techniques for iterative solution of A x = b with successive right-hand sides",
//! 1998, who fits the residual, at the cost of one product for each solution; this fit needs vectors alone).
//!
//! [`follow`] and [`extrapolate`] use AVX2 at most. With AVX-512 they take three times and twice as long, for the
//! reason given in `vectors`.

use super::options::Guess;
use super::{RUN, Stepper};
use crate::body::Body;
use crate::body::handle::HandlePose;
use crate::element::precision::Precision;
use crate::lanes::{Node, to_node};
use crate::team;
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// Number of differences. The first is the velocity itself.
const KEPT: usize = 4;

/// Number of products of pairs of differences.
const PAIRS: usize = KEPT * (KEPT + 1) / 2;

/// Nodes per sum in the vectors' own precision: few enough that single precision loses no more than [`CUT`].
const BLOCK: usize = 64;

/// Free nodes of a block that enter the fit. Their neighbours, the other nodes of the block, move alike.
const SAMPLE: usize = 16;

/// A difference is left out if at most this fraction of its square is independent of the lower differences.
const CUT: f64 = 1e-5;

/// Number of differences in the fit after a step that ran out of iterations. The residual of such a step dominates the
/// higher differences.
const AFTER_UNFINISHED: usize = 2;

/// A fit with a larger weight is no trend, because the rounding error of the guess would exceed the motion: a body that had
/// come to rest has begun to move, and the velocities before are the remainder of its rest.
const MOST: f64 = 1.0 / f64::EPSILON;

/// The largest weight for a sheet that tears and for a body that touches something. The jumps of a tear or a contact would alternate with larger weights from step to step.
const MOST_ROUGH: f64 = 1.5;

/// A node's velocity (m/s), its change in the last step, the change of that change, and so on.
pub(crate) type Differences<T> = [Node<T>; KEPT];

/// The data of a fit: products of the differences with each other, by rows of the lower triangle, and with the wanted
/// change of the velocity.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    pairs: [f64; PAIRS],
    wanted: [f64; KEPT],
}

/// The sums of a few nodes, by lane.
struct Lanes<T> {
    pairs: [Node<T>; PAIRS],
    wanted: [Node<T>; KEPT],
}

impl<T: Precision> Lanes<T> {
    const ZERO: Self = Self {
        pairs: [[T::ZERO; 4]; PAIRS],
        wanted: [[T::ZERO; 4]; KEPT],
    };

    #[inline(always)]
    fn add(&mut self, differences: &Differences<T>, wanted: &Node<T>) {
        let mut pair = 0;
        for row in 0..KEPT {
            for column in 0..=row {
                for i in 0..4 {
                    self.pairs[pair][i] += differences[row][i] * differences[column][i];
                }
                pair += 1;
            }
            for i in 0..4 {
                self.wanted[row][i] += differences[row][i] * wanted[i];
            }
        }
    }
}

impl Sums {
    fn add<T: Precision>(&mut self, lanes: &Lanes<T>) {
        let total = |lanes: &Node<T>| lanes.iter().map(|lane| lane.to_f64()).sum::<f64>();
        for (sum, lanes) in self.pairs.iter_mut().zip(&lanes.pairs) {
            *sum += total(lanes);
        }
        for (sum, lanes) in self.wanted.iter_mut().zip(&lanes.wanted) {
            *sum += total(lanes);
        }
    }

    /// Adds the sums of other nodes.
    fn include(&mut self, other: &Self) {
        for (sum, other) in self.pairs.iter_mut().zip(other.pairs) {
            *sum += other;
        }
        for (sum, other) in self.wanted.iter_mut().zip(other.wanted) {
            *sum += other;
        }
    }

    /// The weights of the first `count` differences that fit best; zero if there is nothing to fit.
    fn weights(self, count: usize) -> [f64; KEPT] {
        // Gaussian elimination in the order of the differences.
        let (mut matrix, mut wanted) = ([[0.0; KEPT]; KEPT], self.wanted);
        let mut pairs = self.pairs.into_iter();
        for row in 0..KEPT {
            for (column, pair) in (0..=row).zip(&mut pairs) {
                matrix[row][column] = pair;
                matrix[column][row] = pair;
            }
        }
        let whole: [f64; KEPT] = core::array::from_fn(|i| matrix[i][i]);
        let new =
            |matrix: &[[f64; KEPT]; KEPT], i: usize| i < count && matrix[i][i] > CUT * whole[i];
        for i in 0..KEPT {
            if !new(&matrix, i) {
                continue;
            }
            for row in i + 1..KEPT {
                let factor = matrix[row][i] / matrix[i][i];
                for column in i..KEPT {
                    matrix[row][column] -= factor * matrix[i][column];
                }
                wanted[row] -= factor * wanted[i];
            }
        }
        let mut weights = [0.0; KEPT];
        for i in (0..KEPT).rev() {
            if new(&matrix, i) {
                let others = i + 1..KEPT;
                let made: f64 = others.map(|j| matrix[i][j] * weights[j]).sum();
                weights[i] = (wanted[i] - made) / matrix[i][i];
            }
        }
        // Numbers that are too large to be squared give no fit.
        if weights.iter().all(|weight| weight.is_finite()) {
            weights
        } else {
            [0.0; KEPT]
        }
    }
}

/// The differences one step later, when the velocity is `v`.
#[inline(always)]
fn next<T: Precision>(old: &Differences<T>, v: &Node<T>) -> Differences<T> {
    let mut new = [*v; KEPT];
    for order in 1..KEPT {
        for i in 0..4 {
            new[order][i] = new[order - 1][i] - old[order - 1][i];
        }
    }
    new
}

/// Advances free nodes by one step to `velocity`, and sums the data of a fit that would have predicted this step.
#[cfg_attr(not(palpate_one_version), multiversion(targets("x86_64+avx2")))]
fn follow<T: Precision>(differences: &mut [Differences<T>], velocity: &[Node<T>], sums: &mut Sums) {
    for (differences, velocity) in differences.chunks_mut(BLOCK).zip(velocity.chunks(BLOCK)) {
        let mut lanes = Lanes::ZERO;
        let sample = SAMPLE.min(differences.len());
        let (first, others) = differences.split_at_mut(sample);
        for (kept, v) in first.iter_mut().zip(velocity) {
            let new = next(kept, v);
            lanes.add(kept, &new[1]);
            *kept = new;
        }
        for (kept, v) in others.iter_mut().zip(&velocity[sample..]) {
            *kept = next(kept, v);
        }
        sums.add(&lanes);
    }
}

/// Advances held nodes by one step to `velocity`, and sums the data of a fit that predicts the next step. In that step
/// the held nodes are displaced by `u` (m) at a `rate` of steps (1/s).
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw+avx2", "x86_64+avx2"))
)]
fn lead<T: Precision>(
    differences: &mut [Differences<T>],
    velocity: &[Node<T>],
    u: &[Node<T>],
    rate: T,
    sums: &mut Sums,
) {
    let nodes = differences.chunks_mut(BLOCK).zip(velocity.chunks(BLOCK));
    for ((differences, velocity), u) in nodes.zip(u.chunks(BLOCK)) {
        let mut lanes = Lanes::ZERO;
        for ((kept, v), u) in differences.iter_mut().zip(velocity).zip(u) {
            *kept = next(kept, v);
            let mut change = *u;
            for i in 0..4 {
                change[i] = rate * change[i] - v[i];
            }
            lanes.add(kept, &change);
        }
        sums.add(&lanes);
    }
}

/// `u := h (v + weights . differences)`.
#[cfg_attr(not(palpate_one_version), multiversion(targets("x86_64+avx2")))]
fn extrapolate<T: Precision>(
    differences: &[Differences<T>],
    h: T,
    weights: &[T; KEPT],
    u: &mut [Node<T>],
) {
    for (u, kept) in u.iter_mut().zip(differences) {
        let mut v = kept[0];
        for order in 0..KEPT {
            for i in 0..4 {
                v[i] += weights[order] * kept[order][i];
            }
        }
        *u = v.map(|v| h * v);
    }
}

/// The weights that the guess uses.
fn limited(weights: [f64; KEPT], tears: bool) -> [f64; KEPT] {
    if tears {
        weights.map(|weight| weight.clamp(-MOST_ROUGH, MOST_ROUGH))
    } else if weights.iter().any(|weight| weight.abs() > MOST) {
        [0.0; KEPT]
    } else {
        weights
    }
}

impl<T: Precision> Stepper<T> {
    /// Begins a new history, as if the body had always moved at its present velocity.
    pub(crate) fn begin_history(&mut self, body: &Body) {
        for (kept, &node) in self.history.iter_mut().zip(&self.places.node) {
            *kept = [[T::ZERO; 4]; KEPT];
            kept[0] = to_node(&body.state.v[node as usize]);
        }
    }

    /// Computes the displacement from which the iterations start, with the displacements that handles and supports
    /// prescribe.
    pub(crate) fn prescribe(&mut self, body: &mut Body, h: f64, targets: &[HandlePose]) {
        let (free, held) = (self.places.free, self.places.held);
        body.prescribe(targets);
        // The residual and `q` are free for other use until there is a guess.
        let state = &body.state;
        let places = (&mut *self.cg.u, &mut *self.cg.residual, &*self.places.node);
        team::each_of(&*self.team, places, RUN, &|(u, v, nodes)| {
            for ((u, v), &node) in u.iter_mut().zip(v).zip(nodes) {
                *u = to_node(&state.displacement[node as usize]);
                *v = to_node(&state.v[node as usize]);
            }
        });
        let (free_nodes, held_nodes) = self.history.split_at_mut(held);
        let places = (&mut free_nodes[..free], &self.cg.residual[..free]);
        let fits = team::runs(&*self.team, places, RUN, &mut self.cg.fits, &|(
            differences,
            v,
        )| {
            let mut sums = Sums::default();
            follow(differences, v, &mut sums);
            sums
        });
        let mut sums = Sums::default();
        for fit in fits {
            sums.include(fit);
        }
        lead(
            held_nodes,
            &self.cg.residual[held..],
            &self.cg.u[held..],
            T::of(1.0 / h),
            &mut sums,
        );
        let weights = match self.options.guess {
            Guess::Velocity => [0.0; KEPT],
            Guess::Acceleration => [0.0, 1.0, 0.0, 0.0],
            Guess::Fitted if self.last.unfinished => sums.weights(AFTER_UNFINISHED),
            Guess::Fitted => sums.weights(KEPT),
        };
        let is_rough = self.growth.is_some() || self.options.may_touch || self.last.was_certified;
        let weights = limited(weights, is_rough);
        let guided = self.places.mask.len();
        self.cg.q[..guided].copy_from_slice(&self.cg.u[..guided]);
        let (h, weights) = (T::of(h), weights.map(T::of));
        let places = (&mut self.cg.u[..free], &*self.history);
        team::each_of(&*self.team, places, RUN, &|(u, differences)| {
            extrapolate(differences, h, &weights, u);
        });
        // Supports prescribe the guided axes.
        for ((u, given), mask) in self.cg.u.iter_mut().zip(&self.cg.q).zip(&self.places.mask) {
            for i in 0..4 {
                if mask[i] == T::ZERO {
                    u[i] = given[i];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums(nodes: &[Differences<f64>], weights: [f64; KEPT]) -> Sums {
        let (mut lanes, mut sums) = (Lanes::ZERO, Sums::default());
        for node in nodes {
            let wanted = core::array::from_fn(|i| (0..KEPT).map(|k| weights[k] * node[k][i]).sum());
            lanes.add(node, &wanted);
        }
        sums.add(&lanes);
        sums
    }

    /// Nodes whose differences are unrelated.
    fn nodes() -> Vec<Differences<f64>> {
        let value = |at: usize| f64::from((at * at * 7919 % 1013) as u32) / 1013.0 - 0.5;
        let node = |n: usize| {
            core::array::from_fn(|k| core::array::from_fn(|i| value(16 * n + 4 * k + i)))
        };
        (0..20).map(node).collect()
    }

    fn near(found: [f64; KEPT], expected: [f64; KEPT]) -> bool {
        // The matrix is far from singular, so rounding errors stay small.
        found
            .iter()
            .zip(expected)
            .all(|(a, b)| (a - b).abs() < 1e-12)
    }

    #[test]
    fn weights_that_made_the_motion_are_found() {
        let made = [0.3, -1.2, 0.7, 2.0];
        let found = sums(&nodes(), made).weights(KEPT);
        assert!(near(found, made), "{found:?}");
    }

    #[test]
    fn a_difference_that_says_nothing_new_is_left_out() {
        let mut nodes = nodes();
        for node in &mut nodes {
            node[1] = node[0].map(|v| 2.0 * v);
            node[3] = [0.0; 4];
        }
        let found = sums(&nodes, [0.5, 0.25, 0.5, 1.0]).weights(KEPT);
        // The first difference takes over the weight of the second, and the last has no effect.
        assert!(near(found, [1.0, 0.0, 0.5, 0.0]), "{found:?}");
    }

    #[test]
    fn nothing_is_made_of_rest_and_of_numbers_too_large() {
        for size in [0.0, 1e-200, 1e200, f64::INFINITY, f64::NAN] {
            let node = [[size; 4]; KEPT];
            let found = sums(&[node], [1.0; KEPT]).weights(KEPT);
            assert_eq!(found, [0.0; KEPT], "{size}");
        }
    }

    #[test]
    fn a_jump_from_the_remainder_of_a_rest_is_no_trend() {
        let mut nodes = nodes();
        for node in &mut nodes {
            *node = node.map(|difference| difference.map(|v| 1e-40 * v));
        }
        let found = sums(&nodes, [1e40; KEPT]).weights(KEPT);
        assert_eq!(limited(found, false), [0.0; KEPT]);
        assert_eq!(
            limited([0.5, 1e9, 1.0, 0.0], true),
            [0.5, MOST_ROUGH, 1.0, 0.0]
        );
    }

    #[test]
    fn polynomials_have_the_differences_of_their_last_values() {
        let mut kept = [[0.0; 4]; KEPT];
        for t in [1.0, 2.0, 3.0, 4.0, 5.0, 6.0] {
            kept = next(&kept, &[t * t * t, t * t, t, 1.0]);
        }
        // The last values are 216, 125, 64, 27; 36, 25, 16, 9; 6, 5, 4, 3.
        assert_eq!(
            kept,
            [
                [216.0, 36.0, 6.0, 1.0],
                [91.0, 11.0, 1.0, 0.0],
                [30.0, 2.0, 0.0, 0.0],
                [6.0, 0.0, 0.0, 0.0],
            ]
        );
    }
}
