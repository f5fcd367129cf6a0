//! What a body touches, in its shapes.
//!
//! The contacts of the last step join the equations of the shapes of a body with those of the bodies that it touches, whose
//! hands stand still. With `A` the matrices of all these bodies, each for itself, and the springs `D` of the contacts,
//! conjugate gradients solve `(A + sum J^T D J) Psi = 0` on all free nodes, preconditioned by the factor of each body. The
//! stiffness of the body is then `Psi^T K Psi` over all of them: a block on another block is as stiff as both in series.
//!
//! A hand that moves another body changes the force on the hands of this one. The reaction of a shape on the nodes which the
//! other hand holds tells by how much (reciprocity), and the drift of the model contains it.

use super::reduction::Reduction;
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::lanes::{to_node, to_vec};
use crate::motion::constraint::by_node;
use crate::motion::contacts::{MOST_BODIES, Spring};
use crate::motion::joined::{At, Workspace, solve_shape};
use crate::motion::stepper::{Equation, Limits, Stepper};
use crate::motion::tearing::TearLimit;

/// A body that is touched.
#[derive(Debug)]
pub struct Beside<'a, T> {
    /// The body.
    pub body: &'a Body,
    /// Its stepper.
    pub stepper: &'a mut Stepper<T>,
}

/// What a body touches.
#[derive(Debug)]
pub struct Around<'a, T> {
    /// The number of the body.
    pub number: usize,
    /// The contacts of the body and of those that share contacts with it.
    pub springs: &'a [Spring],
    /// These, and after them the contacts that close before the next model.
    pub coming: &'a [Spring],
    /// The other bodies, by number. A body that is left out stands still.
    pub others: [Option<Beside<'a, T>>; MOST_BODIES],
    /// Room for the solver.
    pub room: &'a mut Workspace,
}

/// The shapes of a body that is touched, by column, then by node: the displacement of a free node, and the force of the body
/// on a held one.
#[derive(Clone, Debug, Default)]
struct Part {
    factors: (f64, f64),
    fields: Vec<Vec3>,
}

impl Part {
    fn of(&self, column: usize, nodes: usize) -> &[Vec3] {
        self.fields
            .get(nodes * column..nodes * (column + 1))
            .unwrap_or(&[])
    }
}

/// The shapes of the bodies that a body touches.
#[derive(Clone, Debug, Default)]
pub(super) struct Parts {
    parts: [Part; MOST_BODIES],
    /// Whether a shape may be there.
    is_used: bool,
}

impl Parts {
    /// Forgets the shapes of the bodies, which no longer touch.
    pub(super) fn clear(&mut self, reduction: &mut Reduction) {
        if core::mem::take(&mut self.is_used) {
            for part in &mut self.parts {
                part.fields.fill(Vec3::zeros());
            }
            reduction.damped.fill(0.0);
        }
    }

