//! Whether the connection of two edges is a least distance between the surfaces.
//!
//! A contact presses where the distance between two surfaces has a local minimum. There, the connection leads away from the
//! triangles at both edges. Where the connection of two edges leans towards a triangle at one of them, something else on this
//! triangle is nearer, and has a row with another direction. Rows against each other lock two bodies: the borders of two
//! blocks that lie flush on each other have many edges that are no least distance, in all directions across the border.
//!
//! For surfaces of solids a connection must also lead outwards. Two edges in flat surfaces that have slid past each other by
//! less than rounding have the opposite direction.
//!
//! Vertices have no such condition. A vertex that meets a triangle is often the only contact where an arm of a body is pressed on
//! another: with the condition, the force of such a hand was wrong by 65 % of its peak.

use super::surface::Surfaces;
use crate::Vec3;

/// The sine of the angle by which a connection may lean towards a triangle at its edge. Triangles that are nearly flat touch
/// others at their edges, too. Values from 0.03 to 0.6 make no difference to blocks on each other.
const ASIDE: f64 = 0.3;

impl Surfaces {
    /// Whether a direction, of length one and across an edge, leads away from the triangles at the edge. `x` are the positions of
    /// the vertices (m).
    pub(super) fn leaves_edge(&self, edge: u32, direction: &Vec3, x: &[Vec3]) -> bool {
        let at = |vertex: u32| x[vertex as usize];
        let ends @ [from, to] = self.edges[edge as usize];
        let along = (at(to) - at(from)).normalize();
        let opposite = &self.opposite[edge as usize];
        // From the edge into each of its triangles; zero without a triangle.
        let into = opposite.map(|vertex| {
            let beyond = at(vertex) - at(from);
            let into = beyond - along * along.dot(&beyond);
            if ends.contains(&vertex) {
                Vec3::zeros()
            } else {
                into.normalize()
            }
        });
        let is_away = into.iter().all(|into| direction.dot(into) <= ASIDE);
        let outward = along.cross(&(into[0] - into[1]));
        is_away && !(self.parts[self.part_of(from)].is_solid && direction.dot(&outward) < 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::surface::tests::roof;

    /// The directions across the ridge, every ten degrees from that of x to that of z and on, that lead away from it.
    fn around(height: f64, is_solid: bool) -> Vec<u32> {
        let (mut surfaces, x) = roof(height);
        surfaces.parts[0].is_solid = is_solid;
        let ridge = surfaces.edges.iter().position(|edge| *edge == [1, 4]);
        let ridge = ridge.expect("a ridge") as u32;
        let leaves = |tens: &u32| {
            let angle = f64::from(*tens).to_radians() * 10.0;
            let direction = Vec3::new(angle.cos(), 0.0, angle.sin());
            surfaces.leaves_edge(ridge, &direction, &x)
        };
        (0..36).filter(leaves).collect()
    }

    #[test]
    fn a_direction_from_an_edge_leads_away_from_its_triangles() {
        // Flat: along the normal, up to the angle of the tolerance of 17 degrees, on both sides of a sheet.
        assert_eq!(around(0.0, false), [8, 9, 10, 26, 27, 28]);
        assert_eq!(around(0.0, true), [8, 9, 10]);
        // A ridge whose sides fall by 45 degrees: between their normals.
        let ridge: Vec<u32> = (3..=15).collect();
        assert_eq!(around(0.01, true), ridge);
        assert_eq!(around(0.01, false), ridge);
        // A valley touches no edge from above; a sheet does from below.
        assert_eq!(around(-0.01, true), [0_u32; 0]);
        let below: Vec<u32> = ridge.iter().map(|tens| 36 - tens).rev().collect();
        assert_eq!(around(-0.01, false), below);
    }

    #[test]
    fn the_border_of_a_sheet_is_left_on_all_sides_but_that_of_its_triangle() {
        let (surfaces, x) = roof(0.0);
        let border = surfaces.edges.iter().position(|edge| *edge == [0, 3]);
        let border = border.expect("a border") as u32;
        let leaves = |x_part: f64| {
            let direction = Vec3::new(x_part, 0.0, (1.0 - x_part * x_part).sqrt());
            surfaces.leaves_edge(border, &direction, &x)
        };
        assert_eq!([-1.0, 0.0, 0.2, 0.4].map(leaves), [true, true, true, false]);
    }
}
