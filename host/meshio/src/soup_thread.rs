//! From the lines that a file lists to a mesh: unused vertices dropped, faults traced back to the file.

use crate::soup::compact;
use physics::Vec3;
use physics::mesh::check::{Location, MAX_COUNT, check_distinct};
use physics::mesh::{LineMesh, MeshError, ThreadError};

/// Vertices and lines as a file lists them. Both ends of a line are among the vertices.
pub(crate) struct ThreadSoup {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) lines: Vec<[u32; 2]>,
}

/// Why a soup is no mesh.
#[derive(Debug)]
pub(crate) struct ThreadFault {
    pub(crate) source: ThreadError,
    /// What is at fault, vertices numbered as in the file.
    pub(crate) location: Location,
}

impl ThreadSoup {
    /// A mesh of these lines, without groups and fields, and the number in it of each vertex of the file; that of one
    /// that was dropped is [`UNUSED`](crate::soup::UNUSED). With a distance, vertices within it are merged.
    pub(crate) fn into_mesh(self, merge: Option<f64>) -> Result<(LineMesh, Vec<u32>), ThreadFault> {
        let found = self.positions.len();
        if found > MAX_COUNT {
            let entities = "vertices";
            return Err(ThreadFault {
                source: MeshError::TooMany { entities, found }.into(),
                location: Location::Mesh,
            });
        }
        let Self {
            mut positions,
            mut lines,
        } = self;
        let numbers = compact(&mut positions, &mut lines, merge);
        let fault = |source: ThreadError| {
            let location = match source.location() {
                Location::Vertex(vertex) => {
                    let place = numbers.iter().position(|&number| number == vertex);
                    Location::Vertex(place.unwrap_or_default() as u32)
                }
                other => other,
            };
            ThreadFault { source, location }
        };
        let mesh = LineMesh::new(positions, lines).map_err(fault)?;
        check_distinct(&mesh.positions).map_err(|error| fault(error.into()))?;
        Ok((mesh, numbers))
    }
}
