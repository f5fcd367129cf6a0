//! The boundary of a tetrahedral mesh: the faces that belong to one tetrahedron.
//!
//! The corners of a face run counterclockwise seen from outside. A quadratic face has a vertex at the middle of each edge
//! and is divided into four triangles, so the boundary bends with the face.

use super::tet::{Cells, MIDSIDE_ENDS, TetMesh};
use std::collections::BTreeMap;

/// The corners of the four faces of a tetrahedron, counterclockwise seen from outside. The volume
/// `(x1 - x0) x (x2 - x0) . (x3 - x0)` of a tetrahedron is positive.
const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

impl TetMesh {
    /// The triangles of the boundary, in the order of the cells.
    pub fn boundary(&self) -> Vec<[u32; 3]> {
        self.cells.boundary()
    }
}

impl Cells {
    /// The triangles of the boundary, in the order of the cells.
    pub fn boundary(&self) -> Vec<[u32; 3]> {
        let mut shared: BTreeMap<[u32; 3], u8> = BTreeMap::new();
        for cell in self.vertices() {
            for face in faces(cell) {
                let count = shared.entry(sorted(face)).or_insert(0);
                *count = count.saturating_add(1);
            }
        }
        let mut triangles = Vec::new();
        for cell in self.vertices() {
            for (face, corners) in faces(cell).zip(FACES) {
                if shared.get(&sorted(face)) != Some(&1) {
                    continue;
                }
                let [a, b, c] = face;
                match middles(cell, corners) {
                    None => triangles.push(face),
                    Some([ab, bc, ca]) => {
                        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
                    }
                }
            }
        }
        triangles
    }
}

/// The vertices at the corners of the four faces of a cell.
fn faces(cell: &[u32]) -> impl Iterator<Item = [u32; 3]> + '_ {
    FACES.into_iter().map(|face| face.map(|k| cell[k]))
}

fn sorted(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}

/// The vertices at the middles of the edges of a face; `None` for a linear cell.
fn middles(cell: &[u32], [a, b, c]: [usize; 3]) -> Option<[u32; 3]> {
    let middle = |ends: [usize; 2]| {
        let edge = MIDSIDE_ENDS
            .iter()
            .position(|edge| edge.iter().all(|end| ends.contains(end)))?;
        cell.get(4 + edge).copied()
    };
    Some([middle([a, b])?, middle([b, c])?, middle([c, a])?])
}
