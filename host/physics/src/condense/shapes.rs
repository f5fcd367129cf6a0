//! Local models at the rate of the steps, from shapes that are updated instead of recomputed.
//!
//! [`Condenser`](crate::condense::condenser::Condenser) computes the shapes by a factorization of its own. Here
//! conjugate gradients, preconditioned by the stepper's frozen factor, start from the previous shapes, which change
//! little from one model to the next. The columns may be updated in turn, a few with each model. The others are then
//! slightly older.

use super::around::{Around, Parts};
use super::reduction::{Condensed, Reduction, dot};
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::error::CondenseError;
use crate::lanes::{to_node, to_vec};
use crate::motion::stepper::{Limits, Solved, Stepper};
use crate::motion::tearing::TearLimit;

/// The options of the updates of shapes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeOptions {
    /// The residual of a shape to reach, as a fraction of the forces that cause the shape.
    pub tolerance: f64,
    /// The largest number of iterations for a shape in one update. The first computation of the shapes has at least 50.
    pub max_iterations: usize,
    /// The number of shapes that are updated with each model, in turn. The first model computes all of them.
    pub at_a_time: usize,
    /// The residual that is too large for a model, as a fraction of the forces that cause the shape. If
    /// `max_iterations` leave more, the body has changed more than a few shapes in turn can follow: all shapes are updated
    /// with this model, each in up to 50 further iterations. The motion of a thin sheet along itself is its stiffest; a
    /// shape with a large residual has too much of it, and states a stiffness many times that of the body.
    pub bound: f64,
}

/// The least number of iterations that the first computation of a shape may take, and an update down to the bound.
const FIRST_ITERATIONS: usize = 50;

/// Contacts that close and add a smaller fraction of the stiffness along the motion of the hands than this are no limit.
const LEAST_TOUCH: f64 = 0.01;

/// The least number of iterations that a shape of a body with contacts may take: contacts that close or open change it much,
/// and the factor knows none of them.
const CONTACT_ITERATIONS: usize = 400;

impl Default for ShapeOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-5,
            max_iterations: FIRST_ITERATIONS,
            at_a_time: usize::MAX,
            bound: f64::INFINITY,
        }
    }
}

/// The report of the updates for one model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShapeReport {
    /// Number of shapes that were updated.
    pub renewed: usize,
    /// Total number of iterations.
    pub iterations: usize,
    /// The largest residual of an updated shape, as a fraction of the forces that cause the shape.
    pub residual: f64,
}

/// The shapes of a body, kept from one local model to the next. There are none before the first model.
#[derive(Debug, Default)]
pub struct Shapes {
    kept: Option<Box<Kept>>,
}

/// The shapes of a body that one stepper moves.
#[derive(Debug)]
struct Kept {
    /// The epoch of the body.
    epoch: u64,
    reduction: Reduction,
    /// Factors of mass and stiffness in the matrix of the shapes.
    factors: (f64, f64),
    /// For each shape, the norm of the forces that cause it (N), from its first computation.
    references: Vec<f64>,
    next: usize,
    /// The linearization of the latest shapes.
    state: u64,
    /// Number of shapes that are up to date with that linearization.
    current: usize,
    /// For each node, the rate of force that the tangent misses (N/s).
    missed: Vec<Vec3>,
    /// The shapes of the bodies that the body touches.
    parts: Parts,
    /// Number of edits that tears had made when the shapes were computed.
    edits: u64,
}

/// The forces of a turn are taken to be at least this fraction of those of a translation by the handles' length. A
/// turn of a handle whose vertices lie on the axis causes no force, and a fraction of zero would be no goal.
const LEAST_TURN: f64 = 1e-3;

impl Kept {
    /// Whether `body` has begun its epoch by edits alone since the shapes were computed.
    fn has_torn(&self, body: &Body) -> bool {
        let edits = body.edit_count().checked_sub(self.edits);
        let epochs = body.epoch().checked_sub(self.epoch);
        edits.is_some_and(|edits| edits > 0) && edits == epochs
    }

