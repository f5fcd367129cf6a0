//! Certified displacements: nothing crosses, whatever the solver left.

use super::parts::Owner;
use super::{Contacts, Member};
use crate::Vec3;
use crate::contact::Placed;
use crate::contact::certificate::truncate;
use crate::element::precision::Precision;

impl Contacts {
    /// Shortens the solved displacements such that nothing crosses, and keeps the forces for the next step.
    pub fn certify<T: Precision>(&mut self, members: &mut [Member<'_, T>]) {
        let Some(lists) = self.lists.as_mut().filter(|_| !self.is_idle) else {
            return;
        };
        for (part, owner) in self.surfaces.parts.iter().zip(&self.owners) {
            if let Owner::Body(body) = owner
                && let Some(stepper) = &members[*body].stepper
            {
                let nodes = members[*body].body.node_positions().len() as u32;
                for (node, vertex) in (0..nodes).zip(part.vertices.clone()) {
                    self.u[vertex as usize] = stepper.displacement(node);
                }
            }
        }
        let (surfaces, x, u) = (&self.surfaces, &self.x, &self.u);
        lists.extend(surfaces, x, |hierarchy, cluster| {
            let members = hierarchy.members(cluster).iter();
            members
                .map(|vertex| u[*vertex as usize].norm())
                .fold(0.0, f64::max)
        });
        self.fractions.fill(1.0);
        self.is_near.fill(false);
        for touch in &self.touches {
            for (at, _) in touch.nodes.iter().filter(|(_, weight)| *weight != 0.0) {
                self.is_near[at.body] = true;
            }
        }
        let mut mark = |part: usize| {
            if let Owner::Body(body) = self.owners[part] {
                self.is_near[body] = true;
            }
        };
        lists.each(surfaces, x, &mut |pair| {
            for vertex in pair.vertices(surfaces) {
                mark(surfaces.part_of(vertex));
            }
        });
        let mut squeezed = 0;
        for (number, placed) in self.shapes.iter().enumerate() {
            for (part, side) in surfaces.parts.iter().enumerate() {
                if self
                    .meetings
                    .get(part, surfaces.parts.len() + number)
                    .is_none()
                {
                    continue;
                }
                for vertex in side.vertices.clone() {
                    let (at, fraction) = (vertex as usize, &mut self.fractions[vertex as usize]);
                    let (is_near, most) = before(placed, &x[at], &u[at]);
                    if is_near {
                        mark(part);
                    }
                    if most < 1.0 {
                        squeezed += usize::from(self.mass[at].is_infinite() || most < 0.0);
                        *fraction = most.max(0.0);
                    }
                }
            }
        }
        let mass = &self.mass;
        let is_free = |vertex: u32| mass[vertex as usize].is_finite();
        let each = |found: &mut dyn FnMut(crate::contact::Pair)| lists.each(surfaces, x, found);
        self.report.truncated = truncate(surfaces, x, u, &each, &is_free, &mut self.fractions);
        self.report.truncated.squeezed += squeezed;
        for (part, owner) in surfaces.parts.iter().zip(&self.owners) {
            let Owner::Body(body) = owner else { continue };
            let Some(stepper) = members[*body]
                .stepper
                .as_deref_mut()
                .filter(|_| self.is_near[*body])
            else {
                continue;
            };
            let range = part.vertices.start as usize..part.vertices.end as usize;
            let fractions = &self.fractions[range];
            // A step that has not been solved has an error of its own.
            let _ = stepper.certify(&|node| fractions.get(node as usize).copied().unwrap_or(1.0));
        }
        self.end();
    }
}

/// Whether a vertex is near a shape in the step, and the fraction of its displacement with which it stays before the shape:
/// shapes are convex, so the plane at the nearest point divides them. Negative if the shape moves over the vertex.
fn before(placed: &Placed, x: &Vec3, u: &Vec3) -> (bool, f64) {
    let found = placed.at_start(x);
    let motion = placed.motion_to(&(x - found.normal * found.distance));
    let is_near = found.distance <= u.norm() + motion.norm();
    let towards = -found.normal.dot(u);
    let room = 0.95 * found.distance - found.normal.dot(&motion);
    if found.distance <= 0.0 || towards <= room {
        return (is_near, 1.0);
    }
    let most = if room < 0.0 { -1.0 } else { room / towards };
    (is_near, most)
}
