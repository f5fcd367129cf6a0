//! The tips: their driving force, their direction, and the edges by which they go on.

use super::{MOST_EDGES, Tearing, sheet};
use crate::body::Body;
use crate::element::precision::Precision;
use crate::motion::stepper::Stepper;
use crate::tear::fields::stretch;
use crate::tear::strength::{candidate, onwards};
use crate::tear::{Intensity, RINGS, Tip};
use crate::topology::{Edit, NONE, Surface};

/// The largest angle by which an edge turns back to the path (rad): 45 degrees.
const MOST_BACK: f64 = core::f64::consts::FRAC_PI_4;

/// A tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipState {
    /// The vertex.
    pub vertex: u32,
    /// The pair of vertices behind the tip that lets each other go; `None` at the end of a notch and under a law without
    /// letting go.
    pub pair: Option<[u32; 2]>,
    /// Where the path of the tear runs.
    pub course: Course,
}

/// Where the path of a tear runs, as seen from its tip.
///
/// The path is the line that the stress intensities ask for. Edges of the mesh follow it as far as good triangles allow,
/// so the tip lies beside the path, and the last edge has another direction. The tear turns back to its path, so such
/// errors do not add up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Course {
    /// The distance of the tip from the path (m): positive if the tip is on the left.
    pub aside: f64,
    /// The angle from the direction of the last edge to that of the path (rad), counterclockwise.
    pub turned: f64,
}

impl Course {
    /// The angle by which the next edge turns from the path so that it leads back (rad), where edges have about the
    /// length `reach` (m). At most 45 degrees: a tear that comes from large triangles among small ones turns back over
    /// several edges.
    pub fn back(&self, reach: f64) -> f64 {
        -libm::atan2(self.aside, reach).clamp(-MOST_BACK, MOST_BACK)
    }

    /// The course after an edge of the fan angle `angle` (rad) and of this `length` (m), where the path has the fan angle
    /// `path` (rad).
    pub(super) fn after(&self, angle: f64, length: f64, path: f64) -> Self {
        let (sine, cosine) = (libm::sin(path - angle), libm::cos(path - angle));
        Self {
            aside: self.aside - length * sine,
            turned: libm::atan2(sine, cosine),
        }
    }
}

impl TipState {
    /// A tip at the end of a notch.
    pub(super) fn new(vertex: u32) -> Self {
        Self {
            vertex,
            pair: None,
            course: Course::default(),
        }
    }
}

/// What drives a tip.
pub(super) struct Drive {
    /// The energy release rate along its path, with bending (J/m²).
    pub(super) rate: f64,
    /// The share of bending (J/m²).
    pub(super) bending: f64,
    /// The fan angle of the path (rad).
    pub(super) direction: f64,
}

/// The direction straight ahead of a tip.
pub(super) fn ahead(surface: &Surface, vertex: u32) -> Option<Tip> {
    let (triangle, along) = surface.direction_at(vertex, surface.straight_ahead(vertex))?;
    Some(Tip {
        vertex,
        triangle,
        along,
    })
}

impl Tearing {
    /// What drives a tip; `None` for a tip that is held or outside of the surface.
    ///
    /// The tear counts as straight along its path. The direction of the last edge would make the stress intensities err
    /// by the angle between both: triangles do not resolve the field about a kink of one edge.
    pub(super) fn drive(&mut self, body: &Body, tip: &TipState) -> Option<Drive> {
        let surface = body.surface()?;
        let vertex = tip.vertex;
        let direction = surface.straight_ahead(vertex) + tip.course.turned;
        let tip = Tip::at(surface, vertex, direction)?;
        let others = &self.tips;
        let barred = |found: u32| {
            body.is_held(found) || (found != vertex && others.iter().any(|tip| tip.vertex == found))
        };
        self.patch.find(&sheet(surface), &tip, RINGS, barred).ok()?;
        let measured = self
            .patch
            .measure(body.node_positions(), &self.options.material);
        measured.ok()?;
        let material = &self.options.material;
        let bending = body.bending_release(&mut self.patch) / material.thickness;
        Some(Drive {
            rate: self.patch.driving().rate() + bending,
            bending,
            direction,
        })
    }

    /// The edit by which the tip at `vertex` goes on in the direction of a fan angle (rad). A vertex snaps only where
    /// this changes the energy little.
    pub(super) fn growth(&self, body: &Body, vertex: u32, direction: f64) -> Option<Edit> {
        let surface = body.surface()?;
        let may_move = |vertex: u32| !body.is_held(vertex) && !self.is_tip(vertex);
        let advance =
            |snaps: bool| surface.advance(vertex, direction, self.advance_options(snaps), may_move);
        let edit = advance(true)?;
        if self.is_cheap(body, &edit) {
            return Some(edit);
        }
        advance(false)
    }

