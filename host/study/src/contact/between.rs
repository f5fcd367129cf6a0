//! Contact between bodies in equilibrium, as `palpate solve` finds it: a pressed patch, and the law of Hertz.
//!
//! **Patch.** Two blocks whose meshes do not match are pressed on each other. They slide on their sides, so that the pressure is
//! uniform, `p = E u / L` (the patch test of contact: Taylor and Papadopoulos, "On a patch test for contact problems in two
//! dimensions", 1991).
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
pub(super) fn run(
    level: Level,
    progress: &mut dyn FnMut(f64),
    aims: &mut Vec<Aim>,
) -> Result<(), StudyError> {
    for order in [1, 2] {
        patch(order, aims)?;
    }
    progress(0.2);
    hertz(level, aims)?;
    progress(1.0);
    Ok(())
}

/// What a solve leaves.
struct Solved {
    solution: Solution,
    /// By body, at the end.
    frames: Vec<LastFrame>,
}

/// A body at the end.
#[derive(Default)]
struct LastFrame {
    /// The stress along z of each element (Pa), and its centre (m).
    stresses: Vec<([f64; 3], f64)>,
    /// The pressure of contacts on each vertex (Pa).
    pressure: Vec<f64>,
}

/// Solves a scene.
fn solved(text: &str, files: &BTreeMap<String, Vec<u8>>) -> Result<Solved, StudyError> {
    let loaded = Scene::load_texts("between.toml", text, files)?;
    let world = World::new(&loaded)?;
    let mut frames: Vec<LastFrame> = Vec::new();
    let solution = solve(&world, true, &mut |_| {}, &mut |frame: Frame<'_>| {
        let index = loaded
            .scene
            .bodies
            .iter()
            .position(|body| body.name == frame.body);
        let index = index.unwrap_or_default();
        frames.resize_with(frames.len().max(index + 1), LastFrame::default);
        frames[index] = last(&frame);
        Ok::<(), Infallible>(())
    });
    let solution = solution.map_err(|error| match error {
        SolveError::Scene(error) => StudyError::Scene(error),
        SolveError::Matrix(error) => StudyError::Condense(error),
        SolveError::Frame(never) => match never {},
    })?;
    match solution.failures.first() {
        Some(failure) => Err(StudyError::Unsolved(failure.clone())),
        None => Ok(Solved { solution, frames }),
    }
}

fn last(frame: &Frame<'_>) -> LastFrame {
    let grid = &frame.grid;
    let mut found = LastFrame::default();
    for (name, values) in &grid.in_cells {
        if let (Values::Tensor(stresses), "stress") = (values, &**name) {
            let cells = grid.cells.iter().zip(stresses);
            found.stresses = cells
                .map(|((vertices, _), stress)| {
                    let corners = vertices[..4].iter().map(|v| grid.positions[*v as usize]);
                    let centre = corners.fold(physics::Vec3::zeros(), |sum, x| sum + x / 4.0);
                    (centre.into(), stress[(2, 2)])
                })
                .collect();
        }
    }
    for (name, values) in &grid.at_vertices {
        if let (Values::Scalar(pressure), "contact_pressure") = (values, &**name) {
            found.pressure.clone_from(pressure);
        }
    }
    found
}

