//! Facets of the surface of a solid, and the common parts of two of them.
//!
//! A facet has the three or six nodes of the face of a tetrahedron. A quadratic facet is divided at its middles into four plane
//! triangles to find what it shares with another facet; the points found lie on the facet itself (Puso, Laursen and Solberg, "A
//! segment-to-segment mortar contact method for quadratic elements and large deformations", 2008, section 3).

use crate::Vec3;
use crate::mesh::{Cells, TetMesh};

/// Barycentric coordinates of the nodes of a facet.
const NODES: [[f64; 3]; 6] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.5],
    [0.5, 0.0, 0.5],
];
/// The nodes of the plane parts of a quadratic facet, and of a linear one.
const PARTS: [[usize; 3]; 4] = [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]];
const WHOLE: [[usize; 3]; 1] = [[0, 1, 2]];

/// A facet of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    /// The corners, counterclockwise seen from outside, and the middles of the sides that begin at them; the corners again if
    /// the facet is linear.
    pub nodes: [u32; 6],
    /// Whether it has middles.
    pub is_quadratic: bool,
}

impl Facet {
    /// The facets of the boundary of a solid. Nodes are numbered from `first` on.
    pub fn of(mesh: &TetMesh, first: u32) -> Vec<Self> {
        let triangles = mesh.boundary();
        let facets = match mesh.cells {
            Cells::Linear(_) => triangles.chunks(1),
            // Each quadratic face is four triangles of the boundary, in the order of `PARTS`.
            Cells::Quadratic(_) => triangles.chunks(4),
        };
        let facets = facets.filter_map(|parts| match parts {
            [[a, b, c]] => Some(([*a, *b, *c, *a, *b, *c], false)),
            [[a, ab, ca], [_, b, bc], [_, _, c], _] => Some(([*a, *b, *c, *ab, *bc, *ca], true)),
            _ => None,
        });
        let facets = facets.map(|(nodes, is_quadratic)| Self {
            nodes: nodes.map(|node| node + first),
            is_quadratic,
        });
        facets.collect()
    }

    /// The three or six nodes.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..if self.is_quadratic { 6 } else { 3 }]
    }

    /// The values of the shape functions of the nodes at a place in barycentric coordinates.
    pub fn shapes(&self, [a, b, c]: [f64; 3]) -> [f64; 6] {
        if self.is_quadratic {
            let corner = |l: f64| l * (2.0 * l - 1.0);
            let middle = |k: f64, l: f64| 4.0 * k * l;
            [
                corner(a),
                corner(b),
                corner(c),
                middle(a, b),
                middle(b, c),
                middle(c, a),
            ]
        } else {
            [a, b, c, 0.0, 0.0, 0.0]
        }
    }

    /// The nodes of the plane parts, by their numbers in [`nodes`](Self::nodes).
    fn parts(&self) -> &'static [[usize; 3]] {
        if self.is_quadratic { &PARTS } else { &WHOLE }
    }

    /// Calls `found` for each common part of this facet and another one that faces it, as both are projected on the first one along
    /// its normal. `x` has the positions of the nodes (m).
    pub fn each_common(&self, other: &Self, x: &[Vec3], found: &mut dyn FnMut(&Common)) {
        for own in self.parts() {
            for its in other.parts() {
                let at = |facet: &Self, part: &[usize; 3]| {
                    part.map(|node| x[facet.nodes[node] as usize])
                };
                let Some((normal, points)) = common([at(self, own), at(other, its)]) else {
                    continue;
                };
                let on_facet = |part: &[usize; 3], at: [f64; 3]| {
                    [0, 1, 2].map(|i| (0..3).map(|k| at[k] * NODES[part[k]][i]).sum())
                };
                let points = points.into_iter().map(|point| Point {
                    at: [on_facet(own, point.at[0]), on_facet(its, point.at[1])],
                    ..point
                });
                found(&Common {
                    normal,
                    points: points.collect(),
                });
            }
        }
    }
}

/// What two facets share.
#[derive(Clone, Debug, PartialEq)]
pub struct Common {
    /// The outer normal of the first one.
    pub normal: Vec3,
    /// Points of integration.
    pub points: Vec<Point>,
}

/// A point of integration over the common part of two facets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Its place on both, in barycentric coordinates.
    pub at: [[f64; 3]; 2],
    /// The area of the first facet for which it stands (m²).
    pub area: f64,
}

/// The least product of the normals of facets that face each other, negative: 60 degrees between their planes.
const FACING: f64 = 0.5;
/// A part of a facet smaller than this fraction is rounding.
const LEAST: f64 = 1e-9;
/// Places and weights of the rule of six points on a triangle, exact to degree four (Dunavant, "High degree efficient symmetrical
/// Gaussian quadrature rules for the triangle", 1985): one place of three that follow from each other, and its weight. On
/// straight facets the product of a linear and a quadratic function has degree three.
const RULE: [[f64; 2]; 2] = [
    [0.445_948_490_915_965, 0.223_381_589_678_011],
    [0.091_576_213_509_771, 0.109_951_743_655_322],
];

