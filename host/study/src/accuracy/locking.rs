//! Volumetric locking: a beam of nearly incompressible material bends like any other beam. Linear tetrahedra cannot
//! bend without a change of volume; quadratic tetrahedra can. The held end, which may not contract, changes the
//! deflection by a few percent that Timoshenko's beam does not include. The difference grows with Poisson's ratio.

use super::Series;
use super::solve::{displacements, settle, solid_material, vertices, weightless};
use crate::{Level, StudyError};
use physics::body::load::traction;
use physics::mesh::generate_box::solid_box;
use physics::{Body, SolidLaw, Vec3};

const THICK: f64 = 0.1;
const CELLS: [u32; 3] = [20, 2, 2];
/// A small force, so that no cell is inverted.
const FORCE: f64 = 1e-9;

pub(super) fn run(level: Level) -> Result<Vec<Series>, StudyError> {
    let mut all = Vec::new();
    for (name, elements, quadratic) in [
        ("locking_linear", "linear", false),
        ("locking_quadratic", "quadratic", true),
    ] {
        let title =
            format!("cantilever 10 times as long as thick, {elements} tetrahedra: deflection");
        let source = "Timoshenko's beam with Cowper's shear coefficient";
        let mut series = Series::new(name, title, "1", Some(1.0), source);
        let ratios: &[f64] = match level {
            Level::Quick => &[0.3, 0.4999],
            Level::Full => &[0.3, 0.4, 0.45, 0.49, 0.499, 0.4999],
        };
        for &poisson in ratios {
            let mesh = format!("20 x 2 x 2, nu = {poisson}");
            series.push(mesh, 0.05, deflection(poisson, quadratic)?, None);
        }
        all.push(series);
    }
    Ok(all)
}

/// Mean deflection of the free end, relative to Timoshenko's beam.
fn deflection(poisson: f64, quadratic: bool) -> Result<f64, StudyError> {
    let mut mesh = solid_box([1.0, THICK, THICK], CELLS)?;
    if quadratic {
        mesh = mesh.quadratic();
    }
    let material = solid_material(1.0, poisson);
    let mut body = Body::solid(&mesh, &[material], SolidLaw::Linear, weightless(), &[])?;
    body.add_support(&vertices(&mesh.positions, |x| x.x < 1e-9 - 0.5), [true; 3])?;
    let end = vertices(&mesh.positions, |x| x.x > 0.5 - 1e-9);
    let area = THICK * THICK;
    let (forces, _) = traction(&mesh, &end, Vec3::z() * (FORCE / area));
    body.set_external_forces(&forces)?;
    settle(&mut body)?;
    let u = displacements(&body, &mesh.positions);
    let found = end.iter().map(|&vertex| u[vertex as usize].z).sum::<f64>() / end.len() as f64;
    let inertia = area * area / 12.0;
    let shear = 0.5 / (1.0 + poisson);
    let kappa = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson);
    Ok(found / FORCE / (1.0 / (3.0 * inertia) + 1.0 / (kappa * shear * area)))
}
