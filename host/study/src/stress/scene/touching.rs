//! The contacts of the bodies of a reference, as in the host: with each other, with themselves and with obstacles.

use crate::StudyError;
use host::world::World;
use physics::motion::contacts::{Contacts, Member};
use physics::{Body, Stepper};

/// A body with its stepper.
pub(super) type Stepped<'a> = (&'a mut Body, &'a mut Stepper<f64>);

/// The contacts of a scene's bodies.
pub(super) struct Touching {
    contacts: Contacts,
    /// The topology epoch of each body whose surface there is.
    epochs: Vec<u64>,
    /// Where the obstacles are (s).
    time: f64,
}

impl Touching {
    /// The contacts of the scene's bodies, which may have torn, with obstacles where they are at a `time` (s); `None` if
    /// nothing touches.
    pub(super) fn new(
        world: &World<'_>,
        bodies: &[&Body],
        time: f64,
    ) -> Result<Option<Self>, StudyError> {
        if world.contacts.is_empty() {
            return Ok(None);
        }
        let starts = (0..bodies.len()).map(|index| world.start(index).epoch());
        let mut found = Self {
            contacts: world.touching(bodies)?,
            epochs: starts.collect(),
            time,
        };
        found.follow(bodies)?;
        Ok(Some(found))
    }

    /// Follows bodies that have torn.
    pub(super) fn follow(&mut self, bodies: &[&Body]) -> Result<(), StudyError> {
        for (number, (body, epoch)) in bodies.iter().zip(&mut self.epochs).enumerate() {
            if *epoch != body.epoch()
                && let Some(mesh) = body.mesh()
            {
                self.contacts.follow(number, body, mesh, None)?;
                *epoch = body.epoch();
            }
        }
        Ok(())
    }

    /// Solves and certifies a step of `h` (s) of bodies that have been constrained. The obstacles move for `moves` (s).
    pub(super) fn solve(
        &mut self,
        bodies: &mut [Stepped<'_>],
        h: f64,
        moves: f64,
    ) -> Result<(), StudyError> {
        let each = bodies.iter_mut().map(|(body, stepper)| Member {
            body,
            stepper: Some(stepper),
        });
        let mut members: Vec<Member<'_, f64>> = each.collect();
        let end = self.time + moves;
        self.contacts.begin(&members, [self.time, end], h);
        self.time = end;
        self.contacts.solve(&mut members, &mut |_| false);
        for member in &mut members {
            if let Some(stepper) = member.stepper.as_deref_mut()
                && !stepper.is_solved()
            {
                stepper.solve(|| false)?;
            }
        }
        self.contacts.certify(&mut members);
        Ok(())
    }
}
