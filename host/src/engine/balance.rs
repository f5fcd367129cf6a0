//! The balance of energy of a body that tears: a state that diverges is a fault.
//!
//! Only hands, contacts and loads give a body energy. The sum of its kinetic, elastic and potential energy therefore never
//! exceeds the sum at the start by more than the work of hands and contacts. The time steps lose energy. A body whose energy exceeds this
//! bound several times has left the solution of its equations: its state grows without bound, and no force that it
//! exerts means anything.

use super::stats::StepFault;
use physics::Body;

/// Energy of a body (J) over what it may have, as a multiple of the work of the hands. A step counts the work with the
/// force at its end, which at a blow is a multiple of the mean force.
const MOST: f64 = 4.0;
/// Energy that a body may gain in any case (J). It is larger than what the solver's tolerance leaves in a run, and a hand
/// does as much work over a centimetre with a force of 1 N.
const SLACK: f64 = 0.01;

/// Follows the energy of a body.
#[derive(Clone, Debug, Default)]
pub(super) struct Balance {
    /// The energy before the first step (J); `None` before it.
    start: Option<f64>,
    /// The sum of the magnitudes of the work of all hands and of contacts in all steps (J).
    moved: f64,
    /// The fault, once the body has diverged.
    diverged: Option<StepFault>,
}

impl Balance {
    /// Whether the body has not diverged so far.
    ///
    /// # Errors
    /// The fault with which it has.
    pub(super) fn check(&self) -> Result<(), StepFault> {
        self.diverged.clone().map_or(Ok(()), Err)
    }

    /// Notes the work (J) of contacts on the body in the present step, before [`take`](Self::take).
    pub(super) fn push(&mut self, work: f64) {
        self.moved += work.abs();
    }

    /// Takes the step of `h` seconds that `body` has just made, and the elastic energy `elastic` (J) at its end.
    ///
    /// # Errors
    /// [`StepFault::NotFinite`] and [`StepFault::Diverged`], in this and in all later steps.
    pub(super) fn take(&mut self, body: &Body, elastic: f64, h: f64) -> Result<(), StepFault> {
        let reports = (0..).map_while(|handle| body.handle_report(handle));
        let work = reports.map(|report| {
            let power = report.reaction.force.dot(&report.linear_velocity)
                + report.reaction.moment.dot(&report.angular_velocity);
            power.abs() * h
        });
        let energy = elastic + body.kinetic_energy() + body.load_potential();
        self.follow(energy, work.sum())
    }

    /// Takes a step at the end of which the body has `energy` (J), after hands did work of the magnitude `work` (J).
    fn follow(&mut self, energy: f64, work: f64) -> Result<(), StepFault> {
        self.check()?;
        self.moved += work;
        let start = *self.start.get_or_insert(energy);
        let gained = energy - start;
        self.diverged = if !gained.is_finite() || !self.moved.is_finite() {
            Some(StepFault::NotFinite)
        } else if gained > MOST * self.moved + SLACK {
            Some(StepFault::Diverged {
                gained,
                work: self.moved,
            })
        } else {
            None
        };
        self.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_may_store_all_work_of_the_hands() {
        let mut balance = Balance::default();
        let mut energy = -2.0;
        for _ in 0..1000 {
            assert_eq!(balance.follow(energy, 0.01), Ok(()));
            energy += 0.01;
        }
    }

    #[test]
    fn the_work_of_contacts_counts_as_that_of_hands() {
        let mut balance = Balance::default();
        assert_eq!(balance.follow(0.0, 0.0), Ok(()));
        balance.push(-1.0);
        assert_eq!(balance.follow(1.0, 0.0), Ok(()));
        assert!(balance.follow(MOST + 2.0 * SLACK, 0.0).is_err());
    }

    #[test]
    fn energy_that_grows_without_work_is_a_fault_from_then_on() {
        let mut balance = Balance::default();
        let mut energy = 1.0;
        let mut found = Ok(());
        for _ in 0..20 {
            found = balance.follow(energy, 1e-6);
            if found.is_err() {
                break;
            }
            energy *= 1.5;
        }
        let Err(StepFault::Diverged { gained, work }) = found else {
            panic!("{found:?}");
        };
        assert!(gained < 1.0 && work < 1e-4, "{gained} J, {work} J");
        // The body stays as it is.
        assert_eq!(balance.follow(1.0, 0.0), found);
        assert_eq!(balance.check(), found);
    }

    #[test]
    fn a_state_that_is_not_finite_is_a_fault() {
        for bad in [f64::NAN, f64::INFINITY] {
            let mut balance = Balance::default();
            assert_eq!(balance.follow(1.0, 0.0), Ok(()));
            assert_eq!(balance.follow(bad, 0.0), Err(StepFault::NotFinite));
            assert_eq!(balance.follow(1.0, 0.0), Err(StepFault::NotFinite));
        }
    }
}
