//! What the rows of contacts keep from step to step: forces, by the features that touch.
//!
//! A row is found again by its key: the vertex, edge or triangle on either side. A foot that moves on to a neighbouring
//! triangle has another key. Its row takes the forces of a row of the same vertex against the same part that is found no more,
//! of several the one with the nearest normal.

use super::row::Response;
use crate::Vec3;

/// Marks a place of a [`Key`] that has no number.
pub(super) const NONE: u32 = u32::MAX;

/// The features that touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key([u32; 6]);

impl Key {
    /// A vertex on a feature of a part or a shape: the vertices of a triangle or edge, or one vertex; none on a shape.
    pub(super) fn on(vertex: u32, side: u32, mut feature: [u32; 3]) -> Self {
        feature.sort_unstable();
        let [a, b, c] = feature;
        Self([0, vertex, side, a, b, c])
    }

    /// Two edges, or an edge and the end of a segment, or two such ends.
    pub(super) fn edges(one: [u32; 2], other: [u32; 2]) -> Self {
        let (first, second) = (one.min(other), one.max(other));
        Self([1, first[0], first[1], second[0], second[1], NONE])
    }

    /// The vertex and the side, of a vertex on a feature.
    fn vertex_and_side(&self) -> Option<[u32; 2]> {
        let [kind, vertex, side, ..] = self.0;
        (kind == 0).then_some([vertex, side])
    }
}

/// What a row keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kept {
    pub(super) key: Key,
    /// The normal forces of the last two steps (N), the latest first.
    pub forces: [f64; 2],
    /// The force of the friction spring (N), across the normal.
    pub friction: Vec3,
    /// The stiffness of the friction spring (N/m).
    pub friction_stiffness: f64,
    /// The normal.
    pub normal: Vec3,
    /// Number of steps in which the row has been kept.
    pub age: u32,
    /// Whether the sides overlapped at the birth of the row, and still do.
    pub is_parting: bool,
}

impl Kept {
    /// A row without forces.
    pub(super) fn new(key: Key, normal: Vec3, is_parting: bool) -> Self {
        Self {
            key,
            forces: [0.0; 2],
            friction: Vec3::zeros(),
            friction_stiffness: 0.0,
            normal,
            age: 0,
            is_parting,
        }
    }

    /// The friction force (N) across another normal: it keeps its size, and turns with the surface.
    pub(super) fn friction_across(&self, normal: &Vec3) -> Vec3 {
        let across = self.friction - normal * normal.dot(&self.friction);
        let length = across.norm();
        if length > 0.0 {
            across * (self.friction.norm() / length)
        } else {
            across
        }
    }

    /// Takes the response at the end of a step.
    pub(super) fn take(&mut self, response: &Response, friction_stiffness: f64) {
        self.forces = [response.normal, self.forces[0]];
        self.friction = response.friction;
        self.friction_stiffness = friction_stiffness;
        self.age = self.age.saturating_add(1);
    }
}

/// The kept rows, in the order of their keys.
#[derive(Debug, Default)]
pub(super) struct Store {
    kept: Vec<Kept>,
    is_taken: Vec<bool>,
}

impl Store {
    pub(super) fn with_capacity(most: usize) -> Self {
        Self {
            kept: Vec::with_capacity(most),
            is_taken: Vec::with_capacity(most),
        }
    }

    /// Gives each of the `wanted`, which are in the order of their keys, what has been kept of it.
    pub(super) fn recall(&mut self, wanted: &mut [Kept], is_found: &mut Vec<bool>) {
        self.is_taken.clear();
        self.is_taken.resize(self.kept.len(), false);
        is_found.clear();
        for row in &mut *wanted {
            let exact = self.kept.binary_search_by(|kept| kept.key.cmp(&row.key));
            is_found.push(exact.is_ok());
            if let Ok(at) = exact {
                self.is_taken[at] = true;
                recall(row, &self.kept[at]);
            }
        }
        for (row, is_found) in wanted.iter_mut().zip(is_found) {
            let Some(of) = row.key.vertex_and_side().filter(|_| !*is_found) else {
                continue;
            };
            let first = self
                .kept
                .partition_point(|kept| kept.key < Key([0, of[0], of[1], 0, 0, 0]));
            let rows = self.kept.iter().enumerate().skip(first);
            let same = rows.take_while(|(_, kept)| kept.key.vertex_and_side() == Some(of));
            let free = same.filter(|(at, _)| !self.is_taken[*at]);
            let along = |kept: &Kept| kept.normal.dot(&row.normal);
            let nearest = free.max_by(|(_, a), (_, b)| along(a).total_cmp(&along(b)));
            if let Some((at, kept)) = nearest.filter(|(_, kept)| along(kept) > 0.0) {
                self.is_taken[at] = true;
                *is_found = true;
                recall(row, kept);
            }
        }
    }

    /// Keeps the rows of a step, in the order of their keys.
    pub(super) fn keep(&mut self, rows: &[Kept]) {
        self.kept.clear();
        self.kept.extend_from_slice(rows);
    }
}

/// Gives a row the forces of a kept one.
fn recall(row: &mut Kept, kept: &Kept) {
    *row = Kept {
        key: row.key,
        normal: row.normal,
        is_parting: kept.is_parting,
        ..*kept
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(key: Key, normal: Vec3, force: f64) -> Kept {
        Kept {
            forces: [force, force],
            ..Kept::new(key, normal, false)
        }
    }

    #[test]
    fn a_foot_that_moves_on_takes_its_forces_along_once() {
        let mut store = Store::default();
        let on = |feature| Key::on(7, 2, feature);
        store.keep(&[
            row(on([1, 2, 3]), Vec3::z(), 1.0),
            row(on([4, 5, 6]), Vec3::x(), 2.0),
        ]);
        // The first foot has moved to a neighbour, the second one stands.
        let mut rows = [
            row(on([2, 3, 4]), Vec3::z(), 0.0),
            row(on([3, 4, 5]), Vec3::z(), 0.0),
            row(on([6, 5, 4]), Vec3::x(), 0.0),
        ];
        store.recall(&mut rows, &mut Vec::new());
        assert_eq!(rows.map(|row| row.forces[0]), [1.0, 0.0, 2.0]);
    }

    #[test]
    fn friction_turns_with_the_surface_and_keeps_its_size() {
        let kept = Kept {
            friction: Vec3::new(0.0, 3.0, 4.0),
            ..Kept::new(Key::edges([0, 1], [2, 3]), Vec3::x(), false)
        };
        let turned = kept.friction_across(&Vec3::z());
        assert!((turned - Vec3::new(0.0, 5.0, 0.0)).norm() < 1e-12);
        assert_eq!(Key::edges([0, 1], [2, 3]), Key::edges([2, 3], [0, 1]));
    }
}
