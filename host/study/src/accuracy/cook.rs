//! Cook's membrane: a tapered panel, held at its left end and sheared at its right end (Cook, "Improved two-dimensional
//! finite element", 1974). Coarse meshes of elements that bend badly are far too stiff.
//!
//! Corners (0, 0), (48, 44), (48, 60), (0, 44), thickness 1, force 1. In plane stress with E = 1 and nu = 1/3 the
//! middle of the free end moves up by 23.96. Linear tetrahedra lock in plane strain if they are nearly incompressible
//! (E = 1.125, nu = 0.4999). The reference there is extrapolated from the quadratic elements of this engine.

use super::Series;
use super::solve::{displacement_at, settle, sheet_material, solid_material, vertices, weightless};
use crate::{Level, StudyError};
use physics::body::load::{edge_traction, traction};
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::{Body, SolidLaw, Vec3};

/// Sheets are nonlinear. Under this force their relative error is about as large as the force. Slabs are linear and
/// carry the force 1.
const LOAD: f64 = 1e-6;
const END: f64 = 16.0;

/// Maps the unit square around the origin to the panel; z is unchanged.
fn panel(at: &Vec3) -> Vec3 {
    let (s, t) = (at.x + 0.5, at.y + 0.5);
    let (bottom, top) = (44.0 * s, 44.0 + 16.0 * s);
    Vec3::new(48.0 * s, bottom + (top - bottom) * t, at.z)
}

const MIDDLE: Vec3 = Vec3::new(48.0, 52.0, 0.0);

pub(super) fn run(level: Level) -> Result<Vec<Series>, StudyError> {
    let source = "the value in wide use for refined meshes; our sheets, extrapolated: 23.966";
    let name = |elements: &str| format!("Cook's membrane, {elements}: middle of the free end");
    let mut sheets = Series::new("cook_sheet", name("sheet"), "1", Some(23.96), source);
    for &n in level.take(&[8, 16, 32, 64, 128], 3) {
        sheets.push(grid(n), 1.0 / f64::from(n), membrane(n)?, None);
    }
    let quadratic = name("thin slab of quadratic tetrahedra");
    let mut slabs = Series::new("cook_quadratic", quadratic, "1", Some(23.96), source);
    for &n in level.take(&[4, 8, 16, 32], 2) {
        slabs.push(
            grid(n),
            1.0 / f64::from(n),
            slab(n, true, 1.0, 1.0 / 3.0, false)?,
            None,
        );
    }

    let mut all = vec![sheets, slabs];
    for (name, elements, quadratic) in [
        ("cook_incompressible_linear", "linear", false),
        ("cook_incompressible_quadratic", "quadratic", true),
    ] {
        let title = format!(
            "Cook's membrane in plane strain, nu = 0.4999, {elements} tetrahedra: middle of the free end"
        );
        let source = "our quadratic elements, extrapolated from the three finest";
        let mut series = Series::new(name, title, "1", Some(16.44), source);
        for &n in level.take(&[4, 8, 16, 32, 64], 3) {
            let found = slab(n, quadratic, 1.125, 0.4999, true)?;
            series.push(grid(n), 1.0 / f64::from(n), found, None);
        }
        all.push(series);
    }
    Ok(all)
}

fn grid(n: u32) -> String {
    format!("{n} x {n}")
}

/// Plane stress, as a sheet.
fn membrane(n: u32) -> Result<f64, StudyError> {
    let mut mesh = sheet(1.0, 1.0, n, n, Pattern::Alternating)?;
    for x in &mut mesh.positions {
        *x = panel(x);
    }
    let material = sheet_material(1.0, 1.0 / 3.0, 1.0);
    let mut body = Body::sheet(&mesh, &[material], weightless(), &[])?;
    body.add_support(&vertices(&mesh.positions, |_| true), [false, false, true])?;
    body.add_support(&vertices(&mesh.positions, |x| x.x < 1e-9), [true; 3])?;
    let end = vertices(&mesh.positions, |x| x.x > 48.0 - 1e-9);
    let (forces, _) = edge_traction(&mesh, &end, |_, _| Vec3::y() * (LOAD / END))?;
    body.set_external_forces(&forces)?;
    settle(&mut body)?;
    Ok(displacement_at(&body, &mesh.positions, MIDDLE).y / LOAD)
}

/// One layer of tetrahedra: in plane strain between two planes, or with one free face in plane stress (approximately:
/// the thickness of the slab is about a hundredth of its length).
fn slab(
    n: u32,
    quadratic: bool,
    young: f64,
    poisson: f64,
    plane_strain: bool,
) -> Result<f64, StudyError> {
    let thickness = 0.5;
    let mut mesh = solid_box([1.0, 1.0, thickness], [n, n, 1])?;
    for x in &mut mesh.positions {
        *x = panel(x);
    }
    if quadratic {
        mesh = mesh.quadratic();
    }
    let x = &mesh.positions;
    let mut body = Body::solid(
        &mesh,
        &[solid_material(young, poisson)],
        SolidLaw::Linear,
        weightless(),
        &[],
    )?;
    let guided = vertices(x, |x| plane_strain || x.z < 1e-9 - 0.5 * thickness);
    body.add_support(&guided, [false, false, true])?;
    body.add_support(&vertices(x, |x| x.x < 1e-9), [true, true, false])?;
    let end = vertices(x, |x| x.x > 48.0 - 1e-9);
    let (forces, _) = traction(&mesh, &end, Vec3::y() / END);
    body.set_external_forces(&forces)?;
    settle(&mut body)?;
    Ok(displacement_at(&body, x, MIDDLE).y)
}
