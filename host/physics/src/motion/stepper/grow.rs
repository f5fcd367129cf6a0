//! A stepper follows the edits of a sheet that tears, in place.
//!
//! An edit changes a few triangles and adds a few vertices. The stepper takes the vertices at places that it has kept
//! free, lets the elements follow, and carries the state over: a new vertex takes that of its twin, or of the ends of the
//! edge that it divides. Nothing is allocated. The factor stays; [`TornFactor`] joins the new vertices to it.
//!
//! A factor of the new topology, with its order and pattern, is another stepper, made on a copy of the body on another
//! core. The copy and the new stepper repeat the edits made meanwhile. Then the new stepper [adopts](Stepper::adopt) the
//! motion.
//!
//! [`TornFactor`]: crate::linear::torn::TornFactor

use super::Stepper;
use super::turns::Turns;
use crate::body::Body;
use crate::element;
use crate::element::parts::Divided;
use crate::element::precision::Precision;
use crate::error::StepError;
use crate::lanes::Node;
use crate::linear::torn::{Tie, TornFactor};
use crate::topology::{Done, NONE, Origin, Reserve, Surface};
use std::sync::Arc;

/// New vertices with columns beside the factor. Columns of more vertices would take longer than a new factor is late.
const MOST_COLUMNS: usize = 64;

/// The vertices that tears have added since the factor was made.
#[derive(Debug)]
pub(super) struct Growth<T> {
    factor: TornFactor,
    /// Number of places of the factor.
    first: usize,
    /// Displacement of each place at the state of the factor (m).
    pub(super) state: Vec<Node<T>>,
    /// Triangles that have a part in the rows that have changed.
    near: Vec<u32>,
    /// The rotations since that state.
    pub(super) turns: Turns,
    /// Whether the elements have followed an edit since they were linearized.
    is_due: bool,
}

/// The vertices and triangles that edits may still add to `body`.
pub(super) fn spare(body: &Body) -> Reserve {
    body.surface().map_or_else(Reserve::default, |surface| {
        let limits = surface.limits();
        Reserve {
            vertices: limits.vertices - surface.vertex_count(),
            triangles: limits.triangles - surface.triangle_count(),
        }
    })
}

impl<T: Precision> Growth<T> {
    /// Room for `spare` vertices and triangles beside a factor of `first` places; there are `places` in all. `None` for
    /// a body that cannot tear.
    pub(super) fn new(
        body: &Body,
        first: usize,
        spare: Reserve,
        places: usize,
    ) -> Option<Box<Self>> {
        let surface = body.surface()?;
        Some(Box::new(Self {
            factor: TornFactor::new(first, spare.vertices, MOST_COLUMNS),
            first,
            state: vec![[T::ZERO; 4]; places],
            near: Vec::with_capacity(surface.limits().triangles),
            turns: Turns::new(places),
            is_due: false,
        }))
    }

    /// Whether there are vertices that the factor lacks.
    pub(super) fn has_grown(&self) -> bool {
        self.factor.count() > 0
    }

    /// Takes the displacements (m) at which a factor was made.
    pub(super) fn take_state(&mut self, d: &[Node<T>]) {
        self.state.copy_from_slice(d);
        self.turns.note_change();
    }

    /// [`take_state`](Self::take_state), from the displacements of free places and those of held places.
    pub(super) fn take_loaded(&mut self, d: &[Node<T>], free: usize, held: usize) {
        self.state[..free].copy_from_slice(&d[..free]);
        self.state[held..].copy_from_slice(&d[free..]);
        self.turns.note_change();
    }

    /// Applies the preconditioner in place; `solve` solves with the factor.
    pub(super) fn apply(
        &mut self,
        z: &mut [Node<f32>],
        mask: &[Node<T>],
        solve: impl FnOnce(&mut [Node<f32>]),
    ) {
        self.turns.back(z);
        if self.has_grown() {
            self.factor.apply(z, mask, solve);
        } else {
            solve(z);
        }
        self.turns.forth(z);
    }

