//! Motions of surfaces near each other, prescribed as functions of time.

use physics::Vec3;
use physics::contact::{Skin, Surfaces};
use physics::mesh::generate::{self, Pattern};
use physics::mesh::{Mesh, TriMesh};

/// Surfaces and where their vertices are at a time (s).
pub(crate) struct Scene {
    pub name: &'static str,
    pub surfaces: Surfaces,
    pub at: Box<dyn Fn(f64) -> Vec<Vec3>>,
}

/// A sheet of `length` by `width` (m) about the origin.
fn sheet(length: f64, width: f64, cells: [u32; 2]) -> TriMesh {
    generate::sheet(length, width, cells[0], cells[1], Pattern::Alternating).unwrap()
}

fn skin(touches_itself: bool) -> Skin {
    Skin {
        radius: 0.25e-3,
        touches_itself,
        is_obstacle: false,
    }
}

/// The surfaces of `meshes`, and their vertices.
fn joined(meshes: Vec<TriMesh>, touches_itself: bool) -> (Surfaces, Vec<Vec3>) {
    let mut surfaces = Surfaces::default();
    let mut vertices = Vec::new();
    for mesh in meshes {
        vertices.extend_from_slice(&mesh.positions);
        surfaces
            .add(&Mesh::Sheet(mesh), skin(touches_itself))
            .unwrap();
    }
    (surfaces, vertices)
}

/// A body with a garment: two sheets that are wound about the z axis, 1 mm apart.
fn tubes(cells: [u32; 2]) -> (Surfaces, Vec<Vec3>) {
    let (radius, height) = (0.05, 0.3);
    let mut meshes = Vec::new();
    for (layer, shift) in [(0.0, 0.0), (1e-3, 0.3)] {
        let mut mesh = sheet(1.0, height, cells);
        for x in &mut mesh.positions {
            let angle = 6.2 * x.x + shift;
            let r = radius + layer;
            *x = Vec3::new(r * angle.cos(), r * angle.sin(), x.y);
        }
        meshes.push(mesh);
    }
    joined(meshes, false)
}

fn turned(x: &Vec3, angle: f64) -> Vec3 {
    let (sin, cos) = angle.sin_cos();
    Vec3::new(cos * x.x - sin * x.y, sin * x.x + cos * x.y, x.z)
}

/// The motions, with `cells` along each side of a sheet.
pub(crate) fn all(cells: u32) -> Vec<Scene> {
    let (surfaces, tube) = tubes([cells, cells]);
    let mut scenes = Vec::new();
    let moving = |name: &'static str, to: fn(usize, usize, &Vec3, f64) -> Vec3| {
        let (tube, half) = (tube.clone(), tube.len() / 2);
        Scene {
            name,
            surfaces: surfaces.clone(),
            at: Box::new(move |t| {
                let moved = tube.iter().enumerate();
                moved.map(|(i, x)| to(i, half, x, t)).collect()
            }),
        }
    };
    scenes.push(moving("rigid turn", |_, _, x, t| turned(x, t)));
    scenes.push(moving("torsion", |i, half, x, t| {
        let wave = 0.3e-3 * (60.0 * x.z + 9.0 * t).sin();
        let out = Vec3::new(x.x, x.y, 0.0).normalize();
        let x = if i >= half { x + out * wave } else { *x };
        turned(&x, t * x.z / 0.3)
    }));
    scenes.push(moving("jump", |i, half, x, t| {
        let height = 0.3 * (6.0 * t).sin();
        let lag = if i >= half {
            8e-3 * (20.0 * t).sin()
        } else {
            0.0
        };
        x + Vec3::z() * (height + lag)
    }));
    scenes.push(fold(cells));
    scenes.push(poke(cells));
    scenes
}

/// A sheet that is rolled upon itself: a half circle of 0.4 mm moves along it.
fn fold(cells: u32) -> Scene {
    let (surfaces, flat) = joined(vec![sheet(0.2, 0.1, [2 * cells, cells])], true);
    let at = move |t: f64| {
        let (radius, front) = (0.4e-3, 0.08 - 0.2 * t);
        let rolled = |x: &Vec3| {
            let beyond = x.x - front;
            let arc = std::f64::consts::PI * radius;
            if beyond < 0.0 {
                *x
            } else if beyond < arc {
                let angle = beyond / radius;
                Vec3::new(
                    front + radius * angle.sin(),
                    x.y,
                    radius * (1.0 - angle.cos()),
                )
            } else {
                Vec3::new(front - (beyond - arc), x.y, 2.0 * radius)
            }
        };
        flat.iter().map(rolled).collect()
    };
    Scene {
        name: "fold",
        surfaces,
        at: Box::new(at),
    }
}

/// Two sheets 6 mm apart. A hand pushes a bump of the upper one down at 0.3 m/s.
fn poke(cells: u32) -> Scene {
    let mut upper = sheet(0.2, 0.2, [cells, cells]);
    upper.positions.iter_mut().for_each(|x| x.z = 6e-3);
    let (surfaces, flat) = joined(vec![sheet(0.2, 0.2, [cells, cells]), upper], false);
    let at = move |t: f64| {
        let half = flat.len() / 2;
        let moved = flat.iter().enumerate().map(|(i, x)| {
            let bump = (-(x.x * x.x + x.y * x.y) / (2.0 * 0.012 * 0.012)).exp();
            let deep = if i >= half { 0.3 * t * bump } else { 0.0 };
            x - Vec3::z() * deep
        });
        moved.collect()
    };
    Scene {
        name: "poke",
        surfaces,
        at: Box::new(at),
    }
}
