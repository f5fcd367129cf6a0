//! A cube of gelatine, bonded to two plates and compressed by a tenth: 10 cm, 20 kPa, nu = 0.3. The reference is
//! extrapolated from the quadratic elements of an independent program. The force of that program's linear elements on
//! the same mesh is listed for comparison.

use super::Series;
use super::solve::{settle, settle_linear, vertices, weightless};
use crate::elsewhere::ACCURACY;
use crate::{Level, StudyError};
use physics::mesh::generate_box::solid_box;
use physics::{Body, SolidLaw, SolidMaterial, Vec3};

const EDGE: f64 = 0.1;
const GELATINE: SolidMaterial = SolidMaterial {
    young: 2e4,
    poisson: 0.3,
    density: 1000.0,
};

pub(super) fn run(level: Level) -> Result<Vec<Series>, StudyError> {
    let source = "an independent program: quadratic elements, extrapolated";
    let title = |law: &str, elements: &str| {
        format!("bonded cube pressed by a tenth, {law}, {elements} tetrahedra: force")
    };
    let others = &ACCURACY.cube;
    let mut all = Vec::new();
    for (name, quadratic_name, law, law_name, forces, reference) in [
        (
            "cube_linear",
            "cube_quadratic",
            SolidLaw::Linear,
            "linear law",
            &others.linear,
            others.converged_linear,
        ),
        (
            "cube_corotational",
            "cube_corotational_quadratic",
            SolidLaw::Corotational,
            "corotational law",
            &others.corotational,
            others.converged_corotational,
        ),
    ] {
        let title = |elements| title(law_name, elements);
        let mut linear = Series::new(name, title("linear"), "N", Some(reference), source);
        for (&n, &independent) in level.take(&others.cells, 2).iter().zip(forces) {
            let found = pressed(n, false, law)?;
            linear.push(
                format!("{n}^3"),
                1.0 / f64::from(n),
                found,
                Some(independent),
            );
        }
        let mut quadratic = Series::new(
            quadratic_name,
            title("quadratic"),
            "N",
            Some(reference),
            source,
        );
        for &n in level.take(&[3, 6, 8, 10], 1) {
            let found = pressed(n, true, law)?;
            quadratic.push(format!("{n}^3"), 1.0 / f64::from(n), found, None);
        }
        all.extend([linear, quadratic]);
    }
    Ok(all)
}

/// Force (N) that compresses the cube.
fn pressed(n: u32, quadratic: bool, law: SolidLaw) -> Result<f64, StudyError> {
    let mut mesh = solid_box([EDGE; 3], [n; 3])?;
    if quadratic {
        mesh = mesh.quadratic();
    }
    let mut body = Body::solid(&mesh, &[GELATINE], law, weightless(), &[])?;
    let face = |side: f64| vertices(&mesh.positions, |x| side * x.z > 0.5 * EDGE - 1e-9);
    body.add_support(&face(-1.0), [true; 3])?;
    let top = body.add_support(&face(1.0), [true; 3])?;
    body.set_support(top, Vec3::z() * (-0.1 * EDGE))?;
    if law == SolidLaw::Linear {
        settle_linear(&mut body)?;
    } else {
        settle(&mut body)?;
    }
    Ok(body.support_reaction(top).map_or(0.0, |force| -force.z))
}
