//! Edits of a surface: a tear grows by one edge, or begins inside the surface with two.

use super::NONE;
use super::surface::Surface;
use core::ops::Range;
use thiserror::Error;

/// How a tear grows from its tip by one edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Growth {
    /// Along an existing edge.
    Open {
        /// The far end of the edge.
        to: u32,
    },
    /// Through a triangle, to a point of the edge opposite to the tip. The edge and the triangles at it are divided.
    Cut {
        /// The ends of the edge.
        edge: [u32; 2],
        /// The place of the point: 0 at the first end, 1 at the second.
        at: f64,
    },
    /// Along an existing edge whose far end first moves at rest onto the path. Its triangles change their shapes.
    Snap {
        /// The far end of the edge, inside the surface.
        vertex: u32,
        /// Its displacement at rest (m): along the direction from the vertex to the tip, and to the left of it.
        shift: [f64; 2],
    },
}

/// An edit of a surface. [`Surface::advance`] and [`Surface::begin_slit`] make edits that follow a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edit {
    /// The vertex from which the tear grows: on a border, if the tear is to have one tip.
    pub tip: u32,
    /// The growth.
    pub ahead: Growth,
    /// The growth to the other side, if the tear begins inside the surface: a slit of two edges with two tips.
    pub behind: Option<Growth>,
}

/// The two faces of an edge that an edit opened. A face is given by its ends: near the tip that was, and far from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Opened {
    /// The face on the right of one who walks with the tear.
    pub right: [u32; 2],
    /// The face on the left. It has the new vertices.
    pub left: [u32; 2],
    /// The length of the edge at rest (m), on its left side.
    pub length: f64,
}

/// A vertex that moved at rest. In space it belongs to the material point at its new place: the sum of the positions of
/// `corners` by `weights`, before the move. Of two moves in one edit, the second follows the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// The vertex.
    pub vertex: u32,
    /// The vertices of the triangle that held the new place before the move. One of them is the vertex itself.
    pub corners: [u32; 3],
    /// The weight of each of them. The sum is 1.
    pub weights: [f64; 3],
}

/// The effect of an edit.
#[derive(Clone, Debug, PartialEq)]
pub struct Done {
    /// The new tip, and the tip of the growth to the other side. [`NONE`] if the tear ended at a border, and if
    /// the edit had no second growth. A tip of another tear at that border vertex is no tip any more, either.
    pub tips: [u32; 2],
    /// The border vertex that the growth reached, on each side, or [`NONE`]: another tear with its tip there has ended.
    pub met: [u32; 2],
    /// The opened edge of each growth. Of the second growth, left and right are those of one who walks with the first.
    pub opened: [Option<Opened>; 2],
    /// The vertex that each growth moved at rest.
    pub moved: [Option<Moved>; 2],
    /// The new vertices, each after those from which it comes: [`Surface::origin`] says from which.
    pub vertices: Range<u32>,
    /// The new triangles.
    pub triangles: Range<u32>,
    /// Whether the opened edges lead from border to border, so that a part of the surface may have come off.
    pub parted: bool,
}

/// The reason why an edit was refused. The surface is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum EditError {
    /// The reserve is used up.
    #[error("the reserve of {what} is used up")]
    Full {
        /// `vertices` or `triangles`.
        what: &'static str,
    },
    /// There is no such edge.
    #[error("no edge joins the vertices {a} and {b}")]
    NoEdge {
        /// One end.
        a: u32,
        /// The other end.
        b: u32,
    },
    /// The edge is a border already.
    #[error("the edge between the vertices {a} and {b} is on a border")]
    Border {
        /// One end.
        a: u32,
        /// The other end.
        b: u32,
    },
    /// A single edge cannot open if neither of its ends is on a border.
    #[error(
        "the edge between the vertices {a} and {b} is inside the surface: a slit needs two edges"
    )]
    Inside {
        /// One end.
        a: u32,
        /// The other end.
        b: u32,
    },
    /// A slit of two edges can begin only inside the surface, and its edges must differ.
    #[error("no slit can begin at vertex {vertex}")]
    Slit {
        /// The vertex.
        vertex: u32,
    },
    /// The edge to be cut is not opposite to the tip.
    #[error("no triangle has the corner {tip} and the opposite edge between {a} and {b}")]
    Opposite {
        /// The tip.
        tip: u32,
        /// One end.
        a: u32,
        /// The other end.
        b: u32,
    },
    /// The place of a cut is not inside the edge.
    #[error("an edge is cut at {found} of its length, expected a number between 0 and 1")]
    At {
        /// The place.
        found: f64,
    },
    /// A vertex cannot move at rest: it is on a border, or the triangles about it are not flat together.
    #[error(
        "vertex {vertex} cannot move at rest: it is on a border, or its triangles are not flat together"
    )]
    Fixed {
        /// The vertex.
        vertex: u32,
    },
    /// A triangle would be inverted, or become too thin.
    #[error("triangle {triangle} would be inverted or too thin")]
    Thin {
        /// The triangle, or the triangle that would be divided.
        triangle: u32,
    },
}

