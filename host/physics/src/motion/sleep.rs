//! Bodies at rest are not stepped.
//!
//! A body falls asleep when none of its vertices has exceeded a given speed for [`STEPS`] steps in a row. The
//! acceleration over those steps then stays below that speed divided by their duration, so the unbalanced forces are
//! below the mass times that acceleration. A creep with time constant `tau` has less than `speed tau` to go. The body
//! stays exactly where it is until a hand moves further than the speed allows, or anything is set from outside.
//! The [`pieces`] of a torn sheet sleep alone.

mod pieces;

use super::stepper::Places;
use crate::Vec3;
use crate::body::Body;
use crate::body::handle::HandlePose;
use crate::element::precision::Precision;
use pieces::SleepingPieces;

/// Number of steps in a row without motion after which a body sleeps.
pub(crate) const STEPS: u32 = 20;

/// Whether a body sleeps.
#[derive(Clone, Debug)]
pub(crate) struct Sleep {
    still: u32,
    /// Whether something that the body touches moves, or did so in the last step.
    is_kept_awake: bool,
    was_kept_awake: bool,
    /// The poses of the handles when the body fell asleep, and the revision of its state then.
    poses: Vec<HandlePose>,
    revision: u64,
    h: f64,
    /// `None` for a body whose pieces do not sleep alone.
    pieces: Option<Box<SleepingPieces>>,
}

impl Sleep {
    /// `by_pieces`: the pieces of a sheet that tears sleep alone.
    pub(crate) fn new(body: &Body, by_pieces: bool) -> Self {
        Self {
            still: 0,
            is_kept_awake: false,
            was_kept_awake: false,
            poses: body
                .constraints
                .handles
                .iter()
                .map(|h| h.report.pose)
                .collect(),
            revision: 0,
            h: 0.0,
            pieces: by_pieces
                .then(|| SleepingPieces::new(body).map(Box::new))
                .flatten(),
        }
    }

    /// Whether a sleeping body continues to sleep: a step of `h` to `targets` would not move it.
    pub(crate) fn goes_on(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
        speed: f64,
    ) -> bool {
        let goes_on = !self.is_kept_awake && self.would_go_on(body, h, targets, speed);
        if goes_on && self.was_kept_awake {
            stop(body);
        }
        self.was_kept_awake = self.is_kept_awake;
        goes_on
    }

    /// Whether a body that is not kept awake would continue to sleep.
    pub(crate) fn would_go_on(
        &self,
        body: &Body,
        h: f64,
        targets: &[HandlePose],
        speed: f64,
    ) -> bool {
        // Rotations act at the arm of the handle's vertices, which is about the size of a body and at most a metre.
        let near = |(now, then): (&HandlePose, &HandlePose)| {
            (now.position - then.position).norm() <= speed * h
                && now.rotation.angle_to(&then.rotation) <= speed * h
        };
        self.still >= STEPS
            && self.revision == body.state.revision
            && self.h == h
            && targets.iter().zip(&self.poses).all(near)
    }

    /// Records a step, and puts the body to sleep after [`STEPS`] steps without motion.
    pub(crate) fn observe(&mut self, body: &mut Body, h: f64, targets: &[HandlePose], speed: f64) {
        let fastest = body
            .state
            .v
            .iter()
            .map(Vec3::norm_squared)
            .fold(0.0, f64::max);
        let still = fastest <= speed * speed;
        self.still = if still { self.still + 1 } else { 0 };
        if self.still >= STEPS {
            if !self.is_kept_awake {
                stop(body);
            }
            self.poses.copy_from_slice(targets);
            self.revision = body.state.revision;
            self.h = h;
        }
    }

    /// Keeps the body awake, or lets it sleep again.
    pub(crate) fn keep_awake(&mut self, is_kept: bool) {
        self.is_kept_awake = is_kept;
    }

    /// Wakes the body, because something has moved it.
    pub(crate) fn wake(&mut self) {
        self.still = 0;
    }

    /// Wakes all pieces.
    pub(crate) fn wake_pieces(&mut self) {
        if let Some(pieces) = &mut self.pieces {
            pieces.wake();
        }
    }

    /// Notes an edit of the body, which may have `parted` it.
    pub(crate) fn note_edit(&mut self, body: &Body, parted: bool) {
        self.wake();
        if let Some(pieces) = &mut self.pieces {
            pieces.note_edit(body, parted);
        }
    }

    /// Guides the vertices of the pieces that sleep in a step of `h` seconds; of none if `is_awake`.
    pub(crate) fn lay<T: Precision>(
        &mut self,
        body: &mut Body,
        h: f64,
        is_awake: bool,
        places: &mut Places<T>,
    ) {
        if let Some(pieces) = &mut self.pieces {
            pieces.lay(body, h, is_awake, places);
        }
    }

    /// Lets the vertices of pieces go.
    pub(crate) fn lift<T: Precision>(&self, body: &Body, places: &mut Places<T>) {
        if self
            .pieces
            .as_ref()
            .is_some_and(|pieces| pieces.are_several())
        {
            places.guide(body);
        }
    }

    /// Records a step for the pieces.
    pub(crate) fn observe_pieces(&mut self, body: &Body, speed: f64) {
        if let Some(pieces) = &mut self.pieces {
            pieces.observe(body, speed);
        }
    }

    /// Whether a node lies still, with its piece or the body.
    pub(crate) fn is_still(&self, node: u32) -> bool {
        let of_piece = self
            .pieces
            .as_ref()
            .and_then(|pieces| pieces.is_still(node));
        of_piece.unwrap_or(self.still >= STEPS)
    }

    /// Whether a node belongs to a piece that sleeps.
    pub(crate) fn has_asleep(&self, node: u32) -> bool {
        let pieces = self.pieces.as_ref();
        pieces.is_some_and(|pieces| pieces.has_asleep(node))
    }

    /// Number of pieces that sleep.
    pub(crate) fn pieces_asleep(&self) -> usize {
        self.pieces.as_ref().map_or(0, |pieces| pieces.asleep())
    }

    /// Wakes the piece of a node in the present step.
    pub(crate) fn stir<T: Precision>(&mut self, node: u32, places: &mut Places<T>) {
        if let Some(pieces) = &mut self.pieces {
            pieces.stir(node, places);
        }
    }
}

/// Takes the velocities from a body that falls asleep.
fn stop(body: &mut Body) {
    body.state.v.fill(Vec3::zeros());
    for handle in &mut body.constraints.handles {
        handle.report.linear_velocity = Vec3::zeros();
        handle.report.angular_velocity = Vec3::zeros();
    }
}
