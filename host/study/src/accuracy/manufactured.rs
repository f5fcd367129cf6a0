//! Manufactured solutions (Roache, "Code verification by the method of manufactured solutions", 2002). A displacement
//! is chosen, and the body force that causes it is derived. The finite elements compute the displacement from the
//! force, and the error is measured over the volume of the cube. The error is of second order in the size of linear
//! elements, of third order for quadratic elements.

use super::Series;
use super::solve::{displacements, settle_linear, solid_material, vertices, weightless};
use crate::{Level, StudyError};
use core::f64::consts::PI;
use physics::element::tet::shape::{Shape, Tet4, Tet10};
use physics::material::law::Lame;
use physics::mesh::generate_box::solid_box;
use physics::{Body, Mat3, SolidLaw, Vec3};

/// The displacement is `DIRECTION sin(pi x) sin(pi y) sin(pi z)`, zero on the surface of the cube. It is small, so that
/// no cell is inverted.
const DIRECTION: Vec3 = Vec3::new(1e-3, -0.5e-3, 0.7e-3);
const POISSON: f64 = 0.3;

pub(super) fn run(level: Level) -> Result<Vec<Series>, StudyError> {
    let source = "the chosen displacement; the value is the error over the volume, as a fraction";
    let title = |elements: &str| format!("manufactured displacement, {elements} tetrahedra: error");
    let mut linear = Series::new("manufactured_linear", title("linear"), "1", None, source);
    for &n in level.take(&[4, 8, 16, 24, 32], 3) {
        linear.push(
            format!("{n}^3"),
            1.0 / f64::from(n),
            error::<4, 1, Tet4>(n, false)?,
            None,
        );
    }
    let mut quadratic = Series::new(
        "manufactured_quadratic",
        title("quadratic"),
        "1",
        None,
        source,
    );
    for &n in level.take(&[2, 4, 8, 12, 16], 3) {
        quadratic.push(
            format!("{n}^3"),
            1.0 / f64::from(n),
            error::<10, 4, Tet10>(n, true)?,
            None,
        );
    }
    Ok(vec![linear, quadratic])
}

fn bump(at: &Vec3) -> f64 {
    at.iter().map(|c| libm::sin(PI * c)).product()
}

/// `-div sigma` of the displacement: `-(lambda + mu) grad div u - mu laplacian u`.
fn body_force(lame: Lame, at: &Vec3) -> Vec3 {
    let (s, c) = (at.map(|c| libm::sin(PI * c)), at.map(|c| libm::cos(PI * c)));
    let second = Mat3::from_fn(|i, j| {
        if i == j {
            return -bump(at);
        }
        let k = 3 - i - j;
        c[i] * c[j] * s[k]
    }) * (PI * PI);
    -(second * DIRECTION * (lame.lambda + lame.mu) + DIRECTION * (lame.mu * second.trace()))
}

/// A quadrature rule of degree 7 on the reference tetrahedron: Gauss-Legendre points of a cube, collapsed (Duffy). The
/// weights include the map's determinant.
fn fine_rule() -> Vec<(Vec3, f64)> {
    let root = 2.0 / 7.0 * libm::sqrt(6.0 / 5.0);
    let (a, b) = (libm::sqrt(3.0 / 7.0 - root), libm::sqrt(3.0 / 7.0 + root));
    let root = libm::sqrt(30.0);
    let (wa, wb) = ((18.0 + root) / 36.0, (18.0 - root) / 36.0);
    let line = [(-b, wb), (-a, wa), (a, wa), (b, wb)].map(|(x, w)| (0.5 * (x + 1.0), 0.5 * w));
    let mut rule = Vec::new();
    for (u, wu) in line {
        for (v, wv) in line {
            for (w, ww) in line {
                let at = Vec3::new(u, v * (1.0 - u), w * (1.0 - u) * (1.0 - v));
                rule.push((at, wu * wv * ww * (1.0 - u) * (1.0 - u) * (1.0 - v)));
            }
        }
    }
    rule
}

/// Root mean square of the finite elements' error over the cube, relative to the root mean square of the solution.
fn error<const N: usize, const Q: usize, S: Shape<N, Q>>(
    n: u32,
    quadratic: bool,
) -> Result<f64, StudyError> {
    let mut mesh = solid_box([1.0; 3], [n; 3])?;
    for x in &mut mesh.positions {
        *x = x.add_scalar(0.5);
    }
    if quadratic {
        mesh = mesh.quadratic();
    }
    let material = solid_material(1.0, POISSON);
    let lame = Lame::new(material.young, material.poisson);
    // The shape functions and the weight at each point. The Jacobian of a tetrahedron is 6 times its volume, which is a
    // sixth of the grid cell.
    let jacobian = 1.0 / f64::from(n).powi(3);
    let rule: Vec<([f64; N], f64)> = fine_rule()
        .into_iter()
        .map(|(at, weight)| (S::values(&at), weight * jacobian))
        .collect();
    let mix = |cell: &[u32], values: &[f64; N], of: &[Vec3]| -> Vec3 {
        let pairs = cell.iter().zip(values);
        pairs
            .map(|(&vertex, value)| of[vertex as usize] * *value)
            .sum()
    };
    let mut forces = vec![Vec3::zeros(); mesh.positions.len()];
    for cell in mesh.cells.vertices() {
        for (values, weight) in &rule {
            let force = body_force(lame, &mix(cell, values, &mesh.positions));
            for (&vertex, value) in cell.iter().zip(values) {
                forces[vertex as usize] += force * (value * weight);
            }
        }
    }
    let mut body = Body::solid(&mesh, &[material], SolidLaw::Linear, weightless(), &[])?;
    let surface = |x: &Vec3| x.iter().any(|c| *c < 1e-9 || *c > 1.0 - 1e-9);
    body.add_support(&vertices(&mesh.positions, surface), [true; 3])?;
    body.set_external_forces(&forces)?;
    settle_linear(&mut body)?;
    let u = displacements(&body, &mesh.positions);
    let (mut error, mut whole) = (0.0, 0.0);
    for cell in mesh.cells.vertices() {
        for (values, weight) in &rule {
            let exact = DIRECTION * bump(&mix(cell, values, &mesh.positions));
            error += (mix(cell, values, &u) - exact).norm_squared() * weight;
            whole += exact.norm_squared() * weight;
        }
    }
    Ok(libm::sqrt(error / whole))
}
