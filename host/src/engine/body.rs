//! One body in the host's loop: its hands, its step, and what it publishes.

mod landing;

use super::background::Background;
use super::change::Rebuild;
use super::contact::Contact;
use super::hands::{Hands, Joining};
use super::publisher::{Publisher, reference_of};
use super::stats::{StepFault, Stopwatch, Tally};
use super::stepping::Stepping;
use super::tears::BodyTears;
use physics::{Around, Beside, Body, BodyError};
use rt_core::{LocalModel, Pose, TickRecord};

/// A body with its hands, its solver and its publisher.
pub struct HostBody {
    name: String,
    solved: String,
    hands: Hands,
    pub(super) stepping: Stepping,
    publisher: Publisher,
    /// The fault of the present stage.
    pub(super) fault: Option<StepFault>,
    /// Whether the present step has been taken.
    has_stepped: bool,
    /// Whether the present step publishes.
    publishes: bool,
    /// Makes the solvers of changes; `None` before the first change.
    background: Option<Background<Box<Rebuild>>>,
    /// The hands that join with the change that is under way.
    joining: Option<Vec<Joining>>,
}

impl HostBody {
    /// A body of this name that has published no model. `solved` says how it is solved and why so, for people.
    pub(super) fn new(
        (name, solved): (String, String),
        hands: Hands,
        stepping: Stepping,
        publisher: Publisher,
    ) -> Self {
        Self {
            name,
            solved,
            hands,
            stepping,
            publisher,
            fault: None,
            has_stepped: false,
            publishes: false,
            background: None,
            joining: None,
        }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How it is solved and why so, for people.
    pub fn solved(&self) -> &str {
        &self.solved
    }

    /// The physics.
    pub fn body(&self) -> &Body {
        &self.stepping.body
    }

    /// The device of each hand on the body, and the pose of its handle.
    pub(super) fn hands(&self) -> impl Iterator<Item = (usize, Pose)> {
        let devices = self.publisher.devices().enumerate();
        devices.filter_map(|(handle, device)| {
            let report = self.body().handle_report(handle)?;
            Some((usize::from(device), reference_of(device, report).pose))
        })
    }

    /// Gives the body the physics and the solver of `other` from now on. Its hands, paths and sequence of models
    /// continue. A change that is under way is dropped, because it is a change of the old physics.
    ///
    /// # Errors
    /// [`BodyError`] if the two bodies are not of the same mesh. Nothing is changed in this case.
    pub fn exchange(&mut self, other: Self) -> Result<(), BodyError> {
        let before = self.stepping.exchange(other.stepping)?;
        self.publisher.exchange(&before, &self.stepping.body);
        (self.background, self.joining) = (None, None);
        Ok(())
    }

    /// Takes one tick's record.
    pub fn follow(&mut self, record: &TickRecord) {
        self.hands.follow(record);
        for hand in self.joining.iter_mut().flatten() {
            hand.path.follow(record);
        }
    }

    /// Whether the body would sleep in a step to the poses that its hands have now.
    pub(super) fn rests(&self) -> bool {
        let stepping = &self.stepping;
        stepping.solver.rests(&stepping.body, &self.hands.targets)
    }

    /// Begins a step towards the poses of the hands at the end of the step.
    pub(super) fn predict(&mut self, watch: &dyn Stopwatch) -> Result<(), StepFault> {
        self.publishes = false;
        self.hands.aim(&self.stepping.body, &self.publisher);
        self.stepping.predict(watch)
    }

    /// Sets up the step's equation. Does nothing if an earlier stage of the step failed.
    pub(super) fn constrain(&mut self, watch: &dyn Stopwatch) -> Result<(), StepFault> {
        self.stepping.constrain(&self.hands.targets, watch)
    }

    /// Solves the step's equation. Does nothing if an earlier stage of the step failed.
    pub(super) fn solve(&mut self, watch: &dyn Stopwatch) -> Result<(), StepFault> {
        self.stepping.solve(watch)
    }

    /// Takes the step, and makes the model to publish, if one is due. Does nothing if an earlier stage of the step
    /// failed.
    pub(super) fn finish(
        &mut self,
        publishes: bool,
        watch: &dyn Stopwatch,
    ) -> Result<(), StepFault> {
        self.end(None, watch)?;
        if publishes {
            self.publish(None, watch)?;
        }
        Ok(())
    }

    /// Takes the step. Does nothing if an earlier stage of the step failed. `contact` holds the contacts of the engine, and the
    /// number of this body in them.
    pub(super) fn end(
        &mut self,
        contact: Option<(&Contact, usize)>,
        watch: &dyn Stopwatch,
    ) -> Result<(), StepFault> {
        self.has_stepped = false;
        self.has_stepped = (self.stepping).finish(&mut self.publisher, contact, watch)?;
        Ok(())
    }

    /// Takes from the step what the model needs, before the models of other bodies are made.
    pub(super) fn see(&mut self) -> Result<(), StepFault> {
        if self.has_stepped && self.publisher.devices().next().is_some() {
            self.stepping.see()?;
        }
        Ok(())
    }

    /// Makes the model of a body that has taken its step, with what it touches, if a hand holds it.
    pub(super) fn publish(
        &mut self,
        around: Option<&mut Around<'_, f64>>,
        watch: &dyn Stopwatch,
    ) -> Result<(), StepFault> {
        let solved = watch.now_ns();
        if let Some(time_ns) = self.hands.reached_ns()
            && self.has_stepped
            && self.publisher.is_due(time_ns)
        {
            self.stepping
                .publish(&mut self.publisher, time_ns, around)?;
            self.publishes = true;
            self.stepping.tally.condense = Some(watch.now_ns().saturating_sub(solved));
        }
        Ok(())
    }

    /// The body with its stepper, for the model of a body that it touches; `None` if its step failed.
    pub(super) fn beside(&mut self) -> Option<Beside<'_, f64>> {
        self.has_stepped.then(|| Beside {
            body: &self.stepping.body,
            stepper: self.stepping.solver.stepper(),
        })
    }

    /// What it publishes.
    pub fn publisher(&self) -> &Publisher {
        &self.publisher
    }

    /// Notes the work that contacts with other bodies did on the body in a step (J).
    pub(super) fn receive(&mut self, work: f64) {
        self.publisher.receive(work);
    }

    /// Reads ahead what a later step will need.
    pub(super) fn read_ahead(&mut self) {
        self.stepping.solver.read_ahead();
    }

    /// The counts and times of the present step.
    pub(crate) fn tally(&self) -> &Tally {
        &self.stepping.tally
    }

    /// The model that the present step publishes, if one is due.
    pub(super) fn published(&self) -> Option<&LocalModel> {
        self.publishes.then(|| self.publisher.model())
    }

    /// Number of pieces of a torn body that sleep while the body is awake.
    pub fn pieces_asleep(&self) -> usize {
        self.stepping.solver.pieces_asleep()
    }

    /// The tears of the body; `None` for a body that does not tear.
    pub fn tears(&self) -> Option<&BodyTears> {
        self.stepping.tears.as_ref()
    }
}