    /// Makes room for the shapes of the others, for models published every `period` seconds.
    pub(super) fn begin<T: Precision>(
        &mut self,
        around: &mut Around<'_, T>,
        columns: usize,
        period: f64,
    ) {
        self.is_used = true;
        for (part, other) in self.parts.iter_mut().zip(&mut around.others) {
            let is_sound = |other: &Beside<'_, T>| {
                other.stepper.is_ready() && other.stepper.epoch == other.body.epoch()
            };
            if !other.as_ref().is_some_and(is_sound) {
                *other = None;
                part.fields.fill(Vec3::zeros());
            } else if let Some(other) = other {
                let config = &other.body.model.config;
                part.factors = (
                    1.0 / (period * period) + config.mass_damping / period,
                    1.0 + config.stiffness_damping / period,
                );
                let size = columns * other.body.state.x.len();
                if part.fields.len() != size {
                    part.fields.clear();
                    part.fields.resize(size, Vec3::zeros());
                }
            }
        }
    }

    /// Loads the shapes of the others and the forces of the springs into the vectors of the conjugate gradients, after the
    /// column of the body was laid with the factor `stiffness_factor`.
    pub(super) fn lay<T: Precision>(
        &self,
        own: &mut Stepper<T>,
        around: &mut Around<'_, T>,
        column: usize,
        stiffness_factor: f64,
    ) {
        for (part, other) in self.parts.iter().zip(&mut around.others) {
            let Some(Beside { body, stepper }) = other else {
                continue;
            };
            let (mass_factor, stiffness_factor) = part.factors;
            let field = part.of(column, body.state.x.len());
            for place in stepper.places.taken() {
                let node = stepper.places.node[place] as usize;
                let is_free = place < stepper.places.free;
                let u = field.get(node).filter(|_| is_free);
                let u = u.copied().unwrap_or_default();
                let inertia = -mass_factor * stepper.places.mass[place];
                stepper.cg.u[place] = to_node(&u);
                stepper.cg.residual[place] = to_node(&(u * inertia));
            }
            stepper.subtract_elements(stiffness_factor);
        }
        for spring in around.springs {
            let moved = spring.difference(&|at| around.displacement(own, at));
            let force = spring.stiffness * moved * -stiffness_factor;
            spring.add(&force, &mut |at, force| {
                if at.body == around.number {
                    own.load(at.node, &force);
                } else if let Some(other) = &mut around.others[at.body] {
                    other.stepper.load(at.node, &force);
                }
            });
        }
    }

    /// Solves the column that was laid. Returns the number of iterations and the residual (N).
    pub(super) fn solve<T: Precision>(
        &self,
        own: &mut Stepper<T>,
        around: &mut Around<'_, T>,
        factors: (f64, f64),
        limits: Limits,
    ) -> (usize, f64) {
        let mut bodies: [Option<Equation<'_, T>>; MOST_BODIES] = [const { None }; MOST_BODIES];
        let others = around.others.iter_mut().zip(&self.parts);
        for (body, (other, part)) in bodies.iter_mut().zip(others) {
            if let Some(other) = other {
                *body = Some(other.stepper.shape_equation(part.factors, limits));
            }
        }
        bodies[around.number] = Some(own.shape_equation(factors, limits));
        let springs = around.springs;
        solve_shape(
            &mut bodies,
            around.room,
            &|of, add| {
                for spring in springs {
                    let moved = spring.difference(of);
                    spring.add(&(spring.stiffness * moved * factors.1), add);
                }
            },
            limits,
        )
    }

    /// Stores the shapes of the others by a column, and adds their part of the products of the columns to the reduction of the
    /// body. The body has the factor `stiffness_factor` and the damping `beta` (s).
    ///
    /// On the free nodes of another body with the factors `a` of mass and `b` of stiffness the residual is
    /// `R = -(a M + b K) u - b' D u`, with the factor `b'` of the body and the product `D u` with the springs. Thus
    /// `K u = -(R + a M u) / b - (b' / b) D u`.
    pub(super) fn keep<T: Precision>(
        &mut self,
        own: &Stepper<T>,
        around: &Around<'_, T>,
        column: usize,
        reduction: &mut Reduction,
        (stiffness_factor, beta): (f64, f64),
    ) {
        let count = reduction.columns.len();
        for row in 0..count {
            reduction.damped[(row, column)] = 0.0;
        }
        for (part, other) in self.parts.iter_mut().zip(&around.others) {
            let Some(Beside { body, stepper }) = other else {
                continue;
            };
            let config = &body.model.config;
            let nodes = body.state.x.len();
            let (mass_factor, own_factor) = part.factors;
            for place in stepper.places.taken() {
                let node = stepper.places.node[place] as usize;
                let (u, mass) = (to_vec(&stepper.cg.u[place]), stepper.places.mass[place]);
                let residual = to_vec(&stepper.cg.residual[place]);
                if place >= stepper.places.free {
                    part.fields[nodes * column + node] = -residual / own_factor;
                    continue;
                }
                part.fields[nodes * column + node] = u;
                let product = -(residual + u * (mass_factor * mass)) / own_factor;
                for row in 0..count {
                    let shape = part.fields[nodes * row + node];
                    reduction.left[(row, column)] -= shape.dot(&product);
                    reduction.damped[(row, column)] += config.mass_damping * mass * shape.dot(&u)
                        + (config.stiffness_damping - beta) * shape.dot(&product);
                }
            }
        }
        for spring in around.springs {
            let moved = spring.difference(&|at| around.displacement(own, at));
            spring.add(&(spring.stiffness * moved), &mut |at, force| {
                let Some(Beside { body, stepper }) = &around.others[at.body] else {
                    return;
                };
                if !stepper.is_free(at.node) {
                    return;
                }
                let part = &self.parts[at.body];
                let ratio = stiffness_factor / part.factors.1;
                let more = body.model.config.stiffness_damping - beta;
                let nodes = body.state.x.len();
                for row in 0..count {
                    let along = part.of(row, nodes)[at.node as usize].dot(&force);
                    reduction.left[(row, column)] -= (1.0 - ratio) * along;
                    reduction.damped[(row, column)] -= ratio * more * along;
                }
            });
        }
    }

    /// The rate of the force on the hands by a column that the motion of the other bodies adds to the drift (N/s): their own
    /// motion, as far as they do not follow the hands, and that of the hands that hold them.
    pub(super) fn drift<T: Precision>(
        &self,
        around: &Around<'_, T>,
        reduction: &Reduction,
        column: usize,
    ) -> f64 {
        let mut rate = 0.0;
        for (part, other) in self.parts.iter().zip(&around.others) {
            let Some(Beside { body, stepper }) = other else {
                continue;
            };
            let nodes = body.state.x.len();
            let ratio = part.factors.0 / part.factors.1;
            let field = part.of(column, nodes);
            for place in stepper.places.taken() {
                let node = stepper.places.node[place] as usize;
                let v = body.state.v[node];
                if place >= stepper.places.free {
                    rate -= field[node].dot(&v);
                    continue;
                }
                let mut moves = v;
                for (row, speed) in reduction.speeds.iter().enumerate() {
                    moves -= part.of(row, nodes)[node] * *speed;
                }
                rate += ratio * stepper.places.mass[place] * field[node].dot(&moves);
            }
        }
        rate
    }

    /// The rate of the force on the hands by a column that contacts which have just closed add to the drift (N/s), for models
    /// published every `period` seconds.
    ///
    /// The drift is that of an implicit step in which the springs `D` of the contacts have the damper `beta D`, as the elements
    /// have. A contact has none. At the start of the step its damper had the force `beta D J v`, which no contact exerts, so that
    /// the step changes the force on the hands by `-beta (D J Psi) . J v` more. This is the force of the dampers between the hands
    /// and a node that still moves: its contact stops it long before the next model comes.
    ///
    /// `J v` is the approach along the normal alone: a node that leaves is not held, and friction may not suffice to stop one that
    /// moves across. A node that came to its contact with the hands is no faster than they are, so that the dampers add no more
    /// than for the whole stiffness of the column. A faster node chatters, and tells nothing of the time until the next model.
    pub(super) fn stopping<T: Precision>(
        &self,
        body: &Body,
        around: &Around<'_, T>,
        reduction: &Reduction,
        column: usize,
        period: f64,
    ) -> f64 {
        let mut stopped = 0.0;
        for spring in around.springs.iter().filter(|spring| spring.closes == 0.0) {
            let velocity = spring.difference(&|at| around.velocity(body, at)) - spring.carried;
            let approach = spring.normal.dot(&velocity).min(0.0);
            let moved = spring.difference(&|at| self.shape(around, reduction, column, at));
            stopped -= approach * spring.normal.dot(&(spring.stiffness * moved));
        }
        let most = reduction.rate(column);
        body.model.config.stiffness_damping / period * stopped.max(-most).min(most)
    }

    /// The limit of the contacts between the body and the side on which it presses most; `None` if it presses on no other. `slopes`
    /// receives a number for each column.
    ///
    /// With the resultant `N` of the normal forces and its slope `n` by the columns, the sides part where `N + n . d = 0`. This is
    /// the limit of a tear: `s + q . d` reaches `s_c`. Beyond it the body yields along `q`, and it holds again when the hand turns
    /// back. There is no limit to friction: the contacts of two sides slip one after the other, which one number does not describe.
    pub(super) fn limit<T: Precision>(
        &self,
        around: &Around<'_, T>,
        reduction: &Reduction,
        slopes: &mut [f64],
    ) -> Option<TearLimit> {
        let springs = around.springs;
        let between = |pair: [usize; 2]| springs.iter().filter(move |s| s.sorted() == pair);
        let mut found: Option<([usize; 2], f64)> = None;
        for (at, spring) in springs.iter().enumerate() {
            let pair = spring.sorted();
            let is_new = springs[..at].iter().all(|other| other.sorted() != pair);
            if is_new && spring.leaves(around.number) {
                let pressed = between(pair).map(|spring| spring.pressed).sum();
                if found.is_none_or(|(_, most)| pressed > most) {
                    found = Some((pair, pressed));
                }
            }
        }
        let (pair, pressed) = found?;
        let count = reduction.columns.len().min(slopes.len());
        for (column, slope) in slopes.iter_mut().enumerate().take(count) {
            let normal = |spring: &Spring| {
                let moved = spring.difference(&|at| self.shape(around, reduction, column, at));
                spring.normal.dot(&(spring.stiffness * moved))
            };
            *slope = between(pair).map(normal).sum();
        }
        Some(TearLimit {
            root: 0.0,
            critical: pressed,
            is_touch: false,
        })
    }

    /// When the contacts that come close (s), from now, and the fraction of them that one spring has to have. The spring then has
    /// the force that all of them have at the end of the look ahead, and closes at the mean of their times by their parts of this
    /// force: a contact that closes late matters little yet. The parts are those of the body with these contacts.
    pub(super) fn closing<T: Precision>(
        &self,
        around: &Around<'_, T>,
        reduction: &Reduction,
    ) -> Option<(f64, f64)> {
        let [mut sum, mut forces, mut weights, mut end] = [0.0; 4];
        for spring in around.springs.iter().filter(|spring| spring.closes > 0.0) {
            let mut moved = Vec3::zeros();
            for (column, speed) in reduction.speeds.iter().enumerate() {
                let shape = |at| self.shape(around, reduction, column, at);
                moved += spring.difference(&shape) * *speed;
            }
            let pressed = -spring.normal.dot(&(spring.stiffness * moved));
            let force = pressed.max(0.0) * spring.lasts;
            weights += pressed.max(0.0);
            forces += force;
            sum += force * spring.closes;
            end = spring.closes + spring.lasts;
        }
        (forces > 0.0).then(|| {
            let time = sum / forces;
            (time, forces / (weights * (end - time)))
        })
    }

    /// The displacement of a node by a column.
    fn shape<T: Precision>(
        &self,
        around: &Around<'_, T>,
        reduction: &Reduction,
        column: usize,
        at: At,
    ) -> Vec3 {
        if at.body == around.number {
            return reduction.displacement(column, at.node);
        }
        let other = around.others[at.body].as_ref();
        let other = other.filter(|other| other.stepper.is_free(at.node));
        other.map_or_else(Vec3::zeros, |other| {
            self.parts[at.body].of(column, other.body.state.x.len())[at.node as usize]
        })
    }
}

impl<T: Precision> Around<'_, T> {
    /// The velocity of a node; zero for a body that is left out.
    fn velocity(&self, own: &Body, at: At) -> Vec3 {
        let other = self.others[at.body].as_ref().map(|other| other.body);
        let body = if at.body == self.number {
            Some(own)
        } else {
            other
        };
        body.map_or_else(Vec3::zeros, |body| body.state.v[at.node as usize])
    }

    /// The displacement of a node in the vectors of the conjugate gradients.
    fn displacement(&self, own: &Stepper<T>, at: At) -> Vec3 {
        let of = |stepper: &Stepper<T>| by_node(&stepper.places.of, &stepper.cg.u)(at.node);
        if at.body == self.number {
            return of(own);
        }
        let other = self.others[at.body].as_ref();
        other.map_or_else(Vec3::zeros, |other| of(other.stepper))
    }
}
