//! Contacts of a body in its step: the displacement is shortened between `solve` and `finish` so that nothing passes through anything
//! ([`contact::certificate`](crate::contact::certificate)).

use super::Stepper;
use super::calls::Call;
use crate::Vec3;
use crate::element::precision::Precision;
use crate::error::StepError;
use crate::motion::constraint::by_node;
use crate::motion::constraint::tangent::Tangent;

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
    /// # Errors
    ///
    /// [`StepError::Order`] if the step has not been solved.
    pub fn certify(&mut self, fraction: &dyn Fn(u32) -> f64) -> Result<(), StepError> {
        let mut step = self.begun(Call::Solve)?;
        self.present.is_certified = true;
        if !step.report.asleep {
            step.report.residual = self.shorten(step.factors.1, fraction, step.report.residual);
        }
        self.present.underway = Some(step);
        Ok(())
    }

    /// Gives the body the tangents of its contacts in the last step. The next factor has them.
    pub fn touch(&mut self, contacts: impl Iterator<Item = Tangent>) {
        self.contacts.clear();
        self.contacts.extend(contacts);
    }

    /// Scales the displacement of the free nodes. Returns the norm of the residual on free axes (N), which was `residual`.
    fn shorten(
        &mut self,
        stiffness_factor: f64,
        fraction: &dyn Fn(u32) -> f64,
        residual: f64,
    ) -> f64 {
        let (places, cg) = (&self.places, &mut self.cg);
        let mut is_shorter = false;
        for place in 0..places.free {
            let a = fraction(places.node[place]) - 1.0;
            is_shorter |= a < 0.0;
            for i in 0..4 {
                cg.p[place][i] = T::of(a) * cg.u[place][i];
                cg.q[place][i] = cg.inertia[place] * cg.p[place][i];
            }
        }
        if !is_shorter {
            cg.p.fill([T::ZERO; 4]);
            return residual;
        }
        cg.q[places.free..].fill([T::ZERO; 4]);
        let factor = T::of(stiffness_factor);
        self.elements.product(&*self.team, factor, &cg.p, &mut cg.q);
        self.pairs.add_springs(&places.of, &cg.p, &mut cg.q);
        self.advance(1.0)
    }
}
