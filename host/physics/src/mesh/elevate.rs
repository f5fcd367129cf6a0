//! The elevation of linear tetrahedra to quadratic ones.

use super::tet::MIDSIDE_ENDS;
use super::{Cells, TetMesh};
use std::collections::BTreeMap;

impl TetMesh {
    /// The same mesh with a vertex at the middle of each edge; a quadratic mesh is returned as it is.
    ///
    /// Corners keep their numbers. The middles follow in the order of the cells. A middle joins a vertex group
    /// if its edge belongs to a face of the mesh's surface whose corners are all in the group. The group of a
    /// face thus gains the middles on that face and none inside the body. A group of all vertices gains all
    /// middles.
    #[must_use]
    pub fn quadratic(&self) -> Self {
        let Cells::Linear(cells) = &self.cells else {
            return self.clone();
        };
        let mut mesh = self.clone();
        let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut faces: BTreeMap<[u32; 3], usize> = BTreeMap::new();
        let mut quadratic = Vec::with_capacity(cells.len());
        for cell in cells {
            let mut all = [0; 10];
            all[..4].copy_from_slice(cell);
            for (slot, [a, b]) in all[4..].iter_mut().zip(MIDSIDE_ENDS) {
                let ends = [cell[a].min(cell[b]), cell[a].max(cell[b])];
                *slot = *middles.entry(ends).or_insert_with(|| {
                    let [a, b] = ends.map(|vertex| self.positions[vertex as usize]);
                    mesh.positions.push(a + (b - a) * 0.5);
                    (mesh.positions.len() - 1) as u32
                });
            }
            quadratic.push(all);
            for out in 0..4 {
                let mut face = [
                    cell[(out + 1) % 4],
                    cell[(out + 2) % 4],
                    cell[(out + 3) % 4],
                ];
                face.sort_unstable();
                *faces.entry(face).or_insert(0) += 1;
            }
        }
        mesh.cells = Cells::Quadratic(quadratic);
        let surface: Vec<[u32; 3]> = faces
            .into_iter()
            .filter(|(_, cells)| *cells == 1)
            .map(|(face, _)| face)
            .collect();
        for group in &mut mesh.vertex_groups {
            let mut member = vec![false; self.positions.len()];
            for &vertex in &group.members {
                member[vertex as usize] = true;
            }
            let whole = group.members.len() == self.positions.len();
            let mut added: Vec<u32> = if whole {
                middles.values().copied().collect()
            } else {
                surface
                    .iter()
                    .filter(|face| face.iter().all(|&vertex| member[vertex as usize]))
                    .flat_map(|&[a, b, c]| [[a, b], [b, c], [a, c]])
                    .filter_map(|ends| middles.get(&ends).copied())
                    .collect()
            };
            added.sort_unstable();
            added.dedup();
            group.members.extend(added);
        }
        mesh
    }
}
