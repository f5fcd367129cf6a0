//! Measures of when two clusters have to be searched again: that of the kept lists, and those of the thesis beside it.
//!
//! A search of two clusters finds their pairs up to `need + threshold`. The clusters are searched again if their measure
//! exceeds the threshold. A pair is **missed** if it is nearer than `need`, but was farther than `need + threshold` at the
//! last search of its clusters.
//!
//! - `bound`: the largest departures of both clusters from the rigid motion of their union since the search. This measure
//!   bounds the change of every distance, so it misses nothing. The lists use it with thresholds that follow the costs.
//! - `thesis`: equations 4.1 to 4.4. The differences of the mean displacements of both clusters are summed as vectors over
//!   the steps, their standard deviations as numbers. A few vertices of a cluster may move farther than both say.
//! - `absolute`: the measure that the thesis compares with. It sums the mean displacements of both clusters, whatever their
//!   difference is.

use super::aim::Aim;
use super::motions::{self, MOVES, RADIUS, REACH, STEP, Scene};
use crate::{Level, StudyError};
use nalgebra::UnitQuaternion;
use physics::Vec3;
use physics::contact::aabb::Aabb;
use physics::contact::rigid::departure;
use physics::contact::{Hierarchy, Lists, Pair, Surfaces};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// The distance up to which every pair has to be found (m).
const NEED: f64 = 2.0 * (RADIUS + REACH);
/// The thresholds (m): one and five thicknesses.
const THRESHOLDS: [f64; 2] = [2.0 * RADIUS, 10.0 * RADIUS];
/// Steps of a motion.
const STEPS: usize = 24;

/// What a measure costs and misses in a motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// The motion.
    pub scene: &'static str,
    /// Triangles of all surfaces.
    pub triangles: usize,
    /// `lists`, `bound`, `thesis` or `absolute`.
    pub measure: &'static str,
    /// The threshold (m); `null` for the lists, which choose one for each pair of clusters.
    pub threshold: Option<f64>,
    /// Mean number of pairs of clusters that a step searches, after the first step.
    pub searches: f64,
    /// Pairs nearer than what is needed, over all steps.
    pub near: usize,
    /// Those that are missed.
    pub missed: usize,
    /// By how much the worst of them is nearer than what is needed (m).
    pub deepest: f64,
}

/// The measures with thresholds.
#[derive(Clone, Copy, Debug)]
enum Measure {
    Bound,
    Thesis,
    Absolute,
}

impl Measure {
    const ALL: [Self; 3] = [Self::Bound, Self::Thesis, Self::Absolute];

    fn name(self) -> &'static str {
        match self {
            Self::Bound => "bound",
            Self::Thesis => "thesis",
            Self::Absolute => "absolute",
        }
    }
}

/// A pair that is nearer than what is needed.
struct Near {
    clusters: [usize; 2],
    pair: Pair,
    distance: f64,
}

/// A motion as positions, and the pairs that have to be found in each step.
struct Motion {
    surfaces: Surfaces,
    hierarchy: Hierarchy,
    x: Vec<Vec<Vec3>>,
    near: Vec<Vec<Near>>,
}

/// The displacement of a cluster in a step (m): mean and standard deviation.
#[derive(Clone, Copy)]
struct Moved {
    mean: Vec3,
    deviation: f64,
}

/// Two clusters since their last search.
struct Watch {
    /// The step of the search, and the last one in which the clusters were near each other.
    searched: usize,
    seen: usize,
    sum: Vec3,
    length: f64,
    deviation: f64,
    rotation: UnitQuaternion<f64>,
}

/// Measures the measures.
pub(super) fn run(level: Level, aims: &mut Vec<Aim>) -> Result<Vec<Measured>, StudyError> {
    let mut rows = Vec::new();
    // The meshes of the prototype.
    let meshes: &[(&str, u32)] = &[
        ("deep poke", 26),
        ("rigid turn", 29),
        ("torsion", 29),
        ("jump", 29),
        ("fold", 29),
    ];
    for (name, cells) in level.take(meshes, 1) {
        let scenes = motions::all(*cells)?;
        for scene in scenes.into_iter().filter(|scene| scene.name == *name) {
            of_scene(scene, &mut rows);
        }
    }
    let missed = |measures: &[&str], scenes: &dyn Fn(&str) -> bool| {
        let rows = rows.iter().filter(|row| measures.contains(&row.measure));
        let rows = rows.filter(|row| scenes(row.scene));
        rows.map(|row| row.missed).sum::<usize>() as f64
    };
    let name = "pairs that the lists and their measure miss in the motions of the measures";
    aims.push(Aim::at_most(
        name,
        "",
        missed(&["lists", "bound"], &|_| true),
        0.0,
    ));
    // A count that sees no miss here would see none anywhere.
    let name = "pairs that the measure of the thesis misses in a deep poke";
    aims.push(Aim::at_least(
        name,
        "",
        missed(&["thesis"], &|scene| scene == "deep poke"),
        1.0,
    ));
    Ok(rows)
}

