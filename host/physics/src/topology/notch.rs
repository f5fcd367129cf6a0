//! Notches and slits that a surface has before the first step.
//!
//! They are made by the edits of a tear. So they need a surface that is flat at rest, with all shapes in one frame.

use core::ops::Range;

use super::NONE;
use super::advance::AdvanceOptions;
use super::edit::{Done, Edit, EditError, Growth, Moved};
use super::surface::{Shape, Surface, between, cross, dot, length, minus, twice_area};
use thiserror::Error;

/// A straight notch or slit in the plane of a flat surface at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Notch {
    /// One end (m). A notch begins if this end is on the border, or outside; a slit begins inside.
    pub from: [f64; 2],
    /// The other end (m).
    pub to: [f64; 2],
}

/// Why a notch was not made, or not wholly.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum NotchError {
    /// The triangles at a vertex do not lie in one frame at rest.
    #[error(
        "a notch needs a surface that is flat at rest, but vertex {vertex} has two places in the plane"
    )]
    NotFlat {
        /// The vertex.
        vertex: u32,
    },
    /// The ends are not finite, or coincide.
    #[error("the ends of a notch are two points with finite coordinates")]
    Ends,
    /// No edge leads on: the notch points out of the surface, or leaves too thin triangles.
    #[error("no edge leads from vertex {vertex} on towards the end of the notch")]
    Blocked {
        /// The vertex.
        vertex: u32,
    },
    /// An edit was refused.
    #[error("the notch stopped: {0}")]
    Edit(#[from] EditError),
}

/// How far a vertex may have two places, as a fraction of an edge.
const SAME_PLACE: f64 = 1e-9;

/// A notch begins at a vertex of the border if its end is within this fraction of an edge from the vertex.
const AT_VERTEX: f64 = 0.15;

impl Surface {
    /// Makes a notch or a slit. Returns its tips: at `to`, and at `from` for a slit. [`NONE`] stands for an end at a
    /// border. An end inside the surface is met exactly if a vertex can move there, and else within half an edge.
    ///
    /// `done` is told of each edit, as it is made. An error leaves the edits that were made before.
    ///
    /// # Errors
    /// [`NotchError`]
    pub fn notch(
        &mut self,
        notch: &Notch,
        options: AdvanceOptions,
        may_move: impl Fn(u32) -> bool,
        mut done: impl FnMut(&Self, &Done),
    ) -> Result<[u32; 2], NotchError> {
        let across = length(minus(notch.to, notch.from));
        if !(across > 0.0 && across.is_finite()) {
            return Err(NotchError::Ends);
        }
        self.check_one_frame()?;
        // The ends get their vertices first, while no border of the notch holds vertices beside them.
        let border = self.border_at(notch.from);
        let end = self.bring_vertex_to(notch.to, &may_move, &mut done);
        if let Some((edge, at)) = border {
            let root = if at <= AT_VERTEX {
                edge[0]
            } else if at >= 1.0 - AT_VERTEX {
                edge[1]
            } else {
                self.divide_border(edge, at, &mut done)?
            };
            return Ok([
                self.lead(root, notch.to, options, &may_move, &mut done)?,
                NONE,
            ]);
        }
        let begin = self.bring_vertex_to(notch.from, &may_move, &mut done);
        let middle = self.middle_on(notch, [begin, end], &may_move, &mut done)?;
        let blocked = NotchError::Blocked { vertex: middle };
        let at = self.place(middle).unwrap_or_default();
        // A vertex beside the slit begins it parallel to the line, and the tips turn to its ends.
        let direction = self
            .direction_to(
                middle,
                [
                    at[0] + notch.to[0] - notch.from[0],
                    at[1] + notch.to[1] - notch.from[1],
                ],
            )
            .ok_or(blocked)?;
        let edit = self
            .begin_slit(middle, direction, options, &may_move)
            .ok_or(blocked)?;
        let begun = self.edit(&edit)?;
        done(self, &begun);
        let mut tips = begun.tips;
        for (tip, end) in tips.iter_mut().zip([notch.to, notch.from]) {
            if *tip != NONE {
                *tip = self.lead(*tip, end, options, &may_move, &mut done)?;
            }
        }
        Ok(tips)
    }

