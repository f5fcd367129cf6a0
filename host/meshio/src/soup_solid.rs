//! From the tetrahedra that a file lists to a mesh: negative ones turned around, unused vertices dropped,
//! faults traced back to the file.

use crate::soup::drop_unused;
use physics::Vec3;
use physics::mesh::check::{Culprit, MAX_COUNT, check_distinct};
use physics::mesh::check_solid::{SolidError, size};
use physics::mesh::{Cells, MeshError, TetMesh};

/// Vertices and cells as a file lists them. Every vertex of a cell is one of the vertices.
pub(crate) struct SolidSoup {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) cells: Cells,
}

/// Why a soup is no mesh.
#[derive(Debug)]
pub(crate) struct SolidFault {
    pub(crate) source: SolidError,
    /// What is at fault, vertices numbered as in the file.
    pub(crate) culprit: Culprit,
}

impl SolidSoup {
    /// A mesh of these cells, without groups and fields, and the number in it of each vertex of the file;
    /// that of one that was dropped is [`UNUSED`](crate::soup::UNUSED).
    pub(crate) fn into_mesh(self) -> Result<(TetMesh, Vec<u32>), SolidFault> {
        let found = self.positions.len();
        if found > MAX_COUNT {
            let what = "vertices";
            return Err(SolidFault {
                source: MeshError::TooMany { what, found }.into(),
                culprit: Culprit::Mesh,
            });
        }
        let Self {
            mut positions,
            mut cells,
        } = self;
        let numbers = match &mut cells {
            Cells::Linear(cells) => drop_unused(&mut positions, cells),
            Cells::Quadratic(cells) => drop_unused(&mut positions, cells),
        };
        turn_negative(&positions, &mut cells);
        let fault = |source: SolidError| {
            let culprit = match source.culprit() {
                Culprit::Vertex(vertex) => {
                    let place = numbers.iter().position(|&number| number == vertex);
                    Culprit::Vertex(place.unwrap_or_default() as u32)
                }
                other => other,
            };
            SolidFault { source, culprit }
        };
        let mesh = TetMesh::new(positions, cells).map_err(fault)?;
        check_distinct(&mesh.positions).map_err(|error| fault(error.into()))?;
        Ok((mesh, numbers))
    }
}

/// Turns cells of negative volume around. Not all programs count corners the same way round.
fn turn_negative(positions: &[Vec3], cells: &mut Cells) {
    let is_negative = |cell: &[u32]| size(positions, cell).0 < 0.0;
    match cells {
        Cells::Linear(cells) => {
            for cell in cells.iter_mut().filter(|cell| is_negative(&cell[..])) {
                cell.swap(1, 2);
            }
        }
        Cells::Quadratic(cells) => {
            for cell in cells.iter_mut().filter(|cell| is_negative(&cell[..])) {
                cell.swap(1, 2);
                // With the corners 1 and 2 go the middles of 01 and 02, and of 13 and 23.
                cell.swap(4, 6);
                cell.swap(8, 9);
            }
        }
    }
}
