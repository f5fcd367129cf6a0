//! Bodies that are joined, solved together.
//!
//! The equations of the bodies and the [`Joints`] between them are one symmetric positive definite system. Conjugate
//! gradients solve it, preconditioned by the factor of each body for itself (Saad, "Iterative methods for sparse linear
//! systems", algorithm 9.1, with a block diagonal preconditioner). The stages of each body before and after the solution
//! are those of a body alone: `predict`, `constrain`, then [`solve`] for all, `finish`.

use super::joint_equation::JointEquation;
use super::stepper::Limits;
use crate::Vec3;
use crate::body::{Body, BodyMap};
use crate::contact::row::Response;

/// A node of a joined body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct At {
    /// The body, by its number among the joined bodies.
    pub body: usize,
    /// The node.
    pub node: u32,
}

/// Forces between bodies that are linear in the displacements of a step: `f - K u` with a symmetric positive semidefinite
/// `K`.
pub trait Joints: Send {
    /// Takes the state of a body at the start of a step of `h` seconds. Called for each joined body, in their order.
    fn begin(&mut self, body: usize, state: &Body, h: f64);

    /// Calls `add` with the force (N) on each joined node for the displacements `of` nodes over the step (m).
    fn forces(&self, of: &dyn Fn(At) -> Vec3, add: &mut dyn FnMut(At, Vec3));

    /// Calls `add` with the product (N) of `K` with the displacements `of` nodes (m), for each joined node.
    fn product(&self, of: &dyn Fn(At) -> Vec3, add: &mut dyn FnMut(At, Vec3));

    /// Follows a body whose mesh has been replaced: `map` leads from its new vertices to the old ones. Returns whether the
    /// joints hold on. If not, which is the default, the bodies are joined no longer.
    fn follow(&mut self, _body: usize, _map: &BodyMap) -> bool {
        false
    }
}

/// Room for the work of [`solve`], which is reused from step to step.
#[derive(Debug, Default)]
pub struct Workspace {
    pub(super) forces: Vec<(At, Vec3)>,
    /// The norm of the residual on free axes (N), and of the forces of the joints (N), of each body.
    pub(super) left: Vec<f64>,
    pub(super) loads: Vec<f64>,
    /// The responses of contacts, by row.
    pub(super) responses: Vec<Option<Response>>,
}

impl Workspace {
    /// Computes the forces of the joints, and their norm for each body.
    fn load<E: JointEquation>(&mut self, bodies: &[Option<E>], joints: &dyn Joints) {
        self.forces.clear();
        let forces = &mut self.forces;
        joints.forces(
            &|node| at(bodies, node, E::displacement),
            &mut |node, force| forces.push((node, force)),
        );
        self.loads.clear();
        self.loads.resize(bodies.len(), 0.0);
        for (at, force) in &self.forces {
            self.loads[at.body] = self.loads[at.body].hypot(force.norm());
        }
    }

    /// Whether the residual of each body is small.
    pub(super) fn is_solved<E: JointEquation>(&self, bodies: &[Option<E>]) -> bool {
        let mut each = bodies.iter().zip(&self.left).zip(&self.loads);
        each.all(|((body, left), load)| body.as_ref().is_none_or(|body| *left <= body.goal(*load)))
    }
}

/// Solves a shape of a local model over bodies that touch, from the residuals of their equations. `product` is that of the
/// springs between them. Returns the number of iterations and the residual over all bodies (N).
pub(crate) fn solve_shape<E: JointEquation>(
    bodies: &mut [Option<E>],
    room: &mut Workspace,
    product: &Product<'_>,
    limits: Limits,
) -> (usize, f64) {
    let whole = |left: &[f64]| left.iter().map(|left| left * left).sum::<f64>().sqrt();
    room.left.clear();
    let residuals = bodies.iter_mut();
    room.left
        .extend(residuals.map(|body| body.as_mut().map_or(0.0, JointEquation::residual)));
    if whole(&room.left) <= limits.start {
        return (0, whole(&room.left));
    }
    let goal = limits.goal;
    let iterations = iterate(
        bodies,
        room,
        product,
        |_, room| whole(&room.left) <= goal,
        &mut || false,
    );
    (iterations, whole(&room.left))
}

