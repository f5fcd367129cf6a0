//! Pieces of a torn sheet that lie still are not moved.
//!
//! A piece sleeps by the measure of a whole body: none of its vertices has exceeded a given speed for [`STEPS`] steps in a row. It
//! wakes when something that it may touch moves, when anything is set from outside, and when an edit changes it. A hand or a support
//! keeps its pieces awake. So does a pair of vertices that let each other go, for the factor's columns of pairs hold for one set of
//! awake nodes.
//!
//! From `constrain` to `finish` of a step, all axes of a piece that sleeps are guided, as a support guides them, and it moves by
//! nothing. Between the steps it is free: factors and local models see no piece that sleeps.

use super::STEPS;
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::lanes::{Node, to_node};
use crate::motion::stepper::Places;
use crate::topology::Pieces;

/// Most pieces that may sleep.
const MOST: usize = 64;

/// The pieces of a sheet that may touch something.
#[derive(Clone, Debug)]
pub(crate) struct SleepingPieces {
    pieces: Pieces,
    rests: Vec<Rest>,
    /// The rests before the last edit.
    before: Vec<Rest>,
    /// Whether an edit has changed the pieces.
    is_due: bool,
    /// The revision of the body's state, and the length of the step (s).
    revision: u64,
    h: f64,
}

/// The rest of a piece.
#[derive(Clone, Copy, Debug, Default)]
struct Rest {
    /// The first vertex, and the number of vertices. An edit of the piece changes one of them.
    first: u32,
    count: u32,
    /// Steps in a row without motion.
    still: u32,
    /// Whether no hand or support has a vertex.
    is_loose: bool,
    /// Whether something that may touch it moves.
    is_stirred: bool,
    sleeps: bool,
}

impl Rest {
    fn is_still(&self) -> bool {
        self.still >= STEPS
    }
}

impl SleepingPieces {
    /// The pieces of a body with hands or supports; `None` for another body, and for one that cannot tear. A body without
    /// either drifts as a whole.
    pub(super) fn new(body: &Body) -> Option<Self> {
        let is_bound = body.handle_count() + body.support_count() > 0;
        let surface = body.surface().filter(|_| is_bound)?;
        Some(Self {
            pieces: Pieces::new(surface),
            rests: Vec::with_capacity(MOST),
            before: Vec::with_capacity(MOST),
            is_due: true,
            revision: body.state.revision,
            h: 0.0,
        })
    }

    /// Notes an edit of the body. A body in one piece stays so unless the edit `parted` it.
    pub(super) fn note_edit(&mut self, body: &Body, parted: bool) {
        self.is_due |= parted || self.pieces.count() > 1;
        // Nothing else was set meanwhile.
        self.revision += u64::from(self.revision + 1 == body.state.revision);
    }

    /// Takes over the rest of pieces that an edit has not changed.
    fn follow(&mut self, body: &Body) {
        let Some(surface) = body.surface() else {
            return;
        };
        self.is_due = false;
        self.pieces.find(surface);
        core::mem::swap(&mut self.rests, &mut self.before);
        self.rests.clear();
        self.rests
            .resize(self.pieces.count().min(MOST), Rest::default());
        for vertex in 0..surface.vertex_count() as u32 {
            let piece = self.pieces.of_vertex(vertex) as usize;
            if let Some(rest) = self.rests.get_mut(piece) {
                if rest.count == 0 {
                    (rest.first, rest.is_loose) = (vertex, true);
                }
                rest.count += 1;
                let (held, supports) = (body.constraints.holds(vertex), &body.constraints.supports);
                rest.is_loose &= !held && supports.owner_of(vertex).is_none();
            }
        }
        for handle in 0..body.handle_count() {
            for piece in body.pieces_of_handle(handle, &self.pieces) {
                if let Some(rest) = self.rests.get_mut(piece as usize) {
                    rest.is_loose = false;
                }
            }
        }
        for rest in &mut self.rests {
            let same = |old: &&Rest| (old.first, old.count) == (rest.first, rest.count);
            rest.still = self.before.iter().find(same).map_or(0, |old| old.still);
        }
    }

    /// Finds the pieces that sleep in a step of `h` seconds, and guides their vertices; none if `is_awake`.
    pub(super) fn lay<T: Precision>(
        &mut self,
        body: &mut Body,
        h: f64,
        is_awake: bool,
        places: &mut Places<T>,
    ) {
        if self.is_due {
            self.follow(body);
        }
        if !self.are_several() {
            return;
        }
        if (self.revision, self.h) != (body.state.revision, h) {
            (self.revision, self.h) = (body.state.revision, h);
            self.wake();
        }
        for rest in &mut self.rests {
            rest.sleeps = rest.is_still() && rest.is_loose && !rest.is_stirred && !is_awake;
            rest.is_stirred = false;
        }
        if !self.rests.iter().any(|rest| rest.sleeps) {
            return;
        }
        if places.mask.is_empty() {
            (places.mask).resize(places.held, to_node(&Vec3::repeat(1.0)));
        }
        for vertex in 0..body.vertex_count() as u32 {
            if self.has_asleep(vertex) {
                let node = vertex as usize;
                body.state.v[node] = Vec3::zeros();
                body.state.displacement[node] = Vec3::zeros();
                places.mask[places.of[node] as usize] = [T::ZERO; 4];
            }
        }
    }

    /// Records a step.
    pub(super) fn observe(&mut self, body: &Body, speed: f64) {
        for rest in &mut self.rests {
            rest.still = rest.still.saturating_add(1);
        }
        for (vertex, v) in (0..body.vertex_count() as u32).zip(&body.state.v) {
            let piece = self.pieces.of_vertex(vertex) as usize;
            if v.norm_squared() > speed * speed
                && let Some(rest) = self.rests.get_mut(piece)
            {
                rest.still = 0;
            }
        }
    }

    /// Whether there are several.
    pub(super) fn are_several(&self) -> bool {
        self.rests.len() > 1
    }

    /// Whether a vertex belongs to a piece that lies still; `None` for a body in one piece.
    pub(super) fn is_still(&self, vertex: u32) -> Option<bool> {
        let piece = self.pieces.of_vertex(vertex) as usize;
        self.are_several()
            .then(|| self.rests.get(piece).is_some_and(Rest::is_still))
    }

    /// Whether a vertex belongs to a piece that sleeps.
    pub(super) fn has_asleep(&self, vertex: u32) -> bool {
        let piece = self.pieces.of_vertex(vertex) as usize;
        self.rests.get(piece).is_some_and(|rest| rest.sleeps)
    }

    /// Number of pieces that sleep.
    pub(super) fn asleep(&self) -> usize {
        self.rests.iter().filter(|rest| rest.sleeps).count()
    }

    /// Wakes the piece of a vertex in the present step, because something that it may touch moves.
    pub(super) fn stir<T: Precision>(&mut self, vertex: u32, places: &mut Places<T>) {
        let number = self.pieces.of_vertex(vertex);
        let Some(rest) = self.rests.get_mut(number as usize) else {
            return;
        };
        rest.is_stirred = true;
        if core::mem::take(&mut rest.sleeps) {
            let free: Node<T> = to_node(&Vec3::repeat(1.0));
            for vertex in self.pieces.vertices(number) {
                places.mask[places.of[vertex as usize] as usize] = free;
            }
        }
    }

    /// Wakes all pieces.
    pub(super) fn wake(&mut self) {
        for rest in &mut self.rests {
            (rest.still, rest.sleeps) = (0, false);
        }
    }
}
