//! One linearized step of implicit Euler by conjugate gradients on a frozen factor.
//!
//! The equation is that of [`Body::step`](crate::Body::step),
//!
//! ```text
//! A u = M v / h + f_internal + f_external        A = M (1 / h^2 + alpha / h) + K (1 + beta / h)
//! ```
//!
//! with the displacement `u` over the step as the unknown. Nothing is assembled: elements multiply by their own
//! tangent. What makes few iterations enough is the preconditioner, a sparse Cholesky factor of `A` as it was
//! some time ago: elements turn and stretch little from step to step, and conjugate gradients take care of the
//! rest (a frozen factor has long served so, e.g. Courtecuisse et al., "Real-time simulation of contact and
//! cutting of heterogeneous soft-tissues", 2014).
//!
//! A step is one call or four, between which several bodies can be joined: see `stages`.
//!
//! Forces and tangent at the end of a step are those with which the next begins, and their energy bounds the
//! step (`guard`) at no cost.

mod correct;
mod cost;
mod finish;
mod guess;
mod iterate;
mod options;
mod stages;

pub use cost::Part;
pub(crate) use iterate::Limits;
pub use options::{Guess, StepperOptions, StepperReport};

use super::refresh::Refresher;
use super::sleep::Sleep;
use crate::Vec3;
use crate::body::Body;
use crate::body::handle::HandlePose;
use crate::element::{self, kernel::Kernel};
use crate::error::{CondenseError, StepError};
use crate::lanes::{Node, Real, to_node, to_vec};
use crate::linear::block_matrix::BlockMatrix;
use crate::linear::precondition::{self, Preconditioner, Solves};
use stages::Underway;

/// A complete factor of which an iteration leaves more than this share of the residual has aged. A fresh one leaves a
/// thousandth. Good guesses need few iterations of any, so that their number tells too late: where a hand stops, and
/// the guess is of no use, an old one takes twice as many as a fresh one.
const SLOW: f64 = 0.03;

/// How the last step went.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stepped {
    /// How long it was (s).
    pub(crate) length: f64,
    /// Whether it went as its linearization says: neither corrected nor held back.
    pub(crate) whole: bool,
}

/// Steps one body again and again without allocating.
#[derive(Debug)]
pub struct Stepper<T> {
    /// How steps are solved; may be changed between them.
    pub options: StepperOptions,
    /// The epoch of the body for which everything here is made.
    pub(crate) epoch: u64,
    /// The place of each node, and the node at each place: free ones first, in an order that fills little.
    pub(crate) place: Vec<u32>,
    pub(crate) node: Vec<u32>,
    pub(crate) free: usize,
    pub(crate) kernels: Vec<Box<dyn Kernel<T>>>,
    /// Absent while it is lent.
    pub(crate) refresher: Option<Box<Refresher<T>>>,
    /// The factor that steps solve with.
    pub(crate) solves: Solves,
    /// Factors of mass and stiffness in the matrix that was factorized.
    pub(crate) factors: Option<(f64, f64)>,
    stale: bool,
    /// Iterations of the first step on an incomplete factor; 0 before it.
    usual: usize,
    /// Positions (m) by node for which the kernels are linearized.
    pub(crate) at: Vec<Vec3>,
    elastic: f64,
    /// Elastic energy (J) above which cells may be inside out.
    turned: f64,
    /// Mass times what rounding takes from positions (kg m): less force than this over `h^2` moves nothing.
    unseen: f64,

    // By place.
    pub(crate) rest: Vec<Vec3>,
    pub(crate) mass: Vec<f64>,
    /// 1 where an axis of a free place is free, 0 where a support guides it; empty without supports.
    pub(crate) mask: Vec<Node<T>>,
    /// Mass in the matrix that is being solved with (kg/s^2).
    pub(crate) inertia: Vec<T>,
    pub(crate) d: Vec<Node<T>>,
    pub(crate) force: Vec<Node<T>>,
    /// Displacement over the step (m).
    pub(crate) u: Vec<Node<T>>,
    pub(crate) history: Vec<guess::Differences<T>>,
    /// Whether the last step ended before it converged.
    unfinished: bool,
    /// The last step, as long as `residual` is that of its end.
    pub(crate) stepped: Option<Stepped>,
    /// Elastic forces at its start, by place (N).
    pub(crate) began: Vec<Node<T>>,
    pub(crate) residual: Vec<Node<T>>,
    pub(crate) z: Vec<Node<f32>>,
    pub(crate) p: Vec<Node<T>>,
    pub(crate) q: Vec<Node<T>>,
    sleep: Sleep,
    /// The step that has begun and not ended.
    underway: Option<Underway>,
    /// Where its handles go.
    targets: Vec<HandlePose>,
    /// Counts linearizations.
    pub(crate) state: u64,
}

