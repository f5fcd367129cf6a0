//! Further linearizations of a step whose end differs from the prediction: if elements are inverted, and if hands
//! move so far in the step that one linearization adds energy.
//!
//! **Inverted elements.** A body with inverted elements passes close to saddles of its energy. There the small errors of one
//! linearization decide where the body comes to rest: in its right shape, or in a balance in which an element stays inverted.
//! The equation is then linearized again at the step's end and solved for the remaining imbalance. This is Newton's method
//! for implicit Euler. Elsewhere, and if a hand moves the body, one linearization is enough, and this module costs
//! nothing.
//!
//! **Hands that move far.** The motion of a hand is prescribed. If it turns elements by a large angle in a step, the
//! linearized elements become longer, and the step adds energy. The guard shortens such a step, but a shorter motion of
//! the other vertices stretches the elements beside the hand even more, so that no fraction of the motion may be allowed.
//! The equation is then linearized at the step's end and solved again. Its solution is that of implicit Euler, which adds
//! no energy beyond the work of the forces at the end.

use super::{Limits, Solved, Stepper, StepperReport};
use crate::Vec3;
use crate::body::Body;
use crate::body::guard::Energy;
use crate::element::precision::Precision;
use crate::error::StepError;
use crate::lanes::to_vec;
use crate::motion::constraint::by_node;

/// The change of the motion, as a fraction of the motion, above which a step is corrected. With values from 0 to 0.03,
/// mirrored bodies return to their right shape; the constant is half of the upper value.
const STRAY: f64 = 0.015;
/// Most linearizations after the first. Each of them leaves about the square of the fraction that was left before.
const MOST_CORRECTIONS: usize = 2;
/// Most further solutions of a step whose energy is not allowed. In the random tears one sufficed, seldom two.
pub(super) const MOST_SOLUTIONS: usize = 4;
/// Inverted elements store energy. A body with less than this fraction of the energy that presses the whole body flat
/// is not checked.
const TURNED: f64 = 0.05;

/// The linearized equation along the motion `u` over the step (J).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Promise {
    /// `u f`, with the elastic forces at the start.
    force: f64,
    /// `u K u`.
    stiffness: f64,
    /// `u A u`.
    whole: f64,
}

/// The energy (J) above which elements may be inverted; infinite for bodies whose elements cannot be inverted.
pub(crate) fn turned(body: &Body) -> f64 {
    let flat = |axis: usize| {
        let pressed = |x: &Vec3| {
            let mut x = *x;
            x[axis] = 0.0;
            x
        };
        let pressed: Vec<Vec3> = body.model.rest.iter().map(pressed).collect();
        let inside_out: usize = body
            .model
            .elements
            .iter()
            .map(|set| set.inverted(&pressed))
            .sum();
        if inside_out == 0 {
            f64::INFINITY
        } else {
            body.elastic_energy_at(&pressed)
        }
    };
    TURNED * (0..3).map(flat).fold(f64::INFINITY, f64::min)
}

impl<T: Precision> Stepper<T> {
    /// The terms of the equation along the step as solved, before the elements are linearized at its end; `None` if
    /// no element can be inverted.
    pub(crate) fn promise(
        &self,
        body: &Body,
        h: f64,
        (mass_factor, stiffness_factor): (f64, f64),
    ) -> Option<Promise> {
        if self.elements.energy < self.elements.turned {
            return None;
        }
        let (mut force, mut whole, mut inertia) = (0.0, 0.0, 0.0);
        for place in 0..self.places.free {
            let node = self.places.node[place] as usize;
            let (u, mass) = (self.moved(place), self.places.mass[place]);
            let elastic = to_vec(&self.elements.force[place]);
            let acting = elastic + body.model.external[node] * body.model.load_factor;
            force += elastic.dot(&u);
            // `A u` is the acting force less the residual of the solve.
            whole += (body.state.v[node] * (mass / h) + acting - to_vec(&self.cg.residual[place]))
                .dot(&u);
            inertia += mass_factor * mass * to_vec(&self.cg.u[place]).dot(&u);
        }
        Some(Promise {
            force,
            stiffness: (whole - inertia) / stiffness_factor,
            whole,
        })
    }

