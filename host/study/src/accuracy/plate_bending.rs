//! Sheets that bend, against the theory of thin plates (Timoshenko and Woinowsky-Krieger, "Theory of plates
//! and shells", 2nd edition): rigidity `D = E t^3 / (12 (1 - nu^2))`.
//!
//! A strip held at one end bends as a beam (nu = 0), under a force at its end and under pressure. A strip eight times
//! as wide as long (nu = 0.3) bends cylindrically, so that `D` governs the middle of its end. A square plate is held
//! along all its edges. Values are deflections relative to the theory. The held borders are clamped. For comparison, the
//! first strip is also computed as a slab of quadratic tetrahedra.
//!
//! Deflections converge to the theory with the square of the size of the cells, however the sheet is cut into triangles.

use super::Series;
use super::solve::{
    displacement_at, displacements, settle, sheet_material, solid_material, vertices, weightless,
};
use crate::{Level, StudyError};
use physics::body::load::{edge_traction, traction};
use physics::mesh::TriMesh;
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::{Body, BodyConfig, SolidLaw, Vec3};

/// For a strip of length 1 and a square of width 1. The model is that of a thin plate at any thickness.
const THICKNESS: f64 = 0.1;
/// Sheets are nonlinear. Their error is of second order in deflection over thickness.
const DEFLECTION: f64 = 1e-3 * THICKNESS;
/// Thickness of the slab.
const SLAB: f64 = 0.02;
/// Deflection of the slab. The slab is linear, so any value is valid.
const SLAB_DEFLECTION: f64 = 1e-3;

/// The load of a strip.
#[derive(Clone, Copy, PartialEq)]
enum Load {
    End,
    Pressure,
}

/// The cut of a sheet into triangles.
#[derive(Clone, Copy, PartialEq)]
enum Cut {
    /// Parallel diagonals.
    Regular,
    /// Parallel diagonals, with inner vertices moved by up to a fifth of a cell along either axis.
    Moved,
    /// Alternating diagonals: half of the vertices have four triangles, half have eight.
    Alternating,
}

const CUTS: [(Cut, &str); 3] = [
    (Cut::Regular, "all diagonals alike"),
    (Cut::Moved, "all diagonals alike, vertices moved"),
    (Cut::Alternating, "alternating diagonals"),
];

pub(super) fn run(level: Level) -> Result<Vec<Series>, StudyError> {
    let mut all = Vec::new();
    for (name, problem, load, width, poisson, sizes, source) in STRIPS {
        for ((cut, how), name) in CUTS.into_iter().zip(name) {
            let mut series = series(name, problem, how, source);
            for &n in level.take(&sizes, 3) {
                let across = (width * f64::from(n)) as u32;
                let found = strip(n, across, width, poisson, load, cut)?;
                series.push(format!("{n} x {across}"), 1.0 / f64::from(n), found, None);
            }
            all.push(series);
        }
    }
    let names = ["plate", "plate_moved", "plate_alternating"];
    for ((cut, how), name) in CUTS.into_iter().zip(names) {
        let mut series = series(
            name,
            "clamped square plate under pressure",
            how,
            "0.001265319 q a^4 / D",
        );
        for &n in level.take(&[8, 16, 32, 64], 3) {
            series.push(
                format!("{n} x {n}"),
                1.0 / f64::from(n),
                square(n, cut)?,
                None,
            );
        }
        all.push(series);
    }
    let mut slabs = Series::new(
        "strip_quadratic",
        "clamped strip under an end load, slab of quadratic tetrahedra",
        "1",
        Some(1.0),
        "Timoshenko's beam, 2e-4 softer than Euler and Bernoulli's",
    );
    for &n in level.take(&[4_u32, 8, 16, 32], 3) {
        let across = n.div_ceil(4);
        let mesh = format!("{n} x {across} x 1");
        slabs.push(mesh, 1.0 / f64::from(n), slab(n, across)?, None);
    }
    all.push(slabs);
    Ok(all)
}