/// Memory that the complete factor of `body`'s step matrix would take (bytes), as
/// [`precondition::complete_bytes`] counts it.
pub fn complete_bytes(body: &Body) -> usize {
    precondition::complete_bytes(&body.assembly.stiffness, &body.model.rest)
}

/// Factors of mass and stiffness in the matrix of a step of `h` seconds.
fn factors(body: &Body, h: f64) -> (f64, f64) {
    (
        1.0 / (h * h) + body.model.config.mass_damping / h,
        1.0 + body.model.config.stiffness_damping / h,
    )
}

/// The kernels of the element sets of `body` and of its bending, in the order of places.
fn kernels<T: Real>(
    body: &Body,
    place: &[u32],
    matrix: &BlockMatrix,
    rest: &[Vec3],
) -> Vec<Box<dyn Kernel<T>>> {
    let mut kernels: Vec<Box<dyn Kernel<T>>> = Vec::new();
    for set in &body.model.elements {
        let mut set = set.boxed();
        set.renumber(place);
        kernels.push(element::kernel(set, matrix, rest));
    }
    if let Some(bending) = &body.model.bending {
        kernels.push(bending.kernel(&body.assembly.stiffness, place, matrix));
    }
    kernels
}

impl<T: Real> Stepper<T> {
    /// Memory for `body`, as it is connected, held and supported now; where that changes, the stepper
    /// [follows](Self::follow).
    ///
    /// # Errors
    ///
    /// [`CondenseError::Symbolic`].
    pub fn new(body: &Body, options: StepperOptions) -> Result<Self, CondenseError> {
        let count = body.state.x.len();
        let free = body.assembly.stiffness.free();
        let mut node = options
            .preconditioner
            .order(&body.assembly.stiffness, &body.model.rest);
        node.extend(free as u32..count as u32);
        let mut place = vec![0; count];
        for (at, &node) in node.iter().enumerate() {
            place[node as usize] = at as u32;
        }
        let by_place = |values: &[Vec3]| -> Vec<Vec3> {
            node.iter().map(|&node| values[node as usize]).collect()
        };
        let rest = by_place(&body.model.rest);
        let matrix = body.assembly.stiffness.renumbered(&place);
        let kernels = || kernels(body, &place, &matrix, &rest);
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
        let kept = kernels();
        let mask = guided.iter().map(to_node).collect();
        let refresher = Refresher::new(
            kernels(),
            matrix.clone(),
            &rest,
            mass.clone(),
            guided,
            (options.preconditioner, options.code),
            body.epoch(),
        )?;
        let zeros = vec![[T::ZERO; 4]; count];
        let lost = mass.iter().zip(&rest);
        let lost = lost.map(|(mass, rest)| (mass * rest.amax() * (0.5 * f64::EPSILON)).powi(2));
        let unseen = lost.sum::<f64>().sqrt();
        Ok(Self {
            options,
            epoch: body.epoch(),
            kernels: kept,
            solves: refresher.like_made(),
            refresher: Some(Box::new(refresher)),
            place,
            node,
            free,
            mass,
            factors: None,
            stale: true,
            usual: 0,
            at: vec![Vec3::repeat(f64::NAN); count],
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
            unfinished: false,
            stepped: None,
            began: zeros.clone(),
            residual: zeros.clone(),
            z: vec![[0.0; 4]; free],
            p: zeros.clone(),
            q: zeros,
            sleep: Sleep::new(body),
            underway: None,
            targets: Vec::with_capacity(body.handle_count()),
            state: 0,
        })
    }

    /// Makes everything anew where `body` has begun another epoch since; the first step after it does otherwise. Takes
    /// memory and as long as making a stepper; a factor is then still to be [made](Self::prepare).
    ///
    /// # Errors
    ///
    /// [`CondenseError::Symbolic`]; the stepper is as it was then.
    pub fn follow(&mut self, body: &Body) -> Result<(), CondenseError> {
        if self.epoch != body.epoch() {
            // The count goes on: no shapes are those of another epoch's linearization.
            let state = self.state;
            *self = Self::new(body, self.options)?;
            self.state = state;
        }
        Ok(())
    }

    /// Whether there has been a step, from which a factor is left.
    pub(crate) fn is_ready(&self) -> bool {
        self.factors.is_some()
    }