    /// Lets a tear grow from `tip` to a point. Returns its last tip, or [`NONE`] if it ended at a border.
    fn lead(
        &mut self,
        tip: u32,
        to: [f64; 2],
        options: AdvanceOptions,
        may_move: &impl Fn(u32) -> bool,
        done: &mut impl FnMut(&Self, &Done),
    ) -> Result<u32, NotchError> {
        let mut tip = tip;
        // Each edit of a straight path passes a triangle, so their number is an ample limit.
        for _ in 0..self.limits.triangles {
            let blocked = NotchError::Blocked { vertex: tip };
            let left = length(minus(to, self.place(tip).unwrap_or(to)));
            let shortest = self.shortest_edge(tip);
            if left <= SAME_PLACE * shortest {
                return Ok(tip);
            }
            let direction = self.direction_to(tip, to).ok_or(blocked)?;
            let mut edit = self
                .advance(tip, direction, options, may_move)
                .ok_or(blocked)?;
            let (_, size) = self.edge_of(tip, &edit.ahead).ok_or(blocked)?;
            let last = left < size * (1.0 - SAME_PLACE);
            if last {
                match self.snap_to(tip, to, may_move) {
                    Some(end) => edit = end,
                    None if 2.0 * left < size => return Ok(tip),
                    None => {}
                }
            }
            let grown = self.edit(&edit)?;
            done(self, &grown);
            if last || grown.tips[0] == NONE {
                return Ok(grown.tips[0]);
            }
            tip = grown.tips[0];
        }
        Ok(tip)
    }

    /// The edit that moves a neighbour of the tip to a point, and opens the edge to it.
    fn snap_to(&self, tip: u32, to: [f64; 2], may_move: &impl Fn(u32) -> bool) -> Option<Edit> {
        let mut best: Option<(f64, Growth)> = None;
        for vertex in self.fan(tip).map(|corner| corner.from) {
            let (Some(at), Some(shift)) = (self.place(vertex), self.shift_to(vertex, tip, to))
            else {
                continue;
            };
            let far = length(minus(to, at));
            if best.is_none_or(|(least, _)| far < least)
                && may_move(vertex)
                && self.check_snap(tip, vertex, shift).is_ok()
            {
                best = Some((far, Growth::Snap { vertex, shift }));
            }
        }
        best.map(|(_, growth)| Edit::grow(tip, growth))
    }

    /// The displacement of a vertex to a point, along the direction to the tip and to the left of it (m).
    fn shift_to(&self, vertex: u32, tip: u32, to: [f64; 2]) -> Option<[f64; 2]> {
        let at = self.place(vertex)?;
        let ahead = minus(self.place(tip)?, at);
        let size = length(ahead);
        let way = minus(to, at);
        let sign = if twice_area(&self.shape(self.first[vertex as usize])) < 0.0 {
            -1.0
        } else {
            1.0
        };
        Some([dot(ahead, way) / size, sign * cross(ahead, way) / size])
    }

    /// The vertex inside the surface nearest to the middle of a slit, moved onto the slit if it may move. `ends` are
    /// vertices at the ends of the slit.
    fn middle_on(
        &mut self,
        notch: &Notch,
        ends: [u32; 2],
        may_move: &impl Fn(u32) -> bool,
        done: &mut impl FnMut(&Self, &Done),
    ) -> Result<u32, NotchError> {
        let along = minus(notch.to, notch.from);
        let middle = between(notch.from, notch.to, 0.5);
        let mut nearest = (f64::INFINITY, NONE);
        for vertex in 0..self.vertex_count() as u32 {
            let inner = !self.on_border(vertex) && !ends.contains(&vertex);
            if let Some(at) = self.place(vertex).filter(|_| inner) {
                let far = length(minus(middle, at));
                if far < nearest.0 {
                    nearest = (far, vertex);
                }
            }
        }
        let vertex = nearest.1;
        let at = self.place(vertex).ok_or(NotchError::Blocked { vertex })?;
        let part = dot(minus(at, notch.from), along) / dot(along, along);
        if may_move(vertex) {
            self.move_to(vertex, between(notch.from, notch.to, part), done);
        }
        Ok(vertex)
    }

    /// Moves the nearest vertex that can move there to a point, and returns the vertex. [`NONE`] if there is none.
    fn bring_vertex_to(
        &mut self,
        point: [f64; 2],
        may_move: &impl Fn(u32) -> bool,
        done: &mut impl FnMut(&Self, &Done),
    ) -> u32 {
        let mut nearest = (f64::INFINITY, NONE);
        for vertex in 0..self.vertex_count() as u32 {
            let (Some(at), Some(corner)) = (self.place(vertex), self.fan(vertex).next()) else {
                continue;
            };
            let far = length(minus(point, at));
            if far < nearest.0
                && may_move(vertex)
                && self
                    .shift_to(vertex, corner.from, point)
                    .is_some_and(|shift| self.check_snap(corner.from, vertex, shift).is_ok())
            {
                nearest = (far, vertex);
            }
        }
        self.move_to(nearest.1, point, done);
        nearest.1
    }