    /// The least norm of the forces that a column is taken to cause (N).
    fn least_reference(&self, column: usize) -> f64 {
        let found = self.references[..column].iter().copied();
        let largest = found.fold(f64::MIN_POSITIVE, f64::max);
        if self.reduction.columns[column].motion < 3 {
            f64::MIN_POSITIVE
        } else {
            LEAST_TURN * self.reduction.condensed.length * largest
        }
    }
}

impl Shapes {
    /// Condenses the body that `stepper` moves onto its handles after the last step, for local models published every
    /// `period` seconds. The first call allocates.
    ///
    /// # Errors
    ///
    /// [`CondenseError`].
    pub fn condense<T: Precision>(
        &mut self,
        stepper: &mut Stepper<T>,
        body: &Body,
        period: f64,
        options: &ShapeOptions,
    ) -> Result<(&Condensed, ShapeReport), CondenseError> {
        self.condense_among(stepper, body, period, options, None)
    }

    /// [`condense`](Self::condense) for a body with what it touches. Every body of `around` that has shapes of its own must have
    /// [seen](Self::see) its last step.
    ///
    /// # Errors
    ///
    /// [`CondenseError`].
    #[inline(never)]
    pub fn condense_among<T: Precision>(
        &mut self,
        stepper: &mut Stepper<T>,
        body: &Body,
        period: f64,
        options: &ShapeOptions,
        around: Option<&mut Around<'_, T>>,
    ) -> Result<(&Condensed, ShapeReport), CondenseError> {
        let mut shapes = self.take(stepper, body, period)?;
        stepper.see_missed(body, &mut shapes.missed);
        let mut around = around.filter(|around| !around.springs.is_empty());
        let Kept {
            parts, reduction, ..
        } = &mut *shapes;
        match &mut around {
            Some(around) => parts.begin(around, reduction.columns.len(), period),
            None => parts.clear(reduction),
        }
        let report = stepper.renew(body, &mut shapes, options, around.as_deref_mut());
        let shapes = self.kept.insert(shapes);
        let Kept {
            parts,
            reduction,
            factors,
            missed,
            ..
        } = &mut **shapes;
        reduction.reduce(body, factors.0 / factors.1, period, missed);
        if let Some(around) = around {
            for column in 0..reduction.columns.len() {
                let slot = reduction.columns[column].slot();
                let drift = parts.drift(around, reduction, column);
                let stopping = parts.stopping(body, around, reduction, column, period);
                reduction.condensed.drift[slot] += drift + stopping;
            }
        }
        Ok((&reduction.condensed, report))
    }

    /// Takes from the last step what a model needs, before the vectors of the stepper serve the models of other bodies.
    ///
    /// # Errors
    ///
    /// [`CondenseError`].
    pub fn see<T: Precision>(
        &mut self,
        stepper: &mut Stepper<T>,
        body: &Body,
        period: f64,
    ) -> Result<(), CondenseError> {
        let mut shapes = self.take(stepper, body, period)?;
        stepper.see_missed(body, &mut shapes.missed);
        self.kept = Some(shapes);
        Ok(())
    }

    /// The limit of the contacts of the body with what it touches, after a condensation. `slopes` receives a number for each
    /// [motion](Self::motions).
    pub fn limit<T: Precision>(
        &self,
        around: &Around<'_, T>,
        slopes: &mut [f64],
    ) -> Option<TearLimit> {
        let kept = self.kept.as_ref()?;
        kept.parts.limit(around, &kept.reduction, slopes)
    }