    /// Whether the factor alone is the preconditioner.
    pub(super) fn is_plain(&self) -> bool {
        !self.has_grown() && !self.turns.in_use()
    }

    /// Empties the rows of the new vertices that the latest edit may have changed: those of the touched triangles, and
    /// of the triangles beside them, with which they bend. The columns of earlier vertices are kept unless vertices have
    /// `moved` at rest.
    fn begin_rows(&mut self, surface: &Surface, place: &[u32], moved: bool) {
        for &triangle in surface.touched() {
            let beside = surface.neighbours()[triangle as usize];
            for triangle in beside.into_iter().chain([triangle]) {
                if triangle == NONE {
                    continue;
                }
                for vertex in surface.triangles()[triangle as usize] {
                    let place = place[vertex as usize] as usize;
                    match place.checked_sub(self.first) {
                        Some(node) if moved => self.factor.begin(node),
                        Some(node) => self.factor.renew(node),
                        None => {}
                    }
                }
            }
        }
    }

    /// Lists the triangles that have a part in the rows that have changed. `node` is the vertex at each place.
    fn find_near(&mut self, surface: &Surface, node: &[u32]) {
        self.near.clear();
        for place in self.first..self.first + self.factor.count() {
            if !self.factor.takes(place) {
                continue;
            }
            for corner in surface.fan(node[place]) {
                let beside = surface.neighbours()[corner.triangle as usize];
                for triangle in beside.into_iter().chain([corner.triangle]) {
                    if triangle != NONE
                        && let Err(at) = self.near.binary_search(&triangle)
                    {
                        self.near.insert(at, triangle);
                    }
                }
            }
        }
    }
}

/// The sum of the values at `from` by their weights.
fn mixed<T: Precision, const N: usize>(values: &[Node<T>], from: &[(usize, T); N]) -> Node<T> {
    let mut sum = [T::ZERO; 4];
    for &(at, weight) in from {
        for i in 0..4 {
            sum[i] += weight * values[at][i];
        }
    }
    sum
}

impl<T: Precision> Stepper<T> {
    /// Whether tears have added vertices that the factor lacks.
    pub fn has_grown(&self) -> bool {
        self.growth
            .as_ref()
            .is_some_and(|growth| growth.has_grown())
    }

    /// Number of vertices that tears have added since the factor was made.
    pub fn grown(&self) -> usize {
        self.growth
            .as_ref()
            .map_or(0, |growth| growth.factor.count())
    }

    /// Whether a factor of the present topology would pay: see [`adopt`](Self::adopt).
    pub fn wants_factor(&self) -> bool {
        self.has_grown() && (self.factor.stale || 2 * self.grown() > MOST_COLUMNS)
    }