fn of_scene(scene: Scene, rows: &mut Vec<Measured>) {
    let (name, triangles) = (scene.name, scene.surfaces.triangles.len());
    let motion = Motion::new(scene);
    let near = motion.near.iter().map(Vec::len).sum();
    let mut push = |measure, threshold, found: Found| {
        rows.push(Measured {
            scene: name,
            triangles,
            measure,
            threshold,
            searches: found.searches as f64 / (STEPS - 1) as f64,
            near,
            missed: found.missed,
            deepest: found.deepest,
        });
    };
    push("lists", None, motion.by_lists());
    for threshold in THRESHOLDS {
        for measure in Measure::ALL {
            push(
                measure.name(),
                Some(threshold),
                motion.by(measure, threshold),
            );
        }
    }
}

/// What a measure did.
#[derive(Default)]
struct Found {
    searches: usize,
    missed: usize,
    deepest: f64,
}

impl Found {
    fn miss(&mut self, distance: f64) {
        self.missed += 1;
        self.deepest = self.deepest.max(NEED - distance);
    }
}

impl Motion {
    fn new(scene: Scene) -> Self {
        let x: Vec<Vec<Vec3>> = (0..STEPS)
            .map(|step| scene.at(step as f64 * STEP))
            .collect();
        let hierarchy = Hierarchy::new(&scene.surfaces, &x[0]);
        let things = Things::new(&scene.surfaces, &hierarchy);
        let near = x.iter();
        let near = near
            .map(|x| things.near(&scene.surfaces, &hierarchy, x))
            .collect();
        Self {
            near,
            x,
            hierarchy,
            surfaces: scene.surfaces,
        }
    }

    /// What the kept lists do.
    fn by_lists(&self) -> Found {
        let mut found = Found::default();
        let mut lists = Lists::new(&self.surfaces, &self.x[0]);
        for (step, (x, near)) in self.x.iter().zip(&self.near).enumerate() {
            lists.follow(&self.surfaces, x, |_, _| MOVES);
            if step > 0 {
                found.searches += lists.counts().searched;
            }
            let mut listed = BTreeSet::new();
            lists.each(&self.surfaces, x, &mut |pair| {
                listed.insert(in_order(pair));
            });
            for near in near.iter().filter(|near| !listed.contains(&near.pair)) {
                found.miss(near.distance);
            }
        }
        found
    }

    /// What searches by a measure and a threshold (m) do.
    fn by(&self, measure: Measure, threshold: f64) -> Found {
        let mut found = Found::default();
        let mut watches: BTreeMap<[usize; 2], Watch> = BTreeMap::new();
        for (step, x) in self.x.iter().enumerate() {
            let moved = self.moved(step);
            for clusters in self.clusters_within(x, NEED + threshold) {
                let watch = watches.entry(clusters).or_insert_with(|| Watch::new(step));
                if watch.seen + 1 < step {
                    *watch = Watch::new(step);
                }
                watch.seen = step;
                if watch.searched != step {
                    watch.add(clusters.map(|cluster| moved[cluster]));
                    if self.measured(measure, clusters, watch, x) > threshold {
                        *watch = Watch::new(step);
                    }
                }
                found.searches += usize::from(watch.searched == step && step > 0);
            }
            for near in &self.near[step] {
                let before = &self.x[watches[&near.clusters].searched];
                let distance = near.pair.foot(&self.surfaces, before).apart.norm();
                // A pair at this distance is within the list but for rounding.
                if distance > NEED + threshold + 1e-12 {
                    found.miss(near.distance);
                }
            }
        }
        found
    }

    fn measured(&self, measure: Measure, [a, b]: [usize; 2], watch: &mut Watch, x: &[Vec3]) -> f64 {
        match measure {
            Measure::Thesis => watch.sum.norm() + watch.deviation,
            Measure::Absolute => watch.length + watch.deviation,
            Measure::Bound => {
                let first = self.hierarchy.members(a);
                let second = if a == b {
                    &[]
                } else {
                    self.hierarchy.members(b)
                };
                let both: Vec<u32> = first.iter().chain(second).copied().collect();
                let before = &self.x[watch.searched];
                let before: Vec<Vec3> =
                    both.iter().map(|vertex| before[*vertex as usize]).collect();
                let after = |i: usize| x[both[i] as usize];
                let [one, other] = departure(&before, after, first.len(), &mut watch.rotation);
                if a == b { 2.0 * one } else { one + other }
            }
        }
    }

    /// How each cluster moves in a step.
    fn moved(&self, step: usize) -> Vec<Moved> {
        let (before, after) = (&self.x[step.saturating_sub(1)], &self.x[step]);
        let of = |vertex: &u32| after[*vertex as usize] - before[*vertex as usize];
        let each = 0..self.hierarchy.clusters().len();
        each.map(|cluster| {
            let members = self.hierarchy.members(cluster);
            let mean = members.iter().map(of).sum::<Vec3>() / members.len() as f64;
            let squares = members
                .iter()
                .map(|vertex| (of(vertex) - mean).norm_squared());
            let deviation = libm::sqrt(squares.sum::<f64>() / members.len() as f64);
            Moved { mean, deviation }
        })
        .collect()
    }