/// The outer normal of the first of two triangles, and the points of integration of the part that it shares with the second one;
/// `None` if they do not face each other or share nothing.
fn common([first, second]: [[Vec3; 3]; 2]) -> Option<(Vec3, Vec<Point>)> {
    let across = |[a, b, c]: [Vec3; 3]| (b - a).cross(&(c - a));
    let [n, m] = [across(first), across(second)];
    // This fails, too, for a triangle without a plane.
    let faces = n.dot(&m) < -FACING * n.norm() * m.norm();
    if !faces {
        return None;
    }
    let [a, b, c] = first;
    let place = |p: &Vec3| {
        let part = |from: &Vec3, to: &Vec3| n.dot(&(from - p).cross(&(to - p))) / n.norm_squared();
        [part(&b, &c), part(&c, &a), part(&a, &b)]
    };
    let mut polygon: Vec<[[f64; 3]; 2]> = (0..3).map(|i| [place(&second[i]), NODES[i]]).collect();
    // Sutherland and Hodgman, "Reentrant polygon clipping", 1974. Both places are affine along an edge.
    for side in 0..3 {
        let mut inside = Vec::with_capacity(polygon.len() + 1);
        let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
        for (from, to) in edges {
            let [start, end] = [from, to].map(|corner| corner[0][side]);
            if start >= 0.0 {
                inside.push(*from);
            }
            if (start >= 0.0) != (end >= 0.0) {
                let t = start / (start - end);
                let between =
                    |i: usize| [0, 1, 2].map(|k| from[i][k] + t * (to[i][k] - from[i][k]));
                inside.push([between(0), between(1)]);
            }
        }
        polygon = inside;
    }
    let (origin, rest) = polygon.split_first()?;
    let mut points = Vec::new();
    let mut sum = 0.0;
    for pair in rest.windows(2) {
        let corners = [origin, &pair[0], &pair[1]];
        let by = |corner: &[[f64; 3]; 2]| [0, 1].map(|k| corner[0][k] - origin[0][k]);
        let ([p, q], [r, s]) = (by(corners[1]), by(corners[2]));
        let share = (p * s - q * r).abs();
        sum += share;
        for [place, weight] in RULE {
            for apart in 0..3 {
                let weigh = |corner: usize| {
                    if corner == apart {
                        1.0 - 2.0 * place
                    } else {
                        place
                    }
                };
                let at = [0, 1].map(|side| {
                    [0, 1, 2].map(|k| (0..3).map(|i| weigh(i) * corners[i][side][k]).sum())
                });
                points.push(Point {
                    at,
                    area: 0.5 * n.norm() * share * weight,
                });
            }
        }
    }
    (sum > LEAST).then(|| (n.normalize(), points))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of two triangles, seen from above or from below, and one that it covers in part.
    fn facets(first: u32, from_above: bool) -> Vec<Facet> {
        let triangles = if from_above {
            [[0, 1, 2], [0, 2, 3]]
        } else {
            [[0, 2, 1], [0, 3, 2]]
        };
        let facets = triangles.into_iter().map(|[a, b, c]| Facet {
            nodes: [a, b, c, a, b, c].map(|node| node + first),
            is_quadratic: false,
        });
        facets.collect()
    }

    fn sums(x: &[Vec3], facets: [&[Facet]; 2]) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for one in facets[0] {
            for other in facets[1] {
                one.each_common(other, x, &mut |common| {
                    for point in &common.points {
                        let at = |facet: &Facet, at| -> Vec3 {
                            let nodes = facet.nodes().iter().zip(facet.shapes(at));
                            nodes.map(|(node, shape)| x[*node as usize] * shape).sum()
                        };
                        let [p, q] = [at(one, point.at[0]), at(other, point.at[1])];
                        assert!((p - q).cross(&common.normal).norm() < 1e-12, "{p} {q}");
                        sums[0] += point.area;
                        sums[1] += point.area * p.x.powi(3) * p.y;
                    }
                });
            }
        }
        sums
    }

    /// Two squares, one turned by 45 degrees, over each other: the common part is an octagon.
    #[test]
    fn what_two_squares_share_is_integrated_exactly() {
        let mut x: Vec<Vec3> = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| Vec3::new(x, y, 0.0))
            .to_vec();
        let r = 1.2;
        x.extend([[-r, 0.0], [0.0, -r], [r, 0.0], [0.0, r]].map(|[x, y]| Vec3::new(x, y, -0.3)));
        let (upper, lower) = (facets(0, false), facets(4, true));
        let [area, _] = sums(&x, [&upper, &lower]);
        // The corners of the turned square stand out by 0.2.
        let exact = 2.0 * r * r - 4.0 * (r - 1.0) * (r - 1.0);
        assert!((area - exact).abs() < 1e-12, "{area} {exact}");
        // Those that look the same way do not face each other.
        assert_eq!(sums(&x, [&upper, &facets(4, false)]), [0.0; 2]);
        // A polynomial of degree four over a triangle inside the other one.
        let corner = [
            [0.0, 0.0],
            [1.0, 0.0],
            [1.0, 1.0],
            [-3.0, -1.0],
            [1.0, 4.0],
            [4.0, -1.0],
        ];
        let x = corner.map(|[x, y]| Vec3::new(x, y, 0.1 * x + 0.2));
        let facet = |nodes: [u32; 3]| {
            let [a, b, c] = nodes;
            Facet {
                nodes: [a, b, c, a, b, c],
                is_quadratic: false,
            }
        };
        let [_, moment] = sums(&x, [&[facet([0, 1, 2])], &[facet([3, 4, 5])]]);
        let slope = f64::hypot(1.0, 0.1);
        // Integral of x^3 y over 0 <= y <= x <= 1: a twelfth.
        assert!((moment - slope / 12.0).abs() < 1e-12, "{moment}");
    }
}
