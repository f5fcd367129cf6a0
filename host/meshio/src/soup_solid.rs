//! Builds a mesh from the tetrahedra of a file: reorients those of negative volume, drops unused vertices, and traces
//! faults back to the file.

use crate::soup::compact;
use physics::Vec3;
use physics::mesh::check::{Location, MAX_COUNT, check_distinct};
use physics::mesh::check_hanging::check_hanging_solid;
use physics::mesh::check_solid::{SolidError, size};
use physics::mesh::{Cells, MeshError, TetMesh};

/// Vertices and cells in the order of the file. Every corner of a cell is the index of a vertex.
pub(crate) struct SolidSoup {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) cells: Cells,
}

/// The reason why a soup is no valid mesh.
#[derive(Debug)]
pub(crate) struct SolidFault {
    pub(crate) source: SolidError,
    /// The faulty vertex or cell. Vertices are numbered as in the file.
    pub(crate) location: Location,
}

impl SolidSoup {
    /// A mesh of these cells, without groups and fields, and the new number of each vertex of the file. The number of a
    /// dropped vertex is [`UNUSED`](crate::soup::UNUSED). With a distance, vertices within it are merged.
    pub(crate) fn into_mesh(self, merge: Option<f64>) -> Result<(TetMesh, Vec<u32>), SolidFault> {
        let found = self.positions.len();
        if found > MAX_COUNT {
            let entities = "vertices";
            return Err(SolidFault {
                source: MeshError::TooMany { entities, found }.into(),
                location: Location::Mesh,
            });
        }
        let Self {
            mut positions,
            mut cells,
        } = self;
        let numbers = match &mut cells {
            Cells::Linear(cells) => compact(&mut positions, cells, merge),
            Cells::Quadratic(cells) => compact(&mut positions, cells, merge),
        };
        turn_negative(&positions, &mut cells);
        let fault = |source: SolidError| {
            let location = match source.location() {
                Location::Vertex(vertex) => {
                    let place = numbers.iter().position(|&number| number == vertex);
                    Location::Vertex(place.unwrap_or_default() as u32)
                }
                other => other,
            };
            SolidFault { source, location }
        };
        let mesh = TetMesh::new(positions, cells).map_err(fault)?;
        check_distinct(&mesh.positions).map_err(|error| fault(error.into()))?;
        check_hanging_solid(&mesh).map_err(|error| fault(error.into()))?;
        Ok((mesh, numbers))
    }
}

/// Reorients cells of negative volume. Programs differ in the orientation of the corners.
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
                // A swap of the corners 1 and 2 also swaps the middles of 01 and 02, and those of 13 and 23.
                cell.swap(4, 6);
                cell.swap(8, 9);
            }
        }
    }
}
