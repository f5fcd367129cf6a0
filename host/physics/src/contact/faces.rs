//! The two faces of a tear, which touch each other once the tear is open.
//!
//! A tear doubles vertices. A vertex and its twin begin at the same place, where no direction separates the two faces, and where
//! the thickness would push the tear open. So nothing at one vertex touches anything at its twin while the two are **closed**.
//! They are **open** from the step on in which they are further apart than the thickness, nothing at one of them passes through
//! anything at the other one, and the faces there are apart. From then on the faces touch as any surfaces do, and cannot pass through each other.

use super::crossing::passes;
use super::pair::Pair;
use super::surface::{Fan, Surfaces};
use crate::Vec3;

/// The fraction of the thickness by which the faces are apart at least when their twins open: things without a distance have no
/// sides.
const APART: f64 = 0.1;

/// Two vertices of a part that are at the same place at rest: a vertex and its twin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Twins {
    /// Ascending.
    vertices: [u32; 2],
    are_open: bool,
}

impl Surfaces {
    /// Finds the twins of a part that tears. They are closed.
    pub(super) fn find_twins(&mut self, part: usize) {
        let (rest, areas) = (&self.rest, &self.areas);
        let own = self.parts[part].vertices.clone();
        // Room for further vertices has no triangle.
        let mut order: Vec<u32> = own.filter(|v| areas[*v as usize] > 0.0).collect();
        let place = |vertex: u32| &rest[vertex as usize];
        order.sort_by(|a, b| {
            let axes = place(*a).iter().zip(place(*b).iter());
            let mut differ = axes.map(|(a, b)| a.total_cmp(b));
            differ
                .find(|order| order.is_ne())
                .unwrap_or_else(|| a.cmp(b))
        });
        for same in order.chunk_by(|a, b| place(*a) == place(*b)) {
            for (number, first) in same.iter().enumerate() {
                self.twins
                    .extend(same[number + 1..].iter().map(|second| Twins {
                        vertices: [*first, *second],
                        are_open: false,
                    }));
            }
        }
        self.twins.sort_unstable_by_key(|twins| twins.vertices);
    }

    /// The twins that are open.
    pub(crate) fn opened(&self) -> impl Iterator<Item = [u32; 2]> {
        let open = self.twins.iter().filter(|twins| twins.are_open);
        open.map(|twins| twins.vertices)
    }

    /// Notes which twins are open, as in the surfaces before.
    pub(crate) fn keep_open(&mut self, opened: impl Iterator<Item = [u32; 2]>) {
        for [a, b] in opened {
            if let Some(at) = self.place_of(a, b) {
                self.twins[at].are_open = true;
            }
        }
    }

    /// Whether two twins are open; `None` for vertices that are not twins.
    pub fn are_open(&self, a: u32, b: u32) -> Option<bool> {
        self.place_of(a, b).map(|at| self.twins[at].are_open)
    }

    fn place_of(&self, a: u32, b: u32) -> Option<usize> {
        let vertices = [a.min(b), a.max(b)];
        let found = (self.twins).binary_search_by_key(&vertices, |twins| twins.vertices);
        found.ok()
    }

    /// Opens the twins that are apart at the positions `x` (m). Returns whether there are any.
    pub(crate) fn open_twins(&mut self, x: &[Vec3]) -> bool {
        let mut is_changed = false;
        for number in 0..self.twins.len() {
            let Twins { vertices, are_open } = self.twins[number];
            let part = &self.parts[self.part_of(vertices[0])];
            let [a, b] = vertices.map(|vertex| &x[vertex as usize]);
            if are_open || (a - b).norm() <= part.thickness {
                continue;
            }
            let fans = vertices.map(|vertex| self.fan(part, vertex));
            let [Some(first), Some(second)] = fans else {
                continue;
            };
            let least = APART * part.thickness;
            self.twins[number].are_open = true;
            let is_apart = self.are_apart(vertices, [&first, &second], least, x);
            self.twins[number].are_open = is_apart;
            is_changed |= is_apart;
        }
        is_changed
    }