/// Two blocks of 40 mm, 20 mm high each, of 5 by 5 and 4 by 4 cells, are pressed by a fiftieth.
fn patch(order: u32, aims: &mut Vec<Aim>) -> Result<(), StudyError> {
    const SIZE: f64 = 0.04;
    const HEIGHT: f64 = 0.02;
    const GAP: f64 = 1e-4;
    const PRESS: f64 = 0.8e-3;
    let block = |name: &str, cells: [u32; 3], z: f64, held: &str, displacement: f64| {
        format!(
            r#"
[[body]]
name = "{name}"
mesh = {{ box = {{ size = [{SIZE}, {SIZE}, {HEIGHT}], cells = {cells:?} }}, order = {order} }}
position = [0.0, 0.0, {z}]
material = {{ law = "linear", young = {YOUNG}, poisson = {POISSON}, density = 1000.0 }}
[[body.support]]
name = "x"
group = "left"
axes = ["x"]
[[body.support]]
name = "y"
group = "front"
axes = ["y"]
[[body.support]]
name = "z"
group = "{held}"
axes = ["z"]
displacement = [0.0, 0.0, {displacement}]
"#
        )
    };
    // The blocks begin at the distance of contact.
    let z = 0.5 * (HEIGHT + GAP);
    let text = format!(
        r#"
name = "patch"
gravity = [0.0, 0.0, 0.0]
{}{}
[[contact]]
between = ["lower", "upper"]
friction = 0.0
thickness = {GAP}
"#,
        block("lower", [5, 5, 2], -z, "bottom", 0.0),
        block("upper", [4, 4, 2], z, "top", -PRESS),
    );
    let found = solved(&text, &BTreeMap::new())?;
    let exact = YOUNG * PRESS / (2.0 * HEIGHT);
    let (mut off, mut largest, mut count) = (0.0, 0.0_f64, 0);
    let stresses = found.frames.iter().flat_map(|frame| &frame.stresses);
    for (_, stress) in stresses {
        let own = stress / -exact - 1.0;
        off += own * own;
        largest = largest.max(own.abs());
        count += 1;
    }
    let rms = (off / f64::from(count)).sqrt();
    let force = found
        .solution
        .contacts
        .iter()
        .flat_map(|pair| pair.steps.last());
    let force: f64 = force.map(|last| last.force[2].abs()).sum();
    let kind = if order == 1 { "linear" } else { "quadratic" };
    let ask = if order == 1 { 1e-4 } else { 5.0 };
    aims.extend([
        Aim::at_most(
            format!("pressed patch, {kind}: largest error of the stress of an element"),
            "%",
            100.0 * largest,
            ask,
        ),
        Aim::at_most(
            format!("pressed patch, {kind}: mean square error of the stress"),
            "%",
            100.0 * rms,
            ask,
        ),
        Aim::at_most(
            format!("pressed patch, {kind}: error of the force"),
            "%",
            100.0 * (force / (exact * SIZE * SIZE) - 1.0).abs(),
            if order == 1 { 1e-4 } else { 1.0 },
        ),
    ]);
    Ok(())
}

/// A rigid sphere of 10 mm presses a block, up to a tenth of its radius.
fn hertz(level: Level, aims: &mut Vec<Aim>) -> Result<(), StudyError> {
    const RADIUS: f64 = 0.01;
    const DEPTH: f64 = 16.0 * RADIUS;
    const STEPS: usize = 4;
    /// The distance of contact (m): the block begins a little above the sphere's lowest point.
    const SKIN: f64 = 1e-5;
    let (fine, growth) = match level {
        Level::Quick => (0.08 * RADIUS, 1.6),
        _ => (0.04 * RADIUS, 1.4),
    };
    let across = planes(0.4 * RADIUS, fine, growth, DEPTH);
    let mut down: Vec<f64> = planes(0.2 * RADIUS, fine, growth, DEPTH);
    down.reverse();
    down.iter_mut().for_each(|z| *z = -*z);
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
load_steps = {STEPS}
[[body]]
name = "block"
mesh.file = "block.msh"
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
        .solution
        .contacts
        .iter()
        .flat_map(|pair| &pair.steps)
        .enumerate()
    {
        let d = most * (step + 1) as f64 / STEPS as f64;
        // A quarter of the block.
        let exact = 0.25 * law_of_hertz(RADIUS, d) * stiffer(RADIUS, d, DEPTH);
        aims.push(Aim::at_most(
            format!(
                "sphere on a block, d = {:.3} R: error of the force",
                d / RADIUS
            ),
            "%",
            100.0 * (row.force[2] / exact - 1.0).abs(),
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