    /// The edit by which a tip goes on along the path of this fan angle (rad), and the course after the edit.
    fn growth_along(&self, body: &Body, tip: &TipState, path: f64) -> Option<(Edit, Course)> {
        let surface = body.surface()?;
        let back = tip.course.back(surface.mean_edge(tip.vertex));
        let edit = self.growth(body, tip.vertex, path + back)?;
        let (angle, length) = surface.edge_of(tip.vertex, &edit.ahead)?;
        Some((edit, tip.course.after(angle, length, path)))
    }

    /// The angle by which a tip turns that is driven by the energy release rate `rate` (J/m²).
    ///
    /// The stress intensities are those in the plane of the sheet. Where hands tear a sheet out of its plane, most of the
    /// energy comes from the tearing mode and from bending, which drive the tip straight ahead. This part counts with the
    /// opening mode: `K_I` is replaced by `sqrt(E G - K_II^2)` where that is larger. In the plane the two are equal.
    fn kink(&self, rate: f64) -> f64 {
        let found = self.patch.intensity();
        let ahead = self.options.material.young * rate - found.k2 * found.k2;
        let k1 = found.k1.max(libm::sqrt(ahead.max(0.0)));
        Intensity { k1, ..found }.kink()
    }

    /// Lets the tips go on whose energy release rate is at least the toughness. A tip waits until the pair behind it has
    /// let go.
    pub(super) fn advance_by_energy<T: Precision>(
        &mut self,
        body: &mut Body,
        stepper: &mut Stepper<T>,
    ) {
        let mut number = 0;
        while let Some(&(mut tip)) = self.tips.get(number) {
            for _ in 0..MOST_EDGES {
                let Some(drive) = self.drive(body, &tip) else {
                    break;
                };
                self.report.driving = self.report.driving.max(drive.rate);
                let waits = tip
                    .pair
                    .is_some_and(|nodes| stepper.pairs().iter().any(|pair| pair.nodes == nodes));
                // The comparison is false for a rate that is no number.
                let goes_on = drive.rate >= self.options.material.toughness;
                if waits || !goes_on {
                    break;
                }
                let path = drive.direction + self.kink(drive.rate);
                let Some((edit, course)) = self.growth_along(body, &tip, path) else {
                    break;
                };
                let Some([mut next, _]) = self.make(body, stepper, &edit) else {
                    break;
                };
                next.course = course;
                // A met tip before this one has been removed.
                number = self
                    .tips
                    .iter()
                    .position(|found| found.vertex == tip.vertex)
                    .unwrap_or(number);
                tip = next;
                if let Some(entry) = self.tips.get_mut(number) {
                    *entry = next;
                }
                if next.vertex == NONE {
                    break;
                }
            }
            if tip.vertex == NONE {
                self.tips.remove(number);
            } else {
                number += 1;
            }
        }
    }

    /// The law of the thesis: of all tips, the one with the highest principal stress goes on by one edge, if that stress is
    /// at least the strength, orthogonal to the direction of the stress and never backwards (Le Gouis et al. 2017).
    pub(super) fn advance_by_stress<T: Precision>(
        &mut self,
        body: &mut Body,
        stepper: &mut Stepper<T>,
    ) {
        let Some(surface) = body.surface() else {
            return;
        };
        let mut highest: Option<(usize, f64, f64)> = None;
        for (number, tip) in self.tips.iter().enumerate() {
            let Some(from) = ahead(surface, tip.vertex) else {
                continue;
            };
            let view = sheet(surface);
            for corner in surface.fan(tip.vertex) {
                let triangle = corner.triangle as usize;
                let x =
                    view.triangles[triangle].map(|vertex| body.node_positions()[vertex as usize]);
                self.stress[triangle] =
                    stretch(&view.shapes[triangle], x, &self.options.material).stress;
            }
            let found = candidate(&view, tip.vertex, from.triangle, &self.stress);
            self.report.stress = self.report.stress.max(found.stress);
            let along = onwards(found.along, from.along);
            let direction = surface.fan_angle(tip.vertex, from.triangle, along);
            if found.stress >= self.options.material.strength
                && highest.is_none_or(|(_, stress, _)| found.stress > stress)
                && let Some(direction) = direction
            {
                highest = Some((number, found.stress, direction));
            }
        }
        let Some((number, _, direction)) = highest else {
            return;
        };
        let Some(edit) = self.growth(body, self.tips[number].vertex, direction) else {
            return;
        };
        let vertex = self.tips[number].vertex;
        let Some([next, _]) = self.make(body, stepper, &edit) else {
            return;
        };
        if let Some(number) = self.tips.iter().position(|tip| tip.vertex == vertex) {
            if next.vertex == NONE {
                self.tips.remove(number);
            } else {
                self.tips[number] = next;
            }
        }
    }
}