    /// Follows the latest edit of `body`. After the last of several edits, [`settle`](Self::settle) computes forces and
    /// tangent.
    ///
    /// # Errors
    ///
    /// [`StepError::Order`] for a stepper without a [factor](Self::prepare), and for one that has not followed all earlier
    /// edits. The stepper then makes itself again in its next step.
    #[inline(never)]
    pub fn grow(&mut self, body: &Body, done: &Done) -> Result<(), StepError> {
        let fail = |first| {
            Err(StepError::Order {
                call: "grow",
                first,
            })
        };
        if self.factor.factors.is_none() {
            return fail("prepare");
        }
        let (Some(surface), Some(mut growth)) = (body.surface(), self.growth.take()) else {
            return fail("make_tearable");
        };
        let count = done.vertices.len();
        let is_next = self.places.of.len() == done.vertices.start as usize
            && surface.vertex_count() == done.vertices.end as usize
            && self.places.free + count <= self.places.held
            && self.epoch + 1 == body.epoch();
        if !is_next {
            self.growth = Some(growth);
            return fail("grow");
        }
        self.present.underway = None;
        self.epoch = body.epoch();
        self.sleep.note_edit(body, done.parted);
        self.last.stepped = None;
        for moved in done.moved.iter().flatten() {
            let weight = |i: usize| {
                let place = self.places.of[moved.corners[i] as usize] as usize;
                (place, T::of(moved.weights[i]))
            };
            let place = self.places.of[moved.vertex as usize] as usize;
            self.mix(&mut growth, place, &[weight(0), weight(1), weight(2)]);
            self.elements.at[moved.vertex as usize] = body.state.x[moved.vertex as usize];
            self.places.rest[place] = body.model.rest[moved.vertex as usize];
        }
        let mask = body.constraints.supports.mask();
        for vertex in done.vertices.clone() {
            let tie = self.tie(surface.origin(vertex));
            let (node, place) = (vertex as usize, self.places.free);
            self.places.free += 1;
            self.places.node[place] = vertex;
            self.places.of.push(place as u32);
            self.elements.at.push(body.state.x[node]);
            self.places.rest[place] = body.model.rest[node];
            let (first, second) = (T::of(1.0 - tie.fraction), T::of(tie.fraction));
            let [a, b] = tie.ends.map(|end| end as usize);
            self.mix(&mut growth, place, &[(a, first), (b, second)]);
            let free = mask.map_or(crate::Vec3::repeat(1.0), |mask| mask[node]);
            if let Some(axes) = self.places.mask.get_mut(place) {
                *axes = crate::lanes::to_node(&free);
            }
            growth.factor.push(tie, &free);
        }
        for place in self.places.taken() {
            self.places.mass[place] = body.model.mass[self.places.node[place] as usize];
        }
        let torn = element::Torn {
            surface,
            place: Some(&self.places.of),
            rest: &self.places.rest,
        };
        for set in self.elements.sets.iter_mut().filter_map(Divided::tearable) {
            set.follow(&torn);
        }
        let moved = done.moved.iter().flatten().next().is_some();
        growth.begin_rows(surface, &self.places.of, moved);
        growth.is_due = true;
        growth.turns.note_change();
        self.growth = Some(growth);
        self.forget_solves();
        Ok(())
    }

    /// Where a new vertex was.
    fn tie(&self, origin: Origin) -> Tie {
        match origin {
            Origin::Twin { of } => Tie::copy(self.places.of[of as usize]),
            Origin::Between { ends, weight } => Tie {
                ends: ends.map(|end| self.places.of[end as usize]),
                fraction: weight,
            },
            Origin::Original => Tie::copy(0),
        }
    }

    /// Gives a place the state of others, by their weights.
    fn mix<const N: usize>(
        &mut self,
        growth: &mut Growth<T>,
        place: usize,
        from: &[(usize, T); N],
    ) {
        let mut history = self.history[place];
        for (order, values) in history.iter_mut().enumerate() {
            *values = [T::ZERO; 4];
            for &(at, weight) in from {
                for i in 0..4 {
                    values[i] += weight * self.history[at][order][i];
                }
            }
        }
        self.history[place] = history;
        self.cg.u[place] = mixed(&self.cg.u, from);
        growth.state[place] = mixed(&growth.state, from);
        self.cg.p[place] = [T::ZERO; 4];
    }

    /// Computes forces, tangent and energy after edits, and joins the new vertices to the factor. The bound on the energy
    /// of the next step moves with the energy. Returns the change of the elastic energy (J).
    #[inline(never)]
    pub fn settle(&mut self, body: &mut Body) -> f64 {
        if !self.is_due() {
            return 0.0;
        }
        let before = self.elements.energy;
        self.join(body);
        self.linearize();
        let after = self.energy(body);
        body.state.guard.note_edit(after);
        if let Some(account) = &mut self.ledger {
            account.note_edit(after.total());
        }
        self.elements.energy - before
    }

    /// Forgets what earlier solves said about responses and directions.
    pub(super) fn forget_solves(&mut self) {
        self.pairs.forget_responses();
        for learned in &mut self.cg.learned {
            learned.forget();
        }
    }