    fn clusters_within(&self, x: &[Vec3], distance: f64) -> Vec<[usize; 2]> {
        clusters_within(&self.surfaces, &self.hierarchy, x, distance)
    }
}

impl Watch {
    fn new(step: usize) -> Self {
        Self {
            searched: step,
            seen: step,
            sum: Vec3::zeros(),
            length: 0.0,
            deviation: 0.0,
            rotation: UnitQuaternion::identity(),
        }
    }

    fn add(&mut self, [a, b]: [Moved; 2]) {
        self.sum += a.mean - b.mean;
        self.length += a.mean.norm() + b.mean.norm();
        self.deviation += a.deviation + b.deviation;
    }
}

/// The pairs of clusters whose boxes are as near as `distance` (m).
fn clusters_within(
    surfaces: &Surfaces,
    hierarchy: &Hierarchy,
    x: &[Vec3],
    distance: f64,
) -> Vec<[usize; 2]> {
    let clusters = hierarchy.clusters();
    let bounds: Vec<Aabb> = (0..clusters.len())
        .map(|cluster| bounds(hierarchy.members(cluster), x))
        .collect();
    let mut near = Vec::new();
    for (a, one) in clusters.iter().enumerate() {
        for (b, other) in clusters.iter().enumerate().skip(a) {
            if surfaces.may_touch(one.part, other.part) && bounds[a].is_within(&bounds[b], distance)
            {
                near.push([a, b]);
            }
        }
    }
    near
}

fn bounds(vertices: &[u32], x: &[Vec3]) -> Aabb {
    Aabb::of(vertices.iter().map(|vertex| &x[*vertex as usize]))
}

/// The things of each cluster: each thing is of the first cluster that has all its vertices.
struct Things(Vec<[Vec<u32>; 3]>);

impl Things {
    fn new(surfaces: &Surfaces, hierarchy: &Hierarchy) -> Self {
        let mut is_homeless = [
            surfaces.vertices,
            surfaces.triangles.len(),
            surfaces.edges.len(),
        ]
        .map(|count| vec![true; count]);
        let each = 0..hierarchy.clusters().len();
        let each = each.map(|cluster| {
            let members: BTreeSet<u32> = hierarchy.members(cluster).iter().copied().collect();
            let has = |vertices: &[u32]| vertices.iter().all(|vertex| members.contains(vertex));
            let own: [Vec<bool>; 3] = [
                (0..surfaces.vertices as u32)
                    .map(|vertex| has(&[vertex]))
                    .collect(),
                surfaces
                    .triangles
                    .iter()
                    .map(|corners| has(corners))
                    .collect(),
                surfaces.edges.iter().map(|ends| has(ends)).collect(),
            ];
            core::array::from_fn(|kind| {
                let homeless = is_homeless[kind].iter_mut().zip(&own[kind]);
                (0_u32..)
                    .zip(homeless)
                    .filter_map(|(thing, (is_homeless, is_own))| {
                        (*is_own && core::mem::take(is_homeless)).then_some(thing)
                    })
                    .collect()
            })
        });
        Self(each.collect())
    }

    /// The pairs nearer than what is needed at the positions `x` (m), by comparing all things of clusters near each other.
    fn near(&self, surfaces: &Surfaces, hierarchy: &Hierarchy, x: &[Vec3]) -> Vec<Near> {
        let mut near = Vec::new();
        for clusters in clusters_within(surfaces, hierarchy, x, NEED) {
            let [a, b] = clusters;
            let mut try_pair = |pair: Pair| {
                let vertices = pair.vertices(surfaces);
                let (one, other) = vertices.split_at(pair.split());
                if pair.is_joined(surfaces) || !bounds(one, x).is_within(&bounds(other, x), NEED) {
                    return;
                }
                let distance = pair.foot(surfaces, x).apart.norm();
                if distance <= NEED {
                    near.push(Near {
                        clusters,
                        pair,
                        distance,
                    });
                }
            };
            let both = [[a, b], [b, a]];
            let sides = if a == b { &both[..1] } else { &both[..] };
            for [one, other] in sides {
                for vertex in &self.0[*one][0] {
                    for triangle in &self.0[*other][1] {
                        try_pair(Pair::VertexTriangle(*vertex, *triangle));
                    }
                }
            }
            for one in &self.0[a][2] {
                for other in self.0[b][2].iter().filter(|other| a != b || *other > one) {
                    try_pair(in_order(Pair::EdgeEdge(*one, *other)));
                }
            }
        }
        near
    }
}

/// A pair of edges with the smaller number first.
fn in_order(pair: Pair) -> Pair {
    match pair {
        Pair::EdgeEdge(a, b) => Pair::EdgeEdge(a.min(b), a.max(b)),
        pair @ Pair::VertexTriangle(..) => pair,
    }
}
