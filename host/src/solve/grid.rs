//! The state of a body as a mesh with values: displacement, velocity, stress, material. Solves and runs write the same.

use crate::world::Built;
use meshio::write_vtu::{UnstructuredGrid, Values};
use physics::mesh::Mesh;
use physics::topology::Surface;
use physics::{Mat3, Vec3};

/// The present state of a body, with the positions of the deformed body. Displacements (m) are those from `rest`. A body
/// that `moves` has velocities. A body that may touch something has the `pressure` of its contacts (Pa), by vertex.
pub(crate) fn of_body(
    built: &Built,
    rest: &[Vec3],
    moves: bool,
    pressure: Option<Vec<f64>>,
) -> UnstructuredGrid {
    let mut grid = match &built.mesh {
        Mesh::Thread(mesh) => UnstructuredGrid::of_thread(mesh),
        Mesh::Sheet(mesh) => UnstructuredGrid::of_sheet(mesh),
        Mesh::Solid(mesh) => UnstructuredGrid::of_solid(mesh),
    };
    let body = &built.body;
    let torn = body.surface().filter(|_| body.edit_count() > 0);
    let mut rest = rest;
    if let Some(surface) = torn {
        let triangles = surface.triangles().iter();
        grid.cells = triangles.map(|corners| (corners.to_vec(), 5)).collect();
        for (_, values) in &mut grid.in_cells {
            if let Values::Scalar(values) = values {
                *values = of_parents(values, surface);
            }
        }
        // A tear adds vertices, and moves those that snap at rest.
        rest = body.rest_positions();
    }
    grid.positions = body.positions().collect();
    let moved = grid.positions.iter().zip(rest);
    let mut at_vertices = |name: &str, values: Vec<Vec3>| {
        let values = Values::Vector(values);
        grid.at_vertices.push((name.to_owned(), values));
    };
    at_vertices(
        "displacement",
        moved.map(|(now, rest)| now - rest).collect(),
    );
    if moves {
        at_vertices("velocity", body.velocities().collect());
    }
    if let Some(mut pressure) = pressure {
        // Vertices that a tear has just added have not touched anything.
        pressure.resize(grid.positions.len(), 0.0);
        let values = Values::Scalar(pressure);
        grid.at_vertices
            .push(("contact_pressure".to_owned(), values));
    }
    let stresses = stresses(built);
    let faces = faces(built, &stresses);
    let mut in_cells = |name: &str, values: Values| {
        // A field of the mesh file that has the same name is renamed.
        for (other, _) in &mut grid.in_cells {
            if other == name {
                other.push_str("_in_file");
            }
        }
        grid.in_cells.push((name.to_owned(), values));
    };
    in_cells(
        "von_mises",
        Values::Scalar(largest_von_mises(&stresses, faces.as_ref())),
    );
    in_cells("stress", Values::Tensor(stresses));
    if let Some([top, bottom]) = faces {
        in_cells("stress_top", Values::Tensor(top));
        in_cells("stress_bottom", Values::Tensor(bottom));
    }
    let of_elements = |values: &[f64]| match torn {
        Some(surface) => of_parents(values, surface),
        None => values.to_vec(),
    };
    in_cells("young", Values::Scalar(of_elements(&built.young)));
    if !built.poisson.is_empty() {
        in_cells("poisson", Values::Scalar(of_elements(&built.poisson)));
    }
    grid
}

/// The values of the triangles of a torn surface: each has that of its original triangle.
fn of_parents(values: &[f64], surface: &Surface) -> Vec<f64> {
    let parents = surface.parents().iter();
    parents
        .map(|&parent| values.get(parent as usize).copied().unwrap_or(0.0))
        .collect()
}

/// The largest von Mises stress of each element (Pa), in the order of the mesh: of a sheet that bends, on its two faces.
pub fn von_mises(built: &Built) -> Vec<f64> {
    let stresses = stresses(built);
    let faces = faces(built, &stresses);
    largest_von_mises(&stresses, faces.as_ref())
}

/// Cauchy stress of each element (Pa), of a sheet in the middle of its thickness.
fn stresses(built: &Built) -> Vec<Mat3> {
    let body = &built.body;
    let sets = body.elements().iter();
    sets.flat_map(|set| (0..set.count()).map(|e| set.stress(e, body.node_positions())))
        .collect()
}

/// The stress of each triangle on the face at the side of its normal and on the other face (Pa), from the stress in
/// the middle. `None` for a body that does not bend.
fn faces(built: &Built, middle: &[Mat3]) -> Option<[Vec<Mat3>; 2]> {
    let body = &built.body;
    body.bends().then(|| {
        let on_face = |sign: f64| {
            let elements = middle.iter().enumerate();
            elements
                .map(|(e, middle)| middle + body.bending_stress(e) * sign)
                .collect()
        };
        [on_face(1.0), on_face(-1.0)]
    })
}

/// The largest von Mises stress of each element (Pa): of a sheet that bends, on its two faces.
fn largest_von_mises(middle: &[Mat3], faces: Option<&[Vec<Mat3>; 2]>) -> Vec<f64> {
    match faces {
        None => middle.iter().map(equivalent).collect(),
        Some([top, bottom]) => {
            let pairs = top.iter().zip(bottom);
            pairs
                .map(|(top, bottom)| equivalent(top).max(equivalent(bottom)))
                .collect()
        }
    }
}

/// The von Mises stress `sqrt(3/2 s : s)`, in which `s` is the deviatoric stress.
fn equivalent(stress: &Mat3) -> f64 {
    let deviator = stress - Mat3::identity() * (stress.trace() / 3.0);
    (1.5 * deviator.norm_squared()).sqrt()
}
