//! Sheets with bending, with as many triangles as the thesis's cloth, banknote and T-shirt: pulled at one end, and
//! pressed in the middle.
//!
//! 20 x 20 cm, 1 mm, E = 1 MPa, nu = 0.3, 1000 kg/m^3, mass damping 0.1 and stiffness damping 0.01, steps of 10 ms. The
//! sheets of the other programs do not bend, so those programs solve an easier problem.

use super::cube::compare;
use super::motion::Motion;
use super::path;
use super::trial::Scene;
use super::{Row, Told};
use crate::{Level, StudyError};
use physics::mesh::TriMesh;
use physics::mesh::generate::{Pattern, sheet};
use physics::{Body, BodyConfig, Border, Freedom, HandleSpec, Material, SheetLawName, Vec3, Weave};

pub(super) const SIDE: f64 = 0.2;
/// Cells along and across.
const MESHES: [(u32, u32); 3] = [(26, 27), (31, 31), (40, 41)];

/// All scenes of the sheets on all paths. `tell` is given the fraction done, and each row.
pub(super) fn run(level: Level, tell: &mut dyn FnMut(Told<'_>)) -> Result<Vec<Row>, StudyError> {
    let mut rows = Vec::new();
    let (meshes, steps) = match level {
        Level::Quick => (&MESHES[..1], 50),
        Level::Full => (&MESHES[..], 400),
    };
    for (i, &(nx, ny)) in meshes.iter().enumerate() {
        tell(Told::Fraction(i as f64 / meshes.len() as f64));
        let body = body(nx, ny)?;
        let pull = Vec3::x() * (0.05 * SIDE);
        let press = Vec3::z() * (-0.1 * SIDE);
        for (name, title, tool, to) in [
            ("sheet_pull", "sheet pulled by 5 % in 3 s", 1, pull),
            (
                "sheet_press",
                "sheet pressed in by a tenth of its side in 3 s",
                2,
                press,
            ),
        ] {
            let motion = Motion::ramp(to, 3.0, 1.0, 0.01).first(steps);
            let scene = Scene {
                name,
                title: title.to_owned(),
                body: body.clone(),
                tool,
                motion,
                along: to.normalize(),
            };
            compare(&scene, path::ALL, &mut rows, &mut |row| {
                tell(Told::Sheet(row));
            })?;
        }
    }
    Ok(rows)
}

/// A sheet of `nx` by `ny` cells, held at two opposite sides and at a patch in the middle: handles 0, 1 and 2.
pub(super) fn body(nx: u32, ny: u32) -> Result<Body, StudyError> {
    // With parallel diagonals, such a sheet bends as a plate does.
    let mesh = sheet(SIDE, SIDE, nx, ny, Pattern::Regular)?;
    let material = Material {
        young: 1e6,
        poisson: 0.3,
        thickness: 0.001,
        density: 1000.0,
    };
    Ok(Body::sheet(&mesh, &[material], config(), &handles(&mesh))?)
}

/// The same sheet of cloth, half as stiff along the weft as along the warp, without bending stiffness.
pub(super) fn woven(nx: u32, ny: u32, law: SheetLawName) -> Result<Body, StudyError> {
    let mesh = sheet(SIDE, SIDE, nx, ny, Pattern::Regular)?;
    let weave = Weave {
        warp: Vec3::x(),
        young_warp: 1e6,
        young_weft: 5e5,
        poisson: 0.2,
        shear: 2e5,
        thickness: 0.001,
        density: 1000.0,
        rigidity: physics::Rigidity::default(),
    };
    let config = BodyConfig {
        bending: 0.0,
        ..config()
    };
    let handles = handles(&mesh);
    Ok(Body::woven(&mesh, &[weave], law, config, &handles)?)
}

fn config() -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping: 0.1,
        stiffness_damping: 0.01,
        bending: 1.0,
        ..BodyConfig::default()
    }
}

/// Two opposite sides, and a patch in the middle.
fn handles(mesh: &TriMesh) -> [HandleSpec; 3] {
    let end = 0.5 * SIDE - 1e-9;
    [
        held(mesh, Vec3::x() * (-0.5 * SIDE), |x| x.x < -end),
        held(mesh, Vec3::x() * (0.5 * SIDE), |x| x.x > end),
        held(mesh, Vec3::zeros(), |x| x.norm() < 0.05 * SIDE),
    ]
}

fn held(mesh: &TriMesh, origin: Vec3, chosen: impl Fn(&Vec3) -> bool) -> HandleSpec {
    let vertices = (0_u32..).zip(&mesh.positions);
    HandleSpec {
        vertices: vertices
            .filter(|(_, x)| chosen(x))
            .map(|(vertex, _)| vertex)
            .collect(),
        origin,
        freedom: Freedom::Translation,
        border: Border::Hinged,
    }
}
