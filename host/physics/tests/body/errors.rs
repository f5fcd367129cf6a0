//! Bad input: each kind is refused by name, and nothing panics.

use common::*;
use physics::mesh::TriMesh;
use physics::{Body, BodyConfig, BodyError, Border, Freedom, HandleSpec, Material, Vec3};

fn square() -> TriMesh {
    grid(1, 1, 1.0, 1.0, Split::Right)
}

fn refusal(
    mesh: &TriMesh,
    materials: &[Material],
    config: BodyConfig,
    handles: &[HandleSpec],
) -> BodyError {
    match Body::sheet(mesh, materials, config, handles) {
        Err(error) => error,
        Ok(_) => panic!("accepted"),
    }
}

#[test]
fn bad_meshes_are_refused_by_name() {
    let refusal = |mesh: &TriMesh| refusal(mesh, &[rubber(0.3)], tight(), &[]);
    assert_eq!(refusal(&TriMesh::default()), BodyError::Empty);

    let mut mesh = square();
    mesh.positions[2].y = f64::NAN;
    assert_eq!(refusal(&mesh), BodyError::Position { vertex: 2 });

    let mut mesh = square();
    mesh.triangles[1][2] = 9;
    let expected = BodyError::ElementVertex {
        element: 1,
        vertex: 9,
        count: 4,
    };
    assert_eq!(refusal(&mesh), expected);

    let mut mesh = square();
    mesh.triangles[1] = [0, 2, 2];
    assert!(matches!(
        refusal(&mesh),
        BodyError::Degenerate { triangle: 1, .. }
    ));
    let mut mesh = square();
    mesh.positions[3] = mesh.positions[2] * 0.5;
    assert!(matches!(
        refusal(&mesh),
        BodyError::Degenerate { triangle: 1, .. }
    ));

    let mut mesh = square();
    mesh.positions.push(Vec3::zeros());
    assert_eq!(refusal(&mesh), BodyError::Unreferenced { vertex: 4 });
}

#[test]
fn bad_materials_are_refused_by_name() {
    let refusal = |materials: &[Material]| refusal(&square(), materials, tight(), &[]);
    let good = rubber(0.3);
    let named = |material: Material| match refusal(&[good, material]) {
        BodyError::Material {
            element: 1, field, ..
        } => field,
        other => panic!("{other}"),
    };
    assert_eq!(named(Material { young: 0.0, ..good }), "young");
    assert_eq!(
        named(Material {
            young: f64::NAN,
            ..good
        }),
        "young"
    );
    assert_eq!(
        named(Material {
            thickness: -1.0,
            ..good
        }),
        "thickness"
    );
    assert_eq!(
        named(Material {
            density: f64::INFINITY,
            ..good
        }),
        "density"
    );
    assert_eq!(
        named(Material {
            poisson: 0.5,
            ..good
        }),
        "poisson"
    );
    assert_eq!(
        named(Material {
            poisson: -1.0,
            ..good
        }),
        "poisson"
    );
    let expected = BodyError::MaterialCount {
        found: 3,
        elements: 2,
    };
    assert_eq!(refusal(&[good; 3]), expected);
    assert_eq!(
        refusal(&[]),
        BodyError::MaterialCount {
            found: 0,
            elements: 2
        }
    );
}

#[test]
fn bad_configurations_are_refused_by_name() {
    let named = |config| match refusal(&square(), &[rubber(0.3)], config, &[]) {
        BodyError::Config { field, .. } => field,
        other => panic!("{other}"),
    };
    assert_eq!(
        named(BodyConfig {
            mass_damping: -1.0,
            ..tight()
        }),
        "mass_damping"
    );
    assert_eq!(
        named(BodyConfig {
            stiffness_damping: f64::NAN,
            ..tight()
        }),
        "stiffness_damping"
    );
    assert_eq!(
        named(BodyConfig {
            bending: -0.1,
            ..tight()
        }),
        "bending"
    );
    assert_eq!(
        named(BodyConfig {
            gravity: Vec3::repeat(f64::NAN),
            ..tight()
        }),
        "gravity"
    );
}

#[test]
fn bad_handles_are_refused_by_name() {
    let spec = |vertices: &[u32]| HandleSpec {
        vertices: vertices.to_vec(),
        origin: Vec3::zeros(),
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    };
    let refusal = |handles: &[HandleSpec]| refusal(&square(), &[rubber(0.3)], tight(), handles);
    assert_eq!(
        refusal(&[spec(&[0]), spec(&[])]),
        BodyError::EmptyHandle { handle: 1 }
    );
    let expected = BodyError::HandleVertex {
        handle: 0,
        vertex: 4,
        count: 4,
    };
    assert_eq!(refusal(&[spec(&[4])]), expected);
    let expected = BodyError::SharedVertex {
        vertex: 1,
        first: 0,
        second: 1,
    };
    assert_eq!(refusal(&[spec(&[0, 1]), spec(&[2, 1])]), expected);
    let expected = BodyError::SharedVertex {
        vertex: 1,
        first: 0,
        second: 0,
    };
    assert_eq!(refusal(&[spec(&[1, 1])]), expected);
    let mut lost = spec(&[0]);
    lost.origin.x = f64::NAN;
    assert_eq!(refusal(&[lost]), BodyError::HandleOrigin { handle: 0 });
}

#[test]
fn bad_arrays_are_refused_by_name() {
    let mut sheet = Body::sheet(&square(), &[rubber(0.3)], tight(), &[]).unwrap();
    let before: Vec<Vec3> = sheet.positions().collect();
    let short = [Vec3::zeros(); 3];
    let expected = BodyError::Length {
        quantity: "positions",
        found: 3,
        expected: 4,
    };
    assert_eq!(sheet.set_positions(&short), Err(expected));
    let mut bad = [Vec3::zeros(); 4];
    bad[2].z = f64::NAN;
    let expected = BodyError::NotFinite {
        quantity: "velocities",
        vertex: 2,
    };
    assert_eq!(sheet.set_velocities(&bad), Err(expected));
    assert!(sheet.set_external_forces(&bad).is_err());
    assert_eq!(sheet.positions().collect::<Vec<_>>(), before);
}