    /// Whether nothing in the fan of one of two twins passes through the fan of the other one, or touches it nearer than `least`
    /// (m). Other twins that are closed do not count.
    fn are_apart(&self, [a, b]: [u32; 2], fans: [&Fan; 2], least: f64, x: &[Vec3]) -> bool {
        let at = |vertex: u32| &x[vertex as usize];
        let is_apart = |pair: Pair| {
            pair.is_joined(self) || pair.is_closed(self) || pair.foot(self, x).apart.norm() > least
        };
        let [first, second] = fans;
        let are_edges_apart = first.edges.iter().all(|one| {
            let mut others = second.edges.iter();
            others.all(|other| is_apart(Pair::EdgeEdge(*one, *other)))
        });
        are_edges_apart
            && [(a, first, second), (b, second, first)]
                .into_iter()
                .all(|(vertex, fan, other)| {
                    other.triangles.iter().all(|triangle| {
                        let corners = self.triangles[*triangle as usize];
                        let edges = fan.edges.iter().map(|edge| self.edges[*edge as usize]);
                        let mut free =
                            edges.filter(|ends| !ends.iter().any(|end| corners.contains(end)));
                        is_apart(Pair::VertexTriangle(vertex, *triangle))
                            && free.all(|ends| !passes(ends.map(at), corners.map(at)))
                    })
                })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{Pair, Skin};
    use crate::mesh::{Mesh, TriMesh};

    const THICKNESS: f64 = 1e-4;
    /// Two twins: one vertex of the first square, and one of the second square.
    const TWINS: [[u32; 2]; 2] = [[1, 4], [2, 7]];

    /// Two squares of 10 mm that a tear has parted, and their positions.
    fn torn() -> (Surfaces, Vec<Vec3>) {
        let at = |x: f64, y: f64| Vec3::new(x, y, 0.0) * 0.01;
        let first = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
        let second = first.map(|place| place + at(1.0, 0.0));
        let positions = [first, second].concat();
        let triangles = vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        let mut surfaces = Surfaces::default();
        let skin = Skin {
            radius: 0.5 * THICKNESS,
            touches_itself: true,
            is_obstacle: false,
        };
        let mesh = TriMesh::new(positions.clone(), triangles).expect("a surface");
        let part = surfaces.add(&Mesh::Sheet(mesh), skin).expect("a surface");
        surfaces.tears(part, &positions);
        (surfaces, positions)
    }

    /// The positions after the second square has moved.
    fn moved(rest: &[Vec3], by: impl Fn(&Vec3) -> Vec3) -> Vec<Vec3> {
        let moves = |(number, place): (usize, &Vec3)| {
            if number < 4 {
                *place
            } else {
                place + by(place)
            }
        };
        rest.iter().enumerate().map(moves).collect()
    }

    fn states(surfaces: &Surfaces) -> [Option<bool>; 2] {
        TWINS.map(|[a, b]| surfaces.are_open(b, a))
    }

    #[test]
    fn the_faces_of_a_tear_touch_once_they_have_been_apart() {
        let (mut surfaces, rest) = torn();
        let pair = Pair::VertexTriangle(4, 0);
        assert_eq!(states(&surfaces), [Some(false); 2]);
        assert_eq!(surfaces.are_open(1, 2), None);
        assert!(pair.is_closed(&surfaces));
        // The tear opens like a wedge.
        let opened = |most: f64| moved(&rest, |place| Vec3::x() * (most * (1.0 - 80.0 * place.y)));
        assert!(!surfaces.open_twins(&opened(0.9 * THICKNESS)));
        assert!(surfaces.open_twins(&opened(1.1 * THICKNESS)));
        assert_eq!(states(&surfaces), [Some(true), Some(false)]);
        assert!(!pair.is_closed(&surfaces));
        // The edges along the tear have all four twins.
        let along = |ends| surfaces.edges.iter().position(|edge| *edge == ends);
        let [one, other] = [[1, 2], [4, 7]].map(|ends| along(ends).expect("an edge") as u32);
        assert!(Pair::EdgeEdge(one, other).is_closed(&surfaces));
        // Faces that come together again touch.
        assert!(!surfaces.open_twins(&rest));
        let (mut next, _) = torn();
        next.keep_open(surfaces.opened());
        assert_eq!(states(&next), [Some(true), Some(false)]);
    }

    #[test]
    fn a_vertex_on_an_edge_of_the_other_face_does_not_touch_it() {
        // A tear has cut the second square, and the first one has no vertex there.
        let at = |x: f64, y: f64| Vec3::new(x, y, 0.0) * 0.01;
        let first = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
        let second = [
            at(1.0, 0.0),
            at(2.0, 0.0),
            at(2.0, 1.0),
            at(1.0, 1.0),
            at(1.0, 0.5),
        ];
        let positions = [first.as_slice(), &second].concat();
        let triangles = vec![[0, 1, 2], [0, 2, 3], [4, 5, 8], [5, 6, 8], [6, 7, 8]];
        let mut surfaces = Surfaces::default();
        let skin = Skin {
            radius: 0.5 * THICKNESS,
            touches_itself: true,
            is_obstacle: false,
        };
        let mesh = TriMesh::new(positions.clone(), triangles).expect("a surface");
        let part = surfaces.add(&Mesh::Sheet(mesh), skin).expect("a surface");
        surfaces.tears(part, &positions);
        assert!(Pair::VertexTriangle(8, 0).is_closed(&surfaces));
        assert!(!Pair::VertexTriangle(8, 1).is_closed(&surfaces));
    }

    #[test]
    fn faces_that_cross_stay_closed() {
        let (mut surfaces, rest) = torn();
        // The border of the second square passes from above the first one to below it.
        let crossed = |place: &Vec3| Vec3::new(-1e-3, 0.0, 1e-3 - 0.2 * place.y);
        assert!(!surfaces.open_twins(&moved(&rest, crossed)));
        // Faces that slide along each other are not apart.
        assert!(!surfaces.open_twins(&moved(&rest, |_| Vec3::y() * 1e-3)));
        assert!(surfaces.open_twins(&moved(&rest, |_| Vec3::new(-1e-3, 0.0, 1e-3))));
        assert_eq!(states(&surfaces), [Some(true); 2]);
    }
}
