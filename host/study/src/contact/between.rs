//! Contact in equilibrium, as `palpate solve` finds it, against exact solutions: a patch test, and the law of Hertz.
//!
//! **Patch test.** Two blocks whose meshes do not match press on each other under a uniform load. The pressure and the stress
//! are uniform (Taylor and Papadopoulos, "On a patch test for contact problems in two dimensions", 1991).
//!
//! **Hertz.** A rigid sphere of the radius `R` presses the quarter of a block, `H = 16 R` deep and bonded to its ground:
//! `F = 4/3 E/(1 - nu^2) sqrt(R) d^(3/2)` for a half-space (Hertz, 1882). A layer is stiffer, by the series in
//! `chi = sqrt(R d) / H` of Dimitriadis, Horkay, Maresca, Kachar and Chadwick, "Determination of elastic moduli of thin layers of
//! soft material using the atomic force microscope", 2002, equation 13.

use super::aim::Aim;
use crate::{Level, StudyError};
use host::scene::Scene;
use host::solve::{Frame, Solution, SolveError, solve};
use host::world::World;
use meshio::write_vtu::Values;
use physics::mesh::generate_box::graded_box;
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::f64::consts::PI;

/// Young's modulus (Pa) and Poisson's ratio of all bodies.
const YOUNG: f64 = 1e5;
const POISSON: f64 = 0.3;

/// Measures the equilibria.
pub(super) fn run(level: Level, aims: &mut Vec<Aim>) -> Result<(), StudyError> {
    for order in [1, 2] {
        patch(level, order, aims)?;
    }
    hertz(level, aims)
}

/// Solves a scene. `keep` takes the frames.
fn solved(
    text: &str,
    files: &BTreeMap<String, Vec<u8>>,
    keep: &mut dyn FnMut(Frame<'_>),
) -> Result<Solution, StudyError> {
    let loaded = Scene::load_texts("between.toml", text, files)?;
    let world = World::new(&loaded)?;
    let solution = solve(&world, true, &mut |_| {}, &mut |frame: Frame<'_>| {
        keep(frame);
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

/// A block presses a block that slides on the ground, by a load on its upper face.
fn patch(level: Level, order: u32, aims: &mut Vec<Aim>) -> Result<(), StudyError> {
    const WIDTH: f64 = 0.04;
    const HEIGHT: f64 = 0.02;
    /// The load (Pa).
    const PRESSURE: f64 = 0.01 * YOUNG;
    /// The distance of contact, and that at the start (m).
    const SKIN: f64 = 1e-5;
    const START: f64 = 1.5e-5;
    let cells = match level {
        Level::Quick => [[3, 3, 2], [4, 5, 2]],
        Level::Full => [[7, 7, 4], [10, 9, 5]],
    };
    let block = |name: &str, [x, y, z]: [u32; 3], height: f64| {
        format!(
            r#"
[[body]]
name = "{name}"
mesh = {{ box = {{ size = [{WIDTH}, {WIDTH}, {HEIGHT}], cells = [{x}, {y}, {z}] }}, order = {order} }}
position = [0.0, 0.0, {height}]
material = {{ law = "linear", young = {YOUNG}, poisson = {POISSON}, density = 1000.0 }}
[[body.support]]
name = "x"
group = "left"
axes = ["x"]
[[body.support]]
name = "y"
group = "front"
axes = ["y"]
"#
        )
    };
    let text = format!(
        r#"
name = "patch"
gravity = [0.0, 0.0, 0.0]
{}
[[body.support]]
name = "ground"
group = "bottom"
axes = ["z"]
{}
[[body.load]]
name = "load"
group = "top"
traction = [0.0, 0.0, {}]
[[contact]]
between = ["lower", "upper"]
thickness = {SKIN}
friction = 0.0
"#,
        block("lower", cells[0], 0.0),
        block("upper", cells[1], HEIGHT + START),
        -PRESSURE,
    );
    // The load is that of the area at rest, which grows.
    let wider = (1.0 + POISSON * PRESSURE / YOUNG).powi(2);
    // Of both bodies, the largest departures of pressure and stress, and of the faces in contact from their place.
    let mut most = [0.0_f64; 3];
    let found = solved(&text, &BTreeMap::new(), &mut |frame| {
        if frame.number == 0 {
            return;
        }
        let grid = &frame.grid;
        let values = |name: &str, of: &[(String, Values)]| {
            let found = of.iter().find(|(own, _)| own == name);
            found.map(|(_, values)| values.clone())
        };
        // Where the block had its face in contact.
        let face = if frame.body == "lower" {
            0.5 * HEIGHT
        } else {
            0.5 * HEIGHT + START
        };
        let shrunk = if frame.body == "lower" {
            -PRESSURE / YOUNG * HEIGHT
        } else {
            -PRESSURE / YOUNG * HEIGHT - (START - SKIN)
        };
        if let (Some(Values::Scalar(pressure)), Some(Values::Vector(moved))) = (
            values("contact_pressure", &grid.at_vertices),
            values("displacement", &grid.at_vertices),
        ) {
            for ((x, u), own) in grid.positions.iter().zip(&moved).zip(&pressure) {
                if (x.z - u.z - face).abs() < 1e-9 {
                    most[0] = most[0].max((own * wider / PRESSURE - 1.0).abs());
                    most[2] = most[2].max((u.z / shrunk - 1.0).abs());
                }
            }
        }
        if let Some(Values::Tensor(stress)) = values("stress", &grid.in_cells) {
            for own in stress {
                let mut exact = own * 0.0;
                exact[(2, 2)] = -PRESSURE / wider;
                most[1] = most[1].max((own - exact).norm() / PRESSURE);
            }
        }
    })?;
    let force = found.contacts[0]
        .steps
        .last()
        .map_or(0.0, |row| row.force[2].abs());
    let kind = if order == 1 { "linear" } else { "quadratic" };
    let mut aim = |what: &str, ours: f64, ask: f64| {
        let name = format!("block on a block, {kind}: largest error of the {what}");
        aims.push(Aim::at_most(name, "%", 100.0 * ours, ask));
    };
    // The integrals over plane facets are exact. What is left is the tolerance of the solver, 1e-8 of the forces, times the
    // facets that share them.
    for (what, ours) in ["pressure", "stress", "place of the faces"]
        .into_iter()
        .zip(most)
    {
        aim(what, ours, 1e-4);
    }
    aim(
        "force",
        (force / (PRESSURE * WIDTH * WIDTH) - 1.0).abs(),
        1e-4,
    );
    Ok(())
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
    let found = solved(&text, &files.into(), &mut |_| {})?;
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
