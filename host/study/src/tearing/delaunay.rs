//! Delaunay triangulations of points in the plane, for meshes of specimens.
//!
//! Points are inserted one by one: the triangles whose circle holds the new point are removed, and the hole is filled with
//! triangles at the point (Bowyer, "Computing Dirichlet tessellations", 1981; Watson, "Computing the n-dimensional
//! Delaunay tessellation", 1981). The time is quadratic in the number of points, a second for ten thousand.

/// How far the three corners of the first triangle are from the points, as a multiple of their extent. The triangle has to
/// hold the circles of the border's triangles, and rounding grows with its square.
const FAR: f64 = 1e3;

/// The triangles of the Delaunay triangulation of `points`, counterclockwise, in a fixed order. No two points are equal.
/// If four points lie on one circle, rounding decides between the two diagonals.
pub(super) fn triangulate(points: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let count = points.len();
    let extent = |axis: usize| {
        let all = points.iter().map(|point| point[axis]);
        let (least, most) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), at| {
            (least.min(at), most.max(at))
        });
        (0.5 * (least + most), most - least)
    };
    let ((x, width), (y, height)) = (extent(0), extent(1));
    let far = FAR * width.max(height);
    let mut all = points.to_vec();
    all.extend([
        [x - 2.0 * far, y - far],
        [x + 2.0 * far, y - far],
        [x, y + 2.0 * far],
    ]);
    let first = count as u32;
    let mut triangles = vec![[first, first + 1, first + 2]];
    let mut sides: Vec<[u32; 2]> = Vec::new();
    for point in 0..first {
        sides.clear();
        triangles.retain(|&[a, b, c]| {
            let corners = [a, b, c].map(|corner| all[corner as usize]);
            let holds = circle_holds(&corners, all[point as usize]);
            if holds {
                sides.extend([[a, b], [b, c], [c, a]]);
            }
            !holds
        });
        // The sides between two removed triangles occur in both directions.
        for &[from, to] in &sides {
            if !sides.contains(&[to, from]) {
                triangles.push([from, to, point]);
            }
        }
    }
    triangles.retain(|corners| corners.iter().all(|&corner| corner < first));
    triangles
}

/// Whether a point lies inside the circle through the corners of a triangle, which are counterclockwise.
fn circle_holds(corners: &[[f64; 2]; 3], point: [f64; 2]) -> bool {
    let [a, b, c] = corners.map(|corner| [corner[0] - point[0], corner[1] - point[1]]);
    let square = |v: [f64; 2]| v[0] * v[0] + v[1] * v[1];
    let cross = |v: [f64; 2], w: [f64; 2]| v[0] * w[1] - v[1] * w[0];
    square(a) * cross(b, c) + square(b) * cross(c, a) + square(c) * cross(a, b) > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_circle_of_a_triangle_holds_a_point() {
        // Points of the golden angle's spiral: no four of them lie on one circle.
        let point = |k: u32| {
            let (radius, angle) = (f64::from(k).sqrt(), 2.399_963 * f64::from(k));
            [radius * libm::cos(angle), radius * libm::sin(angle)]
        };
        let points: Vec<[f64; 2]> = (0..200).map(point).collect();
        let triangles = triangulate(&points);
        for triangle in &triangles {
            let corners = triangle.map(|corner| points[corner as usize]);
            let others = (0_u32..)
                .zip(&points)
                .filter(|(k, _)| !triangle.contains(k));
            assert!(
                others
                    .into_iter()
                    .all(|(_, &point)| !circle_holds(&corners, point))
            );
        }
        // Euler's formula: the border has 2 n - 2 - f edges, and the spiral's last turn forms it.
        let border = 2 * points.len() - 2 - triangles.len();
        assert!((10..40).contains(&border), "{border}");
    }
}