impl Edit {
    /// The growth of a tear by one edge.
    pub fn grow(tip: u32, ahead: Growth) -> Self {
        Self {
            tip,
            ahead,
            behind: None,
        }
    }
}

impl Surface {
    /// Makes an edit. The edit is made in place, without allocating, in a time proportional to the number of triangles
    /// at its vertices.
    ///
    /// The tip and each border vertex that the tear reaches are doubled. Of the fans that result, the fan on the left of
    /// the tear gets the new vertex.
    ///
    /// # Errors
    /// [`EditError`]. The surface is then unchanged.
    pub fn edit(&mut self, edit: &Edit) -> Result<Done, EditError> {
        self.begin();
        let done = self.apply(edit);
        match done {
            Ok(_) => self.finish(),
            Err(_) => self.undo(),
        }
        done
    }

    fn apply(&mut self, edit: &Edit) -> Result<Done, EditError> {
        let tip = edit.tip;
        let inside = !self.on_border(tip);
        if edit.behind.is_some() && !inside {
            return Err(EditError::Slit { vertex: tip });
        }
        // The edges exist before one of them opens.
        let (ahead, first_moved) = self.prepare(tip, &edit.ahead)?;
        let (behind, second_moved) = match &edit.behind {
            None => (NONE, None),
            Some(growth) => self.prepare(tip, growth)?,
        };
        if ahead == behind {
            return Err(EditError::Slit { vertex: tip });
        }
        let slit = edit.behind.is_some();
        let first = self.open(tip, ahead, slit)?;
        let mut opened = [Some(first), None];
        let mut reached = [first.right[1] != first.left[1], false];
        if slit {
            let back = self.open(tip, behind, false)?;
            // One who walks back has the left of the tear on the right. The first opening had no twin of the middle.
            opened = [
                Some(Opened {
                    left: [back.right[0], first.left[1]],
                    right: [back.left[0], first.right[1]],
                    ..first
                }),
                Some(Opened {
                    left: back.right,
                    right: back.left,
                    ..back
                }),
            ];
            reached[1] = back.right[1] != back.left[1];
        }
        let end = |reached: bool, vertex: u32| if reached { NONE } else { vertex };
        let met = |reached: bool, vertex: u32| if reached { vertex } else { NONE };
        let counts = self.counts_before();
        Ok(Done {
            tips: [end(reached[0], ahead), end(reached[1], behind)],
            met: [met(reached[0], ahead), met(reached[1], behind)],
            opened,
            moved: [first_moved, second_moved],
            vertices: counts.vertices as u32..self.vertex_count() as u32,
            triangles: counts.triangles as u32..self.triangle_count() as u32,
            parted: reached[0] && (reached[1] || (!slit && !inside)),
        })
    }

    /// Makes the edge of a growth, and returns its far end.
    fn prepare(&mut self, tip: u32, growth: &Growth) -> Result<(u32, Option<Moved>), EditError> {
        match *growth {
            Growth::Open { to } => Ok((to, None)),
            Growth::Cut { edge, at } => Ok((self.cut(tip, edge, at)?, None)),
            Growth::Snap { vertex, shift } => Ok((vertex, Some(self.snap(tip, vertex, shift)?))),
        }
    }
}
