//! Solids and fields from VTK's files: every encoding gives the same, and what is wrong is refused with its
//! place.

mod support;

use meshio::read_mesh;
use physics::mesh::generate_box::solid_box;
use physics::mesh::{Mesh, TetMesh};
use support::vtk::{Encoding, Grid, Numbers, legacy, vtu};
use support::{expect_solid, read};

fn error(name: &str, bytes: impl AsRef<[u8]>) -> String {
    let result = read_mesh(name, bytes.as_ref());
    result.map_or_else(|error| error.to_string(), |_| "no error".to_owned())
}

/// Two triangles, a tetrahedron, a line, another tetrahedron, a point, with data.
fn mixed(quadratic: bool) -> (Grid, TetMesh) {
    let mut mesh = solid_box([0.3, 0.2, 0.1], [1; 3]).unwrap();
    if quadratic {
        mesh = mesh.quadratic();
    }
    let whole = Grid::of(&mesh);
    let each = if quadratic { 10 } else { 4 };
    let mut grid = Grid {
        points: whole.points,
        connectivity: Vec::new(),
        ends: Vec::new(),
        types: Vec::new(),
        cell_data: Vec::new(),
    };
    grid.push(5, &[0, 1, 2]);
    if quadratic {
        grid.push(22, &[0, 1, 2, 3, 4, 5]);
        grid.push(21, &[0, 1, 2]);
    } else {
        grid.push(7, &[0, 1, 3]);
        grid.push(3, &[0, 1]);
    }
    for (number, cell) in whole.connectivity.chunks(each).enumerate() {
        grid.push(whole.types[0], cell);
        if number == 2 {
            grid.push(1, &[3]);
            grid.push(5, &[1, 2, 3]);
        }
    }
    // Cells 3 to 5 and 8 to 10 are tetrahedra. The values of the other cells are skipped, whether they are numbers or not.
    let is_kept = |k: usize| (3..6).contains(&k) || k >= 8;
    let stiffness = |k| if is_kept(k) { k as f64 / 3.0 } else { f64::NAN };
    grid.cell_data = vec![
        (
            "stiffness",
            1,
            Numbers::F64((0..11).map(stiffness).collect()),
        ),
        ("direction", 3, Numbers::F32(vec![f32::NAN; 33])),
        ("region", 1, Numbers::I32((0..11).map(|k| k - 5).collect())),
        ("large", 1, Numbers::U64(vec![u64::MAX; 11])),
        ("small", 1, Numbers::U8((0..11).collect())),
        (
            "single",
            1,
            Numbers::F32((0..11).map(|k| k as f32 / 4.0).collect()),
        ),
    ];
    (grid, mesh)
}

/// Checks what was read of the mixed grid.
fn check_mixed(mesh: &TetMesh, expected: &TetMesh, what: &str) {
    assert_eq!(mesh.positions, expected.positions, "{what}");
    assert_eq!(mesh.cells, expected.cells, "{what}");
    let kept = [3, 4, 5, 8, 9, 10_u8];
    let values = |of: &dyn Fn(u8) -> f64| kept.map(of).to_vec();
    for (name, expected) in [
        ("stiffness", values(&|k| f64::from(k) / 3.0)),
        ("region", values(&|k| f64::from(k) - 5.0)),
        ("large", vec![u64::MAX as f64; 6]),
        ("small", values(&f64::from)),
        ("single", values(&|k| f64::from(k) / 4.0)),
    ] {
        let field = mesh.cell_fields.iter().find(|field| field.name == name);
        assert_eq!(field.unwrap().values, expected, "{what}: {name}");
    }
    assert_eq!(mesh.cell_fields.len(), 5, "{what}");
}

