//! One linearized step of implicit Euler by conjugate gradients on a frozen factor.
//!
//! The equation is that of [`Body::step`](crate::Body::step),
//!
//! ```text
//! A u = M v / h + f_internal + f_external        A = M (1 / h^2 + alpha / h) + K (1 + beta / h)
//! ```
//!
//! with the displacement `u` over the step as the unknown. No matrix is assembled: the elements multiply by their own
//! tangent. The preconditioner keeps the iterations few. It is a sparse Cholesky factor of `A` at an earlier state.
//! Elements rotate and stretch little from step to step, and conjugate gradients correct the rest (frozen factors have
//! long been used in this role, e.g. Courtecuisse et al., "Real-time simulation of contact and cutting of heterogeneous
//! soft-tissues", 2014).
//!
//! A step is one call or four calls, between which several bodies can be joined: see `stages` and `equation`.
//!
//! The next step begins with the forces and the tangent at the end of the last step. The energy there bounds the step
//! (`guard`) at no further cost.

mod correct;
mod cost;
mod equation;
mod factor;
mod finish;
mod grow;
mod guess;
mod iterate;
mod learned;
mod ledger;
mod options;
mod release;
mod stages;
mod turns;

pub use cost::Part;
pub use equation::Equation;
pub use factor::complete_bytes;
pub(crate) use iterate::{Limits, Solved};
pub use ledger::Ledger;
pub use options::{Guess, StepperOptions, StepperReport};

use super::constraint::Constraints;
use super::constraint::cohesion::Cohesion;
use super::refresh::Refresher;
use super::sleep::Sleep;
use crate::Vec3;
use crate::body::Body;
use crate::body::handle::HandlePose;
use crate::element::precision::Precision;
use crate::element::{self, Elements, parts::Divided};
use crate::error::{CondenseError, StepError};
use crate::lanes::{Node, to_node, to_vec};
use crate::team::{self, Alone, Team};
use factor::{Factor, factors};
use stages::Underway;
use std::sync::Arc;

/// The largest number of iterations of a step after which the next step does without what solves have learned.
const EASY: usize = 2;

/// Nodes of a run of vectors, some microseconds of work. A sum over a body has a partial sum for each run.
const RUN: usize = 2048;

/// The sum of the partial sums of runs.
fn total(sums: &[f64]) -> f64 {
    sums.iter().fold(0.0, |total, sum| total + sum)
}

/// The last step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stepped {
    /// Length of the step (s).
    pub(crate) length: f64,
    /// Whether the step followed its linearization: neither corrected nor held back.
    pub(crate) whole: bool,
}

/// Advances one body repeatedly without allocating memory.
#[derive(Debug)]
pub struct Stepper<T> {
    /// The options of the steps; they may be changed between steps.
    pub options: StepperOptions,
    /// The team that does the parts of a step. The team may be changed between steps; every team gives the same bytes.
    pub team: Arc<dyn Team>,
    /// The topology epoch of the body for which all data here are made.
    pub(crate) epoch: u64,
    /// The place of each node, and the node at each place. Free nodes come first, in an order that keeps the factor
    /// sparse.
    pub(crate) place: Vec<u32>,
    pub(crate) node: Vec<u32>,
    pub(crate) free: usize,
    /// The first held place. The places between are for the vertices that tears will add. Until then their node is the
    /// first one of the body, and no element has them.
    pub(crate) held: usize,
    /// The vertices that tears have added; `None` for a body that cannot tear.
    growth: Option<Box<grow::Growth<T>>>,
    /// Pairs of vertices that let each other go.
    pairs: Constraints<Cohesion>,
    released: release::Released,
    /// What the last solves tell the preconditioner: those of the steps, and those of the shapes. Without room for pairs
    /// nothing is learned.
    learned: [learned::Learned; 2],
    /// The account of the last step, if it is kept.
    ledger: Option<Box<ledger::Account>>,
    pub(crate) elements: Vec<Divided<T>>,
    factor: Factor<T>,
    /// Positions (m) by node for which the kernels are linearized.
    pub(crate) at: Vec<Vec3>,
    elastic: f64,
    /// Elastic energy (J) above which elements may be inverted.
    turned: f64,
    /// Mass times the rounding error of positions (kg m): a force below this value over `h^2` moves nothing.
    unseen: f64,

