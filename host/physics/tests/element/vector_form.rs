//! The kernel that the realtime step takes for each kind of element. With a wrong kernel the step would be slower, and
//! every test of forces would still pass.

use physics::element::VectorForm;
use physics::material::law::Frame;
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::mesh::generate_thread::straight_thread;
use physics::{Body, BodyConfig, Material, SolidLaw, SolidMaterial, ThreadMaterial};

fn form(body: &Body) -> Option<VectorForm> {
    body.elements()[0].vector_form()
}

fn solid(quadratic: bool, law: SolidLaw) -> Option<VectorForm> {
    let material = SolidMaterial {
        young: 1e4,
        poisson: 0.3,
        density: 1000.0,
    };
    let mut mesh = solid_box([0.1; 3], [1; 3]).unwrap();
    if quadratic {
        mesh = mesh.quadratic();
    }
    form(&Body::solid(&mesh, &[material], law, BodyConfig::default(), &[]).unwrap())
}

#[test]
fn solids_have_a_kernel_by_shape_and_law() {
    use VectorForm::{HookeanQuadraticTets, HookeanTets, IsotropicQuadraticTets, IsotropicTets};
    // A box of one grid cell has six tetrahedra.
    for (law, frame) in [
        (SolidLaw::Linear, Frame::Fixed),
        (SolidLaw::Corotational, Frame::Turning),
    ] {
        let found = solid(false, law);
        let right = matches!(&found, Some(HookeanTets(f, t)) if *f == frame && t.len() == 6);
        assert!(right, "{found:?}");
        let found = solid(true, law);
        let right =
            matches!(&found, Some(HookeanQuadraticTets(f, t)) if *f == frame && t.len() == 6);
        assert!(right, "{found:?}");
    }
    for law in [SolidLaw::StVenantKirchhoff, SolidLaw::StableNeoHookean] {
        let found = solid(false, law);
        let right = matches!(&found, Some(IsotropicTets(_, t)) if t.len() == 6);
        assert!(right, "{found:?}");
        let found = solid(true, law);
        let right = matches!(&found, Some(IsotropicQuadraticTets(_, t)) if t.len() == 6);
        assert!(right, "{found:?}");
    }
}

#[test]
fn membranes_have_a_kernel() {
    let mesh = sheet(0.2, 0.1, 2, 1, Pattern::Regular).unwrap();
    let material = Material {
        young: 1e5,
        poisson: 0.3,
        thickness: 1e-3,
        density: 1000.0,
    };
    let body = Body::sheet(&mesh, &[material], BodyConfig::default(), &[]).unwrap();
    let found = form(&body);
    let count = mesh.triangles.len();
    let right = matches!(&found, Some(VectorForm::CorotationalTriangles(t)) if t.len() == count);
    assert!(right, "{found:?}");
}

#[test]
fn bars_are_assembled() {
    let mesh = straight_thread(0.1, 4).unwrap();
    let material = ThreadMaterial {
        young: 1e8,
        area: 1e-6,
        density: 1000.0,
        tension_only: false,
    };
    let body = Body::thread(&mesh, &[material], BodyConfig::default(), &[]).unwrap();
    assert!(form(&body).is_none());
}
