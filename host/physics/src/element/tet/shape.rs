//! Shape functions and quadrature of tetrahedra.
//!
//! Both elements use the barycentric coordinates `l0 = 1 - r - s - t, l1 = r, l2 = s, l3 = t` (Zienkiewicz
//! and Taylor, "The finite element method", volume 1, chapter 8). The linear element has one quadrature point. The
//! quadratic element has the four points that integrate quadratics exactly. On straight edges these are the products
//! of its gradients, and only rigid motions have no energy. The vertices have the order of VTK.

use crate::Vec3;
use crate::mesh::tet::MIDSIDE_ENDS;

/// A tetrahedron with `N` nodes and `Q` quadrature points.
pub trait Shape<const N: usize, const Q: usize>: Copy + core::fmt::Debug + Send + Sync {
    /// Quadrature points (r, s, t), all of weight `1 / (6 Q)` in the reference tetrahedron.
    fn points() -> [Vec3; Q];

    /// Values of the shape functions.
    fn values(at: &Vec3) -> [f64; N];

    /// Gradients of the shape functions by (r, s, t).
    fn gradients(at: &Vec3) -> [Vec3; N];

    /// Fraction of the element's mass that is lumped at each node: the diagonal of the consistent mass matrix, scaled
    /// to the total mass (Hinton, Rock and Zienkiewicz, "A note on mass lumping and related processes in the finite
    /// element method", 1976). Row sums would give the corners of the quadratic tetrahedron a negative mass.
    fn lumping() -> [f64; N];

    /// Integral of each shape function over the undistorted element, as a fraction of its volume.
    fn weights() -> [f64; N];
}

/// Four nodes, constant strain.
#[derive(Clone, Copy, Debug)]
pub struct Tet4;

/// Ten nodes, linear strain.
#[derive(Clone, Copy, Debug)]
pub struct Tet10;

fn barycentric(at: &Vec3) -> [f64; 4] {
    [1.0 - at.x - at.y - at.z, at.x, at.y, at.z]
}

/// Gradients of the barycentric coordinates.
fn slopes() -> [Vec3; 4] {
    [Vec3::new(-1.0, -1.0, -1.0), Vec3::x(), Vec3::y(), Vec3::z()]
}

impl Shape<4, 1> for Tet4 {
    fn points() -> [Vec3; 1] {
        [Vec3::repeat(0.25)]
    }

    fn values(at: &Vec3) -> [f64; 4] {
        barycentric(at)
    }

    fn gradients(_: &Vec3) -> [Vec3; 4] {
        slopes()
    }

    fn lumping() -> [f64; 4] {
        [0.25; 4]
    }

    fn weights() -> [f64; 4] {
        [0.25; 4]
    }
}

impl Shape<10, 4> for Tet10 {
    fn points() -> [Vec3; 4] {
        // (5 - sqrt 5) / 20 and (5 + 3 sqrt 5) / 20.
        let near = 0.138_196_601_125_010_5;
        let far = 0.585_410_196_624_968_5;
        [
            Vec3::new(near, near, near),
            Vec3::new(far, near, near),
            Vec3::new(near, far, near),
            Vec3::new(near, near, far),
        ]
    }

    fn values(at: &Vec3) -> [f64; 10] {
        let l = barycentric(at);
        let mut values = [0.0; 10];
        for (value, l) in values.iter_mut().zip(l) {
            *value = l * (2.0 * l - 1.0);
        }
        for (value, [a, b]) in values[4..].iter_mut().zip(MIDSIDE_ENDS) {
            *value = 4.0 * l[a] * l[b];
        }
        values
    }

    fn gradients(at: &Vec3) -> [Vec3; 10] {
        let (l, d) = (barycentric(at), slopes());
        let mut gradients = [Vec3::zeros(); 10];
        for a in 0..4 {
            gradients[a] = d[a] * (4.0 * l[a] - 1.0);
        }
        for (gradient, [a, b]) in gradients[4..].iter_mut().zip(MIDSIDE_ENDS) {
            *gradient = (d[b] * l[a] + d[a] * l[b]) * 4.0;
        }
        gradients
    }

    fn lumping() -> [f64; 10] {
        // Diagonal of the consistent mass: 1/70 at a corner, 8/105 at a midside, together 18/35.
        let mut fractions = [1.0 / 36.0; 10];
        fractions[4..].fill(4.0 / 27.0);
        fractions
    }

    fn weights() -> [f64; 10] {
        let mut weights = [-0.05; 10];
        weights[4..].fill(0.2);
        weights
    }
}
