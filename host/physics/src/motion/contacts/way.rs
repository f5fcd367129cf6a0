//! Whether the way is clear for a vertex that a tear moves.
//!
//! Snapping moves a vertex in its sheet onto the path of a tear. The vertex stays on the sheet, but its triangles cut off the
//! corner of a sheet that is bent there, and may leave something else on their other side.

use super::parts::Owner;
use super::{Contacts, Need};
use crate::Vec3;
use crate::body::Body;
use crate::contact::Pair;
use crate::contact::aabb::Aabb;
use crate::contact::certificate::is_certain;
use crate::contact::surface::Fan;

/// The fraction of a gap that must be left.
const LEFT: f64 = 0.05;

impl Contacts {
    /// Whether a vertex of the body of this number may go from its place after the present step straight to another place (m)
    /// without passing through anything. Another body may move a vertex in the same step, and the body itself one that is
    /// not beside this one. `is_followed` tells whether the surface is that of the body; of another one only the clearance is
    /// known.
    pub fn is_clear(
        &self,
        number: usize,
        body: &Body,
        vertex: u32,
        to: &Vec3,
        is_followed: bool,
    ) -> bool {
        let Some(of) = (self.owners.iter()).position(|of| *of == Owner::Body(number)) else {
            return true;
        };
        match self.need {
            Need::All if is_followed => {}
            Need::Clearance => {
                let way = to - body.node_positions()[vertex as usize];
                return self.clearance.is_more_than(2.0 * way.norm());
            }
            _ => return false,
        }
        let surfaces = &self.surfaces;
        let part = &surfaces.parts[of];
        let moving = part.vertices.start + vertex;
        let now = |vertex: u32| {
            let at = vertex as usize;
            self.x[at] + self.u[at] * self.fractions[at]
        };
        // Shapes are convex: the plane at the nearest point divides the whole way from them.
        let from = now(moving);
        let is_outside = self.shapes.iter().enumerate().all(|(shape, placed)| {
            let near = placed.at_end(&from);
            let left = near
                .distance
                .min(near.distance + near.normal.dot(&(to - from)));
            left > 0.0
                || self
                    .meetings
                    .get(of, surfaces.parts.len() + shape)
                    .is_none()
        });
        let Some(Fan { triangles, edges }) = surfaces.fan(part, moving) else {
            return false;
        };
        let end = |vertex: u32| if vertex == moving { *to } else { now(vertex) };
        let mut swept = Aabb::of([to]);
        for corner in edges.iter().flat_map(|edge| surfaces.edges[*edge as usize]) {
            swept.add(&now(corner));
        }
        let is_near = |corners: &[u32]| {
            let mut bounds = Aabb::EMPTY;
            for corner in corners {
                bounds.add(&now(*corner));
            }
            bounds.overlaps(&swept)
        };
        let stays_apart = |pair: Pair| {
            pair.is_joined(surfaces) || pair.is_closed(surfaces) || {
                let start = pair.foot_at(surfaces, now);
                is_certain(pair, surfaces, &start, now, end, |gap| LEFT * gap)
            }
        };
        let mut others = (0..surfaces.parts.len())
            .filter(|other| surfaces.may_touch(of, *other))
            .map(|other| &surfaces.parts[other]);
        is_outside
            && others.all(|other| {
                let both_tear = other.tears && other.vertices != part.vertices;
                let mut before_triangles = (other.triangles.clone())
                    .filter(|triangle| is_near(&surfaces.triangles[*triangle as usize]));
                let mut beside_edges =
                    (other.edges.clone()).filter(|edge| is_near(&surfaces.edges[*edge as usize]));
                before_triangles.all(|triangle| {
                    !both_tear && stays_apart(Pair::VertexTriangle(moving, triangle))
                }) && beside_edges.all(|edge| {
                    let mut ends = surfaces.edges[edge as usize].into_iter();
                    ends.all(|end| {
                        let mut own = triangles.iter();
                        own.all(|own| stays_apart(Pair::VertexTriangle(end, *own)))
                    }) && edges
                        .iter()
                        .all(|own| stays_apart(Pair::EdgeEdge(*own, edge)))
                })
            })
    }
}
