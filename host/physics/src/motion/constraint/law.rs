//! A law over the difference of two nodes, as an equation of motion takes it.
//!
//! A law has one scalar unknown: its **opening** `s`, the length of the vector from its first node to its second, less or
//! plus what the law keeps. Within a step the opening is taken along the direction at the start of the step. The law gives
//! four things: the force at an opening, which is its value; the gradient of the opening by the difference of the nodes;
//! the slope of the force, which is its tangent; and the energy that the law can give back. Across its direction it is a
//! spring, which is part of the matrix of the step.
//!
//! A law may depend on its history. The history changes only in [`accept`](Law::accept), at the end of a step, so that a
//! step can be solved in any number of rounds.

use crate::Vec3;

/// A law over the difference of two nodes.
pub(crate) trait Law {
    /// The nodes.
    fn nodes(&self) -> [u32; 2];

    /// The gradient of the opening by the difference of the nodes: a unit vector.
    fn gradient(&self) -> Vec3;

    /// The opening at the start of the step (m).
    fn opening(&self) -> f64;

    /// The force of a step (N), along the gradient on the first node, that ends with this opening (m).
    fn value(&self, opening: f64) -> f64;

    /// The slope of [`value`](Self::value) (N/m).
    fn tangent(&self, opening: f64) -> f64;

    /// The slope of [`value`](Self::value) (N/m) as the law closes: the largest one.
    fn stiffness(&self) -> f64;

    /// The stiffness across the gradient (N/m).
    fn across(&self) -> f64;

    /// The energy that the law can give back (J).
    fn energy(&self) -> f64;

    /// A force (N) of the law's own size, to which errors are relative and by which responses are measured.
    fn scale(&self) -> f64;

    /// The opening (m) that agrees with the law if the opening is `free - response force`.
    fn meet(&self, free: f64, response: f64) -> f64;

    /// The present force along the gradient (N).
    fn force(&self) -> f64;

    /// Changes the present force along the gradient (N).
    fn set_force(&mut self, force: f64);

    /// The present force on the first node (N).
    fn pull(&self) -> Vec3;

    /// Takes the present force across the gradient (N) from the change of the difference (m).
    fn shear(&mut self, change: &Vec3);

    /// Whether the law may give back so much energy (J) in a step, up to rounding.
    fn may_give(&self, given: f64) -> bool;

    /// Lets go: no force from now on.
    fn drop_force(&mut self);

    /// The work that the law has taken from the body so far (J).
    fn work(&self) -> f64;

    /// Ends a step with the present forces, in which the difference of the nodes has changed by `change` (m).
    fn accept(&mut self, change: &Vec3);

    /// Whether the law has ended.
    fn is_over(&self) -> bool;

    /// The force across the gradient on the first node (N) after a change of the difference (m).
    fn sideways(&self, change: &Vec3) -> Vec3 {
        let along = self.gradient();
        (change - along * along.dot(change)) * self.across()
    }
}
