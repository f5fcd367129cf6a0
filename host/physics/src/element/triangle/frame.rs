//! A triangle at rest, as the mesh or a flat pattern has it: an orthonormal frame in its plane, the gradients of its hat functions in that frame, its area.

use crate::Vec3;
use crate::error::BodyError;
use crate::mesh::TriMesh;
use crate::topology::Shape;

/// The gradients `g_1`, `g_2` (1/m) in the triangle's rest frame and its rest area (m²), or `None` if the triangle is
/// flat.
///
/// The first axis of the frame is along the first edge. The triangle is counterclockwise in the frame.
pub(crate) fn rest_frame(x: [&Vec3; 3]) -> Option<([[f64; 2]; 2], f64)> {
    let e1 = x[1] - x[0];
    let e2 = x[2] - x[0];
    let longest = e1.norm().max(e2.norm()).max((e2 - e1).norm());
    let twice_area = e1.cross(&e2).norm();
    // The gradients of a flatter triangle would give strains without correct digits.
    if twice_area <= 1e-10 * longest * longest || twice_area.is_nan() {
        return None;
    }
    let length = e1.norm();
    let along = e1.dot(&e2) / length;
    let height = twice_area / length;
    Some((
        [
            [1.0 / length, -along / (length * height)],
            [0.0, 1.0 / height],
        ],
        0.5 * twice_area,
    ))
}

/// The corners of a triangle at rest (m) in the frame of its `gradients` (1/m), with the first corner at the origin.
pub(crate) fn shape_of([g1, g2]: [[f64; 2]; 2]) -> Shape {
    // The gradients are the rows of the inverse of the matrix whose columns are the edges.
    let determinant = g1[0] * g2[1] - g1[1] * g2[0];
    [
        [0.0, 0.0],
        [g2[1] / determinant, -g2[0] / determinant],
        [-g1[1] / determinant, g1[0] / determinant],
    ]
}

/// The axes of the frame of [`rest_frame`] in world coordinates. The triangle must have such a frame.
pub(crate) fn rest_axes(x: [&Vec3; 3]) -> [Vec3; 2] {
    let (e1, e2) = (x[1] - x[0], x[2] - x[0]);
    let along = e1.normalize();
    [along, e1.cross(&e2).normalize().cross(&along)]
}

/// The corners of a triangle in the flat pattern of `mesh` (m), or `None` without a pattern: then the mesh is the shape
/// at rest.
pub(crate) fn rest_corners(mesh: &TriMesh, triangle: usize) -> Option<[Vec3; 3]> {
    mesh.flat_pattern.as_ref()?.corners_of(triangle)
}

/// The error that names a triangle without a frame.
pub(crate) fn degenerate(triangle: usize, x: [&Vec3; 3]) -> BodyError {
    let (e1, e2) = (x[1] - x[0], x[2] - x[0]);
    BodyError::Degenerate {
        triangle,
        area: 0.5 * e1.cross(&e2).norm(),
        edge: e1.norm().max(e2.norm()).max((e2 - e1).norm()),
    }
}

/// The gradients of the second and third hat function (1/m) of a triangle with this shape, and its area (m²).
pub(crate) fn gradients_of([a, b, c]: Shape) -> ([[f64; 2]; 2], f64) {
    let ([x1, y1], [x2, y2]) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
    let twice = x1 * y2 - y1 * x2;
    (
        [[y2 / twice, -x2 / twice], [-y1 / twice, x1 / twice]],
        0.5 * twice.abs(),
    )
}

/// The area (m²) of a triangle with these gradients (1/m) of its second and third hat function.
pub(crate) fn area_of([g1, g2]: [[f64; 2]; 2]) -> f64 {
    0.5 / (g1[0] * g2[1] - g1[1] * g2[0]).abs()
}