    /// The time (s) in which the hands reach a limit with the `slopes` if they go on; infinite if they do not.
    pub fn until(&self, limit: &TearLimit, slopes: &[f64]) -> f64 {
        let speeds = self.kept.iter().flat_map(|kept| &kept.reduction.speeds);
        let rate: f64 = slopes.iter().zip(speeds).map(|(q, v)| q * v).sum();
        let left = limit.critical - limit.root.max(0.0);
        if rate > 0.0 {
            left.max(0.0) / rate
        } else {
            f64::INFINITY
        }
    }

    /// The limit of the contacts that close before the next model, after a condensation with them; `open` are the shapes without
    /// them. `slopes` receives a number for each [motion](Self::motions).
    ///
    /// With the velocities `v` of the hands, and the stiffness `D` and the damping `E` that these contacts add, the model stiffens
    /// along `q = D v / sqrt(v . D v)` once `q . d` is `sqrt(v . D v)` times the time to the touch: then the stiffness along `v` is
    /// that of the closed contacts. If they close one after the other, a part of `D` stands for them all.
    pub fn touch<T: Precision>(
        &self,
        open: &Self,
        around: &Around<'_, T>,
        slopes: &mut [f64],
    ) -> Option<TearLimit> {
        let (closed, open) = (self.kept.as_ref()?, open.kept.as_ref()?);
        let Reduction {
            columns, speeds, ..
        } = &closed.reduction;
        let [after, before] = [closed, open].map(|kept| &kept.reduction.condensed);
        let (mut along, mut whole, mut damped) = (0.0, 0.0, 0.0);
        for ((column, speed), slope) in columns.iter().zip(speeds).zip(&mut *slopes) {
            *slope = 0.0;
            for (other, moves) in columns.iter().zip(speeds) {
                let at = (column.slot(), other.slot());
                *slope += (after.stiffness[at] - before.stiffness[at]) * moves;
                whole += after.stiffness[at] * speed * moves;
                damped += (after.damping[at] - before.damping[at]) * speed * moves;
            }
            along += *slope * speed;
        }
        let is_stiffer = along > LEAST_TOUCH * whole;
        let time = closed.parts.closing(around, &closed.reduction);
        let (time, part) = time.filter(|_| is_stiffer)?;
        let root = (part * along).sqrt();
        for slope in slopes {
            *slope *= part / root;
        }
        Some(TearLimit {
            root: -(damped / along).max(0.0),
            critical: root * time,
            is_touch: true,
        })
    }

    /// Takes the shapes, or makes those of a body that has none.
    fn take<T: Precision>(
        &mut self,
        stepper: &Stepper<T>,
        body: &Body,
        period: f64,
    ) -> Result<Box<Kept>, CondenseError> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(CondenseError::Period { found: period });
        }
        if !stepper.is_ready() || stepper.epoch != body.epoch() {
            return Err(CondenseError::NotAssembled);
        }
        let factors = (
            1.0 / (period * period) + body.model.config.mass_damping / period,
            1.0 + body.model.config.stiffness_damping / period,
        );
        Ok(match self.kept.take() {
            Some(shapes) if shapes.factors == factors && shapes.epoch == body.epoch() => shapes,
            Some(mut shapes) if shapes.factors == factors && shapes.has_torn(body) => {
                shapes.reduction.grow(body);
                shapes.missed.resize(body.state.x.len(), Vec3::zeros());
                (shapes.epoch, shapes.current) = (body.epoch(), 0);
                shapes.edits = body.edit_count();
                shapes
            }
            _ => {
                let mut reduction = Reduction::new(body);
                let spare = body.surface().map_or(0, |surface| {
                    surface.limits().vertices - surface.vertex_count()
                });
                reduction.reserve(spare);
                let mut missed = Vec::with_capacity(body.state.x.len() + spare);
                missed.resize(body.state.x.len(), Vec3::zeros());
                Box::new(Kept {
                    epoch: body.epoch(),
                    references: vec![0.0; reduction.columns.len()],
                    reduction,
                    factors,
                    next: 0,
                    state: 0,
                    current: 0,
                    missed,
                    parts: Parts::default(),
                    edits: body.edit_count(),
                })
            }
        })
    }
}

