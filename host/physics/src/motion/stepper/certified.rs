//! Contacts of a body in its step: the displacement is shortened between `solve` and `finish` so that nothing passes through anything
//! ([`contact::certificate`](crate::contact::certificate)).

use super::calls::Call;
use super::{Stepper, Vectors};
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::error::StepError;
use crate::lanes::{Node, to_vec};
use crate::motion::constraint::by_node;
use crate::motion::constraint::tangent::Tangent;

/// The smallest fraction that the search for the least objective of a step tries.
const LEAST: f64 = 0.05;
/// A smaller fraction is taken if the objective falls by this part of its energies.
const FALL: f64 = 0.02;
/// The rounding error of sums of energies, as a fraction.
const ROUNDING: f64 = 1e-9;

impl<T: Precision> Stepper<T> {
    /// The displacement of a node over the step (m): the predicted one after `constrain`, the solution after `solve`, zero for a
    /// body that sleeps.
    pub fn displacement(&self, node: u32) -> Vec3 {
        if self.sleeps() {
            Vec3::zeros()
        } else {
            by_node(&self.places.of, &self.cg.u)(node)
        }
    }

    /// No node moves further than this over the step (m); zero for a body that sleeps.
    pub fn largest_displacement(&self) -> f64 {
        if self.sleeps() {
            return 0.0;
        }
        let square = |u: &[T; 4]| u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
        let largest = self.cg.u.iter().fold(T::ZERO, |most, u| {
            let own = square(u);
            if own > most { own } else { most }
        });
        largest.to_f64().sqrt()
    }

    /// Whether a node moves by the equation: no hand or support holds it.
    pub fn is_free(&self, node: u32) -> bool {
        (self.places.of[node as usize] as usize) < self.places.free
    }

    /// Whether the body sleeps in the present step.
    pub fn sleeps(&self) -> bool {
        self.present.underway.is_some_and(|step| step.report.asleep)
    }

    /// Whether the body, or the piece of a torn sheet to which a node belongs, sleeps in the present step.
    pub fn sleeps_at(&self, node: u32) -> bool {
        self.sleeps() || self.sleep.has_asleep(node)
    }

    /// Number of pieces that sleep while the body is awake.
    pub fn pieces_asleep(&self) -> usize {
        self.sleep.pieces_asleep()
    }

    /// Whether the body, or the piece to which a node belongs, has lain still long enough to sleep.
    pub(crate) fn is_still(&self, node: u32) -> bool {
        self.sleep.is_still(node)
    }

    /// Wakes the piece of a node in the present step, after `constrain`.
    pub(crate) fn stir(&mut self, node: u32) {
        self.sleep.stir(node, &mut self.places);
    }

    /// Certifies the displacement after the solve: each free node takes its `fraction` of the displacement, from zero to one.
    /// `finish` keeps the displacement: if the step would add energy, the body loses velocity. The residual follows.
    ///
    /// `work` takes the work (J) on each free node of the forces that shorten the displacement.
    ///
    /// # Errors
    ///
    /// [`StepError::Order`] if the step has not been solved.
    pub fn certify(
        &mut self,
        fraction: &dyn Fn(u32) -> f64,
        work: &mut dyn FnMut(u32, f64),
    ) -> Result<(), StepError> {
        let mut step = self.begun(Call::Solve)?;
        self.present.is_certified = true;
        if !step.report.asleep && self.multiply(step.factors.1, &|node| fraction(node) - 1.0) {
            step.report.residual = self.advance(1.0);
            let (places, cg) = (&self.places, &self.cg);
            for place in 0..places.free {
                let along = to_vec(&cg.u[place]).dot(&to_vec(&cg.residual[place]));
                work(places.node[place], -along);
            }
        }
        self.present.underway = Some(step);
        Ok(())
    }