    /// Whether an edit has not been settled.
    pub(super) fn is_due(&self) -> bool {
        self.growth.as_ref().is_some_and(|growth| growth.is_due)
    }

    /// Joins the new vertices to the factor.
    pub(super) fn join(&mut self, body: &Body) {
        let (Some(growth), Some(surface), Some(factors)) = (
            self.growth.as_deref_mut(),
            body.surface(),
            self.factor.factors,
        ) else {
            return;
        };
        growth.is_due = false;
        growth.find_near(surface, &self.places.node);
        let Growth {
            factor,
            state,
            near,
            first,
            ..
        } = growth;
        for set in self.elements.sets.iter_mut().filter_map(Divided::tearable) {
            set.local_stiffness(near, state, &mut |row, column, block| {
                factor.add(row as usize, column as usize, &(block * factors.1));
            });
        }
        for place in *first..self.places.free {
            factor.add_mass(place, factors.0 * self.places.mass[place]);
        }
        let (team, solves) = (&*self.team, &mut self.factor.solves);
        let mask = &self.places.mask;
        factor.update(&mask[..(*first).min(mask.len())], |z| {
            solves.solve(team, z);
        });
    }

    /// Takes over the motion of `running`, which this stepper replaces: a stepper with a factor, made for a copy of `body`
    /// that has had the same edits. The elements are linearized at the present state.
    ///
    /// # Errors
    ///
    /// [`StepError::Order`] if this stepper has no factor, or has not followed the same edits; nothing has changed then.
    #[inline(never)]
    pub fn adopt(&mut self, running: &mut Self, body: &mut Body) -> Result<(), StepError> {
        let fail = |first| {
            Err(StepError::Order {
                call: "adopt",
                first,
            })
        };
        if self.factor.factors.is_none() {
            return fail("prepare");
        }
        let count = body.state.x.len();
        let is_same = self.epoch == body.epoch()
            && running.epoch == body.epoch()
            && self.places.of.len() == count
            && running.places.of.len() == count;
        if !is_same {
            return fail("grow");
        }
        if self.is_due() {
            self.join(body);
        }
        (self.options, self.elements.count) = (running.options, running.elements.count);
        self.team = Arc::clone(&running.team);
        (self.last.unfinished, self.last.is_hard) = (running.last.unfinished, running.last.is_hard);
        if let (Some(new), Some(old)) = (&mut self.growth, &running.growth) {
            new.turns.follow(&old.turns);
        }
        self.last.stepped = None;
        self.present.underway = None;
        self.factor.renewed();
        for (&new, &old) in self.places.of.iter().zip(&running.places.of) {
            let (new, old) = (new as usize, old as usize);
            self.history[new] = running.history[old];
            self.cg.u[new] = running.cg.u[old];
            self.places.mass[new] = running.places.mass[old];
        }
        for &node in body.constraints.gone() {
            let place = self.places.of[node as usize] as usize;
            self.history[place] = super::guess::Differences::default();
            self.cg.u[place] = [T::ZERO; 4];
        }
        core::mem::swap(&mut self.sleep, &mut running.sleep);
        core::mem::swap(&mut self.pairs, &mut running.pairs);
        core::mem::swap(&mut self.released, &mut running.released);
        core::mem::swap(&mut self.cg.learned, &mut running.cg.learned);
        core::mem::swap(&mut self.ledger, &mut running.ledger);
        core::mem::swap(&mut self.present.targets, &mut running.present.targets);
        // The places are others.
        self.forget_solves();
        self.elements.at.copy_from_slice(&running.elements.at);
        let was_still = body.state.x == self.elements.at;
        self.linearize();
        if was_still {
            let after = self.energy(body);
            body.state.guard.note_edit(after);
            if let Some(account) = &mut self.ledger {
                account.note_edit(after.total());
            }
        }
        Ok(())
    }
}
