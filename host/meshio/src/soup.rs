//! Builds a mesh from the cells of a file: drops unused vertices, reorients tetrahedra of negative volume, fills groups, and
//! traces faults back to the file.

use crate::error::MeshFault;
use crate::merge;
use physics::Vec3;
use physics::mesh::check::{Location, MAX_COUNT, check_distinct};
use physics::mesh::check_hanging::{check_hanging, check_hanging_solid};
use physics::mesh::check_solid::{SolidError, size};
use physics::mesh::{Cells, Group, LineMesh, MeshError, TetMesh, ThreadError, TriMesh};

/// The number of a vertex that no cell uses.
pub(crate) const UNUSED: u32 = u32::MAX;

/// Vertices and cells in the order of the file. Every corner of a cell is the index of a vertex.
#[derive(Default)]
pub(crate) struct Soup<C> {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) cells: C,
}

/// The reason why a soup is no valid mesh.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) source: MeshFault,
    /// The faulty vertex or cell. Vertices are numbered as in the file.
    pub(crate) location: Location,
}

impl<C: CellList> Soup<C> {
    /// A mesh of these cells, without groups and fields, and the new number of each old vertex. The number of a dropped
    /// vertex is [`UNUSED`]. With a distance, vertices within it are merged.
    pub(crate) fn into_mesh(self, merge: Option<f64>) -> Result<(C::Mesh, Vec<u32>), Fault> {
        let Self {
            mut positions,
            mut cells,
        } = self;
        let found = positions.len();
        if found > MAX_COUNT {
            let entities = "vertices";
            let error = MeshError::TooMany { entities, found };
            return Err(Fault {
                source: C::Error::from(error).into(),
                location: Location::Mesh,
            });
        }
        let numbers = cells.compact(&mut positions, merge);
        let mesh = cells.into_mesh(positions).map_err(|error| {
            let source: MeshFault = error.into();
            let location = match source.location() {
                Location::Vertex(vertex) => {
                    let place = numbers.iter().position(|&number| number == vertex);
                    Location::Vertex(place.unwrap_or_default() as u32)
                }
                other => other,
            };
            Fault { source, location }
        })?;
        Ok((mesh, numbers))
    }
}

/// The cells of one kind of mesh.
pub(crate) trait CellList {
    type Mesh;
    type Error: From<MeshError> + Into<MeshFault>;

    /// Drops the vertices that no cell uses and, with a distance, those within it of an earlier vertex. Returns the new
    /// number of each old vertex.
    fn compact(&mut self, positions: &mut Vec<Vec3>, merge: Option<f64>) -> Vec<u32>;

    /// The mesh of vertices that are all used, checked.
    fn into_mesh(self, positions: Vec<Vec3>) -> Result<Self::Mesh, Self::Error>;
}

impl CellList for Vec<[u32; 2]> {
    type Mesh = LineMesh;
    type Error = ThreadError;

    fn compact(&mut self, positions: &mut Vec<Vec3>, merge: Option<f64>) -> Vec<u32> {
        compact(positions, self, merge)
    }

    fn into_mesh(self, positions: Vec<Vec3>) -> Result<LineMesh, ThreadError> {
        let mesh = LineMesh::new(positions, self)?;
        check_distinct(&mesh.positions)?;
        Ok(mesh)
    }
}

impl CellList for Vec<[u32; 3]> {
    type Mesh = TriMesh;
    type Error = MeshError;

    fn compact(&mut self, positions: &mut Vec<Vec3>, merge: Option<f64>) -> Vec<u32> {
        compact(positions, self, merge)
    }

    fn into_mesh(self, positions: Vec<Vec3>) -> Result<TriMesh, MeshError> {
        let mesh = TriMesh::new(positions, self)?;
        check_distinct(&mesh.positions)?;
        check_hanging(&mesh)?;
        Ok(mesh)
    }
}

impl CellList for Cells {
    type Mesh = TetMesh;
    type Error = SolidError;

    fn compact(&mut self, positions: &mut Vec<Vec3>, merge: Option<f64>) -> Vec<u32> {
        match self {
            Self::Linear(cells) => compact(positions, cells, merge),
            Self::Quadratic(cells) => compact(positions, cells, merge),
        }
    }

    fn into_mesh(mut self, positions: Vec<Vec3>) -> Result<TetMesh, SolidError> {
        turn_negative(&positions, &mut self);
        let mesh = TetMesh::new(positions, self)?;
        check_distinct(&mesh.positions)?;
        check_hanging_solid(&mesh)?;
        Ok(mesh)
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

/// Gives a sheet these groups of triangles, each in ascending order, and the groups of their vertices.
pub(crate) fn set_groups(mesh: &mut TriMesh, groups: Vec<Group>) {
    mesh.vertex_groups = groups
        .iter()
        .map(|group| Group {
            name: group.name.clone(),
            members: vertices_of(&mesh.triangles, &group.members),
        })
        .collect();
    mesh.triangle_groups = groups;
}

/// Drops the vertices that no triangle or cell uses and, with a distance, those within it of an earlier vertex. Returns
/// the new number of each old vertex.
fn compact<const N: usize>(
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
