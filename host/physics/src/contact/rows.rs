//! The rows of a step: from pairs and shapes that are near to laws of contacts.
//!
//! Foot, normal and distance are those at the predicted end of the step, `x + u*`: a normal at the start is late by a step.
//! Two surfaces have no inside, so that a prediction that has crossed would turn the normal over. The predicted foot counts
//! only if the normal at the start still separates the pair there; else foot and normal are those at the start. With the
//! displacement `J u*` of the feet, the gap of the row is `g(u) = d - theta + n . (J u - J u*)`.
//!
//! A row counts once for each pair of features. A vertex that is nearest to an edge or a corner of a triangle has a row only if
//! no listed triangle at that edge or corner is nearer. Two edges have one only if both feet lie inside them: all other
//! cases have a vertex and a triangle, but for segments of threads, which have no triangle.

pub use super::kept::{Kept, Key};
use super::kept::{NONE, Store};
use super::lists::Lists;
use super::pair::{Foot, Pair};
use super::row::{Response, Row, Stiffness, carried};
use super::shape::{Nearest, Shape};
use super::surface::Surfaces;
use crate::HandlePose;
use crate::Vec3;

/// A row lies within this fraction of the thickness, beyond the predicted motion.
const REACH: f64 = 0.1;
/// The reach of a row grows by this factor of the predicted motion.
const AHEAD: f64 = 1.3;
/// The least cosine between the normals at the start and at the predicted end.
const TURN: f64 = 0.5;
/// The squared sine below which two edges count as parallel.
const PARALLEL: f64 = 1e-6;
/// The speed at which sides part that overlap at the start (m/s).
const PARTING: f64 = 0.2;
/// The depth, as a fraction of the thickness, at which sides no longer count as parting.
const PARTED: f64 = 0.02;

/// How two sides touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// The distance at which they touch (m).
    pub thickness: f64,
    /// Coefficient of friction.
    pub friction: f64,
}

/// A shape in a step.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// The shape.
    pub shape: Shape,
    /// Its pose at the start and at the end of the step.
    pub poses: [HandlePose; 2],
}

impl Placed {
    /// The nearest point of the surface to `p` (m) at the start (0) or at the end (1).
    pub(crate) fn nearest(&self, p: &Vec3, when: usize) -> Nearest {
        let pose = &self.poses[when];
        let found = self
            .shape
            .nearest(&(pose.rotation.inverse() * (p - pose.position)));
        Nearest {
            normal: pose.rotation * found.normal,
            ..found
        }
    }

    /// The displacement over the step (m) of the material point that is at `p` at the end.
    pub(crate) fn motion(&self, p: &Vec3) -> Vec3 {
        let [start, end] = &self.poses;
        let own = end.rotation.inverse() * (p - end.position);
        p - (start.position + start.rotation * own)
    }
}

/// The state of a step: all vectors by vertex of the surfaces.
pub struct State<'a> {
    /// The surfaces.
    pub surfaces: &'a Surfaces,
    /// The shapes. They are sides after the parts.
    pub shapes: &'a [Placed],
    /// Positions at the start (m).
    pub x: &'a [Vec3],
    /// Predicted displacements over the step (m). Those of obstacles are exact.
    pub u: &'a [Vec3],
    /// Velocities (m/s).
    pub v: &'a [Vec3],
    /// Masses (kg); infinite if a vertex moves by no equation.
    pub mass: &'a [f64],
    /// Length of the step (s).
    pub h: f64,
    /// How two sides touch, if they do.
    pub meeting: &'a dyn Fn(usize, usize) -> Option<Meeting>,
}

/// A contact of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The vertices, of which those with a weight of zero have no meaning.
    pub vertices: [u32; 4],
    /// Their weights.
    pub weights: [f64; 4],
    /// The law.
    pub row: Row,
    /// The two sides: parts, and after them shapes.
    pub sides: [usize; 2],
    /// The distance at which the sides touch (m).
    pub thickness: f64,
    /// What the row keeps.
    pub kept: Kept,
    /// Whether the sides hit each other: a second update of the multiplier stops them.
    pub is_impact: bool,
}