#[test]
fn every_encoding_of_vtk_gives_the_same_solid() {
    for quadratic in [false, true] {
        let (grid, expected) = mixed(quadratic);
        for encoding in Encoding::all() {
            let file = vtu(&grid, encoding);
            let what = format!("{encoding:?}");
            let mesh = read_mesh("x.vtu", &file).map_err(|e| format!("{what}: {e}"));
            check_mixed(&expect_solid(mesh.unwrap()), &expected, &what);
        }
        for bits in 0..8 {
            let [binary, version_5, scalars] = [1, 2, 4].map(|bit| bits & bit != 0);
            let file = legacy(&grid, binary, version_5, scalars);
            let what = format!("binary {binary}, version 5 {version_5}, scalars {scalars}");
            let mesh = read_mesh("x.vtk", &file).map_err(|e| format!("{what}: {e}"));
            check_mixed(&expect_solid(mesh.unwrap()), &expected, &what);
        }
    }
}

#[test]
fn wrong_grids_are_refused_with_their_place() {
    let ascii = Encoding::all()[0];
    let both = |grid: &Grid, expected: [&str; 2]| {
        let found = [
            error("x.vtk", legacy(grid, false, false, true)),
            error("x.vtu", vtu(grid, ascii)),
        ];
        assert_eq!(found, expected);
    };
    let (mut grid, _) = mixed(false);
    grid.cell_data.clear();
    // Numbers stand in a line each: of points 24, of the cells before 36, in the legacy file with 12 counts.
    grid.push(24, &[0, 1, 2, 3, 4, 5, 6, 7, 0, 1]);
    both(
        &grid,
        [
            "line 79: expected a tetrahedron of first order, as those before, found one of second order",
            "line 70: expected a tetrahedron of first order, as those before, found one of second order",
        ],
    );
    let (mut grid, _) = mixed(false);
    grid.cell_data.clear();
    grid.push(12, &[0, 1, 2, 3, 4, 5, 6, 7]);
    let found = error("x.vtu", vtu(&grid, ascii));
    assert!(
        found.ends_with(
            "expected a triangle or a tetrahedron (cut to them first, as ParaView's filters Triangulate and \
             Tetrahedralize do), found a hexahedron"
        ),
        "{found}"
    );
    // Triangles of second order only.
    let mut grid = Grid {
        types: Vec::new(),
        ends: Vec::new(),
        connectivity: Vec::new(),
        ..grid
    };
    grid.push(22, &[0, 1, 2, 3, 4, 5]);
    let found = error("x.vtu", vtu(&grid, ascii));
    assert!(
        found.ends_with("found a triangle of second order"),
        "{found}"
    );

    let with_data = |components: usize, values: Vec<f64>| {
        let (mut grid, _) = mixed(false);
        grid.cell_data = vec![("E", components, Numbers::F64(values))];
        grid
    };
    both(
        &with_data(
            1,
            (0..11)
                .map(|k| if k == 4 { f64::NAN } else { 1.0 })
                .collect(),
        ),
        // A field with a value that is not finite is skipped.
        ["no error", "no error"],
    );
    let mut grid = with_data(1, vec![1.0; 11]);
    grid.cell_data.push(("E", 1, Numbers::I32(vec![1; 11])));
    both(
        &grid,
        [
            "line 152: expected cell data \"E\" once, found a second one",
            "line 17: expected cell data \"E\" once, found a second one",
        ],
    );
    let found = error("x.vtu", vtu(&with_data(1, vec![1.0; 10]), ascii));
    assert_eq!(
        found,
        "line 5: expected a value for each of 11 cells in \"E\", found 10 values"
    );
    // A value too many is found where the next attribute should stand.
    let found = error(
        "x.vtk",
        legacy(&with_data(1, vec![1.0; 12]), false, false, true),
    );
    assert!(
        found.ends_with("expected an attribute of points or cells, such as SCALARS, VECTORS or FIELD, found \"1.0\""),
        "{found}"
    );
    let text = String::from_utf8(legacy(&with_data(1, vec![1.0; 11]), false, false, true)).unwrap();
    for (from, to, expected) in [
        (
            "CELL_DATA 11",
            "CELL_DATA 12",
            "expected an attribute of points or cells",
        ),
        (
            "LOOKUP_TABLE default\n1.0",
            "1.0",
            "expected LOOKUP_TABLE and a name",
        ),
        (
            "SCALARS E double",
            "SCALARS E quaternion",
            "expected a type of numbers",
        ),
        (
            "SCALARS E double",
            "MATRICES E double",
            "expected an attribute of points or cells",
        ),
    ] {
        let found = error("x.vtk", text.replace(from, to));
        assert!(found.contains(expected), "{to}: {found}");
    }
}

