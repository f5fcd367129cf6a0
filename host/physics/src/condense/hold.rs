//! What else holds a loose piece, while a tool touches it: the floor on which it lies, and the other tools that squeeze it.
//!
//! Their contacts hold the piece at many nodes. Only their resultant is taken: six patterns of forces, three along the axes and three about
//! them, each spread over the nodes as the normal forces are. A pattern has forces where a contact can take them: along the normal alone
//! where the contact slips. The displacements of the piece by these patterns, and of the patterns by the tool, then eliminate the patterns
//! from the compliance of the tool's sites: the mean motion of what holds the piece is zero.

use crate::Vec3;

/// The number of patterns.
pub(super) const PATTERNS: usize = 6;

/// A node of a piece at a contact of the last step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// The node.
    pub node: u32,
    /// Its part of the normal force of the contact (N).
    pub force: f64,
    /// The normal of the contact; of length one.
    pub normal: Vec3,
    /// Whether the contact slips.
    pub slips: bool,
}

/// Lays out the patterns on nodes at the positions `x` (m): forces on nodes that sum to about one newton, or to one at the mean distance of
/// the nodes from their centre.
pub(super) fn patterns(held: &[Held], x: &[Vec3], loads: &mut [Vec<(u32, Vec3)>]) {
    for load in loads.iter_mut() {
        load.clear();
    }
    let whole: f64 = held.iter().map(|held| held.force).sum();
    if whole <= 0.0 {
        return;
    }
    let place = |held: &Held| x[held.node as usize];
    let centre: Vec3 = held.iter().map(|h| place(h) * (h.force / whole)).sum();
    let spread = held
        .iter()
        .map(|h| h.force / whole * (place(h) - centre).norm_squared());
    let spread = spread.sum::<f64>().sqrt();
    for held in held {
        let weight = held.force / whole;
        let arm = place(held) - centre;
        for (pattern, load) in loads.iter_mut().enumerate() {
            let axis = Vec3::ith(pattern % 3, 1.0);
            let way = match pattern / 3 {
                0 => axis,
                _ if spread > 0.0 => axis.cross(&arm) / spread,
                _ => Vec3::zeros(),
            };
            let way = if held.slips {
                held.normal * held.normal.dot(&way)
            } else {
                way
            };
            if way != Vec3::zeros() {
                load.push((held.node, way * weight));
            }
        }
    }
}