    // The following fields are by place.
    pub(crate) rest: Vec<Vec3>,
    pub(crate) mass: Vec<f64>,
    /// By axis of a free place: 1 if the axis is free, 0 if a support guides it; empty without supports.
    pub(crate) mask: Vec<Node<T>>,
    /// Mass in the matrix of the present solve (kg/s^2).
    pub(crate) inertia: Vec<T>,
    pub(crate) d: Vec<Node<T>>,
    pub(crate) force: Vec<Node<T>>,
    /// Displacement over the step (m).
    pub(crate) u: Vec<Node<T>>,
    pub(crate) history: Vec<guess::Differences<T>>,
    /// Whether the last step took more than a few iterations.
    is_hard: bool,
    /// Whether the last step ended before it converged.
    unfinished: bool,
    /// The last step, as long as `residual` belongs to its end.
    pub(crate) stepped: Option<Stepped>,
    /// Elastic forces at the start of the last step, by place (N).
    pub(crate) began: Vec<Node<T>>,
    pub(crate) residual: Vec<Node<T>>,
    pub(crate) z: Vec<Node<f32>>,
    pub(crate) p: Vec<Node<T>>,
    pub(crate) q: Vec<Node<T>>,
    /// Room for the partial sums of runs.
    sums: Vec<f64>,
    fits: Vec<guess::Sums>,
    sleep: Sleep,
    /// The step that has begun and not ended.
    underway: Option<Underway>,
    /// The forces of joints with other bodies on nodes at the end of that step (N).
    joints: Vec<(u32, Vec3)>,
    /// The handle poses at the end of that step.
    targets: Vec<HandlePose>,
    /// Number of linearizations.
    pub(crate) state: u64,
}

/// The element sets of `body` in the order of places, each made by `of_set`. `place` gives the place of each node.
fn sets<E>(body: &Body, place: &[u32], of_set: impl Fn(Box<dyn Elements>) -> E) -> Vec<E> {
    let in_order = body.model.elements.iter().map(|set| {
        let mut set = set.boxed();
        set.renumber(place);
        of_set(set)
    });
    in_order.collect()
}

