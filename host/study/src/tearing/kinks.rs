//! Part `path`: the first kink of a crack at an angle to the load.
//!
//! A square sheet, held flat, has a short straight crack in its middle and is pulled by even tractions on two sides, or
//! sheared by even tractions on all four. The reference is that of an infinite sheet, where
//! `K_I / K_II = tan(angle)` between crack and load, and the maximum tangential stress gives the kink (Erdogan and Sih, "On
//! the crack extension in plates under plane loading and transverse shear", 1963).

use super::patterns::{Pattern, Rectangle, Slit};
use super::specimen::{CLOTH, driving, exact, hold_flat, surface};
use crate::{Level, StudyError};
use physics::body::load::edge_traction;
use physics::tear::TearLaw;
use physics::{Body, Equilibrium, EquilibriumOptions, Vec3};
use serde::Serialize;

/// Side of the square (m), and length of the crack (m): ten edges of a mesh of 3,000 triangles.
const SIDE: f64 = 0.1;
const CRACK: f64 = 0.026;
/// The number of triangles to aim at.
const TRIANGLES: usize = 3000;
/// The traction (Pa): small, so that the sheet stays linear.
const STRESS: f64 = 100.0;

/// How a sheet is loaded.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Load {
    /// Pulled, with this angle (degrees) between crack and load.
    Pull(f64),
    /// Sheared along the crack.
    Shear,
}

/// The loads, and the kink of each in an infinite sheet (degrees).
const LOADS: [(Load, f64); 6] = [
    (Load::Pull(15.0), -65.5),
    (Load::Pull(30.0), -60.0),
    (Load::Pull(45.0), -53.1),
    (Load::Pull(60.0), -43.2),
    (Load::Pull(75.0), -26.7),
    (Load::Shear, -70.5),
];

/// The kinks of one sheet.
#[derive(Clone, Debug, Serialize)]
pub struct Kink {
    /// How the triangles lie.
    pub pattern: String,
    /// Number of triangles.
    pub triangles: usize,
    /// The angle between crack and load, or `shear`.
    pub load: String,
    /// The kink in an infinite sheet (degrees).
    pub exact: f64,
    /// The kinks at the two tips (degrees).
    pub found: [f64; 2],
}

impl Kink {
    /// The larger error of the two tips (degrees).
    pub fn error(&self) -> f64 {
        let errors = self.found.map(|found| (found - self.exact).abs());
        errors[0].max(errors[1])
    }
}

/// The kinks of all loads on all patterns; at the quick level, of three loads on two patterns.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, progress: &dyn Fn(f64)) -> Result<Vec<Kink>, StudyError> {
    let patterns = level.ends(&Pattern::ALL);
    let loads: Vec<_> = match level {
        Level::Quick => vec![LOADS[0], LOADS[2], LOADS[5]],
        Level::Full => LOADS.to_vec(),
    };
    let mut kinks = Vec::new();
    for (number, &pattern) in patterns.iter().enumerate() {
        for &(load, exact) in &loads {
            kinks.push(kink(pattern, load, exact)?);
        }
        progress((number + 1) as f64 / patterns.len() as f64);
    }
    Ok(kinks)
}

fn kink(pattern: Pattern, load: Load, exact_kink: f64) -> Result<Kink, StudyError> {
    // The load is along y. The crack begins at its upper end where the load shears it to the left.
    let angle = match load {
        Load::Pull(angle) => (90.0 - angle).to_radians(),
        Load::Shear => 0.0,
    };
    let end = [
        0.5 * CRACK * libm::cos(angle),
        0.5 * CRACK * libm::sin(angle),
    ];
    let slit = Slit {
        from: [-end[0], -end[1]],
        to: end,
    };
    let rectangle = Rectangle {
        length: SIDE,
        width: SIDE,
        triangles: TRIANGLES,
        pattern,
        slits: &[slit],
        marks: &[],
    };
    let made = rectangle.mesh()?;
    let mesh = &made.mesh;
    let surface = surface(mesh)?;
    let mut body = Body::sheet(mesh, &[CLOTH.elastic()], exact(), &[])?;
    hold_flat(&mut body, &[])?;
    // Three guided directions at the border leave no rigid motion. They give no force, because the load is balanced.
    let [left, right] = [lowest(mesh, -1.0), lowest(mesh, 1.0)];
    body.add_support(&[left], [true, true, false])?;
    body.add_support(&[right], [false, true, false])?;
    let outer: Vec<u32> = ["left", "right", "bottom", "top"]
        .iter()
        .flat_map(|name| super::specimen::side(&made, name).to_vec())
        .collect();
    let (forces, _) = edge_traction(mesh, &outer, |_, normal| {
        let stress = STRESS * CLOTH.thickness;
        match load {
            Load::Pull(_) => Vec3::new(0.0, stress * normal.y, 0.0),
            Load::Shear => Vec3::new(stress * normal.y, stress * normal.x, 0.0),
        }
    })?;
    Equilibrium::new(&body, EquilibriumOptions::default())?.solve_loaded(
        &mut body,
        &[],
        &forces,
    )?;
    let x: Vec<Vec3> = body.positions().collect();
    let material = CLOTH.tear(TearLaw::Toughness);
    let mut found = [0.0; 2];
    for (found, &tip) in found.iter_mut().zip(&made.tips) {
        let (_, intensity) = driving(&surface, tip, &x, &material, |_| false)?;
        *found = intensity.kink().to_degrees();
    }
    Ok(Kink {
        pattern: pattern.name(),
        triangles: mesh.triangles.len(),
        load: match load {
            Load::Pull(angle) => format!("{angle}°"),
            Load::Shear => "shear".to_owned(),
        },
        exact: exact_kink,
        found,
    })
}

/// The corner of the lower side at the left (-1) or right (1).
fn lowest(mesh: &physics::mesh::TriMesh, sign: f64) -> u32 {
    let at = Vec3::new(0.5 * sign * SIDE, -0.5 * SIDE, 0.0);
    let near = mesh
        .positions
        .iter()
        .position(|position| (position - at).norm() < 1e-9);
    near.unwrap_or_default() as u32
}
