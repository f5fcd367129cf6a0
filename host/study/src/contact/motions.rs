//! Motions of surfaces near each other, prescribed as functions of time, and what the kept lists do in them.

use super::aim::Aim;
use super::world::sheet_mesh;
use crate::{Level, StudyError};
use physics::Vec3;
use physics::contact::{Lists, Moves, Pair, Skin, Surfaces};
use physics::mesh::{Mesh, TriMesh};
use std::collections::BTreeSet;

/// What each cluster may move in a step (m), beside the radius. With the radii, 1 mm.
pub(super) const REACH: f64 = 0.25e-3;
/// Clusters that look as far.
pub(super) const MOVES: Moves = Moves {
    mean: Vec3::new(0.0, 0.0, 0.0),
    around: (REACH - 0.1 * RADIUS) / 2.3,
    most: 0.0,
};
/// Half the thickness of a surface (m).
const RADIUS: f64 = 0.25e-3;
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
        Scene::new("rigid turn", tubes(cells)?, |_, x, t| turned(x, t))?,
        Scene::new("torsion", tubes(cells)?, |is_outer, x, t| {
            let wave = 0.3e-3 * libm::sin(60.0 * x.z + 9.0 * t);
            let out = Vec3::new(x.x, x.y, 0.0).normalize();
            let x = if is_outer { x + out * wave } else { *x };
            turned(&x, t * x.z / 0.3)
        })?,
        Scene::new("jump", tubes(cells)?, |is_outer, x, t| {
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
        Scene::new(
            "poke",
            vec![
                flat([0.2, 0.2], [cells, cells], 0.0)?,
                flat([0.2, 0.2], [cells, cells], 6e-3)?,
            ],
            |is_upper, x, t| {
                let bump = libm::exp(-(x.x * x.x + x.y * x.y) / (2.0 * 0.012 * 0.012));
                let deep = if is_upper { 0.3 * t * bump } else { 0.0 };
                x - Vec3::z() * deep
            },
        )?,
    ])
}

fn flat(size: [f64; 2], cells: [u32; 2], z: f64) -> Result<TriMesh, StudyError> {
    sheet_mesh(size, cells, |x| x + Vec3::z() * z)
}

/// A body with a garment: two sheets that are wound about the z axis, 1 mm apart.
fn tubes(cells: u32) -> Result<Vec<TriMesh>, StudyError> {
    let layers = [(0.05, 0.0), (0.051, 0.3)];
    let each = layers.map(|(radius, shift)| {
        sheet_mesh([1.0, 0.3], [cells, cells], |x| {
            turned(&Vec3::new(radius, 0.0, x.y), 6.2 * x.x + shift)
        })
    });
    each.into_iter().collect()
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

/// Measures the lists.
pub(super) fn run(level: Level, aims: &mut Vec<Aim>) -> Result<(), StudyError> {
    for speed in [1.0, 10.0] {
        let scene = &all(level.choose(12, 29))?[0];
        let mut lists = Lists::new(&scene.surfaces, &scene.at(0.0));
        lists.follow(&scene.surfaces, &scene.at(0.0), |_, _| MOVES);
        let mut searched = 0;
        for step in 1..=400 {
            let x = scene.at(speed * f64::from(step) * STEP);
            lists.follow(&scene.surfaces, &x, |_, _| MOVES);
            searched += lists.counts().searched;
        }
        let name = format!("searches in 400 steps of a rigid rotation at {speed} rad/s");
        aims.push(Aim::at_most(name, "", searched as f64, 0.0));
    }
    let mut missed = 0;
    for scene in all(level.choose(7, 14))? {
        missed += misses(&scene);
    }
    let name = "pairs that the lists miss in five motions, against all pairs";
    aims.push(Aim::at_most(name, "", missed as f64, 0.0));
    // The measure of the prototype: 3,364 and 2,704 triangles.
    for (name, cells, most) in [
        ("torsion", 29, 7000.0),
        ("jump", 29, 9500.0),
        ("poke", 26, 100.0),
    ] {
        let scenes = all(cells)?;
        for scene in scenes.iter().filter(|scene| scene.name == name) {
            let triangles = scene.surfaces.triangles.len();
            let name = format!("pairs a step, {name} of {triangles} triangles");
            aims.push(Aim::at_most(name, "", pairs_a_step(scene), most));
        }
    }
    Ok(())
}

/// The mean number of distances that a step computes, after the first one.
fn pairs_a_step(scene: &Scene) -> f64 {
    const STEPS: u32 = 24;
    let mut lists = Lists::new(&scene.surfaces, &scene.at(0.0));
    let mut sum = 0;
    for step in 0..=STEPS {
        let x = scene.at(f64::from(step) * STEP);
        lists.follow(&scene.surfaces, &x, |_, _| MOVES);
        let counts = lists.counts();
        sum += if step > 0 {
            counts.checked + counts.relisted
        } else {
            0
        };
    }
    sum as f64 / f64::from(STEPS)
}

/// The number of pairs within reach that the lists do not give, over 24 steps.
fn misses(scene: &Scene) -> usize {
    let surfaces = &scene.surfaces;
    let mut lists = Lists::new(surfaces, &scene.at(0.0));
    let pairs = pairs_of(surfaces);
    let each = (0..24_u32).map(|step| {
        let x = scene.at(f64::from(step) * STEP);
        lists.follow(surfaces, &x, |_, _| MOVES);
        let mut listed = BTreeSet::new();
        lists.each(surfaces, &x, &mut |pair| {
            listed.insert(match pair {
                Pair::EdgeEdge(a, b) => Pair::EdgeEdge(a.min(b), a.max(b)),
                pair @ Pair::VertexTriangle(..) => pair,
            });
        });
        let need = 2.0 * (RADIUS + REACH);
        let is_near = |pair: &Pair| pair.foot(surfaces, &x).apart.norm() <= need;
        pairs
            .iter()
            .filter(|pair| !listed.contains(pair) && is_near(pair))
            .count()
    });
    each.sum()
}

/// All pairs that may touch.
fn pairs_of(surfaces: &Surfaces) -> Vec<Pair> {
    let vertices = surfaces.parts.iter().flat_map(|part| part.vertices.clone());
    let edges = (0_u32..).zip(&surfaces.edges).map(|(edge, _)| edge);
    let mut pairs = Vec::new();
    for (triangle, _) in (0..).zip(&surfaces.triangles) {
        pairs.extend(
            vertices
                .clone()
                .map(|vertex| Pair::VertexTriangle(vertex, triangle)),
        );
    }
    for edge in edges.clone() {
        let later = edges.clone().filter(|other| *other > edge);
        pairs.extend(later.map(|other| Pair::EdgeEdge(edge, other)));
    }
    pairs.retain(|pair| {
        let vertices = pair.vertices(surfaces);
        let parts = [vertices[0], vertices[3]].map(|vertex| surfaces.part_of(vertex));
        surfaces.may_touch(parts[0], parts[1]) && !pair.is_joined(surfaces)
    });
    pairs
}
