//! Crossings of surfaces, by an exact test of all edges and triangles.

use physics::Vec3;
use physics::contact::Surfaces;
use physics::contact::crossing::passes;

/// Calls `found` with each edge that passes through a triangle, by their vertices at `x`. A vertex at NaN is not there: room
/// for vertices that tears will add. Only parts that `may_touch` are tested.
pub(crate) fn crossings(
    surfaces: &Surfaces,
    x: &[Vec3],
    may_touch: &dyn Fn(usize, usize) -> bool,
    found: &mut dyn FnMut([u32; 2], [u32; 3]),
) {
    let at = |vertex: u32| &x[vertex as usize];
    let parts = surfaces.parts.iter().enumerate();
    let boxes: Vec<[Vec3; 2]> = parts
        .clone()
        .map(|(_, part)| box_of(part.vertices.clone().map(at)))
        .collect();
    for (one, of_triangles) in parts.clone() {
        for (other, of_edges) in parts.clone() {
            if !may_touch(one, other) || are_apart(boxes[one], boxes[other]) {
                continue;
            }
            for triangle in of_triangles.triangles.clone() {
                let corners = surfaces.triangles[triangle as usize];
                let around = box_of(corners.into_iter().map(at));
                for edge in of_edges.edges.clone() {
                    let ends = surfaces.edges[edge as usize];
                    if !are_apart(box_of(ends.into_iter().map(at)), around)
                        && !ends.iter().any(|vertex| corners.contains(vertex))
                        && passes(ends.map(at), corners.map(at))
                    {
                        found(ends, corners);
                    }
                }
            }
        }
    }
}

/// The box of points. Those at NaN do not count.
fn box_of<'a>(points: impl Iterator<Item = &'a Vec3>) -> [Vec3; 2] {
    let none = [f64::INFINITY, f64::NEG_INFINITY].map(Vec3::repeat);
    points.fold(none, |[low, high], x| [low.inf(x), high.sup(x)])
}

fn are_apart([from, to]: [Vec3; 2], [low, high]: [Vec3; 2]) -> bool {
    (0..3).any(|axis| from[axis] > high[axis] || to[axis] < low[axis])
}
