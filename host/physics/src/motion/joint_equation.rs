//! The equation of one of the bodies that are solved together, with the vectors of its conjugate gradients.
//!
//! The equation is `A u = f`. Held nodes and guided axes have prescribed displacements. A step lends its equation
//! (`stepper::Equation`), and so does an equilibrium (`equilibrium::in_contact`).

use crate::Vec3;

/// The equation of one body, for the solvers of several bodies: [`joined`](super::joined) and [`touching`](super::touching).
pub trait JointEquation {
    /// The displacement of a node so far (m). A held node has that of its hand or support.
    fn displacement(&self, node: u32) -> Vec3;

    /// The norm of the residual (N) at which the body is solved, if joints load it with forces of the norm `load` (N).
    fn goal(&self, load: f64) -> f64;

    /// The most iterations.
    fn most(&self) -> usize;

    /// Adds a force (N) on a node to the residual. The residual on held nodes is minus the force of the hand or support.
    fn load(&mut self, node: u32, force: &Vec3);

    /// The norm of the residual on free axes (N).
    fn residual(&mut self) -> f64;

    /// Preconditions the residual. Returns its product with the result.
    fn precondition(&mut self) -> f64;

    /// Computes the next direction, from the preconditioned residual and `beta` times the direction before, and its product
    /// with the matrix.
    fn direct(&mut self, beta: f64);

    /// The direction at a node (m); zero at a held one.
    fn direction(&self, node: u32) -> Vec3;

    /// Adds to the product of the direction with the matrix (N) at a node.
    fn add_product(&mut self, node: u32, value: &Vec3);

    /// The product of the direction with its product.
    fn curvature(&mut self) -> f64;

    /// Moves by `alpha` times the direction. Returns the norm of the residual on free axes (N).
    fn advance(&mut self, alpha: f64) -> f64;

    /// Discards the direction.
    fn stop(&mut self);

    /// Marks the displacement and the residual, for [`along`](Self::along) and [`back`](Self::back).
    fn mark(&mut self);

    /// The products (J) of the residual at the mark, and of the present one, with the displacement since the mark.
    fn along(&self) -> [f64; 2];

    /// Takes the fraction `a` of the displacement since the mark. The residual changes as much as the displacement, as that
    /// of linear forces does; also on held nodes, where the residual is the force of the hand.
    fn back(&mut self, a: f64);

    /// Takes the pairs of a tear into the equation as springs, until it is [solved](Self::solved).
    fn hold_pairs(&mut self);

    /// Gives the pairs of a tear the forces of their laws at the present displacement, by which the residual changes.
    fn let_go(&mut self);

    /// Ends the solve. `forces` are those of the joints on nodes (N), which the residual includes, and `load` is their norm
    /// (N); `residual` is the norm of the residual on free axes (N).
    fn solved(
        &mut self,
        forces: &mut dyn Iterator<Item = (u32, Vec3)>,
        load: f64,
        iterations: usize,
        residual: f64,
    );
}
