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
//! A step is one call or four calls, between which several bodies can be joined: see `calls` and `equation`.
//!
//! The next step begins with the forces and the tangent at the end of the last step. The energy there bounds the step
//! (`guard`) at no further cost.

mod calls;
mod certified;
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
mod linearized;
mod options;
mod places;
mod release;
mod turns;

pub use cost::Phase;
pub use equation::Equation;
pub use factor::complete_bytes;
use finish::Last;
use iterate::Vectors;
pub(crate) use iterate::{Limits, Solved};
pub use ledger::Ledger;
pub use options::{Guess, StepperOptions, StepperReport};
pub(crate) use places::Places;

use super::constraint::Constraints;
use super::constraint::cohesion::Cohesion;
use super::constraint::tangent::Tangent;
use super::refresh::Refresher;
use super::sleep::Sleep;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::element::{self, Elements, parts::Divided};
use crate::error::{CondenseError, StepError};
use crate::lanes::{to_node, to_vec};
use crate::team::{self, Alone, Team};
use calls::Present;
use factor::{Factor, factors};
use linearized::Linearized;
use std::sync::Arc;

/// The next step uses the learned directions only after a step of more iterations than this.
const EASY: usize = 2;

/// Nodes of a run of vectors, some microseconds of work. A sum over a body has a partial sum for each run.
const RUN: usize = 2048;