impl Shapes {
    /// The handle and the motion of each shape: 0 to 2 are translations, 3 to 5 rotations. Empty before the first model.
    pub fn motions(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let columns = self.kept.iter().flat_map(|kept| &kept.reduction.columns);
        columns.map(|column| (column.handle, column.motion))
    }

    /// The displacement of a node for a unit of the motion of a shape (m per m, m per rad); zero before the first model,
    /// and for a node that the shapes do not have yet.
    pub fn displacement(&self, shape: usize, node: u32) -> Vec3 {
        self.kept
            .as_ref()
            .map_or_else(Vec3::zeros, |kept| kept.reduction.displacement(shape, node))
    }
}

impl<T: Precision> Stepper<T> {
    /// Computes by how much the elastic forces at the end of the last step differ from its linearization, as a rate
    /// (N/s). `missed` is unchanged if no step was taken since the last model. The equation of the step gives `K u`, so
    /// no product is needed.
    fn see_missed(&mut self, body: &Body, missed: &mut [Vec3]) {
        let Some(step) = self.last.stepped.take() else {
            return;
        };
        if !step.whole {
            missed.fill(Vec3::zeros());
            return;
        }
        let h = step.length;
        let drag = body.model.config.mass_damping;
        let stiffness_factor = 1.0 + body.model.config.stiffness_damping / h;
        for place in self.places.taken() {
            let node = self.places.node[place] as usize;
            let (old, new) = (to_vec(&self.history[place][0]), body.state.v[node]);
            let inertia = (old - new) / h - new * drag;
            let external = body.model.external[node] * body.model.load_factor;
            let before = to_vec(&self.last.began[place]);
            let acting = before + external + inertia * self.places.mass[place];
            let fallen = (acting - to_vec(&self.cg.residual[place])) / stiffness_factor;
            missed[node] = (to_vec(&self.elements.force[place]) - before + fallen) / h;
        }
        for (node, force) in self.joint_forces() {
            missed[*node as usize] += force / (stiffness_factor * h);
        }
    }

    fn renew(
        &mut self,
        body: &Body,
        shapes: &mut Kept,
        options: &ShapeOptions,
        mut around: Option<&mut Around<'_, T>>,
    ) -> ShapeReport {
        let count = shapes.reduction.columns.len();
        shapes.reduction.take_arms(body);
        let cold = shapes.references.contains(&0.0);
        if shapes.state != self.elements.count {
            shapes.state = self.elements.count;
            shapes.current = 0;
        }
        // A body that has not moved keeps its shapes.
        let left = count - shapes.current;
        let mut turns = if cold {
            left
        } else {
            options.at_a_time.min(left)
        };
        // The shapes begin at zero: few iterations would leave them far from their goal for many models.
        let max_iterations = if around.is_some() {
            options.max_iterations.max(CONTACT_ITERATIONS)
        } else if cold {
            options.max_iterations.max(FIRST_ITERATIONS)
        } else {
            options.max_iterations
        };
        let mut report = ShapeReport::default();
        while report.renewed < turns {
            let column = shapes.next;
            shapes.next = (column + 1) % count;
            if shapes.references[column] == 0.0 {
                self.lay(body, shapes, column);
                let found = self.norm().max(shapes.least_reference(column));
                shapes.references[column] = found;
            }
            self.lay(body, shapes, column);
            let reference = shapes.references[column];
            let limits = Limits {
                of: Solved::Shape,
                uses_learned: true,
                goal: options.tolerance * reference,
                start: options.tolerance * reference,
                max_iterations,
            };
            if let Some(around) = &mut around {
                shapes.parts.lay(self, around, column, shapes.factors.1);
                let parts = &shapes.parts;
                let (iterations, residual) = parts.solve(self, around, shapes.factors, limits);
                self.keep(shapes, column);
                let Kept {
                    parts,
                    reduction,
                    factors,
                    ..
                } = &mut *shapes;
                let own = (factors.1, body.model.config.stiffness_damping);
                parts.keep(self, around, column, reduction, own);
                report.iterations += iterations;
                report.renewed += 1;
                report.residual = report.residual.max(residual / reference);
                continue;
            }
            let mut found = self.iterate(shapes.factors, limits, &mut || false);
            report.iterations += found.iterations;
            if found.residual > options.bound * reference {
                turns = left;
                let limits = Limits {
                    goal: options.bound * reference,
                    start: options.bound * reference,
                    max_iterations: FIRST_ITERATIONS,
                    ..limits
                };
                found = self.iterate(shapes.factors, limits, &mut || false);
                report.iterations += found.iterations;
            }
            self.keep(shapes, column);
            report.renewed += 1;
            report.residual = report.residual.max(found.residual / reference);
        }
        shapes.current += turns;
        report
    }

