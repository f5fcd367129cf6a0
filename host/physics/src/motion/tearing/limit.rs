//! How far handles can move before the next tear goes on.
//!
//! In a linear sheet the stress intensities, and with them `sqrt(G)`, are linear in the displacements of the handles. The
//! slope of `sqrt(G)` by each motion of a handle therefore says how far the handle can move until `G` reaches the
//! toughness. It is the difference of `sqrt(G)` between the present positions and positions displaced by a small part of
//! the shape of the motion.

use super::{Tearing, TipState};
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::motion::stepper::Stepper;
use crate::tear::TearLaw;

/// Part of a shape by which the sheet is displaced: so many metres or radians at the handle.
const SMALL: f64 = 1e-6;
/// Least energy release rate with a slope, as a fraction of the toughness. At zero the root has none.
const LEAST: f64 = 0.01;

/// The tip that is nearest to going on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TearLimit {
    /// The root of the energy release rate (sqrt(J/m²)).
    pub root: f64,
    /// The root of the toughness (sqrt(J/m²)).
    pub critical: f64,
}

impl Tearing {
    /// The tip that is nearest to going on, and the slopes of its root by motions of the handles (sqrt(J/m²) per m or
    /// rad). `shape` gives the displacement of a vertex for a motion, by the number of the motion. `None` under the law
    /// `thesis`, and where no tip can go on: all wait for pairs, or are hardly driven.
    #[inline(never)]
    pub fn limit<T: Precision>(
        &mut self,
        body: &Body,
        stepper: &Stepper<T>,
        shape: &dyn Fn(usize, u32) -> Vec3,
        slopes: &mut [f64],
    ) -> Option<TearLimit> {
        let material = self.options.material;
        if material.law == TearLaw::Thesis {
            return None;
        }
        let mut nearest: Option<(TipState, f64)> = None;
        for number in 0..self.tips.len() {
            let tip = self.tips[number];
            if tip
                .pair
                .is_some_and(|nodes| stepper.pairs().iter().any(|pair| pair.nodes == nodes))
            {
                continue;
            }
            let rate = self.drive(body, &tip).map_or(0.0, |drive| drive.rate);
            if rate > nearest.map_or(LEAST * material.toughness, |(_, rate)| rate) {
                nearest = Some((tip, rate));
            }
        }
        let (tip, rate) = nearest?;
        let bending = self.drive(body, &tip)?.bending;
        let root = libm::sqrt(rate);
        let x = body.node_positions();
        self.displaced.clear();
        self.displaced.extend_from_slice(x);
        for (motion, slope) in slopes.iter_mut().enumerate() {
            for vertex in self.patch.vertices() {
                self.displaced[vertex as usize] += shape(motion, vertex) * SMALL;
            }
            self.patch.measure(&self.displaced, &material).ok()?;
            // The share of bending changes little over so small a motion.
            let moved = self.patch.driving().rate() + bending;
            *slope = (libm::sqrt(moved.max(0.0)) - root) / SMALL;
            for vertex in self.patch.vertices() {
                self.displaced[vertex as usize] = x[vertex as usize];
            }
        }
        let critical = libm::sqrt(material.toughness);
        Some(TearLimit { root, critical })
    }
}
