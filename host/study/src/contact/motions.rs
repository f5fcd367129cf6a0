//! Motions of surfaces near each other, prescribed as functions of time.
//!
//! `tests/detection` includes this file, which therefore needs only the physics and the error of its parent.

use super::StudyError;
use physics::Vec3;
use physics::contact::{Moves, Skin, Surfaces};
use physics::mesh::generate::{Pattern, SheetError, sheet};
use physics::mesh::{Mesh, TriMesh};

/// What each cluster may move in a step (m), beside the radius. With the radii, 1 mm.
pub(super) const REACH: f64 = 0.25e-3;
/// Clusters that look as far.
pub(super) const MOVES: Moves = Moves {
    mean: Vec3::new(0.0, 0.0, 0.0),
    around: (REACH - 0.1 * RADIUS) / 2.3,
    most: 0.0,
};
/// Half the thickness of a surface (m).
pub(super) const RADIUS: f64 = 0.25e-3;
/// Time of a step (s).
pub(super) const STEP: f64 = 4e-3;

/// Surfaces, and where their vertices are at a time (s).
pub(super) struct Scene {
    /// The name in tables.
    pub(super) name: &'static str,
    /// The surfaces of two sheets, or of one that touches itself.
    pub(super) surfaces: Surfaces,
    start: Vec<Vec3>,
    to: fn(bool, &Vec3, f64) -> Vec3,
}

impl Scene {
    fn new(
        name: &'static str,
        meshes: Vec<TriMesh>,
        to: fn(bool, &Vec3, f64) -> Vec3,
    ) -> Result<Self, StudyError> {
        let mut surfaces = Surfaces::default();
        let mut start = Vec::new();
        let skin = Skin {
            radius: RADIUS,
            touches_itself: meshes.len() == 1,
            is_obstacle: false,
        };
        for mesh in meshes {
            start.extend_from_slice(&mesh.positions);
            surfaces.add(&Mesh::Sheet(mesh), skin)?;
        }
        Ok(Self {
            name,
            surfaces,
            start,
            to,
        })
    }

    /// The positions (m) at a time (s).
    pub(super) fn at(&self, t: f64) -> Vec<Vec3> {
        let half = self.start.len() / 2;
        let each = self.start.iter().enumerate();
        each.map(|(i, x)| (self.to)(i >= half, x, t)).collect()
    }
}

/// The motions, with `cells` along each side of a sheet: 4 times the square of `cells` triangles.
pub(super) fn all(cells: u32) -> Result<Vec<Scene>, StudyError> {
    Ok(vec![
        Scene::new("rigid turn", tubes(cells, 1e-3)?, |_, x, t| turned(x, t))?,
        Scene::new("torsion", tubes(cells, 1.4e-3)?, |is_outer, x, t| {
            let wave = 0.3e-3 * libm::sin(60.0 * x.z + 9.0 * t);
            let out = Vec3::new(x.x, x.y, 0.0).normalize();
            let x = if is_outer { x + out * wave } else { *x };
            turned(&x, t * x.z / 0.3)
        })?,
        Scene::new("jump", tubes(cells, 1.1e-3)?, |is_outer, x, t| {
            let lag = if is_outer {
                8e-3 * libm::sin(20.0 * t)
            } else {
                0.0
            };
            x + Vec3::z() * (0.3 * libm::sin(6.0 * t) + lag)
        })?,
        Scene::new(
            "fold",
            vec![flat([0.2, 0.1], [2 * cells, cells], 0.0)?],
            fold,
        )?,
        poke("poke", 22e-3, cells)?,
        poke("deep poke", 6e-3, cells)?,
    ])
}

/// A hand pushes a bump of the upper one of two sheets, with a `gap` (m) between them, down at 0.3 m/s.
fn poke(name: &'static str, gap: f64, cells: u32) -> Result<Scene, StudyError> {
    let sheets = [0.0, gap].map(|z| flat([0.2, 0.2], [cells, cells], z));
    let sheets = sheets.into_iter().collect::<Result<_, _>>()?;
    Scene::new(name, sheets, |is_upper, x, t| {
        let bump = libm::exp(-(x.x * x.x + x.y * x.y) / (2.0 * 0.012 * 0.012));
        let deep = if is_upper { 0.3 * t * bump } else { 0.0 };
        x - Vec3::z() * deep
    })
}

fn flat(size: [f64; 2], cells: [u32; 2], z: f64) -> Result<TriMesh, SheetError> {
    put(size, cells, |x| x + Vec3::z() * z)
}

/// A body with a garment: two sheets that are wound about the z axis, with a `gap` (m) between them.
fn tubes(cells: u32, gap: f64) -> Result<Vec<TriMesh>, SheetError> {
    let layers = [(0.05, 0.0), (0.05 + gap, 0.3)];
    let each = layers.map(|(radius, shift)| {
        put([1.0, 0.3], [cells, cells], |x| {
            turned(&Vec3::new(radius, 0.0, x.y), 6.2 * x.x + shift)
        })
    });
    each.into_iter().collect()
}

/// A sheet with its vertices at the places of `to`.
fn put(size: [f64; 2], cells: [u32; 2], to: impl Fn(&Vec3) -> Vec3) -> Result<TriMesh, SheetError> {
    let mut mesh = sheet(size[0], size[1], cells[0], cells[1], Pattern::Alternating)?;
    mesh.positions.iter_mut().for_each(|x| *x = to(x));
    Ok(mesh)
}

/// Turns a point about the z axis.
fn turned(x: &Vec3, angle: f64) -> Vec3 {
    let (sin, cos) = libm::sincos(angle);
    Vec3::new(cos * x.x - sin * x.y, sin * x.x + cos * x.y, x.z)
}

/// A sheet is rolled upon itself: a half circle of 0.4 mm moves along it.
fn fold(_: bool, x: &Vec3, t: f64) -> Vec3 {
    let (radius, front) = (0.4e-3, 0.08 - 0.2 * t);
    let arc = std::f64::consts::PI * radius;
    let beyond = x.x - front;
    if beyond < 0.0 {
        *x
    } else if beyond < arc {
        let (sin, cos) = libm::sincos(beyond / radius);
        Vec3::new(front + radius * sin, x.y, radius * (1.0 - cos))
    } else {
        Vec3::new(front - (beyond - arc), x.y, 2.0 * radius)
    }
}
