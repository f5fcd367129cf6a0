//! What the kept lists do in prescribed motions.

use super::aim::Aim;
use super::motions::{MOVES, RADIUS, REACH, STEP, Scene, all};
use crate::{Level, StudyError};
use physics::contact::{Lists, Pair, Surfaces};
use std::collections::BTreeSet;

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
    // The motions, the numbers of triangles and of pairs within reach, and the count are those of the prototype.
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

/// The mean number of pairs that a step checks or puts into lists, after the first one.
fn pairs_a_step(scene: &Scene) -> f64 {
    const STEPS: u32 = 24;
    let mut lists = Lists::new(&scene.surfaces, &scene.at(0.0));
    let mut sum = 0;
    for step in 0..=STEPS {
        let x = scene.at(f64::from(step) * STEP);
        lists.follow(&scene.surfaces, &x, |_, _| MOVES);
        let counts = lists.counts();
        sum += if step > 0 {
            counts.checked + counts.listed
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
