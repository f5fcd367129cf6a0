//! Contact in equilibrium, as `palpate solve` finds it, against the law of Hertz.
//!
//! A rigid sphere of the radius `R` presses the quarter of a block, `H = 16 R` deep and bonded to its ground:
//! `F = 4/3 E/(1 - nu^2) sqrt(R) d^(3/2)` for a half-space (Hertz, 1882). A layer is stiffer, by the series in
//! `chi = sqrt(R d) / H` of Dimitriadis, Horkay, Maresca, Kachar and Chadwick, "Determination of elastic moduli of thin layers of
//! soft material using the atomic force microscope", 2002, equation 13.

use super::aim::Aim;
use crate::{Level, StudyError};
use host::scene::Scene;
use host::solve::{Frame, Solution, SolveError, solve};
use host::world::World;
use physics::mesh::generate_box::graded_box;
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::f64::consts::PI;

/// Young's modulus (Pa) and Poisson's ratio of all bodies.
const YOUNG: f64 = 1e5;
const POISSON: f64 = 0.3;

/// Measures the equilibria.
pub(super) fn run(level: Level, aims: &mut Vec<Aim>) -> Result<(), StudyError> {
    hertz(level, aims)
}

/// Solves a scene.
fn solved(text: &str, files: &BTreeMap<String, Vec<u8>>) -> Result<Solution, StudyError> {
    let loaded = Scene::load_texts("between.toml", text, files)?;
    let world = World::new(&loaded)?;
    let solution = solve(&world, true, &mut |_| {}, &mut |_: Frame<'_>| {
        Ok::<(), Infallible>(())
    });
    let solution = solution.map_err(|error| match error {
        SolveError::Scene(error) => StudyError::Scene(error),
        SolveError::Matrix(error) => StudyError::Condense(error),
        SolveError::Frame(never) => match never {},
    })?;
    match solution.failures.first() {
        Some(failure) => Err(StudyError::Unsolved(failure.clone())),
        None => Ok(solution),
    }
}

/// A rigid sphere of 10 mm presses a block, up to a tenth of its radius.
fn hertz(level: Level, aims: &mut Vec<Aim>) -> Result<(), StudyError> {
    const RADIUS: f64 = 0.01;
    const DEPTH: f64 = 16.0 * RADIUS;
    /// The distance of contact (m): the block begins a little above the sphere's lowest point.
    const SKIN: f64 = 1e-5;
    // Quadratic tetrahedra: linear ones of half the size are 9 % too stiff.
    let (fine, growth, steps) = match level {
        Level::Quick => (0.2 * RADIUS, 2.0, 1_u32),
        Level::Full => (0.1 * RADIUS, 1.8, 4),
    };
    let across = planes(0.4 * RADIUS, fine, growth, DEPTH);
    let mut down: Vec<f64> = planes(0.2 * RADIUS, fine, growth, DEPTH);
    down.reverse();
    for z in &mut down {
        *z = -*z;
    }
    let mesh = graded_box([&across, &across, &down])?;
    let files = [(
        "block.msh".to_owned(),
        meshio::write_gmsh::write_solid(&mesh).into_bytes(),
    )];
    let most = 0.1 * RADIUS;
    let text = format!(
        r#"
name = "hertz"
gravity = [0.0, 0.0, 0.0]
[solve]
load_steps = {steps}
[[body]]
name = "block"
mesh = {{ file = "block.msh", order = 2 }}
material = {{ law = "linear", young = {YOUNG}, poisson = {POISSON}, density = 1000.0 }}
contact_thickness = {}
[[body.support]]
name = "x"
group = "left"
axes = ["x"]
[[body.support]]
name = "y"
group = "front"
axes = ["y"]
[[body.support]]
name = "ground"
group = "bottom"
displacement = [0.0, 0.0, {most}]
[[obstacle]]
name = "sphere"
shape = "sphere"
radius = {RADIUS}
position = [0.0, 0.0, {}]
friction = 0.0
"#,
        2.0 * SKIN,
        RADIUS + SKIN,
    );
    let found = solved(&text, &files.into())?;
    for (step, row) in found
        .contacts
        .iter()
        .flat_map(|pair| &pair.steps)
        .enumerate()
    {
        let d = most * (step + 1) as f64 / f64::from(steps);
        // A quarter of the block.
        let exact = 0.25 * law_of_hertz(RADIUS, d) * stiffer(RADIUS, d, DEPTH);
        aims.push(Aim::at_most(
            format!(
                "sphere on a block, d = {:.3} R: error of the force",
                d / RADIUS
            ),
            "%",
            100.0 * (row.force[2].abs() / exact - 1.0).abs(),
            5.0,
        ));
    }
    Ok(())
}

/// The effective radius is that of the surface at which contact begins, which is `R` itself: the skin is very thin.
fn law_of_hertz(radius: f64, d: f64) -> f64 {
    4.0 / 3.0 * YOUNG / (1.0 - POISSON * POISSON) * radius.sqrt() * d.powf(1.5)
}

/// How much stiffer a bonded layer is than a half-space.
fn stiffer(radius: f64, d: f64, depth: f64) -> f64 {
    let nu = POISSON;
    let a = -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1.0 - nu);
    let b = (0.6387 - 1.0277 * nu + 1.5164 * nu * nu) / (1.0 - nu);
    let chi = (radius * d).sqrt() / depth;
    let third = 8.0 / PI.powi(3) * (a.powi(3) + 4.0 * PI * PI / 15.0 * b);
    let fourth = 16.0 * a / PI.powi(4) * (a.powi(3) + 3.0 * PI * PI / 5.0 * b);
    1.0 - 2.0 * a / PI * chi + 4.0 * a * a / (PI * PI) * chi.powi(2) - third * chi.powi(3)
        + fourth * chi.powi(4)
}

/// Planes from 0 to `end` (m): `fine` cells up to `near`, and cells that grow by a factor from there on.
fn planes(near: f64, fine: f64, growth: f64, end: f64) -> Vec<f64> {
    let cells = (near / fine).round();
    let mut found: Vec<f64> = (0..=cells as u32)
        .map(|i| near * f64::from(i) / cells)
        .collect();
    let (mut at, mut size) = (near, fine);
    loop {
        size *= growth;
        at += size;
        // The last cell is at most half as long again as its neighbour asks for.
        if at + 0.5 * size >= end {
            found.push(end);
            return found;
        }
        found.push(at);
    }
}
