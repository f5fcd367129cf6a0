//! Bodies that are joined, solved together.
//!
//! The equations of the bodies and the [`Joints`] between them are one symmetric positive definite system. Conjugate
//! gradients solve it, preconditioned by the factor of each body for itself (Saad, "Iterative methods for sparse linear
//! systems", algorithm 9.1, with a block diagonal preconditioner). The stages of each body before and after the solution
//! are those of a body alone: `predict`, `constrain`, then [`solve`] for all, `finish`.

use super::stepper::Equation;
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;

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
}

/// Solves the equations of bodies and the joints between them. `out_of_time` is called after each iteration. If it returns
/// true, the step continues with the solution so far.
///
/// The iterations end if the residual of each body is below the goal of its equation, or after the most iterations of the
/// first one.
pub fn solve<T: Precision>(
    mut bodies: Vec<Equation<'_, T>>,
    joints: &dyn Joints,
    mut out_of_time: impl FnMut() -> bool,
) {
    let mut forces: Vec<(At, Vec3)> = Vec::new();
    let at = |bodies: &[Equation<'_, T>], at: At| bodies[at.body].displacement(at.node);
    joints.forces(&|node| at(&bodies, node), &mut |node, force| {
        forces.push((node, force));
    });
    for (at, force) in &forces {
        bodies[at.body].load(at.node, force);
    }
    let limits: Vec<(f64, usize)> = bodies.iter().map(Equation::limits).collect();
    let mut left: Vec<f64> = bodies.iter_mut().map(Equation::residual).collect();
    let most = limits.first().map_or(0, |(_, most)| *most);
    let is_solved = |left: &[f64]| {
        let mut pairs = left.iter().zip(&limits);
        pairs.all(|(left, (goal, _))| left <= goal)
    };
    let (mut iterations, mut rz) = (0, 1.0);
    while !is_solved(&left) && iterations < most {
        let next: f64 = bodies.iter_mut().map(Equation::precondition).sum();
        let beta = if iterations == 0 { 0.0 } else { next / rz };
        rz = next;
        for body in &mut bodies {
            body.direct(beta);
        }
        forces.clear();
        joints.product(
            &|at| bodies[at.body].direction(at.node),
            &mut |at, force| forces.push((at, force)),
        );
        for (at, product) in &forces {
            bodies[at.body].add_product(at.node, product);
        }
        let curvature: f64 = bodies.iter_mut().map(Equation::curvature).sum();
        // The matrix is positive definite. Any other curvature is underflow, or a state that has diverged.
        if !(rz > 0.0 && curvature > 0.0 && (rz / curvature).is_finite()) {
            bodies.iter_mut().for_each(Equation::stop);
            break;
        }
        for (body, left) in bodies.iter_mut().zip(&mut left) {
            *left = body.advance(rz / curvature);
        }
        iterations += 1;
        if out_of_time() {
            break;
        }
    }
    forces.clear();
    joints.forces(&|node| at(&bodies, node), &mut |node, force| {
        forces.push((node, force));
    });
    let mut own = Vec::new();
    for (number, (body, left)) in bodies.into_iter().zip(left).enumerate() {
        own.clear();
        let here = forces.iter().filter(|(at, _)| at.body == number);
        own.extend(here.map(|(at, force)| (at.node, *force)));
        body.solved(&own, iterations, left);
    }
}
