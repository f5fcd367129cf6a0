//! Distances between points, triangles and edges, with the feet of the shortest connection.
//!
//! Ericson, "Real-Time Collision Detection" (2005): sections 5.1.5 (point and triangle) and 5.1.9 (two segments). The
//! functions hold for degenerate triangles and edges: the result is the distance to one of their points, and is never
//! smaller than the true distance by more than rounding.

use crate::Vec3;

/// The square of the sine of a corner below which a triangle counts as its edges: its plane is lost to rounding.
const FLAT: f64 = 1e-18;

/// The point of a triangle that is closest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnTriangle {
    /// Weights of the triangle's vertices. Their sum is one.
    pub weights: [f64; 3],
    /// From the closest point to the other point (m).
    pub apart: Vec3,
}

/// The point of triangle `abc` that is closest to `p`.
pub fn point_triangle(p: &Vec3, [a, b, c]: [&Vec3; 3]) -> OnTriangle {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let at = |weights: [f64; 3]| OnTriangle {
        weights,
        apart: ap - ab * weights[1] - ac * weights[2],
    };
    let area = ab.cross(&ac).norm_squared();
    if area <= FLAT * ab.norm_squared() * ac.norm_squared() {
        return on_border(p, [a, b, c]);
    }
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return at([1.0, 0.0, 0.0]);
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return at([0.0, 1.0, 0.0]);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return at([1.0 - v, v, 0.0]);
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return at([0.0, 0.0, 1.0]);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return at([1.0 - w, 0.0, w]);
    }
    let va = d3 * d6 - d5 * d4;
    let (along, back) = (d4 - d3, d5 - d6);
    if va <= 0.0 && along >= 0.0 && back >= 0.0 {
        let w = along / (along + back);
        return at([0.0, 1.0 - w, w]);
    }
    let sum = va + vb + vc;
    let (v, w) = (vb / sum, vc / sum);
    at([1.0 - v - w, v, w])
}

/// The closest point on the edges of a triangle.
fn on_border(p: &Vec3, vertices: [&Vec3; 3]) -> OnTriangle {
    let on_edge = |[i, j]: [usize; 2]| {
        let t = on_segment(p, vertices[i], vertices[j]);
        let mut weights = [0.0; 3];
        (weights[i], weights[j]) = (1.0 - t, t);
        let apart = p - vertices[i] * (1.0 - t) - vertices[j] * t;
        OnTriangle { weights, apart }
    };
    let nearer = |best: OnTriangle, other: OnTriangle| {
        let is_nearer = other.apart.norm_squared() < best.apart.norm_squared();
        if is_nearer { other } else { best }
    };
    nearer(nearer(on_edge([0, 1]), on_edge([1, 2])), on_edge([2, 0]))
}

/// Where, from 0 at `a` to 1 at `b`, the segment `ab` is closest to `p`.
fn on_segment(p: &Vec3, a: &Vec3, b: &Vec3) -> f64 {
    let ab = b - a;
    fraction(ab.dot(&(p - a)), ab.norm_squared())
}

/// `part / whole`, from 0 to 1; 0 for a whole of zero.
fn fraction(part: f64, whole: f64) -> f64 {
    if part <= 0.0 {
        0.0
    } else if part >= whole {
        if whole > 0.0 { 1.0 } else { 0.0 }
    } else {
        part / whole
    }
}

/// The points of two edges that are closest to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnEdges {
    /// Where the point of the first edge lies, from 0 at its first vertex to 1 at its second.
    pub s: f64,
    /// Where the point of the second edge lies.
    pub t: f64,
    /// From the point of the second edge to that of the first one (m).
    pub apart: Vec3,
}

/// The closest points of the edges `ab` and `cd`.
pub fn edge_edge([a, b]: [&Vec3; 2], [c, d]: [&Vec3; 2]) -> OnEdges {
    let (first, second, r) = (b - a, d - c, a - c);
    let (aa, ee) = (first.norm_squared(), second.norm_squared());
    let (f, cc, bb) = (second.dot(&r), first.dot(&r), first.dot(&second));
    let area = aa * ee - bb * bb;
    // Parallel edges: any point of the first edge may begin.
    let mut s = if area > f64::EPSILON * aa * ee {
        ((bb * f - cc * ee) / area).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let t = fraction(bb * s + f, ee);
    if t == 0.0 || t == 1.0 {
        s = fraction(bb * t - cc, aa);
    }
    OnEdges {
        s,
        t,
        apart: r + first * s - second * t,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vec3> {
        [-1.0..1.0, -1.0..1.0, -1.0..1.0].prop_map(Vec3::from)
    }

    /// The least distance from `p` to a grid of `n + 1` points on each side of a triangle.
    fn least(p: &Vec3, [a, b, c]: [Vec3; 3], n: u32) -> f64 {
        let mut least = f64::INFINITY;
        for i in 0..=n {
            for j in 0..=n - i {
                let (v, w) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                least = least.min((p - (a + (b - a) * v + (c - a) * w)).norm());
            }
        }
        least
    }

    proptest! {
        #[test]
        fn no_point_of_a_triangle_is_closer_than_the_foot(p in point(), a in point(), b in point(), c in point()) {
            let found = point_triangle(&p, [&a, &b, &c]);
            let sum: f64 = found.weights.iter().sum();
            prop_assert!((sum - 1.0).abs() < 1e-12 && found.weights.iter().all(|w| *w >= -1e-12));
            let grid = least(&p, [a, b, c], 24);
            let step = (b - a).norm().max((c - a).norm()) / 12.0;
            // The grid has a point within one step of the foot, and the foot is a point of the triangle.
            prop_assert!(found.apart.norm() <= grid + 1e-12);
            prop_assert!(found.apart.norm() >= grid - step);
        }

        #[test]
        fn triangles_without_area_have_a_foot(p in point(), a in point(), b in point(), t in -0.5..1.5) {
            let c = a + (b - a) * t;
            let found = point_triangle(&p, [&a, &b, &c]);
            let grid = least(&p, [a, b, c], 24);
            // The sides of the triangle differ by less than 1e-9 of their length.
            prop_assert!(found.apart.norm() <= grid + 1e-8, "{found:?} {grid}");
            let same = point_triangle(&p, [&a, &a, &a]);
            prop_assert!((same.apart - (p - a)).norm() < 1e-12);
        }

        #[test]
        fn no_points_of_two_edges_are_closer_than_the_feet(a in point(), b in point(), c in point(), d in point()) {
            let found = edge_edge([&a, &b], [&c, &d]);
            for i in 0..=24 {
                let on = a + (b - a) * (f64::from(i) / 24.0);
                let t = on_segment(&on, &c, &d);
                let distance = (on - (c + (d - c) * t)).norm();
                prop_assert!(found.apart.norm() <= distance + 1e-9);
            }
            let apart = (a + (b - a) * found.s) - (c + (d - c) * found.t);
            prop_assert!((apart - found.apart).norm() < 1e-12);
        }

        #[test]
        fn parallel_edges_have_feet(a in point(), along in point(), shift in point(), t in -2.0..2.0) {
            let (b, c) = (a + along, a + shift);
            let d = c + along * t;
            let found = edge_edge([&a, &b], [&c, &d]);
            let other = edge_edge([&c, &d], [&a, &b]);
            prop_assert!((found.apart.norm() - other.apart.norm()).abs() < 1e-6);
        }
    }
}