/// The sum of the partial sums of runs.
fn total(sums: &[f64]) -> f64 {
    sums.iter().fold(0.0, |total, sum| total + sum)
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
    pub(crate) places: Places<T>,
    pub(crate) elements: Linearized<T>,
    /// The vertices that tears have added; `None` for a body that cannot tear.
    growth: Option<Box<grow::Growth<T>>>,
    /// Pairs of vertices that let each other go, and the energy of those that have.
    pairs: Constraints<Cohesion>,
    released: release::Released,
    /// The tangents of the contacts of the last step, for the next factor.
    contacts: Vec<Tangent>,
    factor: Factor<T>,
    pub(crate) cg: Vectors<T>,
    /// The last velocities, by place.
    pub(crate) history: Vec<guess::Differences<T>>,
    pub(crate) last: Last<T>,
    present: Present,
    sleep: Sleep,
    /// The account of the last step, if it is kept.
    ledger: Option<Box<ledger::Account>>,
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
        let mut order = options
            .preconditioner
            .order(&body.assembly.stiffness, &rows.gather(&body.model.rest));
        order.extend(rows.free() as u32..count as u32);
        let mut places = Places::new(body, &order);
        let rank = places.of_rows(body);
        let matrix = body.assembly.stiffness.renumbered(&rank);
        let (of, rest) = (&places.of, &places.rest);
        let mut kernels = sets(body, of, |set| element::kernel(set, &matrix, rest));
        let bending = body.model.bending.as_ref();
        let bent = bending.map(|bending| bending.kernel(&rank, rest));
        if let Some(bent) = &bent {
            kernels.push(Box::new(bent.clone()));
        }
        let refresher = Refresher::new(
            kernels,
            matrix.clone(),
            rest,
            places.mass.clone(),
            places.mask.iter().map(to_vec).collect(),
            (options.preconditioner, options.code),
            body.epoch(),
        )?;
        let spare = grow::spare(body);
        let mut elements;
        if spare.vertices == 0 {
            elements = sets(body, of, |set| element::divided(set, &matrix, rest));
            // A clone shares the constants of the refresher's kernel.
            if let Some(bent) = bent {
                elements.push(Divided::Whole(Box::new(bent)));
            }
        } else {
            places.widen(body, spare.vertices);
            let (rank, rest) = (places.of_rows(body), &places.rest);
            let matrix = matrix.widened(spare.vertices);
            elements = sets(body, &places.of, |set| {
                Divided::Whole(element::kernel(set, &matrix, rest))
            });
            if let Some(bending) = bending {
                elements.push(Divided::Whole(Box::new(bending.kernel(&rank, rest))));
            }
            for set in elements.iter_mut().filter_map(Divided::tearable) {
                set.reserve(spare.triangles);
            }
        }
        let by_pieces = options.may_touch && options.sleep_speed > 0.0;
        if by_pieces && spare.vertices > 0 {
            places.mask.reserve(places.held);
        }
        Ok(Self {
            options,
            team: Arc::new(Alone),
            epoch: body.epoch(),
            growth: grow::Growth::new(body, rows.free(), spare, places.node.len()),
            pairs: Constraints::default(),
            released: release::Released::default(),
            contacts: Vec::new(),
            factor: Factor::of(refresher),
            elements: Linearized::new(body, elements, &places),
            cg: Vectors::new(&places),
            history: vec![guess::Differences::default(); places.node.len()],
            last: Last {
                is_hard: false,
                was_certified: false,
                ahead: Vec::with_capacity(places.node.len()),
                unfinished: false,
                stepped: None,
                began: vec![[T::ZERO; 4]; places.node.len()],
            },
            present: Present {
                targets: Vec::with_capacity(body.handle_count()),
                ..Present::default()
            },
            sleep: Sleep::new(body, by_pieces),
            ledger: None,
            places,
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
            let (state, team) = (self.elements.count, Arc::clone(&self.team));
            let is_kept = self.ledger.is_some();
            *self = Self::new(body, self.options)?;
            (self.elements.count, self.team) = (state, team);
            self.keep_ledger(is_kept);
        }
        Ok(())
    }

    /// The length of the last step (s); 0 before the first step, and after an edit.
    pub(crate) fn step_length(&self) -> f64 {
        self.last.stepped.map_or(0.0, |step| step.length)
    }

    /// Elastic energy (J) at the end of the last step; 0 before the first linearization.
    pub fn elastic_energy(&self) -> f64 {
        self.elements.energy
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
        if body.state.x != self.elements.at {
            self.elements.at.copy_from_slice(&body.state.x);
            self.linearize();
        }
        self.refresh(factors(body, h)).map_err(StepError::Matrix)
    }

    /// Computes forces, tangent and energy at the positions of the elements.
    fn linearize(&mut self) {
        self.elements.linearize(&*self.team, &self.places);
    }

    /// Computes the residual of the guess. Returns the norm of the reference forces (N), relative to which the residual
    /// has to become small: the forces on the free nodes, and the forces that move them. If a hand moves, all its
    /// effect within the step is in the residual of the guess. If no hand moves, the inertial forces bound this part,
    /// so that a bad guess does not relax the tolerance.
    fn start(&mut self, body: &Body, h: f64, mass_factor: f64, stiffness_factor: f64) -> f64 {
        let (state, model) = (&body.state, &body.model);
        let external = |node: usize| model.external[node] * model.load_factor;
        let (team, cg, force) = (&*self.team, &mut self.cg, &self.elements.force);
        let Places {
            of,
            node,
            mass,
            free,
            held,
            mask,
            ..
        } = &self.places;
        let places = (
            &mut *cg.residual,
            &mut *self.last.began,
            (&**force, &*cg.u),
            (&**node, &**mass),
        );
        team::each_of(team, places, RUN, &|(
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
        let places = (&force[..*free], &**node, &**mass);
        let half = cg.sums.len() / 2;
        let (acting, momentum) = cg.sums.split_at_mut(half);
        let acting = team::runs(team, places, RUN, acting, &|(force, nodes, _)| {
            let mut acting = 0.0;
            for (force, &node) in force.iter().zip(nodes) {
                acting += to_vec(force).norm_squared() + external(node as usize).norm_squared();
            }
            acting
        });
        let momentum = team::runs(team, places, RUN, momentum, &|(force, nodes, mass)| {
            let mut momentum = 0.0;
            for ((_, &node), mass) in force.iter().zip(nodes).zip(mass) {
                momentum += (state.v[node as usize] * (mass / h)).norm_squared();
            }
            momentum
        });
        let (acting, momentum) = (total(acting), total(momentum));
        let factor = -T::of(stiffness_factor);
        (self.elements).product(team, factor, &cg.u, &mut cg.residual);
        self.pairs.load(of, &mut cg.residual);
        self.pairs.load_springs(of, &cg.u, &mut cg.residual);
        let held = cg.u[*held..].iter().flatten();
        let moved = !mask.is_empty() || held.copied().any(|u| u != T::ZERO);
        let guess = self.norm();
        let moving = if moved {
            guess
        } else {
            guess.min(momentum.sqrt())
        };
        acting.sqrt().hypot(moving)
    }
}