/// The value at a node of the bodies; zero for a body that takes no part.
pub(crate) fn at<E>(bodies: &[Option<E>], at: At, of: impl Fn(&E, u32) -> Vec3) -> Vec3 {
    let body = bodies.get(at.body).and_then(Option::as_ref);
    body.map_or_else(Vec3::zeros, |body| of(body, at.node))
}

/// Solves the equations of bodies and the joints between them. A body without an equation stands still: the others feel it
/// as held. `out_of_time` is called after each iteration. If it returns true, the step continues with the solution so far.
///
/// The iterations end if the residual of each body is small against its loads and the forces of its joints, or after the most
/// iterations of the first one. Nothing is allocated once `room` has served a step with as many joints.
pub fn solve<E: JointEquation>(
    bodies: &mut [Option<E>],
    joints: &dyn Joints,
    room: &mut Workspace,
    mut out_of_time: impl FnMut() -> bool,
) {
    room.load(bodies, joints);
    for (at, force) in &room.forces {
        if let Some(body) = &mut bodies[at.body] {
            body.load(at.node, force);
        }
    }
    room.left.clear();
    let residuals = bodies.iter_mut();
    room.left
        .extend(residuals.map(|body| body.as_mut().map_or(0.0, E::residual)));
    let iterations = iterate(
        bodies,
        room,
        &|of, add| joints.product(of, add),
        |bodies, room| {
            room.load(bodies, joints);
            room.is_solved(bodies)
        },
        &mut out_of_time,
    );
    room.load(bodies, joints);
    let each = bodies.iter_mut().zip(room.left.iter().zip(&room.loads));
    for (number, (body, (left, load))) in each.enumerate() {
        if let Some(body) = body {
            let own = room.forces.iter().filter(|(at, _)| at.body == number);
            body.solved(
                &mut own.map(|(at, force)| (at.node, *force)),
                *load,
                iterations,
                *left,
            );
        }
    }
}

/// A product of forces between bodies with displacements, as [`Joints::product`].
pub(crate) type Product<'a> = dyn Fn(&dyn Fn(At) -> Vec3, &mut dyn FnMut(At, Vec3)) + 'a;

/// Conjugate gradients over the equations of bodies and a symmetric positive semidefinite `product` between them, from the
/// residuals in `room.left`, until `is_done`. Returns the number of iterations.
pub(super) fn iterate<E: JointEquation>(
    bodies: &mut [Option<E>],
    room: &mut Workspace,
    product: &Product<'_>,
    mut is_done: impl FnMut(&[Option<E>], &mut Workspace) -> bool,
    out_of_time: &mut dyn FnMut() -> bool,
) -> usize {
    let most = bodies.iter().flatten().next().map_or(0, E::most);
    let (mut iterations, mut rz) = (0, 1.0);
    while !is_done(bodies, room) && iterations < most {
        let next: f64 = bodies.iter_mut().flatten().map(E::precondition).sum();
        let beta = if iterations == 0 { 0.0 } else { next / rz };
        rz = next;
        for body in bodies.iter_mut().flatten() {
            body.direct(beta);
        }
        room.forces.clear();
        let products = &mut room.forces;
        product(&|node| at(bodies, node, E::direction), &mut |at, force| {
            products.push((at, force));
        });
        for (at, product) in &room.forces {
            if let Some(body) = &mut bodies[at.body] {
                body.add_product(at.node, product);
            }
        }
        let curvature: f64 = bodies.iter_mut().flatten().map(E::curvature).sum();
        // The matrix is positive definite. Any other curvature is underflow, or a state that has diverged.
        let is_sound = rz > 0.0 && curvature > 0.0 && (rz / curvature).is_finite();
        if !is_sound {
            bodies.iter_mut().flatten().for_each(E::stop);
        }
        for (body, left) in bodies.iter_mut().zip(&mut room.left) {
            if let Some(body) = body.as_mut().filter(|_| is_sound) {
                *left = body.advance(rz / curvature);
            }
        }
        iterations += usize::from(is_sound);
        if !is_sound || out_of_time() {
            break;
        }
    }
    iterations
}