/// What the rows of a step are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowReport {
    /// Number of rows.
    pub rows: usize,
    /// Rows without a place. The certificate still holds their sides apart.
    pub dropped: usize,
    /// Rows whose sides overlap since their birth.
    pub parting: usize,
    /// The energy (J) by which friction springs changed because their stiffness did.
    pub restiffened: f64,
}

/// A row before its law.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    features: Features,
    vertices: [u32; 4],
    weights: [f64; 4],
    normal: Vec3,
    /// Distance of the sides (m), at the place of the foot.
    distance: f64,
    /// The gap for no displacement (m).
    gap: f64,
    motion: Vec3,
    sides: [usize; 2],
    meeting: Meeting,
    /// Whether another row has the features.
    is_shadowed: bool,
}

impl Candidate {
    fn key(&self) -> Key {
        self.features.key
    }
}

/// The rows of a step, and what they keep.
#[derive(Debug)]
pub struct Rows {
    most: usize,
    candidates: Vec<Candidate>,
    contacts: Vec<Contact>,
    wanted: Vec<Kept>,
    is_found: Vec<bool>,
    store: Store,
    /// The vertices near shapes.
    near: Vec<u32>,
    report: RowReport,
}

impl Rows {
    /// Room for `most` rows.
    pub fn new(most: usize) -> Self {
        Self {
            most,
            candidates: Vec::with_capacity(4 * most),
            contacts: Vec::with_capacity(most),
            wanted: Vec::with_capacity(most),
            is_found: Vec::with_capacity(most),
            store: Store::with_capacity(most),
            near: Vec::with_capacity(4 * most),
            report: RowReport::default(),
        }
    }

    /// The rows of the step, in the order of their keys.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// What the rows of the step are.
    pub fn report(&self) -> RowReport {
        self.report
    }

    /// Makes the rows of a step from the pairs of `lists`, which follow the same step.
    pub fn begin(&mut self, step: &State<'_>, lists: &Lists) {
        self.candidates.clear();
        let candidates = &mut self.candidates;
        lists.each(step.surfaces, step.x, &mut |pair| {
            candidates.extend(of_pair(step, pair));
        });
        self.meet_shapes(step, lists);
        drop_shadowed(&mut self.candidates);
        // Of equal keys the nearest row stays.
        (self.candidates).sort_unstable_by(|a, b| {
            let nearer = a.distance.total_cmp(&b.distance);
            (a.key().cmp(&b.key()).then(nearer)).then(a.vertices.cmp(&b.vertices))
        });
        self.candidates.dedup_by_key(|row| row.key());
        self.report = RowReport::default();
        if self.candidates.len() > self.most {
            self.report.dropped = self.candidates.len() - self.most;
            let deepest =
                |a: &Candidate, b: &Candidate| a.gap.total_cmp(&b.gap).then(a.key().cmp(&b.key()));
            self.candidates.select_nth_unstable_by(self.most, deepest);
            self.candidates.truncate(self.most);
            self.candidates.sort_unstable_by_key(Candidate::key);
        }
        self.wanted.clear();
        self.wanted.extend(self.candidates.iter().map(|row| {
            let overlaps = row.distance < row.meeting.thickness;
            Kept::new(row.key(), row.normal, overlaps)
        }));
        self.store.recall(&mut self.wanted, &mut self.is_found);
        self.contacts.clear();
        for (row, kept) in self.candidates.iter().zip(&self.wanted) {
            let contact = law(step, row, *kept, &mut self.report.restiffened);
            self.report.parting += usize::from(contact.kept.is_parting);
            self.contacts.push(contact);
        }
        self.report.rows = self.contacts.len();
    }

