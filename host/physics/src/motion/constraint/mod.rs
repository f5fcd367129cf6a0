//! Constraints: laws over the differences of nodes, in the equation of a step.
//!
//! The forces along the laws enter the equation as loads. After each iteration, `agree` computes the
//! forces that agree with the openings of the iteration. Before the first one, `compliance` predicts the forces from
//! the residual of the guess, by the compliance of the openings with the factor in place of the matrix.
//!
//! Across its gradient a law is a spring. The spring is part of the matrix of the step: a light vertex that moves out of
//! the plane would swing from step to step otherwise. The compliance holds the springs in the preconditioner.
//!
//! - `law`: what a law gives. [`cohesion`]: the law of two vertices that let each other go, the only one so far.
//! - `agree`: the forces that agree with the openings. `compliance`: how the openings respond.
//!
//! `Constraints` knows nodes, places and vectors, and no solver. The stepper calls it between the stages of a solve.

mod agree;
pub mod cohesion;
mod compliance;
pub(crate) mod law;
pub mod tangent;

use crate::Vec3;
use crate::lanes::{Node, Real, to_node, to_vec};
use agree::Agreement;
use compliance::Compliance;
use law::Law;

/// The vector of a node in `vectors`, which are by place; zero for a node whose place is past their end.
pub(crate) fn by_node<'a, T: Real>(
    place: &'a [u32],
    vectors: &'a [Node<T>],
) -> impl Fn(u32) -> Vec3 + 'a {
    |node| {
        let place = place[node as usize] as usize;
        vectors.get(place).map_or_else(Vec3::zeros, to_vec)
    }
}

/// The difference of two nodes.
pub(crate) fn difference(nodes: [u32; 2], of: impl Fn(u32) -> Vec3) -> Vec3 {
    let [a, b] = nodes.map(of);
    b - a
}

/// Adds a force (N) on the first node, and the opposite one on the second, to vectors by place.
fn load<T: Real>(nodes: [u32; 2], force: &Vec3, place: &[u32], to: &mut [Node<T>]) {
    for (node, sign) in nodes.into_iter().zip([1.0, -1.0]) {
        let sum = &mut to[place[node as usize] as usize];
        let load: Node<T> = to_node(&(force * sign));
        for i in 0..4 {
            sum[i] += load[i];
        }
    }
}

/// The laws of one kind on a body, with the responses of their openings.
#[derive(Debug)]
pub(crate) struct Constraints<L> {
    laws: Vec<L>,
    most: usize,
    /// The columns of the laws; those that are not known are computed at the next step.
    compliance: Compliance,
    /// The forces that agree with the openings.
    agreement: Agreement,
    /// Changes of openings (m).
    changed: Vec<Vec3>,
}

impl<L> Default for Constraints<L> {
    fn default() -> Self {
        Self {
            laws: Vec::new(),
            most: 0,
            compliance: Compliance::default(),
            agreement: Agreement::default(),
            changed: Vec::new(),
        }
    }
}

impl<L: Law> Constraints<L> {
    /// Room for `most` laws on a body with free places below `places`.
    pub(crate) fn new(most: usize, places: usize) -> Self {
        Self {
            laws: Vec::with_capacity(most),
            most,
            compliance: Compliance::new(most, places),
            agreement: Agreement::new(most),
            changed: vec![Vec3::zeros(); most],
        }
    }

    /// Notes that the matrix or its factor has changed.
    pub(crate) fn forget_responses(&mut self) {
        self.compliance.forget();
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.laws.is_empty()
    }

    pub(crate) fn laws(&self) -> &[L] {
        &self.laws
    }

    pub(crate) fn laws_mut(&mut self) -> &mut [L] {
        &mut self.laws
    }

    pub(crate) fn clear(&mut self) {
        self.laws.clear();
    }

    /// Adds a law. Returns whether there was room.
    pub(crate) fn push(&mut self, law: L) -> bool {
        let has_room = self.laws.len() < self.most;
        if has_room {
            self.laws.push(law);
        }
        has_room
    }

    /// Removes a law.
    pub(crate) fn remove(&mut self, at: usize) -> L {
        self.forget_responses();
        self.laws.remove(at)
    }

    /// Adds the forces of all laws to the `residual`.
    pub(crate) fn load<T: Real>(&self, place: &[u32], residual: &mut [Node<T>]) {
        for law in &self.laws {
            load(law.nodes(), &law.pull(), place, residual);
        }
    }

    /// Adds the forces of the springs of all laws over the displacements `u` to the `residual`.
    pub(crate) fn load_springs<T: Real>(
        &self,
        place: &[u32],
        u: &[Node<T>],
        residual: &mut [Node<T>],
    ) {
        for law in &self.laws {
            let change = difference(law.nodes(), by_node(place, u));
            load(law.nodes(), &law.sideways(&change), place, residual);
        }
    }