    /// Elastic energy (J) where the last step ended; not a number before the first.
    pub fn elastic_energy(&self) -> f64 {
        self.elastic
    }

    /// Makes the first factor, for steps of `h` seconds: otherwise the first step does, and is late.
    ///
    /// # Errors
    ///
    /// [`StepError::StepLength`] and [`StepError::Matrix`].
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

    /// Whether a step took so many iterations, or they brought so little each, that a new factor would pay.
    fn is_slow(&mut self, report: &StepperReport) -> bool {
        let (patience, iterations) = (self.options.patience, report.iterations);
        match self.solves {
            Solves::Complete(_) => iterations > patience || report.rate > SLOW,
            // A new one takes many, too: only what has been added since counts.
            Solves::Incomplete(_) => {
                if self.usual == 0 {
                    self.usual = iterations;
                }
                iterations > self.usual + self.usual / 4 + patience
            }
        }
    }

    /// What preconditions the steps.
    pub fn preconditioner(&self) -> Preconditioner {
        match self.solves {
            Solves::Complete(_) => Preconditioner::Complete,
            Solves::Incomplete(_) => Preconditioner::Incomplete,
        }
    }

    /// Forces, tangent and energy at the positions `self.at`.
    fn linearize(&mut self) {
        for ((d, rest), &node) in self.d.iter_mut().zip(&self.rest).zip(&self.node) {
            *d = to_node(&(self.at[node as usize] - rest));
        }
        self.state += 1;
        self.linearize_elements();
    }

    /// Forces, tangent and energy at the displacements `self.d`.
    pub(crate) fn linearize_elements(&mut self) {
        self.force.fill([T::ZERO; 4]);
        self.elastic = 0.0;
        for kernel in &mut self.kernels {
            self.elastic += kernel.linearize(&self.d, &mut self.force);
        }
    }

    /// A new factor of the matrix as it is, where the refresher is at hand; otherwise the old one has to do.
    pub(crate) fn refresh(&mut self, factors: (f64, f64)) -> Result<(), CondenseError> {
        if let Some(refresher) = &mut self.refresher {
            refresher.load(&self.d, factors);
            refresher.work()?;
            self.factors = refresher.exchange(&mut self.solves);
            self.stale = false;
            self.usual = 0;
        }
        Ok(())
    }

    /// Where a new factor is worth its while, what makes it: [`work`](Refresher::work) it, on any thread, and
    /// [give it back](Self::give_back). With [`StepperOptions::refresh`] off nobody else does.
    pub fn lend(&mut self) -> Option<Box<Refresher<T>>> {
        if !self.stale {
            return None;
        }
        let factors = self.factors?;
        let mut refresher = self.refresher.take()?;
        refresher.load(&self.d, factors);
        Some(refresher)
    }

    /// Takes the refresher back, and the factor that it has made; of another epoch, both are of no use.
    pub fn give_back(&mut self, mut refresher: Box<Refresher<T>>) {
        if refresher.epoch != self.epoch {
            return;
        }
        if let Some(factors) = refresher.exchange(&mut self.solves) {
            self.factors = Some(factors);
            self.stale = false;
            self.usual = 0;
        }
        self.refresher = Some(refresher);
    }

    /// The residual of the guess; returns the norm of the forces against which it is to be small (N): those that
    /// act on the free nodes, and what moves them. That is what a hand does within the step, all of which is in
    /// the residual; where no hand moves it is inertia, and a bad guess is no excuse.
    fn start(&mut self, body: &Body, h: f64, mass_factor: f64, stiffness_factor: f64) -> f64 {
        let (mut acting, mut momentum) = (0.0, 0.0);
        self.began.copy_from_slice(&self.force);
        for (place, r) in self.residual.iter_mut().enumerate() {
            let node = self.node[place] as usize;
            let mass = self.mass[place];
            let internal = to_vec(&self.force[place]);
            let external = body.model.external[node] * body.model.load_factor;
            let inertia = body.state.v[node] / h - to_vec(&self.u[place]) * mass_factor;
            *r = to_node(&(internal + external + inertia * mass));
            if place < self.free {
                acting += internal.norm_squared() + external.norm_squared();
                momentum += (body.state.v[node] * (mass / h)).norm_squared();
            }
        }
        for kernel in &self.kernels {
            kernel.product(-T::of(stiffness_factor), &self.u, &mut self.residual);
        }
        let held = self.u[self.free..].iter().flatten();
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
