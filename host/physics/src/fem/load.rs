//! Loads that are given per area, as forces on vertices.

use crate::Vec3;
use crate::mesh::{Adjacency, Cells, MeshError, TetMesh, TriMesh};
use std::collections::BTreeMap;

/// Faces of a tetrahedron by corners, and for each the vertices at the middles of its edges.
const FACES: [([usize; 3], [usize; 3]); 4] = [
    ([0, 2, 1], [6, 5, 4]),
    ([0, 1, 3], [4, 8, 7]),
    ([1, 2, 3], [5, 9, 8]),
    ([0, 3, 2], [7, 9, 6]),
];

/// Forces (N), one per vertex, of a uniform dead traction (Pa at rest, world axes) on those faces of the
/// mesh's surface whose corners all lie in `vertices`; and the area that they have (m^2).
///
/// They are consistent with the shape functions on flat faces: a third of the face's force at each corner of
/// a linear one, a third at each middle of a quadratic one.
pub fn traction(mesh: &TetMesh, vertices: &[u32], traction: Vec3) -> (Vec<Vec3>, f64) {
    let mut chosen = vec![false; mesh.positions.len()];
    for &vertex in vertices {
        if let Some(chosen) = chosen.get_mut(vertex as usize) {
            *chosen = true;
        }
    }
    // A face on the surface belongs to one cell only.
    let mut faces: BTreeMap<[u32; 3], (usize, [u32; 3])> = BTreeMap::new();
    for cell in mesh.cells.vertices() {
        for (corners, middles) in FACES {
            let corners = corners.map(|k| cell[k]);
            if !corners.iter().all(|&vertex| chosen[vertex as usize]) {
                continue;
            }
            let carriers = match mesh.cells {
                Cells::Linear(_) => corners,
                Cells::Quadratic(_) => middles.map(|k| cell[k]),
            };
            let mut key = corners;
            key.sort_unstable();
            faces.entry(key).or_insert((0, carriers)).0 += 1;
        }
    }
    let mut forces = vec![Vec3::zeros(); mesh.positions.len()];
    let mut whole = 0.0;
    for (corners, (_, carriers)) in faces.into_iter().filter(|(_, (cells, _))| *cells == 1) {
        let [a, b, c] = corners.map(|vertex| mesh.positions[vertex as usize]);
        let area = 0.5 * (b - a).cross(&(c - a)).norm();
        whole += area;
        for vertex in carriers {
            forces[vertex as usize] += traction * (area / 3.0);
        }
    }
    (forces, whole)
}

/// Forces (N), one per vertex, on those edges of a sheet's border whose ends both lie in `vertices`; and the
/// length that they have (m).
///
/// `per_length` gives the force per length at rest (N/m, world axes) at a place, from there and the outward
/// normal in the sheet's plane. It is integrated with two Gauss points an edge against the linear shape
/// functions: exactly, where it is quadratic along the edge.
///
/// # Errors
///
/// [`MeshError::CrowdedEdge`], where a mesh has no border to speak of.
pub fn edge_traction(
    mesh: &TriMesh,
    vertices: &[u32],
    per_length: impl Fn(&Vec3, &Vec3) -> Vec3,
) -> Result<(Vec<Vec3>, f64), MeshError> {
    let count = mesh.positions.len();
    let mut chosen = vec![false; count];
    for &vertex in vertices {
        if let Some(chosen) = chosen.get_mut(vertex as usize) {
            *chosen = true;
        }
    }
    let mut forces = vec![Vec3::zeros(); count];
    let mut whole = 0.0;
    // Half the distance between the Gauss points, as a share of the edge.
    let offset = 0.5 / libm::sqrt(3.0);
    for edge in Adjacency::new(&mesh.triangles)?.boundary {
        if !edge.vertices.iter().all(|&vertex| chosen[vertex as usize]) {
            continue;
        }
        let [a, b] = edge.vertices.map(|vertex| mesh.positions[vertex as usize]);
        let along = b - a;
        let length = along.norm();
        let inward = mesh.positions[edge.opposite as usize] - a;
        let outward = along * (inward.dot(&along) / (length * length)) - inward;
        let normal = outward / outward.norm();
        for share in [0.5 - offset, 0.5 + offset] {
            let force = per_length(&(a + along * share), &normal) * (0.5 * length);
            forces[edge.vertices[0] as usize] += force * (1.0 - share);
            forces[edge.vertices[1] as usize] += force * share;
        }
        whole += length;
    }
    Ok((forces, whole))
}
