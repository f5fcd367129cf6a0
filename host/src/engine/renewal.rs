//! A stepper for the topology that tears have made, in the background.
//!
//! A stepper serves a torn sheet with the factor of the sheet before: each vertex that a tear adds costs a few columns
//! beside the factor. After some vertices a factor of the new topology pays, with its own order of elimination and its
//! own pattern. Such a factor takes many times as long as a step. A thread therefore makes it in the background, on a
//! **mirror**: a copy of the body that makes the same edits. A tear may grow meanwhile. The new stepper then follows the
//! edits that it missed, and takes over the motion of the old one ([`Stepper::adopt`]).
//!
//! Pieces that leave the scene halt when the new stepper takes over, which has no unknowns for them.
//!
//! The mirror and its memory pass to the thread and back, so that neither the beginning nor the landing of a renewal
//! allocates.

use super::background::{Background, Lost, Work};
use super::stats::StepFault;
use physics::topology::Edit;
use physics::{Body, Stepper, StepperOptions, TearingError, Vec3};
use std::sync::Arc;

/// The work of one renewal, with the mirror.
pub(super) struct Renewal {
    mirror: Body,
    /// Number of edits that the mirror has made.
    known: usize,
    /// Edits that the mirror has still to make.
    edits: Vec<Edit>,
    /// Vertices that leave the scene.
    leaving: Vec<u32>,
    /// The present positions by node (m).
    x: Vec<Vec3>,
    options: StepperOptions,
    /// Length of a step (s).
    h: f64,
    /// The result; `None` before the work has ended.
    made: Option<Result<Stepper<f64>, StepFault>>,
    /// The stepper that was replaced, until the next work drops it.
    spent: Option<Stepper<f64>>,
}

impl Work for Box<Renewal> {
    const THREAD: &'static str = "topology";
    const TIME: f64 = 0.02;

    fn work(&mut self) {
        self.spent = None;
        self.made = Some(self.make());
    }
}

impl Renewal {
    fn make(&mut self) -> Result<Stepper<f64>, StepFault> {
        for edit in self.edits.drain(..) {
            // The body has made the same edit.
            let _ = self.mirror.edit(&edit);
        }
        self.mirror.leave(self.leaving.iter().copied());
        self.mirror.halt(&self.leaving);
        self.mirror.set_positions(&self.x)?;
        self.mirror.reassemble();
        let mut stepper = Stepper::new(&self.mirror, self.options)?;
        stepper.prepare(&self.mirror, self.h)?;
        Ok(stepper)
    }

    /// Lets the new stepper follow the edits after those that the mirror knows.
    fn catch_up(&mut self, stepper: &mut Stepper<f64>, journal: &[Edit]) -> Result<(), StepFault> {
        let newer = journal.get(self.known..).unwrap_or_default();
        catch_up(stepper, &mut self.mirror, newer)?;
        self.known += newer.len();
        Ok(())
    }
}

/// Makes `edits` on `body`, a copy of a body that has made them, and lets the stepper of the copy follow.
///
/// # Errors
/// [`TearingError`] for an edit that the copy cannot make. A stepper that cannot follow makes itself again in its next step.
pub(super) fn catch_up(
    stepper: &mut Stepper<f64>,
    body: &mut Body,
    edits: &[Edit],
) -> Result<(), TearingError> {
    for edit in edits {
        let done = body.edit(edit)?;
        let _ = stepper.grow(body, &done.surface);
    }
    if stepper.has_grown() {
        stepper.settle(body);
    }
    Ok(())
}

/// Renews the stepper of a body that tears.
pub(super) struct Renewals {
    background: Background<Box<Renewal>>,
    /// The value of the next renewal; `None` while one is under way, and after a renewal has failed.
    idle: Option<Box<Renewal>>,
}

impl Renewals {
    /// Renewals of the stepper of `body`, which has made the first of these numbers of edits, and has room for the second. Steps
    /// take `h` seconds.
    pub(super) fn new(
        body: &Body,
        stepper: &Stepper<f64>,
        real: bool,
        h: f64,
        (known, room_for): (usize, usize),
    ) -> Self {
        let room = body
            .surface()
            .map_or(0, |surface| surface.limits().vertices);
        Self {
            background: Background::new(real, h),
            idle: Some(Box::new(Renewal {
                mirror: body.copy_with_room(),
                known,
                edits: Vec::with_capacity(room_for),
                leaving: Vec::with_capacity(room),
                x: Vec::with_capacity(room),
                options: stepper.options,
                h,
                made: None,
                spent: None,
            })),
        }
    }

    /// Begins a renewal, if tears have added vertices or pieces leave, and no renewal is under way. `journal` has all edits
    /// so far.
    pub(super) fn begin(&mut self, body: &Body, stepper: &Stepper<f64>, journal: &[Edit]) {
        if !stepper.has_grown() && body.leaving().is_empty() {
            return;
        }
        let Some(mut renewal) = self.idle.take() else {
            return;
        };
        renewal.edits.extend(journal.iter().skip(renewal.known));
        renewal.known = journal.len();
        renewal.leaving.clear();
        renewal.leaving.extend_from_slice(body.leaving());
        renewal.x.clear();
        renewal.x.extend_from_slice(body.node_positions());
        self.background.begin(renewal);
    }

    /// Takes a stepper that has been made since the last call, and lets it take over the motion of `stepper`; the step took the
    /// time of `passed` steps. Returns whether it did. A renewal that failed leaves the old stepper in use.
    pub(super) fn land(
        &mut self,
        body: &mut Body,
        stepper: &mut Stepper<f64>,
        journal: &[Edit],
        passed: u32,
    ) -> Result<bool, Lost> {
        let Some(mut renewal) = self.background.done(passed)? else {
            return Ok(false);
        };
        let landed = match renewal.made.take() {
            Some(Ok(mut fresh)) => {
                fresh.team = Arc::clone(&stepper.team);
                let followed = renewal.catch_up(&mut fresh, journal).is_ok();
                if followed {
                    body.halt(&renewal.leaving);
                }
                followed && fresh.adopt(stepper, body).is_ok() && {
                    renewal.spent = Some(core::mem::replace(stepper, fresh));
                    true
                }
            }
            _ => false,
        };
        self.idle = Some(renewal);
        Ok(landed)
    }
}
