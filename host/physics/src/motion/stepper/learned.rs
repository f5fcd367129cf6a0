//! A preconditioner that learns from the last solves.
//!
//! A frozen factor lacks what has changed since it was made. When a sheet tears, these are the few triangles about the
//! tip, which stretch by the hand's motion of many steps within one. Conjugate gradients then find the same few slow
//! directions in each step, and again after each round in which the forces of pairs have changed. Each iteration knows a
//! direction `p` and its product `q = A p`. The last of these pairs correct the factor by the formula of limited-memory
//! quasi-Newton methods (J. L. Morales and J. Nocedal, "Automatic preconditioning by limited memory quasi-Newton updating",
//! 2000; the two loops are those of algorithm 7.4 of Nocedal and Wright, "Numerical optimization", 2006).
//!
//! The result is positive definite for any pairs of positive curvature `p q`. A matrix that has changed since a pair was
//! found therefore costs iterations only.

use crate::lanes::{Node, Real};
use crate::linear::vectors;

/// Pairs that correct the factor.
pub(super) const MEMORY: usize = 8;

/// The pairs of the last iterations, scaled to the curvature 1.
#[derive(Debug, Default)]
pub(super) struct Learned {
    /// Number of places of a vector.
    stride: usize,
    /// Directions (m) and products (N), by slots of `stride`. There are twice as many slots as pairs in use, so that the
    /// preconditioner stays the same during a solve.
    directions: Vec<Node<f32>>,
    products: Vec<Node<f32>>,
    /// The slot after that of the newest pair; the number of pairs, of those in use, and of those found since.
    next: usize,
    count: usize,
    used: usize,
    found: usize,
    /// The numbers that the first loop leaves to the second.
    parts: [f64; MEMORY],
}

impl Learned {
    /// Room for the pairs of a body with free places below `stride`.
    pub(super) fn new(stride: usize) -> Self {
        let zeros = vec![[0.0; 4]; 2 * MEMORY * stride];
        Self {
            stride,
            directions: zeros.clone(),
            products: zeros,
            ..Self::default()
        }
    }

    /// Forgets all pairs.
    pub(super) fn forget(&mut self) {
        (self.count, self.used, self.found) = (0, 0, 0);
    }

    /// Begins a solve: the pairs of the last one replace the oldest. The solve uses the pairs only if `uses`: they cost
    /// about a sixth of an iteration, which a solve of one iteration would not save.
    pub(super) fn begin(&mut self, uses: bool) {
        self.next = (self.next + self.found) % (2 * MEMORY);
        self.count = (self.count + self.found).min(MEMORY);
        self.found = 0;
        self.used = if uses { self.count } else { 0 };
    }

    /// Learns the direction `p` with the product `q` and the `curvature` `p q > 0` (J).
    pub(super) fn learn<T: Real>(&mut self, p: &[Node<T>], q: &[Node<T>], curvature: f64) {
        let scale = 1.0 / curvature.sqrt();
        if self.stride < p.len() || self.found == MEMORY || !scale.is_finite() {
            return;
        }
        let start = (self.next + self.found) % (2 * MEMORY) * self.stride;
        let slot = start..start + p.len();
        vectors::round_scaled(scale, p, &mut self.directions[slot.clone()]);
        vectors::round_scaled(scale, q, &mut self.products[slot]);
        self.found += 1;
    }

    /// Where the pair of this age begins: 0 is the newest.
    fn start(&self, age: usize) -> usize {
        (self.next + 2 * MEMORY - 1 - age) % (2 * MEMORY) * self.stride
    }

    /// The first loop, before the solve with the factor: in place on the residual.
    pub(super) fn before(&mut self, r: &mut [Node<f32>]) {
        for age in 0..self.used {
            let slot = self.start(age)..self.start(age) + r.len();
            let part = vectors::dot_single(&self.directions[slot.clone()], r);
            vectors::add_single(-part as f32, &self.products[slot], r);
            self.parts[age] = part;
        }
    }

    /// The second loop, after the solve with the factor: in place on its solution.
    pub(super) fn after(&self, z: &mut [Node<f32>]) {
        for age in (0..self.used).rev() {
            let slot = self.start(age)..self.start(age) + z.len();
            let part = self.parts[age] - vectors::dot_single(&self.products[slot.clone()], z);
            vectors::add_single(part as f32, &self.directions[slot], z);
        }
    }
}