    /// Adds the rows of vertices near shapes.
    fn meet_shapes(&mut self, step: &State<'_>, lists: &Lists) {
        let parts = step.surfaces.parts.len();
        for (number, placed) in step.shapes.iter().enumerate() {
            self.near.clear();
            for (index, cluster) in lists.hierarchy().clusters().iter().enumerate() {
                let Some(meeting) = (step.meeting)(cluster.part, parts + number) else {
                    continue;
                };
                // No vertex of the cluster is nearer than its centre less its extent.
                let members = lists.hierarchy().members(index);
                let moved = members.iter().map(|vertex| {
                    let vertex = *vertex as usize;
                    (step.u[vertex] - placed.motion(&step.x[vertex])).norm()
                });
                let moved = moved.fold(0.0, f64::max);
                let reach = meeting.thickness * (1.0 + REACH) + (1.0 + AHEAD) * moved;
                if placed.nearest(&cluster.centre, 0).distance <= cluster.extent + reach {
                    self.near.extend_from_slice(members);
                }
            }
            self.near.sort_unstable();
            self.near.dedup();
            let near = self.near.iter();
            let rows = near.filter_map(|vertex| of_shape(step, *vertex, number));
            self.candidates.extend(rows);
        }
    }

    /// Keeps the responses of the rows at the end of the step, in the order of the rows, for the next step.
    pub fn end(&mut self, responses: impl Iterator<Item = Response>) {
        for ((contact, response), kept) in self.contacts.iter().zip(responses).zip(&mut self.wanted)
        {
            *kept = contact.kept;
            kept.take(&response, contact.row.friction_stiffness);
            kept.is_parting &= response.gap < -PARTED * contact.thickness;
        }
        self.store.keep(&self.wanted);
    }
}

/// The row of a pair, if the pair comes near.
fn of_pair(step: &State<'_>, pair: Pair) -> Option<Candidate> {
    let surfaces = step.surfaces;
    let (vertices, split) = (pair.vertices(surfaces), pair.split());
    let [first, second] = [vertices[0], vertices[split]].map(|vertex| surfaces.part_of(vertex));
    let meeting = (step.meeting)(first, second)?;
    let u = vertices.map(|vertex| step.u[vertex as usize]);
    let (ones, others) = u.split_at(split);
    let apart = ones
        .iter()
        .flat_map(|one| others.iter().map(move |other| (one - other).norm()));
    let moved = apart.fold(0.0, f64::max);
    let reach = meeting.thickness * (1.0 + REACH) + AHEAD * moved;
    let x = vertices.map(|vertex| step.x[vertex as usize]);
    let start = pair.foot_of(vertices, &x);
    let distance = start.apart.norm();
    if distance > reach + moved {
        return None;
    }
    let ends = [0, 1, 2, 3].map(|i| x[i] + u[i]);
    let end = pair.foot_of(vertices, &ends);
    let end_distance = end.apart.norm();
    let normals = [start.apart / distance, end.apart / end_distance];
    let is_predicted = normals[0].dot(&normals[1]) > TURN && {
        let along = |x: &Vec3| normals[0].dot(x);
        let (ones, others) = ends.split_at(split);
        let least = ones.iter().map(along).fold(f64::INFINITY, f64::min);
        let most = others.iter().map(along).fold(f64::NEG_INFINITY, f64::max);
        least > most
    };
    let (foot, distance, normal) = if is_predicted {
        (end, end_distance, normals[1])
    } else {
        (start, distance, normals[0])
    };
    if !(distance <= reach && normal.x.is_finite()) {
        return None;
    }
    let moved: Vec3 = (0..4).map(|i| u[i] * foot.weights[i]).sum();
    let ahead = if is_predicted {
        normal.dot(&moved)
    } else {
        0.0
    };
    let gap = distance - meeting.thickness - ahead;
    let features = Features::of(surfaces, pair, &foot, &x, [first, second])?;
    // The motion of obstacles is known: it is no unknown of the equation.
    let mut weights = foot.weights;
    let mut motion = Vec3::zeros();
    for (side, range) in [(first, 0..split), (second, split..4)] {
        if surfaces.parts[side].is_obstacle {
            for i in range {
                motion -= u[i] * weights[i];
                weights[i] = 0.0;
            }
        }
    }
    Some(Candidate {
        features,
        vertices,
        weights,
        normal,
        distance,
        gap,
        motion,
        sides: [first, second],
        meeting,
        is_shadowed: false,
    })
}

