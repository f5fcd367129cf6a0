//! Builds a mesh from the triangles of a file: drops unused vertices, fills groups, and traces faults back to the file.

use crate::merge;
use physics::Vec3;
use physics::mesh::check::{Location, MAX_COUNT, check_distinct};
use physics::mesh::check_hanging::check_hanging;
use physics::mesh::{Group, MeshError, TriMesh};

/// The number of a vertex that no triangle or cell uses.
pub(crate) const UNUSED: u32 = u32::MAX;

/// Vertices and triangles in the order of the file. Every corner of a triangle is the index of a vertex.
#[derive(Default)]
pub(crate) struct Soup {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Named sets of triangles, each in ascending order.
    pub(crate) groups: Vec<Group>,
}

/// The reason why a soup is no valid mesh.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) source: MeshError,
    /// The faulty vertex or triangle. Vertices are numbered as in the file.
    pub(crate) location: Location,
}

impl Soup {
    /// A mesh of these triangles, and the new number of each old vertex. Each group becomes a group of triangles and a group
    /// of their vertices. With a distance, vertices within it are merged.
    pub(crate) fn into_mesh(self, merge: Option<f64>) -> Result<(TriMesh, Vec<u32>), Fault> {
        let found = self.positions.len();
        if found > MAX_COUNT {
            let entities = "vertices";
            return Err(Fault {
                source: MeshError::TooMany { entities, found },
                location: Location::Mesh,
            });
        }
        let Self {
            mut positions,
            mut triangles,
            groups,
        } = self;
        let numbers = compact(&mut positions, &mut triangles, merge);
        let fault = |source: MeshError| {
            let location = match source.location() {
                Location::Vertex(vertex) => {
                    let place = numbers.iter().position(|&number| number == vertex);
                    Location::Vertex(place.unwrap_or_default() as u32)
                }
                other => other,
            };
            Fault { source, location }
        };
        let mut mesh = TriMesh::new(positions, triangles).map_err(fault)?;
        check_distinct(&mesh.positions).map_err(fault)?;
        check_hanging(&mesh).map_err(fault)?;
        mesh.vertex_groups = groups
            .iter()
            .map(|group| Group {
                name: group.name.clone(),
                members: vertices_of(&mesh.triangles, &group.members),
            })
            .collect();
        mesh.triangle_groups = groups;
        Ok((mesh, numbers))
    }
}

/// Drops the vertices that no triangle or cell uses and, with a distance, those within it of an earlier vertex. Returns
/// the new number of each old vertex.
pub(crate) fn compact<const N: usize>(
    positions: &mut Vec<Vec3>,
    cells: &mut [[u32; N]],
    merge: Option<f64>,
) -> Vec<u32> {
    let mut numbers = drop_unused(positions, cells);
    let Some(distance) = merge else {
        return numbers;
    };
    let firsts = merge::firsts(positions, distance);
    let number = |numbers: &[u32], vertex: u32| {
        let number = numbers.get(vertex as usize);
        number.copied().unwrap_or(UNUSED)
    };
    for vertex in cells.iter_mut().flatten() {
        *vertex = number(&firsts, *vertex);
    }
    let kept = drop_unused(positions, cells);
    for vertex in &mut numbers {
        *vertex = number(&kept, number(&firsts, *vertex));
    }
    numbers
}

/// Drops the vertices that no triangle or cell uses. Returns the new number of each old vertex.
fn drop_unused<const N: usize>(positions: &mut Vec<Vec3>, cells: &mut [[u32; N]]) -> Vec<u32> {
    let mut numbers = vec![UNUSED; positions.len()];
    for &vertex in cells.iter().flatten() {
        if let Some(number) = numbers.get_mut(vertex as usize) {
            *number = 0;
        }
    }
    let used = numbers.iter_mut().filter(|number| **number != UNUSED);
    for (number, next) in used.zip(0_u32..) {
        *number = next;
    }
    let mut kept = numbers.iter().map(|&number| number != UNUSED);
    positions.retain(|_| kept.next().unwrap_or(false));
    for vertex in cells.iter_mut().flatten() {
        *vertex = numbers.get(*vertex as usize).copied().unwrap_or(UNUSED);
    }
    numbers
}

/// The vertices of some triangles, in ascending order, each once.
fn vertices_of(triangles: &[[u32; 3]], members: &[u32]) -> Vec<u32> {
    let corners = members.iter().filter_map(|&t| triangles.get(t as usize));
    let mut vertices: Vec<u32> = corners.flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices.shrink_to_fit();
    vertices
}