    /// Adds the product of the springs of all laws with `p` to `q`.
    pub(crate) fn add_springs<T: Real>(&self, place: &[u32], p: &[Node<T>], q: &mut [Node<T>]) {
        for law in &self.laws {
            let force = law.sideways(&difference(law.nodes(), by_node(place, p)));
            load(law.nodes(), &-force, place, q);
        }
    }

    /// Gives the laws the forces at the openings of the displacements `u`.
    pub(crate) fn follow(&mut self, u: impl Fn(u32) -> Vec3) {
        for law in &mut self.laws {
            let force = law.value(opening(law, &u));
            if force.is_finite() {
                law.set_force(force);
            }
        }
    }

    /// Gives the laws the forces that agree with the openings of the solution, as far as the factor predicts the solution
    /// from the `residual` of the guess `u`, with `free` free places. Few iterations correct these forces.
    pub(crate) fn predict<T: Real>(
        &mut self,
        place: &[u32],
        u: &[Node<T>],
        free: usize,
        residual: &mut [Node<T>],
    ) {
        if self.is_empty() {
            return;
        }
        self.compliance
            .predict(&residual[..free], &mut self.changed);
        let openings = self.agreement.openings.iter_mut().zip(&self.changed);
        for (law, (to, change)) in self.laws.iter().zip(openings) {
            *to = opening(law, by_node(place, u)) + law.gradient().dot(change);
        }
        let change = self.agreement.solve(&self.laws, false);
        if change.is_finite() {
            self.take_forces(place, residual);
        }
    }

    /// Solves for the forces that agree with the openings of the displacements `u`. Returns the largest change of a force
    /// (N). The change is NaN if a force is NaN.
    pub(crate) fn agree(&mut self, u: impl Fn(u32) -> Vec3) -> f64 {
        self.find_openings(u);
        self.agreement.solve(&self.laws, true)
    }

    /// Gives the laws the forces that were solved for, and changes the `residual` by them.
    pub(crate) fn take_forces<T: Real>(&mut self, place: &[u32], residual: &mut [Node<T>]) {
        for (law, &force) in self.laws.iter_mut().zip(&self.agreement.forces) {
            let change = law.gradient() * (force - law.force());
            load(law.nodes(), &change, place, residual);
            law.set_force(force);
        }
    }

    /// Finds the openings at the displacements `u`.
    pub(crate) fn find_openings(&mut self, u: impl Fn(u32) -> Vec3) {
        for (law, to) in self.laws.iter().zip(&mut self.agreement.openings) {
            *to = opening(law, &u);
        }
    }

    /// Adds the product of the laws, as springs along their gradients, with `p` to `q`.
    pub(crate) fn add_stiffness<T: Real>(&self, place: &[u32], p: &[Node<T>], q: &mut [Node<T>]) {
        for law in &self.laws {
            let along = law.gradient();
            let opens = along.dot(&difference(law.nodes(), by_node(place, p)));
            load(law.nodes(), &(along * (-law.stiffness() * opens)), place, q);
        }
    }

    /// Gives the laws the forces that their springs have at the displacements `u`, from the openings that were found last.
    pub(crate) fn stretch(&mut self, u: impl Fn(u32) -> Vec3) {
        for (law, from) in self.laws.iter_mut().zip(&self.agreement.openings) {
            law.set_force(law.force() + law.stiffness() * (opening(law, &u) - from));
        }
    }

    /// Gives the laws their forces at the displacements `u`, and changes the `residual` by the difference to their
    /// springs.
    ///
    /// This is Newton's method with the stiffness of a law that closes for its tangent. A law that falls faster than the body
    /// unloads opens in each round, until it has no force left.
    pub(crate) fn relinearize<T: Real>(
        &mut self,
        place: &[u32],
        u: &[Node<T>],
        residual: &mut [Node<T>],
    ) {
        self.stretch(by_node(place, u));
        self.find_openings(by_node(place, u));
        for (law, opening) in self.laws.iter_mut().zip(&self.agreement.openings) {
            let force = law.value(*opening);
            if force.is_finite() {
                let change = law.gradient() * (force - law.force());
                load(law.nodes(), &change, place, residual);
                law.set_force(force);
            }
        }
    }

    /// Changes the force of a law by its own size, to measure the responses to it.
    pub(crate) fn push_law<T: Real>(
        &mut self,
        column: usize,
        place: &[u32],
        residual: &mut [Node<T>],
    ) {
        let law = &mut self.laws[column];
        load(
            law.nodes(),
            &(law.gradient() * law.scale()),
            place,
            residual,
        );
        law.set_force(law.force() + law.scale());
    }