/// The features that touch.
#[derive(Clone, Copy, Debug)]
struct Features {
    key: Key,
    /// The vertices of the triangle with the foot, and those of the foot's feature; none of an edge pair or on a shape.
    triangle: [u32; 3],
    feature: [u32; 3],
}

impl Features {
    /// The features of a pair; `None` if another pair has the row.
    fn of(
        surfaces: &Surfaces,
        pair: Pair,
        foot: &Foot,
        x: &[Vec3; 4],
        sides: [usize; 2],
    ) -> Option<Self> {
        let [a, b, c, d] = foot.vertices;
        let named = |i: usize| {
            if foot.weights[i] == 0.0 {
                NONE
            } else {
                foot.vertices[i]
            }
        };
        if matches!(pair, Pair::VertexTriangle(..)) {
            let feature = [1, 2, 3].map(named);
            let mut corners = feature.into_iter().filter(|vertex| *vertex != NONE);
            let key = match (corners.next(), corners.next()) {
                (Some(corner), None) => Key::edges([a, NONE], [corner, NONE]),
                _ => Key::on(a, sides[1] as u32, feature),
            };
            return Some(Self {
                key,
                triangle: [b, c, d],
                feature,
            });
        }
        let is_inside = |i: usize| foot.weights[i] != 0.0 && foot.weights[i + 1] != 0.0;
        let is_segment = sides.map(|side| surfaces.parts[side].triangles.is_empty());
        if !(is_inside(0) || is_segment[1]) || !(is_inside(2) || is_segment[0]) {
            return None;
        }
        let (one, other) = (x[1] - x[0], x[3] - x[2]);
        let sine = one.cross(&other).norm_squared();
        let is_parallel = sine < PARALLEL * one.norm_squared() * other.norm_squared();
        if is_parallel && is_segment == [false; 2] {
            return None;
        }
        let ends = |i: usize| {
            let (from, to) = (named(i), named(i + 1));
            [from.min(to), from.max(to)]
        };
        Some(Self {
            key: Key::edges(ends(0), ends(2)),
            triangle: [NONE; 3],
            feature: [NONE; 3],
        })
    }

    /// Whether the triangle has all vertices of the feature of `other`, which is not a whole triangle.
    fn contains(&self, other: &Self) -> bool {
        let mut corners = other.feature.iter();
        corners.all(|vertex| *vertex == NONE || self.triangle.contains(vertex))
    }

    /// Whether the foot lies on an edge or a corner of its triangle.
    fn is_on_border(&self) -> bool {
        self.triangle[0] != NONE && self.feature.contains(&NONE)
    }
}

/// The row of a vertex at a shape, if the vertex comes near.
fn of_shape(step: &State<'_>, vertex: u32, number: usize) -> Option<Candidate> {
    let (at, placed) = (vertex as usize, &step.shapes[number]);
    let (part, side) = (
        step.surfaces.part_of(vertex),
        step.surfaces.parts.len() + number,
    );
    let meeting = (step.meeting)(part, side)?;
    let end = step.x[at] + step.u[at];
    let found = placed.nearest(&end, 1);
    let motion = placed.motion(&(end - found.normal * found.distance));
    let moved = step.u[at] - motion;
    if found.distance > meeting.thickness * (1.0 + REACH) + AHEAD * moved.norm() {
        return None;
    }
    Some(Candidate {
        features: Features {
            key: Key::on(vertex, side as u32, [NONE; 3]),
            triangle: [NONE; 3],
            feature: [NONE; 3],
        },
        vertices: [vertex; 4],
        weights: [1.0, 0.0, 0.0, 0.0],
        normal: found.normal,
        distance: found.distance,
        gap: found.distance - meeting.thickness - found.normal.dot(&moved),
        motion,
        sides: [part, side],
        meeting,
        is_shadowed: false,
    })
}