impl<T: Precision> Stepper<T> {
    /// Makes a stepper for `body` with its present connectivity, handles and supports. If these change, the stepper
    /// [follows](Self::follow).
    ///
    /// # Errors
    ///
    /// [`CondenseError::Symbolic`].
    #[inline(never)]
    pub fn new(body: &Body, options: StepperOptions) -> Result<Self, CondenseError> {
        let count = body.state.x.len();
        let rows = &body.assembly.places;
        let free = rows.free();
        let mut order = options
            .preconditioner
            .order(&body.assembly.stiffness, &rows.gather(&body.model.rest));
        order.extend(free as u32..count as u32);
        let node: Vec<u32> = order
            .iter()
            .map(|&row| rows.nodes()[row as usize])
            .collect();
        let (mut rank, mut place): (Vec<u32>, Vec<u32>) = (vec![0; count], vec![0; count]);
        for (at, (&row, &node)) in order.iter().zip(&node).enumerate() {
            rank[row as usize] = at as u32;
            place[node as usize] = at as u32;
        }
        let by_place = |values: &[Vec3], node: &[u32]| -> Vec<Vec3> {
            node.iter().map(|&node| values[node as usize]).collect()
        };
        let rest = by_place(&body.model.rest, &node);
        let matrix = body.assembly.stiffness.renumbered(&rank);
        let mut kernels = sets(body, &place, |set| element::kernel(set, &matrix, &rest));
        let bending = body.model.bending.as_ref();
        let bent = bending.map(|bending| bending.kernel(&rank, &rest));
        if let Some(bent) = &bent {
            kernels.push(Box::new(bent.clone()));
        }
        let guided = body
            .constraints
            .supports
            .mask()
            .map_or_else(Vec::new, |mask| {
                let free = &node[..free];
                free.iter().map(|&node| mask[node as usize]).collect()
            });
        let mass: Vec<f64> = node
            .iter()
            .map(|&node| body.model.mass[node as usize])
            .collect();
        let refresher_mass = mass.clone();
        let mut mask: Vec<Node<T>> = guided.iter().map(to_node).collect();
        let refresher = Refresher::new(
            kernels,
            matrix.clone(),
            &rest,
            refresher_mass,
            guided,
            (options.preconditioner, options.code),
            body.epoch(),
        )?;
        let lost = mass.iter().zip(&rest);
        let lost = lost.map(|(mass, rest)| (mass * rest.amax() * (0.5 * f64::EPSILON)).powi(2));
        let unseen = lost.sum::<f64>().sqrt();
        // Places for the vertices of tears.
        let spare = grow::spare(body);
        let held = free + spare.vertices;
        let (mut node, mut rest, mut mass) = (node, rest, mass);
        let mut elements;
        if spare.vertices == 0 {
            elements = sets(body, &place, |set| element::divided(set, &matrix, &rest));
            // A clone shares the constants of the refresher's kernel.
            if let Some(bent) = bent {
                elements.push(Divided::Whole(Box::new(bent)));
            }
        } else {
            let first = body.constraints.nodes().next().unwrap_or(0) as u32;
            node.splice(free..free, core::iter::repeat_n(first, spare.vertices));
            for place in place.iter_mut().chain(&mut rank) {
                if *place as usize >= free {
                    *place += spare.vertices as u32;
                }
            }
            place.reserve_exact(spare.vertices);
            rest = by_place(&body.model.rest, &node);
            mass.splice(free..free, core::iter::repeat_n(0.0, spare.vertices));
            if !mask.is_empty() {
                mask.resize(held, [T::of(1.0), T::of(1.0), T::of(1.0), T::ZERO]);
            }
            let matrix = matrix.widened(spare.vertices);
            elements = sets(body, &place, |set| {
                Divided::Whole(element::kernel(set, &matrix, &rest))
            });
            if let Some(bending) = bending {
                elements.push(Divided::Whole(Box::new(bending.kernel(&rank, &rest))));
            }
            for set in elements.iter_mut().filter_map(Divided::tearable) {
                set.reserve(spare.triangles);
            }
        }
        let mut at = Vec::with_capacity(count + spare.vertices);
        at.resize(count, Vec3::repeat(f64::NAN));
        let growth = grow::Growth::new(body, free, spare, node.len());
        let count = node.len();
        let zeros = vec![[T::ZERO; 4]; count];
        Ok(Self {
            options,
            epoch: body.epoch(),
            elements,
            growth,
            pairs: Constraints::default(),
            released: release::Released::default(),
            learned: Default::default(),
            ledger: None,
            held,
            team: Arc::new(Alone),
            factor: Factor::of(refresher),
            place,
            node,
            free,
            mass,
            at,
            elastic: 0.0,
            turned: correct::turned(body),
            unseen,
            rest,
            mask,
            inertia: vec![T::ZERO; count],
            d: zeros.clone(),
            force: zeros.clone(),
            u: zeros.clone(),
            history: vec![guess::Differences::default(); count],
            is_hard: false,
            unfinished: false,
            stepped: None,
            began: zeros.clone(),
            residual: zeros.clone(),
            z: vec![[0.0; 4]; held],
            p: zeros.clone(),
            q: zeros,
            sums: vec![0.0; 2 * count.div_ceil(RUN)],
            fits: vec![guess::Sums::default(); count.div_ceil(RUN)],
            sleep: Sleep::new(body),
            underway: None,
            joints: Vec::new(),
            targets: Vec::with_capacity(body.handle_count()),
            state: 0,
        })
    }

    /// Makes the stepper again if `body` has begun another topology epoch since. Otherwise the next step does so. The
    /// call allocates memory and takes as long as making a stepper. A factor has still to be [made](Self::prepare).
    ///
    /// # Errors
    ///
    /// [`CondenseError::Symbolic`]; the stepper has not changed then.
    #[inline(never)]
    pub fn follow(&mut self, body: &Body) -> Result<(), CondenseError> {
        if self.epoch != body.epoch() {
            // The count continues, so that no shapes of another epoch pass for those of this linearization.
            let (state, team) = (self.state, Arc::clone(&self.team));
            let is_kept = self.ledger.is_some();
            *self = Self::new(body, self.options)?;
            (self.state, self.team) = (state, team);
            self.keep_ledger(is_kept);
        }
        Ok(())
    }

    /// The places that nodes have: the free places, then the held places.
    pub(crate) fn taken_places(&self) -> impl Iterator<Item = usize> + use<T> {
        (0..self.free).chain(self.held..self.node.len())
    }

    /// The length of the last step (s); 0 before the first step, and after an edit.
    pub(crate) fn step_length(&self) -> f64 {
        self.stepped.map_or(0.0, |step| step.length)
    }