    /// The largest fraction, at most one, of the displacement of the free nodes, each shortened to its `fraction`, with which
    /// the forces that shorten it do no work on the body.
    ///
    /// The shortened displacement `s u'` solves the equation `A u = f` with the forces `A s u' - f` in addition. Their work
    /// is zero at `s = u'.f / u'.A u'`, and `u'.f` follows from the residual `r = f - A u` of the solution `u`.
    pub fn fraction_without_gain(&mut self, fraction: &dyn Fn(u32) -> f64) -> f64 {
        let step = self.present.underway.filter(|step| !step.report.asleep);
        if !step.is_some_and(|step| self.multiply(step.factors.1, fraction)) {
            return 1.0;
        }
        let curvature =
            self.along_free(|cg, place| to_vec(&cg.p[place]).dot(&to_vec(&cg.q[place])));
        let excess = self.along_free(|cg, place| {
            let of = |vector: &[Node<T>]| to_vec(&vector[place]);
            let (u, p) = (of(&cg.u), of(&cg.p));
            (p - u).dot(&of(&cg.q)) - p.dot(&of(&cg.residual))
        });
        if excess > 0.0 {
            (1.0 - excess / curvature).max(0.0)
        } else {
            1.0
        }
    }

    /// The fraction, one or a power of a half, of the displacement of the free nodes, each shortened to its `fraction`, with
    /// the least objective of the step: `m |u - h v|^2 / 2 h^2`, the energy at the end, and that of `contacts` for a fraction.
    /// Implicit Euler minimizes this objective (Gast et al., "Optimization integrator for large time steps", 2015). A solution
    /// of the linearized equation goes too far if elements turn or stretch much.
    pub fn fraction_of_least(
        &mut self,
        body: &Body,
        fraction: &dyn Fn(u32) -> f64,
        contacts: &dyn Fn(f64) -> f64,
    ) -> f64 {
        let step = self.present.underway.filter(|step| !step.report.asleep);
        let Some(step) = step else { return 1.0 };
        let mut x = core::mem::take(&mut self.last.ahead);
        // The objective, and by what a smaller one has to be less.
        let mut objective = |s: f64| {
            let mut inertia = 0.0;
            x.clear();
            x.extend((0_u32..).zip(&body.state.x).map(|(node, x)| {
                let (at, place) = (node as usize, self.places.of[node as usize] as usize);
                let u = to_vec(&self.cg.u[place]);
                if place >= self.places.free {
                    return x + u;
                }
                let u = u * (s * fraction(node));
                let by = u / step.h - body.state.v[at];
                inertia += 0.5 * body.model.mass[at] * by.norm_squared();
                x + u
            }));
            let stored = inertia + body.elastic_energy_at(&x);
            let loads = body.load_potential_at(&x);
            let objective = stored + loads + contacts(s);
            (objective, FALL * stored + ROUNDING * loads.abs())
        };
        let (mut s, mut least) = (1.0, objective(1.0));
        while s > LEAST {
            let half = objective(0.5 * s);
            if half.0 >= least.0 - least.1 {
                break;
            }
            (s, least) = (0.5 * s, half);
        }
        self.last.ahead = x;
        s
    }

    /// Gives the body the tangents of its contacts in the last step. The next factor has them.
    pub fn touch(&mut self, contacts: impl Iterator<Item = Tangent>) {
        self.contacts.clear();
        self.contacts.extend(contacts);
    }

    /// Computes the product of the matrix with the displacement of the free nodes, that of each times the `scale` of the node.
    /// Returns whether the scaled displacement is not zero.
    fn multiply(&mut self, stiffness_factor: f64, scale: &dyn Fn(u32) -> f64) -> bool {
        let (places, cg) = (&self.places, &mut self.cg);
        let mut moves = false;
        for place in 0..places.free {
            let a = T::of(scale(places.node[place]));
            for i in 0..4 {
                cg.p[place][i] = a * cg.u[place][i];
                cg.q[place][i] = cg.inertia[place] * cg.p[place][i];
            }
            moves |= cg.p[place] != [T::ZERO; 4];
        }
        cg.p[places.free..].fill([T::ZERO; 4]);
        if moves {
            cg.q[places.free..].fill([T::ZERO; 4]);
            let factor = T::of(stiffness_factor);
            self.elements.product(&*self.team, factor, &cg.p, &mut cg.q);
            self.pairs.add_springs(&places.of, &cg.p, &mut cg.q);
        }
        moves
    }

    /// The sum over the free nodes, by place.
    fn along_free(&self, of: impl Fn(&Vectors<T>, usize) -> f64) -> f64 {
        (0..self.places.free).map(|place| of(&self.cg, place)).sum()
    }
}