    /// Moves a vertex inside the surface to a point, if it can move there.
    fn move_to(&mut self, vertex: u32, point: [f64; 2], done: &mut impl FnMut(&Self, &Done)) {
        let Some(from) = self.fan(vertex).next().map(|corner| corner.from) else {
            return;
        };
        let Some(shift) = self.shift_to(vertex, from, point) else {
            return;
        };
        self.begin();
        if let Ok(moved) = self.snap(from, vertex, shift) {
            self.finish();
            done(self, &self.without_growth(Some(moved)));
        }
    }

    /// Divides an edge of the border. Returns the new vertex.
    fn divide_border(
        &mut self,
        edge: [u32; 2],
        at: f64,
        done: &mut impl FnMut(&Self, &Done),
    ) -> Result<u32, NotchError> {
        let [left, right] = self.edge_between(edge[0], edge[1]);
        let triangle = if left == NONE { right } else { left };
        let apex = self
            .across(triangle, edge)
            .map_or(NONE, |corner| self.triangles[triangle as usize][corner]);
        self.begin();
        match self.cut(apex, edge, at) {
            Ok(vertex) => {
                self.finish();
                done(self, &self.without_growth(None));
                Ok(vertex)
            }
            Err(error) => {
                self.undo();
                Err(error.into())
            }
        }
    }

    /// What an edit did that opened no edge.
    fn without_growth(&self, moved: Option<Moved>) -> Done {
        let before = self.counts_before();
        let new = |before: usize, now: usize| -> Range<u32> { before as u32..now as u32 };
        Done {
            tips: [NONE; 2],
            met: [NONE; 2],
            opened: [None; 2],
            moved: [moved, None],
            vertices: new(before.vertices, self.vertex_count()),
            triangles: new(before.triangles, self.triangle_count()),
            parted: false,
        }
    }

    /// The edge of the border on which a point is, or beside which it is outside, and its place on the edge from 0 to 1.
    /// `None` for a point inside the surface, further from the border than a fraction of an edge.
    fn border_at(&self, point: [f64; 2]) -> Option<([u32; 2], f64)> {
        // Ahead of the tip of a slit, a point is on the line of the slit's faces, and inside all the same.
        let outside = !self.shapes.iter().any(|shape| is_in(shape, point));
        let mut nearest = (f64::INFINITY, None);
        for (corners, (shape, neighbours)) in self
            .triangles
            .iter()
            .zip(self.shapes.iter().zip(&self.neighbours))
        {
            for corner in (0..3).filter(|&corner| neighbours[corner] == NONE) {
                let (a, b) = ((corner + 1) % 3, (corner + 2) % 3);
                let along = minus(shape[b], shape[a]);
                let size = length(along);
                let way = minus(point, shape[a]);
                let at = (dot(way, along) / (size * size)).clamp(0.0, 1.0);
                let foot = [along[0] * at - way[0], along[1] * at - way[1]];
                if length(foot) < nearest.0 {
                    let beside = outside || length(foot) <= AT_VERTEX * size;
                    let edge = ([corners[a], corners[b]], at);
                    nearest = (length(foot), beside.then_some(edge));
                }
            }
        }
        nearest.1
    }

    /// The fan angle at a vertex of the direction to a point of the plane.
    fn direction_to(&self, vertex: u32, point: [f64; 2]) -> Option<f64> {
        let at = self.place(vertex)?;
        self.fan_angle(vertex, self.first[vertex as usize], minus(point, at))
    }

    /// The place of a vertex in the frame of its first triangle.
    pub fn place(&self, vertex: u32) -> Option<[f64; 2]> {
        let corner = self.fan(vertex).next()?;
        Some(self.shape(corner.triangle)[corner.corner])
    }

    /// Checks that all triangles have one frame.
    fn check_one_frame(&self) -> Result<(), NotchError> {
        for vertex in 0..self.vertex_count() as u32 {
            let Some(at) = self.place(vertex) else {
                continue;
            };
            let far = SAME_PLACE * self.shortest_edge(vertex);
            let upright = twice_area(&self.shape(self.first[vertex as usize])) > 0.0;
            for corner in self.fan(vertex) {
                let shape = self.shape(corner.triangle);
                let near = length(minus(shape[corner.corner], at)) <= far;
                if !near || (twice_area(&shape) > 0.0) != upright {
                    return Err(NotchError::NotFlat { vertex });
                }
            }
        }
        Ok(())
    }
}

/// Whether a point is in a triangle of this shape.
fn is_in(shape: &Shape, point: [f64; 2]) -> bool {
    let whole = twice_area(shape);
    (0..3).all(|corner| {
        let mut part = *shape;
        part[corner] = point;
        twice_area(&part) / whole >= 0.0
    })
}
