//! Where new tears start: the vertex with the highest principal stress, once this stress reaches the strength.
//!
//! On a border one tip starts there. Inside the sheet a slit of two edges with two tips starts. The direction is
//! orthogonal to the largest principal stress. Vertices about a tip do not count: the stress at a tip grows with finer
//! triangles without limit, and the energy release rate decides about the tip.

use super::tips::ahead;
use super::{MOST_TIPS, Tearing, sheet};
use crate::body::Body;
use crate::lanes::Real;
use crate::motion::stepper::Stepper;
use crate::tear::RINGS;
use crate::tear::strength::{Candidate, cannot_start, highest, stresses};
use crate::topology::{Edit, NONE, Surface};

impl Tearing {
    /// Starts a tear where the stress is highest, if it reaches the strength.
    pub(super) fn start<T: Real>(&mut self, body: &mut Body, stepper: &mut Stepper<T>) {
        if self.tips.len() + 2 > MOST_TIPS {
            return;
        }
        let Some(surface) = body.surface() else {
            return;
        };
        let material = self.options.material;
        let view = sheet(surface);
        let density = stresses(&view, body.node_positions(), &material, &mut self.stress);
        if cannot_start(density, &material) {
            return;
        }
        self.mark_tips(surface);
        let may_start = |vertex: u32| !body.is_held(vertex) && !self.near[vertex as usize];
        let Some(found) = highest(&view, &self.stress, material.strength, may_start) else {
            return;
        };
        self.report.stress = found.stress;
        let Some(edit) = self.beginning(body, surface, &found) else {
            return;
        };
        let Some(tips) = self.make(body, stepper, &edit) else {
            return;
        };
        self.report.started += 1;
        let new = tips.into_iter().filter(|tip| tip.vertex != NONE);
        self.tips.extend(new);
    }

    /// The edit by which a tear starts at a vertex.
    fn beginning(&self, body: &Body, surface: &Surface, found: &Candidate) -> Option<Edit> {
        let vertex = found.vertex;
        let may_move = |vertex: u32| !body.is_held(vertex) && !self.is_tip(vertex);
        let choose = |snaps: bool| {
            let options = self.advance_options(snaps);
            if !surface.on_border(vertex) {
                let direction = surface.fan_angle(vertex, found.triangle, found.along)?;
                return surface.begin_slit(vertex, direction, options, may_move);
            }
            let [x, y] = found.along;
            let inwards = [[x, y], [-x, -y]];
            let direction = inwards
                .into_iter()
                .find_map(|along| surface.fan_angle(vertex, found.triangle, along))?;
            surface.advance(vertex, direction, options, may_move)
        };
        let edit = choose(true)?;
        if self.is_cheap(body, &edit) {
            return Some(edit);
        }
        choose(false)
    }

    /// Marks the vertices about each tip, up to the ring after the last one of the integrals.
    fn mark_tips(&mut self, surface: &Surface) {
        self.near.fill(false);
        for tip in &self.tips {
            let Some(tip) = ahead(surface, tip.vertex) else {
                continue;
            };
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
