//! A membrane strip stretched to 1.2 of its length. With free sides the solution is exact on any mesh. With clamped
//! ends the reference is an independent program on the same mesh.

use super::Series;
use super::solve::{settle, vertices, weightless};
use crate::elsewhere::ACCURACY;
use crate::{Level, StudyError};
use physics::mesh::TriMesh;
use physics::mesh::generate::{Pattern, sheet};
use physics::{Body, Material, SheetLawName, Vec3, Weave};

const LENGTH: f64 = 0.1;
const WIDTH: f64 = 0.04;
const STRETCH: f64 = 1.2;
const RUBBER: Material = Material {
    young: 1e6,
    poisson: 0.3,
    thickness: 1e-3,
    density: 1000.0,
};

pub(super) fn run(_: Level) -> Result<Vec<Series>, StudyError> {
    let exact = "exact";
    let mut corotational = Series::new(
        "strip_corotational",
        "strip with free sides, corotational: force",
        "N",
        Some(8.0),
        exact,
    );
    let mut stvk = Series::new(
        "strip_stvk",
        "strip with free sides, St. Venant-Kirchhoff: force",
        "N",
        Some(10.56),
        exact,
    );
    let mut clamped = Series::new(
        "strip_clamped",
        "strip with clamped ends, corotational: force",
        "N",
        Some(ACCURACY.strip.clamped),
        "an independent program on this mesh, to six digits",
    );
    let mesh = sheet(LENGTH, WIDTH, 10, 4, Pattern::Regular)?;
    let isotropic = Weave {
        warp: Vec3::x(),
        young_warp: RUBBER.young,
        young_weft: RUBBER.young,
        poisson: RUBBER.poisson,
        shear: RUBBER.shear(),
        thickness: RUBBER.thickness,
        density: RUBBER.density,
        rigidity: physics::Rigidity::default(),
    };
    let as_sheet = || Body::sheet(&mesh, &[RUBBER], weightless(), &[]);
    let law = SheetLawName::StVenantKirchhoff;
    let woven = Body::woven(&mesh, &[isotropic], law, weightless(), &[])?;
    let name = "10 x 4";
    corotational.push(name, 0.1, pulled(&mesh, as_sheet()?, false)?, None);
    stvk.push(name, 0.1, pulled(&mesh, woven, false)?, None);
    clamped.push(name, 0.1, pulled(&mesh, as_sheet()?, true)?, None);
    Ok(vec![corotational, stvk, clamped])
}

/// Force (N) that stretches the strip. Clamped ends cannot contract.
fn pulled(mesh: &TriMesh, mut body: Body, clamped: bool) -> Result<f64, StudyError> {
    let at = |chosen: &dyn Fn(&Vec3) -> bool| vertices(&mesh.positions, chosen);
    body.add_support(&at(&|_| true), [false, false, true])?;
    let left = at(&|x| x.x < 1e-9 - 0.5 * LENGTH);
    let right = at(&|x| x.x > 0.5 * LENGTH - 1e-9);
    body.add_support(&left, [true, clamped, false])?;
    // Without clamps, one fixed vertex prevents sliding along y.
    body.add_support(&left[..1], [true, true, false])?;
    let end = body.add_support(&right, [true, clamped, false])?;
    body.set_support(end, Vec3::x() * (LENGTH * (STRETCH - 1.0)))?;
    settle(&mut body)?;
    Ok(body.support_reaction(end).map_or(0.0, |force| force.x))
}
