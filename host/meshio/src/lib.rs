//! Mesh files: from a file's bytes to a mesh, and from a mesh to a file's text.
//!
//! [`read`] and [`read_mesh`] take the bytes of a file in any of the formats [`gmsh`], [`obj`], [`vtk_legacy`]
//! and [`vtk_xml`]. What they read ends in [`LineMesh::new`](physics::mesh::LineMesh::new),
//! [`TriMesh::new`](physics::mesh::TriMesh::new) or [`TetMesh::new`](physics::mesh::TetMesh::new), so what holds for one
//! mesh holds for all. A mesh goes back
//! to a file's text by [`write_gmsh`], [`write_vtk`] and [`write_vtu`].
//!
//! Nothing here opens a file: bytes come in and text goes out.
#![forbid(unsafe_code)]

pub mod file;
pub mod gmsh;
mod lines;
pub mod obj;
mod soup;
mod soup_solid;
mod soup_thread;
mod text;
mod vtk_array;
mod vtk_cells;
mod vtk_fields;
pub mod vtk_legacy;
pub mod vtk_xml;
pub mod write_gmsh;
pub mod write_vtk;
pub mod write_vtu;

pub use file::{MeshFileError, Place, read, read_mesh};
