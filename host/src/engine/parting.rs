//! The pieces into which the tears of a body part its handles.
//!
//! A torn body stays one body with one local model. Each of its handles has the number of its **group**. Handles on the
//! same piece belong to one group. If a handle holds several pieces, the handles on all of them belong to one group. When an
//! edit parts two groups, the account of energy parts with them, and the mass of each group gives the weights of its handles.

use physics::topology::{NONE, Pieces};
use physics::{Body, PieceSums, Vec3};
use rt_core::{LocalModel, MAX_HANDLES};

/// Most pieces that are told apart. The pieces without hands come off anywhere, so there may be many.
const MOST_PIECES: usize = 64;

/// A piece without a hand has left the scene when its distance from all handles exceeds this number of diagonals of the
/// body at rest. No hand reaches that far from the rest of the body.
pub(crate) const FAR: f64 = 4.0;

/// The pieces of a body, and the groups of its handles.
pub(super) struct Parting {
    pieces: Pieces,
    /// Edits that may have parted the body, when the pieces were found.
    parted: u64,
    /// The group of each handle.
    group_of_handle: [u8; MAX_HANDLES],
    /// The group of each piece; `None` for a piece without a handle.
    group_of_piece: Vec<Option<u8>>,
    /// Number of groups.
    groups: usize,
    /// A vertex of each piece without a handle.
    loose: Vec<u32>,
    /// The distance from all handles at which a piece has left (m).
    far: f64,
    by_piece: Vec<PieceSums>,
    by_group: Vec<PieceSums>,
    /// The energies of the account before a parting (J).
    before: Vec<f64>,
}

impl Parting {
    /// The pieces of `body` after `parted` edits that may have parted it; `None` for a body that cannot tear.
    pub(super) fn new(body: &Body, parted: u64) -> Option<Self> {
        let mut parting = Self {
            pieces: Pieces::new(body.surface()?),
            parted,
            group_of_handle: [0; MAX_HANDLES],
            group_of_piece: Vec::with_capacity(MOST_PIECES),
            groups: 1,
            loose: Vec::with_capacity(MOST_PIECES),
            far: FAR * diagonal(body.rest_positions()),
            by_piece: Vec::with_capacity(MOST_PIECES),
            by_group: Vec::with_capacity(MAX_HANDLES),
            before: Vec::with_capacity(MAX_HANDLES),
        };
        parting.gather(body);
        Some(parting)
    }

    /// Finds the pieces again if `parted`, the number of edits that may have parted the body, has grown. Returns, if
    /// the handles have new groups, the old group of each new group.
    pub(super) fn follow(&mut self, body: &Body, parted: u64) -> Option<[u8; MAX_HANDLES]> {
        if parted == self.parted {
            return None;
        }
        self.parted = parted;
        self.pieces.find(body.surface()?);
        let old = self.group_of_handle;
        let count = self.groups;
        self.gather(body);
        if self.groups == count {
            return None;
        }
        let mut from = [0; MAX_HANDLES];
        for (&new, old) in self
            .group_of_handle
            .iter()
            .zip(old)
            .take(body.handle_count())
        {
            from[usize::from(new)] = old;
        }
        Some(from)
    }

    /// Number of groups.
    pub(super) fn groups(&self) -> usize {
        self.groups
    }

    /// The pieces.
    pub(super) fn pieces(&self) -> &Pieces {
        &self.pieces
    }