/// Names by cut, problem, load, width, Poisson's ratio, cells along the length, source.
type Strip = (
    [&'static str; 3],
    &'static str,
    Load,
    f64,
    f64,
    [u32; 4],
    &'static str,
);

const STRIPS: [Strip; 3] = [
    (
        ["strip_end", "strip_end_moved", "strip_end_alternating"],
        "clamped strip under an end load",
        Load::End,
        0.25,
        0.0,
        [8, 16, 32, 64],
        "Euler and Bernoulli's beam",
    ),
    (
        [
            "strip_press",
            "strip_press_moved",
            "strip_press_alternating",
        ],
        "clamped strip under pressure",
        Load::Pressure,
        0.25,
        0.0,
        [8, 16, 32, 64],
        "Euler and Bernoulli's beam",
    ),
    (
        ["strip_wide", "strip_wide_moved", "strip_wide_alternating"],
        "clamped strip 8 times as wide as long under pressure",
        Load::Pressure,
        8.0,
        0.3,
        [4, 8, 16, 32],
        "cylindrical bending, q L^4 / (8 D)",
    ),
];

fn series(name: &'static str, problem: &str, how: &str, source: &'static str) -> Series {
    let title = format!("{problem}, sheet with {how}");
    Series::new(name, title, "1", Some(1.0), source)
}

/// A rectangle of `nx` times `ny` cells.
fn rectangle(size: [f64; 2], nx: u32, ny: u32, cut: Cut) -> Result<TriMesh, StudyError> {
    let pattern = match cut {
        Cut::Alternating => Pattern::Alternating,
        Cut::Regular | Cut::Moved => Pattern::Regular,
    };
    let mut mesh = sheet(size[0], size[1], nx, ny, pattern)?;
    if cut == Cut::Moved {
        let cell = [size[0] / f64::from(nx), size[1] / f64::from(ny)];
        // A linear congruential generator (Knuth's constants): the same mesh on every machine.
        let mut state = 1_u64;
        let mut signed = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        // The border keeps its place, so that it is straight. The middle vertex keeps its place, too.
        let inner = |x: f64, axis: usize| x.abs() < 0.5 * (size[axis] - cell[axis]);
        for x in &mut mesh.positions {
            let by = [signed(), signed()];
            if inner(x.x, 0) && inner(x.y, 1) && x.norm() > 0.5 * cell[0] {
                x.x += 0.2 * cell[0] * by[0];
                x.y += 0.2 * cell[1] * by[1];
            }
        }
    }
    Ok(mesh)
}

/// A body of `mesh` that resists bending, moves along z only, and is clamped where `held` holds.
fn plate(mesh: &TriMesh, poisson: f64, held: impl Fn(&Vec3) -> bool) -> Result<Body, StudyError> {
    let config = BodyConfig {
        bending: 1.0,
        ..weightless()
    };
    let mut body = Body::sheet(
        mesh,
        &[sheet_material(1.0, poisson, THICKNESS)],
        config,
        &[],
    )?;
    body.add_support(&vertices(&mesh.positions, |_| true), [true, true, false])?;
    body.add_clamp(&vertices(&mesh.positions, held))?;
    Ok(body)
}

/// Forces (N) of a uniform pressure along z.
fn pressure(mesh: &TriMesh, pressure: f64) -> Vec<Vec3> {
    let mut forces = vec![Vec3::zeros(); mesh.positions.len()];
    for (number, triangle) in (0_u32..).zip(&mesh.triangles) {
        let third = pressure * mesh.triangle_area(number).unwrap_or(0.0) / 3.0;
        for &vertex in triangle {
            forces[vertex as usize].z += third;
        }
    }
    forces
}

/// Deflection at the middle of the free end, relative to the theory.
fn strip(
    n: u32,
    across: u32,
    width: f64,
    poisson: f64,
    load: Load,
    cut: Cut,
) -> Result<f64, StudyError> {
    let mut mesh = rectangle([1.0, width], n, across, cut)?;
    for x in &mut mesh.positions {
        x.x += 0.5;
    }
    let mut body = plate(&mesh, poisson, |x| x.x < 1e-9)?;
    let rigidity = sheet_material(1.0, poisson, THICKNESS).bending_rigidity();
    let forces = match load {
        Load::End => {
            let per_width = DEFLECTION * 3.0 * rigidity;
            let end = vertices(&mesh.positions, |x| x.x > 1.0 - 1e-9);
            edge_traction(&mesh, &end, |_, _| Vec3::z() * per_width)?.0
        }
        Load::Pressure => pressure(&mesh, DEFLECTION * 8.0 * rigidity),
    };
    body.set_external_forces(&forces)?;
    settle(&mut body)?;
    Ok(displacement_at(&body, &mesh.positions, Vec3::x()).z / DEFLECTION)
}

/// Deflection of the middle, relative to the theory.
fn square(n: u32, cut: Cut) -> Result<f64, StudyError> {
    let mesh = rectangle([1.0; 2], n, n, cut)?;
    let mut body = plate(&mesh, 0.3, |x| x.amax() > 0.5 - 1e-9)?;
    let rigidity = sheet_material(1.0, 0.3, THICKNESS).bending_rigidity();
    let load = DEFLECTION * rigidity / 0.001_265_319;
    body.set_external_forces(&pressure(&mesh, load))?;
    settle(&mut body)?;
    Ok(displacement_at(&body, &mesh.positions, Vec3::zeros()).z / DEFLECTION)
}

/// Mean deflection of the slab's free end, relative to the theory.
fn slab(n: u32, across: u32) -> Result<f64, StudyError> {
    let width = 0.25;
    let mesh = solid_box([1.0, width, SLAB], [n, across, 1])?.quadratic();
    let material = solid_material(1.0, 0.0);
    let mut body = Body::solid(&mesh, &[material], SolidLaw::Linear, weightless(), &[])?;
    body.add_support(&vertices(&mesh.positions, |x| x.x < 1e-9 - 0.5), [true; 3])?;
    let end = vertices(&mesh.positions, |x| x.x > 0.5 - 1e-9);
    let area = width * SLAB;
    let inertia = area * SLAB * SLAB / 12.0;
    // For nu = 0: G = E / 2, and the shear area is 5 / 6 of the section.
    let per_force = 1.0 / (3.0 * inertia) + 1.0 / (5.0 / 6.0 * 0.5 * area);
    let force = SLAB_DEFLECTION / per_force;
    let (forces, _) = traction(&mesh, &end, Vec3::z() * (force / area));
    body.set_external_forces(&forces)?;
    settle(&mut body)?;
    let u = displacements(&body, &mesh.positions);
    let sum: f64 = end.iter().map(|&vertex| u[vertex as usize].z).sum();
    Ok(sum / (end.len() as f64 * SLAB_DEFLECTION))
}