    /// Whether the motion has to be corrected: the body has inverted elements, and the forces at the step's end, where
    /// the elements are linearized, differ from the prediction by so much that the motion would change.
    pub(crate) fn breaks(&self, body: &Body, promised: Promise) -> bool {
        let force = (0..self.places.free)
            .map(|place| to_vec(&self.elements.force[place]).dot(&self.moved(place)));
        let left = force.sum::<f64>() - promised.force + promised.stiffness;
        left.abs() > STRAY * promised.whole.abs()
            && body
                .model
                .elements
                .iter()
                .any(|set| set.inverted(&self.elements.at) > 0)
    }

    /// Solves for the remaining imbalance at the step's end, linearized there. Returns an upper bound of the work of
    /// hands (J), and the energy at the new end.
    pub(crate) fn correct(
        &mut self,
        body: &mut Body,
        h: f64,
        factors: (f64, f64),
        report: &mut StepperReport,
        out_of_time: &mut dyn FnMut() -> bool,
    ) -> Result<(f64, Energy), StepError> {
        let goal = self.options.tolerance * report.reference;
        let mut result = None;
        for _ in 0..MOST_CORRECTIONS {
            self.pull_at_the_end(body, h);
            let limits = Limits {
                of: Solved::Step,
                uses_learned: true,
                goal,
                start: goal,
                max_iterations: self.options.max_iterations,
            };
            let again = self.iterate(factors, limits, out_of_time);
            report.iterations += again.iterations;
            report.residual = again.residual;
            report.converged = again.converged;
            let work = self.take(body, h, report)?;
            result = Some((work, self.energy_ahead(body, h)));
            if again.iterations == 0 {
                break;
            }
        }
        match result {
            Some(result) => Ok(result),
            None => Ok((self.take(body, h, report)?, self.energy_ahead(body, h))),
        }
    }

    /// Solves the equation again, from the displacement of `body` and linearized at its end. Returns the work of hands and
    /// supports over the step (J), and the energy at the end. The work is that of the forces at the end, with which
    /// implicit Euler adds no energy.
    pub(crate) fn solve_again(
        &mut self,
        body: &mut Body,
        h: f64,
        factors: (f64, f64),
        report: &mut StepperReport,
        out_of_time: &mut dyn FnMut() -> bool,
    ) -> Result<(f64, Energy), StepError> {
        let goal = self.options.tolerance * report.reference;
        let limits = Limits {
            of: Solved::Step,
            uses_learned: true,
            goal,
            start: goal,
            max_iterations: self.options.max_iterations,
        };
        self.pull_at_the_end(body, h);
        let solved = self.iterate(factors, limits, out_of_time);
        self.pairs.shear(by_node(&self.places.of, &self.cg.u));
        report.iterations += solved.iterations;
        report.residual = solved.residual;
        report.converged = solved.converged;
        self.take(body, h, report)?;
        let after = self.energy_ahead(body, h);
        self.pull_at_the_end(body, h);
        let mut work = self.supplied(body) + self.given_back(body);
        if !self.present.joints.is_empty() {
            work += self.joint_work(body);
        }
        Ok((work, after))
    }

    /// The work of hands and supports on the body over the step (J), from the residual.
    fn supplied(&self, body: &Body) -> f64 {
        let mut work = 0.0;
        for place in self.places.taken() {
            let u = body.state.displacement[self.places.node[place] as usize];
            let pull = -to_vec(&self.cg.residual[place]);
            if place >= self.places.held {
                work += pull.dot(&u);
            } else if let Some(mask) = self.places.mask.get(place) {
                let fixed = Vec3::repeat(1.0) - to_vec(mask);
                work += pull.component_mul(&fixed).dot(&u);
            }
        }
        work
    }

    /// The displacement of a free place along its free axes (m).
    fn moved(&self, place: usize) -> Vec3 {
        let u = to_vec(&self.cg.u[place]);
        self.places
            .mask
            .get(place)
            .map_or(u, |mask| u.component_mul(&to_vec(mask)))
    }
}