    /// Takes the responses of all openings to that change from the displacements `u`.
    pub(crate) fn take_responses(&mut self, column: usize, u: impl Fn(u32) -> Vec3) {
        let scale = self.laws[column].scale();
        for (row, law) in self.laws.iter().enumerate() {
            let opening = opening(law, &u);
            // Forces close the openings.
            let response = (self.agreement.openings[row] - opening) / scale;
            self.agreement.set_response(row, column, response);
            self.agreement.openings[row] = opening;
        }
    }

    /// Whether the columns of the laws have still to be [taken](Self::take_column).
    pub(crate) fn needs_columns(&self) -> bool {
        !self.is_empty() && !self.compliance.is_known()
    }

    /// Takes the displacements `z` (m/N) of the free places under the unit force that parts the nodes of a law along an
    /// axis. After the last axis of the last law, the columns are complete.
    pub(crate) fn take_column(
        &mut self,
        column: usize,
        axis: usize,
        place: &[u32],
        z: &[Node<f32>],
    ) {
        self.compliance.take_column(column, axis, z);
        for (row, law) in self.laws.iter().enumerate() {
            let opening = difference(law.nodes(), by_node(place, z));
            self.compliance.take_opening(row, column, axis, &opening);
        }
        if column + 1 == self.laws.len() && axis == 2 {
            self.compliance.complete(self.laws.len());
        }
    }

    /// Computes the responses of the openings along the present gradients, with the factor in place of the matrix, and
    /// takes the springs into the preconditioner.
    pub(crate) fn respond(&mut self) {
        if self.is_empty() {
            return;
        }
        let springs = self.laws.iter().map(|law| (law.gradient(), law.across()));
        self.compliance.hold(springs);
        for (column, law) in self.laws.iter().enumerate() {
            self.compliance
                .respond(column, &law.gradient(), &mut self.changed);
            for (row, (law, change)) in self.laws.iter().zip(&self.changed).enumerate() {
                let response = law.gradient().dot(change);
                self.agreement.set_response(row, column, response);
            }
        }
    }

    /// Takes the displacements by the springs from `z`, into which the factor has solved.
    pub(crate) fn hold(&mut self, place: &[u32], z: &mut [Node<f32>]) {
        if !self.compliance.holds() {
            return;
        }
        let laws = &self.laws;
        self.compliance
            .add_to(z, |z, law| difference(laws[law].nodes(), by_node(place, z)));
    }

    /// Gives the laws the forces of their springs over the displacements `u`.
    pub(crate) fn shear(&mut self, u: impl Fn(u32) -> Vec3) {
        for law in &mut self.laws {
            law.shear(&difference(law.nodes(), &u));
        }
    }

    /// Ends at once each law that would give back more energy than it stores. Their forces do not agree with their
    /// openings after all rounds: a light piece that has come off responds more than the old factor says, and a law would
    /// throw it.
    pub(crate) fn drop_strays<T: Real>(
        &mut self,
        place: &[u32],
        u: &[Node<T>],
        residual: &mut [Node<T>],
    ) {
        for law in &mut self.laws {
            let opens = law
                .gradient()
                .dot(&difference(law.nodes(), by_node(place, u)));
            if !law.may_give(-law.force() * opens) {
                load(
                    law.nodes(),
                    &(law.gradient() * -law.force()),
                    place,
                    residual,
                );
                law.drop_force();
            }
        }
    }

    /// The energy (J) that the laws give back in a step with the displacements `u`.
    pub(crate) fn given_back(&self, u: impl Fn(u32) -> Vec3) -> f64 {
        let work = self
            .laws
            .iter()
            .map(|law| (-law.pull().dot(&difference(law.nodes(), &u))).clamp(0.0, law.energy()));
        work.sum()
    }

    /// Ends a step with the displacements `u`, and forgets the laws that are over, each of which `ended` takes. Returns the
    /// work that the laws took (J).
    pub(crate) fn accept(&mut self, u: impl Fn(u32) -> Vec3, mut ended: impl FnMut(&L)) -> f64 {
        let mut work = 0.0;
        for law in &mut self.laws {
            work -= law.work();
            law.accept(&difference(law.nodes(), &u));
            work += law.work();
        }
        let count = self.laws.len();
        self.laws.retain(|law| {
            let is_over = law.is_over();
            if is_over {
                ended(law);
            }
            !is_over
        });
        if self.laws.len() < count {
            self.forget_responses();
        }
        work
    }
}

/// The opening of a law at the displacements `u` (m).
fn opening<L: Law>(law: &L, u: impl Fn(u32) -> Vec3) -> f64 {
    law.opening() + law.gradient().dot(&difference(law.nodes(), u))
}
