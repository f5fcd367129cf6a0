//! The files for ParaView, with the values that a solution writes into them.

mod support;

use meshio::write_vtu::{UnstructuredGrid, Values};
use physics::Vec3;
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use support::read;

#[test]
fn a_written_sheet_reads_back_bit_for_bit() {
    let mesh = sheet(0.1, 0.07, 5, 3, Pattern::Alternating).unwrap();
    let mut grid = UnstructuredGrid::of_sheet(&mesh);
    let vectors = mesh.positions.iter().map(|x| x / 3.0).collect();
    grid.at_vertices
        .push(("u <m> & \"more\"".to_owned(), Values::Vector(vectors)));
    let back = read("sheet.vtu", grid.vtu().as_bytes()).unwrap();
    assert_eq!(
        (back.positions, back.triangles),
        (mesh.positions, mesh.triangles)
    );
}

#[test]
fn a_written_solid_has_its_cells_and_values() {
    let mesh = solid_box([1.0; 3], [1, 1, 1]).unwrap().quadratic();
    let mut grid = UnstructuredGrid::of_solid(&mesh);
    let tensors = vec![physics::Mat3::from_diagonal(&Vec3::new(1.0, 2.0, 3.0)); 6];
    grid.in_cells
        .push(("stress".to_owned(), Values::Tensor(tensors)));
    grid.in_cells
        .push(("energy".to_owned(), Values::Scalar(vec![0.5; 6])));
    let text = grid.vtu();
    // Other programs make a column of vectors of one component.
    assert!(text.contains("<DataArray type=\"Float64\" Name=\"energy\" format=\"ascii\">"));
    assert!(text.contains("<Piece NumberOfPoints=\"27\" NumberOfCells=\"6\">"));
    assert!(
        text.contains(&format!(
            "Name=\"types\" format=\"ascii\">\n{}</DataArray>",
            "24\n".repeat(6)
        )),
        "six quadratic tetrahedra"
    );
    assert_eq!(
        text.matches("1.0 0.0 0.0 0.0 2.0 0.0 0.0 0.0 3.0").count(),
        6
    );
}
