//! How far handles can move before the next tear advances.
//!
//! In a linear sheet the stress intensities, and with them the root of the rate that drives a tip (`G` of a tip that rests,
//! `J` of a tip that runs), are linear in the displacements of the handles. The slope of the root by each motion of a handle
//! therefore says how far the handle can move until the rate reaches the toughness. It is the difference of the root
//! between the present positions and positions displaced by a small part of the shape of the motion.

use super::tips::{Drive, MARGIN};
use super::{Tearing, TipState};
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::motion::stepper::Stepper;
use crate::tear::TearLaw;

/// Part of a shape by which the sheet is displaced: this number of metres or radians at the handle.
const SMALL: f64 = 1e-6;
/// Least energy release rate with a slope, as a fraction of the toughness. At zero the root has none.
const LEAST: f64 = 0.01;

/// The tip that is nearest to advancing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TearLimit {
    /// The root of the rate that drives the tip (sqrt(J/m²)).
    pub root: f64,
    /// The root at which the tip advances (sqrt(J/m²)).
    pub critical: f64,
    /// Whether the limit is that of a contact that closes: `critical` is then the gap (sqrt(J)), and `root` minus the time of its
    /// damper (s).
    pub is_touch: bool,
}

impl Tearing {
    /// The tip that is nearest to advancing, and the slopes of its root by motions of the handles (sqrt(J/m²) per m or
    /// rad). `shape` gives the displacement of a vertex for a motion, by the number of the motion. `None` under the law
    /// `thesis`, and if no tip is driven by it, or all are hardly driven.
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
        let mut nearest: Option<(TipState, Drive, f64)> = None;
        for number in 0..self.tips.len() {
            let tip = self.tips[number];
            // The strength drives the tips of a tear that pairs bridge.
            if tip
                .bridge
                .is_some_and(|nodes| stepper.pair(nodes).is_some())
            {
                continue;
            }
            let Some((drive, rate)) = self.driven(body, stepper, &tip) else {
                continue;
            };
            if rate > (nearest.as_ref()).map_or(LEAST * material.toughness, |&(.., rate)| rate) {
                nearest = Some((tip, drive, rate));
            }
        }
        let (tip, mut drive, rate) = nearest?;
        // The patch is that of the last tip, or of none.
        self.lay_patch(body, &tip)?;
        // The turn of the tear and the shares of bending and inertia change little over so small a motion.
        let (present, bending) = (drive.rate, drive.bending);
        let mut root_at = |driving: f64| {
            drive.rate = driving + bending;
            let moved = if tip.pair.is_some() {
                drive.flow()
            } else {
                drive.rate * rate / present
            };
            libm::sqrt(moved.max(0.0))
        };
        let root = libm::sqrt(rate);
        let x = body.node_positions();
        self.displaced.clear();
        self.displaced.extend_from_slice(x);
        for (motion, slope) in slopes.iter_mut().enumerate() {
            for vertex in self.patch.vertices() {
                self.displaced[vertex as usize] += shape(motion, vertex) * SMALL;
            }
            self.patch
                .measure_driving(&self.displaced, &material)
                .ok()?;
            *slope = (root_at(self.patch.driving().rate()) - root) / SMALL;
            for vertex in self.patch.vertices() {
                self.displaced[vertex as usize] = x[vertex as usize];
            }
        }
        let waits = tip.pair.and_then(|nodes| stepper.pair(nodes));
        let margin = if waits.is_some() { 1.0 + MARGIN } else { 1.0 };
        let critical = libm::sqrt(margin * material.toughness);
        Some(TearLimit {
            root,
            critical,
            is_touch: false,
        })
    }
}