    /// Elastic energy (J) at the end of the last step; 0 before the first linearization.
    pub fn elastic_energy(&self) -> f64 {
        self.elastic
    }

    /// Makes the first factor, for steps of `h` seconds. Otherwise the first step makes the factor and is late.
    ///
    /// # Errors
    ///
    /// [`StepError::StepLength`] and [`StepError::Matrix`].
    #[inline(never)]
    pub fn prepare(&mut self, body: &Body, h: f64) -> Result<(), StepError> {
        if !(h > 0.0 && h.is_finite()) {
            return Err(StepError::StepLength { found: h });
        }
        self.follow(body).map_err(StepError::Matrix)?;
        if body.state.x != self.at {
            self.at.copy_from_slice(&body.state.x);
            self.linearize();
        }
        self.refresh(factors(body, h)).map_err(StepError::Matrix)
    }

    /// Computes forces, tangent and energy at the positions `self.at`.
    fn linearize(&mut self) {
        let at = &self.at;
        let nodes = (&mut *self.d, &*self.rest, &*self.node);
        team::each_of(&*self.team, nodes, RUN, &|(d, rest, nodes)| {
            for ((d, rest), &node) in d.iter_mut().zip(rest).zip(nodes) {
                *d = to_node(&(at[node as usize] - rest));
            }
        });
        self.state += 1;
        self.linearize_elements();
    }

    /// Computes forces, tangent and energy at the displacements `self.d`.
    pub(crate) fn linearize_elements(&mut self) {
        self.force.fill([T::ZERO; 4]);
        self.elastic = 0.0;
        for set in &mut self.elements {
            self.elastic += set.linearize(&*self.team, &self.d, &mut self.force);
        }
    }

    /// Computes the residual of the guess. Returns the norm of the reference forces (N), relative to which the residual
    /// has to become small: the forces on the free nodes, and the forces that move them. If a hand moves, all its
    /// effect within the step is in the residual of the guess. If no hand moves, the inertial forces bound this part,
    /// so that a bad guess does not relax the tolerance.
    fn start(&mut self, body: &Body, h: f64, mass_factor: f64, stiffness_factor: f64) -> f64 {
        let (state, model) = (&body.state, &body.model);
        let external = |node: usize| model.external[node] * model.load_factor;
        let places = (
            &mut *self.residual,
            &mut *self.began,
            (&*self.force, &*self.u),
            (&*self.node, &*self.mass),
        );
        team::each_of(&*self.team, places, RUN, &|(
            residual,
            began,
            (force, u),
            (nodes, mass),
        )| {
            began.copy_from_slice(force);
            let places = residual.iter_mut().zip(force).zip(u).zip(nodes).zip(mass);
            for ((((r, force), u), &node), &mass) in places {
                let node = node as usize;
                let inertia = state.v[node] / h - to_vec(u) * mass_factor;
                *r = to_node(&(to_vec(force) + external(node) + inertia * mass));
            }
        });
        let free = self.free;
        let places = (&self.force[..free], &*self.node, &*self.mass);
        let half = self.sums.len() / 2;
        let (acting, momentum) = self.sums.split_at_mut(half);
        let acting = team::runs(&*self.team, places, RUN, acting, &|(force, nodes, _)| {
            let mut acting = 0.0;
            for (force, &node) in force.iter().zip(nodes) {
                acting += to_vec(force).norm_squared() + external(node as usize).norm_squared();
            }
            acting
        });
        let momentum = team::runs(&*self.team, places, RUN, momentum, &|(
            force,
            nodes,
            mass,
        )| {
            let mut momentum = 0.0;
            for ((_, &node), mass) in force.iter().zip(nodes).zip(mass) {
                momentum += (state.v[node as usize] * (mass / h)).norm_squared();
            }
            momentum
        });
        let (acting, momentum) = (total(acting), total(momentum));
        let factor = -T::of(stiffness_factor);
        for set in &mut self.elements {
            set.product(&*self.team, factor, &self.u, &mut self.residual);
        }
        self.pairs.load(&self.place, &mut self.residual);
        (self.pairs).load_springs(&self.place, &self.u, &mut self.residual);
        let held = self.u[self.held..].iter().flatten();
        let moved = !self.mask.is_empty() || held.copied().any(|u| u != T::ZERO);
        let guess = self.norm();
        let moving = if moved {
            guess
        } else {
            guess.min(momentum.sqrt())
        };
        acting.sqrt().hypot(moving)
    }
}
