//! The choice of the edit that lets a tear follow a direction.

use super::NONE;
use super::cut::THINNEST;
use super::edit::{Edit, Growth};
use super::surface::{Surface, angle, between, cross, dot, length, minus};

/// An edge always opens as it is if its far end is off the path by this fraction of its length or less (0.6 degrees).
const NEGLIGIBLE: f64 = 0.01;

/// How good a cut has to be.
struct Quality {
    /// The least angle of the new triangles (rad).
    good: f64,
    /// The fraction of the edge that a cut keeps between itself and the ends, if a cut elsewhere would make thin triangles.
    clear: f64,
}

/// A tear that turns back to its path may leave the path for good triangles by an angle whose sine is this multiple of the
/// options' opening.
const FURTHER: f64 = 2.28;
/// The largest sine of this angle: 20 degrees.
const MOST_OFF: f64 = 0.342;

/// For tears that turn back to their path: 15 degrees.
const LOOSE: Quality = Quality {
    good: 0.262,
    clear: 0.3,
};

/// For tears that stay on their path as well as they can: 8 degrees.
const EXACT: Quality = Quality {
    good: 0.14,
    clear: 0.15,
};

/// How [`Surface::advance`] follows a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AdvanceOptions {
    /// How far a vertex may move at rest onto the path, as a fraction of the shortest edge at the vertex: 0 without
    /// snapping, at most 0.5.
    pub snapping: f64,
    /// How far the far end of an edge may lie off the path so that the edge opens as it is, as a fraction of its length. The
    /// caller then has to turn back to the path, see [`Surface::edge_of`]. In return cuts leave better triangles; if a
    /// cut would leave thin ones, the tear may leave the path by more than twice this fraction. At 0 only edges on the
    /// path open.
    pub opening: f64,
}

impl Surface {
    /// The edit by which the tear grows from `tip` in the direction of a fan angle (rad, see
    /// [`Surface::straight_ahead`], [`Surface::fan_angle`]), by one edge. `None` if the direction points out of the
    /// surface, if the tip is inside the surface, or if every edit would make too thin a triangle.
    ///
    /// `may_move` says whether a vertex inside the surface may move at rest. Vertices on borders never move. A caller
    /// that does not want a snap once it knows the snap's cost asks again without snapping.
    pub fn advance(
        &self,
        tip: u32,
        direction: f64,
        options: AdvanceOptions,
        may_move: impl Fn(u32) -> bool,
    ) -> Option<Edit> {
        if !self.on_border(tip) {
            return None;
        }
        let ahead = self.growth(tip, direction, options, &may_move)?;
        Some(Edit::grow(tip, ahead))
    }

    /// The edit by which a slit of two edges begins at a vertex inside the surface, in the direction of a fan angle
    /// (rad) and in the opposite direction.
    pub fn begin_slit(
        &self,
        vertex: u32,
        direction: f64,
        options: AdvanceOptions,
        may_move: impl Fn(u32) -> bool,
    ) -> Option<Edit> {
        if self.on_border(vertex) {
            return None;
        }
        let back = direction + 0.5 * self.total_angle(vertex);
        let ahead = self.growth(vertex, direction, options, &may_move)?;
        let behind = self.growth(vertex, back, options, &may_move)?;
        Some(Edit {
            tip: vertex,
            ahead,
            behind: Some(behind),
        })
    }

    /// The edge along which a tear would grow: its fan angle at the tip (rad), and its length at rest (m). `None` if the
    /// tip has no such edge.
    ///
    /// The edge may differ from the direction that [`Surface::advance`] was given. A tear that keeps to a line adds up
    /// `length * sin(angle - direction)`, its distance from the line, and turns back by it.
    pub fn edge_of(&self, tip: u32, growth: &Growth) -> Option<(f64, f64)> {
        let (far, weight) = match *growth {
            Growth::Open { to } => (to, None),
            Growth::Snap { vertex, .. } => (vertex, None),
            Growth::Cut { edge, at } => (edge[0], Some((edge[1], at))),
        };
        let mut begin = 0.0;
        for corner in self.fan(tip) {
            let (shape, k) = (self.shape(corner.triangle), corner.corner);
            let sides = [1, 2].map(|far| minus(shape[(k + far) % 3], shape[k]));
            let turn = |to: [f64; 2]| libm::atan2(cross(sides[0], to).abs(), dot(sides[0], to));
            let ends = [corner.from, corner.to];
            let side = ends.iter().position(|&end| end == far);
            let reached = match (side, weight) {
                (Some(side), None) => Some(sides[side]),
                (Some(side), Some((other, at))) if ends[1 - side] == other => {
                    Some(between(sides[side], sides[1 - side], at))
                }
                _ => None,
            };
            if let Some(reached) = reached {
                let mut found = (begin + turn(reached), length(reached));
                if let Growth::Snap { shift, .. } = *growth {
                    // The shift is seen from the far end, with the tip ahead.
                    found.0 -= libm::atan2(shift[1], found.1 - shift[0]);
                    found.1 = libm::hypot(found.1 - shift[0], shift[1]);
                }
                return Some(found);
            }
            begin += angle(&shape, k);
        }
        None
    }

