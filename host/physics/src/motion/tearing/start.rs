//! Where new tears start: the vertex with the highest principal stress, once this stress reaches the strength.
//!
//! On a border one tip starts there. Inside the sheet a slit of two edges with two tips starts. The direction is
//! orthogonal to the largest principal stress. Vertices about a tip do not count: the stress at a tip grows with finer
//! triangles without limit, and the energy release rate decides about the tip.
//!
//! For the same reason the end of a sharp notch in the mesh is a tip from the beginning. The mean stress of its fan holds the
//! unloaded flanks, too: it is less than that of a vertex beside the end.

use super::tips::ahead;
use super::{Course, IsClear, MOST_TIPS, OPENING, Tearing, sheet};
use crate::body::Body;
use crate::element::precision::Precision;
use crate::motion::stepper::Stepper;
use crate::tear::RINGS;
use crate::tear::strength::{Candidate, cannot_start, highest, stresses};
use crate::topology::{Edit, Growth, NONE, Surface};

/// The angle of the fan of a border vertex (rad) from which the vertex is the end of a sharp notch: 300 degrees. The flanks
/// of the notch then meet at 60 degrees or less, and the stress grows towards the end by the power 0.49 of the distance or
/// more, where that about a crack grows by 0.5 (Williams, "Stress singularities resulting from various boundary conditions
/// in angular corners of plates in extension", 1952).
const SHARP: f64 = 5.0 / 3.0 * core::f64::consts::PI;

/// How far from a tip the elastic stress may exceed the strength while the tip rests, in Irwin lengths `E G_c / strength^2`.
/// About a crack that is opened by `K` the principal stress is at most `sqrt(27 / 16) K / sqrt(2 pi r)`, at 60 degrees from
/// straight ahead, and `K^2 = E G_c` when the tip advances.
const STRESSED: f64 = 27.0 / 16.0 / core::f64::consts::TAU;

/// Whether a vertex is the free end of a sharp notch in the mesh.
pub(super) fn is_sharp(body: &Body, surface: &Surface, vertex: u32) -> bool {
    surface.on_border(vertex) && surface.total_angle(vertex) >= SHARP && !body.is_held(vertex)
}

impl Tearing {
    /// Starts a tear where the stress is highest, if it reaches the strength.
    pub(super) fn start<T: Precision>(
        &mut self,
        body: &mut Body,
        stepper: &mut Stepper<T>,
        is_clear: &IsClear<'_>,
    ) {
        if self.tips.len() + 2 > MOST_TIPS {
            return;
        }
        let Some(surface) = body.surface() else {
            return;
        };
        let material = self.options.material;
        let view = sheet(surface);
        let density = stresses(&view, body.node_positions(), &material, &mut self.stress);
        if self.options.skips && cannot_start(density, &material) {
            return;
        }
        self.mark_tips(body, surface);
        let may_start = |vertex: u32| !body.is_held(vertex) && !self.near[vertex as usize];
        let Some(found) = highest(&view, &self.stress, material.strength, may_start) else {
            return;
        };
        self.report.stress = found.stress;
        let Some((edit, courses)) = self.beginning(body, surface, &found, is_clear) else {
            return;
        };
        let Some(mut tips) = self.make(body, stepper, &edit) else {
            return;
        };
        self.report.started += 1;
        for (tip, course) in tips.iter_mut().zip(courses) {
            (tip.course, tip.bridge) = (course, tip.pair);
        }
        let new = tips.into_iter().filter(|tip| tip.vertex != NONE);
        self.tips.extend(new);
    }

    /// The edit by which a tear starts at a vertex, and the courses of its tips.
    fn beginning(
        &self,
        body: &Body,
        surface: &Surface,
        found: &Candidate,
        is_clear: &IsClear<'_>,
    ) -> Option<(Edit, [Course; 2])> {
        let vertex = found.vertex;
        let [x, y] = found.along;
        let both = [[x, y], [-x, -y]];
        let direction = both
            .into_iter()
            .find_map(|along| surface.fan_angle(vertex, found.triangle, along))?;
        let may_move = |vertex: u32| !body.is_held(vertex) && !self.is_tip(vertex);
        let choose = |snaps: bool| {
            let options = self.advance_options(snaps, OPENING);
            if surface.on_border(vertex) {
                surface.advance(vertex, direction, options, may_move)
            } else {
                surface.begin_slit(vertex, direction, options, may_move)
            }
        };
        let mut edit = choose(true)?;
        if !self.may_snap(body, &edit, is_clear) {
            edit = choose(false)?;
        }
        let course = |growth: Option<Growth>, path: f64| {
            let edge = growth.and_then(|growth| surface.edge_of(vertex, &growth));
            edge.map_or_else(Course::default, |(angle, length)| {
                Course::default().after(angle, length, path)
            })
        };
        let opposite = direction + 0.5 * surface.total_angle(vertex);
        let courses = [
            course(Some(edit.ahead), direction),
            course(edit.behind, opposite),
        ];
        Some((edit, courses))
    }

    /// Marks the vertices about each tip: up to the ring after the last one of the integrals, and as far as the stress may
    /// reach the strength before the tip advances.
    fn mark_tips(&mut self, body: &Body, surface: &Surface) {
        self.near.fill(false);
        let reach = STRESSED * self.options.material.irwin_length();
        let rest = body.rest_positions();
        for tip in &self.tips {
            let Some(tip) = ahead(surface, tip.vertex) else {
                continue;
            };
            for (near, place) in self.near.iter_mut().zip(rest) {
                *near |= (place - rest[tip.vertex as usize]).norm_squared() <= reach * reach;
            }
            if self
                .patch
                .find(&sheet(surface), &tip, RINGS, |_| false)
                .is_ok()
            {
                for vertex in self.patch.vertices() {
                    self.near[vertex as usize] = true;
                }
            }
        }
    }
}