#[test]
fn a_cell_of_any_order_is_read_for_its_number_of_points() {
    let mesh = solid_box([0.3, 0.2, 0.1], [1; 3]).unwrap();
    for mesh in [mesh.clone(), mesh.quadratic()] {
        let mut grid = Grid::of(&mesh);
        grid.types.fill(71);
        for bytes in [
            legacy(&grid, false, true, false),
            legacy(&grid, true, false, false),
        ] {
            let found = expect_solid(read_mesh("x.vtk", &bytes).unwrap());
            assert_eq!(
                (&found.positions, &found.cells),
                (&mesh.positions, &mesh.cells)
            );
        }
    }
    let text = |code: u8, points: &str| {
        let each = points.split(' ').count();
        format!(
            "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 6 int\n0 0 0 2 0 0 0 2 0 1 0 0 1 1 0 0 1 0\n\
             CELLS 1 {}\n{each} {points}\nCELL_TYPES 1\n{code}\n",
            each + 1
        )
    };
    assert!(matches!(
        read_mesh("x", text(69, "0 1 2").as_bytes()),
        Ok(Mesh::Sheet(_))
    ));
    assert!(matches!(
        read_mesh("x", text(68, "0 1").as_bytes()),
        Ok(Mesh::Thread(_))
    ));
    let found = error("x", text(69, "0 1 2 3 4 5"));
    assert!(
        found.ends_with("found a triangle of second order"),
        "{found}"
    );
    let found = error("x", text(71, "0 1 2 3 4"));
    assert!(
        found.ends_with("found a Lagrange cell of 5 points (write the mesh with order 1 or 2)"),
        "{found}"
    );
}

#[test]
fn cell_data_of_polygons_counts_points_and_lines_first() {
    let head = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0 1 1 0 0 1 0\n";
    let text = format!(
        "{head}VERTICES 1 2\n1 0\nPOLYGONS 2 8\n3 0 1 2\n3 0 2 3\nLINES 2 6\n2 0 1\n2 1 2\n\
         CELL_DATA 5\nFIELD f 1\na%20b%25 1 5 int\n1 2 3 4 5\n"
    );
    let mesh = read("x.vtk", text.as_bytes()).unwrap();
    assert_eq!(mesh.triangle_fields[0].name, "a b%");
    assert_eq!(mesh.triangle_fields[0].values, [4.0, 5.0]);
    let xml = "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"4\" NumberOfVerts=\"1\" \
        NumberOfLines=\"2\" NumberOfPolys=\"2\">\
        <CellData><DataArray type=\"Int8\" Name=\"a &lt; b\">1 2 3 4 5</DataArray>\
        <DataArray type=\"String\" Name=\"s\">1 2</DataArray><DataArray type=\"Int8\">1</DataArray></CellData>\
        <Points><DataArray type=\"Int8\" NumberOfComponents=\"3\">0 0 0 1 0 0 1 1 0 0 1 0</DataArray></Points>\
        <Polys><DataArray type=\"Int8\" Name=\"connectivity\">0 1 2 0 2 3</DataArray>\
        <DataArray type=\"Int8\" Name=\"offsets\">3 6</DataArray></Polys></Piece></PolyData></VTKFile>";
    let mesh = read("x.vtp", xml.as_bytes()).unwrap();
    assert_eq!(mesh.triangle_fields.len(), 1);
    assert_eq!(mesh.triangle_fields[0].name, "a < b");
    assert_eq!(mesh.triangle_fields[0].values, [4.0, 5.0]);
}
