//! Mesh files: reads meshes from the bytes of a file, and writes meshes as the text of a file.
//!
//! [`read_mesh`] takes the bytes of a file in any of the formats [`gmsh`], [`obj`], [`stl`],
//! [`vtk_legacy`] and [`vtk_xml`]. [`LineMesh::new`](physics::mesh::LineMesh::new),
//! [`TriMesh::new`](physics::mesh::TriMesh::new) or [`TetMesh::new`](physics::mesh::TetMesh::new) makes every mesh, so the same
//! checks hold for all meshes. [`write_gmsh`], [`write_vtk`] and [`write_vtu`] write a mesh as the text of a file.
//!
//! Written meshes have no flat pattern.
//!
//! This crate opens no files: it takes bytes and returns text.
//!
//! ```
//! let text = b"v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n";
//! let mesh = meshio::read_mesh("triangle.obj", text)?;
//! assert_eq!((mesh.positions().len(), mesh.element_count()), (3, 1));
//!
//! let written = meshio::write_gmsh::write(&mesh);
//! assert_eq!(meshio::read_mesh("triangle.msh", written.as_bytes())?, mesh);
//! # Ok::<(), meshio::MeshFileError>(())
//! ```
#![forbid(unsafe_code)]

pub mod error;
pub mod file;
pub mod gmsh;
mod lines;
mod merge;
pub mod obj;
mod soup;
pub mod stl;
mod text;
mod vtk_array;
mod vtk_cells;
mod vtk_fields;
pub mod vtk_legacy;
pub mod vtk_xml;
pub mod write_gmsh;
pub mod write_vtk;
pub mod write_vtu;

pub use error::{FilePosition, GmshError, InvalidMesh, MeshFault, MeshFileError};
pub use file::{Choices, read_mesh, read_mesh_as};
