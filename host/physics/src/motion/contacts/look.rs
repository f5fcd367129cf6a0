//! Contacts with rounded hulls, looked at again where the solver has brought the surface.
//!
//! The rows of a step are linear, and stand at the points that are nearest in the predicted motion. A coarse surface that a hull
//! dents turns and slides, and other points of its facets come nearest. So the solution is looked at: rows that have become
//! inexact are linearized there, points that lie deep in a hull become contacts, and the step is solved on from there. A surface at
//! rest is looked at once and solved no further. The tick does the same (`rt_core::tool`).

use super::parts::Owner;
use super::{Contacts, MOST_BODIES};
use crate::contact::Step;
use crate::element::precision::Precision;
use crate::motion::stepper::Equation;
use crate::motion::touching::{self, Touch};
use core::ops::Range;

impl Contacts {
    /// Looks at the contacts `range` of an island whose bodies have `lent` their equations, with these numbers of `nodes`.
    /// Returns the new end of the range, if rows have changed; their forces then are no longer in the residuals.
    pub(super) fn look<T: Precision>(
        &mut self,
        lent: &mut [Option<Equation<'_, T>>; MOST_BODIES],
        nodes: &[usize; MOST_BODIES],
        range: Range<usize>,
    ) -> Option<usize> {
        let shapes = self.surfaces.parts.len();
        let of = |touch: usize| &self.rows.contacts()[self.of_row[touch]];
        if !range.clone().any(|touch| of(touch).parts[1] >= shapes) {
            return None;
        }
        for (part, owner) in self.surfaces.parts.iter().zip(&self.owners) {
            let Owner::Body(body) = *owner else { continue };
            let Some(equation) = &lent[body] else {
                continue;
            };
            let u = &mut self.u[part.vertices.start as usize..part.vertices.end as usize];
            for (node, u) in (0..).zip(u.iter_mut().take(nodes[body])) {
                *u = equation.displacement(node);
            }
        }
        let (surfaces, meetings) = (&self.surfaces, &self.meetings);
        let step = Step {
            surfaces,
            obstacles: &self.shapes,
            x: &self.x,
            u: &self.u,
            v: &self.v,
            masses: &self.mass,
            parting: super::PARTING,
            hierarchy: self.lists.as_ref()?.hierarchy(),
            pairs: &|_| {},
            h: self.h,
            meeting: &|one, other| meetings.get(one, other),
        };
        let owners = &self.owners;
        let is_lent = |part: usize| match owners[part] {
            Owner::Body(body) => lent[body].is_some(),
            Owner::Obstacle(_) => false,
        };
        let before = self.rows.contacts().len();
        self.rows.look(&step, &is_lent);
        let (rows, of_row) = (&self.rows, &self.of_row);
        let mut looked_at = range
            .clone()
            .filter_map(|touch| rows.looked_at(&step, of_row[touch]));
        if before == rows.contacts().len() && looked_at.next().is_none() {
            return None;
        }
        touching::unload(lent, &self.touches[range.clone()]);
        for touch in range.clone() {
            let row = self.of_row[touch];
            if let Some((normal, gap)) = self.rows.looked_at(&step, row) {
                self.rows.look_again(row, normal, gap);
                self.touches[touch].look_again(normal, gap);
            }
        }
        let mut end = range.end;
        for row in before..self.rows.contacts().len() {
            let contact = &self.rows.contacts()[row];
            let touch = Touch::new(self.nodes(contact), contact.row);
            self.touches.insert(end, touch);
            self.of_row.insert(end, row);
            end += 1;
        }
        Some(end)
    }
}
