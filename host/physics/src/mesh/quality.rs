//! How well shaped the elements of a mesh are.
//!
//! The quality of an element is its **radius ratio**: the radius of the inscribed circle or sphere over that of the
//! circumscribed one, times the dimension. It is 1 for an element of equal sides and 0 for an element without an area
//! or a volume, and does not depend on the size. It is small for needles, whose short side makes the stiffness of
//! neighbours differ by far, and falls with the square of the aspect ratio for elements with an angle near 180 degrees,
//! whose strain errs by the radius of the circumscribed circle (J. R. Shewchuk, "What is a good linear finite
//! element?", 2002; the ratio as in P. P. Pébay and T. J. Baker, "Analysis of triangle quality measures", 2003).

use super::{Mesh, TetMesh, TriMesh};
use crate::Vec3;

/// The shape of one element at rest. A quadratic tetrahedron has the shape of its corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// The radius ratio, from 0 to 1.
    pub quality: f64,
    /// The area (m²) or the volume (m³).
    pub size: f64,
    /// The middle of the corners at the start (m).
    pub centre: Vec3,
}

/// The shapes of the elements of a mesh, in the order of the file. A mesh of lines has none: every line is well shaped.
pub fn shapes(mesh: &Mesh) -> Vec<Shape> {
    match mesh {
        Mesh::Thread(_) => Vec::new(),
        Mesh::Sheet(mesh) => of_triangles(mesh),
        Mesh::Solid(mesh) => of_cells(mesh),
    }
}

fn of_triangles(mesh: &TriMesh) -> Vec<Shape> {
    let each = (0..mesh.triangles.len() as u32).map(|number| {
        // A checked mesh has the corners of each triangle.
        let rest = mesh.rest_corners(number).unwrap_or_default();
        let start = mesh.corners(number).unwrap_or_default();
        Shape {
            quality: of_triangle(rest),
            size: mesh.triangle_area(number).unwrap_or_default(),
            centre: start.iter().sum::<Vec3>() / 3.0,
        }
    });
    each.collect()
}

fn of_cells(mesh: &TetMesh) -> Vec<Shape> {
    let each = mesh.cells.vertices().map(|cell| {
        let corners = [0, 1, 2, 3].map(|corner| mesh.positions[cell[corner] as usize]);
        let [a, b, c, d] = corners;
        Shape {
            quality: of_tetrahedron(corners),
            size: (b - a).cross(&(c - a)).dot(&(d - a)).abs() / 6.0,
            centre: corners.iter().sum::<Vec3>() / 4.0,
        }
    });
    each.collect()
}

/// The radius ratio of a triangle: `16 A^2 / (a b c (a + b + c))` with the area `A` and the sides `a`, `b` and `c`.
pub fn of_triangle([a, b, c]: [Vec3; 3]) -> f64 {
    let sides = [(b - a).norm(), (c - b).norm(), (a - c).norm()];
    let twice_area = (b - a).cross(&(c - a)).norm();
    let ratio = 4.0
        * (twice_area / sides.iter().product::<f64>())
        * (twice_area / sides.iter().sum::<f64>());
    bounded(ratio)
}

/// The radius ratio of a tetrahedron. The radius of the inscribed sphere is `3 V / S` with the volume `V` and the surface
/// `S`; the circumscribed one has the radius `|u^2 v x w + v^2 w x u + w^2 u x v| / 12 V` with the edges `u`, `v` and `w`
/// at one corner.
pub fn of_tetrahedron([a, b, c, d]: [Vec3; 4]) -> f64 {
    let (u, v, w) = (b - a, c - a, d - a);
    let volume = u.cross(&v).dot(&w).abs() / 6.0;
    let faces = [
        u.cross(&v),
        v.cross(&w),
        w.cross(&u),
        (v - u).cross(&(w - u)),
    ];
    let surface = 0.5 * faces.iter().map(Vec3::norm).sum::<f64>();
    let [uv, vw, wu, _] = faces;
    let across = u.norm_squared() * vw + v.norm_squared() * wu + w.norm_squared() * uv;
    bounded(108.0 * (volume / surface) * (volume / across.norm()))
}

/// A ratio without the error of rounding at its ends, and 0 for an element whose corners lie at one place.
fn bounded(ratio: f64) -> f64 {
    if ratio.is_finite() {
        ratio.min(1.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Cells;

    /// Rounding of some ten operations.
    const ROUNDING: f64 = 1e-14;

    #[test]
    fn elements_of_equal_sides_have_one_and_flat_ones_zero() {
        let [x, y, z] = [Vec3::x(), Vec3::y(), Vec3::z()];
        assert!((of_triangle([x, y, z]) - 1.0).abs() < ROUNDING);
        let cube = [Vec3::zeros(), x + y, y + z, z + x];
        assert!((of_tetrahedron(cube) - 1.0).abs() < ROUNDING);
        assert_eq!(of_triangle([x, 2.0 * x, 3.0 * x]), 0.0);
        assert_eq!(of_triangle([x; 3]), 0.0);
        assert_eq!(of_tetrahedron([Vec3::zeros(), x, y, x + y]), 0.0);
        assert_eq!(of_tetrahedron([x; 4]), 0.0);
    }

    #[test]
    fn the_ratio_is_that_of_the_radii_at_any_size_and_place() {
        // The sides 3, 4 and 5 have the radii 1 and 2.5; the corner of a cube of side 1 has (3 - sqrt 3) / 6 and
        // sqrt 3 / 2.
        let corner = 3.0 * (3.0 - 3.0_f64.sqrt()) / 6.0 / (3.0_f64.sqrt() / 2.0);
        for scale in [1e-6, 1.0, 1e4] {
            let at = |p: Vec3| scale * (p + Vec3::new(1.0, -2.0, 0.5));
            let triangle = [Vec3::zeros(), 3.0 * Vec3::x(), 4.0 * Vec3::z()].map(at);
            assert!((of_triangle(triangle) - 0.8).abs() < 10.0 * ROUNDING);
            let cell = [Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()].map(at);
            assert!((of_tetrahedron(cell) - corner).abs() < 10.0 * ROUNDING);
        }
        // Needles fall with the aspect ratio, and angles near 180 degrees with its square.
        let thin = |end: f64| of_triangle([Vec3::zeros(), Vec3::x(), Vec3::new(end, 1e-3, 0.0)]);
        assert!((thin(1.0) - 2e-3).abs() < 1e-5, "{}", thin(1.0));
        assert!((thin(0.5) - 8e-6).abs() < 1e-10, "{}", thin(0.5));
    }

    #[test]
    fn a_mesh_has_a_shape_for_each_element_in_its_order() {
        let positions = vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()];
        let linear = TetMesh::new(positions, Cells::Linear(vec![[0, 1, 2, 3]])).unwrap();
        let quadratic = linear.quadratic();
        let expected = shapes(&Mesh::Solid(linear));
        assert_eq!(expected[0].size, 1.0 / 6.0);
        assert_eq!(expected[0].centre, Vec3::repeat(0.25));
        assert_eq!(shapes(&Mesh::Solid(quadratic)), expected);
    }
}
