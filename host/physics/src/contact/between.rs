//! Points of a surface between its vertices, where a rounded hull meets a surface that is coarse beside its radius.
//!
//! A sphere that is pressed on a coarse surface lies in a facet, between the vertices: contacts of vertices alone let it sink
//! into the facet, and its force jumps from vertex to vertex as it slides. So a rounded hull also has contacts at the nearest points
//! of long edges and of their triangles. Each is a **material point**, known by its place on a fine lattice, with a contact of
//! its own: the force keeps its place in the surface, and its direction is that of the hull, which changes
//! continuously. A point that presses stays a contact until its force is zero, also when another point of its triangle is nearer.
//! That is the law of the contacts of a tool in the tick (`rt_core::tool`).

/// The length of the longest edge, as a fraction of the radius, up to which a triangle meets a rounded hull at its vertices alone. A
/// facet sinks by a hundredth of the radius between vertices at this distance.
pub(crate) const SHORT: f64 = 0.25;
/// Parts of an edge in the lattice. A plane facet sinks into a sphere of half the length of its edges by a millionth of them
/// between two points of the lattice.
const PARTS: u32 = 256;

/// A point of a surface between up to three vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Between {
    /// The vertices; an edge has its second one twice.
    pub vertices: [u32; 3],
    /// The place in the lattice: the parts that the second and the third vertex have.
    place: [u16; 2],
}

impl Between {
    /// The point of a triangle, or of an edge with one end twice, at these weights of the vertices; `None` at a vertex.
    pub(crate) fn at(vertices: [u32; 3], weights: [f64; 3]) -> Option<Self> {
        let parts = f64::from(PARTS);
        let [_, b, c] = weights;
        let [b, c] = [b, c].map(|weight| (weight * parts).round() as u32);
        let a = PARTS.saturating_sub(b + c);
        let parts = [a, b, c];
        let mut used = (0..3).filter(|corner| parts[*corner] > 0);
        let corners = [used.next()?, used.next()?];
        if used.next().is_some() {
            let place = [b as u16, c as u16];
            return Some(Self { vertices, place });
        }
        // An edge has the same points in both of its triangles.
        let [one, other] = corners.map(|corner| (vertices[corner], parts[corner]));
        let (first, second) = (one.min(other), one.max(other));
        (first.0 != second.0).then_some(Self {
            vertices: [first.0, second.0, second.0],
            place: [second.1 as u16, 0],
        })
    }

    /// The weights of the vertices, which sum to one; zero for the second one of two equal vertices.
    pub(crate) fn weights(&self) -> [f64; 3] {
        let [b, c] = self.place.map(|part| f64::from(part) / f64::from(PARTS));
        [1.0 - b - c, b, c]
    }

    /// The point after vertices have got the numbers that `number` gives; `None` if one is no longer there.
    pub(super) fn renumbered(&self, number: &dyn Fn(u32) -> Option<u32>) -> Option<Self> {
        let [a, b, c] = self.vertices.map(number);
        let ([a, b, c], mut place) = ([a?, b?, c?], self.place);
        let is_edge = b == c;
        if is_edge && a > b {
            place[0] = PARTS as u16 - place[0];
            return Some(Self {
                vertices: [b, a, a],
                place,
            });
        }
        Some(Self {
            vertices: [a, b, c],
            place,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::contact::distance::point_triangle;

    fn point(vertices: [u32; 3], p: [f64; 3]) -> Option<Between> {
        let at = [
            Vec3::zeros(),
            Vec3::x(),
            Vec3::y(),
            Vec3::new(1.0, 1.0, 0.0),
        ];
        let corners = vertices.map(|vertex| &at[vertex as usize]);
        Between::at(vertices, point_triangle(&Vec3::from(p), corners).weights)
    }

    #[test]
    fn a_point_keeps_its_place_on_a_lattice_and_an_edge_has_one_in_both_triangles() {
        let inside = point([0, 1, 2], [0.3, 0.2, 5.0]).expect("inside");
        assert_eq!(
            inside.weights(),
            [128.0, 77.0, 51.0].map(|part| part / 256.0)
        );
        assert_eq!(point([0, 1, 2], [0.3001, 0.2001, -1.0]), Some(inside));
        // On the diagonal, from both sides, and as an edge of its own.
        let on_edge = point([0, 1, 2], [0.8, 0.7, 0.1]).expect("an edge");
        assert_eq!(on_edge.vertices, [1, 2, 2]);
        assert_eq!(on_edge.weights(), [141.0 / 256.0, 115.0 / 256.0, 0.0]);
        assert_eq!(
            point([3, 2, 1], [0.3, 0.2, 0.1]).map(|p| p.vertices),
            Some([1, 2, 2])
        );
        assert_eq!(point([2, 1, 1], [0.8, 0.7, 0.1]), Some(on_edge));
        // Vertices have contacts of their own.
        assert_eq!(point([0, 1, 2], [-0.2, -0.1, 0.1]), None);
        assert_eq!(point([0, 1, 2], [0.001, 0.0, 0.1]), None);
    }

    #[test]
    fn a_point_of_an_edge_follows_its_vertices_also_when_their_order_changes() {
        let on_edge = point([0, 1, 2], [0.8, 0.7, 0.1]).expect("an edge");
        let turned = on_edge
            .renumbered(&|vertex| Some(7 - vertex))
            .expect("both are there");
        assert_eq!(turned.vertices, [5, 6, 6]);
        assert_eq!(turned.weights(), [115.0 / 256.0, 141.0 / 256.0, 0.0]);
        assert_eq!(
            on_edge.renumbered(&|vertex| (vertex < 2).then_some(vertex)),
            None
        );
    }
}