/// Drops vertices at an edge or a corner of a triangle, if a listed triangle at that edge or corner is nearer.
fn drop_shadowed(candidates: &mut Vec<Candidate>) {
    let of = |row: &Candidate| {
        (
            row.features.triangle[0] == NONE,
            row.vertices[0],
            row.sides[1],
        )
    };
    candidates.sort_unstable_by(|a, b| {
        let nearer = a.distance.total_cmp(&b.distance);
        of(a)
            .cmp(&of(b))
            .then(nearer)
            .then(a.vertices.cmp(&b.vertices))
    });
    let mut from = 0;
    while from < candidates.len() {
        let first = of(&candidates[from]);
        let rest = &mut candidates[from..];
        let same = rest.iter().take_while(|row| of(row) == first).count();
        if !first.0 {
            let (group, _) = rest.split_at_mut(same);
            for i in 1..group.len() {
                let (nearer, row) = group.split_at_mut(i);
                let row = &mut row[0];
                row.is_shadowed = row.features.is_on_border()
                    && nearer.iter().any(|other| {
                        other.distance < row.distance && other.features.contains(&row.features)
                    });
            }
        }
        from += same;
    }
    candidates.retain(|row| !row.is_shadowed);
}

/// The law of a row.
fn law(step: &State<'_>, row: &Candidate, mut kept: Kept, restiffened: &mut f64) -> Contact {
    let (mut compliance, mut opening) = (0.0, 0.0);
    for (vertex, weight) in row.vertices.into_iter().zip(row.weights) {
        if weight != 0.0 {
            compliance += weight * weight / step.mass[vertex as usize];
            opening += weight * row.normal.dot(&step.v[vertex as usize]);
        }
    }
    opening -= row.normal.dot(&row.motion) / step.h;
    let meeting = row.meeting;
    let stiffness = Stiffness {
        // A row between held vertices moves nothing; any finite mass serves.
        mass: if compliance > 0.0 {
            1.0 / compliance
        } else {
            0.0
        },
        step: step.h,
        thickness: meeting.thickness,
        approach: -opening,
        force: kept.forces[0].max(kept.forces[1]),
        friction: meeting.friction,
    };
    let friction_stiffness = stiffness.friction(f64::INFINITY);
    let anchored = kept.friction_across(&row.normal);
    if kept.friction_stiffness > 0.0 && friction_stiffness > 0.0 {
        let half = 0.5 * anchored.norm_squared();
        *restiffened += half * (1.0 / friction_stiffness - 1.0 / kept.friction_stiffness);
    }
    kept.is_parting &= row.distance < meeting.thickness;
    let gap = if kept.is_parting {
        row.gap.max(-PARTING * step.h)
    } else {
        row.gap
    };
    Contact {
        vertices: row.vertices,
        weights: row.weights,
        row: Row {
            normal: row.normal,
            gap,
            motion: row.motion,
            friction: meeting.friction,
            normal_stiffness: stiffness.normal(),
            friction_stiffness,
            carried: if kept.is_parting {
                0.0
            } else {
                carried(kept.forces, opening, step.h, stiffness.depth())
            },
            anchored,
        },
        sides: row.sides,
        thickness: meeting.thickness,
        is_impact: kept.forces[0] == 0.0 && -opening * step.h > stiffness.depth(),
        kept,
    }
}