    /// The growth from a tip in the direction of a fan angle (rad).
    ///
    /// In the plane of the triangle, the direction crosses the edge opposite to the tip between its ends `p` and `q`.
    /// The nearer end by its distance from the path is tried first: its edge opens if the distance is negligible, it
    /// snaps if it may and the distance is small. Otherwise the opposite edge is cut. If a cut would make thin
    /// triangles, the nearest usable edge opens.
    fn growth(
        &self,
        tip: u32,
        direction: f64,
        options: AdvanceOptions,
        may_move: &impl Fn(u32) -> bool,
    ) -> Option<Growth> {
        let wedge = self.wedge(tip, direction)?;
        let corner = self.corner(wedge.triangle, tip)?;
        let shape = self.shape(wedge.triangle);
        let side = |k: usize| length(minus(shape[(wedge.corner + k) % 3], shape[wedge.corner]));
        let ends = [
            End::new(corner.from, side(1), wedge.within, -1.0),
            End::new(corner.to, side(2), wedge.angle - wedge.within, 1.0),
        ];
        let crossing = ends[0].aside / (ends[0].aside + ends[1].aside);
        let mut near = ends;
        if ends[1].aside < ends[0].aside {
            near.swap(0, 1);
        }
        let opens = |end: &End| self.opens(tip, end.vertex);
        let nearest = &near[0];
        if opens(nearest) && nearest.aside <= options.opening.max(NEGLIGIBLE) * nearest.size {
            return Some(Growth::Open { to: nearest.vertex });
        }
        for end in &near {
            let limit = options.snapping.clamp(0.0, 0.5) * self.shortest_edge(end.vertex);
            let shift = end.shift();
            if end.aside <= limit
                && end.cosine > 0.0
                && may_move(end.vertex)
                && self.check_snap(tip, end.vertex, shift).is_ok()
            {
                let vertex = end.vertex;
                return Some(Growth::Snap { vertex, shift });
            }
        }
        let edge = [corner.from, corner.to];
        let cut = |at: f64, thinnest: f64| {
            let fits = self.check_cut(tip, edge, at, thinnest).is_ok();
            fits.then_some(Growth::Cut { edge, at })
        };
        // Beside a cut near an end of the edge, a thin triangle would remain: the edge to this end opens instead.
        let open = |end: &End| opens(end).then_some(Growth::Open { to: end.vertex });
        let exact = crossing.clamp(EXACT.clear, 1.0 - EXACT.clear);
        let near_path = || {
            let inner = crossing.clamp(LOOSE.clear, 1.0 - LOOSE.clear);
            let keeps = |sine: f64| sine <= (FURTHER * options.opening).min(MOST_OFF);
            cut(crossing, LOOSE.good)
                .or_else(|| cut(inner, LOOSE.good).filter(|_| keeps(off(&ends, inner))))
                .or_else(|| open(nearest).filter(|_| keeps(nearest.sine) && nearest.cosine > 0.0))
        };
        let loose = if options.opening > 0.0 {
            near_path()
        } else {
            None
        };
        loose
            .or_else(|| cut(crossing, EXACT.good))
            .or_else(|| cut(exact, EXACT.good))
            .or_else(|| open(nearest))
            .or_else(|| cut(exact, THINNEST))
            .or_else(|| open(&near[1]))
            .or_else(|| cut(0.5, THINNEST))
    }

    /// Whether there is an edge from the tip that is on no border.
    fn opens(&self, tip: u32, to: u32) -> bool {
        !self.edge_between(tip, to).contains(&NONE)
    }

    /// The mean length at rest of the edges at a vertex (m); 0 for a vertex of no triangle.
    pub fn mean_edge(&self, vertex: u32) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for corner in self.fan(vertex) {
            let (shape, k) = (self.shape(corner.triangle), corner.corner);
            for far in [1, 2] {
                sum += length(minus(shape[(k + far) % 3], shape[k]));
                count += 1.0;
            }
        }
        if count > 0.0 { sum / count } else { 0.0 }
    }

    /// The length at rest of the shortest edge at a vertex (m).
    pub(super) fn shortest_edge(&self, vertex: u32) -> f64 {
        let lengths = self.fan(vertex).map(|corner| {
            let (shape, k) = (self.shape(corner.triangle), corner.corner);
            let side = |far: usize| length(minus(shape[(k + far) % 3], shape[k]));
            side(1).min(side(2))
        });
        lengths.fold(f64::INFINITY, f64::min)
    }
}

/// The sine of the angle between the path and the direction to a point of the edge between two ends.
fn off(ends: &[End; 2], at: f64) -> f64 {
    let point = |end: &End| [end.size * end.cosine, end.left * end.aside];
    let [along, left] = between(point(&ends[0]), point(&ends[1]), at);
    left.abs() / libm::hypot(along, left)
}

/// An end of the edge opposite to the tip, as seen from the tip.
#[derive(Clone, Copy)]
struct End {
    vertex: u32,
    /// The length of the edge from the tip to the vertex (m).
    size: f64,
    /// The sine and the cosine of the angle between this edge and the path.
    sine: f64,
    cosine: f64,
    /// The distance of the vertex from the path (m).
    aside: f64,
    /// 1 if the vertex is on the left of the path, -1 on the right.
    left: f64,
}

impl End {
    fn new(vertex: u32, size: f64, angle: f64, left: f64) -> Self {
        let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
        Self {
            vertex,
            size,
            sine,
            cosine,
            aside: size * sine.abs(),
            left,
        }
    }

    /// The displacement of the vertex to the nearest point of the path (m), along the direction to the tip and left of it.
    fn shift(&self) -> [f64; 2] {
        // Seen from a vertex on the left of the path, with the tip ahead, the path is on the left.
        [self.aside * self.sine, self.left * self.aside * self.cosine]
    }
}