    /// Loads a column and its residual into the vectors of the conjugate gradients. A column that was never computed is
    /// zero.
    fn lay(&mut self, body: &Body, shapes: &Kept, column: usize) {
        let Kept {
            reduction,
            factors: (mass_factor, stiffness_factor),
            ..
        } = shapes;
        // Nodes that have halted are free nodes of the shapes still; no hand moves them.
        let free = reduction.places.free();
        let shape = &reduction.shapes[3 * free * column..3 * free * (column + 1)];
        let motion = reduction.columns[column];
        for place in self.places.taken() {
            let node = self.places.node[place] as usize;
            let row = reduction.places.of(node);
            let u = if row < free {
                Vec3::new(shape[3 * row], shape[3 * row + 1], shape[3 * row + 2])
            } else {
                match reduction.holder.get(row - free) {
                    Some(&holder) if holder as usize == motion.handle => {
                        motion.at(&reduction.arms[row - free])
                    }
                    _ => Vec3::zeros(),
                }
            };
            self.cg.u[place] = to_node(&u);
            self.cg.residual[place] = to_node(&(u * (-mass_factor * body.model.mass[node])));
        }
        self.subtract_elements(*stiffness_factor);
    }

    /// Subtracts `factor` times the product of the elements with the displacement from the residual.
    pub(super) fn subtract_elements(&mut self, factor: f64) {
        let factor = T::of(-factor);
        self.elements
            .product(&*self.team, factor, &self.cg.u, &mut self.cg.residual);
    }

    /// Stores a column, its product with the stiffness on the handle nodes, and its products with the residual on the free
    /// nodes.
    fn keep(&mut self, shapes: &mut Kept, column: usize) {
        let (mass_factor, stiffness_factor) = shapes.factors;
        let free = shapes.reduction.places.free();
        let Reduction {
            shapes: all,
            places,
            pulls,
            holder,
            rest,
            left,
            turn,
            ..
        } = &mut shapes.reduction;
        let shape = &mut all[3 * free * column..3 * free * (column + 1)];
        rest.clear();
        rest.resize(3 * free, 0.0);
        for place in self.places.taken() {
            let row = places.of(self.places.node[place] as usize);
            let u = to_vec(&self.cg.u[place]);
            let residual = to_vec(&self.cg.residual[place]);
            if row < free {
                shape[3 * row..3 * row + 3].copy_from_slice(u.as_slice());
                if place < self.places.free {
                    rest[3 * row..3 * row + 3].copy_from_slice(residual.as_slice());
                }
            } else if row - free < holder.len() {
                let force = -residual - u * (mass_factor * self.places.mass[place]);
                pulls[column * holder.len() + row - free] = force / stiffness_factor;
            }
        }
        turn[column] = 1 + turn.iter().copied().max().unwrap_or(0);
        for (r, shape) in all.chunks_exact(3 * free.max(1)).enumerate() {
            left[(r, column)] = dot(shape, rest) / stiffness_factor;
        }
    }
}