    /// Finds the groups of the handles. The groups are numbered by their first handles.
    fn gather(&mut self, body: &Body) {
        let count = body.handle_count().min(MAX_HANDLES);
        self.group_of_piece.clear();
        let pieces = self.pieces.count().min(MOST_PIECES);
        self.group_of_piece.resize(pieces, None);
        self.groups = 0;
        for handle in 0..count {
            let held = || {
                let all = body.pieces_of_handle(handle, &self.pieces);
                all.filter(|&piece| piece != NONE && (piece as usize) < pieces)
            };
            let known = held().find_map(|piece| self.group_of_piece[piece as usize]);
            let group = known.unwrap_or(self.groups as u8);
            for piece in body.pieces_of_handle(handle, &self.pieces) {
                if let Some(entry) = self.group_of_piece.get_mut(piece as usize) {
                    *entry = Some(group);
                }
            }
            self.group_of_handle[handle] = group;
            self.groups = self.groups.max(usize::from(group) + 1);
        }
        self.groups = self.groups.max(1);
        self.loose.clear();
        for (piece, group) in (0_u32..).zip(&self.group_of_piece) {
            if group.is_none() && count > 0 {
                let mut vertices = self.pieces.vertices(piece);
                self.loose.extend(vertices.next());
            }
        }
        self.by_piece.clear();
        self.by_piece.resize(pieces, PieceSums::default());
    }

    /// Lets the pieces leave that no hand holds and that are far from all hands.
    pub(super) fn dismiss(&mut self, body: &mut Body) {
        let Self {
            pieces, loose, far, ..
        } = self;
        loose.retain(|&vertex| {
            let x = body.node_positions()[vertex as usize];
            let mut handles = (0..).map_while(|handle| body.handle_report(handle));
            let is_far = handles.all(|report| (report.pose.position - x).norm() > *far);
            // A piece on a support stays.
            !(is_far && body.leave(pieces.vertices(pieces.of_vertex(vertex))))
        });
    }

    /// Computes the sums over each group.
    pub(super) fn sum(&mut self, body: &Body) -> &[PieceSums] {
        body.sums_of_pieces(&self.pieces, &mut self.by_piece);
        self.by_group.clear();
        self.by_group.resize(self.groups, PieceSums::default());
        for (sums, group) in self.by_piece.iter().zip(&self.group_of_piece) {
            if let Some(total) = group.and_then(|group| self.by_group.get_mut(usize::from(group))) {
                total.mass += sums.mass;
                total.elastic += sums.elastic;
                total.potential += sums.potential;
            }
        }
        &self.by_group
    }

    /// The sums that were computed last, and room for the energies of an account.
    pub(super) fn latest(&mut self) -> (&[PieceSums], &mut Vec<f64>) {
        (&self.by_group, &mut self.before)
    }

    /// Gives the handles of `model` their groups.
    pub(super) fn number(&self, model: &mut LocalModel) {
        let handles = &mut model.handles[..usize::from(model.head.handle_count)];
        for (handle, &group) in handles.iter_mut().zip(&self.group_of_handle) {
            handle.piece = group;
        }
    }

    /// Gives the handles of `model` their groups and, if no support bears a part of the body, the weights of their
    /// groups: those of before, scaled so that they add up to the weight of the group.
    pub(super) fn name(&self, body: &Body, model: &mut LocalModel) {
        self.number(model);
        let handles = &mut model.handles[..usize::from(model.head.handle_count)];
        if body.support_count() > 0 {
            return;
        }
        let gravity = body.config().gravity;
        let size = gravity.norm();
        let Some(down) = gravity.try_normalize(0.0) else {
            return;
        };
        for (group, sums) in (0_u8..).zip(&self.by_group) {
            let on = |piece: u8| piece == group;
            let whole = size * sums.mass;
            let projected: f64 = handles
                .iter()
                .filter(|h| on(h.piece))
                .map(|h| h.weight.dot(&down))
                .sum();
            let holders = handles.iter().filter(|h| on(h.piece)).count().max(1) as f64;
            for handle in handles.iter_mut().filter(|h| on(h.piece)) {
                let share = if projected > 0.0 {
                    handle.weight.dot(&down) / projected
                } else {
                    1.0 / holders
                };
                handle.weight = down * (whole * share);
            }
        }
    }
}

/// The diagonal of the box around positions (m).
fn diagonal(positions: &[Vec3]) -> f64 {
    let far = |pick: fn(f64, f64) -> f64, start: f64| {
        let start = Vec3::repeat(start);
        positions.iter().fold(start, |a, b| a.zip_map(b, pick))
    };
    (far(f64::max, f64::NEG_INFINITY) - far(f64::min, f64::INFINITY)).norm()
}
