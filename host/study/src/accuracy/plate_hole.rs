//! Kirsch's problem: a plate with a round hole in uniaxial tension (Kirsch, "Die Theorie der Elasticität und die
//! Bedürfnisse der Festigkeitslehre", 1898). The largest stress, at the hole, is 3 times the applied stress.
//!
//! The domain is a quarter of a square plate of 5 radii (10 in one case). The tractions of the exact solution act on
//! its border, so that the finite size causes no error. The stress is the largest principal stress of a single element.
//! The figures of an independent program on the same meshes are listed for comparison (rays at equal angles, an odd
//! number of them that cut the corner off, alternating diagonals).

use super::Series;
use super::solve::{settle, sheet_material, vertices, weightless};
use crate::elsewhere::ACCURACY;
use crate::{Level, StudyError};
use physics::body::load::edge_traction;
use physics::mesh::generate_plate::{HoledPlate, Rays, quarter_plate_with_hole};
use physics::{Body, Mat3, Vec3};

/// Remote stress over Young's modulus. Sheets are nonlinear, and their relative error is about as large.
const STRAIN: f64 = 1e-7;
const POISSON: f64 = 0.3;

/// Stress at a place in an infinite plate with a hole of radius 1, relative to the stress applied along x.
fn exact_stress(at: &Vec3) -> Mat3 {
    let q = 1.0 / (at.x * at.x + at.y * at.y);
    let angle = libm::atan2(at.y, at.x);
    let [c2, c4] = [2.0, 4.0].map(|n| libm::cos(n * angle));
    let [s2, s4] = [2.0, 4.0].map(|n| libm::sin(n * angle));
    let far = 1.5 * q * q;
    let xx = 1.0 - q * (1.5 * c2 + c4) + far * c4;
    let yy = -q * (0.5 * c2 - c4) - far * c4;
    let xy = -q * (0.5 * s2 + s4) + far * s4;
    Mat3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, 0.0)
}

/// One family of meshes: name, title, half the width of the plate over the radius, growth; and for each mesh the cells
/// around a quarter, the cells outward, and the number of times its cells were halved (each halving replaces the growth
/// by its square root).
type Family = (
    &'static str,
    &'static str,
    f64,
    f64,
    &'static [(u32, u32, u32)],
);

const FAMILIES: [Family; 4] = [
    (
        "kirsch_graded_1.15",
        "plate with a hole, cells growing by 1.15: largest stress",
        5.0,
        1.15,
        &[
            (15, 12, 0),
            (17, 14, 0),
            (23, 18, 0),
            (46, 36, 1),
            (92, 72, 2),
        ],
    ),
    (
        "kirsch_graded_1.3",
        "plate with a hole, cells growing by 1.3: largest stress",
        5.0,
        1.3,
        &[(15, 12, 0), (17, 14, 0), (23, 18, 0), (46, 36, 1)],
    ),
    (
        "kirsch_uniform",
        "plate with a hole, uniform rays: largest stress",
        5.0,
        1.0,
        &[
            (15, 12, 0),
            (17, 14, 0),
            (23, 18, 0),
            (46, 36, 1),
            (92, 72, 2),
        ],
    ),
    (
        "kirsch_uniform_wide",
        "plate with a hole, 10 radii, uniform rays: largest stress",
        10.0,
        1.0,
        &[(15, 12, 0), (17, 14, 0), (23, 18, 0)],
    ),
];

pub(super) fn run(level: Level) -> Result<Vec<Series>, StudyError> {
    let mut all = Vec::new();
    for (name, title, half, growth, meshes) in FAMILIES {
        let source = "Kirsch 1898; an independent program on the same meshes";
        let mut series = Series::new(name, title, "1", Some(3.0), source);
        let others = &ACCURACY.kirsch[name];
        for (&(around, outward, halvings), &independent) in level.take(meshes, 3).iter().zip(others)
        {
            let plate = HoledPlate {
                width: 2.0 * half,
                height: 2.0 * half,
                radius: 1.0,
                around,
                outward,
                growth: libm::exp2(libm::log2(growth) / f64::from(1 << halvings)),
                rays: Rays::Equal,
            };
            let mesh = format!("{around} x {outward}, {} whole", 8 * around * outward);
            let size = 1.0 / f64::from(around);
            series.push(mesh, size, largest_stress(&plate)?, Some(independent));
        }
        all.push(series);
    }
    Ok(all)
}

/// The largest principal stress of any element, relative to the applied stress.
fn largest_stress(plate: &HoledPlate) -> Result<f64, StudyError> {
    let mesh = quarter_plate_with_hole(plate)?;
    let material = sheet_material(1.0, POISSON, 1.0);
    let mut body = Body::sheet(&mesh, &[material], weightless(), &[])?;
    let on = |name: &str| mesh.group(name).map_or(&[][..], |group| &group.members);
    body.add_support(&vertices(&mesh.positions, |_| true), [false, false, true])?;
    body.add_support(on("symmetry_x"), [true, false, false])?;
    body.add_support(on("symmetry_y"), [false, true, false])?;
    let border = [on("right"), on("top")].concat();
    let pull = |at: &Vec3, normal: &Vec3| exact_stress(at) * normal * STRAIN;
    let (forces, _) = edge_traction(&mesh, &border, pull)?;
    body.set_external_forces(&forces)?;
    settle(&mut body)?;
    let x = body.node_positions();
    let stresses = body
        .elements()
        .iter()
        .flat_map(|set| (0..set.count()).map(|element| set.stress(element, x)));
    Ok(stresses.map(|s| larger_principal(&s)).fold(0.0, f64::max) / STRAIN)
}

/// The larger principal value in the plane of x and y.
fn larger_principal(s: &Mat3) -> f64 {
    let mean = 0.5 * (s[(0, 0)] + s[(1, 1)]);
    mean + libm::hypot(0.5 * (s[(0, 0)] - s[(1, 1)]), s[(0, 1)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mesh_has_its_figure() {
        for (name, _, _, _, meshes) in FAMILIES {
            assert_eq!(ACCURACY.kirsch[name].len(), meshes.len(), "{name}");
        }
        assert_eq!(ACCURACY.kirsch.len(), FAMILIES.len());
    }
}
