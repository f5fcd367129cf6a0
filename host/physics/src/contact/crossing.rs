//! Whether an edge passes through a triangle, decided exactly.
//!
//! The signs of the volumes of tetrahedra decide (Guigue and Devillers, "Fast and robust triangle-triangle overlap test
//! using orientation predicates", 2003), by the adaptive arithmetic of Shewchuk (1997). An edge that only touches a
//! triangle does not pass through it.

use crate::Vec3;
use robust::{Coord3D, orient3d};

/// The sign of the volume of four points.
fn side(points: [&Vec3; 4]) -> f64 {
    let [a, b, c, d] = points.map(|p| Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    });
    orient3d(a, b, c, d)
}

/// Whether the edge `pq` passes through the triangle `abc`.
pub fn passes([p, q]: [&Vec3; 2], [a, b, c]: [&Vec3; 3]) -> bool {
    // Most pairs of an edge and a triangle lie apart along an axis.
    let is_apart = |axis: usize| {
        let corners = [a[axis], b[axis], c[axis]];
        corners
            .iter()
            .all(|corner| *corner < p[axis] && *corner < q[axis])
            || corners
                .iter()
                .all(|corner| *corner > p[axis] && *corner > q[axis])
    };
    if (0..3).any(is_apart) {
        return false;
    }
    let (from, to) = (side([p, a, b, c]), side([q, a, b, c]));
    // The signs are compared, because the product of two small volumes may be zero.
    let is_between = (from > 0.0 && to < 0.0) || (from < 0.0 && to > 0.0);
    is_between && is_inside(p, q, [a, b, c])
}

/// Whether the line through `p` and `q` passes through the inside of a triangle.
fn is_inside(p: &Vec3, q: &Vec3, [a, b, c]: [&Vec3; 3]) -> bool {
    let sides = [side([p, q, a, b]), side([p, q, b, c]), side([p, q, c, a])];
    sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_through_the_inside_passes_and_one_that_touches_does_not() {
        let corners = [Vec3::zeros(), Vec3::x(), Vec3::y()];
        let triangle = [&corners[0], &corners[1], &corners[2]];
        let at = |x: f64, y: f64, z: f64| Vec3::new(x, y, z);
        assert!(passes([&at(0.2, 0.2, -1.0), &at(0.2, 0.2, 1.0)], triangle));
        assert!(passes(
            [&at(0.2, 0.2, -1e-300), &at(0.2, 0.2, 1e-300)],
            triangle
        ));
        assert!(!passes([&at(0.2, 0.2, 0.0), &at(0.2, 0.2, 1.0)], triangle));
        assert!(!passes([&at(0.8, 0.8, -1.0), &at(0.8, 0.8, 1.0)], triangle));
        assert!(!passes([&at(0.2, 0.2, 0.5), &at(0.2, 0.2, 1.0)], triangle));
        assert!(!passes([&at(0.0, 0.5, -1.0), &at(0.0, 0.5, 1.0)], triangle));
    }
}
